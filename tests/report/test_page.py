"""The report page states results and failures first, is safe, and has tables without a script."""

import base64
import hashlib
import re
from importlib.resources import files

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from made import displayed, scores
from pages import page_of, parsed, read_page, stored

from sweeps.engine.run.schedule import Progress
from sweeps.report.frames import Column, Frame, frame, read_frames
from sweeps.report.outputs import page_file
from sweeps.report.scales import axis_of, figure_of, scale_of
from sweeps.report.timings import write_timings

LARGEST = 5_000_000  # bytes of the smoke experiment's page, of which charts take 0.9 MB


@pytest.fixture(scope="module")
def smoke(smoke_store):
    return read_page(page_file(smoke_store))


def states(*given):
    """Return a dataset of the states of some cells."""
    return xr.Dataset({"extent": ("ship", np.array(given, dtype="i1"))})


def test_page_has_every_table_with_the_values_of_its_frame(smoke, smoke_store):
    for name, table in read_frames(smoke_store).items():
        section, figure = smoke.root.only("section", id=f"table-{name}"), table.figures[0]
        cells = [td for td in section.all("td") if td.attrs.get("data-f") == figure]
        assert cells, name
        for cell in cells:
            value = table.rows.loc[int(cell.attrs["data-r"]), figure]
            text = table.columns[figure].text(value)
            assert cell.text.split()[0] == text, name


def test_page_shows_rows_of_one_setting_without_a_script(smoke, smoke_store):
    table = read_frames(smoke_store)["scores"]
    section = smoke.root.only("section", id="table-scores")
    shown_rows = [row for row in section.all("tr") if "hidden" not in row.attrs and row.all("td")]
    labels = [
        int(row.all("td")[-1].attrs["data-r"])
        for row in shown_rows
        if "data-r" in row.all("td")[-1].attrs
    ]
    rows = table.rows.loc[labels]
    assert rows.vigilance.dropna().nunique() <= 2 and rows.kind.unique().tolist() == ["test"]
    assert {"acn", "mnn", "correlation", "likelihood", "fusion"} <= set(rows.classifier)


def test_python_snippet_below_a_table_returns_its_rows(smoke, smoke_store, monkeypatch):
    monkeypatch.chdir(smoke_store.parent)
    for name in ("scores", "categories"):
        section = smoke.root.only("section", id=f"table-{name}")
        imported, code = section.all("code")[0].text.split("\n")
        assert imported == "from sweeps.report.frames import frame"
        assert len(eval(code, {"frame": frame})) == len(read_frames(smoke_store)[name].rows)


@pytest.mark.parametrize(
    ("given", "word", "said"),
    [
        ((1, 1, 1), "complete", "3 of 3 results done"),
        ((1, 1, 0), "partial", "2 of 3 results done, 1 failed"),
        ((1, -1, 0), "partial", "1 of 3 results done, 1 failed, 1 missing"),
        ((0, 0, 0), "failed", "0 of 3 results done, 3 failed"),
    ],
)
def test_page_of_an_incomplete_sweep_begins_with_an_alert(given, word, said, tmp_path):
    why = {"extent ship=duncan": "ValueError: <no> mesh"} if 0 in given else {}
    attributes = {"configuration": {}, "title": "T", "failures": why}
    path = stored(
        tmp_path / "s.zarr", attributes, status=states(*given), tables__o=scores(a=[1, 2])
    )
    page = parsed(page_of(path))
    title, alerts = page.root.only("head").only("title").text, page.root.all("div", role="alert")
    header = page.root.only("header", id="summary").text
    assert said in header
    if word == "complete":
        assert title == "s.zarr – T" and not alerts and "Complete" in header
    else:
        assert title.startswith(f"{word.upper()}: ")
        assert alerts[0].text.startswith(f"{word.capitalize()}: this sweep is not complete.")
        assert "✓" not in header and "Complete" not in header
        assert all(f"{what}: {reason}" in alerts[0].text for what, reason in why.items())


def test_cells_are_counted_as_on_the_screen(tmp_path):
    path = stored(tmp_path / "s.zarr", status=states(1, 1, 1), tables__o=scores(a=[1, 2]))
    write_timings(path, {"extent": Progress(1200, 200, 999, 1), "profile": Progress(51, 51)})
    header = parsed(page_of(path)).root.only("header", id="summary").text
    assert "1,250 of 1,251 cells done, 1 failed" in header


