"""The stages between configuration and library: units, sampling, what is computed when."""

from dataclasses import replace

import numpy as np
import pytest

import ncti.ships
from ncti.ladar import expected_profile, range_extent
from ncti.render import range_image
from ncti.render.flight import depression_angle
from sweeps import stages
from sweeps.cache import code_digest
from sweeps.grid import InfraredGrid
from sweeps.ladar import bin_centres
from sweeps.schema import RenderConfig, SceneConfig
from sweeps.sensor_schema import InfraredConfig, LadarConfig
from sweeps.stages import Ship, View, ViewPlan, depression_at, view_profiles

INFRARED_GRID = InfraredGrid(
    range=(25.0,),
    super_resolution=("none", "perfect", "shifted"),
    frame_count=(1, 16),
    coverage_rule=(0.25,),
    segmentation=("matched",),
    inner_radius=(0.75,),
    interpolation=("bilinear",),
    phase=(0, 1),
    order=(0,),
    vigilance=(0.87,),
)


def plan_of(cache, **changes):
    plan = ViewPlan(
        sensors=("range",),
        pulse_width=(30.0,),
        frame_count=(2,),
        range=(100.0,),
        target_free_ifovs=(0,),
        replicate=(0,),
        lag=1,
        scene=SceneConfig(),
        render=RenderConfig(engine="embree"),
        ladar=LadarConfig(),
        infrared_grid=INFRARED_GRID,
        infrared=InfraredConfig(),
        seed=0,
        cache=cache,
        code={"range": stages.profile_code()},
    )
    return replace(plan, **changes)


@pytest.fixture
def duncan():
    return Ship("duncan", "duncan", ncti.ships.digest("duncan"))


@pytest.fixture
def drawn(monkeypatch):
    """Every image drawn, as (depression, pixel, samples)."""
    log = []

    def draw(*args, **kwargs):
        image = range_image(*args, **kwargs)
        log.append((image.depression, image.pixel, int(image.hit.sum())))
        return image

    monkeypatch.setattr(stages, "range_image", draw)
    return log


def test_a_view_is_the_library_in_the_units_of_the_configuration(duncan, tmp_path):
    plan = plan_of(tmp_path, render=RenderConfig(engine="embree", samples=0))
    image = range_image(ncti.ships.load("duncan"), aspect=63, depression=3.84, engine="embree")
    extent = range_extent(image, slant_range=100e3, ifov=150e-6, bin_width=1.0)
    by_hand = expected_profile(extent, pulse_width=30e-9, cnr=10**3.2)
    ours = view_profiles(View(duncan, 63, plan))["expected"][0, 0, 0]
    np.testing.assert_allclose(ours, by_hand, rtol=1e-6)
    np.testing.assert_array_equal(bin_centres(plan.ladar), extent.down_range)


def test_extinction_reaches_the_profile_in_its_units(duncan, tmp_path):
    # 0.1 dB/km over the 50 km less than the reference, both ways: 10 dB more, besides 4 times.
    ladar = LadarConfig(extinction=0.1, cnr=20.0)
    plan = plan_of(tmp_path, range=(50.0,), ladar=ladar)
    clear = LadarConfig(cnr=20.0 + 10.0)
    np.testing.assert_allclose(
        view_profiles(View(duncan, 60.0, plan))["expected"],
        view_profiles(View(duncan, 60.0, replace(plan, ladar=clear)))["expected"],
        rtol=1e-6,
    )


def test_ends_are_drawn_finer_and_broadsides_once(duncan, tmp_path, drawn):
    view_profiles(View(duncan, 0.0, plan_of(tmp_path)))
    (_, first, few), (_, second, enough) = drawn
    assert first == 0.25 and second < 0.25
    assert few < 20_000
    assert enough == pytest.approx(20_000, rel=0.02)
    drawn.clear()
    view_profiles(View(duncan, 60.0, plan_of(tmp_path)))
    assert len(drawn) == 1


def test_one_image_serves_all_ranges_at_one_depression(duncan, tmp_path, drawn):
    view_profiles(View(duncan, 60.0, plan_of(tmp_path, range=(25.0, 50.0, 100.0))))
    assert len(drawn) == 1


def test_each_range_has_its_depression_at_one_altitude(duncan, tmp_path, drawn):
    scene = SceneConfig(geometry="altitude")
    view_profiles(View(duncan, 60.0, plan_of(tmp_path, range=(25.0, 100.0), scene=scene)))
    assert [depression for depression, _, _ in drawn] == pytest.approx([15.46, 3.40], abs=0.01)


def test_depression_angles():
    # Flat sea, the article's 22,000 ft: asin(h / R).
    for slant_range, flat in ((25e3, 15.56), (100e3, 3.84)):
        angle = depression_angle(slant_range, altitude=6705.6, earth_radius=1e12)
        assert angle == pytest.approx(flat, abs=0.005)
    assert depression_angle(100e3, altitude=6705.6) == pytest.approx(3.396, abs=0.001)
    assert depression_angle(5e3, altitude=5e3, earth_radius=1e12) == pytest.approx(90, abs=1e-3)
    assert depression_at(100.0, SceneConfig()) == 3.84
    with pytest.raises(ValueError, match="altitude"):
        depression_angle(5e3, altitude=6e3)
    with pytest.raises(ValueError, match="horizon"):
        depression_angle(300e3, altitude=6e3)


def test_code_is_told_apart_by_its_source(tmp_path, monkeypatch):
    package = tmp_path / "fleet"
    package.mkdir()
    (package / "__init__.py").write_text("A = 1")
    (package / "oar.py").write_text("B = 1")
    monkeypatch.syspath_prepend(tmp_path)

    def digest(*names):
        code_digest.cache_clear()
        return code_digest(*names)

    whole, one = digest("fleet"), digest("fleet.oar")
    assert digest("fleet") == whole != one
    (package / "__init__.py").write_text("A = 2")
    assert digest("fleet") != whole
    assert digest("fleet.oar") == one
    (package / "oar.py").write_text("B = 2")
    assert digest("fleet.oar") != one
