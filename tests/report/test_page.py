"""The report page: its numbers are the store's, nothing of a store is markup, nothing is remote."""

import base64
import hashlib
import re
from contextlib import chdir
from importlib.resources import files
from itertools import product

import numpy as np
import pytest
import xarray as xr
from made import SOURCE, scores
from pages import page_of, parsed, read_page, stored
from stores import opened

from sweeps.report.page import confusion
from sweeps.report.page.cells import Cells
from sweeps.report.page.cubes import Axes, placed
from sweeps.report.page.layout import Cell
from sweeps.report.places import page_file

LARGEST = 10e6  # bytes


@pytest.fixture(scope="module")
def smoke(smoke_store):
    """The page that the smoke experiment ended with."""
    return read_page(page_file(smoke_store))


def states(*values):
    return xr.Dataset({"view": ("ship", np.array(values, dtype="i1"))})


# numbers ------------------------------------------------------------------------------------------


def test_code_beside_numbers_gives_them(smoke, smoke_store):
    cells = [one for one in smoke.root.all("td") if "data-c" in one.attrs]
    assert len(cells) > 300
    rng = np.random.default_rng(0)
    groups = set()
    with chdir(smoke_store.parent):
        for cell in rng.choice(np.array(cells, dtype=object), 40, replace=False):
            shown = cell.all("span", **{"class": "ci" if "data-m" in cell.attrs else "v"})[0].text
            if shown in ("–", ""):
                continue
            code = smoke.code(cell)
            groups.add(re.search(r"group='([^']*)'", code)[1])
            value = eval(code, {"xr": xr})
            half = 0.5001 if code.startswith("100") else 0.0
            assert abs(value - float(shown)) <= half + 5.1e-4 * abs(value), (code, shown)
    assert {group.partition("/")[0] for group in groups} == {"tables", "classification"}


def test_every_bin_of_every_classifier_is_there(smoke, smoke_store):
    table = opened(smoke_store, "tables/correlation")
    here = table.sel(pulse_width=30, frame_count=16).squeeze()
    sheet = smoke.root.one("section", data_name="correlation").one("div", data_by="frame_count")
    (row,) = [one for one in sheet.all("tr") if one.all("th")[0].text == "16"]
    for cell, place in zip(row.all("td"), here.aspect_bin.values, strict=True):
        one = here.sel(aspect_bin=place)
        ends = [f"{100 * float(one[end]):.0f}" for end in ("ci_low", "ci_high")]
        assert cell.text.split() == [f"{100 * float(one.accuracy):.0f}", "–".join(ends)]


def of_the_source(**changed):
    """The network's table with as many views as the source's, and these percentages."""
    axes = {"pulse_width": [10.0, 30.0], "vigilance": [0.95], "frame_count": [8, 16]}
    table = scores(**axes, range=[100.0], target_free_ifovs=4000, bins=("0-27", "30-57", "60-90"))
    table["view_count"] = 124 + 0 * table.accuracy.isel(aspect_bin=0)
    return table.assign(changed)


def test_figures_of_the_source_stand_beside_ours_where_the_sweep_has_its_views(tmp_path):
    table = of_the_source()
    fixed = {"accuracy": 0.8, "ci_low": 0.65, "ci_high": 0.9}
    for name, value in fixed.items():
        table[name] = value + 0 * table[name]
    page = parsed(page_of(stored(tmp_path / "s.zarr", SOURCE, tables__acn=table)))
    row = page.root.one("section", id="scores").all("table")[0].all("tr")[1]
    cells = row.all("td")[:2]  # 16 frames, 30 ns: 78 and 40, the article's Table 4
    assert [cell.one("span", **{"class": "src"}).text for cell in cells] == ["78 +2", "40 +40"]
    assert [cell.attrs["class"] for cell in cells] == ["same", "above strong"]
    few = of_the_source(view_count=table.view_count - 1)
    page = parsed(page_of(stored(tmp_path / "few.zarr", SOURCE, tables__acn=few)))
    assert not any(one.text for one in page.root.all("span", **{"class": "src"}))
    digests = SOURCE["mesh_digests"] | {"texas": "of another mesh"}
    given = SOURCE | {"mesh_digests": digests}
    page = parsed(page_of(stored(tmp_path / "own.zarr", given, tables__acn=table)))
    assert not any(one.text for one in page.root.all("span", **{"class": "src"}))


