"""The report page works in a real browser, fits its width, and loads no other file."""

import csv
import io
import os
import re
import shutil
from contextlib import contextmanager
from pathlib import Path

import pytest
import xarray as xr
from made import displayed, scores
from pages import stored
from rich.console import Console

from sweeps.report import chart
from sweeps.report.frames import read_frames
from sweeps.report.headline import headline
from sweeps.report.outputs import page_file
from sweeps.report.page.write import write_store_page
from sweeps.report.pivot import select_main
from sweeps.report.stores import attributes, open_store
from sweeps.report.summary import report_comparison, tables_of

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
OPTIONS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--no-first-run"),
)
PHONE, DESK = {"width": 390, "height": 844}, {"width": 1280, "height": 900}


def give_up(reason):
    """Skip a test, or fail it where NCTI_BROWSER_TESTS is `required`."""
    required = os.environ.get("NCTI_BROWSER_TESTS") == "required"
    (pytest.fail if required else pytest.skip)(reason)


def executable():
    """Return the path of an installed browser, or give up."""
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    return path or give_up(f"none of {', '.join(BROWSERS)} is installed")


@pytest.fixture(scope="module")
def browser():
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        give_up("playwright is not installed")
    path = executable()
    with sync_playwright() as started:
        running = started.chromium.launch(executable_path=path, args=list(OPTIONS))
        yield running
        running.close()


@pytest.fixture(scope="module")
def file(smoke_store):
    return page_file(smoke_store)


@pytest.fixture(scope="module")
def two_axes(tmp_path_factory):
    """Return a store with a page: classifiers over four CNRs and three ranges, and a constant."""
    axes = {"cnr": [5.0, 10.0, 20.0, 30.0], "range": [25.0, 50.0, 100.0]}
    tables = {
        "tables__acn": displayed(scores(0, **axes)),
        "tables__mnn": displayed(scores(1, **axes), "mnn"),
        "tables__likelihood": displayed(scores(2, range=axes["range"]), "likelihood"),
        "tables__constant": xr.Dataset({"length": ("cnr", [7.0, 7.0])}, {"cnr": [5.0, 10.0]}),
    }
    attributes = {"configuration": {}, "title": "T", "swept": ["cnr", "range"]}
    path = stored(tmp_path_factory.mktemp("two") / "s.zarr", attributes, **tables)
    assert write_store_page(path, tables_of(path)) == []
    return path


def new_page(browser, **options):
    """Return a page with a timeout of two minutes, for machines that have other work."""
    page = browser.new_page(**options)
    page.set_default_timeout(120_000)
    return page


@contextmanager
def open_page(browser, file):
    """Yield a file's page on a desktop; fail if it requests another file or logs a message."""
    page = new_page(browser, viewport=DESK)
    requests, wrong = [], []
    page.on("request", lambda request: requests.append(request.url))
    page.on("console", lambda message: wrong.append(message.text))
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.goto(file.as_uri())
    yield page
    assert wrong == []
    addresses = {url.partition("#")[0] for url in requests if not url.startswith("data:")}
    assert addresses <= {file.as_uri(), "about:blank"}
    page.close()


@pytest.fixture(scope="module")
def smoke_page(browser, file):
    """Yield the page of the smoke experiment."""
    with open_page(browser, file) as page:
        page.locator("#table-scores svg").first.wait_for()
        page.start = page.evaluate(
            "[document.documentElement.scrollHeight, document.body.innerText.split(/\\s+/).length]"
        )
        page.locator("#table-scores summary").first.click()
        yield page


@pytest.fixture
def both(browser, two_axes):
    """Yield the page of the store of two axes."""
    with open_page(browser, page_file(two_axes)) as page:
        page.locator("#table-scores .heat svg").wait_for()
        yield page


def choose(page, axis, label):
    page.select_option(f'select[data-axis="{axis}"]', label=label)


def shown_rows(page, table):
    """Return the texts of a table's visible rows, as a list for each row."""
    rows = page.locator(f"#table-{table} tbody tr:visible")
    return [
        [text for text in row.locator("th:visible, td").all_inner_texts()] for row in rows.all()
    ]


MARKS = "{section} figure.{kind} svg g.mark-{mark}.role-mark > *"
"""Selector of the marks of one kind of chart, including those of its legend."""


def marks(page, kind, mark, section="#table-scores"):
    """Return the locator of a chart's marks."""
    return page.locator(MARKS.format(section=section, kind=kind, mark=mark))


def downloaded(page, button):
    with page.expect_download() as download:
        page.locator(button).click()
    return Path(download.value.path()).read_text(encoding="utf-8")


