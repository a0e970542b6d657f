"""Maximum likelihood from the exact mean and covariance of range profiles."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ncti.classify.blocks import HELD_ROWS, row_blocks
from ncti.classify.fusion import label_posterior
from ncti.classify.misfit import log_fit
from ncti.classify.track import aspect_prior
from ncti.features.profile import estimated_floor
from ncti.ladar import spread_place
from ncti.ladar.places import TEMPLATE_PLACES, IfovOffset
from ncti.ships import names
from sweeps.engine.declare.settings import Choices, Run, Settings, draws, number, switch
from sweeps.engine.declare.stage import UNSTORED, Output, Stream, derived, in_memory, stage
from sweeps.engine.resolve.streams import cell_rng
from sweeps.stages import classifier
from sweeps.stages.classifier import (
    GATHERED,
    NO_ANSWER,
    AspectSelection,
    Classifier,
    Integers,
    Mask,
)
from sweeps.stages.ladar import Ladar, expected, extent_stages, mirror_offset
from sweeps.stages.refusals import refuse
from sweeps.stages.views import Arrays, Floats, Grid, Profiles

if TYPE_CHECKING:
    from ncti.classify.likelihood import GaussianTemplates

IMPORTS = ("ncti.classify.likelihood",)
NAME = "likelihood"
ANSWERS = classifier.of_profiles(NAME, "gain_sigma", "left_out")


class Likelihood(Settings, key="classifier"):
    """Prior knowledge of profiles."""

    gain_sigma = number(
        1.0,
        0,
        1000,
        label="prior standard deviation of the target's gain",
        help="0: known",
        role="coordinate",
    )
    floor_sigma = number(
        1.0,
        0,
        1000,
        label="prior standard deviation of the noise floor, relative to that of one frame",
        help="0: known",
    )
    floor_estimated = switch(
        False,
        label="noise floor estimated from the edges of the window",
        help="used by the likelihood; with floor_sigma 0 the estimate counts as exact",
    )
    aspect_sigma = number(
        None,
        low=0,
        high=1000,
        unit="degree",
        label="standard deviation of the aspect that a track reports",
        help="used by the likelihood; 0: the nearest template of each ship; null: no track",
    )
    diagonal_loading = number(
        1e-3, 1e-9, 1000, label="variance of noise beyond the model, relative to the model's"
    )
    template_error = number(
        None,
        low=0,
        high=1000,
        label="variance of profiles between templates, relative to half their second difference",
        help="0: templates are exact; null: calibrated on aspects left out",
    )
    template_places = draws(
        TEMPLATE_PLACES,
        64,
        label="places of the ship on the grid of IFOVs that templates have",
        help="used by likelihood and fusion, which average over them; 1 is the corner alone",
        dimension="template_place",
    )
    misfit_weight = number(
        0.01,
        low=0,
        high=100,
        label="power of the goodness of fit in the similarity of an answer",
        help="0: similarity is a probability alone",
    )


@dataclass(frozen=True)
class Prior:
    """Noise beyond the model, and prior knowledge of the noise floor."""

    diagonal_loading: float
    floor_sigma: float
    floor_estimated: bool

    def drop_floors(self, profiles: Profiles) -> Profiles | Floats:
        """Return profiles, without their floors if these are estimated."""
        return profiles - estimated_floor(profiles) if self.floor_estimated else profiles


prior = derived(uses=(Likelihood,), name="prior")(Prior)


@dataclass(frozen=True, eq=False)
class Moments:
    """Moments of profiles by (ship, aspect), with masks of existing and of training views.

    `placed_profile`, the means, and `valid` begin with the axes (place, ship, aspect).
    """

    placed_profile: Profiles
    covariance: Profiles
    valid: Mask
    training_views: Mask
    alternative_views: Mask
    aspect: tuple[float, ...]
    prior: Prior

    @property
    def learned_mask(self) -> Mask:
        """The (ship, aspect) mask of learned views."""
        return self.valid.all(axis=0) & self.training_views

    @property
    def alternative_mask(self) -> Mask:
        """The (ship, aspect) mask of templates that stand for unknown ships."""
        return self.valid.all(axis=0) & self.alternative_views

    def templates(
        self,
        chosen: Mask,
        template_error: float | None,
        rng: np.random.Generator | None = None,
    ) -> GaussianTemplates:
        """Return templates of the chosen views; calibrate `template_error` if it is None.

        The floor is the level at the window's edge, including the noise of the ship's IFOVs; the
        target's gain does not scale it.
        """
        from ncti.classify.likelihood import GaussianTemplates

        places = range(len(self.placed_profile))
        profiles = [self.placed_profile[place, chosen] for place in places]
        means = self.prior.drop_floors(np.stack(profiles, axis=1))
        ship, column = chosen.nonzero()
        aspects = np.array(self.aspect)[column]
        return GaussianTemplates(
            diagonal_loading=self.prior.diagonal_loading,
            floor_sigma=self.prior.floor_sigma,
            template_error=template_error,
        ).fit(means, self.covariance[chosen], ship, floor=means[..., :1], aspect=aspects, rng=rng)


@in_memory(uses=(Grid, Classifier), gather=GATHERED)
def alternative_views(
    ship: tuple[str, ...],
    aspect: tuple[float, ...],
    alternative: tuple[str, ...] | None,
    aspect_selection: AspectSelection,
) -> Mask:
    """Return the (ship, aspect) mask of the templates of ships in `classifier.alternative`."""
    return ~classifier.training_ships(ship, alternative)[:, None] & aspect_selection.mask(aspect)


@derived(uses=(Grid, Classifier, Likelihood))
def template_offset(
    template_places: int,
    ship: str,
    aspect: float,
    drawn_aspect: float,
    unknown: tuple[str, ...] | None,
    alternative: tuple[str, ...] | None,
    aspect_selection: AspectSelection,
) -> IfovOffset:
    """Return the place of the ship origin in a template, mirrored if the other side is drawn.

    Views without templates are at the corner, so that they share the cells of expected profiles.
    """
    [is_learned] = aspect_selection.mask((aspect,))
    absent = set(unknown or ()) - set(alternative or ())
    number = template_places if is_learned and ship not in absent else 0
    return mirror_offset(spread_place(number), aspect, drawn_aspect)


placed_extents = extent_stages("placed", shift="template_offset")
placed_profile = replace(
    expected,
    name="placed_profile",
    group=UNSTORED,
    reads={**expected.reads, "extent": "placed_ifovs"},
)

profile_moments = in_memory(
    uses=(Grid,),
    reads=classifier.read_in_blocks("placed_profile", "covariance"),
    gather=(Likelihood.template_places, *GATHERED),
    name="profile_moments",
)(Moments)


@stage(
    Output("calibrated_error", dtype="f8"),
    uses=(Likelihood,),
    stream=Stream((Grid.pulse_width, Grid.range, Ladar.target_free_ifovs)),
)
def calibrated_error(
    profile_moments: Moments,
    *,
    template_error: float | None,
    rng: np.random.Generator,
) -> Floats:
    """Return the template error, calibrated on left-out templates unless it is given."""
    if template_error is None and profile_moments.learned_mask.any():
        known = profile_moments.learned_mask
        return np.array(profile_moments.templates(known, None, rng).template_error_)
    return np.array(template_error or 0.0)


@in_memory(keep=2)
def profile_templates(
    profile_moments: Moments, calibrated_error: Floats
) -> tuple[GaussianTemplates, Mask]:
    """Return the templates of all training views, and their (ship, aspect) mask."""
    known = profile_moments.learned_mask
    return profile_moments.templates(known, float(calibrated_error)), known


@in_memory(keep=2)
def alternative_templates(
    profile_moments: Moments, calibrated_error: Floats
) -> tuple[GaussianTemplates | None, Mask]:
    """Return the templates of ships in `classifier.alternative`, or None, and their mask."""
    chosen = profile_moments.alternative_mask
    templates = profile_moments.templates(chosen, float(calibrated_error)) if chosen.any() else None
    return templates, chosen


@dataclass(frozen=True, eq=False)
class Track:
    """Aspects of the grid, and the aspect of each view [deg] as a track reports it, if any.

    Attributes
    ----------
    aspect : tuple of float
    sigma : float or None
    reported : (ship, aspect) float64 ndarray
    """

    aspect: tuple[float, ...]
    sigma: float | None
    reported: Floats

    def log_prior(self, views: Integers, ship: Integers, column: Integers) -> ArrayLike:
        """Return the log prior of templates of given ships and columns, for views by index."""
        if self.sigma is None:
            return 0.0
        aspects = np.array(self.aspect)[column]
        return aspect_prior(aspects, ship, self.reported.reshape(-1)[views], sigma=self.sigma)


@in_memory(uses=(Grid, Likelihood, Run), gather=GATHERED)
def track(
    ship: tuple[str, ...],
    aspect: tuple[float, ...],
    aspect_sigma: float | None,
    replicate: int,
    seed: int,
) -> Track:
    """Return the aspects of views as a track reports them.

    The error of each view has its own random stream and is scaled by its standard deviation.
    """
    reported = np.tile(np.array(aspect, dtype=np.float64), (len(ship), 1))
    for (s, name), (a, angle) in product(enumerate(ship), enumerate(aspect)):
        if aspect_sigma:
            rng = cell_rng(seed, stage="track", ship=str(name), aspect=angle, replicate=replicate)
            reported[s, a] += aspect_sigma * rng.standard_normal()
    return Track(aspect, aspect_sigma, reported)


def _widened_scores(
    templates: GaussianTemplates,
    profiles: Profiles | Floats,
    densities: tuple[Floats, Floats],
    columns: tuple[Integers, Integers],
    count: int,
    gain_sigma: tuple[float, ...],
) -> tuple[Floats, Floats]:
    """Return the scores and peaks of templates whose cells extend over a left-out aspect.

    `columns` has the aspect indices of profiles and of templates.
    """
    of_view, of_template = columns
    scores, peak = densities[0].copy(), np.broadcast_to(densities[1], densities[0].shape).copy()
    for column in np.intersect1d(of_view, of_template):
        rows, remaining = of_view == column, of_template != column
        reduced, index = templates.without(~remaining), (slice(None), *np.ix_(rows, remaining))
        scores[index] = reduced.log_likelihood(profiles[rows], count, gain_sigma=gain_sigma)
        peak[index] = peak_densities(reduced, count, gain_sigma)
    return scores, peak


def peak_densities(
    templates: GaussianTemplates, count: int, gain_sigma: tuple[float, ...]
) -> Floats:
    """Return the (gain, 1, template) greatest log densities under each template."""
    return np.stack([[templates.peak(count, gain_sigma=gain)] for gain in gain_sigma])


def _score_alternative(
    unknown: GaussianTemplates | None,
    profiles: Profiles | Floats,
    count: int,
    gain_sigma: tuple[float, ...],
) -> Floats:
    """Return the (gain, view, template) scores of the alternative's ships, if there are any."""
    if unknown is None:
        return np.empty((len(gain_sigma), len(profiles), 0))
    return unknown.log_likelihood(profiles, count, gain_sigma=gain_sigma)


