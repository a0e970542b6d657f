"""The report page in a real browser: its selectors and width, and that it loads nothing else."""

import os
import re
import shutil
from pathlib import Path

import pytest
import xarray as xr

from sweeps.report.frames import read_frames
from sweeps.report.headline import headline
from sweeps.report.pivot import at_main
from sweeps.report.places import page_file
from sweeps.report.stores import attributes, opened

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
    asked = {url.partition("#")[0] for url in page.requests if not url.startswith("data:")}
    assert asked <= {file.as_uri(), "about:blank"}


def choose(page, axis, label):
    page.select_option(f'select[data-axis="{axis}"]', label=label)


def shown_rows(page, table):
    """The texts of the rows of a table that are shown, a list a row."""
    rows = page.locator(f"#table-{table} tbody tr:visible")
    return [[one for one in row.locator("th:visible, td").all_inner_texts()] for row in rows.all()]


def test_selectors_and_the_address_change_what_is_shown(seen, smoke_store, file):
    frame = read_frames(smoke_store)["scores"]
    for width, count in (("10", "4"), ("50", "16")):
        choose(seen, "pulse_width_ns", width)
        choose(seen, "frame_count", count)
        seen.select_option("#against", "vigilance")
        rows = frame.rows[
            (frame.rows.classifier == "acn")
            & (frame.rows.channel == "range")
            & (frame.rows.kind == "test")
            & (frame.rows.pulse_width_ns == float(width))
            & (frame.rows.frame_count == int(count))
            & (frame.rows.aspect_bin_deg == "overall")
        ]
        expected = [f"{one:.0f}" for one in rows.sort_values("vigilance").percent_correct]
        lines = [row for row in shown_rows(seen, "scores") if "ACN, range profile, ship" in row]
        assert [row[-1].split()[0] for row in lines] == expected
        assert f"pulse_width_ns={width}" in seen.url or width == "30"
    address = seen.url
    seen.goto("about:blank")
    seen.goto(address)
    assert seen.locator('select[data-axis="pulse_width_ns"]').input_value() == "50.0"
    assert seen.locator("#against").input_value() == "vigilance"


def test_the_headline_follows_the_selection_in_the_same_words(browser, smoke_store, file):
    """The script says of a selection what the command says of a store of that alone."""
    frames, about = read_frames(smoke_store), attributes(opened(smoke_store))
    scores = frames["scores"]
    page = browser.new_page(viewport=DESK)
    page.goto(file.as_uri())
    said = {page.locator(".headline").inner_text()}
    assert said == set(headline(frames, about))
    places = [
        ("pulse_width_ns", {"frame_count": 4}),
        ("pulse_width_ns", {"frame_count": 4, "infrared_frame_count": 4}),
        ("frame_count", {"pulse_width_ns": 50.0}),
        ("range_km", {"infrared_frame_count": 4, "super_resolution": "perfect"}),
        ("vigilance", {"pulse_width_ns": 10.0, "frame_count": 4}),
    ]
    for axis, place in places:
        page.goto("about:blank")
        by_name = "&".join(f"{name}={scores.columns[name].text(v)}" for name, v in place.items())
        page.goto(f"{file.as_uri()}#by={axis}&{by_name}")
        alone = {"scores": at_main(scores, [*scores.down, axis, *scores.several])}
        for name, value in place.items():
            rows = alone["scores"].rows
            alone["scores"] = alone["scores"].where(rows[name].isna() | (rows[name] == value))
        [wanted] = headline(alone, about | {"swept": [scores.columns[axis].axis]})
        # A store of one value of an axis may leave it out of its settings.
        found = page.locator(".headline").inner_text()
        assert without_settings(found) == without_settings(wanted), place
        said.add(found)
    assert len(said) > 3
    page.close()


def without_settings(sentence):
    return re.sub(r" \([a-z].*?\)", "", sentence)


def test_charts_are_drawn_of_the_selection_and_saved(seen, smoke_store):
    seen.select_option("#against", "frame_count")
    seen.wait_for_function("document.querySelectorAll('.draw svg').length > 2")
    seen.wait_for_function(
        "document.querySelector('#table-scores .chart').dataset.axis === 'frame_count'"
    )
    marks = seen.locator("#table-scores .draw svg [aria-roledescription='point']").count()
    frame = read_frames(smoke_store)["scores"]
    assert marks >= frame.rows.frame_count.nunique()
    with seen.expect_download() as download:
        seen.locator("#table-scores button.csv").click()
    text = Path(download.value.path()).read_text(encoding="utf-8")
    assert len(text.splitlines()) == len(frame.rows) + 1
    with seen.expect_download() as download:
        seen.locator("#table-scores button.svg").click()
    assert Path(download.value.path()).read_text(encoding="utf-8").startswith("<svg")


def test_cells_say_how_to_reproduce_them_by_keyboard(seen, smoke_store, monkeypatch):
    monkeypatch.chdir(smoke_store.parent)
    seen.locator("#table-scores td[tabindex]").first.focus()
    for key in ("ArrowRight", "ArrowDown"):
        seen.keyboard.press(key)
        code = seen.locator("#where code").inner_text()
        shown = seen.evaluate("document.activeElement.firstChild.textContent").strip()
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
    assert page.locator("table.figures:visible").count() > 4
    assert page.locator("#table-scores tbody tr:visible td").first.inner_text()[0].isdigit()
    context.close()
