"""Tables of the published results, from sweeps of several seeds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from benchmarks.reports import Column, Report
from docs._tables.repeated import bins_of, mean_over_seeds, multiples_mask, percent_of, pick
from ncti.evaluate import Scores, open_set_scores, score

RANGES, SPACINGS, STEP = (25, 50, 100), (1.5, 3, 6), 1.5

Answers = list[dict[str, xr.Dataset]]
"""Groups of a store by name, for each seed."""


def text_of(values: Sequence[float], **options: Any) -> str:
    """Return the mean and interval of percentages by seed."""
    return mean_over_seeds(values, **options).text()


# Aspects absent from training

ROWS: tuple[tuple[str, str, dict[str, object]], ...] = (
    ("profile, likelihood", "likelihood", {}),
    ("profile, correlation", "correlation", {}),
    ("profile, ACN", "acn", {}),
    ("silhouette, nearest template", "fusion", {"channel": "infrared", "super_resolution": "none"}),
    ("silhouette, ACN", "acn_infrared", {"super_resolution": "none"}),
    ("both", "fusion", {"channel": "both", "super_resolution": "none"}),
)
GROUPS = tuple(f"classification/{name}" for name in dict.fromkeys(row[1] for row in ROWS))


def shares(
    by_seed: Answers,
    group: str,
    name: str,
    places: Mapping[str, object] | None = None,
    *,
    learned: bool = False,
) -> list[float]:
    """Return percent correct of each seed in a bin of aspects, at new or at learned ones."""
    percentages = []
    for groups in by_seed:
        correct = pick(groups[group].correct, **(places or {}))
        chosen = bins_of(correct.aspect.values)[name]
        chosen = chosen & (multiples_mask(correct.aspect.values, STEP) == learned)
        percentages.append(percent_of(correct, chosen))
    return percentages


def views_of(by_seed: Answers, group: str, name: str) -> int:
    """Return the number of new views of a seed in a bin of aspects."""
    answers = by_seed[0][group]
    aspect = answers.aspect.values
    new = bins_of(aspect)[name] & ~multiples_mask(aspect, STEP)
    return int(new.sum()) * answers.sizes["ship"]


def new_aspects(by_seed: Answers) -> dict[str, Report]:
    """Return the tables of classifiers at aspects absent from training, and of the README."""
    seeds = len(by_seed)
    names = ("0-30°", "30-60°", "60-90°", "overall")
    rows, summary = [], []
    for km in RANGES:
        for label, classifier, places in ROWS:
            group = f"classification/{classifier}"
            setting = {"range": km, "template_spacing": STEP, **places}
            row: dict[str, Any] = {"what": f"{km} km: {label}"}
            for name in names:
                views = views_of(by_seed, group, name)
                row[name] = text_of(shares(by_seed, group, name, setting), views=views)
            learned = shares(by_seed, group, "overall", setting, learned=True)
            row["learned"] = f"{np.mean(learned):.0f}"
            rows.append(row)
    for label, source_row in (
        ("profile, likelihood", "profile, likelihood"),
        ("profile, ACN", "profile, ACN"),
        ("silhouette, nearest template", "silhouette, nearest template"),
    ):
        range_rows = [
            next(row for row in rows if row["what"] == f"{km} km: {source_row}") for km in RANGES
        ]
        summary.append(
            {"what": label}
            | {f"{km} km": row["overall"] for km, row in zip(RANGES, range_rows, strict=True)}
        )
    title = f"percent correct, mean of {seeds} seeds [95 % interval]"
    return {
        "summary": Report(
            "Ships identified at new aspects",
            (Column("what", title), *(Column(f"{km} km", f"{km} km") for km in RANGES)),
            summary,
        ),
        "new": Report(
            "Ships identified at new aspects, by bin",
            (
                Column("what", title),
                *(Column(name, name) for name in names),
                Column("learned", "at learned aspects"),
            ),
            rows,
        ),
        "spacing": spacings(by_seed),
    }


def add_known(summary: Report, known: Report) -> Report:
    """Return the table of the README with rows of classifiers that know gain and floor."""
    listed = ("the same, gain and floor known",)
    rows = [
        {"what": row["what"], f"{RANGES[-1]} km": row["overall"]}
        for row in known.rows
        if row["what"] in listed
    ]
    return replace(summary, rows=[summary.rows[0], *rows, *summary.rows[1:]])


def spacings(by_seed: Answers) -> Report:
    """Return the table of spacings of templates."""
    rows = []
    for km in (25, 100):
        for label, classifier, places in ROWS:
            if classifier == "acn_infrared":
                continue
            group = f"classification/{classifier}"
            row: dict[str, Any] = {"what": f"{km} km: {label}"}
            for spacing in SPACINGS:
                setting = {"range": km, "template_spacing": spacing, **places}
                for name in ("60-90°", "overall"):
                    views = views_of(by_seed, group, name)
                    row[f"{spacing:g} {name}"] = text_of(
                        shares(by_seed, group, name, setting), views=views
                    )
            rows.append(row)
    return Report(
        "Ships identified at new aspects, by spacing of templates",
        (
            Column("what", f"percent correct, mean of {len(by_seed)} seeds [95 % interval]"),
            *(
                Column(f"{spacing:g} {name}", f"{spacing:g}°, {name}")
                for spacing in SPACINGS
                for name in ("60-90°", "overall")
            ),
        ),
        rows,
    )


def fusion(by_seed: Answers, shifted: Answers) -> Report:
    """Return the gain of both sensors over the better one, in the same draws.

    At all ranges, and at 100 km also with images super-resolved from shifted frames.
    """
    rows = []
    names = ("0-30°", "30-60°", "60-90°")
    looks = [(f"{km} km", by_seed, km) for km in RANGES]
    for label, of_look, km in [*looks, ("100 km, 4 x 16 shifted frames", shifted, 100)]:
        row: dict[str, Any] = {"what": label}
        for spacing in SPACINGS:
            setting: dict[str, object] = {"range": km, "template_spacing": spacing}
            for name in names:
                percent = {
                    channel: np.array(
                        shares(
                            of_look, "classification/fusion", name, setting | {"channel": channel}
                        )
                    )
                    for channel in ("range", "infrared", "both")
                }
                better = max(("range", "infrared"), key=lambda channel: percent[channel].mean())
                gain = mean_over_seeds(percent["both"] - percent[better], bounds=(-100.0, 100.0))
                row[f"{spacing:g} {name}"] = gain.text(1, "+")
        rows.append(row)
    return Report(
        "Gain of both sensors over the better one",
        (
            Column("what", f"points gained, mean of {len(by_seed)} seeds [95 % interval]"),
            *(
                Column(f"{spacing:g} {name}", f"{spacing:g}°, {name}")
                for spacing in SPACINGS
                for name in names
            ),
        ),
        rows,
    )


CHANNELS = {"profile": "range", "silhouette": "infrared", "both": "both"}


def sensors(near: Answers, far: Answers) -> dict[str, Report]:
    """Return the table of profile, silhouette and both, where each carries information.

    At 25 km with sparse templates, and at 100 km with images of shifted frames.
    """
    rows = []
    cases: list[tuple[str, Answers, int, float]] = [("25 km, templates every 6°", near, 25, 6)]
    cases += [
        (f"100 km, 4 x 16 shifted frames, templates every {spacing:g}°", far, 100, spacing)
        for spacing in SPACINGS
    ]
    for label, answers, km, spacing in cases:
        for name in ("0-30°", "30-60°", "60-90°", "overall"):
            setting: dict[str, object] = {"range": km, "template_spacing": spacing}
            views = views_of(answers, "classification/fusion", name)
            percent = {
                title: shares(
                    answers, "classification/fusion", name, setting | {"channel": channel}
                )
                for title, channel in CHANNELS.items()
            }
            row = {"what": f"{label}: {name}"}
            row |= {title: text_of(values, views=views) for title, values in percent.items()}
            better = max(
                ("profile", "silhouette"), key=lambda title: float(np.mean(percent[title]))
            )
            gain = np.array(percent["both"]) - np.array(percent[better])
            row["gain"] = mean_over_seeds(gain, bounds=(-100.0, 100.0)).text(1, "+")
            rows.append(row)
    columns = (
        Column("what", f"percent correct, mean of {len(near)} seeds [95 % interval]"),
        *(Column(title, title) for title in CHANNELS),
        Column("gain", "both less the better one, points"),
    )
    return {"sensors": Report("Both sensors where each carries information", columns, rows)}


def prior_knowledge(by_seed: Answers) -> dict[str, Report]:
    """Return the table of classifiers that know gain and floor, at 100 km."""
    group, rows = "classification/likelihood", []
    names = ("0-30°", "30-60°", "60-90°", "overall")

    def add(label: str, percentages: Callable[[str], list[float]]) -> None:
        rows.append(
            {"what": label}
            | {
                name: text_of(percentages(name), views=views_of(by_seed, group, name))
                for name in names
            }
        )

    for label, gain, floor in (
        ("maximum likelihood, gain and floor unknown", 1, 1),
        ("the same, floor known", 1, 0),
        ("the same, gain known", 0, 1),
        ("the same, gain and floor known", 0, 0),
    ):
        add(
            label,
            lambda name, gain=gain, floor=floor: shares(  # type: ignore[misc]
                by_seed, group, name, {"gain_sigma": gain, "floor_sigma": floor}
            ),
        )
    title = f"percent correct at 100 km, mean of {len(by_seed)} seeds [95 % interval]"
    columns = (Column("what", title), *(Column(name, name) for name in names))
    return {"known": Report("Known gain and floor", columns, rows)}


KNOWLEDGE = {
    "gain and floor unknown": {"gain_sigma": 1, "floor_sigma": 1},
    "floor known": {"gain_sigma": 1, "floor_sigma": 0},
    "gain known": {"gain_sigma": 0, "floor_sigma": 1},
    "gain and floor known": {"gain_sigma": 0, "floor_sigma": 0},
}
"""Prior standard deviations of gain and floor, by prior knowledge."""


def places(by_places: Mapping[str, Answers]) -> dict[str, Report]:
    """Return percent correct, log loss and calibration error by the places of templates."""
    rows: list[dict[str, Any]] = []
    for known, sigmas in KNOWLEDGE.items():
        correct, loss, calibration = (
            {"what": f"{known}: {name}"}
            for name in ("percent correct", "log loss", "calibration error, all seeds together")
        )
        for label, answers in by_places.items():
            groups = [by_group["classification/likelihood"] for by_group in answers]
            of_seed = [confidence([group], sigmas) for group in groups]
            correct[label] = text_of(
                [100 * float(scores.accuracy.fraction[-1]) for scores in of_seed]
            )
            loss[label] = mean_over_seeds([scores.log_loss for scores in of_seed]).text(2)
            calibration[label] = f"{confidence(groups, sigmas).ece:.2f}"
        rows += [correct, loss, calibration]
    title = f"100 km, mean of {len(next(iter(by_places.values())))} seeds [95 % interval]"
    columns = (Column("what", title), *(Column(label, label) for label in by_places))
    return {"places": Report("Places of the ship that templates know", columns, rows)}


def confidence(several: Sequence[xr.Dataset], where: Mapping[str, object]) -> Scores:
    """Return all scores of some seeds' answers at new aspects."""
    parts: list[tuple[NDArray[Any], ...]] = []
    for answers in several:
        new = answers.isel(aspect=~multiples_mask(answers.aspect.values, STEP))
        predicted, true, similarity = (
            pick(new[name], **where).transpose("ship", "aspect", ...).values.reshape(-1)
            for name in ("predicted", "probability", "similarity")
        )
        ship, aspect = np.indices((new.sizes["ship"], new.sizes["aspect"])).reshape(2, -1)
        # The store has the probabilities of the true and the predicted ship; others share the rest.
        other_ships = new.sizes["ship"] - 1 - (predicted != ship)
        remainder = (
            np.maximum(1 - similarity - np.where(predicted == ship, 0, true), 0) / other_ships
        )
        likely = np.repeat(remainder[:, None], new.sizes["ship"], axis=1)
        likely[np.arange(len(ship)), ship] = true
        likely[np.arange(len(ship)), predicted] = similarity
        likely /= likely.sum(axis=1, keepdims=True)
        parts.append((new.ship.values[ship], likely, new.aspect.values[aspect]))
    true_ships, likely, aspects = map(np.concatenate, zip(*parts, strict=True))
    options = {"classes": several[0].ship.values.tolist(), "aspect": aspects}
    return score(true_ships, likely, groups=np.arange(len(aspects)), **options)


