"""What a sweep must keep whatever runs it: the same bits, the rest of the cells, what is done."""

import json
import shutil

import numpy as np
import pytest
import trimesh
import xarray as xr
from sweeping import TINY, command, contents, fresh

import ncti.ships
from sweeps import graph, stages, store
from sweeps.app import main
from sweeps.cache import StageCache
from sweeps.seeds import cell_rng


def run_here(monkeypatch, folder, *overrides, code=0):
    """The command in this process, without a cluster."""
    monkeypatch.chdir(folder)
    monkeypatch.setattr("sys.argv", ["ncti-sweep", *TINY, "cluster=inline", *overrides])
    with pytest.raises(SystemExit) as exit_:
        main()
    assert exit_.value.code == code


@pytest.fixture(scope="session")
def two_workers(tmp_path_factory, cache):
    folder = tmp_path_factory.mktemp("two")
    done = command(
        *TINY, "cluster.workers=2", "store=s.zarr", folder=folder, cache=fresh(folder, cache)
    )
    assert done.returncode == 0, done.stderr
    return folder


def test_one_and_two_workers_make_the_same_store(two_workers, tmp_path, cache):
    one = command(
        *TINY, "cluster.workers=1", "store=s.zarr", folder=tmp_path, cache=fresh(tmp_path, cache)
    )
    assert one.returncode == 0, one.stderr
    assert contents(tmp_path / "s.zarr") == contents(two_workers / "s.zarr")


def test_no_cluster_makes_the_same_store(two_workers, tmp_path, cache, monkeypatch):
    run_here(monkeypatch, tmp_path, "store=s.zarr", f"cache={fresh(tmp_path, cache)}")
    # This process may use several threads for a product, which may round otherwise.
    ours, theirs = (
        xr.open_datatree(folder / "s.zarr", engine="zarr") for folder in (tmp_path, two_workers)
    )
    assert ours.attrs == theirs.attrs
    for group in ("range_profile", "classification/acn", "status", "tables/acn"):
        xr.testing.assert_allclose(ours[group].to_dataset(), theirs[group].to_dataset(), rtol=1e-5)


def test_another_seed_is_other_noise(two_workers, tmp_path, monkeypatch):
    run_here(monkeypatch, tmp_path, "store=s.zarr", "seed=1", f"cache={two_workers / 'cache'}")
    ours, theirs = (
        xr.open_zarr(folder / "s.zarr", group="range_profile") for folder in (tmp_path, two_workers)
    )
    xr.testing.assert_allclose(ours.expected, theirs.expected, rtol=1e-5)
    assert not np.any(ours.averaged == theirs.averaged)


def test_a_cell_is_the_same_in_another_grid(two_workers, tmp_path, monkeypatch, cache):
    run_here(
        monkeypatch,
        tmp_path,
        "store=s.zarr",
        f"cache={fresh(tmp_path, cache)}",
        "grid.ship=[spruance]",
        "grid.aspect=[30,45]",
        "grid.pulse_width=50",
        "grid.frame_count=[1,2,8]",
        "grid.vigilance=0.9",
    )
    ours, theirs = (
        xr.open_zarr(folder / "s.zarr", group="range_profile").sel(
            ship="spruance", aspect=45, pulse_width=50, range=100
        )
        for folder in (tmp_path, two_workers)
    )
    xr.testing.assert_allclose(ours.expected, theirs.expected, rtol=1e-6)
    # The first two frames, drawn among 8 and among 4: equal to the rounding of float32.
    xr.testing.assert_allclose(
        ours.averaged.sel(frame_count=2), theirs.averaged.sel(frame_count=2), rtol=1e-5
    )


def test_replicates_are_further_draws_of_the_same_profiles(two_workers, tmp_path, monkeypatch):
    run_here(
        monkeypatch,
        tmp_path,
        "sensor=range",
        "grid.replicate=3",
        "store=s.zarr",
        f"cache={two_workers / 'cache'}",
    )
    ours, theirs = (
        xr.open_zarr(folder / "s.zarr", group="range_profile").load()
        for folder in (tmp_path, two_workers)
    )
    xr.testing.assert_equal(ours.expected, theirs.expected.drop_vars("replicate"))
    xr.testing.assert_equal(
        ours.averaged.sel(replicate=0, drop=True), theirs.averaged.drop_vars("replicate")
    )
    # 36 profiles of 250 bins, whose noise correlates over some 5 bins: 1,800 numbers at least
    # and so correlations of 0.024, of which three pairs stay below 4 standard deviations.
    noise = (ours.averaged - ours.expected).isel(frame_count=0)
    flat = noise.transpose("replicate", ...).values.reshape(3, -1)
    correlation = np.corrcoef(flat)[np.triu_indices(3, 1)]
    assert np.abs(correlation).max() < 4 * 0.024
    tables = xr.open_zarr(tmp_path / "s.zarr", group="tables/acn").load()
    assert "replicate" not in tables.dims
    assert tables.n.sel(aspect_bin="overall").min() == 3 * 2 * 3


