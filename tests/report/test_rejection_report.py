"""Unknown ships in the report: percentages, intervals and counts are the table's."""

import io
import re

import numpy as np
import pytest
import xarray as xr
from made import with_units
from rich.console import Console

from sweeps.report.tables import REJECTED as FIGURES
from sweeps.report.tables import curve_rows, print_rejection, rejection_rows

LEAST = [0.0, 0.5, 0.9]


def rejected(**axes):
    """A table by chance: test vigilances and least shares, of learned aspects and between them."""
    rng = np.random.default_rng(0)
    coords = axes | {"aspects": ["between", "learned"], "frame_count": 16}
    along = [name for name, value in coords.items() if isinstance(value, list)]
    data = {}
    for name, own in (
        *((name, "test_vigilance") for name in FIGURES),
        ("correct_where_rejected", "least_rejected"),
        ("rejected_up_to", "least_rejected"),
        ("auroc", None),
        ("oscr", None),
    ):
        dims = [*along, *([own] if own else [])]
        sizes = {"test_vigilance": 2, "least_rejected": len(LEAST)}
        shape = [sizes.get(dim) or len(coords[dim]) for dim in dims]
        share = rng.uniform(0.3, 0.7, shape)
        data[name] = (dims, share)
        if own and name != "rejected_up_to":
            data |= {f"{name}_ci_low": (dims, share - 0.1), f"{name}_ci_high": (dims, share + 0.1)}
    for name, count in (("n_known", 60), ("n_unknown", 40)):
        data[name] = (along, np.full([len(coords[dim]) for dim in along], count))
    coords |= {"test_vigilance": [0.5, 0.95], "least_rejected": LEAST}
    return with_units(xr.Dataset(data, coords))


def test_rows_are_the_cells_of_the_table():
    table = rejected()
    rows = rejection_rows({"correlation": table})
    assert len(rows) == 2 * 2
    for row in rows:
        at = table.sel(aspects=row["aspects"], test_vigilance=row["test_vigilance"])
        assert (row["n_known"], row["n_unknown"]) == (60, 40)
        for name in FIGURES:
            assert row[f"percent_{name}"] == pytest.approx(100 * float(at[name]), abs=0.0501)
            for end in ("ci_low", "ci_high"):
                wanted = 100 * float(at[f"{name}_{end}"])
                assert row[f"{name}_{end}"] == pytest.approx(wanted, abs=0.0501)
    for row in curve_rows({"correlation": table}):
        least = row["least_percent_rejected"] / 100
        at = table.sel(aspects=row["aspects"], least_rejected=least)
        wanted = 100 * float(at.correct_where_rejected)
        assert row["percent_correct"] == pytest.approx(wanted, abs=0.0501)
        assert row["rejected_up_to"] == float(at.rejected_up_to)
        for name in ("auroc", "oscr"):
            assert row[name] == pytest.approx(float(at[name]), abs=0.000501)


def test_the_screen_shows_figures_over_their_intervals():
    table = rejected(cnr=[10.0, 20.0])
    for name in ("correct_where_rejected", "auroc", "oscr"):
        table[name][{"aspects": 0}] = np.nan
    curve = curve_rows({"correlation": table, "acn": rejected()})
    screen = io.StringIO()
    print_rejection(curve, Console(file=screen))
    lines = screen.getvalue().splitlines()
    assert not re.search(r"\b(nan|None)\b", screen.getvalue())
    learned = [row for row in curve if row["aspects"] == "learned"]
    # A section for each kind of aspects, in it a row for each classifier and level of noise.
    (begin,) = (k for k, line in enumerate(lines) if "learned" in line)
    shown = [k for k in range(begin, len(lines)) if " + " in lines[k] and k < begin + 7]
    assert len(shown) == 3
    for k, first in zip(shown, range(0, 9, 3), strict=True):
        rows = learned[first : first + 3]
        label, _, figures_of = lines[k].partition("60 +")
        above = re.findall(r"[\d.-]+", figures_of)
        figures = [f"{row['percent_correct']:.0f}" for row in rows]
        assert above == [*figures, *(f"{rows[0][name]:.2f}" for name in ("auroc", "oscr"))]
        ends = [f"{row['ci_low']:.0f}-{row['ci_high']:.0f}" for row in rows]
        assert re.findall(r"[\d-]+", lines[k + 1])[-4:] == ["40", *ends]
        noise = rows[0]["cnr_db"]
        assert noise is None or f"cnr {noise:g} dB" in label