TRACKS = (10, 5, 2, 0)  # standard deviations of a tracker's aspect [deg]


def track_benefit(by_seed: Answers, with_track: Answers) -> dict[str, Report]:
    """Return the table of the benefit of a track, by its error and by prior knowledge."""
    group, rows = "classification/likelihood", []
    for spacing in (STEP, 4 * STEP):
        for label, knowledge in KNOWLEDGE.items():
            setting: dict[str, object] = {"template_spacing": spacing, **knowledge}
            views = views_of(by_seed, group, "overall")
            row = {"what": f"templates every {spacing:g}°: {label}"}
            row["no track"] = text_of(shares(by_seed, group, "overall", setting), views=views)
            for sigma in TRACKS:
                percentages = shares(
                    with_track, group, "overall", setting | {"aspect_sigma": sigma}
                )
                row[f"{sigma}°"] = text_of(percentages, views=views)
            rows.append(row)
    title = f"percent correct at 100 km, mean of {len(by_seed)} seeds [95 % interval]"
    columns = (
        Column("what", title),
        *(Column(name, name) for name in ("no track", *(f"{sigma}°" for sigma in TRACKS))),
    )
    return {"track": Report("Aspect from a track", columns, rows)}


# The article's protocol

SOURCE_BINS = ("0-27°", "30-57°", "60-90°", "overall")