def test_a_changed_vigilance_renders_and_draws_nothing(two_workers, tmp_path, monkeypatch):
    def never(*args, **kwargs):
        raise AssertionError("a finished stage was computed again")

    for name in ("range_image", "range_extent", "sample_frames", "expected_profile"):
        monkeypatch.setattr(stages, name, never)
    run_here(
        monkeypatch,
        tmp_path,
        "grid.vigilance=0.8",
        "store=s.zarr",
        f"cache={two_workers / 'cache'}",
    )
    assert np.all(xr.open_zarr(tmp_path / "s.zarr", group="status").cell == 1)


def test_a_changed_seed_renders_nothing(two_workers, tmp_path, monkeypatch):
    def never(*args, **kwargs):
        raise AssertionError("a finished stage was computed again")

    monkeypatch.setattr(stages, "range_image", never)
    run_here(monkeypatch, tmp_path, "seed=77", "store=s.zarr", f"cache={two_workers / 'cache'}")
    for group in ("status", "status_infrared"):
        assert np.all(xr.open_zarr(tmp_path / "s.zarr", group=group).cell == 1)


def test_a_view_that_fails_is_named_and_the_rest_is_done(
    two_workers, tmp_path, monkeypatch, capsys
):
    whole = stages.view_profiles

    def broken(view):
        if (view.ship.label, view.aspect) == ("duncan", 45):
            raise ArithmeticError("a\nstorm")
        return whole(view)

    monkeypatch.setattr(graph, "view_profiles", broken)
    cached = f"cache={two_workers / 'cache'}"
    run_here(monkeypatch, tmp_path, "store=s.zarr", cached, code=1)
    assert "ship=duncan aspect=45 (ArithmeticError: a storm)" in capsys.readouterr().err
    status = xr.open_zarr(tmp_path / "s.zarr", group="status").load()
    assert status.view.sel(ship="duncan", aspect=45) == 0
    assert int((status.view == 1).sum()) == 5
    lost = status.cell.sel(ship="duncan", aspect=45)
    assert np.all(lost == 0)
    assert int((status.cell == 0).sum()) == lost.size
    tables = xr.open_zarr(tmp_path / "s.zarr", group="tables/acn").load()
    assert np.all(tables.n.sel(aspect_bin="overall") == 5)

    # Once the cause is gone, the same command goes on: one view is measured, and the store is
    # the one that would have been.
    measured = []
    monkeypatch.setattr(graph, "view_profiles", lambda view: measured.append(view) or whole(view))
    run_here(monkeypatch, tmp_path, "store=s.zarr", cached)
    assert [(view.ship.label, view.aspect) for view in measured] == [("duncan", 45)]
    again = xr.open_datatree(tmp_path / "s.zarr", engine="zarr")
    first = xr.open_datatree(two_workers / "s.zarr", engine="zarr")
    xr.testing.assert_allclose(
        again["range_profile"].to_dataset(), first["range_profile"].to_dataset(), rtol=1e-5
    )
    assert np.all(again["status"].cell == 1)


def test_another_sweep_does_not_touch_a_store(two_workers, monkeypatch, capsys):
    before = contents(two_workers / "s.zarr")
    run_here(
        monkeypatch,
        two_workers,
        "store=s.zarr",
        "seed=5",
        f"cache={two_workers / 'cache'}",
        code=2,
    )
    assert "s.zarr" in capsys.readouterr().err
    assert contents(two_workers / "s.zarr") == before


def test_several_noise_floors_are_an_axis(two_workers, tmp_path, monkeypatch):
    run_here(
        monkeypatch,
        tmp_path,
        "store=s.zarr",
        "ladar.target_free_ifovs=[0,4000]",
        "grid.ship=duncan",
        f"cache={two_workers / 'cache'}",
    )
    profiles = xr.open_zarr(tmp_path / "s.zarr", group="range_profile").load()
    assert profiles.target_free_ifovs.values.tolist() == [0, 4000]
    step = profiles.expected.diff("target_free_ifovs")
    np.testing.assert_allclose(step, 4000 * (np.pi**3 / 32) ** 0.25, rtol=1e-6)
    tables = xr.open_zarr(tmp_path / "s.zarr", group="tables/acn")
    assert "target_free_ifovs" in tables.accuracy.dims


