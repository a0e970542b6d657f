"""Source changes alter the hash of a function if they change its computation, not its layout."""

from pathlib import Path

import pytest
import xarray as xr
import yaml
from running import python
from test_code import digest_in, write  # noqa: F401 (a fixture)

CHANGES = yaml.safe_load(Path(__file__).with_name("changes.yaml").read_text())
FILES, DECLARED = CHANGES["files"], CHANGES["declared"]


@pytest.fixture
def digest_of(tmp_path, digest_in):  # noqa: F811
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
def test_another_computation_alone_has_another_hash(digest_of, counts, name, old, new):
    file = f"fleet/{name}.py"
    text = FILES[file].replace(old, new, 1)
    assert text != FILES[file]
    digests = [digest_of(files, "fleet.measure", "length") for files in ({}, {file: text})]
    assert (digests[0] != digests[1]) == counts


@pytest.mark.filterwarnings("ignore:registration of accessor")
@pytest.mark.parametrize(("late", "book"), CHANGES["whole"])
def test_all_that_a_module_and_its_imports_do_counts(digest_of, late, book):
    files = {"fleet/late.py": late, "fleet/rope.py": "BOOK = {}\n", "fleet/book/page.py": ""}
    files["fleet/book/__init__.py"] = book
    assert digest_of(files) != digest_of(other(files))


@pytest.mark.parametrize("how", CHANGES["statements"])
def test_statements_that_change_a_computation_count(digest_of, how):
    late = DECLARED.format(CHANGES["statements"][how])
    files = {"late": late, "bent": CHANGES["bent"], "loops": CHANGES["loops"]}
    files = {f"fleet/{name}.py": text for name, text in files.items()}
    assert digest_of(files) != digest_of(other(files))


def test_the_order_of_statements_counts(digest_of):
    late = DECLARED.format("GAIN = 2\nGAIN = 3\n@_stage()\ndef late(x):\n    return GAIN")
    swapped = late.replace("GAIN = 2\nGAIN = 3", "GAIN = 3\nGAIN = 2")
    assert digest_of({"fleet/late.py": late}) != digest_of({"fleet/late.py": swapped})


def test_a_script_of_one_function_may_change_its_values(digest_of):
    script = (
        "import sweeps\ndef late(x):\n    return x\n"
        "if __name__ == '__main__':\n    sweeps.sweep(late, {'x': [2]}, store='s.zarr')\n"
    )
    more = script.replace("[2]", "[2, 3]")
    assert digest_of({"fleet/late.py": script}) == digest_of({"fleet/late.py": more})


def test_a_store_follows_its_file_and_computes_only_what_is_another_computation(tmp_path):
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