def seed_percentages(correct: xr.DataArray, name: str) -> list[float]:
    """Return percent correct of each seed in a bin of the article's 31 aspects."""
    chosen = bins_of(correct.aspect.values)[name]
    return [percent_of(correct.sel(seed=seed), chosen) for seed in correct.seed.values]


def protocol(groups: Mapping[str, xr.Dataset]) -> dict[str, Report]:
    """Return the tables of the article's protocol: learned aspects at 100 km, and silhouettes."""
    acn, mnn = groups["classification/acn"], groups["classification/mnn"]
    answers = groups["classification/likelihood"].correct
    seeds = acn.sizes["seed"]
    still = {"learn_in_test": False}
    profiles: list[tuple[str, xr.DataArray]] = [
        ("ACN, training", pick(acn.training_correct, **still))
    ]
    for count in (32, 16, 8, 4):
        profiles.append((f"ACN, {count} frames", pick(acn.correct, frame_count=count, **still)))
    profiles += [
        (
            "ACN, 16 frames, learning in the test, as in the article",
            pick(acn.correct, frame_count=16, learn_in_test=True),
        ),
        ("MNN, ship and aspect group, 16 frames", pick(mnn.correct, frame_count=16)),
        ("MNN, ship alone, 16 frames", pick(mnn.ship_correct, frame_count=16)),
        (
            "correlation with every profile learned, 16 frames",
            pick(groups["classification/correlation"].correct, frame_count=16),
        ),
        (
            "maximum likelihood, gain and floor unknown, 16 frames",
            pick(answers, frame_count=16, gain_sigma=1),
        ),
        ("maximum likelihood, gain known, 16 frames", pick(answers, frame_count=16, gain_sigma=0)),
    ]
    silhouette_answers = pick(groups["classification/acn_infrared"].correct, **still)
    silhouettes = []
    for label, km, way in (
        ("25 km", 25, "none"),
        ("50 km, 2x super-resolution assumed perfect", 50, "perfect"),
        ("50 km, 2x from shifted frames, 4 x 16 of them", 50, "shifted"),
        ("50 km", 50, "none"),
        ("100 km, 2x super-resolution assumed perfect", 100, "perfect"),
        ("100 km, 2x from shifted frames, 4 x 16 of them", 100, "shifted"),
        ("100 km", 100, "none"),
    ):
        silhouettes.append((label, pick(silhouette_answers, range=km, super_resolution=way)))
    reports = {}
    for name, title, rows in (
        ("protocol", "Learned aspects, the article's protocol", profiles),
        ("silhouettes", "Silhouettes, the article's protocol", silhouettes),
    ):
        heading = f"percent correct, mean of {seeds} seeds [95 % interval]"
        columns = (
            Column("what", heading),
            *(Column(source_bin, source_bin) for source_bin in SOURCE_BINS),
        )
        masks = dict(zip(SOURCE_BINS, bins_of([0.0]), strict=True))
        reports[name] = Report(
            title,
            columns,
            [
                {"what": label}
                | {span: text_of(seed_percentages(correct, masks[span])) for span in SOURCE_BINS}
                for label, correct in rows
            ],
        )
    return reports


