"""The hash of the code behind a function changes with it and its libraries, with nothing else."""

import importlib
import json
import re
import shutil
import sys
from pathlib import Path

import pytest
import yaml
from running import ROOT, python

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
    loaded = set(sys.modules)
    # Bytecode of a file that is rewritten within a second, at the same size, counts as current.
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

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
def test_exactly_the_files_behind_a_function_change_its_digest(tmp_path, digest_in, name):
    before = digest_in(write(tmp_path, PROJECT))
    more = {".py": "x = print()\n", ".frag": "// a comment\n", ".txt": "a note\n"}
    text = PROJECT[name] + more[Path(name).suffix]
    after = digest_in(write(tmp_path, {name: text}))
    assert (after.digest != before.digest) == (name in COUNTED)
    assert after.parts.keys() == before.parts.keys()
    assert after.libraries == before.libraries


def test_a_copy_elsewhere_has_the_same_digest_in_other_processes(tmp_path, digest_in):
    folder = write(tmp_path / "here", PROJECT)
    copy = shutil.copytree(folder, tmp_path / "over" / "there")
    script = (
        "import fleet.measure, sweeps.engine.resolve.code as code;"
        "print(code.Code(frozenset(['yard', 'fleet'])).digest(fleet.measure.length).digest)"
    )
    printed = {
        python("-c", script, PYTHONPATH=f"{path}:{ROOT}", PYTHONHASHSEED=seed).stdout.strip()
        for seed, path in (("1", folder), ("2", copy))
    }
    assert printed == {digest_in(folder).digest}


def test_modules_parsed_before_are_used_if_only_this_user_wrote_them(tmp_path):
    folder = write(tmp_path / "here", PROJECT)
    script = (
        "import fleet.measure; from sweeps.engine.resolve import code, modules;"
        "print(code.Code(frozenset(['yard', 'fleet'])).digest(fleet.measure.length).digest);"
        "modules.save_parsed_modules()"
    )

    def digest() -> str:
        variables = {"PYTHONPATH": f"{folder}:{ROOT}", "XDG_CACHE_HOME": str(tmp_path / "home")}
        return python("-c", script, **variables).stdout.strip()

    expected = digest()
    [file] = (tmp_path / "home").rglob(CACHE_FILE)
    content = file.read_text()
    assert not file.parent.stat().st_mode & 0o077
    assert digest() == expected and file.read_text() == content
    for damaged in ("", "{", "[]", "7", content[:-9]):
        file.write_text(damaged)
        assert digest() == expected
        assert json.loads(file.read_text()) == json.loads(content)
    # The file is keyed by source and rule, and entries found under a key are used unchecked.
    file.write_text(re.sub(r'\["[0-9a-f]{32}",', f'["{32 * "0"}",', content))
    assert digest() != expected
    file.parent.chmod(0o720)
    assert digest() == expected
    assert json.loads(file.read_text()) == json.loads(content)


def test_the_version_of_a_library_counts(tmp_path, digest_in, monkeypatch):
    before = digest_in(write(tmp_path, PROJECT))
    monkeypatch.setattr(
        code,
        "dist_versions",
        lambda top: dist_versions(top) | ({"scikit-image": "0"} if "sk" in top else {}),
    )
    after = digest_in(tmp_path)
    assert after.libraries == {**before.libraries, "scikit-image": "0"}
    assert after.digest != before.digest


def test_the_engine_is_left_out(tmp_path, digest_in):
    text = (
        "from sweeps.engine.declare.errors import ConfigurationError as E\ndef length(): raise E\n"
    )
    digest = digest_in(write(tmp_path, {"fleet/measure.py": text}), roots=ROOTS | {"sweeps"})
    assert [*digest.parts] == ["code of fleet.measure.length"]
    assert digest.libraries == {}


@pytest.mark.parametrize("how", IMPORTS)
def test_ways_of_importing(tmp_path, digest_in, how):
    sources, modules = IMPORTS[how]["files"], set(IMPORTS[how]["modules"])
    empty = {"__init__": "", "deck/__init__": "", "deck/wood": "", "rope": "wood = 1", "tools": ""}
    measure = {"measure": "from fleet import tools\ndef length(): return tools"}
    files = {f"fleet/{name}.py": f"{text}\n" for name, text in (empty | measure | sources).items()}
    digest = digest_in(write(tmp_path, files))
    names = {f"code of {name}" for name in modules | {"fleet", "fleet.tools"}}
    assert set(digest.parts) == names | {"code of fleet.measure.length"}


def test_a_module_that_no_distribution_has_counts_by_its_source(tmp_path, digest_in):
    measure = "import loose\ndef length():\n    return loose.x\n"
    files = {"fleet/measure.py": measure, "loose.py": "x = 0\n"}
    before = digest_in(write(tmp_path, files))
    assert set(before.parts) == {"code of fleet.measure.length", "code of loose"}
    assert digest_in(write(tmp_path, {"loose.py": "x = 1\n"})).digest != before.digest


def test_a_library_counts_once_it_is_there(tmp_path, digest_in):
    files = {"fleet/measure.py": "def length():\n    import loose\n    import no_such_library\n"}
    before = digest_in(write(tmp_path, files))
    assert set(before.parts) == {"code of fleet.measure.length"}
    assert digest_in(write(tmp_path, {"loose.py": ""})).parts.keys() - before.parts.keys()


def test_a_script_counts_like_a_module(tmp_path):
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
    assert run("-m", "script") == run("-c", script) == before
    write(tmp_path, {"script.py": script.replace("return loose", "return 1, loose")})
    assert run("script.py")[0] != before[0]