def test_a_page_is_there_when_every_cell_of_a_classifier_failed(tmp_path):
    empty = scores(frame_count=[4, 8]).where(False)  # no answers, and so no accuracy
    empty["n"] = empty.n.fillna(0).astype("i4")
    why = {"acn frame_count=4": "ValueError: shapes", "acn frame_count=8": "ValueError: shapes"}
    attributes = {"configuration": {}, "title": "T", "failures": why}
    path = stored(
        tmp_path / "s.zarr", attributes, status=states(0, 0), tables__acn=displayed(empty)
    )
    (alert,) = parsed(page_of(path)).root.all("div", role="alert")
    assert all(f"{what}: {reason}" in alert.text for what, reason in why.items())


def test_a_store_without_states_does_not_look_complete(tmp_path):
    page = parsed(page_of(stored(tmp_path / "s.zarr", tables__o=scores(a=[1, 2]))))
    assert page.root.only("head").only("title").text.startswith("UNKNOWN: ")


def test_transforms_of_own_meshes_are_on_the_page(tmp_path):
    attributes = {"mesh_digests": {"own": "ab12"}, "mesh_transforms": {"own": "up: y, scale: 0.01"}}
    page = parsed(page_of(stored(tmp_path / "s.zarr", attributes, tables__o=scores(a=[1, 2]))))
    text = page.root.only("section", id="configuration").text
    assert "Transforms of the ships' meshes" in text and "up: y, scale: 0.01" in text


# safety -------------------------------------------------------------------------------------------

HOSTILE = [
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "\x1b[31mred",
    "=1+1",
    "'; alert(1); //",
    "</script><b>",
    "{{ 7 * 7 }}",
]


def test_page_escapes_all_strings_of_a_store(tmp_path):
    path = tmp_path / '"><img src=x onerror=alert(1)>\x1b[31m{{ 7*7 }}.zarr'
    count = len(HOSTILE)
    predictions = xr.Dataset(
        {"predicted": (("ship", "aspect"), np.zeros((count, 2), dtype="i2"))},
        {"ship": HOSTILE, "aspect": [0.0, 90.0]},
    )
    table = scores(word=HOSTILE, size=[1.0, 2.0])
    table.accuracy.attrs["long_name"] = table["size"].attrs["units"] = HOSTILE[0]
    table["size"].attrs["long_name"] = HOSTILE[1]
    other = xr.Dataset({HOSTILE[0].replace("/", ""): ("word", np.arange(count))}, {"word": HOSTILE})
    portraits = xr.Dataset({"length": ("ship", np.ones(count))}, {"ship": HOSTILE})
    portraits["warning"] = ("ship", HOSTILE)
    attributes = {
        "title": HOSTILE[0],
        "configuration": {"grid": {"ship": HOSTILE, HOSTILE[1]: HOSTILE[2]}},
        "failures": dict(zip(HOSTILE, HOSTILE, strict=True)),
        "versions": {HOSTILE[1]: HOSTILE[0]},
        "seed": HOSTILE[5],
    }
    groups = {"classification__x": predictions, "tables__x": table, "ships": portraits}
    stored(path, attributes, **groups, status=states(1, 0))
    other.assign_attrs(title=HOSTILE[1]).to_zarr(
        path, group="tables/other", mode="a", consolidated=False
    )
    (path.parent / "x").mkdir()
    page = parsed(page_of(path))
    assert len(page.root.all("script")) == 5 and not page.root.all("img")
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f]", page.written)
    assert not any(key.startswith("on") for element in all_of(page.root) for key in element.attrs)
    assert "49" not in page.root.only("head").only("title").text
    for word in HOSTILE:
        assert word.replace("\x1b", "\\x1b") in page.root.text
    words = page.data["tables"]["x"]["rows"]["word"]
    assert set(words) == {word.replace("\x1b", "\\x1b") for word in HOSTILE}


def test_non_finite_numbers_become_null_in_page_data(tmp_path):
    table = xr.Dataset({"height": ("size", [1.0, np.inf, np.nan])}, {"size": [1.0, 2.0, 3.0]})
    page = parsed(page_of(stored(tmp_path / "s.zarr", tables__o=table)))
    assert page.data["tables"]["o"]["rows"]["height"] == [1.0, None, None]


def test_log_scale_needs_positive_values_of_large_ratio():
    logarithmic = [
        scale_of(ends, 6) == {"type": "log"} for ends in ([1, 7], [1, 6], [0, 7], [-1, 7])
    ]
    assert logarithmic == [True, False, False, False]


