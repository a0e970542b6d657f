"""The report page in a real browser: its selectors and width, and that it loads nothing else."""

import re
import shutil
from contextlib import chdir

import pytest
import xarray as xr
from pages import read_page

from sweeps.report.rows import page_file

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FOUND = next(filter(None, map(shutil.which, BROWSERS)), None)
OPTIONS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--no-first-run"),
)
PHONE, DESK = {"width": 390, "height": 844}, {"width": 1280, "height": 900}

pytestmark = pytest.mark.skipif(FOUND is None, reason=f"none of {', '.join(BROWSERS)} is installed")


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as started:
        running = started.chromium.launch(executable_path=FOUND, args=list(OPTIONS))
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
