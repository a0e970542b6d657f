"""Which changes of sources change the hash of a function: what it computes, not how it looks."""

import pytest
import xarray as xr
from running import python
from test_code import digest_in, write  # noqa: F401 (a fixture)

MEASURE = """'''Ships of wood.'''
from functools import partial

import numba
import numpy as np

from fleet import rope
from fleet.hull import Hull, keel
from fleet.paint import scaled
from sweeps.engine.settings import Settings, number
from sweeps.engine.stage import Experiment, Group, Output, Table, stage

GAIN = 3
SHIFT = {"bow": 1.0, "stern": -1.0}
PLANKS = {}
ROOM = "ships"
_stage = partial(stage, group=Group(ROOM))


class Wood(Settings, key="wood"):
    '''What it is made of.'''

    load = number(10.0, unit="kg", label="load of the ship", help="with its crew")
    x = number(1.0, label="place")


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


@_stage(Output("other", label="another"), uses=(Wood,))
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
        "class Solid:\n    '''Of steel.'''\n    weight = 1\n"
        "    def push(self):\n        return self.weight\n"
        "def bend(x):\n    return x / 2\n"
    ),
    "fleet/rope.py": "def knot(x):\n    return x\ndef coil(x):\n    return x\n",
    "fleet/paint.py": (
        "def scaled(by):\n    def wrap(function):\n"
        "        return lambda x: by * function(x)\n    return wrap\n"
    ),
}
# Of `fleet.measure`, a word that is changed, and the word instead.
SAME = [
    ("    # both sides\n", ""),
    ("    # both sides\n", "    # note: import scipy\n"),
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
    ("hull", "DRAUGHT = 4", "DRAUGHT = 4  # m"),
    ("steel", "Of steel.", "Of iron."),
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


# A module without declarations counts as a whole, with what it imports and what that does: a change
# of 2 in any of these files, `late` and `book`, is another computation.
KNOT = "def knot(x): return 2\n"
FILLED = "from fleet.rope import BOOK\n_ = BOOK.setdefault('a', 2)\n"
ACCESSOR = "import xarray\n@xarray.register_dataset_accessor('fleet')\nclass Fleet: deep = 2\n"
SCALED = (
    "from functools import wraps\ndef scaled(by):\n    def wrap(f):\n        {}\n"
    "        def tied(x):\n            return by * f(x)\n        return tied\n    return wrap\n"
    "def raw(x):\n    return x\nlate = scaled(2)(raw)\n"
)
WHOLE = [
    ("from fleet.book import *\ndef late(x): return knot(x)\n", KNOT),
    ("import importlib\nbook = importlib.import_module('fleet.book')\ndef late(x): ...\n", KNOT),
    ("import fleet.book\ndef late(x): return fleet.book.knot(x)\n", KNOT),
    ("try:\n    from fleet.book import knot\nfinally: ...\ndef late(x): return knot(x)\n", KNOT),
    ("def late(x):\n    from fleet import book as other\n    return other.knot(x)\n", KNOT),
    ("import fleet.book\nfrom fleet.rope import BOOK\ndef late(x): return BOOK['a']\n", FILLED),
    ("import fleet.book.page\nfrom fleet.rope import BOOK\ndef late(x): ...\n", FILLED),
    ("import fleet.book\ndef late(x): return x.fleet.deep\n", ACCESSOR),
    ("import fleet.rope as r\ndef late(x): return r.BOOK\nif __name__ == 'a': r.BOOK = 2\n", ""),
    ("import sys\nN = 2\ndef late(x): return getattr(sys.modules[__name__], 'N')\n", ""),
    (SCALED.format("@wraps(f)"), ""),
    (SCALED.format("pass"), ""),
]


@pytest.mark.filterwarnings("ignore:registration of accessor")
@pytest.mark.parametrize(("late", "book"), WHOLE)
def test_all_that_a_module_and_its_imports_do_counts(tmp_path, digest_in, late, book):  # noqa: F811
    files = {"fleet/late.py": late, "fleet/rope.py": "BOOK = {}\n", "fleet/book/page.py": ""}
    files["fleet/book/__init__.py"] = book
    folder = write(tmp_path, FILES | files)
    before = digest_in(folder, "fleet.late", "late").digest
    changed = {name: text.replace("2", "3") for name, text in files.items() if "2" in text}
    assert digest_in(write(folder, changed), "fleet.late", "late").digest != before


# The file of an experiment, of which statements count: a change of 2 is another computation.
DECLARED = """from functools import partial, wraps
import numba
from sweeps.engine.stage import Group, Output, stage
_stage = partial(stage, Output("late"))
{}
"""
BENT = "from sweeps.engine.stage import Group, stage\ndef pulled(x):\n    return 2 * x\n"
LOOPS = (
    "def make(by):\n    return lambda x: by * x\n"
    "def scaled(f, by):\n    return lambda x: by * f(x)\n"
)
STATEMENTS = {
    "a wrapper below the stage": "def scaled(by):\n    def wrap(f):\n        @wraps(f)\n"
    "        def tied(x):\n            return by * f(x)\n        return tied\n    return wrap\n"
    "@_stage()\n@scaled(2)\ndef late(x):\n    return x",
    "a function made elsewhere": "from fleet.loops import make\n"
    "late = _stage(name='late')(make(2))",
    "a decorator made of one elsewhere": "from fleet.loops import scaled\n@_stage()\n"
    "@partial(scaled, by=2)\ndef late(x):\n    return x",
    "an argument that is named label": "def net(label):\n    return label\nNET = net(label=2)\n"
    "@_stage()\ndef late(x):\n    return NET",
    "an object that registers": "class Book(dict):\n    def add(self, f):\n"
    "        self[f.__name__] = f\n        return f\nbook = Book()\n@book.add\n"
    "def tie(x):\n    return 2 * x\n@_stage()\ndef late(x):\n    return book['tie'](x)",
    "a base that registers": "class Rope:\n    book = {}\n    def __init_subclass__(cls):\n"
    "        Rope.book[cls.__name__] = cls\nclass Line(Rope):\n    length = 2\n"
    "@_stage()\ndef late(x):\n    return Rope.book['Line'].length",
    "a metaclass that registers": "class Kind(type):\n    book = {}\n"
    "    def __init__(cls, name, *rest):\n        Kind.book[name] = cls\n"
    "class Line(metaclass=Kind):\n    length = 2\n"
    "@_stage()\ndef late(x):\n    return Kind.book['Line'].length",
    "subclasses": "class Rope:\n    pass\nclass Line(Rope):\n    length = 2\n"
    "@_stage()\ndef late(x):\n    return Rope.__subclasses__()[0].length",
    "what is not for types": "from typing import TYPE_CHECKING\n"
    "if not TYPE_CHECKING:\n    GAIN = 2\n@_stage()\ndef late(x):\n    return GAIN",
    "a decorator with the name of one of Python's": "BOOK = {}\nfrom functools import cache\n"
    "def cache(f):\n    BOOK['a'] = f\n@cache\ndef tie(x):\n    return 2 * x\n@_stage()\n"
    "def late(x):\n    return BOOK['a'](x)",
    "a decorator made of one that registers": "BOOK = []\n@partial(BOOK.append)\n"
    "def tie(x):\n    return 2 * x\n@_stage()\ndef late(x):\n    return BOOK[0](x)",
    "a function for a type": "from functools import singledispatch\n@singledispatch\n"
    "def tie(x):\n    return x\n@tie.register\ndef _(x: int):\n    return 2 * x\n@_stage()\n"
    "def late(x):\n    return tie(x)",
    "an item among names": "BOOK = {}\nTIED, BOOK['a'] = 1, 2\n@_stage()\n"
    "def late(x):\n    return BOOK['a']",
    "another experiment, tried": "try:\n    import fleet.bent as bent\nexcept ImportError:\n"
    "    bent = None\n@_stage()\ndef late(x):\n    return bent.pulled(x)",
    "another experiment, returned": "def other():\n    import fleet.bent as bent\n"
    "    return bent\n@_stage()\ndef late(x):\n    return other().pulled(x)",
    "another experiment, by a star": "from fleet.bent import *\n@_stage()\n"
    "def late(x):\n    return pulled(x)",
    "another experiment, in a mapping": "from fleet import bent\nBENT = {'a': bent}\n@_stage()\n"
    "def late(x):\n    return BENT['a'].pulled(x)",
    "another experiment, by a text": "from operator import attrgetter\nfrom fleet import bent\n"
    "PULLED = attrgetter('pulled')\n@_stage()\ndef late(x):\n    return PULLED(bent)(x)",
}


@pytest.mark.parametrize("how", STATEMENTS)
def test_statements_that_change_a_computation_count(tmp_path, digest_in, how):  # noqa: F811
    late = DECLARED.format(STATEMENTS[how])
    files = {"fleet/late.py": late, "fleet/bent.py": BENT, "fleet/loops.py": LOOPS}
    folder = write(tmp_path, FILES | files)
    before = digest_in(folder, "fleet.late", "late").digest
    changed = {name: text.replace("2", "3") for name, text in files.items()}
    assert digest_in(write(folder, changed), "fleet.late", "late").digest != before


def test_the_order_of_statements_counts(tmp_path, digest_in):  # noqa: F811
    late = DECLARED.format("GAIN = 2\nGAIN = 3\n@_stage()\ndef late(x):\n    return GAIN")
    before = digest_in(write(tmp_path, {"fleet/late.py": late}), "fleet.late", "late").digest
    swapped = late.replace("GAIN = 2\nGAIN = 3", "GAIN = 3\nGAIN = 2")
    after = digest_in(write(tmp_path, {"fleet/late.py": swapped}), "fleet.late", "late").digest
    assert after != before


def test_a_script_of_one_function_may_change_its_values(tmp_path, digest_in):  # noqa: F811
    script = (
        "import sweeps\ndef late(x):\n    return x\n"
        "if __name__ == '__main__':\n    sweeps.sweep(late, {'x': [2]}, store='s.zarr')\n"
    )
    folder = write(tmp_path, FILES | {"fleet/late.py": script})
    before = digest_in(folder, "fleet.late", "late").digest
    write(folder, {"fleet/late.py": script.replace("[2]", "[2, 3]")})
    assert digest_in(folder, "fleet.late", "late").digest == before


SWEPT = """
import sys
from pathlib import Path

