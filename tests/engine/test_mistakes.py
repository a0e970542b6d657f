"""Mistakes are refused and named when settings, stages or experiments are declared."""

import re
from dataclasses import replace

import pytest
from toys import SPRINGS, Few, Measured, Spring

from sweeps.engine.declare.errors import DeclarationError
from sweeps.engine.declare.settings import Settings, count, number
from sweeps.engine.declare.stage import (
    Experiment,
    Group,
    Output,
    Status,
    Stream,
    Table,
    in_memory,
    stage,
)


class Named(Settings, key="named"):
    """A setting named like a stage."""

    period = number(1.0, label="period of another kind")


class Scalar(Settings, key="few", role="scalar"):
    """A setting whose `single` is not a valid kind of coordinate."""

    size = number(1.0, label="size")


class Again(Settings, key="few"):
    """Another group of settings with the key of `Few`."""

    size = count(1, label="size")


class Seed(Settings):
    """A setting with a key of the engine."""

    seed = number(1.0, label="seed")


def few_stage(
    *outputs, function=lambda size: size, name="one", group="few", uses=(Few,), **options
):
    """Return a stage of one function."""
    group = Group(group) if isinstance(group, str) else group
    declare = stage(*(outputs or (Output("x"),)), name=name, group=group, uses=uses, **options)
    return declare(function)


FEW, TOYS = (Few,), (Spring, Measured)
ELSEWHERE, OVER_MASS = (
    Group("b", status=Status("few")),
    Group("few", status=Status("few", over=(Spring.mass,))),
)
GOOD = few_stage()
CIRCLE = (
    few_stage(name="a", reads={"size": "b"}),
    few_stage(Output("y"), name="b", reads={"size": "a"}),
)
HIDDEN = few_stage(function=lambda period: period, name="two", uses=(Named,))
MISTAKES = [
    ("two stages have the name one", FEW, [GOOD, few_stage(Output("y"))]),
    ("the name few/x", FEW, [few_stage(Output("x"), Output("x"))]),
    (
        "the name status/few",
        FEW,
        [few_stage(Output(x, role="state"), group=ELSEWHERE, name=x) for x in "xy"],
    ),
    ("is in the group 'status', which has states", FEW, [few_stage(group="status")]),
    ("two settings have the name few.size", (Few, Again), [GOOD]),
    ("keep=0, but must keep at least 1", FEW, [in_memory(keep=0, uses=FEW)(lambda size: size)]),
    ("two settings have the name seed", (Seed,), []),
    ("is both the setting named.period and a stage", (*TOYS, Named), [*SPRINGS.stages[:3], HIDDEN]),
    ("stage one: setting few.size is not in", (Spring,), [few_stage(group="")]),
    ("one: size is named like the setting few.size", FEW, [few_stage(Output("size"))]),
    ("has a dimension named like the setting", FEW, [few_stage(Output("x", ("size",)))]),
    ("one: x is named like a dimension of its group", FEW, [few_stage(Output("x", ("x", "y")))]),
    ("'size' is neither a setting of the groups it uses nor", FEW, [few_stage(uses=())]),
    ("stages depend on each other in a circle: a -> b -> a", FEW, CIRCLE),
    ("stage a/b has the name 'a/b'", FEW, [few_stage(name="a/b")]),
    ("stage one has the name 'a/b'", FEW, [few_stage(Output("x", ("a/b",)))]),
    ("setting few.size has role='scalar', but must have one of 'dimension'", (Scalar,), []),
    ("stage one in group '../few' has the name '..'", FEW, [few_stage(group="../few")]),
    ("has a stream, but its function", FEW, [few_stage(stream=Stream((Few.size,)))]),
    ("one takes valid, but gathers nothing", FEW, [few_stage(function=lambda size, valid: size)]),
    ("one: x has the dtype 'O', but must have", FEW, [few_stage(Output("x", dtype="O"))]),
    ("one: x has the dtype 'f3', unknown", FEW, [few_stage(Output("x", dtype="f3"))]),
    ("stage one: setting spring.mass is not", FEW, [few_stage(group=OVER_MASS)]),
]


@pytest.mark.parametrize(("words", "settings", "stages"), MISTAKES)
def test_invalid_experiments_are_refused(words, settings, stages):
    with pytest.raises(DeclarationError) as refused:
        Experiment("few", "Few", (*settings, *stages))
    assert words in str(refused.value) and "\n" not in str(refused.value)


HERE = r"^[\w/]*test_mistakes\.py:\d+: "  # the prefix of each message


@pytest.mark.parametrize(
    ("word", "wrong"),
    [
        ("'few' as uses", {"uses": Few}),
        ("'few.size' as gather", {"gather": Few.size}),
        ("'few.size' as along", {"along": Few.size}),
        ("'few.size' as settings of its stream", {"stream": Stream(Few.size)}),
    ],
)
def test_scalars_in_place_of_tuples_are_refused(word, wrong):
    with pytest.raises(DeclarationError, match=f"{HERE}stage one has {word}, but must have a tup"):
        few_stage(**wrong)


def test_output_requires_tuple_dims_and_string_unit():
    with pytest.raises(DeclarationError, match=HERE + "stage one has 'row' as dims of x, but must"):
        few_stage(Output("x", "row"))
    with pytest.raises(DeclarationError, match=HERE + r"stage one: x has unit=\('m', 2\), but"):
        few_stage(Output("x", unit=("m", 2)))


def test_setting_requires_unreserved_name_and_string_unit():
    with pytest.raises(DeclarationError, match=HERE + "setting key must have another name"):

        class _(Settings, key="wrong"):
            key = count(1, label="key")

    with pytest.raises(DeclarationError, match=HERE + r"setting size has unit=\('J/k', 2\), but"):

        class _(Settings, key="wrong"):
            size = count(1, label="size", unit=("J/k", 2))


def test_gathering_draws_of_a_stage_without_stream_is_refused():
    drawn = few_stage(function=lambda size, rng: size, name="drawn")
    mean = few_stage(Output("y"), function=lambda drawn, size: drawn, name="mean")
    with pytest.raises(DeclarationError) as caught:
        Experiment("few", "Few", (Few, Spring, drawn, replace(mean, gather=(Spring.mass,))))
    assert re.match(
        HERE + "stage mean does not need spring.mass; to let drawn, which takes rng, draw ",
        str(caught.value),
    )
    assert str(caught.value).endswith("its stream: stream=Stream((..., spring.mass))")


TABLES = [
    ("tables/b: group fw", [("tables/a", ("few",)), ("tables/b", ("fw", "tables/a"))]),
    ("tables/a: group tables/b", [("tables/a", ("tables/b",)), ("tables/b", ("few",))]),
]


@pytest.mark.parametrize(("words", "tables"), TABLES)
def test_tables_of_unavailable_groups_are_refused(words, tables):
    with pytest.raises(DeclarationError, match=words):
        Experiment("few", "Few", (*FEW, GOOD, *(Table(*group, print) for group in tables)))
