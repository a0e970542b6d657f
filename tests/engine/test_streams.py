"""Names and draws of random streams are pinned, since results in caches were made with them."""

from dataclasses import replace

import pytest
from toys import SPRINGS, Measured, Spring, having, noisy

from sweeps.engine.declare.settings import Settings, number, read_choices
from sweeps.engine.declare.stage import Experiment, Group, Output, Stream, stage
from sweeps.engine.resolve.plan import Plan
from sweeps.engine.resolve.streams import cell_rng

RAISE = "streams draw other numbers: raise STREAM_VERSION of resolve.streams, and pin these"

NAMED = {
    "a stage and numbers": (0, {"stage": "noisy", "stiffness": 4.0, "mass": 2.0, "draw": 1}),
    "a word and null": (7, {"stage": "x", "word": "Å", "nothing": None}),
    "a flag and a tuple": (2**63, {"flag": True, "listed": (1, 2.5)}),
    "nothing": (1, {}),
}
PINNED = {
    "a stage and numbers": [8429893072068033818, 6921488181819985363],
    "a word and null": [2043669674844759975, 16488868804915923567],
    "a flag and a tuple": [15539549332621547411, 3714506883557514991],
    "nothing": [1626417862388722985, 18185730258830339999],
}


@pytest.mark.parametrize("kind", NAMED)
def test_draws_of_a_stream_are_pinned(kind):
    seed, name = NAMED[kind]
    draws = cell_rng(seed, **name).bit_generator.random_raw(2).tolist()
    assert draws == PINNED[kind], RAISE


def test_the_names_of_streams_are_pinned():
    """Streams have named settings, all settings, another stage's name, or optional settings."""
    every = replace(noisy, name="every", outputs=noisy.outputs[:1], group=Group("a"), stream=None)
    stream = Stream((Spring.stiffness, Spring.mass), optional=(Measured.draw,))
    optional = replace(every, name="optional", group=Group("b"), stream=stream)
    experiment = having(SPRINGS, (*SPRINGS.stages, every, optional), ())
    plan = Plan(experiment, read_choices(SPRINGS.declared, {"seed": 3}))
    cell = 20  # the first length and draw of the last of 3 stiffnesses and 2 masses
    values = {"stiffness": 4.0, "mass": 2.0}
    expected = {
        "noisy": {"stage": "noisy", **values, "draw": 0},
        "trace": {"stage": "noisy", **values, "draw": 0},
        "optional": {"stage": "optional", **values},
        "every": {
            "stage": "every",
            "spring.stiffness": 4.0,
            "spring.mass": 2.0,
            "spring.limit": 100.0,
            "measured.length": 2,
            "measured.draw": 0,
            "measured.pause": 0.0,
        },
    }
    for name, pinned in expected.items():
        assert plan.stream(plan.bound[name], cell) == (3, pinned), RAISE


class Left(Settings, key="left"):
    """Settings with names of settings of `Right`, or of `stage` and `seed` of a stream."""

    gain = number([1.0, 2.0], label="gain")
    stage = number([1.0, 2.0], label="stage")
    seed = number([1.0, 2.0], label="seed")


class Right(Settings, key="right"):
    """Settings with a name that `Left` has too."""

    gain = number([1.0, 2.0], label="gain")


def test_settings_of_equal_names_draw_independent_noise():
    """This holds for settings named like each other, like `stage` or like `seed`.

    Each has cells of its own, though only the stream names it.
    """
    settings = (Left.gain, Right.gain, Left.stage, Left.seed)
    drawn = stage(Output("y"), stream=Stream(settings), group=Group("drawn"))(lambda rng: 0.0)
    experiment = Experiment("few", "Few", (Left, Right, replace(drawn, name="drawn")))
    plan = Plan(experiment, read_choices(experiment.declared, {}))
    bound = plan.bound["drawn"]
    streams = [plan.stream(bound, cell) for cell in range(plan.count(bound))]
    assert len(streams) == 16 == len({repr(stream) for stream in streams})
    draws = {cell_rng(seed, **name).random() for seed, name in streams}
    assert len(draws) == 16 == len({key.tobytes() for key in plan.keys(bound)})


DRAWING = {"noisy", "trace", "answers"}  # stages that take `rng`, or results of such a stage


@pytest.mark.parametrize(
    ("version", "all_keys"), [("STREAM_VERSION", True), ("np.__version__", False)]
)
def test_rng_versions_change_keys_of_stages_that_may_draw(monkeypatch, version, all_keys):
    """STREAM_VERSION changes all keys, as any stage may call `cell_rng`; numpy's only `DRAWING`."""

    def keys():
        plan = Plan(SPRINGS, read_choices(SPRINGS.declared, {}))
        return {bound.name: plan.fingerprint(bound) for bound in plan.bound.values()}

    before = keys()
    monkeypatch.setattr(f"sweeps.engine.resolve.plan.{version}", "another")
    after = keys()
    changed = {name for name in before if before[name] != after[name]}
    assert changed == ({*before} if all_keys else DRAWING)
