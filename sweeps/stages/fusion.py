"""Fusion of range profiles and silhouettes, and identification by each alone.

A template is a view, a ship at an aspect, for both sensors. Draw d pairs replicate d of the
profiles with phase d of the silhouettes; the one with fewer values repeats cyclically.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ncti.classify.blocks import HELD_ROWS, ROWS, row_blocks
from ncti.classify.fusion import add_outliers, fuse, label_posterior, similarity_between_phases
from sweeps.engine.declare.settings import Choices
from sweeps.engine.declare.stage import At, Output, Stream, coordinate, stage
from sweeps.stages import classifier
from sweeps.stages.classifier import GATHERED, NO_ANSWER, Classifier, Indices, Integers, Mask
from sweeps.stages.infrared import OF_SILHOUETTES, Infrared
from sweeps.stages.ladar import Ladar
from sweeps.stages.likelihood import Likelihood, Prior
from sweeps.stages.refusals import refuse, require_among
from sweeps.stages.views import INFRARED, RANGE, Arrays, Floats, Grid, Profiles, Sweep

if TYPE_CHECKING:
    from ncti.classify.likelihood import GaussianTemplates

NAME = "fusion"
CHANNELS = ("range", "infrared", "both")
MIN_PHASES = 2
OF_DRAWS = ("channel", "draw")
# Settings that silhouettes depend on besides the range; templates depend on the last two.
LOOKS = (
    *(Infrared.frame_count, Infrared.super_resolution, Infrared.segmentation),
    *(Infrared.inner_radius, Infrared.interpolation),
)


def classifies_with_both(choices: Choices) -> bool:
    """Return whether fusion is chosen, and both sensors see every range of profiles."""
    sensors = {RANGE, INFRARED} <= set(choices.value(Sweep.sensor))
    ranges = set(choices[Grid.range]) <= set(choices[Infrared.range])
    return NAME in choices[Classifier.name] and sensors and ranges


def cosines(
    templates: NDArray[np.float32], maps: NDArray[np.uint8], number: int, views: Indices
) -> NDArray[np.float32]:
    """Return (phase, view, template) cosines of some views of (number, phase, view, ...) maps.

    The maps are those at index `number` of the first axis; templates are (phase, template, feature)
    vectors. See `ncti.classify.fusion.similarity_between_phases`.
    """
    similarity = np.empty((len(templates), len(views), templates.shape[1]), np.float32)
    for rows in row_blocks(len(views)):
        vectors = view_vectors(maps, number, views[rows])
        similarity[:, rows] = similarity_between_phases(vectors, templates)
    return similarity


def view_vectors(maps: NDArray[np.uint8], number: int, views: Indices) -> NDArray[np.float32]:
    """Return (phase, view, feature) vectors of some views of maps, as for `cosines`."""
    # Advanced indices on both sides of a slice come first.
    return classifier.map_vectors(maps[number, :, views].swapaxes(0, 1)[:, None])


def stack_map_views(maps: NDArray[np.uint8], lead: int) -> NDArray[np.uint8]:
    """Return (..., ship, aspect, angle, radius) maps as (..., view, angle, radius) ones."""
    return maps.reshape(*maps.shape[:lead], -1, *maps.shape[lead + 2 :])


@stage(
    Output("silhouette_constants", ("constant", "phase"), "f8"),
    uses=(Infrared,),
    along=(Infrared.frame_count,),
    gather=(Infrared.subpixel_offsets, *GATHERED),
    reads=classifier.read_in_blocks("template_log_polar", "log_polar"),
)
def silhouette_constants(
    template_log_polar: NDArray[np.uint8],
    log_polar: NDArray[np.uint8],
    valid: Mask,
    training_views: Mask,
) -> Floats:
    """Return (frame_count, constant, phase) inverse temperatures and outlier fractions.

    Fit them to silhouettes of learned views, with the cosines between these views held in memory
    for one frame count at a time. See `ncti.classify.calibration.fit_held_out_phases`.
    """
    from ncti.classify.calibration import fit_held_out_phases

    learned = np.flatnonzero(valid.all(axis=0) & training_views)
    templates = classifier.map_vectors(stack_map_views(template_log_polar, 1)[:, learned][:, None])
    maps = stack_map_views(log_polar, 2)
    ship_aspect = np.divmod(learned, training_views.shape[1])
    return np.stack(
        [
            fit_held_out_phases(cosines(templates, maps, m, learned), *ship_aspect)
            for m in range(len(maps))
        ]
    )


@stage(
    Output("profile_outlier_fraction", ("template",), "f8"),
    uses=(Grid, Likelihood),
    along=(Grid.frame_count,),
    # The name of the stream with which the published figures were drawn.
    stream=Stream((Grid.pulse_width, Grid.range, Ladar.target_free_ifovs), "profile_doubt"),
)
def profile_outlier_fraction(
    profile_templates: tuple[GaussianTemplates, Mask],
    gain_sigma: float,
    frame_count: tuple[int, ...],
    rng: np.random.Generator,
) -> Floats:
    """Return (frame_count, template) outlier fractions of profiles.

    See `ncti.classify.calibration.fit_outlier_fraction`.
    """
    from ncti.classify.calibration import fit_outlier_fraction

    seed, (templates, _) = int(rng.integers(2**63)), profile_templates
    # Use the same draws for every frame count.
    return np.stack(
        [
            fit_outlier_fraction(
                templates, count, np.random.default_rng(seed), gain_sigma=gain_sigma
            )
            for count in frame_count
        ]
    )


ANSWERS = classifier.ClassifierGroup.of_classifier(
    NAME,
    classifies_with_both,
    (
        *(*classifier.OF_PROFILES, "channel", "gain_sigma", *OF_SILHOUETTES, "super_resolution"),
        *("infrared_frame_count", "place", "draw", "frame_count"),
    ),
    names={Infrared.frame_count: "infrared_frame_count"},
    answer=(*OF_DRAWS, *classifier.VIEW),
)


@ANSWERS.answers(
    Output("probability", ANSWERS.answer, label="posterior probability of the true ship"),
    # In the channel `both`, the first output belongs to silhouettes, the second to profiles.
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
    uses=(Grid, Likelihood),
    gather=(Grid.replicate, Infrared.subpixel_offsets, *GATHERED),
    # Densities of profiles are shared by all of them.
    along=(Likelihood.gain_sigma, Grid.frame_count, *LOOKS),
    reads=classifier.read_in_blocks("averaged")
    | {
        name: At(name, {Infrared.range: Grid.range}, in_blocks=name != "silhouette_constants")
        for name in ("template_log_polar", "log_polar", "silhouette_constants")
    },
)
def fusion(
    profile_templates: tuple[GaussianTemplates, Mask],
    profile_outlier_fraction: Floats,
    averaged: Profiles,
    template_log_polar: NDArray[np.uint8],
    log_polar: NDArray[np.uint8],
    silhouette_constants: Floats,
    valid: Mask,
    training_views: Mask,
    prior: Prior,
    gain_sigma: tuple[float, ...],
    frame_count: tuple[int, ...],
) -> Arrays:
    """Return the ships predicted by profile, by silhouette and by both.

    The score of a profile is its log-likelihood at an inverse temperature of 1. The score of a
    silhouette has the inverse temperature fitted to the silhouettes of the *other* phases. Fuse
    both sensors by adding their scores, each with an outlier fraction, so that neither outweighs
    the other by more than answers about learned views support. An empty silhouette carries no
    information: all its scores are 0. Score only views that both sensors see in all draws, in
    blocks of views.
    """
    templates, known = profile_templates
    compared: Mask = np.asarray(valid.all(axis=(0, 1)))
    learned = compared & known & training_views
    views, training_set = np.flatnonzero(compared), np.flatnonzero(learned)
    template = np.searchsorted(np.flatnonzero(known), training_set)  # among templates of profiles
    of_ship, of_profiles = training_set // known.shape[1], profile_outlier_fraction[..., template]
    # Maps by look and view, and the vectors of templates by inner radius and interpolation.
    axes, kinds = log_polar.shape[: len(LOOKS)], template_log_polar.shape[:2]
    looks, replicates, phases = math.prod(axes), averaged.shape[1], log_polar.shape[len(LOOKS)]
    maps = log_polar.reshape(looks, phases, -1, *log_polar.shape[-2:])
    known_maps = template_log_polar.reshape(math.prod(kinds), phases, -1, *maps.shape[-2:])
    silhouettes = [view_vectors(known_maps, k, training_set) for k in range(len(known_maps))]
    profiles = averaged.reshape(len(frame_count), replicates, -1, averaged.shape[-1])
    draws = max(replicates, phases)
    shape = (len(gain_sigma), len(frame_count), looks, len(CHANNELS), draws)
    best = np.full((*shape, *known.shape), NO_ANSWER, dtype=np.int16)
    probability = np.full((*shape, *known.shape), np.nan, dtype=np.float32)
    factors = silhouette_constants.reshape(looks, 2, phases)[..., np.arange(draws) % phases]
    for rows in row_blocks(len(views), ROWS * max(1, HELD_ROWS // (ROWS * max(replicates, looks)))):
        true, column = np.divmod(views[rows], known.shape[1])
        similar = [
            cosines(silhouettes[m % len(silhouettes)], maps, m, views[rows]) for m in range(looks)
        ]
        for f, count in enumerate(frame_count):
            block = np.concatenate([profiles[f, r, views[rows]] for r in range(replicates)])
            logs = templates.log_likelihood(prior.drop_floors(block), count, gain_sigma=gain_sigma)
            logs = logs.reshape(len(gain_sigma), replicates, len(true), -1)[..., template]
            for g, d in np.ndindex(len(gain_sigma), draws):
                profile = logs[g, d % replicates], of_profiles[g, f]
                scaled = (
                    (factor * cosine[d % phases].astype(np.float64), share)
                    for (factor, share), cosine in zip(factors[..., d], similar, strict=True)
                )
                for (m, c), posterior in channel_posteriors(profile, scaled, of_ship):
                    index = g, f, m, c, d, true, column
                    best[index], probability[index] = classifier.best_ships(posterior, true)
    answers = classifier.mark_answers(best, compared) | {"probability": probability}
    answers |= _constants(factors, of_profiles.mean(axis=-1), shape)
    return {
        name: values.reshape(*shape[:2], *axes, *values.shape[3:])
        for name, values in answers.items()
    }


def channel_posteriors(
    profile: tuple[Floats, Floats], silhouettes: Iterable[tuple[Floats, float]], of_ship: Integers
) -> Iterator[tuple[tuple[int, int], tuple[Integers, Floats]]]:
    """Yield the indices of a look and a channel, then ships with their (view, ship) probabilities.

    `profile`, and each item of `silhouettes`, one per look, are (view, template) scores with their
    outlier fractions; `of_ship` (template,) has the ship of each template.
    """
    scores, outliers = profile
    of_profile = label_posterior(scores, of_ship)
    certain = add_outliers(scores, of_ship, outlier_fraction=outliers)
    for m, (similar, share) in enumerate(silhouettes):
        silhouette = add_outliers(similar, of_ship, outlier_fraction=share)
        fused = fuse(certain, silhouette, inverse_temperature=(1.0, 1.0))
        of_both = (label_posterior(scores, of_ship) for scores in (silhouette, fused))
        for c, posterior in enumerate((of_profile, *of_both)):
            yield (m, c), posterior


def _constants(factors: Floats, of_profiles: Floats, shape: tuple[int, ...]) -> Arrays:
    """Return inverse temperatures and outlier fractions by gain, frame count, look, channel, draw.

    `factors` (look, 2, draw) has inverse temperatures and outlier fractions of silhouettes;
    `of_profiles` (gain, frame count) has outlier fractions of profiles.
    """
    inverse_temperature, outlier_fraction = np.empty((2, *shape))
    inverse_temperature[..., 0, :], inverse_temperature[..., 1:, :] = 1.0, factors[:, :1]
    outlier_fraction[..., ::2, :] = of_profiles[..., None, None, None]
    outlier_fraction[..., 1, :] = factors[:, 1]
    return {"inverse_temperature": inverse_temperature, "outlier_fraction": outlier_fraction}


def draws_of(replicate: tuple[int, ...], subpixel_offsets: tuple[int, ...]) -> Arrays:
    """Return the channels and the numbers of draws."""
    draws = max(len(replicate), len(subpixel_offsets))
    return {"channel": np.array(CHANNELS), "draw": np.arange(draws)}


fusion_draws = ANSWERS.coordinates(
    coordinate("channel", ("channel",), "U8", label="sensor that identifies the ship"),
    coordinate("draw", ("draw",), "i8", label="number of the pair of a replicate and a phase"),
    uses=(Grid, Infrared),
    gather=(Grid.replicate, Infrared.subpixel_offsets),
)(draws_of)


def check(choices: Choices) -> None:
    """Refuse ranges that only one sensor sees, if fusion is the only classifier.

    Beside other classifiers, fusion is left out at such ranges.
    """
    if choices[Classifier.name] == (NAME,):
        sensors, reason = choices.value(Sweep.sensor), f"for the classifier {NAME}"
        if not {RANGE, INFRARED} <= set(sensors):
            refuse(Sweep.sensor, repr(", ".join(sensors)), f"both {reason}")
        require_among(choices, Grid.range, Infrared.range, f", {reason}")
    if classifies_with_both(choices):
        offsets = len(choices[Infrared.subpixel_offsets])
        if offsets < MIN_PHASES:
            reason = f"the classifier {NAME} weighs the silhouettes of one by those of others"
            refuse(Infrared.subpixel_offsets, offsets, f"at least {MIN_PHASES}: {reason}")
        classifier.check_receiver(choices, NAME)


STAGES = (
    silhouette_constants,
    profile_outlier_fraction,
    fusion,
    fusion_draws,
)
TABLES = ANSWERS.tables(labels={"classifier": NAME})
