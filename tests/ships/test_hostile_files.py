"""Files that could hang a reader, fill its memory or write on its terminal are refused."""

from __future__ import annotations

import os

import numpy as np
import pytest
import trimesh
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from running import python
from shipyard import barge, refusal, refused_sheet, sentence

from ncti import ships
from ncti.ships import documents, errors

BOX = trimesh.creation.box((100, 14, 20)).apply_translation((0, 0, 10))


# Names


@pytest.mark.parametrize(
    "name", ["a\nb", "\x1b[31mred", "bell\a", "\u202egnp", "tab\t", " ", "x" * 101, "\x9b2J"]
)
def test_invalid_ship_names_are_refused_and_escaped(name, tmp_path) -> None:
    path = tmp_path / f"{name}.stl"
    BOX.export(path)
    message = refusal(path)
    assert "cannot label its ship: its name must have 1 to 100 printable characters" in message
    assert ascii(name)[1:-1][:20] in message
    with pytest.raises(ships.ShipError):
        ships.digest(path)


def test_error_message_is_one_short_printable_line() -> None:
    message = str(ships.ShipError("a\n\x1b" + "b" * 10**6 + "."))
    assert message.isprintable()
    assert message.startswith(r"a\n\x1bbbb")
    assert len(message) == errors.MAX_MESSAGE


# Kinds of files and their size

ALONE = """
import sys
from ncti import ships
for path in sys.argv[1:]:
    try:
        ships.load(path)
    except ships.ShipError as error:
        print(error)
"""


def test_only_regular_files_are_read(tmp_path) -> None:
    """Run in a separate process, because reading a pipe without a writer would block forever."""
    paths = []
    for suffix in ("stl", "obj", "yaml"):
        pipe, endless, silent = (tmp_path / f"{name}.{suffix}" for name in ("pipe", "zero", "null"))
        os.mkfifo(pipe)
        endless.symlink_to("/dev/zero")
        silent.symlink_to("/dev/null")
        paths += [pipe, endless, silent]
    ran = python("-c", ALONE, *paths)
    expected = [f"ship file '{path}' is no regular file, but must be one." for path in paths]
    assert ran.stdout.splitlines() == expected


@pytest.mark.parametrize(("suffix", "millions"), [("stl", 256), ("glb", 256), ("yaml", 1)])
def test_huge_file_is_refused_unread(suffix, millions, tmp_path) -> None:
    path = tmp_path / f"hulk.{suffix}"
    path.touch()
    os.truncate(path, 10**12)  # takes no room on the disk
    assert f"bytes, but may have at most {millions} million" in refusal(path)


# YAML


def bomb(depth: int, *, width: int = 9) -> str:
    """Return YAML of a few hundred bytes that expands to `width` ** `depth` values."""
    lines = ["a0: &a0 [0]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * width)}]" for i in range(1, depth)]
    return "\n".join(lines)


@pytest.mark.parametrize("depth", [9, 40, 200])
def test_yaml_alias_bombs_are_refused(depth) -> None:
    message = refused_sheet(bomb(depth) + f"\nname: *a{depth - 1}\n")
    assert "with those that its aliases stand for, but may be at most 50000" in message


def test_self_referencing_yaml_is_refused() -> None:
    assert "'*a' holds itself, but no value may" in refused_sheet("a: &a [1, {b: *a}]")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[" * 50_000, "is nested 31 deep, but may be at most 30"),
        ("- " * 50_000, "is nested 31 deep"),
        ("- 1\n" * 60_000, "has 50001 values or more"),
        ("name: " + "x" * 20_000, "of 20000 characters, but may be at most 10000"),
        ("name: " + ":".join(["1"] * 300_000), "of 599999 characters"),  # a number to base 60
        ("name: 0x" + "f" * 9_000, "a whole number of 36000 bits"),
        ("name: " + "1" * 9_000, "is not valid YAML"),  # more digits than Python converts
        ("name: !!int ''", "is not valid YAML"),
        ("name: !!bool maybe", "is not valid YAML"),
        ("name: !!timestamp now", "is not valid YAML"),
        ("name: *nowhere", "is not valid YAML"),
        ("a: &a 1\nb: &a 2", "is not valid YAML"),
        ("\x1b[31m", "is not valid YAML"),
        ('"a\\e[31m": 1', "'components' is missing"),
        ("name: barge\nname: barge", "'name' is given twice (line "),
        ("name: a\nnote: [0, {a: 1, 'a': 2}]", "'a' is given twice (line "),
        ("name: a\nnote: [0, {1: 1, 1: 2}]", "1 is given twice (line "),
    ],
)
def test_oversized_or_invalid_yaml_is_refused(text, told) -> None:
    if "name" in text:
        rest = {k: v for k, v in barge().items() if k != "name"}
        text = yaml.safe_dump(rest) + text
    assert told in refused_sheet(text)


@pytest.mark.parametrize("text", ["\x1b[31m\nred", "x" * 5000])
def test_hostile_names_and_keys_are_escaped_and_truncated(text) -> None:
    for change in ({"name": text, "l": -1}, {text: 1}, {"prim": text}, {"prim": [text] * 50}):
        document = barge()
        document["components"][0].update(change)
        assert len(refused_sheet(yaml.safe_dump(document))) < 500
    for name in ({text: {}}, {text: {"parts": [[text] * 5]}}):
        assert len(refused_sheet(yaml.safe_dump(barge() | {"templates": name}))) < 500


@settings(deadline=None, max_examples=80)
@given(st.text(st.sampled_from(" \n-:[]{},&*ab1'\"!<?|>%#~"), max_size=60))
def test_any_text_parses_like_pyyaml_or_is_refused(text) -> None:
    try:
        ours = documents.read("here", text)
    except ships.ShipError as error:
        sentence(error)
    else:
        assert repr(ours) == repr(yaml.load(text, documents.LOADER))


# Text in other encodings


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "cp1252"])
@pytest.mark.parametrize("kind", ["obj", "stl_ascii"])
def test_text_meshes_may_be_written_in_any_encoding(kind, encoding, tmp_path) -> None:
    path = tmp_path / f"hulk.{kind[:3]}"
    text = BOX.export(file_type=kind)
    text = f"# Schöner Rumpf\n{text}" if kind == "obj" else text.replace("solid", "solid Größe", 1)
    path.write_bytes(text.encode(encoding))
    mesh = ships.load(path)
    assert mesh.is_volume
    np.testing.assert_allclose(mesh.bounds, BOX.bounds)
