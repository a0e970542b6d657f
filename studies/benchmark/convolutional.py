"""Convolutional network of one dimension, by PyTorch: the extra ``torch``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from numbers import Integral
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils import check_random_state
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, validate_data

from ncti.classify.blocks import row_blocks
from ncti.classify.constraints import Interval, fit_context

if TYPE_CHECKING:
    import torch

CHANNELS = (16, 32, 64)  # of the layers, each of which halves the number of bins
KERNEL = 9  # bins
PLACES = 8  # along the profile, at which the last layer is averaged
BATCH = 64  # rows of a step
RATE, DECAY = 2e-3, 1e-2  # largest learning rate, and weight decay
WARM_UP = 0.3  # part of the steps in which the learning rate rises

Floats = NDArray[np.float64]


class ConvolutionalNetwork(ClassifierMixin, BaseEstimator):
    """Classify profiles by a small convolutional network, trained for `epochs` on shifted copies.

    Three layers of 16, 32 and 64 convolutions over nine bins, each with a stride of two bins, batch
    normalisation (Ioffe and Szegedy, PMLR 37, 448 (2015)) and a rectifier; the mean of the last one
    in eighths of the profile, which keeps the place of a feature along the ship; and a linear
    layer. Adam with decoupled weight decay (Loshchilov and Hutter, ICLR 2019) trains it, at a
    learning rate that rises and falls once; each presentation shifts a profile by up to `shift`
    bins, repeating its edge. One thread computes and numpy draws: a seed gives the same answers, to
    the bit, wherever library and processor are the same.
    """

    _parameter_constraints: ClassVar[dict] = {
        "epochs": [Interval(Integral, 1, None, closed="left")],
        "shift": [Interval(Integral, 0, None, closed="left")],
        "random_state": ["random_state"],
    }

    def __init__(
        self,
        *,
        epochs: int = 30,
        shift: int = 2,
        random_state: int | np.random.RandomState | None = None,
    ) -> None:
        self.epochs = epochs
        self.shift = shift
        self.random_state = random_state

    @fit_context(prefer_skip_nested_validation=True)
    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Train the network on X (sample, feature) and labels y (sample,), an output each."""
        vectors, labels = validate_data(self, X, y, dtype=np.float64)
        check_classification_targets(labels)
        self.classes_, label = np.unique(labels, return_inverse=True)
        self.centre_, self.scale_ = float(vectors.mean()), float(vectors.std()) or 1.0
        random = check_random_state(self.random_state)
        with limit_to_one_thread() as torch:
            self.network_ = _build_network(len(self.classes_), random)
            padded = np.pad(self._inputs(vectors), ((0, 0), (self.shift, self.shift)), "edge")
            self.loss_curve_ = self._train(padded, torch.from_numpy(label), random)
        return self

    def predict_proba(self, X: ArrayLike) -> Floats:
        """Return (sample, class) probabilities of X (sample, feature), ordered as `classes_`."""
        check_is_fitted(self)
        vectors = validate_data(self, X, dtype=np.float64, reset=False)
        inputs = self._inputs(vectors)
        likely = np.empty((len(inputs), len(self.classes_)))
        with limit_to_one_thread() as torch, torch.no_grad():
            for rows in row_blocks(len(inputs)):
                outputs = self.network_(torch.from_numpy(inputs[rows])[:, None])
                likely[rows] = torch.softmax(outputs.double(), 1).numpy()
        return likely

    def predict(self, X: ArrayLike) -> NDArray:
        """Return the most probable (sample,) labels; of equals, the first in `classes_`."""
        best = self.predict_proba(X).argmax(axis=1)
        return self.classes_[best]

    def _inputs(self, vectors: Floats) -> NDArray[np.float32]:
        """Return the inputs of the network."""
        return ((vectors - self.centre_) / self.scale_).astype(np.float32)

    def _train(
        self, padded: NDArray[np.float32], label: torch.Tensor, random: np.random.RandomState
    ) -> list[float]:
        """Train the network on shifts of (sample, feature) inputs, and return the losses."""
        import torch

        count, width = len(padded), padded.shape[1] - 2 * self.shift
        steps = self.epochs * len([*row_blocks(count, BATCH)])
        optimizer = torch.optim.AdamW(self.network_.parameters(), lr=RATE, weight_decay=DECAY)
        schedule = torch.optim.lr_scheduler.OneCycleLR(
            optimizer, RATE, total_steps=steps, pct_start=WARM_UP
        )
        losses = []
        self.network_.train()
        for _ in range(self.epochs):
            order, total_loss = random.permutation(count), 0.0
            for rows in (order[block] for block in row_blocks(count, BATCH)):
                starts = random.randint(2 * self.shift + 1, size=len(rows))
                inputs = padded[rows[:, None], starts[:, None] + np.arange(width)]
                outputs = self.network_(torch.from_numpy(inputs)[:, None])
                loss = torch.nn.functional.cross_entropy(outputs, label[torch.from_numpy(rows)])
                optimizer.zero_grad()
                loss.backward()
                optimizer.step()
                schedule.step()
                total_loss += len(rows) * loss.item()
            losses.append(total_loss / count)
        self.network_.eval()
        return losses


def _build_network(classes: int, random: np.random.RandomState) -> torch.nn.Sequential:
    """Build a network whose weights numpy draws from torch's default distribution."""
    from torch import from_numpy, nn, no_grad
    from torch.nn.utils import skip_init

    layers: list[nn.Module] = []
    for before, channels in zip((1, *CHANNELS), CHANNELS, strict=False):
        size: dict[str, Any] = {"stride": 2, "padding": KERNEL // 2}
        convolution = skip_init(nn.Conv1d, before, channels, KERNEL, **size)
        layers += [convolution, nn.BatchNorm1d(channels), nn.ReLU()]
    linear = skip_init(nn.Linear, PLACES * CHANNELS[-1], classes)
    network = nn.Sequential(*layers, nn.AdaptiveAvgPool1d(PLACES), nn.Flatten(), linear)
    with no_grad():
        for layer in network:
            if isinstance(layer, nn.Conv1d | nn.Linear):
                bound = layer.weight[0].numel() ** -0.5
                for values in (layer.weight, layer.bias):
                    drawn = random.uniform(-bound, bound, tuple(values.shape))
                    values.copy_(from_numpy(drawn))
    return network


@contextmanager
def limit_to_one_thread() -> Iterator[Any]:
    """Yield torch, limited to one thread meanwhile."""
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield torch
    finally:
        torch.set_num_threads(before)
