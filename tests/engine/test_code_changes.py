"""Which changes of sources change the hash of a function: what it computes, not how it looks."""

import subprocess
import sys

import pytest
import xarray as xr
from test_code import ROOT, digest_in, write  # noqa: F401 (a fixture)

MEASURE = """'''Ships of wood.'''
from functools import partial

import numba
import numpy as np

from fleet import rope
from fleet.hull import Hull, keel
from fleet.paint import scaled
from sweeps.engine.settings import Settings, number
from sweeps.engine.stage import Experiment, Output, Table, stage

GAIN = 3
SHIFT = {"bow": 1.0, "stern": -1.0}
PLANKS = {}
ROOM = "ships"
_stage = partial(stage, group=ROOM)


class Wood(Settings, key="wood"):
    '''What it is made of.'''

    load = number(10.0, unit="kg", label="load of the ship", help="with its crew")


def doubled(x):
    '''Return twice the values.'''
    # both sides
    return 2 * x


def registered(function):
    PLANKS[function.__name__] = function
    return function


@registered
def oak(x):
    return x + 1


@numba.njit(cache=True)
def summed(x):
    total = 0.0
    for i in range(len(x)):
        total += x[i]
    return total


@scaled(2)
def wide(x, share=0.5):
    return share * x


def unused(x):
    return x - 7


@_stage(Output("length", ("bin",), "f8", "length of the ship", unit="m"), uses=(Wood,))
def length(x, load=Wood.load.default):
    '''Return the length.'''
    if load > GAIN:
        return doubled(x) + SHIFT["bow"] + keel(x) + summed(x) + wide(x)
    return PLANKS["oak"](x) + Hull(x).deep + rope.knot(x) + np.sqrt(x)


@_stage(Output("other", label="another"))
def other(x):
    return x


def tabulate(found, choices):
    return found.mean()


TABLES = (Table("tables/wood", ("ships",), tabulate),)
EXPERIMENT = Experiment("wood", "Ships of wood", (Wood,), (length, other), TABLES)
"""
FILES = {
    "fleet/__init__.py": "",
    "fleet/measure.py": MEASURE,
    "fleet/hull.py": (
        "from dataclasses import dataclass\n"
        "from fleet.steel import Solid, bend\n"
        "DRAUGHT = 4\n"
        "DEPTH = 5\n"
        "def keel(x):\n    return bend(x) + DRAUGHT\n"
        "@dataclass\nclass Hull(Solid):\n    x: float\n    deep: float = 1.5\n"
        "def rudder(x):\n    return x\n"
    ),
    "fleet/steel.py": (
        "class Solid:\n    weight = 1\n    def push(self):\n        return self.weight\n"
        "def bend(x):\n    return x / 2\n"
    ),
    "fleet/rope.py": "def knot(x):\n    return x\ndef coil(x):\n    return x\n",
    "fleet/paint.py": (
        "def scaled(by):\n    def wrap(function):\n"
        "        return lambda x: by * function(x)\n    return wrap\n"
    ),
}

