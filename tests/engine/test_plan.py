"""Plans give each cell a key that depends only on values, code and declarations that it uses."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from toys import SPRINGS, having, period

from sweeps.engine.declare.settings import Settings, number, read_choices
from sweeps.engine.declare.stage import Experiment, Group, Output, stage
from sweeps.engine.resolve.keys import fold, hash_texts, unique_keys
from sweeps.engine.resolve.plan import Plan


def planned(**values):
    """Return the plan of the springs with these settings."""
    values = {key.replace("__", "."): value for key, value in values.items()}
    return Plan(SPRINGS, read_choices(SPRINGS.declared, values))


def keys(plan, name):
    """Return the keys of all cells of a stage, in order."""
    bound = plan.bound[name]
    return [plan.key(bound, cell) for cell in plan.cells(bound)]


@settings(deadline=None)
@given(
    masses=st.lists(st.floats(0.1, 1e6), min_size=1, max_size=5, unique=True),
    lengths=st.lists(st.integers(1, 50), min_size=1, max_size=5, unique=True),
    data=st.data(),
)
def test_keys_depend_on_values_not_positions(masses, lengths, data):
    wide = planned(spring__mass=masses, measured__length=lengths)
    mass, length = data.draw(st.sampled_from(masses)), data.draw(st.sampled_from(lengths))
    narrow = planned(spring__mass=mass, measured__length=length)
    values = {"spring.mass": mass, "measured.length": length}
    for name in ("period", "noisy", "trace", "answers"):
        bound = wide.bound[name]
        there = [
            wide.key(bound, cell)
            for cell in wide.cells(bound).tolist()
            if all(
                wide.value(bound, key, cell) == values[key] for key in values.keys() & bound.needs
            )
        ]
        assert there == keys(narrow, name)


CHANGED = {
    "seed": (1, {"noisy", "trace", "answers"}),
    "spring__limit": (50.0, {"period", "noisy", "answers"}),
    "measured__doubled": (True, {"answers"}),
    "spring__reference": (4.0, set()),
    "cluster__workers": (7, set()),
    "cache_limit": (7, set()),
}


@pytest.mark.parametrize("key", CHANGED)
def test_changed_value_changes_only_keys_of_dependent_stages(key):
    value, stages = CHANGED[key]
    before, after = planned(), planned(**{key: value})
    names = {bound.name for bound in before.targets}
    assert {name for name in names if keys(before, name) != keys(after, name)} == stages


@pytest.mark.parametrize("change", [{"dtype": "f2"}, {"name": "swing"}])
def test_output_name_and_dtype_change_keys(change):
    """Keys depend on name and dtype of an output, which are not part of the function's code."""
    (output,) = period.outputs
    replaced = replace(period, outputs=(replace(output, **change),))
    stages = tuple(replaced if declared is period else declared for declared in SPRINGS.stages)
    after = Plan(having(SPRINGS, stages), read_choices(SPRINGS.declared, {}))
    assert not set(keys(after, "period")) & set(keys(planned(), "period"))


def summed(**inputs):
    """Return the sum of any keywords: the code is the same for any name of an input."""
    return sum(inputs.values())


def test_input_keyword_changes_keys():
    def key(name):
        options = {"reads": {name: "period"}, "name": "told", "group": Group("told")}
        declared = stage(Output("told", label="told"), **options)(summed)
        springs = having(SPRINGS, (*SPRINGS.stages[:3], declared), ())
        plan = Plan(springs, read_choices(SPRINGS.declared, {}))
        return plan.key(plan.bound["told"], 0)

    assert key("ours") == key("ours") != key("theirs")


def test_order_of_gathered_axes_changes_keys():
    """If an axis has one value, either order gathers the same cells, but keys must differ."""

    class Sea(Settings, key="sea"):
        state = number([1.0], label="state")
        swell = number([2.0, 3.0], label="swell")

    @stage(Output("height", label="height"), uses=(Sea,))
    def height(state, swell):
        return state * swell

    def key(*axes):
        @stage(Output("first", label="first"), uses=(Sea,), group=Group("sea"), gather=axes)
        def first(height):
            return height.mean(axis=0)[0]

        sea = Experiment("sea", "Sea", (Sea, height, first))
        plan = Plan(sea, read_choices(sea.declared, {}))
        return plan.key(plan.bound["first"], 0)

    assert key(Sea.state, Sea.swell) == key(Sea.state, Sea.swell)
    assert key(Sea.state, Sea.swell) != key(Sea.swell, Sea.state)


# keys of many cells -------------------------------------------------------------------------------


HALVES = st.integers(0, 2).map(lambda n: n * (2**63 - 1))


@given(st.lists(st.tuples(HALVES, HALVES), max_size=12))
def test_unique_keys_match_a_dict(keys):
    """This also holds for keys of which only one half is equal."""
    first, number = unique_keys(np.array(keys, np.uint64).reshape(-1, 2))
    expected = {key: place for place, key in reversed([*enumerate(keys)])}
    assert first.tolist() == sorted(expected.values())
    assert [first[n] for n in number] == [expected[key] for key in keys]


def test_folded_values_and_their_order_change_keys():
    """No two of 200,000 keys have an equal half; equal halves by chance occur once in 10^9 runs."""
    words = hash_texts(map(str, range(447)))
    pairs = np.repeat(words, len(words), axis=0)
    keys = pairs.copy()
    fold(keys, np.tile(words, (len(words), 1)))
    assert all(len(np.unique(half)) == len(keys) for half in keys.T)


def test_folding_flips_about_half_of_the_bits():
    """Flipping any of 64 bits that are mixed in changes 45 to 55% of the bits of 1,000 keys."""
    keys = hash_texts(map(str, range(1000)))
    for bit in range(64):
        first, second = keys.copy(), keys.copy()
        fold(first, np.zeros(2, np.uint64))
        fold(second, np.full(2, 1 << bit, np.uint64))
        changed = np.bitwise_count(first ^ second).sum() / (128 * len(keys))
        assert abs(changed - 0.5) < 0.05