def test_smoke_page_is_short_until_expanded(smoke_page):
    height, words = smoke_page.start
    assert height <= 5000 and words <= 700


def test_selectors_and_url_set_the_selection(smoke_page, smoke_store, file):
    frame = read_frames(smoke_store)["scores"]
    for width, count in (("10", "4"), ("50", "16")):
        choose(smoke_page, "pulse_width_ns", width)
        choose(smoke_page, "frame_count", count)
        smoke_page.select_option("#against", "vigilance")
        rows = frame.rows[
            (frame.rows.classifier == "acn")
            & (frame.rows.channel == "range")
            & (frame.rows.kind == "test")
            & (frame.rows.pulse_width_ns == float(width))
            & (frame.rows.frame_count == int(count))
            & (frame.rows.aspect_bin_deg == "overall")
        ]
        expected = [f"{percent:.0f}" for percent in rows.sort_values("vigilance").percent_correct]
        lines = [
            row for row in shown_rows(smoke_page, "scores") if "ACN, range profile, ship" in row
        ]
        assert [row[-1].split()[0] for row in lines] == expected
        assert f"pulse_width_ns={width}" in smoke_page.url or width == "30"
    address = smoke_page.url
    smoke_page.goto("about:blank")
    smoke_page.goto(address)
    smoke_page.locator("#table-scores summary").first.click()
    assert smoke_page.locator('select[data-axis="pulse_width_ns"]').input_value() == "50.0"
    assert smoke_page.locator("#against").input_value() == "vigilance"


def test_headline_of_a_selection_matches_the_command(browser, smoke_store, file):
    """The script describes a selection as the command describes a store of it alone."""
    frames, attrs = read_frames(smoke_store), attributes(open_store(smoke_store))
    scores = frames["scores"]
    page = new_page(browser, viewport=DESK)
    page.goto(file.as_uri())
    sentences = {page.locator(".headline").inner_text()}
    assert sentences == set(headline(frames, attrs))
    settings = [
        ("pulse_width_ns", {"frame_count": 4, "infrared_frame_count": 4}),
        ("frame_count", {"pulse_width_ns": 50.0}),
        ("range_km", {"infrared_frame_count": 4, "super_resolution": "perfect"}),
        ("vigilance", {"pulse_width_ns": 10.0, "frame_count": 4}),
    ]
    for axis, setting in settings:
        page.goto("about:blank")
        by_name = "&".join(f"{name}={scores.columns[name].text(v)}" for name, v in setting.items())
        page.goto(f"{file.as_uri()}#by={axis}&{by_name}")
        selected = {"scores": select_main(scores, [*scores.down, axis, *scores.varying_axes])}
        for name, value in setting.items():
            rows = selected["scores"].rows
            selected["scores"] = selected["scores"].where(rows[name].isna() | (rows[name] == value))
        [expected] = headline(selected, attrs | {"swept": [scores.columns[axis].axis]})
        # A store of one value of an axis may leave it out of its settings.
        sentence = page.locator(".headline").inner_text()
        assert without_settings(sentence) == without_settings(expected), setting
        sentences.add(sentence)
    assert len(sentences) > 3
    page.close()


def test_headline_ranks_by_values_common_to_all_classifiers(browser, tmp_path):
    """One of two classifiers failed at one CNR; the page opens with the command's sentence."""
    datasets = [scores(seed, cnr=[5.0, 10.0, 20.0], range=[25.0, 50.0]) for seed in (3, 4)]
    datasets[1] = datasets[1].where(datasets[1].cnr != 20.0)
    tables = {"tables__acn": displayed(datasets[0]), "tables__mnn": displayed(datasets[1], "mnn")}
    attrs = {"configuration": {}, "title": "T", "swept": ["cnr", "range"]}
    path = stored(tmp_path / "s.zarr", attrs, **tables)
    assert write_store_page(path, tables_of(path)) == []
    [expected] = headline(read_frames(path), attrs)
    assert "Ranked by 2 of 3 values of CNR, those that all have." in expected
    with open_page(browser, page_file(path)) as page:
        page.locator("#table-scores svg").first.wait_for()
        assert without_settings(page.locator(".headline").inner_text()) == without_settings(
            expected
        )


def without_settings(sentence):
    return re.sub(r" \([a-z].*?\)", "", sentence)


