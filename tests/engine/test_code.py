"""The hash of the code behind a function: what changes it, and what must not."""

import importlib
import json
import linecache
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

from sweeps.engine import code, sources
from sweeps.engine.code import code_digest
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.libraries import distributions, versions
from sweeps.engine.reach import graph_of

ROOT = Path(__file__).resolve().parents[2]
ROOTS = frozenset({"fleet", "yard"})
version = metadata.version

# A little project; `fleet.measure.length` is the function whose code is hashed.
PROJECT = {
    "fleet/__init__.py": "",
    "fleet/measure.py": (
        "import math\n"
        "from typing import TYPE_CHECKING\n"
        "import numpy as np\n"
        "from fleet.hull import keel\n"
        "from .deck import planks\n"
        "from fleet import paint\n"
        "if TYPE_CHECKING:\n"
        "    from fleet.typed import Plan\n"
        "else:\n"
        "    import fleet.untyped\n"
        "def length(x):\n"
        "    from skimage import filters\n"
        "    from yard.crane import lift\n"
        "    return np.sqrt(keel(x))\n"
    ),
    "fleet/hull.py": "from . import steel\ndef keel(x):\n    return steel.bend(x)\n",
    "fleet/steel.py": "import fleet.hull\ndef bend(x):\n    return x\n",
    "fleet/deck/__init__.py": "from fleet.deck.wood import planks\n",
    "fleet/deck/wood.py": "from ..rope import knot\ndef planks(): ...\n",
    "fleet/deck/caulk.py": "",
    "fleet/rope.py": "def knot(): ...\n",
    "fleet/paint/__init__.py": "",
    "fleet/paint/colours/red.frag": "void main() {}",
    "fleet/paint/notes.txt": "",
    "fleet/paint/varnish/__init__.py": "",
    "fleet/paint/varnish/gloss.frag": "void main() {}",
    "fleet/typed.py": "",
    "fleet/untyped.py": "",
    "fleet/alone.py": "",
    "yard/__init__.py": "",
    "yard/crane.py": "def lift(): ...\n",
    "yard/gate.py": "",
}
COUNTED = {
    "fleet/measure.py",
    "fleet/hull.py",
    "fleet/steel.py",
    "fleet/deck/__init__.py",
    "fleet/deck/wood.py",
    "fleet/rope.py",
    "fleet/paint/__init__.py",
    "fleet/paint/colours/red.frag",
    "fleet/untyped.py",
    "fleet/__init__.py",  # of `import fleet.untyped`
    "yard/crane.py",
}


