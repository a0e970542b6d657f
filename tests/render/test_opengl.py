"""The mended OSMesa binding: on PyOpenGL as installed, and without what 3.1.0 is without."""

import ctypes
import subprocess
import sys
import types

import pytest

from ncti.render.choice import available_engines
from ncti.render.opengl import mend_osmesa

needs_osmesa = pytest.mark.skipif(
    "osmesa" not in available_engines(), reason="libOSMesa is not installed"
)


class _Opaque(ctypes.Structure):
    pass


def old_binding():
    """The parts of PyOpenGL 3.1.0's binding that matter, as they are there: hardly any."""

    class Context(ctypes.POINTER(_Opaque)):
        _type_ = _Opaque

    library = types.SimpleNamespace(OSMesaCreateContextAttribs=lambda attributes, shared: None)
    return types.SimpleNamespace(OSMESA_FORMAT=0x22), Context, library


def test_what_is_missing_is_added():
    binding, context_type, library = old_binding()
    received = []
    library.OSMesaCreateContextAttribs = lambda attributes, shared: received.append(
        list(attributes)
    )
    mend_osmesa(binding, context_type, library)
    assert binding.OSMESA_CONTEXT_MAJOR_VERSION == 0x36
    binding.OSMesaCreateContextAttribs(
        [binding.OSMESA_PROFILE, binding.OSMESA_CORE_PROFILE, 0], None
    )
    assert received == [[0x33, 0x34, 0]]


def test_what_is_present_is_left_alone():
    binding, context_type, library = old_binding()
    create = binding.OSMesaCreateContextAttribs = object()
    binding.OSMESA_PROFILE = profile = object()
    mend_osmesa(binding, context_type, library)
    assert binding.OSMesaCreateContextAttribs is create
    assert binding.OSMESA_PROFILE is profile


def test_two_handles_of_a_context_are_one_key():
    binding, context_type, library = old_binding()
    mend_osmesa(binding, context_type, library)
    here, there = _Opaque(), _Opaque()
    one, same, other = (context_type(target) for target in (here, here, there))
    assert one == same
    assert hash(one) == hash(same)
    assert one != other
    assert one != 0
    assert {one: "cached"}[same] == "cached"


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
def test_pyrender_draws_on_a_binding_stripped_to_what_3_1_0_has():
    ran = subprocess.run([sys.executable, "-c", STRIP], capture_output=True, text=True, timeout=120)
    assert ran.stdout.strip() == "drawn", ran.stderr


COUNT = """
import trimesh
from ncti.render import range_image
box = trimesh.creation.box((10, 4, 2))
range_image(box, aspect=30, depression=10)
from pyrender.shader_program import ShaderProgram
compiled = []
ShaderProgram._add_to_context = lambda self: compiled.append(self)
from ncti.render.choice import start_engine
canvas = start_engine("osmesa")._canvas
cache = canvas._renderer._program_cache
program = start_engine("osmesa")._thread.submit(
    cache.get_program, "mesh_depth.vert", "mesh_depth.frag", None, {}).result
assert program() is program()
for aspect in range(5):
    range_image(box, aspect=aspect, depression=10)
assert not compiled
print("kept")
"""


@needs_osmesa
def test_shaders_are_compiled_once():
    ran = subprocess.run([sys.executable, "-c", COUNT], capture_output=True, text=True, timeout=120)
    assert ran.stdout.strip() == "kept", ran.stderr