@pytest.mark.parametrize(("format", "unit", "whole"), [(".1%", "", 1), (".0f", "%", 100)])
def test_fractions_and_percentages_have_a_linear_scale(format, unit, whole):
    column = Column("share", "share", "share", unit, role="figure", format=format)
    rows = pd.DataFrame({"share": [0.001 * whole, 1.0 * whole]})
    scale = figure_of(Frame("x", "X", rows, {"share": column}), "share")["y"]["scale"]
    assert scale["domain"] == [0, whole] and "type" not in scale


ISING = xr.Dataset(
    {"magnetisation": (("size", "temperature"), np.arange(6.0).reshape(2, 3))},
    {"size": [8, 16], "temperature": [1.5, 2.3, 3.0]},
)


@pytest.mark.parametrize(
    ("table", "along", "colour"),
    [
        (displayed(scores(range=[25.0, 50.0], cnr=[5.0, 10.0, 20.0])), "cnr_db", "range_km"),
        (ISING, "temperature", "size"),
    ],
)
def test_chart_has_the_headline_axis_as_x_axis(table, along, colour, tmp_path):
    attributes = {
        "configuration": {},
        "title": "T",
        "swept": ["size", "temperature", "cnr", "range"],
    }
    page = parsed(page_of(stored(tmp_path / "s.zarr", attributes, tables__acn=table)))
    for name, first in (("against", along), ("colour", colour)):
        (chosen,) = page.root.only("select", id=name).all("option", selected="")
        assert chosen.attrs["value"] == first


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        (["aspect-random", "few-frames"], "nominal"),
        (["0-27", "30-57", "overall"], "ordinal"),
        ([25.0, 50.0, 100.0], "quantitative"),
    ],
)
def test_axis_type_is_nominal_for_words_only(values, kind):
    column = Column("axis", "axis", "axis")
    rows = pd.DataFrame({"axis": values})
    assert axis_of(column, Frame("x", "X", rows, {"axis": column}))["type"] == kind


def all_of(element):
    return [element, *(descendant for child in element.children for descendant in all_of(child))]


def test_content_security_policy_allows_only_own_style_and_script(smoke):
    (policy,) = [
        meta.attrs["content"]
        for meta in smoke.root.all("meta")
        if meta.attrs.get("http-equiv") == "Content-Security-Policy"
    ]
    rules = dict(rule.split(" ", 1) for rule in policy.split("; "))
    assert rules.pop("default-src") == "'none'" and rules.pop("img-src") == "data:"
    assert rules.pop("base-uri") == rules.pop("form-action") == "'none'"
    code = [script.text for script in smoke.root.all("script") if "type" not in script.attrs]
    for kind, texts in (("script-src", code), ("style-src", [smoke.root.only("style").text])):
        digests = [
            base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in texts
        ]
        assert rules.pop(kind) == " ".join(f"'sha256-{digest}'" for digest in digests)
    assert not rules
    assert not any("style" in element.attrs for element in all_of(smoke.root))


def test_page_is_self_contained(smoke):
    assert len(smoke.written.encode()) < LARGEST
    for element in all_of(smoke.root):
        for key in ("src", "href", "action", "srcset", "data"):
            assert element.attrs.get(key, "#").startswith(("#", "data:"))
    style = smoke.root.only("style").text
    script = "".join(script.text for script in smoke.root.all("script")[-2:])
    assert "http" not in style + script and "url(" not in style and "@import" not in style
    assert "innerHTML" not in script and "eval(" not in script and "Function(" not in script


def luminance(colour):
    """Return the relative luminance of a colour (WCAG 2.2)."""
    share = np.asarray(colour) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(first, second):
    low, high = sorted(map(luminance, (first, second)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_and_curves_meet_wcag_contrast(scheme):
    """Contrast is at least 4.5 for text (WCAG 2.2, 1.4.3) and 3 for curves (1.4.11)."""
    style = files("sweeps.report.page").joinpath("templates/page.css").read_text(encoding="utf-8")
    blocks = re.findall(r":root \{(.*?)\}", style, re.DOTALL)
    block = blocks[("light", "dark").index(scheme)]
    colour = {
        name: [int(value[k : k + 2], 16) for k in (0, 2, 4)]
        for name, value in re.findall(r"--([\w-]+): #([0-9a-f]{6})", block)
    }
    words = ("ink", "soft", "link", "good", "bad", "focus")
    for ground in ("paper", "panel"):
        assert min(contrast(colour[name], colour[ground]) for name in words[:-1]) >= 4.5
    assert contrast(colour["focus"], colour["paper"]) >= 3
    curves = (*(f"c{k}" for k in range(8)), "s0", "s1")
    assert min(contrast(colour[name], colour["paper"]) for name in curves) >= 3
