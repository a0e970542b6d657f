"""The report page in a real browser: its selectors and width, and that it loads nothing else."""

import os
import re
import shutil
from contextlib import chdir

import numpy as np
import pytest
import xarray as xr
from pages import read_page

from sweeps.report.page.cells import number
from sweeps.report.page.write import write_page
from sweeps.report.places import page_file

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
    """The browser that is installed."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    return found or give_up(f"none of {', '.join(BROWSERS)} is installed")


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
def seen(browser, file):
    """The page on a desk, with what it asked for and what went wrong."""
    page = browser.new_page(viewport=DESK)
    page.requests, page.wrong = [], []
    page.on("request", lambda request: page.requests.append(request.url))
    page.on("console", lambda message: page.wrong.append(message.text))
    page.on("pageerror", lambda error: page.wrong.append(str(error)))
    page.goto(file.as_uri())
    yield page
    assert page.wrong == []
    assert [url for url in page.requests if not url.startswith("data:")] == [file.as_uri()]


@pytest.mark.parametrize(
    ("setting", "outcome"), [("required", pytest.fail), ("", pytest.skip), (None, pytest.skip)]
)
def test_a_browser_that_is_required_is_not_skipped(setting, outcome, monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("NCTI_BROWSER_TESTS", raising=False)
    if setting is not None:
        monkeypatch.setenv("NCTI_BROWSER_TESTS", setting)
    with pytest.raises(outcome.Exception, match=r"none of chromium, .* is installed"):
        executable()


def choose(page, axis, label):
    page.select_option(f'select[data-axis="{axis}"]', label=label)


def test_the_script_begins_with_what_is_written(seen, file):
    """It fills every cell and draws every curve anew: the same texts and paths as without it."""
    written = read_page(file).root
    cells = [" ".join(one.text.split()) for one in written.all("td") if "data-c" in one.attrs]
    assert (
        seen.eval_on_selector_all(
            "td[data-c]", "all => all.map(one => one.textContent.trim().replace(/\\s+/g, ' '))"
        )
        == cells
    )
    looks = [one.attrs["class"] for one in written.all("td") if "data-c" in one.attrs]
    assert seen.eval_on_selector_all("td[data-c]", "all => all.map(one => one.className)") == looks
    paths = [
        path.attrs["d"]
        for chart in written.all("figure", **{"class": "chart"})
        for curve in chart.all("g")
        for path in curve.all("path")
    ]
    drawn = seen.eval_on_selector_all(
        ".chart g path", "all => all.map(one => one.getAttribute('d'))"
    )
    number = re.compile(r"-?\d+\.\d")
    assert [number.sub("#", path) for path in drawn] == [number.sub("#", path) for path in paths]
    for one, other in zip(drawn, paths, strict=True):
        ends = zip(number.findall(one), number.findall(other), strict=True)
        assert all(abs(float(a) - float(b)) < 0.11 for a, b in ends)  # ties of the last digit


def test_selectors_change_what_is_shown(seen, smoke_store):
    table = xr.open_zarr(smoke_store, group="tables/acn").load()
    row = seen.locator("#scores .sheet").first.locator("tbody tr", has_text="ACN").first
    for width, count in ((10, 4), (50, 16)):
        choose(seen, "pulse_width", str(width))
        choose(seen, "frame_count", str(count))
        here = table.sel(pulse_width=width, frame_count=count, vigilance=0.95).squeeze()
        expected = [f"{100 * float(one):.0f}" for one in here.accuracy]
        assert row.locator(".v").all_inner_texts() == expected
        (chart,) = seen.locator('#curves svg[data-axis="vigilance"]').all()
        path = chart.locator("g .line").first.get_attribute("d")
        overall = table.sel(pulse_width=width, frame_count=count, aspect_bin="overall").squeeze()
        heights = [float(y) for y in re.findall(r" ([\d.]+)", path)]
        expected = [186 - 166 * float(one) for one in overall.accuracy]
        assert heights == pytest.approx(expected, abs=0.15)  # of pixels; shares to a thousandth
        shown = seen.locator('[data-shown="pulse_width"]').inner_text()
        assert shown == f"{width} ns"
    assert seen.locator(".confusion td .ci").first.inner_text().isdigit()


def test_one_classifier_can_be_chosen_and_the_rows_of_its_tables(seen):
    seen.select_option("#who", "correlation")
    assert seen.locator(".classifier:visible").count() == 1
    assert seen.locator(".matrix:visible").count() == 1
    assert seen.locator("#curves g:not(.faint)").count() > 0
    seen.select_option("#by", "pulse_width")
    heads = seen.locator(".classifier:visible .sheet:visible tbody th").all_inner_texts()
    assert heads == ["10", "30", "50"]
    seen.select_option("#by", "frame_count")
    seen.select_option("#who", "")
    assert seen.locator(".classifier:visible").count() > 3


def test_cells_say_how_to_reproduce_them_by_keyboard(seen, smoke_store):
    seen.locator("#scores table").first.locator("td").first.focus()
    seen.keyboard.press("ArrowDown")
    seen.keyboard.press("ArrowRight")
    code = seen.locator("#where code").inner_text()
    shown = seen.evaluate("document.activeElement.querySelector('.v').textContent")
    with chdir(smoke_store.parent):
        assert f"{eval(code, {'xr': xr}):.0f}" == shown
    assert seen.locator("#where button").is_visible()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("size", [PHONE, DESK], ids=["phone", "desk"])
def test_no_page_is_wider_than_its_screen(size, scheme, browser, file):
    page = browser.new_page(viewport=size, color_scheme=scheme)
    page.goto(file.as_uri())
    page.eval_on_selector_all("details", "all => all.forEach(one => { one.open = true; })")
    assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
    light = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (light == "rgb(255, 255, 255)") == (scheme == "light")
    page.close()


def test_what_is_closed_is_printed(seen):
    closed = "document.querySelectorAll('details:not([open], .code)').length"
    before = seen.evaluate(closed)
    seen.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert before > 0 and seen.evaluate(closed) == 0
    seen.evaluate("dispatchEvent(new Event('afterprint'))")
    assert seen.evaluate(closed) == before


def test_it_reads_without_its_script(browser, file):
    context = browser.new_context(java_script_enabled=False, viewport=PHONE)
    page = context.new_page()
    page.goto(file.as_uri())
    assert page.locator(".bar").is_hidden() and page.locator("#where").is_hidden()
    assert page.locator("#scores table:visible").count() > 5
    assert page.locator("#scores .v").first.inner_text().isdigit()
    context.close()


# Ties of the fifth digit that floats have exactly, whole numbers, and both ends of exponents.
FLOATS = (12345.0, 1234.5, 1233.5, 0.5, -1234.5, 43672.0, 9999.5, 99995.0, 1.0e-5, 2.5e-4, 1e7, 0.0)
COUNTS = (43672, 9999, 10000, 1234567, -43672, 0, 1, 2, 3, 4, 5, 6)


@pytest.mark.parametrize("values", [FLOATS, COUNTS], ids=["floats", "counts"])
def test_numbers_keep_their_digits_when_a_selector_changes(values, browser, tmp_path):
    """The script writes a number as the page begins with it, at every place of the axes."""
    shaped = np.array(values).reshape(2, -1)
    axes = {"colour": ["green", "red"], "size": np.arange(shaped.shape[1])}
    table = xr.Dataset({"facets": (("colour", "size"), shaped)}, axes)
    table.to_zarr(tmp_path / "s.zarr", group="tables/grown", consolidated=False)
    assert not write_page(tmp_path / "s.zarr", lambda kind, store: None)
    page = browser.new_page(viewport=DESK)
    page.goto(page_file(tmp_path / "s.zarr").as_uri())
    shown = []
    for colour in axes["colour"]:
        choose(page, "colour", colour)
        rows = page.locator("#others table.figures").first.locator("td .v")
        shown += rows.all_text_contents()
    assert shown == [number(one, counted=values is COUNTS) for one in values]
    page.close()