def test_charts_show_the_selection_and_download_as_svg(smoke_page, smoke_store):
    smoke_page.select_option("#against", "frame_count")
    smoke_page.locator('#table-scores[data-axis="frame_count"]').wait_for()
    frame = read_frames(smoke_store)["scores"]
    assert marks(smoke_page, "chart", "symbol").count() >= frame.rows.frame_count.nunique()
    assert downloaded(smoke_page, "#table-scores figure.chart button.svg").startswith("<svg")
    for kind, section in (("aspect", "scores"), ("heat", "confusion")):
        assert smoke_page.locator(f"#table-{section} figure.{kind} svg").is_visible()


def test_x_axis_values_are_selected_only_below_the_chart(smoke_page):
    for axis in ("pulse_width_ns", "frame_count"):
        smoke_page.select_option("#against", axis)
        assert smoke_page.locator(f'.bar select[data-axis="{axis}"]').count() == 0
        assert smoke_page.locator(f'.at select[data-axis="{axis}"]').is_visible()
    assert smoke_page.locator('.bar select[data-axis="pulse_width_ns"]').is_visible()


def test_csv_download_has_visible_or_all_rows(smoke_page, smoke_store):
    frame = read_frames(smoke_store)["scores"]
    heads, *lines = csv.reader(downloaded(smoke_page, "#table-scores button.seen").splitlines())
    rows = shown_rows(smoke_page, "scores")
    assert len(lines) == len(rows) < len(frame.rows)
    shown_heads = smoke_page.locator("#table-scores thead th:visible").all_inner_texts()
    assert [head for head in heads if not head.endswith((" low", " high"))] == shown_heads
    for line, row in zip(lines, rows, strict=True):
        value, low, high = line[-3:]
        assert f"{float(value):.0f} {float(low):.0f}–{float(high):.0f}" == row[-1].strip()
    lines_of_all = downloaded(smoke_page, "#table-scores button.all").splitlines()
    assert len(lines_of_all) == len(frame.rows) + 1


def test_curves_are_coloured_by_a_second_axis_with_a_titled_legend(both):
    legend = both.locator("#table-scores figure.chart svg")
    assert "classifier" in legend.inner_html() and marks(both, "chart", "line").count() == 3
    both.select_option("#colour", "range_km")
    both.locator("#table-scores figure.chart svg text", has_text="range [km]").wait_for()
    lines = marks(both, "chart", "line")
    colours, dashes = (
        [line.get_attribute(name) for line in lines.all()]
        for name in ("stroke", "stroke-dasharray")
    )
    assert len(set(colours)) == len(set(dashes)) == 3
    assert marks(both, "chart", "text").all_text_contents() == ["25", "50", "100"]
    assert "colour=range_km" in both.url


def test_a_heat_map_has_the_values_of_both_axes(both, two_axes):
    both.locator("#table-scores label.of select").select_option(label="MNN")
    both.reload()  # the address keeps the choice
    both.locator("#table-scores .whose", has_text="MNN").wait_for()
    rows = read_frames(two_axes)["scores"].rows
    rows = rows[(rows.classifier == "mnn") & (rows.aspect_bin_deg == "overall")]
    rows = rows[rows.kind == "test"]
    values = [f"{percent:.0f}" for percent in rows.percent_correct]
    marks = MARKS.format(section="#table-scores", kind="heat", mark="text")
    both.wait_for_function(
        """([marks, values]) => Array.from(document.querySelectorAll(marks))
            .map((node) => node.textContent).sort().join() === values.join()""",
        arg=[marks, sorted(values)],
    )
    assert sorted(both.locator(marks).all_text_contents()) == sorted(values)


def test_a_classifier_without_the_axis_is_a_horizontal_line(both):
    assert both.locator("#against").input_value() == "cnr_db"
    flat = [
        path
        for path in (line.get_attribute("d") for line in marks(both, "chart", "line").all())
        if len({place.split(",")[1] for place in path[1:].split("L")}) == 1
    ]
    assert len(flat) == 1 and flat[0].count("L") == 3


def test_clicking_a_legend_entry_highlights_its_curve(both):
    marks(both, "chart", "text").nth(1).click()
    faint = [line.get_attribute("opacity") for line in marks(both, "chart", "line").all()]
    assert [float(opacity or 1) < 0.5 for opacity in faint] == [True, False, True]


def test_scalar_figure_has_a_table_but_no_chart(both):
    section = both.locator("#table-constant")
    assert section.locator("details.rows").get_attribute("open") is not None
    assert section.locator("svg").count() == 0 and section.locator("td:visible").count() == 1


def test_focused_cell_shows_code_that_reproduces_it(smoke_page, smoke_store, monkeypatch):
    monkeypatch.chdir(smoke_store.parent)
    smoke_page.locator("#table-scores td[tabindex]").first.focus()
    for key in ("ArrowRight", "ArrowDown"):
        smoke_page.keyboard.press(key)
        code = smoke_page.locator("#where code").inner_text()
        cell_text = smoke_page.evaluate("document.activeElement.firstChild.textContent").strip()
        assert f"{eval(code, {'xr': xr}):.0f}" == cell_text
    assert smoke_page.locator("#where button").is_visible()


