"""The hash of the code behind a function changes with it and its libraries, with nothing else."""

import importlib
import json
import re
import shutil
import sys
from pathlib import Path

import pytest
import xarray as xr
import yaml
from running import python

from sweeps.engine.declare.stage import Stage
from sweeps.engine.resolve import code, modules
from sweeps.engine.resolve.code import Code, module_and_name
from sweeps.engine.resolve.modules import (
    CACHE_FILE,
    dist_versions,
    distributions,
    module_spec,
)

ROOTS = frozenset({"fleet", "yard"})

GIVEN = yaml.safe_load(Path(__file__).with_name("project.yaml").read_text())
PROJECT, COUNTED, IMPORTS = GIVEN["files"], GIVEN["counted"], GIVEN["imports"]


def write(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder


@pytest.fixture
def digest_in(monkeypatch):
    """Return a function that computes a digest of a folder's project as a new process would."""
    # Bytecode of a file that is rewritten within a second, at the same size, counts as current.
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    loaded = set(sys.modules)

    def forget():
        for name in set(sys.modules) - loaded:
            if name.split(".")[0] in {"fleet", "yard", "loose"}:
                del sys.modules[name]
        importlib.invalidate_caches()
        for cached in (
            module_spec,
            modules.package_files,
            modules.read_module,
            dist_versions,
            distributions,
        ):
            cached.cache_clear()

    def digest(folder, module="fleet.measure", function="length", roots=ROOTS):
        forget()
        with monkeypatch.context() as patch:
            patch.syspath_prepend(folder)
            imported = importlib.import_module(module)
            assert str(folder) in imported.__file__
            value = getattr(imported, function)
            declared = [stage_ for stage_ in vars(imported).values() if isinstance(stage_, Stage)]
            homes = {module_and_name(stage_.function)[0] for stage_ in declared} | {module}
            return Code(roots, frozenset(homes)).digest(getattr(value, "function", value))

    yield digest
    forget()


@pytest.mark.parametrize("name", PROJECT)
def test_only_files_a_function_depends_on_change_its_digest(tmp_path, digest_in, name):
    before = digest_in(write(tmp_path, PROJECT))
    more = {".py": "x = print()\n", ".frag": "// a comment\n", ".txt": "a note\n"}
    text = PROJECT[name] + more[Path(name).suffix]
    after = digest_in(write(tmp_path, {name: text}))
    assert (after.digest != before.digest) == (name in COUNTED)
    assert after.parts.keys() == before.parts.keys()
    assert after.libraries == before.libraries


def test_a_copy_elsewhere_has_the_same_digest(tmp_path, digest_in):
    folder = write(tmp_path / "here", PROJECT)
    copy = shutil.copytree(folder, tmp_path / "over" / "there")
    assert digest_in(folder).digest == digest_in(copy).digest


def test_parse_cache_is_used_only_if_private(tmp_path, digest_in, monkeypatch):
    home, folder = tmp_path / "home", write(tmp_path / "here", PROJECT)
    monkeypatch.setattr(modules, "CACHE_FOLDER", home)
    monkeypatch.setattr(modules, "_new", {})  # without what other tests have parsed

    def digest():
        modules._cached_modules.cache_clear()
        found = digest_in(folder).digest
        modules.save_parsed_modules()
        return found

    expected, file = digest(), home / CACHE_FILE
    content = file.read_text()
    assert not home.stat().st_mode & 0o077
    assert digest() == expected and file.read_text() == content
    for damaged in ("[]", content[:-9]):
        file.write_text(damaged)
        assert digest() == expected
        assert json.loads(file.read_text()) == json.loads(content)
    # The file is keyed by source and rule, and entries found under a key are used unchecked.
    file.write_text(re.sub(r'\["[0-9a-f]{32}",', f'["{32 * "0"}",', content))
    assert digest() != expected
    home.chmod(0o720)
    assert digest() == expected
    assert json.loads(file.read_text()) == json.loads(content)


def test_digest_depends_on_library_versions(tmp_path, digest_in, monkeypatch):
    before = digest_in(write(tmp_path, PROJECT))
    monkeypatch.setattr(
        code,
        "dist_versions",
        lambda top: dist_versions(top) | ({"scikit-image": "0"} if "sk" in top else {}),
    )
    after = digest_in(tmp_path)
    assert after.libraries == {**before.libraries, "scikit-image": "0"}
    assert after.digest != before.digest


def test_digest_excludes_the_engine(tmp_path, digest_in):
    text = (
        "from sweeps.engine.declare.errors import ConfigurationError as E\ndef length(): raise E\n"
    )
    digest = digest_in(write(tmp_path, {"fleet/measure.py": text}), roots=ROOTS | {"sweeps"})
    assert [*digest.parts] == ["code of fleet.measure.length"]
    assert digest.libraries == {}


@pytest.mark.parametrize("how", IMPORTS)
def test_digest_follows_every_form_of_import(tmp_path, digest_in, how):
    sources, modules = IMPORTS[how]["files"], set(IMPORTS[how]["modules"])
    empty = {"__init__": "", "deck/__init__": "", "deck/wood": "", "rope": "wood = 1", "tools": ""}
    measure = {"measure": "from fleet import tools\ndef length(): return tools"}
    files = {f"fleet/{name}.py": f"{text}\n" for name, text in (empty | measure | sources).items()}
    digest = digest_in(write(tmp_path, files))
    names = {f"code of {name}" for name in modules | {"fleet", "fleet.tools"}}
    assert set(digest.parts) == names | {"code of fleet.measure.length"}


def test_scripts_are_digested_like_modules(tmp_path):
    script = (
        "import json, sys\nimport loose\nfrom sweeps.engine.resolve.code import Code\n"
        "def length(): return loose\n"
        "found = Code(frozenset()).digest(length)\n"
        "print(json.dumps([found.digest, [*found.parts]]))\n"
    )
    write(tmp_path, {"script.py": script, "loose.py": ""})

    def run(*arguments: str):
        return json.loads(python(*arguments, cwd=tmp_path).stdout)

    before = run("script.py")
    assert before[1] == ["code of loose", "code of __main__.length"]
    assert run("-c", script) == before
    write(tmp_path, {"script.py": script.replace("return loose", "return 1, loose")})
    assert run("script.py")[0] != before[0]


# changes of sources -------------------------------------------------------------------------------


CHANGES = yaml.safe_load(Path(__file__).with_name("changes.yaml").read_text())
FILES, DECLARED = CHANGES["files"], CHANGES["declared"]


@pytest.fixture
def digest_of(tmp_path, digest_in):
    """Return a function that computes a digest of the project with some files replaced."""

    def digest(files, module="fleet.late", function="late"):
        found: str = digest_in(write(tmp_path, FILES | files), module, function).digest
        return found

    return digest


def other(files):
    """Return the files with each 2 replaced by 3."""
    return {name: text.replace("2", "3") for name, text in files.items()}


@pytest.mark.parametrize(
    ("counts", "name", "old", "new"),
    [
        (counts, *change)
        for counts in (False, True)
        for change in CHANGES["other" if counts else "same"]
    ],
)
def test_digest_changes_only_if_the_computation_changes(digest_of, counts, name, old, new):
    file = f"fleet/{name}.py"
    text = FILES[file].replace(old, new, 1)
    assert text != FILES[file]
    digests = [digest_of(files, "fleet.measure", "length") for files in ({}, {file: text})]
    assert (digests[0] != digests[1]) == counts


@pytest.mark.filterwarnings("ignore:registration of accessor")
@pytest.mark.parametrize(("late", "book"), CHANGES["whole"])
def test_dynamically_used_modules_are_digested_whole(digest_of, late, book):
    files = {"fleet/late.py": late, "fleet/rope.py": "BOOK = {}\n", "fleet/book/page.py": ""}
    files["fleet/book/__init__.py"] = book
    assert digest_of(files) != digest_of(other(files))


@pytest.mark.parametrize("how", CHANGES["statements"])
def test_statements_affecting_the_result_change_the_digest(digest_of, how):
    late = DECLARED.format(CHANGES["statements"][how])
    files = {"late": late, "bent": CHANGES["bent"], "loops": CHANGES["loops"]}
    files = {f"fleet/{name}.py": text for name, text in files.items()}
    assert digest_of(files) != digest_of(other(files))


def test_statement_order_changes_the_digest(digest_of):
    late = DECLARED.format("GAIN = 2\nGAIN = 3\n@_stage()\ndef late(x):\n    return GAIN")
    swapped = late.replace("GAIN = 2\nGAIN = 3", "GAIN = 3\nGAIN = 2")
    assert digest_of({"fleet/late.py": late}) != digest_of({"fleet/late.py": swapped})


def test_changing_swept_values_in_a_script_keeps_the_digest(digest_of):
    script = (
        "import sweeps\ndef late(x):\n    return x\n"
        "if __name__ == '__main__':\n    sweeps.sweep(late, {'x': [2]}, store='s.zarr')\n"
    )
    more = script.replace("[2]", "[2, 3]")
    assert digest_of({"fleet/late.py": script}) == digest_of({"fleet/late.py": more})


def test_label_and_table_edits_update_the_store_without_recomputing(tmp_path):
    swept: str = CHANGES["swept"]
    file, runs = tmp_path / "wood.py", tmp_path / "runs"

    def run(text: str) -> tuple[int, str, float, str]:
        """Run a script; return cells computed, a label and a table of the store, and messages."""
        file.write_text(text)
        runs.write_text("")
        done = python(file, cwd=tmp_path, check=False)
        ships = xr.open_zarr(tmp_path / "s.zarr", group="ships").load()
        table = xr.open_zarr(tmp_path / "s.zarr", group="tables/wood").load()
        return len(runs.read_text()), ships.length.long_name, float(table.length), done.stderr

    assert run(swept) == (2, "length", 3, "")
    text = swept.replace('label="length"', 'label="length of a ship"')
    text = text.replace("    return 2", "    # twice\n    return 2")
    assert run(text) == (0, "length of a ship", 3, "")
    assert run(text.replace("ships.mean()", "ships.max()")) == (0, "length of a ship", 4, "")
    assert "made by different code of length" in run(text.replace("2 * load", "3 * load"))[3]
