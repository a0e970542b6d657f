"""A store that grows computes new cells alone, and equals the store of a sweep of the whole."""

from commands import FAST, chosen, swept
from small_stores import contents

from sweeps.engine.resolve.plan import Plan
from sweeps.experiment import EXPERIMENT

TINY = (*FAST, "grid.frame_count=[2,4]", "ladar.place=corner", "classifier.template_places=1")
ALL = (*TINY, "classifier=all", "classifier.mnn.epochs=5")


WHOLE = ("grid.ship=[duncan,spruance]", "grid.aspect=[0,30,60]", "grid.pulse_width=[30,50]")


def test_extending_a_store_computes_only_new_cells(folder):
    """It grows by a view in front and a longer pulse, and then equals the whole sweep's store."""
    store, cache, whole = folder / "s.zarr", folder / "cache", folder / "whole.zarr"
    swept(whole, folder / "other", *ALL, *WHOLE)
    overrides = ("grid.ship=[duncan,spruance]", "grid.aspect=[30,60]", "grid.pulse_width=30")
    finished = swept(store, cache, *ALL, *overrides)
    grown = swept(store, cache, *ALL, *WHOLE)
    assert contents(store) == contents(whole)
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
    assert not repeated.written and contents(store) == contents(whole)


def test_changing_the_frame_count_does_not_retrain_classifiers():
    def keys(stage, frames):
        plan = Plan(EXPERIMENT, chosen(*ALL, *WHOLE, f"grid.frame_count={frames}"))
        return {*map(bytes, plan.keys(plan.bound[stage]))}

    for name in ("acn_training", "mnn_training", "calibrated_error"):
        assert keys(name, "[2,4]") == keys(name, "2")
    for name in ("acn", "mnn", "correlation", "likelihood"):
        assert keys(name, "[2,4]") > keys(name, "2")