def test_hovered_marker_shows_its_value_and_code(both, two_axes, monkeypatch):
    monkeypatch.chdir(two_axes.parent)
    for kind, mark in (("chart", "symbol"), ("aspect", "symbol"), ("heat", "rect")):
        marks(both, kind, mark).nth(2).hover(force=True)
        value = eval(both.locator("#where code").inner_text(), {"xr": xr})
        assert f"percent correct [%]: {value:.4g}" in both.locator("#tip").inner_text()


CUT = """[...document.querySelectorAll("body *")].filter((node) => {
  const style = getComputedStyle(node);
  return node.scrollWidth > node.clientWidth + 1 && node.clientWidth
    && style.overflowX !== "visible"
    && !style.backgroundImage.includes("gradient") && !node.closest("svg, select");
}).map((node) => node.outerHTML.slice(0, 99))"""
"""Script that lists elements wider than their box, unless a shadow shows that they are."""


@pytest.mark.parametrize(("size", "scheme"), [(PHONE, "light"), (DESK, "dark")])
def test_page_fits_the_screen_width(size, scheme, browser, file):
    page = new_page(browser, viewport=size, color_scheme=scheme)
    page.goto(file.as_uri())
    page.eval_on_selector_all("details", "all => all.forEach(node => { node.open = true; })")
    assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
    assert page.evaluate(CUT) == []
    light = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (light == "rgb(255, 255, 255)") == (scheme == "light")
    page.close()


def test_collapsed_sections_are_expanded_for_printing(smoke_page):
    closed = "document.querySelectorAll('details:not([open], .code)').length"
    before = smoke_page.evaluate(closed)
    smoke_page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert before > 0 and smoke_page.evaluate(closed) == 0
    smoke_page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert smoke_page.evaluate(closed) == before


def test_page_is_readable_without_javascript(browser, file):
    context = browser.new_context(java_script_enabled=False, viewport=PHONE)
    page = new_page(context)
    page.goto(file.as_uri())
    assert page.locator(".bar").is_hidden() and page.locator("#where").is_hidden()
    assert page.locator("table.figures:visible").count() > 4
    assert page.locator("#table-scores tbody tr:visible td").first.inner_text()[0].isdigit()
    context.close()


def test_differences_of_stores_have_a_line_at_zero(browser, tmp_path):
    for name, figures in (("a", [1.0, 2.0, 4.0]), ("b", [2.0, 2.0, 1.0])):
        table = xr.Dataset({"height": ("size", figures)}, {"size": [1.0, 2.0, 3.0]})
        stored(tmp_path / f"{name}.zarr", {"configuration": {}}, tables__tree=table)
    paths = tmp_path / "a.zarr", tmp_path / "b.zarr"
    assert report_comparison(*paths, console=Console(file=io.StringIO()), html=True) == []
    with open_page(browser, tmp_path / "b-less-a-report.html") as page:
        page.locator("#table-tree_differences svg").wait_for()
        (zero,) = marks(page, "chart", "rule", "#table-tree_differences").all()
        points = marks(page, "chart", "symbol", "#table-tree_differences").all()
        level, *heights = (
            mark.bounding_box()["y"] + mark.bounding_box()["height"] / 2 for mark in (zero, *points)
        )
        gain, none, loss = sorted(height - level for height in heights)  # +1, 0 and -3 m
        assert abs(none) < 1 and gain < -10 and loss == pytest.approx(-3 * gain, abs=2)


def test_notebook_chart_follows_its_selectors(browser, tmp_path):
    table = displayed(scores(cnr=[5.0, 10.0, 20.0], range=[25.0, 50.0], votes=[1, 3]))
    notebook_chart = chart(table, x="cnr", colour="range")
    (tmp_path / "cell.html").write_text(notebook_chart._repr_html_(), encoding="utf-8")
    with open_page(browser, tmp_path / "cell.html") as page:
        cell = page.frame_locator("iframe")
        cell.locator(".chart svg").wait_for()
        before = cell.locator(".chart svg").inner_html()
        cell.locator('select[data-axis="votes"]').select_option(label="3")
        _, frame = page.frames
        changed = "before => document.querySelector('.chart svg').innerHTML !== before"
        frame.wait_for_function(changed, arg=before)
        assert cell.locator(".chart svg").inner_html() != before
