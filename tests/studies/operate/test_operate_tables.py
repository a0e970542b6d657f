"""Tables of frames and costs are right for shares that are known functions of the setting."""

import numpy as np
import pytest
import xarray as xr

from studies.operate.costs import relative_cost
from studies.operate.tables import tabulate_cheapest, tabulate_frames

AXES = {
    "range": [50.0, 100.0],
    "ifov": [75.0, 150.0],
    "cnr": [26.0, 32.0],
    "pulse_width": [10.0, 30.0],
    "frame_count": [2, 4, 8, 16, 32, 64, 128],
    "fleet": [4],
    "channel": ["profile", "silhouette", "both"],
}
NEEDED = 16.0  # frames at 100 km, 150 urad, 32 dB, 30 ns, by profile


def shares(resamples=3):
    """Return shares that rise to 95 % on a straight line in the logarithm of the frames."""
    grid = xr.Dataset(coords=AXES)
    needed = NEEDED * (grid.range / 100) ** 4 * (grid.ifov / 150) * (grid.pulse_width / 30)
    needed = needed * 10 ** ((32 - grid.cnr) / 10)
    needed = needed * xr.DataArray([1.0, 1e9, 0.5], {"channel": AXES["channel"]}, ("channel",))
    share = (0.95 + 0.1 * np.log2(grid.frame_count / needed)).clip(0, None)
    share = share.expand_dims(fleet=AXES["fleet"])
    return xr.Dataset({"share": share, "resampled": share.expand_dims(resample=resamples)})


@pytest.mark.parametrize("ifov", [50e-6, 150e-6, 400e-6])
@pytest.mark.parametrize(("frames", "cnr"), [(16, 32.0), (4, 20.0)])
def test_cost_is_transmitted_energy_times_aperture_area(frames, cnr, ifov):
    def spent(frames, cnr, ifov):
        area = (10.6e-6 / ifov) ** 2  # of an aperture limited by diffraction
        energy = 10 ** (cnr / 10) / area  # of a pulse into an IFOV that is to return that CNR
        return frames * (1e-3 / ifov) ** 2 * energy * area  # for a box of 1 mrad

    ratio = spent(frames, cnr, ifov) / spent(16, 32.0, 150e-6)
    assert relative_cost(frames, cnr, ifov) == pytest.approx(ratio)


def test_frame_table_uses_the_article_setting():
    table = tabulate_frames(shares()).squeeze("fleet")
    assert table.frames.sel(range=100, channel="profile").item() == pytest.approx(NEEDED)
    assert table.frames.sel(range=100, channel="both").item() == pytest.approx(NEEDED / 2)
    assert table.frames.sel(range=50, channel="profile").item() == 2  # the fewest of the sweep
    assert np.isinf(table.frames.sel(channel="silhouette")).all()
    assert table.frames.equals(table.frames_low) and table.frames.equals(table.frames_high)


def test_cheapest_table_minimises_cost_over_settings():
    table = tabulate_cheapest(shares()).squeeze("fleet").sel(range=100)
    # Frames go as the IFOV and the cost as its inverse square, so that the wider one is cheaper.
    # Effects of the CNR cancel; a short pulse needs fewer frames and costs nothing.
    profile = table.sel(channel="profile")
    assert (profile.best_ifov, profile.best_pulse_width) == (150, 10)
    assert profile.cost.item() == pytest.approx(1 / 3)
    frames = relative_cost(1, profile.best_cnr, profile.best_ifov * 1e-6)
    assert profile.frames.item() == pytest.approx(profile.cost.item() / float(frames))
    assert table.cost.sel(channel="both").item() == pytest.approx(1 / 6)
    assert profile.chosen.item() == 1