def _fit_of_best(scores: Floats, peak: Floats, exclude: Mask, bins: int) -> Floats:
    """Return the log probability (view,) of a worse fit of each view's best template."""
    allowed = np.where(exclude[:, : scores.shape[1]], -np.inf, scores)
    best = np.arange(len(allowed)), allowed.argmax(axis=1)
    shortfall = np.broadcast_to(peak, scores.shape)[best] - scores[best]
    return log_fit(-shortfall[:, None], [0.0], bins)[:, 0]


def _select_ships(
    posterior: tuple[Integers, Floats], true_ship: Integers
) -> tuple[Integers, Floats, Floats]:
    """Return the (view,) predicted ships, and probabilities of the true and of the predicted ones.

    With an alternative, the probability of a prediction is normalised against it alone.
    `posterior` has ships, `NO_ANSWER` for the alternative, and their (view, ship) probabilities.
    """
    ships, probability = posterior
    named = ships != NO_ANSWER
    best, of_true = classifier.best_ships((ships[named], probability[:, named]), true_ship)
    of_best = probability[:, named].max(axis=1)
    if not named.all():
        of_best = of_best / (of_best + probability[:, ~named].sum(axis=1))
    return best, of_true, of_best


@ANSWERS.answers(
    Output("probability", classifier.VIEW, label="posterior probability of the true ship"),
    Output(
        "similarity",
        classifier.VIEW,
        label="posterior probability of the predicted ship, among all of them or, if there is an "
        "alternative, against that alone, times a power of its fit",
    ),
    Output("fit", classifier.VIEW, label="log probability of a worse fit of the best template"),
    Output("calibrated_error", label="template error, given or calibrated"),
    uses=(Grid, Classifier, Likelihood),
    reads=classifier.read_in_blocks("averaged"),
    # All combinations share the densities.
    along=(Classifier.left_out, Likelihood.gain_sigma, Grid.frame_count),
)
def likelihood(
    profile_templates: tuple[GaussianTemplates, Mask],
    alternative_templates: tuple[GaussianTemplates | None, Mask],
    averaged: Profiles,
    valid: Mask,
    prior: Prior,
    track: Track,
    *,
    ship: tuple[str, ...],
    gain_sigma: tuple[float, ...],
    misfit_weight: float,
    frame_count: tuple[int, ...],
    left_out: tuple[bool, ...],
) -> Arrays:
    """Return the most probable ship of (frame_count, ship, aspect, bin) averages.

    If the true aspect is left out, exclude the templates of all ships at that aspect, and extend
    the cells of adjacent templates over it. The alternative's ships form one class that is never
    predicted. Accept an answer by the ratio of its density to theirs: by the lemma of Neyman and
    Pearson, no other test keeps more right answers for a given share of rejected unknown ships.
    `gain_sigma` holds prior standard deviations of the gain. Generated ships are not tested.
    Compute log densities in blocks of views, sorted by aspect.
    """
    templates, known = profile_templates
    classifier.require_another_aspect(known, any(left_out))
    unknown, of_unknown = alternative_templates
    tested = classifier.tested_ships(ship)[:, None]
    view_aspect, view_ship = np.nonzero((valid & tested).T)
    views = view_ship * valid.shape[1] + view_aspect
    of_ship, of_template = np.nonzero(known)
    template, column = np.concatenate([np.nonzero(mask) for mask in (known, of_unknown)], axis=1)
    label = np.where(np.arange(template.size) < of_ship.size, template, NO_ANSWER)
    flat = averaged.reshape(len(frame_count), -1, averaged.shape[-1])
    shape = (len(left_out), len(gain_sigma), len(frame_count), *valid.shape)
    best = np.full(shape, NO_ANSWER, dtype=np.int16)
    probability, similarity, fit = np.full((3, *shape), np.nan)
    for f, count in enumerate(frame_count):
        highest = peak_densities(templates, count, gain_sigma)
        for rows in row_blocks(len(views), HELD_ROWS):
            block, true_ship = prior.drop_floors(flat[f, views[rows]]), view_ship[rows]
            narrow = templates.log_likelihood(block, count, gain_sigma=gain_sigma), highest
            alternative_scores = _score_alternative(unknown, block, count, gain_sigma)
            log_prior = track.log_prior(views[rows], template, column)
            for n, leave in enumerate(left_out):
                scored = narrow
                if leave and templates.template_error_:
                    columns = view_aspect[rows], of_template
                    scored = _widened_scores(templates, block, narrow, columns, count, gain_sigma)
                exclude = (view_aspect[rows, None] == column) & leave
                for g, (scores, peak) in enumerate(zip(*scored, strict=True)):
                    index = n, g, f, true_ship, view_aspect[rows]
                    all_scores = np.concatenate([scores, alternative_scores[g]], axis=1)
                    posterior = label_posterior(
                        all_scores, label, exclude=exclude, log_prior=log_prior
                    )
                    best[index], probability[index], accepted = _select_ships(posterior, true_ship)
                    fit[index] = _fit_of_best(scores, peak, exclude, averaged.shape[-1])
                    similarity[index] = accepted * np.exp(misfit_weight * fit[index])
    return classifier.mark_answers(best, valid, tested) | {
        "probability": probability,
        "similarity": similarity,
        "fit": fit,
        "calibrated_error": np.full(shape[:3], templates.template_error_),
    }