SAME = [
    ("    # both sides\n", ""),
    ("    # both sides\n", "    # both sides, and the bow\n\n\n"),
    ("Return twice the values.", "Return the values twice."),
    ("    '''Return the length.'''\n", ""),
    ("'''Ships of wood.'''", "'''Ships of oak.'''"),
    ("What it is made of.", "Its wood."),
    ("load of the ship", "load"),
    ("with its crew", "without its crew"),
    ("length of the ship", "length"),
    (', help="with its crew"', ""),
    ("    return 2 * x\n", "    return (\n        2\n        * x\n    )\n"),
    ('SHIFT = {"bow": 1.0, "stern": -1.0}', "SHIFT = {\n    'bow': 1.0,\n    'stern': -1.0,\n}"),
    ("GAIN = 3", "\n\nGAIN = 0x3"),
    ("found.mean()", "found.median()"),
    ("tables/wood", "tables/oak"),
    ("return x - 7", "return x - 8"),
    ('label="another"', 'label="the other"'),
    ("def other(x):\n    return x\n", "def other(x):\n    return 2 * x\n"),
    ('Ships of wood", (', 'Ships", ('),
    ("TABLES = ", "NEW = 1\nTABLES = "),
]
SAME_ELSEWHERE = [
    ("hull", "DEPTH = 5", "DEPTH = 6"),
    ("hull", "def rudder(x):\n    return x", "def rudder(x):\n    return 2 * x"),
    ("hull", "DRAUGHT = 4", "DRAUGHT = 4  # m"),
    ("rope", "def coil(x):\n    return x", "def coil(x):\n    return -x"),
]
OTHER = [
    ("GAIN = 3", "GAIN = 4"),
    ("GAIN = 3", "GAIN = 3.0"),
    ("GAIN = 3", "GAIN = 3\nGAIN += 1"),
    ('"bow": 1.0', '"bow": -1.0'),
    ("load > GAIN", "load >= GAIN"),
    ("return 2 * x", "return 2 / x"),
    ("return 2 * x", "return 2 * -x"),
    ("load=Wood.load.default", "load=5"),
    ("number(10.0", "number(11.0"),
    ('return PLANKS["oak"](x)', 'return PLANKS["oak"](-x)'),
    ("return x + 1", "return x + 2"),
    ("total += x[i]", "total += x[i] * x[i]"),
    ("range(len(x))", "range(1, len(x))"),
    ("njit(cache=True)", "njit(cache=True, fastmath=True)"),
    ("@scaled(2)", "@scaled(3)"),
    ("share=0.5", "share=0.25"),
    ("np.sqrt(x)", "np.cbrt(x)"),
    ("from fleet.hull import Hull, keel", "from fleet.hull import Hull, rudder as keel"),
    ("rope.knot(x)", "rope.coil(x)"),
    ("from fleet import rope", "from fleet import steel as rope"),
    ("TABLES = ", "SHIFT.update(bow=2)\nTABLES = "),
    ("TABLES = ", "doubled = oak\nTABLES = "),
]
OTHER_ELSEWHERE = [
    ("hull", "DRAUGHT = 4", "DRAUGHT = 5"),
    ("hull", "bend(x) + DRAUGHT", "bend(x) - DRAUGHT"),
    ("hull", "deep: float = 1.5", "deep: float = 2.5"),
    ("hull", "@dataclass", "@dataclass(frozen=True)"),
    ("steel", "weight = 1", "weight = 2"),
    ("steel", "return self.weight", "return -self.weight"),
    ("steel", "x / 2", "x / 3"),
    ("rope", "def knot(x):\n    return x", "def knot(x):\n    return -x"),
    ("paint", "by * function(x)", "by + function(x)"),
]


@pytest.fixture
def changed(tmp_path, digest_in):  # noqa: F811
    """Whether a change of a file changes the hash of `length`."""
    before = digest_in(write(tmp_path, FILES)).digest

    def change(name: str, old: str, new: str) -> bool:
        file = f"fleet/{name}.py"
        text = FILES[file].replace(old, new, 1)
        assert text != FILES[file]
        after: str = digest_in(write(tmp_path, {file: text})).digest
        return after != before

    return change


@pytest.mark.parametrize(
    ("name", "old", "new"), [*(("measure", *one) for one in SAME), *SAME_ELSEWHERE]
)
def test_the_same_computation_has_the_same_hash(changed, name, old, new):
    assert not changed(name, old, new)


@pytest.mark.parametrize(
    ("name", "old", "new"), [*(("measure", *one) for one in OTHER), *OTHER_ELSEWHERE]
)
def test_another_computation_has_another_hash(changed, name, old, new):
    assert changed(name, old, new)


# `from fleet.late import late` is enough to see them
SEEN_WHOLE = [
    "from fleet.rope import *\ndef late(x):\n    return knot(x)\n",
    "from fleet.rope import knot\ndef late(x):\n    return globals()['knot'](x)\n",
    "import fleet.rope as rope\ndef late(x):\n    return getattr(rope, 'knot')(x)\n",
    "from fleet import rope\ndef late(x, of=rope):\n    return of.knot(x)\n",
    "from importlib import import_module\nrope = import_module('fleet.rope')\n"
    "def late(x):\n    return rope.knot(x)\n",
    "import fleet\nimport fleet.rope\ndef late(x):\n    return fleet.rope.knot(x)\n",
    "try:\n    from fleet.rope import knot\nexcept ImportError:\n    knot = None\n"
    "def late(x):\n    return knot(x)\n",
    "import fleet.rope\nclass Late:\n    tie = staticmethod(fleet.rope.knot)\n"
    "def late(x):\n    return Late.tie(x)\n",
    "def late(x):\n    from fleet import rope as other\n    return other.knot(x)\n",
]


