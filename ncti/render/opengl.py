"""OpenGL engines: pyrender's depth pass in software, on OSMesa or EGL, one platform per process."""

from __future__ import annotations

import ctypes
import importlib
import os
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.render.engine import EngineError
from ncti.render.solid import Solid, sampled_facets
from ncti.render.view import Lattice, View, clip_matrix

MAX_FACETS = 2**24
"""Most facets: their numbers are float32 colours, exact up to this number."""

_process: int | None = None
"""Process in which PyOpenGL was bound."""


def bind_platform(name: str) -> None:
    """Make PyOpenGL load its functions from "osmesa" or "egl"; call it before importing pyrender.

    Raises `EngineError` if PyOpenGL is bound to another platform in this process, or was bound
    before a fork.
    """
    global _process
    if _process not in (None, os.getpid()):
        raise EngineError(
            f"render engine {name} cannot run in a process forked from one that draws with OpenGL, "
            "whose threads are not there: start processes by spawn or forkserver, or use embree."
        )
    bound = bound_platform()
    if bound not in (None, name):
        usable = f"{bound} or embree" if bound in ("osmesa", "egl") else "embree"
        raise EngineError(
            f"render engine {name} cannot start, because OpenGL is already bound to {bound} in "
            f"this process and can be bound once: use {usable} here, or another process."
        )
    _process = os.getpid()
    os.environ["PYOPENGL_PLATFORM"] = name
    # Mesa maps its shader cache into memory, and a full disk then ends the process (SIGBUS).
    # The depth shader is trivial, so the cache saves nothing.
    os.environ.setdefault("MESA_SHADER_CACHE_DISABLE", "true")
    if name == "osmesa":
        import OpenGL.osmesa
        import OpenGL.platform
        import OpenGL.raw.osmesa._types as types

        patch_osmesa(OpenGL.osmesa, types.OSMesaContext, OpenGL.platform.PLATFORM.OSMesa)


def bound_platform() -> str | None:
    """Return the platform from which PyOpenGL loads its functions, None before it is imported.

    It waits for another thread that is importing it, as the platform has no name until then.
    """
    platform = sys.modules.get("OpenGL.platform")
    if platform is None:
        return None
    if getattr(platform, "PLATFORM", None) is None:
        platform = importlib.import_module("OpenGL.platform")
    return type(platform.PLATFORM).__module__.rpartition(".")[2]


def patch_osmesa(binding: Any, context_type: Any, library: ctypes.CDLL) -> None:
    """Add to PyOpenGL the parts of OSMesa that pyrender needs.

    pyrender pins PyOpenGL 3.1.0, whose binding lacks `OSMesaCreateContextAttribs`, needed for
    OpenGL 3.3, its constants, and the hash of a context, by which pyrender and PyOpenGL find a
    context's objects. Later versions have these, but two handles of one context are still unequal,
    so that pyrender would recompile its shaders for every image.
    """
    constants = {
        "OSMESA_DEPTH_BITS": 0x30,
        "OSMESA_STENCIL_BITS": 0x31,
        "OSMESA_ACCUM_BITS": 0x32,
        "OSMESA_PROFILE": 0x33,
        "OSMESA_CORE_PROFILE": 0x34,
        "OSMESA_COMPAT_PROFILE": 0x35,
        "OSMESA_CONTEXT_MAJOR_VERSION": 0x36,
        "OSMESA_CONTEXT_MINOR_VERSION": 0x37,
    }
    for name, value in constants.items():
        if not hasattr(binding, name):
            setattr(binding, name, value)
    if not hasattr(binding, "OSMesaCreateContextAttribs"):
        create = library.OSMesaCreateContextAttribs
        create.restype = context_type
        create.argtypes = [ctypes.POINTER(ctypes.c_int), context_type]

        def create_context(attributes: Any, shared: Any) -> Any:
            return create((ctypes.c_int * len(attributes))(*attributes), shared)

        binding.OSMesaCreateContextAttribs = create_context

    def address(context: Any) -> int | None:
        return ctypes.cast(context, ctypes.c_void_p).value

    def is_same(self: Any, other: Any) -> bool:
        return isinstance(other, context_type) and address(self) == address(other)

    context_type.__eq__ = is_same
    context_type.__hash__ = lambda self: hash(address(self))


def _open_canvas(platform: str) -> Any:
    # Imports OpenGL, which binds it to the platform of this moment.
    from ncti.render.canvas import Canvas

    return Canvas(platform)


class PyrenderEngine:
    """pyrender on one OpenGL platform, with a persistent context, renderer and scene.

    An OpenGL context belongs to one thread. The engine has its own thread for it, so any thread
    may call it; it draws one image at a time.
    """

    def __init__(self, platform: str) -> None:
        bind_platform(platform)
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix=f"render-{platform}")
        try:
            self._canvas = self._thread.submit(_open_canvas, platform).result()
        except Exception as error:
            raise EngineError(
                f"render engine {platform} has its libraries but cannot start here ({error!r}): "
                "use embree, or another engine in another process."
            ) from error

    def visible(
        self, solid: Solid, view: View, lattice: Lattice, points: NDArray[np.float64]
    ) -> NDArray[np.float32]:
        """Return the facet that each pixel sees, -1 for none."""
        if len(solid.faces) > MAX_FACETS:
            raise ValueError(
                f"mesh has {len(solid.faces)} facets: OpenGL engines take at most {MAX_FACETS}."
            )
        clip = clip_matrix(view, lattice, centre=solid.centre)
        facets = sampled_facets(solid, view, lattice, points)
        drawing = self._thread.submit(self._canvas.draw, solid, facets, clip, lattice.shape)
        return drawing.result()
