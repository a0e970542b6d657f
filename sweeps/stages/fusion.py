"""Fusion of range profiles and silhouettes, beside each of them alone.

A template is a view, a ship at an aspect, for both sensors. Draw d pairs replicate d of the
profiles with phase d of the silhouettes, cyclically if there are fewer profiles.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ncti.classify.blocks import row_blocks
from ncti.classify.fusion import fuse, label_posterior, similarity_between_phases, with_outliers
from sweeps.engine.settings import Choices
from sweeps.engine.stage import At, Output, Stream, coordinate, stage
from sweeps.stages import classifier
from sweeps.stages.classifier import GATHERED, NONE, Classifier, Views
from sweeps.stages.infrared import OF_SILHOUETTES, Infrared
from sweeps.stages.ladar import Ladar
from sweeps.stages.likelihood import Likelihood
from sweeps.stages.views import INFRARED, RANGE, Arrays, Floats, Grid, Sweep, refuse, require_among

if TYPE_CHECKING:
    from ncti.classify.likelihood import GaussianTemplates

NAME = "fusion"
CHANNELS = ("range", "infrared", "both")
LEAST_PHASES = 2
OF_DRAWS = ("channel", "draw")


def names_by_both(choices: Choices) -> bool:
    """Return whether fusion is chosen, and both sensors see every range of profiles."""
    sensors = {RANGE, INFRARED} <= set(choices.one(Sweep.sensor))
    ranges = set(choices[Grid.range]) <= set(choices[Infrared.range])
    return NAME in choices[Classifier.name] and sensors and ranges


@stage(
    Output("silhouette_scores", ("phase", "view", "template"), "f4"),
    uses=(Infrared,),
    along=(Infrared.frame_count,),
    gather=(Infrared.subpixel_offsets, *GATHERED),
)
def silhouette_scores(
    template_log_polar: NDArray[np.uint8],
    log_polar: NDArray[np.uint8],
    valid: Views,
    training_views: Views,
) -> NDArray[np.float32]:
    """Return (frame_count, phase, view, template) cosines, NaN of views missing in any phase.

    A template is a learned view that is there. See
    `ncti.classify.fusion.similarity_between_phases`.
    """
    views = valid.all(axis=0).reshape(-1)
    present, learned = views.nonzero()[0], (views & training_views.reshape(-1)).nonzero()[0]
    # Compared with all views, as rounding of single precision depends on their number.
    templates = classifier.map_vectors(template_log_polar)[:, present]
    columns = np.searchsorted(present, learned)
    shape = len(log_polar), len(valid), views.size, learned.size
    scores = np.full(shape, np.nan, np.float32)
    for of_count, maps in zip(scores, log_polar, strict=True):
        seen = maps.reshape(len(maps), 1, -1, *maps.shape[-2:])
        for rows in row_blocks(len(present)):
            vectors = classifier.map_vectors(seen[:, :, present[rows]])
            cosines = similarity_between_phases(vectors, templates)
            of_count[:, present[rows]] = cosines[..., columns]
    return scores


@stage(Output("silhouette_constants", ("constant", "phase"), "f8"))
def silhouette_constants(silhouette_scores: NDArray[np.float32], training_views: Views) -> Floats:
    """Return the (constant, phase) inverse temperature and outlier fraction of silhouettes.

    See `ncti.classify.calibration.fit_held_out_phases`.
    """
    # Imported here because scikit-learn takes a second.
    from ncti.classify.calibration import fit_held_out_phases

    training_set = (training_views.reshape(-1) & compared(silhouette_scores)).nonzero()[0]
    # Rows and columns together, which decides the order in memory, and so that of sums.
    scores = silhouette_scores[:, training_set[:, None], np.arange(training_set.size)]
    return fit_held_out_phases(scores, *np.divmod(training_set, training_views.shape[1]))


@stage(
    Output("profile_outlier_fraction", ("view",), "f8"),
    uses=(Grid, Likelihood),
    along=(Grid.frame_count,),
    # Of its first name, so that it draws as it always did.
    stream=Stream((Grid.pulse_width, Grid.range, Ladar.target_free_ifovs), "profile_doubt"),
)
def profile_outlier_fraction(
    profile_templates: tuple[GaussianTemplates, Views],
    gain_sigma: float,
    frame_count: tuple[int, ...],
    rng: np.random.Generator,
) -> Floats:
    """Return (frame_count, view) outlier fractions of profiles.

    See `ncti.classify.calibration.fit_outlier_fraction`; NaN for views that are not learned.
    """
    # Imported here because scipy takes a second.
    from ncti.classify.calibration import fit_outlier_fraction

    templates, known = profile_templates
    seed = int(rng.integers(2**63))
    outlier_fraction = np.full((len(frame_count), known.size), np.nan)
    for of_count, count in zip(outlier_fraction, frame_count, strict=True):
        drawn = np.random.default_rng(seed)
        fraction = fit_outlier_fraction(templates, count, drawn, gain_sigma=gain_sigma)
        of_count[known.reshape(-1)] = fraction
    return outlier_fraction


ANSWERS = classifier.ClassifierGroup.of(
    NAME,
    names_by_both,
    (
        *(*classifier.OF_PROFILES, "channel", "gain_sigma", *OF_SILHOUETTES, "super_resolution"),
        *("infrared_frame_count", "ifov_phase", "draw", "frame_count"),
    ),
    names={Infrared.frame_count: "infrared_frame_count"},
    answer=(*OF_DRAWS, *classifier.VIEW),
)


@ANSWERS.answers(
    Output("probability", ANSWERS.answer, label="posterior probability of the true ship"),
    # Of both sensors the first is that of silhouettes, the second that of profiles.
    Output(
        "inverse_temperature",
        OF_DRAWS,
        label="log-probability of a unit of a sensor's score; of both: that of silhouettes",
    ),
    Output(
        "outlier_fraction",
        OF_DRAWS,
        label="probability that a sensor is uninformative, the mean over templates; of both: that "
        "of profiles",
    ),
    uses=(Grid,),
    gather=(Grid.replicate, *GATHERED),
    reads={
        name: At(name, {Infrared.range: Grid.range})
        for name in ("silhouette_scores", "silhouette_constants")
    },
)
def fusion(
    profile_scores: Floats,
    silhouette_scores: NDArray[np.float32],
    silhouette_constants: Floats,
    profile_outlier_fraction: Floats,
    training_views: Views,
    ship: tuple[str, ...],
    aspect: tuple[float, ...],
) -> Arrays:
    """Return the ships predicted by profile, by silhouette and by both.

    The score of a profile is its log-likelihood, taken as it is: its inverse temperature is 1. That
    of a silhouette is given the inverse temperature found on the silhouettes of the *other* phases.
    For both, they are added, each with its outlier fraction: neither outweighs the other by more
    than answers about learned views support. An empty silhouette carries no information: all its
    scores are 0.
    """
    of_both = compared(profile_scores), compared(silhouette_scores)
    # Templates of each sensor, of which those of both are compared.
    templates = np.isfinite(profile_outlier_fraction), training_views.reshape(-1) & of_both[1]
    seen = np.logical_and(*of_both)
    views = seen.nonzero()[0]
    training_set = (np.logical_and(*templates) & seen).nonzero()[0]
    columns = [np.searchsorted(own.nonzero()[0], training_set) for own in templates]
    draws = max(len(profile_scores), len(silhouette_scores))
    whole = (len(CHANNELS), draws, len(ship), len(aspect))
    valid = seen.reshape(whole[2:])
    named, probability = np.full(whole, NONE), np.full(whole, np.nan)
    inverse_temperature, outlier_fraction = np.full((2, *whole[:2]), np.nan)
    of_ship, of_profiles = training_set // len(aspect), profile_outlier_fraction[training_set]
    for d in range(draws):
        phase = d % len(silhouette_scores)
        factor, of_silhouettes = silhouette_constants[:, phase]
        inverse_temperature[:, d] = 1.0, factor, factor
        outlier_fraction[:, d] = of_profiles.mean(), of_silhouettes, of_profiles.mean()
        for rows in row_blocks(len(views)):
            profile = profile_scores[d % len(profile_scores)][views[rows, None], columns[0]]
            silhouette = silhouette_scores[phase][views[rows, None], columns[1]]
            silhouette = factor * silhouette.astype(np.float64)
            silhouette = with_outliers(silhouette, of_ship, outlier_fraction=of_silhouettes)
            certain = with_outliers(profile, of_ship, outlier_fraction=of_profiles)
            both = fuse(certain, silhouette, inverse_temperature=(1.0, 1.0))
            true, column = np.divmod(views[rows], len(aspect))
            for c, scores in enumerate((profile, silhouette, both)):
                at = c, d, true, column
                posterior = label_posterior(scores, of_ship)
                named[at], probability[at] = classifier.most_probable(posterior, true)
    return classifier.judged(named, valid) | {
        "probability": probability,
        "inverse_temperature": inverse_temperature,
        "outlier_fraction": outlier_fraction,
    }


def draws_of(replicate: tuple[int, ...], subpixel_offsets: tuple[int, ...]) -> Arrays:
    """Return the channels and the numbers of the draws."""
    draws = max(len(replicate), len(subpixel_offsets))
    return {"channel": np.array(CHANNELS), "draw": np.arange(draws)}


fusion_draws = ANSWERS.coordinates(
    coordinate("channel", ("channel",), "U8", label="sensor that identifies the ship"),
    coordinate("draw", ("draw",), "i8", label="number of the pair of a replicate and a phase"),
    uses=(Grid, Infrared),
    gather=(Grid.replicate, Infrared.subpixel_offsets),
)(draws_of)


def compared(scores: NDArray[np.floating]) -> Views:
    """Return the (view,) mask of views with (draw, view, template) scores in every draw."""
    valid: Views = np.isfinite(scores).any(axis=-1).all(axis=0)
    return valid


def check(choices: Choices) -> Choices:
    """Refuse ranges that only one sensor sees, where fusion is the only classifier.

    Among other classifiers it is left out then.
    """
    if choices[Classifier.name] == (NAME,):
        sensors, reason = choices.one(Sweep.sensor), f"for the classifier {NAME}"
        if not {RANGE, INFRARED} <= set(sensors):
            refuse(Sweep.sensor, repr(", ".join(sensors)), f"both {reason}")
        require_among(choices, Grid.range, Infrared.range, f", {reason}")
    if names_by_both(choices):
        offsets = len(choices[Infrared.subpixel_offsets])
        if offsets < LEAST_PHASES:
            reason = f"the classifier {NAME} weighs the silhouettes of one by those of others"
            refuse(Infrared.subpixel_offsets, offsets, f"at least {LEAST_PHASES}: {reason}")
        classifier.check_receiver(choices, NAME)
    return choices


TABLES = ANSWERS.tables(labels={"classifier": NAME})
