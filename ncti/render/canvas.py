"""Drawing of facet numbers by OpenGL, in a context of pyrender.

Importing this module imports OpenGL: `ncti.render.opengl.bind_platform` comes before. pyrender's
own depth pass would walk through a scene and set constant state for every image; its framebuffer
has four samples per pixel, of which it picks one off the centre, and 24 bits of depth; and its
shader multiplies projection, view and model in float32.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL
from OpenGL.GL.shaders import compileProgram, compileShader
from pyrender.platforms.osmesa import OSMesaPlatform

from ncti.render.solid import CACHED_SOLIDS, Solid

SHADERS = Path(__file__).with_name("shaders")


class Canvas:
    """A context, a shader program and a framebuffer, reused for all images.

    The last ships drawn stay uploaded.
    """

    def __init__(self, platform: str) -> None:
        self._context = _make_context(platform)
        GL.glBindVertexArray(GL.glGenVertexArrays(1))  # without one, no program is valid
        program = compileProgram(
            compileShader((SHADERS / "mesh_depth.vert").read_text(), GL.GL_VERTEX_SHADER),
            compileShader((SHADERS / "mesh_depth.frag").read_text(), GL.GL_FRAGMENT_SHADER),
        )
        GL.glUseProgram(program)
        self._matrix = GL.glGetUniformLocation(program, "P")
        GL.glClearColor(-1.0, -1.0, -1.0, -1.0)
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glEnable(GL.GL_CULL_FACE)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, GL.glGenFramebuffers(1))
        self._buffers = GL.glGenRenderbuffers(2)
        self._shape = (0, 0)
        self._uploaded: dict[Solid, _Facets] = {}  # the last drawn comes last

    def draw(
        self,
        solid: Solid,
        facets: NDArray[np.int32],
        clip: NDArray[np.float64],
        shape: tuple[int, int],
    ) -> NDArray[np.float32]:
        """Return the (row * col,) facet numbers behind pixels, row 0 the lowest, -1 for none.

        `facets` (facet,) are drawn in their order; `clip` (4, 4) leads from vertices to clip
        coordinates, whose volume the image of `shape` fills.
        """
        ship = self._uploaded.pop(solid, None) or _Facets(solid)
        self._uploaded[solid] = ship
        if len(self._uploaded) > CACHED_SOLIDS:
            self._uploaded.pop(next(iter(self._uploaded))).free()
        rows, columns = shape
        if shape != self._shape:
            self._resize(rows, columns)
        GL.glClear(GL.GL_COLOR_BUFFER_BIT | GL.GL_DEPTH_BUFFER_BIT)
        GL.glUniformMatrix4fv(self._matrix, 1, GL.GL_TRUE, clip.astype(np.float32))
        ship.draw(facets)
        image = np.empty(rows * columns, dtype=np.float32)
        GL.glReadPixels(0, 0, columns, rows, GL.GL_RED, GL.GL_FLOAT, image)
        return image

    def _resize(self, rows: int, columns: int) -> None:
        for buffer, attachment, content in zip(
            self._buffers,
            (GL.GL_COLOR_ATTACHMENT0, GL.GL_DEPTH_ATTACHMENT),
            (GL.GL_R32F, GL.GL_DEPTH_COMPONENT32F),
            strict=True,
        ):
            GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
            GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, content, columns, rows)
            GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, attachment, GL.GL_RENDERBUFFER, buffer)
        GL.glViewport(0, 0, columns, rows)
        self._shape = rows, columns


class _Facets:
    """Uploaded facets, with vertices in such an order that vertex i is the last of facet i.

    A `flat` output of the vertex shader has the value of a facet's last vertex, so the number of
    that vertex gives the facet; `gl_PrimitiveID` would too, but is slower in Mesa by a third.
    Other corners use any copy of their vertex, and vertices that end no facet come last.
    """

    def __init__(self, solid: Solid) -> None:
        facets, last = len(solid.faces), solid.faces[:, 2]
        copy = np.full(len(solid.vertices), -1)
        copy[last] = np.arange(facets)
        rest = np.flatnonzero(copy < 0)
        copy[rest] = facets + np.arange(len(rest))
        self._numbers = copy[solid.faces].astype(np.uint32)
        self._numbers[:, 2] = np.arange(facets)
        positions = solid.vertices[np.concatenate([last, rest])].astype(np.float32)
        self._array = GL.glGenVertexArrays(1)
        self._buffers = GL.glGenBuffers(2)
        GL.glBindVertexArray(self._array)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._buffers[0])
        GL.glBufferData(GL.GL_ARRAY_BUFFER, positions.nbytes, positions, GL.GL_STATIC_DRAW)
        GL.glVertexAttribPointer(0, 3, GL.GL_FLOAT, GL.GL_FALSE, 0, None)
        GL.glEnableVertexAttribArray(0)
        GL.glBindBuffer(GL.GL_ELEMENT_ARRAY_BUFFER, self._buffers[1])

    def draw(self, facets: NDArray[np.int32]) -> None:
        """Draw some of the facets, in the current context."""
        GL.glBindVertexArray(self._array)
        content = self._numbers.take(facets, axis=0)
        if len(content):  # PyOpenGL makes no empty buffer
            GL.glBufferData(GL.GL_ELEMENT_ARRAY_BUFFER, content.nbytes, content, GL.GL_STREAM_DRAW)
            GL.glDrawElements(GL.GL_TRIANGLES, content.size, GL.GL_UNSIGNED_INT, None)

    def free(self) -> None:
        """Delete them from the current context."""
        GL.glDeleteVertexArrays(1, [self._array])
        GL.glDeleteBuffers(2, self._buffers)


def _make_context(platform: str) -> Any:
    """Return a current context of one pixel: images have their own framebuffers."""
    context = OSMesaPlatform(1, 1) if platform == "osmesa" else _software_egl()
    context.init_context()
    context.make_current()
    # The process ends it: pyrender would destroy it in whichever thread collects it as garbage.
    context.delete_context = lambda: None
    return context


def _software_egl() -> Any:
    """Return EGL on Mesa's software device, so that images do not depend on the machine.

    If that device is not listed, it is the default one, which differs only at silhouettes.
    """
    from pyrender.platforms import egl

    extensions = 0x3055  # EGL_EXTENSIONS
    for device in egl.query_devices():
        names = egl._eglQueryDeviceStringEXT(device._display, extensions) or b""
        if b"EGL_MESA_device_software" in names:
            return egl.EGLPlatform(1, 1, device=device)
    return egl.EGLPlatform(1, 1)