def categories(groups: Mapping[str, xr.Dataset]) -> dict[str, Report]:
    """Return the numbers of categories by pulse width; orders of presentation are redrawn."""
    category = groups["classification/acn"]["training_category"].max(("ship", "aspect")) + 1
    category = category.isel(order=slice(1, None))  # the first is the grid's own, of every seed
    width = [int(value) for value in category.pulse_width.values]
    row: dict[str, Any] = {"what": "here"}
    for ns in width:
        counts = category.sel(pulse_width=ns)
        of_seed = [float(counts.sel(seed=seed).mean()) for seed in counts.seed.values]
        row[str(ns)] = mean_over_seeds(of_seed, bounds=(0, np.inf)).text(1)
    source: dict[str, Any] = {"what": "article, Table 3"} | dict(
        zip(map(str, (10, 30, 50)), ("26", "18", "16"), strict=True)
    )
    heading = f"categories formed at vigilance 0.95, mean of {category.sizes['seed']} seeds"
    columns = (
        Column("what", f"{heading} [95 % interval]"),
        *(Column(str(ns), f"{ns} ns") for ns in width),
    )
    return {"categories": Report("Categories of range profiles", columns, [row, source])}


# Unknown ships


UNKNOWN_SHIPS = ("connole", "roberts")
TEMPLATE_SPACINGS = (0.5, 1.5, 3)  # spacings of templates [deg]
REJECTED_SHARE = 0.9  # of answers to unknown ships


