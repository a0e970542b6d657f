"""The command that draws pictures of ships and sweeps.

python -m sweeps.report.figures ships PICTURE
python -m sweeps.report.figures KIND STORE PICTURE
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from sweeps.report.rows import attributes, groups, opened, read

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS = {
    "profiles": "range profiles by aspect, ship and number of frames",
    "tables": "percent correct by aspect and number of frames, beside the source's",
    "silhouettes": "infrared images, silhouettes and log-polar maps by range",
    "formation": "categories formed from silhouettes, by ship and aspect",
    "profile_formation": "categories formed from range profiles, by ship and aspect",
    "table5": "percent correct of silhouettes by range and super-resolution, beside the source's",
    "classifiers": "percent correct of every classifier by aspect and number of frames",
    "fusion": "percent correct of profile, silhouette and both by aspect and range",
    "spacing": "percent correct at aspects absent from training, by template spacing",
    "flight": "images of a flight after each correction, beside the truth",
    "validation": "measured near-stern profiles beside noiseless and synthetic ones",
    "sensitivity": "effect of wrong flight parameters, with and without autofocus",
    "measured": "percent correct of measured profiles after training on synthetic ones",
    "scan": "field of regard with its detections and visits, scores and times",
    "runtime_vs_error": "error of range extents against run time, by engine",
}


def main() -> None:
    """Run the command line; exits with 2 when the picture cannot be made."""
    parser = argparse.ArgumentParser(
        prog="python -m sweeps.report.figures", description="Draw pictures of ships and sweeps."
    )
    kinds = parser.add_subparsers(dest="kind", required=True)
    kinds.add_parser("ships", help="the six ships, from their range images")
    for kind, text in KINDS.items():
        kinds.add_parser(kind, help=text).add_argument(
            "store", type=Path, help="store of a sweep, such as sweep.zarr"
        )
    for subparser in kinds.choices.values():
        subparser.add_argument("picture", type=Path, help="file to write, such as ships.png")
    arguments = parser.parse_args()
    try:
        figure = draw(arguments.kind, getattr(arguments, "store", Path()))
    except (OSError, KeyError, ValueError) as error:
        print(f"figures: {arguments.kind} cannot be drawn: {error}", file=sys.stderr)
        sys.exit(2)
    figure.savefig(arguments.picture)


def draw(kind: str, path: Path) -> Figure:
    """Draw the ships, or a picture of a store. Raises ValueError if it lacks what is drawn."""
    from sweeps.report import (
        formation_figures,
        infrared_figures,
        run_time_figures,
        scan_figures,
        score_figures,
        sensitivity_figures,
        ship_figures,
        spacing_figures,
    )
    from sweeps.report.fair import read_compared
    from sweeps.report.silhouettes import fusion_rows
    from sweeps.report.tables import TITLES, classifier_rows

    if kind == "ships":
        return ship_figures.draw_ships()
    store = opened(path)
    match kind:
        case "profiles":
            profiles = read(store, "range_profile")[["expected", "averaged"]]
            return ship_figures.draw_profiles(profiles)
        case "tables":
            return score_figures.draw_tables(read_compared(store, "tables/acn").load())
        case "runtime_vs_error":
            table = read(store, "tables/run_time_samplings").load()
            return run_time_figures.draw_run_time(table)
        case "scan":
            found, table = read(store, "scan").load(), read(store, "tables/scan").load()
            return scan_figures.draw_scan(found, table, attributes(store)["configuration"])
        case "measured":
            return score_figures.draw_measured(read(store, "tables/measured").load())
        case "fusion":
            return score_figures.draw_fusion(fusion_rows(read(store, "tables/fusion").load()))
        case "classifiers":
            names = [name for name in groups(store, "tables") if name in TITLES]
            there = {name: read_compared(store, f"tables/{name}").load() for name in names}
            return score_figures.draw_classifiers(classifier_rows(there))
        case "spacing":
            names = [name for name in groups(store, "tables")]
            scores = {name: read(store, f"tables/{name}") for name in names}
            scores = {name: one.load() for name, one in scores.items() if "accuracy" in one}
            return spacing_figures.draw_spacing(scores)
        case "silhouettes":
            given = attributes(store)["configuration"]["infrared"]
            return infrared_figures.draw_silhouettes(read(store, "infrared"), given)
        case "profile_formation":
            classified = read(store, "classification/acn")
            return formation_figures.draw_formation(classified, formation_figures.PROFILES)
        case "formation" | "table5":
            classified = read(store, "classification/acn_infrared")
            if kind == "formation":
                return formation_figures.draw_formation(classified, formation_figures.SILHOUETTES)
            tables = read_compared(store, "tables/acn_infrared").load()
            return score_figures.draw_table5(tables, ships=classified.sizes["ship"])
    flights = read(store, "validation")
    if kind == "sensitivity":
        return sensitivity_figures.draw_sensitivity(flights)
    # Imported here because simulating flights takes a third of a second to import.
    from sweeps.report import flight_figures

    if kind == "flight":
        place = flight_figures.flights_of(flights)[0]
        return flight_figures.draw_flight(attributes(store), flights, place)
    return flight_figures.draw_validation(flights)


if __name__ == "__main__":
    main()