def write(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder


@pytest.fixture
def digest_in(monkeypatch):
    """Digest of a function of a folder's project, as a new process would make it."""
    loaded = set(sys.modules)

    def forget():
        for name in set(sys.modules) - loaded:
            if name.split(".")[0] in {"fleet", "yard", "loose"}:
                del sys.modules[name]
        importlib.invalidate_caches()
        for cached in (graph_of, sources._read, versions, distributions, code._data):
            cached.cache_clear()

    def digest(folder, module="fleet.measure", function="length", roots=ROOTS, **how):
        forget()
        with monkeypatch.context() as patch:
            patch.syspath_prepend(folder)
            imported = importlib.import_module(module)
            assert str(folder) in imported.__file__
            given = getattr(imported, function)
            return code_digest(getattr(given, "function", given), roots=roots, **how)

    yield digest
    forget()


@pytest.mark.parametrize("name", PROJECT)
def test_exactly_the_files_behind_a_function_change_its_digest(tmp_path, digest_in, name):
    before = digest_in(write(tmp_path, PROJECT))
    more = {".py": "print()\n", ".frag": "// a comment\n", ".txt": "a note\n"}
    text = PROJECT[name] + more[Path(name).suffix]
    after = digest_in(write(tmp_path, {name: text}))
    # A package above counts, too, as soon as it does something when it is imported.
    acts = name == "yard/__init__.py"
    assert (after.digest != before.digest) == (acts or name in COUNTED)
    assert set(after.modules) - ({"yard"} if acts else set()) == set(before.modules)
    assert after.libraries == before.libraries


def test_modules_and_libraries_are_named(tmp_path, digest_in):
    found = digest_in(write(tmp_path, PROJECT))
    sources = {name for name in COUNTED if name.endswith(".py")}
    names = {name.removesuffix(".py").removesuffix("/__init__") for name in sources}
    assert found.modules == tuple(sorted(name.replace("/", ".") for name in names))
    assert found.libraries == {
        "numpy": version("numpy"),
        "scikit-image": version("scikit-image"),
    }


def test_a_copy_elsewhere_has_the_same_digest(tmp_path, digest_in):
    first = write(tmp_path / "here", PROJECT)
    shutil.copytree(first, tmp_path / "over" / "there")
    assert digest_in(first) == digest_in(tmp_path / "over" / "there")


def test_another_process_has_the_same_digest(tmp_path, digest_in):
    folder = write(tmp_path, PROJECT)
    script = (
        "import fleet.measure, sweeps.engine.code as code;"
        "print(code.code_digest(fleet.measure.length, roots=frozenset(['yard', 'fleet'])).digest)"
    )
    printed = {
        subprocess.run(
            [sys.executable, "-c", script],
            env={"PYTHONPATH": f"{folder}:{ROOT}", "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
        for seed in ("1", "2")
    }
    assert printed == {digest_in(folder).digest}


def test_functions_of_one_module_differ(tmp_path, digest_in):
    folder = write(tmp_path, {"fleet/hull.py": "def a(): ...\ndef b(): ...\n"})
    digests = [digest_in(folder, "fleet.hull", name) for name in "aab"]
    assert digests[0] == digests[1]
    assert digests[0].digest != digests[2].digest


def test_the_version_of_a_library_counts(tmp_path, digest_in, monkeypatch):
    before = digest_in(write(tmp_path, PROJECT))
    monkeypatch.setattr(
        metadata, "version", lambda name: "0.0" if name == "scikit-image" else version(name)
    )
    after = digest_in(tmp_path)
    assert after.libraries == before.libraries | {"scikit-image": "0.0"}
    assert after.digest != before.digest


def test_further_distributions_count(tmp_path, digest_in):
    plain = digest_in(write(tmp_path, PROJECT))
    further = digest_in(tmp_path, also=("networkx",))
    assert further.libraries == plain.libraries | {"networkx": version("networkx")}
    assert further.digest != plain.digest
    with pytest.raises(ConfigurationError, match="'no-such-thing'"):
        digest_in(tmp_path, also=("no-such-thing",))


@pytest.mark.parametrize("statement", ["import fleet.hull", "from fleet import hull"])
def test_what_is_left_out_is_left_out_with_all_behind_it(tmp_path, digest_in, statement):
    measure = {"fleet/measure.py": f"{statement}\nimport fleet.rope\ndef length(): ...\n"}
    folder = write(tmp_path, PROJECT | measure)
    without = frozenset({"fleet.hull"})
    found = digest_in(folder, without=without)
    assert found.modules == ("fleet", "fleet.measure", "fleet.rope")
    write(folder, {"fleet/hull.py": "import scipy\n"})
    assert digest_in(folder, without=without) == found
    assert digest_in(folder).libraries.keys() == {"scipy"}


def test_a_library_and_modules_of_a_star_can_be_left_out(tmp_path, digest_in):
    measure = "from fleet.deck import *\nimport scipy.fft\nimport numpy\ndef length(): ...\n"
    folder = write(tmp_path, PROJECT | {"fleet/measure.py": measure})
    found = digest_in(folder, without=frozenset({"fleet.deck.wood", "scipy"}))
    assert found.modules == ("fleet.deck", "fleet.deck.caulk", "fleet.measure")
    assert found.libraries.keys() == {"numpy"}


def test_the_engine_is_left_out(tmp_path, digest_in):
    text = "from sweeps.engine.errors import ConfigurationError\ndef length(): ...\n"
    found = digest_in(write(tmp_path, {"fleet/measure.py": text}), roots=ROOTS | {"sweeps"})
    assert found.modules == ("fleet.measure",)
    assert found.libraries == {}


@pytest.mark.parametrize(
    ("files", "modules"),
    [
        # a package that gives the name of its module to something else
        (
            {
                "measure": "from fleet.deck import wood",
                "deck/__init__": "from fleet.rope import wood",
                "deck/wood": "",
                "rope": "wood = 1",
            },
            {"fleet.deck", "fleet.deck.wood", "fleet.rope"},
        ),
        # packages that import on demand
        (
            {
                "__init__": "def __getattr__(name): ...",
                "measure": "import fleet\ndef length(): return fleet.deck.wood.planks",
                "deck/__init__": "",
                "deck/wood": "",
                "rope": "",
            },
            {"fleet", "fleet.deck", "fleet.deck.wood"},
        ),
        (
            {
                "measure": "from fleet.deck import planks",
                "deck/__init__": "def __getattr__(name): ...",
                "deck/wood": "",
                "rope": "",
            },
            {"fleet.deck", "fleet.deck.wood"},
        ),
        (
            {
                "measure": "import importlib\nrope = importlib.import_module('.rope', __package__)",
                "rope": "",
            },
            {"fleet.rope"},
        ),
        (
            {"measure": "from fleet.deck import *", "deck/__init__": "", "deck/wood": ""},
            {"fleet.deck", "fleet.deck.wood"},
        ),
        # a package above that does something when it is imported
        (
            {
                "__init__": "import os\nimport fleet.rope\nos.environ['PAINT'] = 'red'",
                "measure": "",
                "rope": "",
            },
            {"fleet", "fleet.rope"},
        ),
        (
            {
                "__init__": "'''Ships.'''\nimport fleet.rope\nNAMES = ('keel',)",
                "measure": "",
                "rope": "",
            },
            set(),
        ),
    ],
)
def test_ways_of_importing(tmp_path, digest_in, files, modules):
    files = {f"fleet/{name}.py": f"{text}\n" for name, text in files.items()}
    if "def length" not in files["fleet/measure.py"]:
        files["fleet/measure.py"] += "def length(): ...\n"
    found = digest_in(write(tmp_path, files))
    assert set(found.modules) == modules | {"fleet.measure"}


def test_nothing_is_imported_to_find_it(tmp_path, digest_in):
    measure = "def length():\n    import yard.bomb\n"
    bomb = {"yard/bomb.py": "raise RuntimeError", "yard/__init__.py": "raise RuntimeError"}
    found = digest_in(write(tmp_path, {"fleet/measure.py": measure} | bomb))
    assert found.modules == ("fleet.measure", "yard", "yard.bomb")


def test_a_module_that_no_distribution_has_counts_by_its_source(tmp_path, digest_in):
    measure = "import loose\ndef length():\n    return loose.x\n"
    files = {"fleet/measure.py": measure, "loose.py": "x = 0\n"}
    before = digest_in(write(tmp_path, files))
    assert before.modules == ("fleet.measure", "loose")
    assert digest_in(write(tmp_path, {"loose.py": "x = 1\n"})).digest != before.digest


def test_a_root_may_be_a_part_of_a_package(tmp_path, digest_in):
    files = {"fleet/measure.py": "import scipy.fft\nimport scipy.io\ndef length(): ...\n"}
    found = digest_in(write(tmp_path, files), roots=ROOTS | {"scipy.io"})
    assert "scipy.io" in found.modules
    assert "scipy.fft" not in found.modules
    assert found.libraries["scipy"] == version("scipy")


def test_a_library_that_is_missing_is_named(tmp_path, digest_in):
    files = {"fleet/measure.py": "def length():\n    import no_such_library\n"}
    assert digest_in(write(tmp_path, files)).libraries == {"no_such_library": "not installed"}


def test_a_single_compiled_module_has_its_version(tmp_path, digest_in):
    files = {"fleet/measure.py": "def length():\n    import manifold3d\n"}
    found = digest_in(write(tmp_path, files))
    assert found.libraries == {"manifold3d": version("manifold3d")}


@pytest.mark.parametrize("top", ["OpenGL", "numpy", "scipy", "skimage", "sklearn", "yaml", "zarr"])
def test_distributions_are_those_that_python_finds(top):
    expected = {name: version(name) for name in metadata.packages_distributions()[top]}
    assert dict(versions(top)) == expected


def test_decorators_are_seen_through(tmp_path, digest_in):
    wrapped = (
        "import functools\n@functools.lru_cache\ndef length(): ...\nplain = length.__wrapped__\n"
    )
    folder = write(tmp_path, {"fleet/measure.py": wrapped})
    assert digest_in(folder) == digest_in(folder, function="plain")


def test_a_script_counts_like_a_module(tmp_path):
    script = (
        "import json, sys\nimport loose\nfrom sweeps.engine.code import code_digest\n"
        "def length(): ...\n"
        "found = code_digest(length, roots=frozenset())\n"
        "print(json.dumps([found.digest, found.modules]))\n"
    )
    write(tmp_path, {"script.py": script, "loose.py": ""})

    def run(*arguments: str):
        done = subprocess.run(
            [sys.executable, *arguments],
            env={"PYTHONPATH": str(ROOT)},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )
        return json.loads(done.stdout)

    assert run("script.py")[1] == ["__main__", "loose"]
    assert run("-m", "script")[1] == ["loose", "script"]
    before = run("script.py")
    write(tmp_path, {"script.py": script.replace("def length(): ...", "def length(): return 1")})
    assert run("script.py")[0] != before[0]


def typed_in(text: str, monkeypatch):
    """A function as a notebook has it: no file, its lines kept by `linecache`."""
    space = {"__name__": "__main__"}
    lines = text.splitlines(keepends=True)
    monkeypatch.setitem(linecache.cache, "<cell>", (len(text), None, lines, "<cell>"))
    exec(compile(text, "<cell>", "exec"), space)
    return space["length"]


def test_a_function_of_a_session_counts_by_its_own_lines(monkeypatch):
    def digest(body: str):
        text = f"import numpy as np\ndef length(x):\n    return [{body} for y in x]\n"
        return code_digest(typed_in(text, monkeypatch), roots=frozenset())

    assert digest("np.sqrt(y)").libraries == {"numpy": version("numpy")}
    assert digest("np.sqrt(y)") == digest("np.sqrt(y)")
    assert digest("np.sqrt(y)").digest != digest("np.cbrt(y)").digest


def test_a_function_of_a_session_may_not_use_what_is_not_hashed(monkeypatch):
    text = "GAIN = 3\ndef length(x):\n    return [GAIN * y for y in x]\n"
    with pytest.raises(ConfigurationError, match="length uses GAIN of a session"):
        code_digest(typed_in(text, monkeypatch), roots=frozenset())


def test_a_function_without_source_is_refused():
    space = {"__name__": "nowhere"}
    exec("def length(): ...", space)
    with pytest.raises(ConfigurationError, match="length of nowhere has no source"):
        code_digest(space["length"], roots=frozenset())
    with pytest.raises(TypeError, match="not a Python function"):
        code_digest(len, roots=frozenset())


def test_segmentation_of_this_project():
    from ncti.features.segmentation import segment

    found = code_digest(segment, roots=frozenset({"ncti", "sweeps"}))
    assert "ncti.features.segmentation" in found.modules
    assert not any(name.startswith("ncti.irar") for name in found.modules)
    assert found.libraries["scikit-image"] == version("scikit-image")


def test_a_name_of_a_package_depends_on_all_that_the_package_imports(tmp_path, digest_in):
    files = {"fleet/measure.py": "from ncti.ladar import sample_frames\ndef length(): ...\n"}
    found = digest_in(write(tmp_path, files), roots=ROOTS | {"ncti"})
    rooms = {"ncti.ladar", "ncti.ladar.frames", "ncti.ladar.budget", "ncti.checks"}
    assert rooms <= set(found.modules)
    assert not any(name.startswith("ncti.classify") for name in found.modules)
