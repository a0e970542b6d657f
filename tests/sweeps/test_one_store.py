"""A store that grows computes new cells alone, and equals the store of a sweep of the whole."""

import pytest
from commands import FAST, swept
from small_stores import contents

TINY = (*FAST, "grid.frame_count=[2,4]", "ladar.place=corner", "classifier.template_places=1")
ALL = (*TINY, "classifier=all", "classifier.mnn.epochs=5")


WHOLE = ("grid.ship=[duncan,spruance]", "grid.aspect=[0,30,60]", "grid.pulse_width=[30,50]")


@pytest.fixture(scope="module")
def whole_store(tmp_path_factory):
    """Return the store of a sweep with all classifiers of profiles."""
    folder = tmp_path_factory.mktemp("whole")
    swept(folder / "s.zarr", folder / "cache", *ALL, *WHOLE)
    return folder / "s.zarr"


def test_a_store_grows_by_what_is_new(whole_store, folder):
    """It grows by a view in front and a longer pulse, and then equals the whole sweep's store."""
    store, cache = folder / "s.zarr", folder / "cache"
    overrides = ("grid.ship=[duncan,spruance]", "grid.aspect=[30,60]", "grid.pulse_width=30")
    finished = swept(store, cache, *ALL, *overrides)
    grown = swept(store, cache, *ALL, *WHOLE)
    assert contents(store) == contents(whole_store)
    counts = {name: (progress.done, progress.reused) for name, progress in grown.progress.items()}
    # At one place on the grid of IFOVs tests, templates and expected profiles share an extent.
    extents = [counts[name] for name in ("extent", "offset_extent", "placed_extent")]
    assert sorted(extents) == [(0, 4), (0, 4), (2, 4)]
    new = 2 * 3 * 2 - 4
    assert sorted((counts["expected"], counts["placed_profile"])) == [(0, 4), (new, 4)]
    assert counts["covariance"] == (new, 4)
    assert counts["averaged"] == (2 * new, 2 * 4)
    # Classifiers see all views, so all of their answers are new.
    for name in ("acn", "mnn", "correlation", "likelihood"):
        assert counts[name] == (2 * 2, 0) and finished.progress[name].done == 2
    repeated = swept(store, cache, *ALL, *WHOLE)
    assert not repeated.written and contents(store) == contents(whole_store)


def test_one_more_number_of_frames_answers_alone(whole_store, folder):
    """Classifiers that do not depend on the number of frames are not trained again."""
    store, cache = folder / "s.zarr", folder / "cache"
    swept(store, cache, *ALL, *WHOLE, "grid.frame_count=2")
    grown = swept(store, cache, *ALL, *WHOLE)
    assert contents(store) == contents(whole_store)
    counts = {name: (progress.done, progress.reused) for name, progress in grown.progress.items()}
    assert counts["averaged"] == (12, 12) and counts["expected"] == (0, 12)
    assert counts["mnn_training"] == counts["acn_training"] == (0, 2)
    for name in ("acn", "mnn", "correlation", "likelihood"):
        assert counts[name] == (2, 2)
