"""The time of a search, and the time that visits save, have closed forms."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from studies.scan.field import Box, Field
from studies.scan.schedule import Rates, dwell, imaging_time, max_pulse_rate, position_count

IFOV = 150e-6
SOURCE = {"width": math.radians(3), "height": math.radians(2)}
IMAGER = {"ifov": IFOV, "pixels": 256, "frame_count": 16, "frame_rate": 30.0, "slew_time": 0.1}


def test_the_sources_field_has_175_by_117_places():
    assert position_count(**SOURCE, element=IFOV) == 175 * 117
    # 32 frames at a kilohertz: 655 s, which is why something else has to look first
    assert dwell(175 * 117, frame_count=32, pulse_rate=1000.0) == pytest.approx(655.2)


@given(st.integers(1, 200), st.integers(1, 200), st.integers(1, 8))
def test_position_count_is_the_fewest_that_cover_the_field(columns, rows, detector):
    positions = position_count(columns * IFOV, rows * IFOV, element=IFOV, detector=detector)
    across, up = -(-columns // detector), -(-rows // detector)
    assert positions == across * up
    assert (across - 1) * detector < columns <= across * detector


def test_the_imager_steps_over_a_field_wider_than_its_array():
    # 349.1 x 232.7 pixels: two places of 256
    assert imaging_time(**SOURCE, **IMAGER) == pytest.approx(2 * 16 / 30 + 0.1)
    field = {"width": math.radians(12), "height": math.radians(12)}  # 1396.3 pixels: six by six
    assert imaging_time(**field, **IMAGER) == pytest.approx(36 * 16 / 30 + 35 * 0.1)


@given(
    visits=st.lists(st.integers(1, 500), max_size=20),
    frame_count=st.integers(1, 64),
    pulse_rate=st.floats(10, 1e5),
    slew_time=st.floats(0, 1),
)
def test_search_time_is_the_sum_of_its_parts(visits, frame_count, pulse_rate, slew_time):
    rates = Rates(2, pulse_rate, 256, 16, 30.0, slew_time)
    boxes = [Box(0, 0, 2 * positions, 2) for positions in visits]
    search = rates.schedule(Field(**SOURCE, ifov=IFOV), boxes, frame_count)
    assert search.imaging == imaging_time(**SOURCE, **IMAGER | {"slew_time": slew_time})
    assert search.total == search.imaging + search.slewing + search.dwelling
    assert search.slewing == pytest.approx(len(visits) * slew_time)
    assert search.dwelling == pytest.approx(sum(visits) * frame_count / pulse_rate)
    assert search.exhaustive == pytest.approx(175 * 117 * frame_count / pulse_rate)


def test_maximum_pulse_rate_is_unambiguous_in_range():
    assert max_pulse_rate(100e3) == pytest.approx(1499, abs=0.5)
