"""Back-propagation through one growing hidden layer of nodes with individual gains."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

MOMENTUM = 0.9  # share of the last step in the next one
GAIN_FACTOR = (0.1, 10.0)  # bounds of the learned gain of a node relative to the gain level

Floats = NDArray[np.float64]


@dataclass
class Layer:
    """Layer of nodes that share their inputs.

    `weights` w (node, input), `offsets` theta (node,) and `factors` (node,), gains beta over the
    gain level.
    """

    weights: Floats
    offsets: Floats
    factors: Floats

    def answers(self, inputs: Floats, level: float) -> Floats:
        """Return the (sample, node) outputs tanh(beta (w.x + theta) / 2)."""
        return np.tanh((inputs @ self.weights.T + self.offsets) * (level / 2 * self.factors))

    def back_propagate(
        self, inputs: Floats, answers: Floats, errors: Floats, level: float
    ) -> tuple[Layer, Floats]:
        """Return the gradient of a loss with respect to the layer's parameters and net inputs w.x.

        The latter is (sample, node), like the outputs `answers`, and `errors`, the derivatives of
        the loss with respect to the outputs.
        """
        slopes = errors * ((1.0 - answers) * (1.0 + answers)) * (level / 2)
        net = slopes * self.factors
        weights = net.T @ inputs
        # The gradient in the gains is the sum over samples of slope (w.x + theta), here from the
        # gradients in weights and offsets.
        offsets = net.sum(axis=0)
        along = np.einsum("ni,ni->n", weights, self.weights) + offsets * self.offsets
        return Layer(weights, offsets, along / self.factors), net


class Network:
    """Growing hidden layer and output layer, with the momentum terms of both."""

    def __init__(self, hidden: Layer, output: Layer) -> None:
        self.hidden, self.output = hidden, output
        self.velocities = [
            Layer(*(np.zeros_like(array) for array in astuple(layer))) for layer in (hidden, output)
        ]

    @classmethod
    def seed(cls, n_inputs: int, n_outputs: int, random: np.random.RandomState) -> Network:
        """Return a network with one hidden node, with zero weights to the outputs."""
        hidden = Layer(*_draw_node(n_inputs, random), np.ones(1))
        output = Layer(np.zeros((n_outputs, 1)), np.zeros(n_outputs), np.ones(n_outputs))
        return cls(hidden, output)

    def grow(self, random: np.random.RandomState) -> None:
        """Add a hidden node with zero weights to the outputs."""
        weights, offsets = _draw_node(self.hidden.weights.shape[1], random)
        node = Layer(weights, offsets, np.ones(1))
        rest = Layer(np.zeros_like(weights), np.zeros(1), np.zeros(1))
        for (hidden, output), new in (
            ((self.hidden, self.output), node),
            (self.velocities, rest),
        ):
            hidden.weights = np.concatenate([hidden.weights, new.weights])
            hidden.offsets = np.append(hidden.offsets, new.offsets)
            hidden.factors = np.append(hidden.factors, new.factors)
            output.weights = np.pad(output.weights, ((0, 0), (0, 1)))

    def loss_and_gradient(
        self, inputs: Floats, targets: Floats, level: float
    ) -> tuple[float, tuple[Layer, Layer]]:
        """Return the mean square error of the outputs, and the gradient for the next step.

        The gradient is of half the squared error, summed over outputs and averaged over samples,
        so that the step does not depend on the number of classes.
        """
        middle = self.hidden.answers(inputs, level)
        answers = self.output.answers(middle, level)
        errors = answers - targets
        output, net = self.output.back_propagate(middle, answers, errors / len(inputs), level)
        hidden, _ = self.hidden.back_propagate(inputs, middle, net @ self.output.weights, level)
        return float(np.mean(errors**2)), (hidden, output)

    def step(self, gradient: tuple[Layer, Layer], learning_rate: float) -> None:
        """Take a step against the gradient, with momentum, and keep the gains within bounds."""
        for layer, velocity, slope in zip(
            (self.hidden, self.output), self.velocities, gradient, strict=True
        ):
            for name in ("weights", "offsets", "factors"):
                speed = getattr(velocity, name)
                speed *= MOMENTUM
                speed -= learning_rate * getattr(slope, name)
                parameter = getattr(layer, name)
                parameter += speed
            np.clip(layer.factors, *GAIN_FACTOR, out=layer.factors)


def _draw_node(n_inputs: int, random: np.random.RandomState) -> tuple[Floats, Floats]:
    """Return random (1, input) weights and a (1,) offset of a new node.

    The offset must not be zero: a node without offset is odd in its inputs, and on data symmetric
    about zero it would never learn an even function.
    """
    parameters = random.uniform(-1.0, 1.0, (1, n_inputs + 1)) / np.sqrt(n_inputs)
    return parameters[:, :-1], parameters[:, -1]