def test_confusion_counts_every_answer_once(smoke, smoke_store):
    answers = opened(smoke_store, "classification/acn").predicted
    here = answers.sel(pulse_width=30, vigilance=0.95, frame_count=16).squeeze()
    for line, ship in zip(
        smoke.root.one("div", **{"class": "matrix", "data_name": "acn"}).all("tr")[1:],
        range(2),
        strict=True,
    ):
        counts = [int(cell.text.split()[1]) for cell in line.all("td")]
        named = here.isel(ship=ship).values
        assert counts == [int((named == other).sum()) for other in range(2)]


def test_code_beside_counts_holds_for_aspects_of_many_digits(tmp_path):
    aspects = [0.1234567, 12.3456789, 45.0, 89.9999999]
    named = xr.Dataset(
        {"predicted": (("ship", "aspect"), np.array([[0, 0, 1, 0], [1, 0, 1, 1]], dtype="i2"))},
        {"ship": ["duncan", "own"], "aspect": aspects},
    )
    path = stored(tmp_path / "s.zarr", classification__acn=named)
    axes = Axes()
    found = confusion.matrices_of(
        opened(path, "classification/acn"), "classification/acn", str(path), axes
    )
    known = axes.finished()
    (cube,) = (placed(one, known) for one in found)
    cells = Cells([cube], known)
    for place, expected in zip(product(*cube.at), cube.values, strict=True):
        code = cells.code(Cell(0, dict(zip(cube.dims, place, strict=True))))
        assert eval(code, {"xr": xr}) == expected, code
    assert sum(cube.values) == 2 * named.predicted.size  # in a bin, and in all


# axes ---------------------------------------------------------------------------------------------


def test_an_axis_that_nobody_foresaw_has_its_curves(tmp_path):
    table = scores(ripeness=[1.0, 2.0, 8.0], colour=["green", "red"])
    grown = xr.Dataset(
        {"height": (("ripeness", "weather"), [[1.0, 2.0], [4.0, 3.0], [5.0, np.nan]])},
        {"ripeness": [1.0, 2.0, 8.0], "weather": ["sun", "rain"]},
    )
    path = stored(tmp_path / "s.zarr", tables__oracle=table, tables__grown=grown)
    page = parsed(page_of(path))
    curves = page.root.one("section", id="curves").all("svg", role="img")
    assert {one.attrs["data-axis"] for one in curves} == {"ripeness", "colour", "aspect_bin"}
    (curve,) = [one for one in curves if one.attrs["data-axis"] == "ripeness"]
    points = re.findall(
        r"[ML](\S+) (\S+?)(?=L|$)", curve.all("path", **{"class": "line"})[0].attrs["d"]
    )
    expected = table.accuracy.sel(colour="green", aspect_bin="overall").values
    low, high = (186.0, 20.0)  # of 0 and 100 %
    found = [(low - float(y)) / (low - high) for _, y in points]
    np.testing.assert_allclose(found, np.round(expected, 3), atol=0.06 / 166)
    others = page.root.one("section", id="others").all("svg", role="img")
    assert {one.attrs["data-axis"] for one in others} == {"ripeness", "weather"}
    names = {one.attrs["data-axis"] for one in page.root.all("select") if "data-axis" in one.attrs}
    assert names == {"ripeness", "colour", "weather", "aspect_bin"}


