"""Compiled loops are cached for later processes, but not loaded if untrusted or outdated."""

import pytest
from running import python

from ncti import machine_code


@pytest.fixture
def compiled(tmp_path, monkeypatch, umask):
    """Return a function that compiles into an empty folder of machine code, with umask 0."""
    umask(0)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "made" / "compiled"))
    for cached in (machine_code.folder, machine_code.folder_of):
        cached.cache_clear()

    def compiled():
        from ncti.compiled import compiled

        def halved(x):
            return x / 2

        return compiled(halved)

    yield compiled
    for cached in (machine_code.folder, machine_code.folder_of):
        cached.cache_clear()


def test_machine_code_in_world_writable_folder_is_not_loaded(compiled, tmp_path):
    assert compiled()(5.0) == 2.5
    files = list(tmp_path.rglob("*.nbc"))
    files[0].parent.chmod(0o777)
    machine_code.folder_of.cache_clear()
    again = compiled()
    assert (
        again(5.0) == 2.5 and not again.stats.cache_hits and list(tmp_path.rglob("*.nbc")) == files
    )


def test_changed_constant_of_another_module_recompiles(tmp_path):
    """Numba itself would compare only the time of the function's own file."""
    (tmp_path / "loops.py").write_text(
        "from depth import DEPTH\nfrom ncti.compiled import compiled\n"
        "@compiled\ndef deep(x):\n    return x * DEPTH\n"
        "print(deep(1), sum(deep.stats.cache_hits.values()))\n"
    )

    def run(depth):
        (tmp_path / "depth.py").write_text(f"DEPTH = {depth}\n")
        folder = str(tmp_path / "kept")
        return python("-B", "loops.py", cwd=tmp_path, NUMBA_CACHE_DIR=folder).stdout.split()

    assert [run(2), run(2), run(30)] == [["2", "0"], ["2", "1"], ["30", "0"]]
