"""Render engines are chosen or refused with clear messages, and draw the same image."""

import json
import subprocess
import sys
import textwrap

import numpy as np
import pytest
import trimesh

from ncti.render import EngineError, available_engines, choice, range_image
from ncti.render.choice import choose_engine, engines

ASPECTS = (0.0, 12.7, 37.3, 90.0, 141.9, 203.0)


def needs(*names):
    missing = [name for name in names if name not in available_engines()]
    return pytest.mark.skipif(bool(missing), reason=f"no {' and no '.join(missing)} library here")


PRELUDE = """
import json, os, signal, sys
import numpy as np, trimesh
from ncti.render import *
from ncti.render.choice import choose_engine, engines, start_engine
ball = trimesh.creation.icosphere(3, radius=8)
hull = trimesh.creation.box((60, 9, 5))
mast = trimesh.creation.cylinder(0.3, 20, sections=12).apply_translation((5, 0, 10))
ship = trimesh.util.concatenate([ball, hull, mast])
view = {"aspect": 33.0, "depression": 7.0}
"""
# All scripts share the imports of the server; each runs in a forked process of its own.
SERVER = (
    PRELUDE
    + """
for line in sys.stdin:
    script, output, seconds = json.loads(line)
    child = os.fork()
    if child == 0:
        signal.alarm(seconds)
        for stream, suffix in ((1, ""), (2, ".errors")):
            os.dup2(os.open(output + suffix, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), stream)
        exec(script)
        break
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""
)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Return a function that runs a script in a process without OpenGL, and returns its output."""
    output = tmp_path_factory.mktemp("scripts") / "output"
    with subprocess.Popen(
        [sys.executable, "-c", SERVER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as server:

        def ran(script, *, seconds=120):
            request = textwrap.dedent(script), str(output), seconds
            server.stdin.write(json.dumps(request) + "\n")
            server.stdin.flush()
            status = server.stdout.readline()
            assert status == "0\n", output.with_suffix(".errors").read_text()
            return output.read_text().strip()

        yield ran
        server.stdin.close()


@pytest.fixture
def present(monkeypatch):
    """Return a function that sets the engines that seem installed, in an unbound process."""

    def these(*names):
        monkeypatch.setattr(choice, "_is_present", names.__contains__)
        monkeypatch.setattr(choice, "bound_platform", lambda: None)

    return these


@pytest.mark.parametrize(
    ("name", "there", "words"),
    [
        ("osmesa", ("egl", "embree"), ["osmesa", "apt install libosmesa6", "egl or embree"]),
        ("egl", ("osmesa", "embree"), ["egl", "libegl1", "libgl1-mesa-dri", "osmesa or embree"]),
        ("osmesa", ("embree",), ["libosmesa6", "or use embree"]),
    ],
)
def test_missing_engine_error_names_package_and_alternatives(present, name, there, words):
    present(*there)
    box = trimesh.creation.box((4, 2, 1))
    with pytest.raises(EngineError) as refusal:
        range_image(box, aspect=0, depression=0, engine=name)
    message = str(refusal.value)
    assert all(word in message for word in words)
    assert "\n" not in message


def test_unknown_engine_raises_value_error():
    with pytest.raises(ValueError, match="it must be auto, osmesa, egl, embree"):
        choose_engine("povray")
    assert engines() == ("osmesa", "egl", "embree")


@needs("egl")
def test_driver_start_failure_raises_engine_error(run):
    message = run("""
        import ncti.render.opengl as opengl
        def fail(platform): raise AssertionError("no display")
        opengl._open_canvas = fail
        try:
            range_image(ship, engine="egl", **view)
        except EngineError as error:
            print(error)
    """)
    assert message.startswith("render engine egl has its libraries but cannot start here")
    assert "use embree" in message


@needs("osmesa", "egl")
def test_egl_and_osmesa_draw_the_same_image_bit_for_bit(run, tmp_path):
    for engine in ("osmesa", "egl"):
        run(f"""
            images = [
                range_image(ship, aspect=a, depression=5.5, slant_range=r, engine="{engine}")
                for a in {ASPECTS} for r in (None, 4e3)
            ]
            np.savez(r"{tmp_path / engine}.npz",
                     *[i.down_range for i in images], *[i.gradient for i in images])
        """)
    osmesa, egl = (np.load(tmp_path / f"{engine}.npz") for engine in ("osmesa", "egl"))
    assert len(osmesa.files) == 4 * len(ASPECTS)
    for name in osmesa.files:
        assert osmesa[name].tobytes() == egl[name].tobytes()


@needs("osmesa")
def test_a_forked_process_is_refused_instead_of_hanging(run):
    message = run("""
        import os
        range_image(ship, **view)
        if os.fork() == 0:
            try:
                range_image(ship, **view)
            except EngineError as error:
                range_image(ship, engine="embree", **view)
                print(error, flush=True)
            os._exit(0)
        os.wait()
        range_image(ship, **view)
    """)
    assert "forked" in message
    assert "use embree" in message