@pytest.mark.parametrize("text", SEEN_WHOLE)
def test_names_are_followed_or_all_of_a_module_counts(tmp_path, digest_in, text):  # noqa: F811
    folder = write(tmp_path, FILES | {"fleet/late.py": text})
    before = digest_in(folder, "fleet.late", "late").digest
    write(folder, {"fleet/rope.py": FILES["fleet/rope.py"].replace("return x", "return -x", 1)})
    assert digest_in(folder, "fleet.late", "late").digest != before


def test_another_module_may_fill_a_registry(tmp_path, digest_in):  # noqa: F811
    """By a decorator or a call at its top, as soon as it is imported."""
    registry = "ALL = {}\ndef register(f):\n    ALL[f.__name__] = f\n    return f\n"
    late = (
        "import fleet.masts\nfrom fleet.registry import ALL\n"
        "def late(x):\n    return ALL['fore'](x)\n"
    )
    for masts in (
        "from fleet.registry import register\n@register\ndef fore(x):\n    return x\n",
        "from fleet import registry\ndef fore(x):\n    return x\nregistry.register(fore)\n",
        "from fleet import registry\ndef fore(x):\n    return x\nown = registry.register(fore)\n",
        "import fleet.registry as r\ndef fore(x):\n    return x\nown = r.register(fore)\n",
        "from fleet.registry import ALL\ndef fore(x):\n    return x\nALL['fore'] = fore\n",
    ):
        files = {"fleet/registry.py": registry, "fleet/late.py": late, "fleet/masts.py": masts}
        folder = write(tmp_path, FILES | files)
        before = digest_in(folder, "fleet.late", "late").digest
        write(folder, {"fleet/masts.py": masts.replace("return x", "return -x")})
        assert digest_in(folder, "fleet.late", "late").digest != before, masts


BOOKED = "from fleet.rope import BOOK\nimport fleet.book\ndef late(x):\n    return BOOK['a']\n"
ROPE = "BOOK = {}\nclass Knot:\n    def __init__(self, x):\n        BOOK['a'] = x\n"
TIED = "def late(x):\n    return x\n"
SCALED = (
    "from functools import wraps\ndef scaled(by):\n    def wrap(f):\n        {}\n"
    "        def tied(x):\n            return by * f(x)\n        return tied\n    return wrap\n"
)
# A change of 2 in a module reached, which has an effect behind the back of the names used.
BEHIND = {
    "assignment of a call": (BOOKED, "from fleet.rope import BOOK\n_ = BOOK.setdefault('a', 2)\n"),
    "a class that registers its objects": (BOOKED, "from fleet.rope import Knot\nknot = Knot(2)\n"),
    "a function that calls another": (
        BOOKED,
        "from fleet.rope import BOOK\ndef put(x):\n    BOOK['a'] = x\n"
        "def tie(x):\n    put(x)\n    return x\nknot = tie(2)\n",
    ),
    "attributes of another module": (
        BOOKED,
        "from fleet import rope\ndef tie(x):\n    rope.BOOK = x\nknot = tie({'a': 2})\n",
    ),
    "setattr": (
        BOOKED,
        "from fleet import rope\ndef tie(x):\n    setattr(rope, 'BOOK', x)\nknot = tie({'a': 2})\n",
    ),
    "an argument": (
        BOOKED,
        "from fleet.rope import BOOK\ndef put(book, x):\n    book['a'] = x\nknot = put(BOOK, 2)\n",
    ),
    "a default": (
        BOOKED,
        "from fleet.rope import BOOK\ndef put():\n    BOOK['a'] = 2\ndef other(x=put()): ...\n",
    ),
    "a class body": (BOOKED, "from fleet.rope import BOOK\nclass A:\n    BOOK['a'] = 2\n"),
    "a library's registry": (
        "import fleet.book\ndef late(x):\n    return x.fleet.deep\n",
        "import xarray as xr\n@xr.register_dataset_accessor('fleet')\nclass Fleet:\n    deep = 2\n",
    ),
    "a script": (
        "from fleet import rope\ndef late(x):\n    return rope.BOOK\n"
        "if __name__ == '__main__':\n    rope.BOOK = 2\n",
        "",
    ),
    "sys.modules": (
        "import sys\nGAIN = 2\ndef late(x):\n    return getattr(sys.modules[__name__], 'GAIN')\n",
        "",
    ),
    "a wrapper": (
        SCALED.format("@wraps(f)") + TIED.replace("late", "raw") + "late = scaled(2)(raw)\n",
        "",
    ),
    "a closure": (
        SCALED.format("pass") + TIED.replace("late", "raw") + "late = scaled(2)(raw)\n",
        "",
    ),
}


