"""The reports of whole commands, run with a toy in the place of the experiment."""

import io

import pytest
from rich.console import Console

from benchmarks import commands, grid, memory, paper
from benchmarks.processes import Run
from benchmarks.sweeping import choices_of
from sweeps.engine.multirun import crossed
from sweeps.engine.plan import Plan
from sweeps.engine.schedule import Progress
from sweeps.engine.watching import summary
from sweeps.experiment import EXPERIMENT
from sweeps.stages.views import Grid

TOY = ("-c", "from benchmarks.toy import main; main()")


@pytest.fixture
def toy(monkeypatch, tmp_path):
    """The toy's command in the place of `ncti-sweep`."""
    monkeypatch.setattr(commands, "PROGRAM", TOY)
    monkeypatch.setattr(commands, "cache_folder", lambda: tmp_path / "user")


def swept(seconds, made):
    """What a command took that started no worker."""
    run = Run(seconds, seconds, together=50.0, driver=100.0, worker=0.0, output="")
    return commands.Swept(run, made, reused=0, work=seconds)


def test_printed_summaries_are_read_back():
    progress = {
        "a_stage_of_a_long_name": Progress(9, 2, 4, 3, 12.34),
        "quick": Progress(5, 0, 5, 0, 0.01),
        "reused": Progress(7, 7, 0, 0, 0.0),
    }
    text = io.StringIO()
    console = Console(file=text, width=80, soft_wrap=True, markup=False)
    for _ in range(2):  # as of two jobs
        console.print("ship 1 2 3.0")
        console.print(summary(progress, 3.2))
        console.print("ncti-sweep: 2 cells failed")
    assert list(commands.sweeps_printed(text.getvalue())) == 2 * [(9, 9, 12.3)]


def test_a_command_that_tells_nothing_is_an_error(monkeypatch, tmp_path):
    monkeypatch.setattr(commands, "PROGRAM", ("-c", "print('tea')"))
    with pytest.raises(RuntimeError, match="printed no summary of a sweep"):
        commands.sweep(["sensor=range"], tmp_path)


@pytest.mark.usefixtures("toy")
def test_paper_makes_only_what_is_more():
    base = ("cluster=inline", "grid.ship=[duncan,texas]", "grid.pulse_width=[10,30]")
    more = {"one more": "grid.pulse_width=[10,20,30]"}
    report = paper.measure(repeats=1, experiment=base, more=more)
    assert [(row["step"], row["cells"]) for row in report.rows] == [
        (paper.COLD, 4),
        (paper.AGAIN, 0),
        ("one more", 2),
    ]
    cold, *others = report.rows
    assert cold["ratio"].median == 1
    for row in others:
        assert row["ratio"].median == row["wall_s"].median / cold["wall_s"].median


@pytest.mark.usefixtures("toy")
def test_jobs_of_the_basic_launcher_are_added_up(tmp_path):
    part = grid.swept({"ship": ("duncan", "texas"), "aspect": (0,)})
    folder = commands.new_folder(tmp_path / "cold")
    found = commands.sweep(["-m", *grid.BASIC_LAUNCHER, *part], folder)
    assert (found.made, found.reused) == (2, 0)
    assert len(list(folder.glob("hydra/*/sweep.zarr"))) == 2


def test_a_part_of_the_grid_counts_for_the_whole(monkeypatch):
    whole = {"ship": ("duncan", "texas"), "aspect": (0, 3, 6)}
    runs = iter([swept(2.0, 6), swept(3.0, 6), swept(5.0, 2)])
    asked = []

    def sweep(overrides, folder):
        asked.append(overrides)
        return next(runs)

    monkeypatch.setattr(grid, "sweep", sweep)
    report = grid.measure(repeats=1, grid=whole, part={**whole, "aspect": (0,)})
    assert [row["cells"] for row in report.rows] == [6, 6, 2]
    assert [row["whole_s"].median for row in report.rows] == [2, 3, 15]
    assert [row["ratio"].median for row in report.rows] == [1, 1.5, 7.5]
    assert [row["efficiency"].median for row in report.rows] == [0.5, 0.5, 0.5]
    assert asked == [
        ["grid.ship=[duncan,texas]", "grid.aspect=[0,3,6]"],
        ["-m", "grid.ship=duncan,texas", "grid.aspect=0,3,6"],
        ["-m", *grid.BASIC_LAUNCHER, "grid.ship=duncan,texas", "grid.aspect=0"],
    ]


def test_memory_is_of_1_4_and_16_times_the_aspects(monkeypatch):
    aspects = []

    def sweep(overrides, folder):
        choices = choices_of(overrides)
        assert choices[Grid.ship] == ("duncan", "spruance")
        aspects.append(choices[Grid.aspect])
        return swept(1.0, len(aspects[-1]))

    monkeypatch.setattr(memory, "sweep", sweep)
    report = memory.measure(repeats=1)
    assert list(map(len, aspects)) == [row["aspects"] for row in report.rows] == [30, 120, 480]
    assert set(aspects[0]) < set(aspects[1]) < set(aspects[2])
    assert [row["driver_mib"].median for row in report.rows] == [100] * 3


def test_the_grid_is_the_sources_at_three_ranges():
    assert grid.cells(grid.GRID) == 22_320
    assert grid.cells(grid.GRID) / grid.cells(grid.HUNDREDTH) == pytest.approx(100, rel=0.05)
    for name, values in grid.HUNDREDTH.items():
        assert set(values) <= set(grid.GRID[name])
    assert crossed(EXPERIMENT, grid.swept(grid.GRID)) == grid.listed(grid.GRID)
    choices = choices_of(grid.listed(grid.GRID))
    for name, values in grid.GRID.items():
        assert choices.values[f"grid.{name}"] == tuple(values)
    # And nothing else has several: what the network names is one cell of the grid each.
    plan = Plan(EXPERIMENT, choices)
    named = plan.count(plan.bound["acn"]) * len(choices[Grid.ship]) * len(choices[Grid.aspect])
    assert named == 22_320


@pytest.mark.parametrize("override", paper.MORE.values(), ids=list(paper.MORE))
def test_one_more_is_one_value_more(override):
    before = choices_of(paper.EXPERIMENT).values
    after = choices_of([*paper.EXPERIMENT, override]).values
    differing = [key for key in before if before[key] != after[key]]
    assert differing == [override.partition("=")[0]]
    (key,) = differing
    assert set(before[key]) < set(after[key])
    assert len(after[key]) == len(before[key]) + 1
