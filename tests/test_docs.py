"""On pages of the documentation code runs, commands are valid, and names exist."""

import importlib.util
import re
import shlex
import sys
from collections import Counter
from importlib import import_module
from pathlib import Path

import buckets
import matplotlib as mpl
import numpy as np
import pytest
import trimesh
import yaml
from commands import FAST, prepared, ran
from documentation import DOCS, PAGES, ROOT, blocks, commands, fences, prose_of, text_of
from once import sharing_ships

import ncti.ships
from sweeps.engine.command.line import Command
from sweeps.engine.declare.settings import Run
from sweeps.engine.declare.storable import decode_attrs, encode_attrs
from sweeps.engine.objects import Objects
from sweeps.engine.resolve.overrides import read_jobs
from sweeps.engine.store.provenance import check_extends, provenance
from sweeps.experiment import EXPERIMENT

sys.path.insert(1, str(ROOT / "docs" / "_extensions"))

COMPOSED = yaml.safe_load((ROOT / "tests/sweeps/experiments.yaml").read_text())["composed"]
ELSEWHERE = {"one_function.md"}  # tests/engine/test_function_results.py runs its code
WITH_CODE = [
    page
    for page in (ROOT / "README.md", *DOCS)
    if fences(page, "python", "sh") and page.name not in ELSEWHERE
]


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Return the cache of finished results that the pages share."""
    return sharing_ships(tmp_path_factory.mktemp("cache"))


def of_file(code):
    """Return the name of the file to save a block as, if its first line says so."""
    found = re.match(r"# (\w+\.py)\n", code)
    return found and found[1]


SMALLER = {
    r"(classifier\.generated)=\d+": r"\1=1",  # a ship that is generated takes seconds to build
    r'(split\("aspect-\w+", seed=0)[^)]*': r"\1, train=80, test=40",
    r"RandomForestClassifier\(": "RandomForestClassifier(10, ",
    r"(benchmark\.split)=\S+": r"\1=aspect-gap",
    r"(benchmark\.training_rows)=\d+": r"\1=80",
}


def shortened(block):
    """Return a block with commands that take less time."""
    for long, short in SMALLER.items():
        block = re.sub(long, short, block)
    return block


def imported(name):
    spec = importlib.util.spec_from_file_location(Path(name).stem, name)
    module = importlib.util.module_from_spec(spec)
    sys.modules[module.__name__] = module
    spec.loader.exec_module(module)
    return module


def of_user(path):
    """Write a ship to a file as downloads are, in millimetres with y up."""
    mesh = ncti.ships.load("duncan")
    x, y, z = 1000 * mesh.vertices.T
    trimesh.Trimesh(np.column_stack([x, z, -y]), mesh.faces, process=False).export(path)


def stored(arguments):
    """Return arguments with a store, if they name none, as the default one is in use."""
    own = any(one.startswith("store=") for one in arguments)
    return arguments if own else [*arguments, "store=other.zarr"]


@pytest.fixture
def bucket(smoke_store, monkeypatch):
    """Put the store into a bucket, `s3://bucket/sweep.zarr`."""
    if buckets.ABSENT:
        pytest.skip(buckets.ABSENT)
    with buckets.serving() as environment:
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        there, here = Objects(f"s3://{buckets.BUCKET}/sweep.zarr"), Objects(smoke_store)
        there.map(lambda name: there.put(name, here.get(name)), here.sizes())
        yield


@pytest.mark.usefixtures("quick_layout")
@pytest.mark.parametrize("page", WITH_CODE, ids=lambda page: page.stem)
def test_code_on_the_page_runs(page, smoke_store, results, tmp_path, monkeypatch, capsys, request):
    """The test executes code, runs scripts of the page and composes other commands, in order."""
    mpl.use("Agg")
    (tmp_path / "sweep.zarr").symlink_to(smoke_store, target_is_directory=True)
    if "hull.stl" in text_of(page):
        of_user(tmp_path / "hull.stl")
    if "s3://" in "".join(code for _, code in fences(page, "python")):
        request.getfixturevalue("bucket")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    namespace = {}
    for language, block in fences(page, "python", "py", "sh"):
        block = shortened(block)
        if language != "sh" and (name := of_file(block)):
            Path(name).write_text(block, encoding="utf-8")
        elif language != "sh":
            exec(compile(block, page.name, "exec"), namespace)
        for line in commands(block, "ncti-sweep") if language == "sh" else ():
            if not re.search(r" (--|-sc)", line):  # options that print something and end
                name = re.search(r"\+experiment=(\w+)", line)
                smaller = COMPOSED.get(name[1], ()) if name else ()
                assert prepared(*stored(shlex.split(line)[1:]), *smaller), line
        for line in commands(block, "python") if language == "sh" else ():
            name, *arguments = shlex.split(line)[1:]
            if name == "-m":
                assert arguments[0] in ("benchmarks", "docs._tables"), line
                continue
            if name.startswith("docs/gallery/"):
                continue
            module = imported(name)
            status = ran(*stored(arguments), *FAST, f"cache={results}", modules=(module,))
            assert status == 0, capsys.readouterr().err
    from matplotlib import pyplot as plt

    plt.close("all")


def words_of(page, name):
    """Return the words of all command lines of a page that call a command."""
    return [shlex.split(line) for block in blocks(page, "sh") for line in commands(block, name)]


def test_commands_of_first_pages_run_in_order(tmp_path, monkeypatch):
    """A command extends the store of an earlier one with the same `store=`, or without any."""
    monkeypatch.chdir(tmp_path)
    pages = (ROOT / "README.md", ROOT / "docs/quick_start.md", ROOT / "docs/sweeping.md")
    lines = [words for page in pages for words in words_of(page, "ncti-sweep")]
    lines = [words[1:] for words in lines if not any(word.startswith("--") for word in words)]

    def store(words):
        return next((one for one in words if one.startswith("store=")), "store=sweep.zarr")

    several = Counter(map(store, lines))
    assert sum(count > 1 for count in several.values()) >= 2
    command, stores = Command(EXPERIMENT), {}
    for words in (one for one in lines if several[store(one)] > 1):
        jobs = read_jobs(EXPERIMENT, [one for one in words if one != "-m"], several="-m" in words)
        ((plan, place),) = command.prepare(jobs)
        if place.store in stores:
            check_extends(EXPERIMENT, str(place.store), stores[place.store], plan)
        if not plan.choices.value(Run.dry_run):
            stores[place.store] = decode_attrs(encode_attrs(provenance(plan)))


def test_the_gallery_has_every_script_and_the_command_that_runs_it():
    page = ROOT / "docs" / "gallery.md"
    lines = words_of(page, "python")
    used = {line[2] for line in lines if line[2].endswith(".zarr")}
    assert used <= {*re.findall(r"store=(\S+)", text_of(page))}
    scripts, pictures = ([line[place] for line in lines] for place in (1, -1))
    assert {ROOT / script for script in scripts} == {*(page.parent / "gallery").glob("*.py")}
    assert re.findall(r"!\[[^\]]+\]\((.*?)\)", text_of(page)) == pictures
    assert {path.name for path in page.parent.glob("*.png")} == {*pictures}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_names_on_the_page_exist(page):
    for name in set(re.findall(r"`((?:ncti|studies|sweeps)(?:\.\w+)+)`", prose_of(page))):
        found, *rest = import_module(name.partition(".")[0]), *name.split(".")[1:]
        for part in rest:
            if not hasattr(found, part):
                import_module(f"{found.__name__}.{part}")
            found = getattr(found, part)
    for path in re.findall(r"`((?:benchmarks|docs|studies|tests)/[\w/]+\.py)`", prose_of(page)):
        assert (ROOT / path).is_file(), path


GROUPS = {one.key.partition(".")[0] for one in EXPERIMENT.declared if "." in one.key}
KEYS = {one.key for setting in EXPERIMENT.declared for one in (setting, *setting.kind.entries)}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_settings_on_the_page_exist(page):
    own = set(re.findall(r'key="([a-z_.]+)"', text_of(page)))  # declared by code on the page
    for key in set(re.findall(r"`([a-z_]+(?:\.[a-z_]+)+)(?:=[^`\s]*)?`", prose_of(page))):
        if key.endswith(".py"):
            continue
        if key.partition(".")[0] in GROUPS and key.rpartition(".")[0] not in own:
            assert key in KEYS, key


def test_equations_become_mathml_or_are_refused():
    pytest.importorskip("latex2mathml")
    pytest.importorskip("sphinx")
    from mathml import mathml

    assert "<mfrac>" in mathml(r"\frac{1}{2}", display="inline")
    assert mathml(r"\cos a \cos b", display="block").count("mspace") == 3
    for wrong in (r"\begin{aligned} a &= b \end{aligned}", r"\unheard{x}"):
        with pytest.raises(ValueError, match="equation"):
            mathml(wrong, display="block")
