"""Both sensors at aspects that nobody learned: at least as good as the better one."""

import numpy as np
import pytest
import xarray as xr
from infrared_channel import EXPERIMENT, choose

from sweeps.engine.cluster import ClusterChoice
from sweeps.engine.run import Place, sweep
from sweeps.engine.schedule import Watch

SPACINGS = (6.0, 3.0)


@pytest.fixture(scope="module", params=SPACINGS)
def answers(request, tmp_path_factory):
    """Learned at several spacings, shown at random aspects abeam and near the bow."""
    rng = np.random.default_rng(11)
    fresh = [*np.round(rng.uniform(0, 30, 4), 2), *np.round(rng.uniform(60, 90, 8), 2)]
    learned = np.arange(0, 90.1, request.param)
    folder = tmp_path_factory.mktemp("fresh")
    choices = choose(
        sensor="both",
        classifier__name="fusion",
        classifier__training_aspect=[float(one) for one in learned],
        grid__aspect=sorted({*map(float, learned), *map(float, fresh)}),
        grid__range=25,
        grid__frame_count=16,
        infrared__range=25,
        infrared__frame_count=16,
        infrared__super_resolution="none",
        infrared__phases=2,
        render__pixel=0.5,
        render__engine="lines",
    )
    place = Place(
        folder / "s.zarr", tmp_path_factory.getbasetemp() / "fresh", ClusterChoice(kind="inline")
    )
    assert not sweep(EXPERIMENT, choices, place, Watch(say=lambda sentence: None)).failures
    found = xr.open_zarr(place.store, group="classification/fusion").load().squeeze(drop=True)
    return found.sel(aspect=sorted(map(float, fresh)))


def test_both_are_at_least_as_good_as_the_better_sensor(answers):
    """Overall and by end, within 1.96 standard errors of the paired difference between views.

    And nine in ten are right overall, of 48 views in two phases.
    """
    right = answers.correct == 1
    for part in (right, right.sel(aspect=slice(0, 30)), right.sel(aspect=slice(60, 90))):
        share = part.mean(("draw", "ship", "aspect"))
        better = max(("range", "infrared"), key=lambda name: float(share.sel(channel=name)))
        gain = part.sel(channel="both") * 1.0 - part.sel(channel=better)
        views = gain.mean("draw").values.ravel()
        assert views.mean() + 1.96 * views.std() / np.sqrt(views.size) >= 0
    assert float(right.sel(channel="both").mean()) > 0.9
