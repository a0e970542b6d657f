"""Maximum likelihood from the exact mean and covariance of range profiles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ncti.classify.blocks import row_blocks
from ncti.classify.fusion import label_posterior
from ncti.features.profile import estimated_floor
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.settings import Choices, Settings, number, switch
from sweeps.engine.stage import Output, Stream, in_memory, plain, stage
from sweeps.stages import classifier
from sweeps.stages.classifier import GATHERED, NONE, Classifier, Views
from sweeps.stages.ladar import Ladar
from sweeps.stages.views import Arrays, Floats, Grid, Profiles

if TYPE_CHECKING:
    from ncti.classify.likelihood import GaussianTemplates

IMPORTS = ("ncti.classify.likelihood",)  # by its stages, when they are called; takes long
NAME = "likelihood"
ANSWERS = classifier.of_profiles(NAME, "gain_sigma", "left_out")


KNOWN = "classifier.aspect_known has True, but must be false where {}"


class Likelihood(Settings, key="classifier"):
    """Prior knowledge of profiles."""

    gain_sigma = number(
        1.0,
        0,
        1000,
        label="prior standard deviation of the target's gain",
        help="0: known",
        single="coordinate",
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
    aspect_known = switch(
        False,
        label="restriction to exact templates at the true aspect",
        help="used by the likelihood, as if a track gave the heading",
    )
    diagonal_loading = number(
        1e-3, 1e-9, 1000, label="variance of noise beyond the model, relative to the model's"
    )
    template_error = number(
        *(None, 0, 1000),
        label="variance of profiles between templates, relative to half their second difference",
        help="0: templates are exact; null: calibrated on aspects left out",
    )


@dataclass(frozen=True)
class Prior:
    """What is known of profiles before they are seen."""

    diagonal_loading: float
    floor_sigma: float
    floor_estimated: bool

    def levelled(self, profiles: Profiles) -> Profiles | Floats:
        """Return profiles with their floors removed where these are estimated."""
        return profiles - estimated_floor(profiles) if self.floor_estimated else profiles


prior = plain(uses=(Likelihood,), name="prior")(Prior)


@dataclass(frozen=True, eq=False)
class Moments:
    """Moments of profiles by (ship, aspect), and which views exist and are in training."""

    expected: Profiles
    covariance: Profiles
    valid: Views
    training_views: Views
    aspect: tuple[float, ...]
    prior: Prior

    @property
    def known(self) -> Views:
        """The (ship, aspect) mask of what is learned."""
        return self.valid & self.training_views

    def templates(
        self, template_error: float | None, rng: np.random.Generator | None = None
    ) -> GaussianTemplates:
        """Return templates of the views learned; their error is calibrated if it is None.

        Their floor, which the target's gain leaves alone, is what the window's edge holds: noise,
        the ship's own IFOVs' among it.
        """
        # Imported here because scikit-learn takes a second.
        from ncti.classify.likelihood import GaussianTemplates

        means = self.prior.levelled(self.expected[self.known])
        ship, column = self.known.nonzero()
        at = np.array(self.aspect)[column]
        return GaussianTemplates(
            diagonal_loading=self.prior.diagonal_loading,
            floor_sigma=self.prior.floor_sigma,
            template_error=template_error,
        ).fit(means, self.covariance[self.known], ship, floor=means[:, :1], aspect=at, rng=rng)


profile_moments = in_memory(
    uses=(Grid,),
    reads=classifier.in_blocks("expected", "covariance"),
    gather=GATHERED,
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
    aspect_known: bool,
    rng: np.random.Generator,
) -> Floats:
    """Return the template error, calibrated on templates left out unless it is given."""
    if aspect_known:
        return np.array(0.0)
    if template_error is None and profile_moments.known.any():
        return np.array(profile_moments.templates(None, rng).template_error_)
    return np.array(template_error or 0.0)


@in_memory(keep=2)
def profile_templates(
    profile_moments: Moments, calibrated_error: Floats
) -> tuple[GaussianTemplates, Views]:
    """Return the templates of all training views, and their (ship, aspect) mask."""
    return profile_moments.templates(float(calibrated_error)), profile_moments.known


@stage(
    Output("log_density", ("view", "template"), "f8"),
    uses=(Grid, Likelihood),
    along=(Grid.frame_count,),
    gather=GATHERED,
)
def profile_scores(
    profile_templates: tuple[GaussianTemplates, Views],
    averaged: Profiles,
    valid: Views,
    gain_sigma: float,
    frame_count: tuple[int, ...],
    prior: Prior,
) -> Floats:
    """Return (frame_count, view, template) log densities, NaN for missing views.

    A template is a learned view. `gain_sigma` is the prior standard deviation of the gain.
    """
    templates, known = profile_templates
    scores = np.full((len(frame_count), valid.size, np.count_nonzero(known)), np.nan)
    for of_count, count, profiles in zip(scores, frame_count, averaged, strict=True):
        of_count[valid.reshape(-1)] = templates.log_likelihood(
            prior.levelled(profiles[valid]), count, gain_sigma=gain_sigma
        )
    return scores


@ANSWERS.answers(
    Output("probability", classifier.VIEW, label="posterior probability of the true ship"),
    Output("similarity", classifier.VIEW, label="posterior probability of the predicted ship"),
    Output("calibrated_error", label="template error, given or calibrated"),
    uses=(Grid, Classifier, Likelihood),
    along=(Grid.frame_count,),
)
def likelihood(
    profile_templates: tuple[GaussianTemplates, Views],
    profile_scores: Floats,
    averaged: Profiles,
    valid: Views,
    prior: Prior,
    *,
    gain_sigma: float,
    frame_count: tuple[int, ...],
    left_out: bool,
    aspect_known: bool,
) -> Arrays:
    """Return the most probable ship, one number of frames at a time.

    Where the true aspect is left out, templates of all ships at it are, and cells of those beside
    it reach as far as it.
    """
    templates, known = profile_templates
    classifier.require_another_aspect(known, left_out)
    (true, of_view), (of_ship, of_template) = np.nonzero(valid), np.nonzero(known)
    views = np.flatnonzero(valid)
    whole = (len(frame_count), *valid.shape)
    named, (probability, similarity) = np.full(whole, NONE), np.full((2, *whole), np.nan)
    for f, count in enumerate(frame_count):
        scores = profile_scores[f]
        if left_out and templates.template_error_:
            scores, seen = scores.copy(), prior.levelled(averaged[f][valid])
            for column in np.unique(of_view):
                rows, others = of_view == column, of_template != column
                rest = templates.without(~others)
                scores[np.ix_(views[rows], others)] = rest.log_likelihood(
                    seen[rows], count, gain_sigma=gain_sigma
                )
        for rows in row_blocks(len(views)):
            same = of_view[rows, None] == of_template
            exclude = (same & left_out) | (~same & aspect_known)
            posterior = label_posterior(scores[views[rows]], of_ship, exclude=exclude)
            at = f, true[rows], of_view[rows]
            named[at], probability[at] = classifier.most_probable(posterior, true[rows])
            similarity[at] = posterior[1].max(axis=1)
    return classifier.judged(named, valid) | {
        "probability": probability,
        "similarity": similarity,
        "calibrated_error": np.full(len(frame_count), templates.template_error_),
    }


def check(choices: Choices) -> Choices:
    """Refuse receivers with unknown moments, and leaving all aspects out."""
    if ANSWERS.when(choices):
        classifier.check_receiver(choices, NAME)
        classifier.check_left_out(choices)
        if any(choices[Likelihood.aspect_known]):
            if any(choices[Classifier.left_out]):
                raise ConfigurationError(KNOWN.format("classifier.left_out has True"))
            if not classifier.learned_of(choices).any(axis=0).all():
                raise ConfigurationError(KNOWN.format("an aspect of the grid is not learned"))
    return choices


TABLES = ANSWERS.tables(rejecting=True)
