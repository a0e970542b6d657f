"""Render engines are chosen or refused with clear messages, and draw the same image."""

import textwrap

import numpy as np
import pytest
from running import python

from ncti.render import EngineError, available_engines, choice, opengl
from ncti.render.choice import choose_engine, engines

ASPECTS = (0.0, 12.7, 37.3, 90.0, 141.9, 203.0)


def needs(*names):
    missing = [name for name in names if name not in available_engines()]
    return pytest.mark.skipif(bool(missing), reason=f"no {' and no '.join(missing)} library here")


PRELUDE = """
import os
import numpy as np, trimesh
from ncti.render import EngineError, range_image
hull = trimesh.creation.box((60, 9, 5))
mast = trimesh.creation.cylinder(0.3, 20, sections=12).apply_translation((5, 0, 10))
ship = trimesh.util.concatenate([trimesh.creation.icosphere(3, radius=8), hull, mast])
"""


def run(script):
    """Return the output of a script that runs in a process without OpenGL."""
    return python("-c", PRELUDE + textwrap.dedent(script)).stdout.strip()


@pytest.mark.parametrize(
    ("name", "there", "words"),
    [
        ("osmesa", ("embree",), ["osmesa", "apt install libosmesa6", "or use embree"]),
        ("egl", ("osmesa", "embree"), ["egl", "libegl1", "libgl1-mesa-dri", "osmesa or embree"]),
    ],
)
def test_a_missing_engine_is_named_with_its_package_and_the_others(monkeypatch, name, there, words):
    monkeypatch.setattr(choice, "_is_present", there.__contains__)
    with pytest.raises(EngineError) as refusal:
        choose_engine(name)
    message = str(refusal.value)
    assert all(word in message for word in words) and "\n" not in message


def test_an_unknown_engine_is_a_wrong_value():
    with pytest.raises(ValueError, match="it must be auto, osmesa, egl, embree"):
        choose_engine("povray")
    assert engines() == ("osmesa", "egl", "embree")


def test_a_driver_that_cannot_start_is_an_engine_error(monkeypatch):
    def fail(platform):
        raise AssertionError("no display")

    monkeypatch.setattr(opengl, "bind_platform", lambda platform: None)
    monkeypatch.setattr(opengl, "_open_canvas", fail)
    with pytest.raises(EngineError, match=r"has its libraries but cannot start here.*use embree"):
        opengl.PyrenderEngine("egl")


@needs("osmesa", "egl")
def test_egl_and_osmesa_draw_the_same_image_bit_for_bit(tmp_path):
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
def test_a_forked_process_is_refused_instead_of_hanging():
    message = run("""
        view = {"aspect": 33.0, "depression": 7.0}
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