@pytest.mark.filterwarnings("ignore:registration of accessor")
@pytest.mark.parametrize("how", BEHIND)
def test_effects_of_an_import_count(tmp_path, digest_in, how):  # noqa: F811
    late, book = BEHIND[how]
    files = {"fleet/late.py": late, "fleet/book.py": book, "fleet/rope.py": ROPE}
    folder = write(tmp_path, FILES | files)
    before = digest_in(folder, "fleet.late", "late").digest
    changed = {name: text.replace("2", "3") for name, text in files.items() if "2" in text}
    assert digest_in(write(folder, changed), "fleet.late", "late").digest != before


def test_calls_without_effects_do_not_count(tmp_path, digest_in):  # noqa: F811
    late = "import fleet.book\ndef late(x):\n    return x\n"
    book = (
        "from fleet.hull import keel\n"
        "class Plan:\n    def __init__(self, x):\n        self.x = x\n"
        "def halved(x):\n    own = {}\n    own['a'] = x\n    return keel(x)\n"
        "plan, half, size = Plan(2), halved(2), len('2')\n"
    )
    folder = write(tmp_path, FILES | {"fleet/late.py": late, "fleet/book.py": book})
    before = digest_in(folder, "fleet.late", "late").digest
    write(folder, {"fleet/book.py": book.replace("2", "3")})
    assert digest_in(folder, "fleet.late", "late").digest == before


SWEPT = """
import sys
from pathlib import Path

from sweeps.engine.cluster import ClusterChoice
from sweeps.engine.run import Place, sweep
from sweeps.engine.schedule import Watch
from sweeps.engine.settings import Settings, number, read_choices
from sweeps.engine.stage import Experiment, Output, Table, stage

RUNS = Path("runs")


class Wood(Settings, key="wood"):
    '''What it is made of.'''

    load = number([1, 2], unit="kg", label="load", shown=True)


@stage(Output("length", label="length", unit="m"), uses=(Wood,), group="ships")
def length(load):
    RUNS.write_text(RUNS.read_text() + "x")
    return 2 * load


def tabulate(ships, choices):
    return ships.mean()


if __name__ == "__main__":
    TABLES = (Table("tables/wood", ("ships",), tabulate),)
    wood = Experiment("wood", "Wood", (Wood,), (length,), TABLES)
    place = Place(Path("s.zarr"), Path("cache"), ClusterChoice("inline"))
    sweep(wood, read_choices(wood.declared, {}), place, Watch(lambda sentence: None))
"""


def test_a_store_follows_its_file_and_computes_only_what_is_another_computation(tmp_path):
    file, runs = tmp_path / "wood.py", tmp_path / "runs"

    def run(text: str) -> tuple[int, xr.Dataset, float]:
        """Cells computed, and what the store then has; its file comes from a new process."""
        file.write_text(text)
        runs.write_text("")
        here = {"PYTHONPATH": str(ROOT)}
        subprocess.run([sys.executable, file.name], cwd=tmp_path, check=True, env=here)
        ships = xr.open_zarr(tmp_path / "s.zarr", group="ships").load()
        table = xr.open_zarr(tmp_path / "s.zarr", group="tables/wood").load()
        return len(runs.read_text()), ships, float(table.length)

    made, ships, mean = run(SWEPT)
    assert (made, ships.length.long_name, mean) == (2, "length", 3)
    text = SWEPT.replace('label="length"', 'label="length of a ship"')
    text = text.replace("    return 2", "    # twice\n    return 2")
    made, ships, mean = run(text)
    assert (made, ships.length.long_name, mean) == (0, "length of a ship", 3)
    made, ships, mean = run(text.replace("ships.mean()", "ships.max()"))
    assert (made, mean) == (0, 4)
    file.write_text(text.replace("2 * load", "3 * load"))
    failed = subprocess.run(
        [sys.executable, file.name],
        cwd=tmp_path,
        env={"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    assert "made by another code of length" in failed.stderr
