"""Choice of an engine among those that can run here."""

from __future__ import annotations

import ctypes
import os
from functools import lru_cache
from threading import RLock

from ncti.render.embree import EmbreeEngine
from ncti.render.engine import Engine, EngineError
from ncti.render.opengl import PyrenderEngine, bound_platform

_LIBRARIES: dict[str, tuple[tuple[str, ...], ...]] = {  # by engine: files of each library
    "osmesa": (("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"),),
    "egl": (("libEGL.so.1", "libEGL.so"), ("libOpenGL.so.0", "libGL.so.1", "libGL.so")),
    "embree": (),
}
_PACKAGES = {"osmesa": "libosmesa6", "egl": "libegl1 libopengl0 libgl1-mesa-dri"}


def engines() -> tuple[str, ...]:
    """Return the names of all engines, in the order that "auto" prefers."""
    return tuple(_LIBRARIES)


@lru_cache
def _is_present(name: str) -> bool:
    def loads(library: str) -> bool:
        try:
            ctypes.CDLL(library)
        except OSError:
            return False
        return True

    return all(any(map(loads, files)) for files in _LIBRARIES[name])


def available_engines() -> tuple[str, ...]:
    """Return the engines whose libraries this machine has, in the order that "auto" prefers.

    It only looks for the libraries, and imports neither pyrender nor OpenGL.

    See Also
    --------
    range_image : Takes one of these names.

    Examples
    --------
    >>> from ncti.render import available_engines
    >>> "embree" in available_engines()
    True
    """
    return tuple(name for name in engines() if _is_present(name))


def choose_engine(name: str) -> str:
    """Return the name of an engine that can run here, or raise `EngineError`.

    "auto" chooses the first available of osmesa, egl and embree that is compatible with the
    platform to which OpenGL is bound in this process.
    """
    if name == "auto":
        with _lock:  # an engine that another thread is starting rules out others
            bound = bound_platform()
        return next(n for n in available_engines() if n == "embree" or bound in (None, n))
    if name not in _LIBRARIES:
        raise ValueError(f"engine is {name!r}: it must be auto, {', '.join(engines())}.")
    if not _is_present(name):
        alternatives = " or ".join(available_engines())
        raise EngineError(
            f"render engine {name} cannot run here, because its libraries are missing: install "
            f"them with `apt install {_PACKAGES[name]}`, or use {alternatives}."
        )
    return name


def start_engine(name: str) -> Engine:
    """Return an engine by name, started on first use and kept for this process.

    Threads may call this concurrently: one starts the engine, and the others wait. Raises
    `EngineError` if its libraries are missing or cannot draw.
    """
    with _lock:
        name = choose_engine(name)
        key = os.getpid(), name  # An engine does not survive a fork.
        if key not in _running:
            _running[key] = EmbreeEngine() if name == "embree" else PyrenderEngine(name)
        return _running[key]


_running: dict[tuple[int, str], Engine] = {}
# Held from the choice of an engine until it runs: "auto" depends on the engines started before, and
# importing OpenGL binds it to a platform, which must not happen twice.
_lock = RLock()
