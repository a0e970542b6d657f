"""Range profiles and silhouettes together, beside each of them alone.

A template is a view, a ship at an aspect, for both sensors. Draw d pairs replicate d of the
profiles with phase d of the silhouettes, as many of the first as there are, over again where there
are fewer.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.classify.fusion import fit_sharpness, fuse, label_posterior
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.settings import Choices
from sweeps.engine.stage import Output, Stage, Table, stage
from sweeps.stages.acn_infrared import map_vectors
from sweeps.stages.classifier import NONE, STATE, Classifier, learned
from sweeps.stages.infrared import Infrared
from sweeps.stages.likelihood import Likelihood, Moments, check_receiver
from sweeps.stages.scores import tabulate_answers
from sweeps.stages.silhouettes import OF_SILHOUETTES
from sweeps.stages.views import INFRARED, RANGE, Grid, Sweep

Arrays = dict[str, NDArray[Any]]
Scores = NDArray[np.float64]

NAME = "fusion"
GROUP = "classification/fusion"
STATUS = "status_fusion"
CHANNELS = ("range", "infrared", "both")
LEAST_PHASES = 2
ANSWER = ("channel", "draw", "ship", "aspect")
DIMS = (
    *("pulse_width", "range", "target_free_ifovs", "channel", "gain_sigma", *OF_SILHOUETTES),
    *("super_resolution", "infrared_frame_count", "draw", "frame_count"),
)


def names_by_both(choices: Choices) -> bool:
    """Return whether fusion is chosen, and both sensors see every range of profiles."""
    return NAME in choices[Classifier.name] and sees_both(choices)


def sees_both(choices: Choices) -> bool:
    """Return whether both sensors see every range of profiles."""
    sensors = {RANGE, INFRARED} <= set(choices.one(Sweep.sensor))
    return sensors and set(choices[Grid.range]) <= set(choices[Infrared.range])


@stage(
    Output("profile_scores", ("view", "template"), "f8"),
    uses=(Grid, Likelihood),
    along=(Likelihood.gain_sigma, Grid.frame_count),
    gather=(Grid.ship, Grid.aspect),
)
def profile_scores(
    profile_moments: Moments,
    averaged: NDArray[np.float32],
    there: NDArray[np.bool_],
    gain_sigma: tuple[float, ...],
    frame_count: tuple[int, ...],
) -> Scores:
    """(gain_sigma, frame_count, view, template): log-likelihoods, NaN where a view is not there."""
    views, known = there.reshape(-1), profile_moments.there.reshape(-1)
    scores = np.full((len(gain_sigma), len(frame_count), views.size, views.size), np.nan)
    for f, count in enumerate(frame_count):
        logs = profile_moments.templates.log_likelihood(
            averaged[f][there], count, gain_sigma=gain_sigma
        )
        scores[:, f, views[:, None] & known] = logs.reshape(len(gain_sigma), -1)
    return scores


@stage(
    Output("silhouette_scores", ("phase", "view", "template"), "f4"),
    uses=(Infrared,),
    along=(Infrared.frame_count,),
    gather=(Infrared.phases, Grid.ship, Grid.aspect),
)
def silhouette_scores(
    template_log_polar: NDArray[np.uint8],
    log_polar: NDArray[np.uint8],
    there: NDArray[np.bool_],
    frame_count: tuple[int, ...],
) -> NDArray[np.float32]:
    """(frame_count, phase, view, template): cosines, NaN where a view is not there in all phases.

    See `similarity`.
    """
    views = there.all(axis=0).reshape(-1)
    templates = map_vectors(template_log_polar)[:, views]
    scores = np.full((len(frame_count), len(there), views.size, views.size), np.nan, np.float32)
    for f in range(len(frame_count)):
        seen = map_vectors(log_polar[f])[:, views]
        found = similarity(seen, templates)
        scores[f][:, np.outer(views, views)] = found.reshape(len(there), -1)
    return scores


@stage(
    Output("silhouette_sharpness", ("phase",), "f8"),
    uses=(Grid, Classifier),
    gather=(Grid.ship, Grid.aspect),
)
def silhouette_sharpness(
    silhouette_scores: NDArray[np.float32],
    ship: tuple[str, ...],
    aspect: tuple[float, ...],
    unknown: tuple[str, ...] | None,
    training_aspect: tuple[float, ...] | None,
) -> Scores:
    """(phase,): what a step of each silhouette's score is worth in log-probability.

    See `calibrate`.
    """
    taught = learned(ship, aspect, unknown, training_aspect)
    lessons = (taught.reshape(-1) & compared(silhouette_scores)).nonzero()[0]
    scores = silhouette_scores.astype(np.float64)[:, lessons[:, None], lessons]
    return calibrate(scores, lessons // len(aspect))


@stage(
    Output("predicted", ANSWER, "i2", label="ship named, as an index into the ship axis"),
    Output("correct", ANSWER, "i1", label="1 where the answer is right"),
    Output("probability", ANSWER, label="posterior probability of the true ship"),
    Output(
        "sharpness",
        ANSWER[:2],
        label="what a step of a sensor's score is worth in log-probability",
    ),
    Output(
        "cell",
        ANSWER,
        "i1",
        label=f"state of a cell of {NAME}",
        failed=0,
        group=STATUS,
        attrs=STATE,
    ),
    uses=(Grid, Classifier),
    gather=(Grid.replicate, Grid.ship, Grid.aspect),
    at={Infrared.range: Grid.range},
    names={Infrared.frame_count: "infrared_frame_count"},
    group=GROUP,
    dims=DIMS,
    when=names_by_both,
    status="-",
)
def fusion(
    profile_scores: Scores,
    silhouette_scores: NDArray[np.float32],
    silhouette_sharpness: Scores,
    ship: tuple[str, ...],
    aspect: tuple[float, ...],
    unknown: tuple[str, ...] | None,
    training_aspect: tuple[float, ...] | None,
) -> Arrays:
    """Name ships by profile, by silhouette and by both.

    Returns
    -------
    dict of str to ndarray
        predicted, correct, probability, cell : (channel, draw, ship, aspect); sharpness :
        (channel, draw) of range and infrared, NaN for both.

    Notes
    -----
    The score of a profile is its log-likelihood, which is worth what it says: its sharpness is 1.
    That of a silhouette is given the sharpness found on the silhouettes of the *other* phases.
    Then they are added. An empty silhouette says nothing: all its scores are 0.
    """
    seen = compared(profile_scores) & compared(silhouette_scores)
    taught = learned(ship, aspect, unknown, training_aspect)
    views, lessons = seen.nonzero()[0], (taught.reshape(-1) & seen).nonzero()[0]
    of_view, labels = views // len(aspect), lessons // len(aspect)
    draws = max(len(profile_scores), len(silhouette_scores))
    whole = (len(CHANNELS), draws, seen.size)
    named, true = np.full(whole, NONE), np.full(whole, np.nan)
    sharpness = np.full(whole[:2], np.nan)
    for d in range(draws):
        phase = d % len(silhouette_scores)
        alone = (
            profile_scores[d % len(profile_scores)][views[:, None], lessons],
            silhouette_scores[phase].astype(np.float64)[views[:, None], lessons],
        )
        worth = 1.0, float(silhouette_sharpness[phase])
        sharpness[:2, d] = worth
        answers = (
            fuse(alone[0], sharpness=worth[:1]),
            fuse(alone[1], sharpness=worth[1:]),
            fuse(*alone, sharpness=worth),
        )
        for c, answer in enumerate(answers):
            classes, posterior = label_posterior(answer, labels)
            named[c, d, views] = classes[posterior.argmax(axis=1)]
            # 0 for a ship that is not learned.
            true[c, d, views] = (posterior * (classes == of_view[:, None])).sum(axis=1)
    predicted = named.reshape(*whole[:2], *taught.shape)
    correct = np.where(predicted == NONE, NONE, predicted == np.indices(taught.shape)[0])
    return {
        "predicted": predicted,
        "correct": correct,
        "probability": true.reshape(predicted.shape),
        "sharpness": sharpness,
        "cell": np.where(correct >= 0, 1, 0),
    }


def number_draws(replicate: tuple[int, ...], phases: tuple[int, ...]) -> Arrays:
    """Return the channels, and the numbers of the draws."""
    return {"channel": np.array(CHANNELS), "draw": np.arange(max(len(replicate), len(phases)))}


def _draws_in(group: str, name: str) -> Stage:
    """Declare the coordinates of a group."""
    declared = stage(
        Output("channel", ("channel",), "U8", label="sensor that names the ship"),
        Output("draw", ("draw",), "i8", label="number of the pair of a replicate and a phase"),
        uses=(Grid, Infrared),
        gather=(Grid.replicate, Infrared.phases),
        group=group,
        when=names_by_both,
        coordinates=True,
        name=name,
    )
    return declared(number_draws)


fusion_draws = _draws_in(GROUP, "fusion_draws")
fusion_states = _draws_in(STATUS, "fusion_states")


def compared(scores: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Return which views have scores in every draw, (view,) of (draw, view, template) scores."""
    there: NDArray[np.bool_] = np.isfinite(scores).any(axis=-1).all(axis=0)
    return there


