"""Mistakes of declarations, named when an experiment is assembled."""

from dataclasses import replace

import numpy as np
import pytest
from toys import SPRINGS, Measured, Spring, noisy, period, solver

from sweeps.engine.errors import DeclarationError
from sweeps.engine.settings import Settings, count, number
from sweeps.engine.stage import Experiment, Output, Status, Table, plain, stage


class Few(Settings, key="few"):
    """Settings of mistakes."""

    size = count([1, 2], label="size")


class Named(Settings, key="named"):
    """A setting named like a stage."""

    period = number(1.0, label="period of another kind")


class Slashed(Settings, key="slashed"):
    """A setting whose dimension is a path."""

    size = number(1.0, label="size", dimension="a/b")


class Again(Settings, key="few"):
    """Another group of the same key."""

    size = count(1, label="size")


def one(*outputs, size=None, **how):
    """A stage of one function."""
    return stage(*(outputs or (Output("x", label="x"),)), name=how.pop("name", "one"), **how)(
        lambda size: size
    )


@stage(Output("x", label="x"), uses=(Few,), group="few", stream=(Few.size,))
def undrawn(size):
    """A stream that nothing draws from."""
    return size


@stage(Output("x", label="x"), uses=(Few,), group="few", noise="other")
def unheard(size):
    """The noise of another stage, and no noise."""
    return size


@stage(Output("x", label="x"), uses=(Few,), group="few")
def unmasked(size, there):
    """A mask of nothing."""
    return size


@stage(Output("y", label="y"), uses=(Named,), group="few")
def twofold(period):
    """An argument of two meanings."""
    return period


@plain(uses=(Few,))
def absent(size):
    """A setting that the experiment lacks."""
    return size


GOOD = one(uses=(Few,), group="few")
SLASH = "but a name must not be empty, have '/', or begin with '.' or '__'"
MISTAKES = {
    "stages of one name": (
        ((Few,), (GOOD, one(Output("y"), uses=(Few,), group="few"))),
        "two stages have the name one",
    ),
    "outputs of one name": (
        ((Few,), (one(Output("x"), Output("x"), uses=(Few,), group="few"),)),
        "two outputs of a group of the store have the name few/x",
    ),
    "outputs of one stage that is not stored": (
        ((Few,), (one(Output("x"), Output("x"), uses=(Few,)),)),
        "two outputs of stage one have the name x",
    ),
    "outputs of two stages in a group": (
        ((Few,), (GOOD, one(uses=(Few,), group="few", name="two"))),
        "two outputs of a group of the store have the name few/x",
    ),
    "an output put into the other's group": (
        ((Few,), (GOOD, one(Output("x", group="few"), uses=(Few,), group="b", name="two"))),
        "two outputs of a group of the store have the name few/x",
    ),
    "settings of one key": (((Few, Again), (GOOD,)), "two settings have the name few.size"),
    "a setting of the engine's key": (
        ((type("Seed", (Settings,), {"seed": number(1.0, label="seed")}),), ()),
        "two settings have the name seed",
    ),
    "a setting named like a stage": (
        ((Spring, Measured, Named), (*SPRINGS.stages[:3], twofold)),
        "stage twofold: argument 'period' is both the setting named.period and a stage; rename one "
        "of them, or say which by reads",
    ),
    "a setting of a class that is not there": (
        ((Spring,), (absent,)),
        "stage absent: setting few.size is not in the experiment",
    ),
    "an axis of a class that is not there": (
        ((Spring, Measured), (replace(period, along=(Few.size,)), solver, SPRINGS.stages[0])),
        "stage period: setting few.size is not in the experiment",
    ),
    "a slash in a stage": (
        ((Few,), (one(uses=(Few,), group="few", name="a/b"),)),
        f"stage a/b has the name 'a/b', {SLASH}",
    ),
    "a slash in an output": (
        ((Few,), (one(Output("a/b"), uses=(Few,), group="few"),)),
        f"stage one has the name 'a/b', {SLASH}",
    ),
    "a slash in a dimension": (
        ((Few,), (one(Output("x", ("a/b",)), uses=(Few,), group="few"),)),
        f"stage one has the name 'a/b', {SLASH}",
    ),
    "a slash in a setting": (
        ((Slashed,), ()),
        f"setting slashed.size has the name 'a/b', {SLASH}",
    ),
    "a group above": (
        ((Few,), (one(uses=(Few,), group="../few"),)),
        f"stage one in group '../few' has the name '..', {SLASH}",
    ),
    "a stream without rng": (
        ((Few,), (undrawn,)),
        "stage undrawn has a stream, but its function does not take rng",
    ),
    "noise without rng": (
        ((Few,), (unheard,)),
        "stage unheard has a stream, but its function does not take rng",
    ),
    "optional settings without a stream": (
        ((Spring, Measured), (replace(noisy, stream=None, optional=(Measured.draw,)),)),
        "stage noisy has optional settings that its stream does not have",
    ),
    "a mask of nothing": (((Few,), (unmasked,)), "stage unmasked takes there, but gathers nothing"),
    "objects": (
        ((Few,), (one(Output("x", dtype="O"), uses=(Few,), group="few"),)),
        "stage one: x has the dtype 'O', but must have one of numbers of at most 8 bytes, truth "
        "values or texts of fixed width",
    ),
    "no dtype": (
        ((Few,), (one(Output("x", dtype="f3"), uses=(Few,), group="few"),)),
        "stage one: x has the dtype 'f3', unknown to numpy",
    ),
    "an origin that is nowhere": (
        ((Few,), (one(Output("x", ("bin",), origin={"bin": "at"}), uses=(Few,), group="few"),)),
        "stage one: output of an origin at is not in the experiment",
    ),
    "a status that is nowhere": (
        ((Few,), (one(uses=(Few,), group="few", status="state:few"),)),
        "stage one: status state:few is not in the experiment",
    ),
}


