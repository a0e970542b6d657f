"""Pictures of the infrared channel show what the store holds."""

import warnings

import matplotlib
import numpy as np
import pytest
import xarray as xr
from made import SOURCE
from matplotlib.colors import to_rgb
from stores import attributes_of, opened

from ncti.features import log_polar
from sweeps.report import figures, infrared_figures, rows
from sweeps.report.axes import nominal
from sweeps.report.fair import compared
from sweeps.report.infrared_figures import looks_of
from sweeps.report.score_figures import COLOURS, WAYS, draw_table5

ANGLES, RADII = 64, 32  # of a map
STEPS = 255  # of which the store counts the cells of a map
KEPT = ("ship", "aspect", "phase", "order", "range", "super_resolution", "frame_count")


def group(path, name):
    return nominal(opened(path, name), keep=(*KEPT, "vigilance", "aspect_bin"))


@pytest.fixture(scope="module")
def view(smoke_store):
    return group(smoke_store, "infrared").sel(ship="spruance", aspect=60.0, frame_count=16)


@pytest.fixture(scope="module")
def infrared(smoke_store):
    return attributes_of(smoke_store)["configuration"]["infrared"]


@pytest.fixture(scope="module")
def drawn(smoke_store):
    """Figures of all kinds, with any warning as an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = {kind: figures.draw(kind, smoke_store) for kind in PANELS}
        for figure in made.values():
            figure.canvas.draw()
    return made


# Panels that have data, of the smoke store: 4 rows of 3; 3 bins and all.
PANELS = {"silhouettes": 21, "table5": 4}


def panels_of(figure):
    return [axes for axes in figure.axes if not hasattr(axes, "_colorbar")]


@pytest.mark.parametrize(("kind", "count"), PANELS.items())
def test_panels_are_as_many_as_there_is_data_for(kind, count, drawn):
    assert len(panels_of(drawn[kind])) == count


def test_silhouette_shown_is_the_one_that_was_mapped(view, infrared):
    # The images are stored in single precision, which leaves no pixel's side in doubt here.
    looks = looks_of(view, infrared)
    assert [(look.slant_range, look.way) for look in looks] == [
        (25.0, "none"),
        (50.0, "none"),
        (50.0, "perfect"),
        (50.0, "shifted"),
        (100.0, "none"),
        (100.0, "perfect"),
        (100.0, "shifted"),
    ]
    for look in looks:
        mapped = log_polar(
            look.mask,
            inner_radius=view.inner_radius.item(),
            interpolation=view.interpolation.item(),
            angles=ANGLES,
            radii=RADII,
        )
        np.testing.assert_allclose(look.cells, mapped, atol=0.5 / STEPS + 1e-9)


def test_pixels_are_the_detectors_or_half_as_wide(view, infrared):
    for look in looks_of(view, infrared):
        side = infrared["ifov"] * 1e-6 * look.slant_range * 1e3
        assert look.pixel == pytest.approx(side if look.way == "none" else side / 2)
        left, right, bottom, top = look.extent
        rows, columns = look.image.shape
        assert (right - left, top - bottom) == pytest.approx(
            (columns * look.pixel, rows * look.pixel)
        )
        assert np.isfinite(look.image).all()
        area = look.mask.sum() * look.pixel**2
        assert np.pi * look.unit**2 == pytest.approx(area)


def test_centroid_of_a_mask_is_where_its_pixels_are():
    mask = np.zeros((4, 6), dtype=bool)
    mask[1:3, 2:6] = True
    look = infrared_figures.Look(
        slant_range=25.0,
        way="none",
        across=np.arange(6) * 3.0 - 6.0,
        up=np.arange(4) * 3.0,
        image=np.zeros(mask.shape),
        mask=mask,
        cells=np.zeros((ANGLES, RADII)),
    )
    assert look.centroid == pytest.approx((4.5, 4.5))


def test_silhouettes_show_the_stores_images_to_scale_and_on_one_scale_a_range(
    drawn, view, infrared
):
    panels = panels_of(drawn["silhouettes"])
    looks = looks_of(view, infrared)
    limits = {}
    for look, (image, mask, polar) in zip(
        looks, zip(*[iter(panels)] * 3, strict=True), strict=True
    ):
        (shown,) = image.images
        np.testing.assert_array_equal(shown.get_array(), look.image)
        np.testing.assert_array_equal(mask.images[0].get_array(), look.mask)
        (cells,) = polar.collections
        # Turned by 90 degrees, so that it begins a quarter before the angle 0.
        expected = np.concatenate([look.cells[-ANGLES // 4 :], look.cells[: -ANGLES // 4]])
        np.testing.assert_array_equal(
            np.asarray(cells.get_array()).reshape(RADII, ANGLES).T, expected
        )
        for axes in (image, mask):
            box = axes.get_window_extent()
            across, up = np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())
            assert box.width / across == pytest.approx(box.height / up, rel=0.01)
        limits.setdefault(look.slant_range, set()).add(shown.get_clim())
        assert image.get_ylabel() == "up [m]"
        assert "√(area/π)" in polar.get_ylabel()
    assert [len(clims) for clims in limits.values()] == [1, 1, 1]
    assert [axes.get_xlabel() for axes in panels[-3:]] == [
        "across [m]",
        "across [m]",
        "angle [°], 0 right, 90 up",
    ]
    bars = [axes for axes in drawn["silhouettes"].axes if hasattr(axes, "_colorbar")]
    assert [bar.get_xlabel() for bar in bars] == ["K", "K", "K"]


def lines_of(axes, colour):
    """Points, ends of the intervals and of the spread, by order of range."""
    (points,) = [bars[0] for bars in axes.containers if bars[0] and bars[0].get_color() == colour]
    spread, interval = [
        np.array([segment[:, 1] for segment in bars.get_segments()])
        for bars in axes.collections
        if to_rgb(bars.get_color()[0][:3]) == to_rgb(colour)
    ]
    return np.asarray(points.get_ydata(), dtype=float), interval, spread


def test_table5_draws_the_stores_percentages_intervals_and_spread(drawn, smoke_store):
    tables = group(smoke_store, "tables/acn_infrared").sel(vigilance=0.87, frame_count=16)
    panels = panels_of(drawn["table5"])
    assert [axes.get_xlabel() for axes in panels] == ["slant range [km]"] * 4
    assert panels[0].get_ylabel() == "percent correct"
    for axes, label in zip(panels, tables.aspect_bin.values, strict=True):
        assert str(label).replace("-", "–") in axes.get_title()
        assert [tick.get_text() for tick in axes.get_xticklabels()] == ["25", "50", "100"]
        for way in WAYS:
            cell = tables.sel(aspect_bin=label, super_resolution=way).sortby("range")
            points, interval, spread = lines_of(axes, COLOURS[way])
            # Percentages are rounded to a tenth, their differences to two.
            np.testing.assert_allclose(points, 100 * cell.accuracy, atol=0.051)
            ends = np.stack([cell.ci_low, cell.ci_high], axis=1)
            np.testing.assert_allclose(interval, 100 * ends, atol=0.11)
            np.testing.assert_allclose(np.ptp(spread, axis=1), 200 * cell.spread, atol=0.11)
        guess = [line for line in axes.lines if line.get_label().startswith("chance")]
        assert [line.get_ydata()[0] for line in guess] == [50.0]


def test_marks_of_a_range_stay_in_its_band(drawn, smoke_store):
    """Well inside, the source's as well, so that none can be read as of another range."""
    tables = group(smoke_store, "tables/acn_infrared")
    views = rows.source_figures()["experiment"]["views"]
    whole = draw_table5(tables.assign(view_count=xr.full_like(tables.view_count, views)), ships=4)
    for axes in (*panels_of(drawn["table5"]), *panels_of(whole)):
        marked = [line for line in axes.lines if line.get_marker() not in ("None", "_", "|")]
        assert len(marked) >= len(WAYS)
        for line in marked:
            places = np.asarray(line.get_xdata(), dtype=float)
            assert np.abs(places - np.rint(places)).max() < 0.4
            assert line.get_linestyle() == "None"


def test_source_is_drawn_beside_its_own_views_only(drawn, smoke_store):
    def diamonds(figure):
        return [
            float(value)
            for axes in panels_of(figure)
            for line in axes.lines
            if line.get_marker() == "D"
            for value in line.get_ydata()
        ]

    assert diamonds(drawn["table5"]) == []
    tables = group(smoke_store, "tables/acn_infrared")
    views = rows.source_figures()["experiment"]["views"]
    whole = tables.assign(view_count=xr.full_like(tables.view_count, views))
    theirs = rows.source_figures()["table5_percent_correct"]
    expected = [
        *theirs["none"][25],
        *theirs["none"][50],
        *theirs["perfect"][50],
        *(value for way in ("none", "perfect") for value in theirs["overall"][way].values()),
    ]
    fair = compared(whole, SOURCE)
    assert sorted(diamonds(draw_table5(fair, ships=4))) == sorted(expected)


def test_pictures_leave_the_settings_of_matplotlib_alone(smoke_store):
    before = dict(matplotlib.rcParams)
    figures.draw("table5", smoke_store)
    assert dict(matplotlib.rcParams) == before