def similarity(
    silhouettes: NDArray[np.float32], templates: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Compare silhouettes with templates in all phases but their own.

    No observer would have the template of the silhouette's own place on the detector on file.

    Parameters
    ----------
    silhouettes, templates : (phase, view, feature) float32 ndarray
        Maps of two phases or more.

    Returns
    -------
    (phase, view, template) float32 ndarray
        Largest cosine to a template over the other phases.
    """
    phases, views, features = templates.shape
    known = _directions(templates)
    best = np.empty((phases, silhouettes.shape[1], views), dtype=np.float32)
    for phase, seen in enumerate(_directions(silhouettes)):
        others = known[np.arange(phases) != phase].reshape(-1, features)
        best[phase] = (seen @ others.T).reshape(-1, phases - 1, views).max(axis=1)
    return best


def _directions(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    norm = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))[..., None]
    return np.asarray(vectors / np.where(norm > 0, norm, np.float32(1)), dtype=np.float32)


def calibrate(scores: Scores, ship: NDArray[np.intp]) -> Scores:
    """Find the sharpness of every phase's scores on those of the other phases.

    Parameters
    ----------
    scores : (phase, view, template) float64 ndarray
        Of two phases or more.
    ship : (view,) intp ndarray
        Ship of each view, and of each template.

    Returns
    -------
    (phase,) float64 ndarray
        See `ncti.classify.fit_sharpness`.
    """
    phases = len(scores)
    found = np.empty(phases)
    for phase in range(phases):
        pooled = scores[np.arange(phases) != phase].reshape(-1, scores.shape[-1])
        found[phase] = fit_sharpness(pooled, ship, np.tile(ship, phases - 1))
    return found


def check(choices: Choices) -> Choices:
    """Refuse what one sensor would see and the other would not, where fusion is asked for alone.

    Among other classifiers it is left out then.

    Raises
    ------
    ConfigurationError
        Naming the key.
    """
    if choices[Classifier.name] == (NAME,):
        _check_sensors(choices)
    if names_by_both(choices):
        phases = len(choices[Infrared.phases])
        if phases < LEAST_PHASES:
            raise ConfigurationError(
                f"infrared.phases is {phases}, but must be at least {LEAST_PHASES} for the "
                f"classifier {NAME}, which weighs the silhouettes of one by those of others"
            )
        check_receiver(choices, NAME)
    return choices


def _check_sensors(choices: Choices) -> None:
    sensors = choices.one(Sweep.sensor)
    if not {RANGE, INFRARED} <= set(sensors):
        raise ConfigurationError(
            f"sensor is {', '.join(sensors)!r}, but must be both for the classifier {NAME}"
        )
    there = choices[Infrared.range]
    for slant_range in choices[Grid.range]:
        if slant_range not in there:
            raise ConfigurationError(
                f"grid.range has {slant_range:g}, but every value must be one of "
                f"{', '.join(f'{one:g}' for one in there)}, the values of infrared.range, for "
                f"the classifier {NAME}"
            )


STAGES: tuple[Stage, ...] = (
    *(profile_scores, silhouette_scores, silhouette_sharpness),
    *(fusion, fusion_draws, fusion_states),
)
TABLES = (Table(f"tables/{NAME}", (GROUP,), tabulate_answers, names_by_both),)