@pytest.mark.parametrize("ladar", ["first_pulse", "peak_pulse"])
def test_other_receivers_run_the_whole_sweep(ladar, two_workers, tmp_path, monkeypatch):
    run_here(
        monkeypatch, tmp_path, "store=s.zarr", f"ladar={ladar}", f"cache={two_workers / 'cache'}"
    )
    profiles = xr.open_zarr(tmp_path / "s.zarr", group="range_profile").load()
    assert np.isfinite(profiles.averaged).all()
    assert (profiles.expected > 0).any("down_range").all()


def test_multirun_gives_each_job_its_own_store(two_workers, tmp_path):
    done = command(
        "-m",
        *(item for item in TINY if "vigilance" not in item),
        "grid.vigilance=0.85,[0.9,0.95]",
        "cluster=inline",
        folder=tmp_path,
        cache=two_workers / "cache",
    )
    assert done.returncode == 0, done.stderr
    stores = sorted(tmp_path.glob("multirun/*/*/*/sweep.zarr"))
    values = [xr.open_zarr(s, group="tables/acn").vigilance.values.tolist() for s in stores]
    assert values == [[0.85], [0.9, 0.95]]


def test_report_prints_the_tables_of_a_store(two_workers, capsys, monkeypatch):
    from sweeps.report.command import main as report

    monkeypatch.setattr("sys.argv", ["ncti-report", str(two_workers / "s.zarr")])
    report()
    printed = capsys.readouterr().out
    assert "Categories formed" in printed and "Percent correct" in printed
    monkeypatch.setattr("sys.argv", ["ncti-report", str(two_workers)])
    with pytest.raises(SystemExit) as exit_:
        report()
    assert exit_.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_stage_cache_survives_damage_and_tells_inputs_apart(tmp_path):
    cache = StageCache(tmp_path)
    made = []

    def compute():
        made.append(1)
        return {"a": np.arange(3.0)}

    for _ in range(2):
        kept = cache.fetch("stage", {"x": 0.1}, compute)
        np.testing.assert_array_equal(kept["a"], [0, 1, 2])
    assert len(made) == 1
    cache.fetch("stage", {"x": 0.2}, compute)
    cache.fetch("other", {"x": 0.1}, compute)
    assert len(made) == 3
    for path in tmp_path.rglob("*.npz"):
        path.write_bytes(path.read_bytes()[:40])
    cache.fetch("stage", {"x": 0.1}, compute)
    assert len(made) == 4
    assert not list(tmp_path.rglob("*.partial"))
    assert cache.fetch("stage", {"x": 0.1}, compute)["a"].tolist() == [0, 1, 2]


def test_a_pickle_in_the_cache_is_not_opened(tmp_path):
    cache = StageCache(tmp_path)
    cache.fetch("stage", {}, lambda: {"a": np.zeros(1)})
    (path,) = tmp_path.rglob("*.npz")
    np.savez(path, a=np.array([{"evil": 1}], dtype=object))
    assert cache.fetch("stage", {}, lambda: {"a": np.ones(1)})["a"].tolist() == [1]


def test_streams_are_keyed_by_value_and_independent():
    first = cell_rng(1, ship="duncan", aspect=3.0).random(4)
    np.testing.assert_array_equal(first, cell_rng(1, aspect=3.0, ship="duncan").random(4))
    draws = np.array(
        [cell_rng(seed, ship="duncan", aspect=a).random(2000) for seed in (1, 2) for a in (0, 3)]
    )
    correlation = np.corrcoef(draws)[np.triu_indices(4, 1)]
    # Six correlations of 2,000 pairs, level 1e-3 together: 3.8 standard errors of 1/sqrt(2000).
    assert np.abs(correlation).max() < 3.8 / np.sqrt(2000)


def test_workers_listen_on_loopback_only():
    import os

    import psutil

    from sweeps.cluster import executor
    from sweeps.schema import ClusterConfig

    with executor(ClusterConfig(kind="local", workers=2), tasks=2) as workers:
        assert {result for _, result, _ in workers.run(abs, [(-1,), (-2,)])} == {1, 2}
        family = [psutil.Process(os.getpid())]
        family += family[0].children(recursive=True)
        listening = [
            connection.laddr.ip
            for process in family
            for connection in process.net_connections(kind="inet")
            if connection.status == psutil.CONN_LISTEN
        ]
    assert listening
    assert set(listening) <= {"127.0.0.1", "::1"}


