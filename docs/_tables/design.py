"""The article's statements on the design of its sensors, beside its own tables and simulation."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from sklearn.exceptions import ConvergenceWarning
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]  # of scikit-learn

import ncti.ships
from benchmarks.classifiers import SHIPS, SIGNAL, SLANT_RANGE, Task, source_task
from benchmarks.reports import Column, Report
from benchmarks.views import DEPRESSION
from ncti.classify import CorrelationNeighbour, GainAnnealedNetwork
from ncti.features import profile_vector
from ncti.infrared import contrast, snr
from ncti.ladar import (
    RangeExtent,
    expected_profile,
    power_ratio,
    range_extent,
    sample_frames,
)
from ncti.ladar.pulse import SPEED_OF_LIGHT, Pulse, noise_by_lag
from ncti.render import line_image

FRAMES = 4000
RANDOM_STATES = 20
MAX_EPOCHS = 3000  # epochs
SIDE, OTHER_SIDE = 15.0, 18.0  # sides of an IFOV at 100 km [m]
AVERAGED_FRAMES = 16

Floats = NDArray[np.float64]


def passive_ratio() -> list[tuple[str, str, str]]:
    """Compare the passive sensor's ratio of 32 dB at 100 km with the article's Table 1."""
    ours = float(snr(SLANT_RANGE))
    # The ratio is one of powers, the square of contrast over noise.
    noise = contrast(SLANT_RANGE) / math.sqrt(ours)
    stated_contrast = math.sqrt(power_ratio(32)) * noise
    at_zero = stated_contrast * contrast(0.0) / contrast(SLANT_RANGE)
    return [
        (
            "SNR of the passive sensor at 100 km, 16 frames",
            "32 dB; 7.2 in its Table 1, which is 8.6 dB",
            f"{10 * math.log10(ours):.1f} dB",
        ),
        (
            f"contrast that 32 dB need with {noise:.1f} K of noise, at 100 km and without air",
            "0.27 K at 100 km in its Table 1",
            f"{stated_contrast:.1f} K, {at_zero:.0f} K",
        ),
    ]


def precision(*, cnr: float, pulse_width: float) -> float:
    """Return the scale of the error of a surface's range in one frame [m].

    Notes
    -----
    The signal a g(z - x) and the correlation of the noise have one shape,
    g = exp(-8 z^2 / (c T)^2), because the filter is matched to the pulse; with the variance s^2 of
    a quadrature the Fisher information is |a|^2 / s^2 times -g''(0) = 16 / (c T)^2, whether a is
    known or not. Speckle makes |a|^2 exponential with mean 2 CNR / N_z. Over frames a normal error
    of variance d^2 / E, E exponential, is d times a Student's t of two degrees of freedom, with
    d = c T / 4 sqrt(s^2 N_z / (2 CNR)).
    """
    length = SPEED_OF_LIGHT * pulse_width
    bins = length / math.sqrt(2)  # N_z of bins of 1 m
    variance = float(noise_by_lag(Pulse(pulse_width, 1.0), 1)[0])
    return length / 4 * math.sqrt(variance * bins / (2 * cnr))


def range_errors(
    *, cnr: float, pulse_width: float, frames: int, rng: np.random.Generator
) -> Floats:
    """Return the (frame,) errors of the range of a surface that fills an IFOV [m].

    The peak of a frame is found by a parabola through the logarithms of its three highest bins:
    the peak behind a matched filter is the estimate of maximum likelihood.
    """
    fraction = np.zeros((1, 81))
    fraction[0, 40] = 1.0
    centres: Floats = np.arange(-40.0, 41.0)
    extent = RangeExtent(fraction, centres, 1.0, np.zeros((1, 2), int), 150e-6, SLANT_RANGE)
    samples = sample_frames(extent, pulse_width=pulse_width, cnr=cnr, frame_count=frames, rng=rng)
    peak = np.clip(samples.argmax(axis=1), 1, 79)
    low, top, high = (np.log(samples[np.arange(frames), peak + k]) for k in (-1, 0, 1))
    return centres[peak] + (low - high) / 2 / (low - 2 * top + high)


def range_precision(frames: int = FRAMES) -> list[tuple[str, str, str]]:
    """Compare the range precision of 1 m at 30 ns and 32 dB with simulated frames."""
    setting = {"cnr": power_ratio(32), "pulse_width": 30e-9}
    off = np.abs(range_errors(**setting, frames=frames, rng=np.random.default_rng(0)))
    # Quantiles of Student's t with two degrees of freedom.
    share = 0.68
    bound = precision(**setting) * share * math.sqrt(2 / (1 - share**2))
    return [
        (
            "range precision at 30 ns and 32 dB, one frame of one IFOV",
            "1 m",
            f"{np.quantile(off, share):.2f} m in 68 % of frames (bound {bound:.2f} m), "
            f"within 0.5 m in {100 * (off < 0.5).mean():.1f} %",
        )
    ]


def epochs_to_tolerance(task: Task, states: int = RANDOM_STATES) -> tuple[Floats, Floats]:
    """Return epochs to the tolerance of (state,) networks with annealing, and without."""
    with threadpool_limits(1), warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        epochs = [
            [
                GainAnnealedNetwork(annealing=way, epochs=MAX_EPOCHS, random_state=state)
                .fit(task.training, task.label)
                .n_iter_
                for state in range(states)
            ]
            for way in (True, False)
        ]
    annealed, constant = np.array(epochs, dtype=np.float64)
    return annealed, constant


def annealing(task: Task | None = None, states: int = RANDOM_STATES) -> list[tuple[str, str, str]]:
    """Compare the epochs that training takes with annealing of the gains and without."""
    from scipy import stats

    annealed, constant = epochs_to_tolerance(source_task() if task is None else task, states)
    ratio = np.log(annealed / constant)
    half = stats.t.ppf(0.975, states - 1) * ratio.std(ddof=1) / math.sqrt(states)
    low, mean, high = np.exp(ratio.mean() + half * np.array([-1, 0, 1]))
    return [
        (
            "epochs to the tolerance with gain annealing, and without",
            "much faster",
            f"{annealed.mean():.0f} and {constant.mean():.0f}, "
            f"{mean:.2f} [{low:.2f}-{high:.2f}] times as many",
        )
    ]


def pixels(
    ships: Sequence[str] = SHIPS, aspects: Sequence[float] = tuple(range(0, 91, 6))
) -> list[tuple[str, str, str]]:
    """Compare range profiles of pixels of 18 m at 100 km with those of 15 m."""
    rng = np.random.default_rng(0)
    templates: dict[float, list[Floats]] = {SIDE: [], OTHER_SIDE: []}
    answers: dict[float, list[Floats]] = {SIDE: [], OTHER_SIDE: []}
    for ship in ships:
        for aspect in aspects:
            view = line_image(ncti.ships.load(ship), aspect=aspect, depression=DEPRESSION)
            for side in (SIDE, OTHER_SIDE):
                extent = range_extent(view, slant_range=SLANT_RANGE, ifov=side / SLANT_RANGE)
                templates[side].append(profile_vector(expected_profile(extent, **SIGNAL)))
                frames = sample_frames(extent, frame_count=AVERAGED_FRAMES, rng=rng, **SIGNAL)
                answers[side].append(profile_vector(frames.mean(axis=0)))
    similarity = [np.corrcoef(*pair)[0, 1] for pair in zip(*templates.values(), strict=True)]
    number = np.repeat(np.arange(len(ships)), len(aspects))

    def score(learned: float, tested: float) -> float:
        """Return the percentage of averages of one size named right by templates of another."""
        nearest = CorrelationNeighbour().fit(templates[learned], number)
        return float(100 * (nearest.predict(answers[tested]) == number).mean())

    return [
        (
            "range profiles of IFOVs of 18 m at 100 km: correlation with those of 15 m; averages "
            f"of {AVERAGED_FRAMES} frames named right",
            "15 m, and once 18 m",
            f"median {np.median(similarity):.3f}, least {min(similarity):.3f}; "
            f"{score(OTHER_SIDE, OTHER_SIDE):.0f} % ({score(SIDE, OTHER_SIDE):.0f} % by templates "
            f"of 15 m), {score(SIDE, SIDE):.0f} % at 15 m",
        )
    ]


def measure() -> Report:
    """Return the article's statements on design beside its tables and our simulation."""
    rows = [*passive_ratio(), *range_precision(), *annealing(), *pixels()]
    return Report(
        "The article's statements on the design of its sensors",
        (Column("what", "what"), Column("source", "article"), Column("ours", "ours")),
        [dict(zip(("what", "source", "ours"), row, strict=True)) for row in rows],
        [
            f"Range: {FRAMES} frames; the bound is that of Cramér and Rao over the fading of "
            "speckle, a Student's t of two degrees of freedom. Epochs: means of "
            f"{RANDOM_STATES} random states, and their paired ratio with its 95 % interval. "
            "Profiles of IFOVs: four ships every 6 degrees."
        ],
    )
