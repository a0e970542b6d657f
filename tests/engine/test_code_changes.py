"""Which changes of sources change the hash of a function: what it computes, not how it looks."""

from pathlib import Path

import pytest
import xarray as xr
import yaml
from running import python
from test_code import digest_in, write  # noqa: F401 (a fixture)

CHANGES = yaml.safe_load(Path(__file__).with_name("changes.yaml").read_text())
FILES, DECLARED = CHANGES["files"], CHANGES["declared"]


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


@pytest.mark.parametrize(("name", "old", "new"), CHANGES["same"])
def test_the_same_computation_has_the_same_hash(changed, name, old, new):
    assert not changed(name, old, new)


@pytest.mark.parametrize(("name", "old", "new"), CHANGES["other"])
def test_another_computation_has_another_hash(changed, name, old, new):
    assert changed(name, old, new)


@pytest.mark.filterwarnings("ignore:registration of accessor")
@pytest.mark.parametrize(("late", "book"), CHANGES["whole"])
def test_all_that_a_module_and_its_imports_do_counts(tmp_path, digest_in, late, book):  # noqa: F811
    files = {"fleet/late.py": late, "fleet/rope.py": "BOOK = {}\n", "fleet/book/page.py": ""}
    files["fleet/book/__init__.py"] = book
    folder = write(tmp_path, FILES | files)
    before = digest_in(folder, "fleet.late", "late").digest
    changed = {name: text.replace("2", "3") for name, text in files.items() if "2" in text}
    assert digest_in(write(folder, changed), "fleet.late", "late").digest != before


@pytest.mark.parametrize("how", CHANGES["statements"])
def test_statements_that_change_a_computation_count(tmp_path, digest_in, how):  # noqa: F811
    late = DECLARED.format(CHANGES["statements"][how])
    files = {
        "fleet/late.py": late,
        "fleet/bent.py": CHANGES["bent"],
        "fleet/loops.py": CHANGES["loops"],
    }
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


def test_a_store_follows_its_file_and_computes_only_what_is_another_computation(tmp_path):
    swept: str = CHANGES["swept"]
    file, runs = tmp_path / "wood.py", tmp_path / "runs"

    def run(text: str) -> tuple[int, str, float, str]:
        """Cells computed in a new process, a label and a table of the store, and the messages."""
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