def check_first(choices: Choices) -> Choices | None:
    """Return choices with generated ships added to the grid, `unknown` and `alternative`.

    Refuse (`ConfigurationError`) to generate variants of ships without a packaged sheet, or
    without the classifier `likelihood`, the only one that uses them.
    """
    number = choices.value(Classifier.generated)
    if not number:
        return None
    if not ANSWERS.when(choices):
        refuse(Classifier.generated, number, f"0 unless classifier.name has {NAME}")
    learned = set(choices[Grid.ship]) - set(choices.value(Classifier.unknown) or ())
    if not learned <= set(names()):
        foreign = ", ".join(sorted(learned - set(names())))
        refuse(
            Classifier.generated, number, f"0 where other ships are learned than known: {foreign}"
        )
    generated = classifier.generated_ships(sorted(learned), number)
    choices = choices.replace(Grid.ship, tuple(sorted({*choices[Grid.ship], *generated})))
    for setting in (Classifier.unknown, Classifier.alternative):
        members = tuple(sorted({*(choices.value(setting) or ()), *generated}))
        choices = choices.replace(setting, (members,))
    return choices


def check(choices: Choices) -> None:
    """Refuse receivers with unknown moments, and leaving all aspects out."""
    if ANSWERS.when(choices):
        classifier.check_receiver(choices, NAME)
        classifier.check_left_out(choices)


STAGES = (
    prior,
    alternative_views,
    template_offset,
    placed_extents,
    placed_profile,
    profile_moments,
    calibrated_error,
    profile_templates,
    alternative_templates,
    track,
    likelihood,
)
TABLES = ANSWERS.tables(rejecting=True)