def open_set(
    classified: xr.Dataset, unknown_ships: Sequence[str] = UNKNOWN_SHIPS, **places: object
) -> dict[str, float]:
    """Return AUROC, OSCR and the percentage kept by a classifier at new aspects of one seed.

    Ships of the alternative are not tested.
    """
    answers = classified.isel(
        aspect=~multiples_mask(classified.aspect.values, TEMPLATE_SPACINGS[0])
    )
    answers = answers.isel(ship=["@" not in str(ship) for ship in answers.ship.values])
    known = ~np.isin(answers.ship.values, unknown_ships)
    arrays = {
        "similarity": pick(answers.similarity, **places),
        "correct": pick(answers.correct, **places) == 1,
    }
    similarity, right = (array.transpose("ship", ...).values for array in arrays.values())
    learned = np.broadcast_to(known.reshape(-1, *[1] * (similarity.ndim - 1)), similarity.shape)
    scores = open_set_scores(similarity, right, learned)
    limit = np.quantile(similarity[~learned], REJECTED_SHARE, method="inverted_cdf")
    retained = 100 * float((right & (similarity > limit))[learned].mean())
    return {"auroc": scores.auroc, "oscr": scores.oscr, "kept": retained}


def unknown_rejection(
    looked_up: Answers,
    likely: Answers,
    generated: Mapping[str, Answers],
    against: Answers,
    themselves: Answers,
) -> dict[str, Report]:
    """Return the scores of rejecting ships absent from training.

    Answers are by cosine, by likelihood, and by likelihood with an alternative: ships generated
    from the learned ones, variants of the unknown ships, or, as a bound, these ships themselves.
    """
    kinds: list[tuple[str, str, Answers, dict[str, Any]]] = [
        ("ACN, cosine, 3°", "acn", looked_up, {}),
        ("correlation, cosine, 3°", "correlation", looked_up, {}),
    ]
    spacings_tried = tuple(reversed(TEMPLATE_SPACINGS))
    for label, answers, weight, spacings in (
        ("posterior probability", likely, 0.0, spacings_tried),
        ("posterior probability and fit", likely, 0.01, spacings_tried),
        *(
            (f"density over that of generated ships {lengths}", answers, 0.01, spacings_tried[:1])
            for lengths, answers in generated.items()
        ),
        ("density over that of variants of the unknown ships", against, 0.01, spacings_tried[:1]),
        ("density over that of the unknown ships themselves", themselves, 0.01, spacings_tried[:1]),
    ):
        for spacing in spacings:
            setting: dict[str, Any] = {"template_spacing": spacing, "misfit_weight": weight}
            kinds.append((f"likelihood, {label}, {spacing:g}°", "likelihood", answers, setting))
    rows = []
    for km in (25, 100):
        for label, name, answers, setting in kinds:
            if km != 100 and any(answers is other for other in generated.values()):
                continue
            scores = [
                open_set(groups[f"classification/{name}"], range=km, **setting)
                for groups in answers
            ]
            row = {
                "what": f"{km} km: {label}",
                "kept": text_of([scored["kept"] for scored in scores]),
            }
            for area in ("auroc", "oscr"):
                row[area] = mean_over_seeds(
                    [scored[area] for scored in scores], bounds=(0, 1)
                ).text(2)
            rows.append(row)
    columns = (
        Column("what", f"similarity, mean of {len(likely)} seeds [95 % interval]"),
        *(Column("auroc", "AUROC"), Column("oscr", "OSCR")),
        Column("kept", "known ships right where 90 % of unknown ones are rejected [%]"),
    )
    return {"unknown": Report("Unknown ships", columns, rows)}