@pytest.mark.parametrize("kind", MISTAKES)
def test_mistakes_are_named_when_an_experiment_is_assembled(kind):
    (settings, stages), sentence = MISTAKES[kind]
    with pytest.raises(DeclarationError) as refused:
        Experiment("few", "Few", settings, stages)
    assert str(refused.value) == sentence


TABLES = {
    "table tables/b: group fw is not in the experiment": (
        Table("tables/a", ("few",), print),
        Table("tables/b", ("fw", "tables/a"), print),
    ),
    "table tables/a: group tables/b is not in the experiment": (
        Table("tables/a", ("tables/b",), print),
        Table("tables/b", ("few",), print),
    ),
}


@pytest.mark.parametrize("sentence", TABLES)
def test_a_table_of_a_group_that_nobody_makes_is_named(sentence):
    with pytest.raises(DeclarationError) as refused:
        Experiment("few", "Few", (Few,), (GOOD,), tables=TABLES[sentence])
    assert str(refused.value) == sentence


def test_a_status_over_a_setting_that_is_not_there_is_named():
    with pytest.raises(DeclarationError) as refused:
        Experiment("few", "Few", (), (), statuses=(Status("s:x", (Few.size,), "x"),))
    assert str(refused.value) == "status s:x: setting few.size is not in the experiment"


def test_alternatives_that_are_named_are_not_mistakes():
    """Which of two is meant may be said; a stage may refine a setting of its own name."""
    said = replace(twofold, reads={"period": Named.period})
    Experiment("few", "Few", (Spring, Measured, Named), (*SPRINGS.stages[:3], said))
    refined = plain(uses=(Few,), name="size")(lambda size: 2 * size)
    Experiment("few", "Few", (Few,), (refined, replace(GOOD, uses=())))
    assert np.dtype(GOOD.outputs[0].dtype) == "f4"