def test_settings_that_run_together_are_one_axis(tmp_path):
    joint = {"error_parameter": ["none", "heading"], "error_value": [0.0, 2.0]}
    path = stored(tmp_path / "s.zarr", tables__oracle=scores(error=joint))
    page = parsed(page_of(path))
    (select,) = [one for one in page.root.all("select") if one.attrs.get("data-axis") == "error"]
    assert [one.text for one in select.all("option")] == [
        "error parameter none, error value 0",
        "error parameter heading, error value 2",
    ]
    table = page.root.one("section", id="scores").all("table")[0]
    with chdir(tmp_path):
        value = eval(page.code(table.all("td")[0]), {"xr": xr})
    assert f"{value:.0f}" == table.all("td")[0].all("span")[0].text


# what became of the sweep -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "word", "said"),
    [
        ((1, 1, 1), "complete", "3 of 3 cells done"),
        ((1, 1, 0), "partial", "2 of 3 cells done, 1 failed"),
        ((1, -1, 0), "partial", "1 of 3 cells done, 1 failed, 1 missing"),
        ((0, 0, 0), "failed", "0 of 3 cells done, 3 failed"),
        ((-1, -1, -1), "partial", "0 of 3 cells done, 3 missing"),
    ],
)
def test_a_sweep_that_is_not_complete_says_so_first(given, word, said, tmp_path):
    why = {"extent ship=duncan": "ValueError: <no> mesh"} if 0 in given else {}
    attributes = {"configuration": {}, "title": "T", "failures": why}
    path = stored(
        tmp_path / "s.zarr", attributes, status=states(*given), tables__o=scores(a=[1, 2])
    )
    page = parsed(page_of(path))
    title, alerts = page.root.one("head").one("title").text, page.root.all("div", role="alert")
    header = page.root.one("header", id="summary").text
    assert said in header
    if word == "complete":
        assert title == "s.zarr – T" and not alerts and "Complete" in header
    else:
        assert title.startswith(f"{word.upper()}: ")
        assert alerts[0].text.startswith(f"{word.capitalize()}: this sweep is not complete.")
        assert "✓" not in header and "Complete" not in header
        assert all(f"{what}: {reason}" in alerts[0].text for what, reason in why.items())


def test_a_store_without_states_does_not_look_complete(tmp_path):
    page = parsed(page_of(stored(tmp_path / "s.zarr", tables__o=scores(a=[1, 2]))))
    assert page.root.one("head").one("title").text.startswith("UNKNOWN: ")


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


def test_whatever_a_store_says_is_text(tmp_path):
    path = tmp_path / '"><img src=x onerror=alert(1)>\x1b[31m{{ 7*7 }}.zarr'
    count = len(HOSTILE)
    named = xr.Dataset(
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
    groups = {"classification__x": named, "tables__x": table, "ships": portraits}
    stored(path, attributes, **groups, status=states(1, 0))
    other.assign_attrs(title=HOSTILE[1]).to_zarr(
        path, group="tables/other", mode="a", consolidated=False
    )
    (path.parent / "x").mkdir()
    page = parsed(page_of(path))
    assert len(page.root.all("script")) == 2 and not page.root.all("img")
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f]", page.written)
    assert not any(key.startswith("on") for one in all_of(page.root) for key in one.attrs)
    assert "49" not in page.root.one("head").one("title").text
    for word in HOSTILE:
        assert word.replace("\x1b", "\\x1b") in page.root.text
    assert page.data["axes"]["word"]["t"] == [word.replace("\x1b", "\\x1b") for word in HOSTILE]


def all_of(element):
    return [element, *(one for child in element.children for one in all_of(child))]


def test_the_policy_allows_its_own_style_and_script_alone(smoke):
    (policy,) = [
        one.attrs["content"]
        for one in smoke.root.all("meta")
        if one.attrs.get("http-equiv") == "Content-Security-Policy"
    ]
    rules = dict(rule.split(" ", 1) for rule in policy.split("; "))
    assert rules.pop("default-src") == "'none'" and rules.pop("img-src") == "data:"
    assert rules.pop("base-uri") == rules.pop("form-action") == "'none'"
    code = [one.text for one in smoke.root.all("script") if "type" not in one.attrs]
    for kind, texts in (("script-src", code), ("style-src", [smoke.root.one("style").text])):
        (text,) = texts
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert rules.pop(kind) == f"'sha256-{digest}'"
    assert not rules
    assert not any("style" in one.attrs for one in all_of(smoke.root))