def pairs(answers: Mapping[tuple[str, str], Mapping[str, Answers]]) -> dict[str, Report]:
    """Return the share of known ships kept at 100 km if two of six ships are unknown.

    By the unknown pair and by the alternative of the likelihood ratio.
    """
    alternatives = list(next(iter(answers.values())))
    retained = {
        alternative: np.array(
            [
                [
                    open_set(groups["classification/likelihood"], pair)["kept"]
                    for groups in by_alternative[alternative]
                ]
                for pair, by_alternative in answers.items()
            ]
        )
        for alternative in alternatives
    }
    rows = [
        {"what": " and ".join(name.title() for name in pair)}
        | {alternative: text_of(percent[k]) for alternative, percent in retained.items()}
        for k, pair in enumerate(answers)
    ]
    rows.append(
        {"what": "mean of all pairs"}
        | {alternative: text_of(percent.mean(axis=0)) for alternative, percent in retained.items()}
    )
    spread = {alternative: percent.mean(axis=1) for alternative, percent in retained.items()}
    rows.append(
        {"what": "standard deviation of pairs [lowest-highest]"}
        | {
            alternative: f"{percent.std(ddof=1):.0f} [{percent.min():.0f}-{percent.max():.0f}]"
            for alternative, percent in spread.items()
        }
    )
    seeds = retained[alternatives[0]].shape[1]
    columns = (
        Column("what", f"unknown ships, mean of {seeds} seeds [95 % interval]; alternative:"),
        *(Column(alternative, alternative) for alternative in alternatives),
    )
    return {"pairs": Report("Every pair of six ships unknown", columns, rows)}