def test_status_of_an_unfinished_store_reads_missing(two_workers, tmp_path, monkeypatch):
    class Killed(BaseException):
        pass

    def kill(*args):
        raise Killed

    monkeypatch.setattr(graph, "run_classification", kill)
    with pytest.raises(Killed):
        run_here(monkeypatch, tmp_path, "store=s.zarr", f"cache={two_workers / 'cache'}")
    status = xr.open_zarr(tmp_path / "s.zarr", group="status").load()
    assert np.all(status.view == 1)
    assert np.all(status.cell == -1)
    monkeypatch.undo()
    run_here(monkeypatch, tmp_path, "store=s.zarr", f"cache={two_workers / 'cache'}")
    attributes = json.loads((tmp_path / "s.zarr" / "zarr.json").read_text())["attributes"]
    assert attributes["seed"] == 0
    assert np.all(xr.open_zarr(tmp_path / "s.zarr", group="status").cell == 1)


def test_a_store_is_seen_whole_or_not_at_all(two_workers, tmp_path, monkeypatch):
    """A maker that is killed half way leaves nothing that stands in the way of the next."""

    class Killed(BaseException):
        pass

    def kill(*args):
        raise Killed

    monkeypatch.setattr(store, "_consolidate", kill)
    cached = f"cache={two_workers / 'cache'}"
    with pytest.raises(Killed):
        run_here(monkeypatch, tmp_path, "store=s.zarr", cached)
    assert not (tmp_path / "s.zarr").exists()
    monkeypatch.undo()
    run_here(monkeypatch, tmp_path, "store=s.zarr", cached)
    assert (tmp_path / "s.zarr").exists()
    assert not list(tmp_path.glob(".s.zarr*"))


def test_leftovers_of_a_killed_writer_are_swept_up(two_workers, tmp_path):
    shutil.copytree(two_workers / "s.zarr", tmp_path / "s.zarr")
    orphan = tmp_path / "s.zarr" / "range_profile" / "averaged" / "c" / "0.abc.partial"
    orphan.parent.mkdir(exist_ok=True)
    orphan.write_bytes(b"half")
    again = command(*TINY, "store=s.zarr", folder=tmp_path, cache=two_workers / "cache")
    assert again.returncode == 0, again.stderr
    assert contents(tmp_path / "s.zarr") == contents(two_workers / "s.zarr")


def test_two_stores_of_one_folder_keep_their_own_tables(two_workers, tmp_path, monkeypatch):
    cached = f"cache={two_workers / 'cache'}"
    for name in ("run.1", "run.2"):
        run_here(monkeypatch, tmp_path, f"store={name}", "grid.aspect=[0,1e-5]", cached)
        assert (tmp_path / f"{name}-tables" / "accuracy.csv").exists()


def test_a_view_cut_short_is_no_view(two_workers, tmp_path, monkeypatch):
    """One array of a view written, the other not: that view fails, and no other."""
    whole = store.write_view

    def half(path, ship, aspect, measured):
        if (ship, aspect) == (0, 1):
            whole(path, ship, aspect, {group: measured[group] for group in ("range_profile",)})
            raise OSError("no space left on device")
        whole(path, ship, aspect, measured)

    monkeypatch.setattr(store, "write_view", half)
    run_here(monkeypatch, tmp_path, "store=s.zarr", f"cache={two_workers / 'cache'}", code=1)
    status = xr.open_zarr(tmp_path / "s.zarr", group="status").load()
    assert int((status.view == 0).sum()) == 1
    assert int((status.cell == 0).sum()) == 2 * 2 * 2
    assert int((status.cell == 1).sum()) == 5 * 2 * 2 * 2


def test_a_mesh_edited_while_the_sweep_runs_is_not_taken_for_the_old_one(tmp_path):
    path = tmp_path / "barge.stl"
    for length in (60, 90):
        mesh = trimesh.creation.box(extents=(length, 10, 8))
        mesh.apply_translation((0, 0, 4))
        mesh.export(path)
        if length == 60:
            digest = ncti.ships.digest(path)
    with pytest.raises(ValueError, match="changed while the sweep ran"):
        stages.load_ship(str(path), digest, tmp_path)
