"""Fusion of range profiles and silhouettes, beside each of them alone.

A template is a view, a ship at an aspect, for both sensors. Draw d pairs replicate d of the
profiles with phase d of the silhouettes, cyclically if there are fewer profiles.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ncti.classify.fusion import doubted, fuse, label_posterior
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.settings import Choices
from sweeps.engine.stage import Output, Stage, stage
from sweeps.stages import classifier
from sweeps.stages.classifier import GATHERED, NONE, Arrays, Classifier, Floats, Naming, Views
from sweeps.stages.infrared import Infrared
from sweeps.stages.ladar import Ladar
from sweeps.stages.likelihood import Likelihood
from sweeps.stages.silhouettes import OF_SILHOUETTES
from sweeps.stages.views import INFRARED, RANGE, Grid, Sweep

if TYPE_CHECKING:
    from ncti.classify.likelihood import GaussianTemplates

NAME = "fusion"
CHANNELS = ("range", "infrared", "both")
LEAST_PHASES = 2
# Weight of silhouettes without templates of their own aspect, beside those with: similarity falls
# with the square of the distance, whose mean is 1/12 of that of aspects left out at new ones.
LEFT_OUT = 1 / 12
UNLIKE = -1.0  # cosine to what is left out: below that of any map
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
    gather=(Infrared.phases, *GATHERED),
)
def silhouette_scores(
    template_log_polar: NDArray[np.uint8], log_polar: NDArray[np.uint8], there: Views
) -> NDArray[np.float32]:
    """Return (frame_count, phase, view, template) cosines, NaN of views missing in any phase.

    See `similarity`.
    """
    views = there.all(axis=0).reshape(-1)
    templates = classifier.map_vectors(template_log_polar)[:, views]
    whole = (len(log_polar), len(there), views.size, views.size)
    scores = np.full(whole, np.nan, np.float32)
    for of_count, maps in zip(scores, log_polar, strict=True):
        found = similarity(classifier.map_vectors(maps)[:, views], templates)
        of_count[:, np.outer(views, views)] = found.reshape(len(there), -1)
    return scores


@stage(Output("silhouette_constants", ("constant", "phase"), "f8"))
def silhouette_constants(silhouette_scores: NDArray[np.float32], training_views: Views) -> Floats:
    """Return the (constant, phase) sharpness and doubt of each silhouette's scores.

    Silhouettes of learned views are scored with the templates of all aspects, and again without
    those of their own. See `calibrate`.
    """
    lessons = (training_views.reshape(-1) & compared(silhouette_scores)).nonzero()[0]
    scores = silhouette_scores.astype(np.float64)[:, lessons[:, None], lessons]
    return calibrate(scores, *np.divmod(lessons, training_views.shape[1]))


@stage(
    Output("profile_doubt", ("view",), "f8"),
    uses=(Grid, Likelihood),
    along=(Likelihood.gain_sigma, Grid.frame_count),
    stream=(Grid.pulse_width, Grid.range, Ladar.target_free_ifovs),
)
def profile_doubt(
    profile_moments: tuple[GaussianTemplates, Views],
    gain_sigma: tuple[float, ...],
    frame_count: tuple[int, ...],
    rng: np.random.Generator,
) -> Floats:
    """Return (gain_sigma, frame_count, view) doubts of `ncti.classify.calibration.fit_doubt`.

    NaN for views that are not learned.
    """
    # Imported here because scipy takes a second.
    from ncti.classify.calibration import fit_doubt

    templates, known = profile_moments
    seed = int(rng.integers(2**63))
    found = np.full((len(gain_sigma), len(frame_count), known.size), np.nan)
    for f, count in enumerate(frame_count):
        drawn = np.random.default_rng(seed)
        found[:, f, known.reshape(-1)] = fit_doubt(templates, count, drawn, gain_sigma=gain_sigma)
    return found


NAMING = Naming(NAME, names_by_both, dims=(*OF_DRAWS, *classifier.VIEW))


@NAMING.answers(
    Output("probability", NAMING.dims, label="posterior probability of the true ship"),
    Output(
        *("sharpness", OF_DRAWS),
        label="log-probability of a unit of a sensor's score; of both: that of silhouettes",
    ),
    Output(
        *("doubt", OF_DRAWS),
        label="probability that a sensor is uninformative, the mean over templates; of both: that "
        "of profiles",
    ),
    uses=(Grid,),
    gather=(Grid.replicate, *GATHERED),
    at={Infrared.range: Grid.range},
    names={Infrared.frame_count: "infrared_frame_count"},
    dims=(
        *(*classifier.OF_PROFILES, "channel", "gain_sigma", *OF_SILHOUETTES, "super_resolution"),
        *("infrared_frame_count", "ifov_phase", "draw", "frame_count"),
    ),
)
def fusion(
    profile_scores: Floats,
    silhouette_scores: NDArray[np.float32],
    silhouette_constants: Floats,
    profile_doubt: Floats,
    training_views: Views,
    ship: tuple[str, ...],
    aspect: tuple[float, ...],
) -> Arrays:
    """Return the ships predicted by profile, by silhouette and by both.

    The score of a profile is its log-likelihood, taken as it is: its sharpness is 1. That of a
    silhouette is given the sharpness found on the silhouettes of the *other* phases. For both,
    they are added, each with its doubt: neither outweighs the other by more than answers about
    learned views support. An empty silhouette carries no information: all its scores are 0.
    """
    of_profiles = profile_scores
    seen = compared(of_profiles) & compared(silhouette_scores)
    views, lessons = seen.nonzero()[0], (training_views.reshape(-1) & seen).nonzero()[0]
    draws = max(len(of_profiles), len(silhouette_scores))
    whole = (len(CHANNELS), draws, len(ship), len(aspect))
    there = seen.reshape(whole[2:])
    named, probability = np.full(whole, NONE), np.full(whole, np.nan)
    sharpness, doubt = np.full((2, *whole[:2]), np.nan)
    of_ship, doubts = lessons // len(aspect), profile_doubt[lessons]
    for d in range(draws):
        phase = d % len(silhouette_scores)
        sharp, uncertain = silhouette_constants[:, phase]
        profile = of_profiles[d % len(of_profiles)][views[:, None], lessons]
        silhouette = silhouette_scores[phase].astype(np.float64)[views[:, None], lessons]
        silhouette = doubted(sharp * silhouette, of_ship, doubt=uncertain)
        both = fuse(doubted(profile, of_ship, doubt=doubts), silhouette, sharpness=(1.0, 1.0))
        sharpness[:, d] = 1.0, sharp, sharp
        doubt[:, d] = doubts.mean(), uncertain, doubts.mean()
        for c, scores in enumerate((profile, silhouette, both)):
            named[c, d, there], probability[c, d, there] = classifier.most_probable(
                label_posterior(scores, of_ship), views // len(aspect)
            )
    return classifier.judged(named, there) | {
        "probability": probability,
        "sharpness": sharpness,
        "doubt": doubt,
    }


def number_draws(replicate: tuple[int, ...], phases: tuple[int, ...]) -> Arrays:
    """Return the channels and the numbers of the draws."""
    return {"channel": np.array(CHANNELS), "draw": np.arange(max(len(replicate), len(phases)))}


fusion_draws, fusion_states = (
    stage(
        Output("channel", ("channel",), "U8", label="sensor that identifies the ship"),
        Output("draw", ("draw",), "i8", label="number of the pair of a replicate and a phase"),
        uses=(Grid, Infrared),
        gather=(Grid.replicate, Infrared.phases),
        group=group,
        when=names_by_both,
        coordinates=True,
        name=name,
    )(number_draws)
    for group, name in (
        (f"classification/{NAME}", "fusion_draws"),
        (f"status_{NAME}", "fusion_states"),
    )
)


def compared(scores: NDArray[np.floating]) -> Views:
    """Return the (view,) mask of views with (draw, view, template) scores in every draw."""
    there: Views = np.isfinite(scores).any(axis=-1).all(axis=0)
    return there


def similarity(
    silhouettes: NDArray[np.float32], templates: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the (phase, view, template) largest cosines to templates in all other phases.

    In use, no template has the same position on the detector as the silhouette.
    Both are (phase, view, feature) maps of two phases or more.
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


def calibrate(scores: Floats, ship: NDArray[np.intp], aspect: NDArray[np.intp]) -> Floats:
    """Return the (constant, phase) sharpness and doubt of every phase's scores.

    Of (phase, view, template) scores of two phases or more, and the (view,) ship and number of the
    aspect of each view and of each template: fitted to the other phases, with templates of the
    view's own aspect and without; see `ncti.classify.calibration.fit_sharpness_and_doubt`.
    """
    # Imported here because scikit-learn takes a second.
    from ncti.classify.calibration import fit_sharpness_and_doubt

    phases, views, _ = scores.shape
    without = np.where(aspect[:, None] == aspect, UNLIKE, scores)
    weight = np.repeat([1 - LEFT_OUT, LEFT_OUT], (phases - 1) * views)
    truth = np.tile(ship, 2 * (phases - 1))
    found = np.empty((2, phases))
    for phase in range(phases):
        others = np.arange(phases) != phase
        pooled = np.concatenate([one[others] for one in (scores, without)])
        rows = pooled.reshape(-1, views)
        found[:, phase] = fit_sharpness_and_doubt(rows, ship, truth, weight=weight)
    return found


def check(choices: Choices) -> Choices:
    """Refuse ranges that only one sensor sees, where fusion is the only classifier.

    Among other classifiers it is left out then.
    """
    if choices[Classifier.name] == (NAME,):
        sensors, there = choices.one(Sweep.sensor), choices[Infrared.range]
        if not {RANGE, INFRARED} <= set(sensors):
            raise ConfigurationError(
                f"sensor is {', '.join(sensors)!r}, but must be both for the classifier {NAME}"
            )
        for slant_range in choices[Grid.range]:
            if slant_range not in there:
                raise ConfigurationError(
                    f"grid.range has {slant_range:g}, but every value must be one of "
                    f"{', '.join(f'{one:g}' for one in there)}, the values of infrared.range, for "
                    f"the classifier {NAME}"
                )
    if names_by_both(choices):
        phases = len(choices[Infrared.phases])
        if phases < LEAST_PHASES:
            raise ConfigurationError(
                f"infrared.phases is {phases}, but must be at least {LEAST_PHASES} for the "
                f"classifier {NAME}, which weighs the silhouettes of one by those of others"
            )
        classifier.check_receiver(choices, NAME)
    return choices


STAGES: tuple[Stage, ...] = (
    *(silhouette_scores, silhouette_constants, profile_doubt, fusion, fusion_draws, fusion_states),
)
TABLES = NAMING.tables()