from sweeps.engine.cluster import ClusterChoice
from sweeps.engine.run import Place, sweep
from sweeps.engine.schedule import Watch
from sweeps.engine.settings import Settings, number, read_choices
from sweeps.engine.stage import Experiment, Group, Output, Table, stage

RUNS = Path("runs")


class Wood(Settings, key="wood"):
    '''What it is made of.'''

    load = number([1, 2], unit="kg", label="load", shown=True)


@stage(Output("length", label="length", unit="m"), uses=(Wood,), group=Group("ships"))
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

    def run(text: str) -> tuple[int, str, float, str]:
        """Cells computed in a new process, a label and a table of the store, and the messages."""
        file.write_text(text)
        runs.write_text("")
        done = python(file, cwd=tmp_path, check=False)
        ships = xr.open_zarr(tmp_path / "s.zarr", group="ships").load()
        table = xr.open_zarr(tmp_path / "s.zarr", group="tables/wood").load()
        return len(runs.read_text()), ships.length.long_name, float(table.length), done.stderr

    assert run(SWEPT) == (2, "length", 3, "")
    text = SWEPT.replace('label="length"', 'label="length of a ship"')
    text = text.replace("    return 2", "    # twice\n    return 2")
    assert run(text) == (0, "length of a ship", 3, "")
    assert run(text.replace("ships.mean()", "ships.max()")) == (0, "length of a ship", 4, "")
    assert "made by another code of length" in run(text.replace("2 * load", "3 * load"))[3]
