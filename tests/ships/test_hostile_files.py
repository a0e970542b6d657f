"""Files that could hang a reader, fill its memory or write on its terminal are refused."""

from __future__ import annotations

import os

import numpy as np
import pytest
import trimesh
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from shipyard import barge, refusal, refused_sheet, sentence

from ncti import ships
from ncti.ships import documents

BOX = trimesh.creation.box((100, 14, 20)).apply_translation((0, 0, 10))


# Names


@pytest.mark.parametrize("name", ["a\nb", "\x1b[31mred", "\u202egnp", " ", "x" * 101])
def test_name_that_is_no_label_is_refused_and_shown_escaped(name, tmp_path) -> None:
    path = tmp_path / f"{name}.stl"
    BOX.export(path)
    message = refusal(path)
    assert "cannot label its ship: its name must have 1 to 100 printable characters" in message
    assert ascii(name)[1:-1][:20] in message
    with pytest.raises(ships.ShipError):
        ships.digest(path)


# Kinds of files and their size


@pytest.mark.parametrize("suffix", ["stl", "obj", "yaml"])
def test_only_regular_files_are_read(suffix, tmp_path) -> None:
    path = tmp_path / f"hulk.{suffix}"
    path.symlink_to("/dev/null")
    assert refusal(path) == f"ship file '{path}' is no regular file, but must be one."


@pytest.mark.parametrize(("suffix", "millions"), [("stl", 256), ("glb", 256), ("yaml", 1)])
def test_huge_file_is_refused_unread(suffix, millions, tmp_path) -> None:
    path = tmp_path / f"hulk.{suffix}"
    path.touch()
    os.truncate(path, 10**12)  # takes no room on the disk
    assert f"bytes, but may have at most {millions} million" in refusal(path)


# YAML


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[" * 50_000, "is nested 31 deep, but may be at most 30"),
        ("a: &a [1, {b: *a}]", "'components' is missing"),
        ("name: !!int ''", "is not valid YAML"),
        ("name: !!bool maybe", "is not valid YAML"),
        ("\x1b[31m", "is not valid YAML"),
        ("name: barge\nname: barge", "'name' is given twice (line "),
        ("name: a\nnote: [0, {a: 1, 'a': 2}]", "'a' is given twice (line "),
    ],
)
def test_text_that_costs_too_much_or_says_nothing_is_refused(text, told) -> None:
    if "name" in text:
        rest = {k: v for k, v in barge().items() if k != "name"}
        text = yaml.safe_dump(rest) + text
    assert told in refused_sheet(text)


@pytest.mark.parametrize("text", ["\x1b[31m\nred", "x" * 5000])
def test_wild_names_and_keys_are_escaped_and_cut(text) -> None:
    for change in ({"name": text, "l": -1}, {text: 1}, {"prim": text}, {"prim": [text] * 50}):
        document = barge()
        document["components"][0].update(change)
        assert len(refused_sheet(yaml.safe_dump(document))) < 500
    for name in ({text: {}}, {text: {"parts": [[text] * 5]}}):
        assert len(refused_sheet(yaml.safe_dump(barge() | {"templates": name}))) < 500


@settings(deadline=None, max_examples=80)
@given(st.text(st.sampled_from(" \n-:[]{},&*ab1'\"!<?|>%#~"), max_size=60))
def test_any_text_is_read_as_yaml_does_or_refused(text) -> None:
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