def test_nothing_of_the_page_is_elsewhere(smoke):
    assert len(smoke.written.encode()) < LARGEST
    for one in all_of(smoke.root):
        for key in ("src", "href", "action", "srcset", "data"):
            assert one.attrs.get(key, "#").startswith(("#", "data:"))
    style, script = smoke.root.one("style").text, smoke.root.all("script")[-1].text
    assert "http" not in style + script and "url(" not in style and "@import" not in style
    assert "innerHTML" not in script and "eval(" not in script and "Function(" not in script


# provenance ---------------------------------------------------------------------------------------


def test_transforms_of_own_meshes_are_on_the_page(tmp_path):
    attributes = {"mesh_digests": {"own": "ab12"}, "mesh_transforms": {"own": "up: y, scale: 0.01"}}
    page = parsed(page_of(stored(tmp_path / "s.zarr", attributes, tables__o=scores(a=[1, 2]))))
    told = page.root.one("section", id="provenance").text
    assert "Transforms of the ships' meshes" in told and "up: y, scale: 0.01" in told


# form ---------------------------------------------------------------------------------------------


def test_tables_and_figures_can_be_read_aloud(smoke):
    tables = smoke.root.all("table")
    assert tables and smoke.root.all("img")
    for table in tables:
        assert table.one("caption").text.strip()
        assert all(one.attrs["scope"] in ("col", "row") for one in table.all("th"))
    assert all(len(one.attrs["alt"]) > 40 for one in smoke.root.all("img"))
    for one in smoke.root.all("svg"):
        assert one.attrs.get("aria-hidden") == "true" or len(one.attrs["aria-label"]) > 20
    for one in smoke.root.all("select"):
        assert any(one in label.all("select") for label in smoke.root.all("label"))
    ids = [one.attrs["id"] for one in all_of(smoke.root) if "id" in one.attrs]
    assert len(ids) == len(set(ids))
    links = [one.attrs["href"][1:] for one in smoke.root.one("nav").all("a")]
    assert links and set(links) <= set(ids)


def luminance(colour):
    """Relative luminance of a colour (WCAG 2.2)."""
    share = np.asarray(colour) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(one, other):
    low, high = sorted(map(luminance, (one, other)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_and_curves_stand_out(scheme):
    """WCAG 2.2: 4.5 for text (1.4.3), 3 for what curves are drawn with (1.4.11)."""
    style = files("sweeps.report.page").joinpath("templates/page.css").read_text(encoding="utf-8")
    blocks = re.findall(r":root \{(.*?)\}", style, re.DOTALL)
    block = blocks[("light", "dark").index(scheme)]
    colour = {
        name: [int(value[k : k + 2], 16) for k in (0, 2, 4)]
        for name, value in re.findall(r"--([\w-]+): #([0-9a-f]{6})", block)
    }
    words = ("ink", "soft", "link", "above", "below", "same", "good", "bad", "focus")
    for ground in ("paper", "panel"):
        assert min(contrast(colour[name], colour[ground]) for name in words[:-1]) >= 4.5
    assert contrast(colour["focus"], colour["paper"]) >= 3
    assert min(contrast(colour[f"c{k}"], colour["paper"]) for k in range(8)) >= 3
    shade = np.array([int(k) for k in re.search(r"--shade: ([\d, ]+)", block)[1].split(",")])
    for level in re.findall(r"rgba\(var\(--shade\), (\.\d+)\)", style):
        mixed = float(level) * shade + (1 - float(level)) * np.array(colour["paper"])
        assert contrast(colour["ink"], mixed) >= 4.5
