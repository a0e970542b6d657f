"""Plans: what depends on what, the cells that follow, and their keys."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from toys import SPRINGS, noisy, period

from sweeps.engine.errors import ConfigurationError, DeclarationError
from sweeps.engine.plan import Plan
from sweeps.engine.schedule import Schedule
from sweeps.engine.settings import Joint, Settings, count, number, read_choices
from sweeps.engine.stage import Experiment, Output, bind, in_memory, plain, stage


def planned(**given):
    """Plan of the springs."""
    given = {key.replace("__", "."): value for key, value in given.items()}
    return Plan(SPRINGS, read_choices(SPRINGS.declared, given))


def keys(plan, name):
    """Keys of all cells of a stage, by place."""
    bound = plan.bound[name]
    return {place: plan.key(bound, place) for place in plan.cells(bound)}


def test_what_a_stage_depends_on_follows_from_names():
    bound = bind(SPRINGS)
    assert list(bound)[:3] == ["rate", "solver", "period"]
    assert bound["rate"].needs == ("spring.mass", "spring.stiffness")
    assert bound["period"].needs == (
        "measured.pause",
        "spring.limit",
        "spring.mass",
        "spring.stiffness",
    )
    assert "seed" in bound["noisy"].needs and "measured.draw" in bound["noisy"].needs
    assert "spring.stiffness" not in bound["answers"].needs  # which it gathers
    assert "spring.reference" in bound["compared"].needs
    assert "spring.stiffness" not in bound["compared"].needs  # taken at the reference


def test_stages_that_nothing_asks_for_are_left_out():
    assert "compared" not in planned().bound
    assert "compared" in planned(spring__reference=4.0).bound
    assert [one.name for one in planned().targets] == [
        "period",
        "energy",
        "noisy",
        "trace",
        "answers",
    ]


def test_the_number_of_cells():
    plan = planned(measured__length=[2, 4, 6], spring__limit=[1, 2, 3, 4])
    counts = {bound.name: plan.count(bound) for bound in plan.bound.values()}
    assert counts["solver"] == 3 * 2 and counts["period"] == 3 * 2 * 4
    assert counts["noisy"] == 3 * 2 * 4 * 3 * 2 and counts["answers"] == 2 * 4 * 3 * 2 * 2
    for bound in plan.bound.values():
        assert len(list(plan.cells(bound))) == plan.count(bound)


def test_equal_values_behind_a_plain_stage_are_one_cell():
    plan = planned()
    found = keys(plan, "period")
    assert found[0, 0] == found[1, 1]  # 1/1 and 2/2
    assert found[1, 0] == found[2, 1]  # 2/1 and 4/2
    assert len(set(found.values())) == 4 and len(set(keys(plan, "noisy").values())) == 24


@settings(deadline=None)
@given(
    masses=st.lists(st.floats(0.1, 1e6), min_size=1, max_size=5, unique=True),
    lengths=st.lists(st.integers(1, 50), min_size=1, max_size=5, unique=True),
    data=st.data(),
)
def test_a_key_depends_on_values_and_not_on_their_places(masses, lengths, data):
    wide = planned(spring__mass=masses, measured__length=lengths)
    mass, length = data.draw(st.sampled_from(masses)), data.draw(st.sampled_from(lengths))
    narrow = planned(spring__mass=mass, measured__length=length)
    for name in ("period", "noisy", "trace", "answers"):
        alone = narrow.bound[name]
        bound = wide.bound[name]
        for place in wide.cells(bound):
            asked = {"spring.mass": mass, "measured.length": length}
            if any(
                wide.value(bound, key, place) != value
                for key, value in asked.items()
                if key in bound.needs
            ):
                continue
            there = tuple(
                place[wide.axes_on(bound).index(number)] for number in narrow.axes_on(alone)
            )
            assert wide.key(bound, place) == narrow.key(alone, there)


CHANGED = {
    "seed": (1, {"noisy", "trace", "answers"}),
    "spring__limit": (50.0, {"period", "noisy", "answers"}),
    "measured__doubled": (True, {"answers"}),
    "spring__reference": (4.0, set()),
    "cluster__workers": (7, set()),
    "cache_limit": (7, set()),
}


@pytest.mark.parametrize("key", CHANGED)
def test_another_value_changes_the_keys_of_what_depends_on_it_alone(key):
    value, stages = CHANGED[key]
    before, after = planned(), planned(**{key: value})
    other = {one.name for one in before.targets if keys(before, one.name) != keys(after, one.name)}
    assert other == stages
    prints = {
        one.name
        for one in before.targets
        if before.fingerprint(one) != after.fingerprint(after.bound[one.name])
    }
    assert prints == stages


def test_a_gathered_value_changes_the_keys_of_what_gathers():
    few, many = keys(planned(), "answers"), keys(planned(spring__stiffness=[1, 2, 4, 8]), "answers")
    assert few.keys() == many.keys() and not set(few.values()) & set(many.values())


def test_two_stages_of_one_function_share_results_and_others_do_not():
    same = replace(period, name="same", group="same")
    another = replace(period, name="other", group="other", also=("pyyaml",))
    experiment = replace(SPRINGS, stages=(*SPRINGS.stages, same, another))
    plan = Plan(experiment, read_choices(SPRINGS.declared, {}))
    assert keys(plan, "same") == keys(plan, "period")
    assert not set(keys(plan, "other").values()) & set(keys(plan, "period").values())


def test_streams_are_named_by_values():
    plan = planned(measured__draw=2)
    bound = plan.bound["noisy"]
    seed, name = plan.stream(bound, (2, 1, 0, 1))
    assert (seed, name) == (0, {"stage": "noisy", "stiffness": 4.0, "mass": 2.0, "draw": 1})
    assert plan.stream(plan.bound["trace"], (2, 1, 0, 1)) == (seed, name)  # the same noise
    unnamed = replace(noisy, stream=None)
    experiment = replace(SPRINGS, stages=(*SPRINGS.stages[:4], unnamed), tables=())
    every = Plan(experiment, plan.choices)
    _, name = every.stream(every.bound["noisy"], (2, 1, 0, 1))
    assert set(name) == {"stage", *every.bound["noisy"].needs} - {"seed"}


def test_where_inputs_are_taken():
    plan = planned(spring__reference=[1.0, 4.0])
    compared = plan.bound["compared"]
    for place in plan.cells(compared):
        ((_, there),) = plan.sources(compared, plan.bound["period"], place)
        reference = plan.value(compared, "spring.reference", place)
        assert plan.value(plan.bound["period"], "spring.stiffness", there) == reference
    gathering = plan.bound["answers"]
    points = list(plan.sources(gathering, plan.bound["noisy"], (1, 0, 1, 1)))
    assert [point for point, _ in points] == [(0,), (1,), (2,)]
    assert [there for _, there in points] == [(0, 1, 0, 1), (1, 1, 0, 1), (2, 1, 0, 1)]


def test_settings_that_run_together_are_one_axis():
    choices = read_choices(SPRINGS.declared, {"spring.mass": [1, 2], "spring.limit": [8, 9]})
    joint = Joint("two", ("spring.mass", "spring.limit"), ((1.0, 9.0), (2.0, 8.0)))
    plan = Plan(SPRINGS, replace(choices, joint=(joint,)))
    period = plan.bound["period"]
    assert plan.count(period) == 3 * 2
    met = {
        tuple(plan.value(period, key, place) for key in joint.keys) for place in plan.cells(period)
    }
    assert met == set(joint.points)
    assert plan.described(period, (2, 1)) == "period stiffness=4 two=2,8"


def test_cells_are_described_without_losing_digits():
    plan = planned(spring__mass=[1.0000001, 1.0000002])
    assert plan.described(plan.bound["period"], (0, 1)) == "period stiffness=1 mass=1.0000002"


def test_a_plain_stage_that_cannot_be_worked_out_is_refused():
    with pytest.raises(ConfigurationError) as refused:
        Plan(NEGATIVE, read_choices(NEGATIVE.declared, {})).key(bind(NEGATIVE)["root_of"], ())
    assert str(refused.value) == "root cannot be computed from size=-1: math domain error"


class Few(Settings, key="few"):
    """Settings of mistakes."""

    size = number(-1.0, label="size")
    part = count([1, 2], label="part")


@plain(uses=(Few,))
def root(size):
    """A root that there may not be."""
    import math

    return math.sqrt(size)


@stage(Output("root_of", label="root"), uses=(Few,), group="few")
def root_of(root):
    """The same on disk."""
    return root


NEGATIVE = Experiment("negative", "Negative", (Few,), (root, root_of))


@stage(Output("x", label="x"), uses=(Few,), group="few")
def unknown(nothing):
    """An argument that is nowhere."""


@stage(Output("x", label="x"), uses=(Few,), group="few", name="one", reads={"other": "another"})
def circular(other):
    """One half of a circle."""


@stage(Output("y", label="y"), uses=(Few,), group="few", name="another", reads={"other": "one"})
def circle(other):
    """The other half."""


@stage(Output("x", label="x"), uses=(Few,), group="few", along=(Few.part,))
def unneeded(size):
    """An axis that it does not need."""


@in_memory(uses=(Few,))
def lost(part):
    """An object for each value of an axis."""


@stage(Output("x", label="x"), uses=(Few,), group="few", gather=(Few.part,))
def gatherer(lost, part):
    """What would gather objects that are not kept."""


MISTAKES = [
    ((unknown,), "stage unknown: argument 'nothing' is neither a setting of Few nor a stage"),
    ((circular, circle), "stages need each other: one -> another -> one"),
    ((unneeded,), "stage unneeded does not need few.part"),
    ((lost, gatherer), "lost is not kept on disk, so it cannot depend on few.part"),
]


@pytest.mark.parametrize(("stages", "sentence"), MISTAKES)
def test_mistakes_of_declarations_are_named(stages, sentence):
    with pytest.raises(DeclarationError) as refused:
        bind(Experiment("few", "Few", (Few,), stages))
    assert sentence in str(refused.value)


# schedules ----------------------------------------------------------------------------------------


def test_cells_of_a_common_parent_stay_together():
    plan = planned()
    schedule = Schedule(plan, dict.fromkeys(SPRINGS.by_name, 1e-6))
    schedule.resolve(lambda bound, keys: {})
    jobs, calls = schedule.batch(1)
    own = [job for job in jobs if job.bound.name in ("period", "energy")]
    parents = [job.affinity for job in own]
    together = [k for k, one in enumerate(parents) if k == 0 or parents[k - 1] != one]
    assert len(together) == len(set(parents)) == 4 and len(own) == 4 + 6
    assert len(calls) == len(jobs)


def test_tasks_are_sized_by_cost_and_get_shorter():
    plan = planned(spring__mass=list(range(1, 101)))
    schedule = Schedule(plan, dict.fromkeys(SPRINGS.by_name, 0.05))
    schedule.resolve(lambda bound, keys: {})
    sizes = [len(schedule.batch(2)[0]) for _ in range(30)]
    assert sizes[0] == 30  # 1.5 s
    assert schedule.ready
    schedule = Schedule(plan, dict.fromkeys(SPRINGS.by_name, 1e-9))
    schedule.resolve(lambda bound, keys: {})
    assert len(schedule.batch(2)[0]) > 300


def test_what_is_asked_together_is_one_call():
    plan = planned(measured__length=[2, 3, 4], measured__rule=["max", "mean"])
    schedule = Schedule(plan)
    schedule.resolve(lambda bound, keys: {})
    calls = dict.fromkeys(("noisy", "answers"), 0)
    for bound, cells in schedule.missing_cells():
        if bound.name in calls:
            calls[bound.name] += 1
            assert cells == {"noisy": 3, "answers": 6}[bound.name]
    assert calls == {"noisy": 3 * 2 * 2, "answers": 2 * 2}


def test_only_what_is_missing_is_asked_for():
    few = planned()
    there = {key: ("pack", 0) for one in few.targets for key in keys(few, one.name).values()}
    plan = planned(measured__rule=["max", "mean", "min"])
    schedule = Schedule(plan)
    schedule.resolve(lambda bound, wanted: {key: there[key] for key in wanted if key in there})
    assert [(bound.name, cells) for bound, cells in schedule.missing_cells()] == [
        ("answers", 2)
    ] * 4
    progress = schedule.progress["answers"]
    assert (progress.total, progress.reused) == (24, 16)


def test_the_order_of_axes_given_to_a_function_counts():
    """A gathered array of one value on an axis has the same cells in either order."""

    class Sea(Settings, key="sea"):
        state = number([1.0], label="state")
        swell = number([2.0, 3.0], label="swell")

    @stage(Output("height", label="height"), uses=(Sea,))
    def height(state, swell):
        return state * swell

    def key(*axes):
        @stage(Output("first", label="first"), uses=(Sea,), group="sea", gather=axes)
        def first(height):
            return height.mean(axis=0)[0]

        sea = Experiment("sea", "Sea", (Sea,), (height, first))
        plan = Plan(sea, read_choices(sea.declared, {}))
        return plan.key(plan.bound["first"], ())

    assert key(Sea.state, Sea.swell) == key(Sea.state, Sea.swell)
    assert key(Sea.state, Sea.swell) != key(Sea.swell, Sea.state)
