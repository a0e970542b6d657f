"""OSMesa draws without the names that PyOpenGL 3.1.0 lacks, and keeps no shader cache."""

import os
import subprocess
import sys

import pytest
from platformdirs import user_cache_path
from running import python

from ncti.render.choice import available_engines

needs_osmesa = pytest.mark.skipif(
    "osmesa" not in available_engines(), reason="libOSMesa is not installed"
)


STRIP = """
import os, sys
os.environ["PYOPENGL_PLATFORM"] = "osmesa"
import ctypes
import OpenGL.osmesa, OpenGL.raw.osmesa.mesa, OpenGL.raw.osmesa._types as types, OpenGL._opaque
for module in (OpenGL.osmesa, OpenGL.raw.osmesa.mesa):
    for name in [n for n in vars(module) if "Attribs" in n or "PROFILE" in n or "VERSION" in n
                 or n.endswith("_BITS")]:
        delattr(module, name)
if "__hash__" in vars(OpenGL._opaque._opaque_pointer):
    del OpenGL._opaque._opaque_pointer.__hash__
assert not hasattr(OpenGL.osmesa, "OSMesaCreateContextAttribs")
assert not hasattr(OpenGL.osmesa, "OSMESA_DEPTH_BITS")
import trimesh
from ncti.render import range_image
image = range_image(trimesh.creation.box((10, 4, 2)), aspect=30, depression=10)
assert image.hit.sum() > 100
print("drawn")
"""


@needs_osmesa
def test_pyrender_draws_with_pyopengl_3_1_0_names_only():
    ran = python("-c", STRIP, check=False)
    assert ran.stdout.strip() == "drawn", ran.stderr


DRAW = """
import trimesh
from ncti.render import range_image
range_image(trimesh.creation.box((10, 4, 2)), aspect=30, depression=10, engine="osmesa")
"""


@needs_osmesa
def test_mesa_shader_cache_is_disabled(tmp_path):
    (tmp_path / "ncti-sweep").symlink_to(user_cache_path("ncti-sweep"))  # with its compiled loops
    places = os.environ | {"XDG_CACHE_HOME": str(tmp_path)}
    places.pop("MESA_SHADER_CACHE_DISABLE", None)
    subprocess.run([sys.executable, "-c", DRAW], env=places, check=True, timeout=120)
    assert not (tmp_path / "mesa_shader_cache").exists()
