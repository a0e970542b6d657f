"""pyrender's renderer and scene, set up to draw facet numbers.

Importing this module imports OpenGL: `ncti.render.opengl.bind_platform` comes before.
"""

from __future__ import annotations

from collections import OrderedDict
from pathlib import Path
from typing import Any

import numpy as np
import pyrender
from numpy.typing import NDArray
from OpenGL import GL
from pyrender.platforms.osmesa import OSMesaPlatform
from pyrender.shader_program import ShaderProgramCache

from ncti.render.solid import KEPT, Solid

SHADERS = Path(__file__).with_name("shaders")


class Canvas:
    """A context, a renderer and a scene, kept from image to image.

    The scene holds the last ships drawn, with one of them visible; pyrender uploads a ship when it
    joins the scene and frees it when it leaves.
    """

    def __init__(self, platform: str) -> None:
        self._context = _make_context(platform)
        self._camera = _MatrixCamera()
        self._scene = pyrender.Scene(bg_color=-np.ones(4))
        self._scene.add(self._camera)
        self._renderer = _FacetRenderer()
        self._nodes: OrderedDict[Solid, pyrender.Node] = OrderedDict()

    def draw(
        self,
        solid: Solid,
        facets: NDArray[np.int32],
        clip: NDArray[np.float64],
        shape: tuple[int, int],
    ) -> NDArray[np.float32]:
        """The number of the facet behind each pixel, -1 where there is none.

        Parameters
        ----------
        solid : Solid
            The ship.
        facets : (facet,) int32 ndarray
            Those of its facets that are drawn, in their order.
        clip : (4, 4) float64 ndarray
            From its vertices to clip coordinates.
        shape : (int, int)
            Rows and columns of the image, which fills the clip volume.

        Returns
        -------
        (row * col,) float32 ndarray
            Facet numbers, row 0 the lowest.
        """
        self._show(solid).choose(facets)
        self._camera.matrix = clip
        self._renderer.viewport_height, self._renderer.viewport_width = shape
        flags = pyrender.RenderFlags.DEPTH_ONLY | pyrender.RenderFlags.OFFSCREEN
        return self._renderer.render(self._scene, flags)

    def _show(self, solid: Solid) -> _Facets:
        node = self._nodes.pop(solid, None)
        if node is None:
            node = self._scene.add(pyrender.Mesh([_Facets(solid)]))
        self._nodes[solid] = node
        if len(self._nodes) > KEPT:
            _, oldest = self._nodes.popitem(last=False)
            self._scene.remove_node(oldest)
        for other in self._nodes.values():
            other.mesh.is_visible = other is node
        facets: _Facets = node.mesh.primitives[0]
        return facets


class _Facets(pyrender.Primitive):
    """Facets, with vertices in such an order that vertex i is the last of facet i.

    A `flat` output of the vertex shader is that of a facet's last vertex, so the number of that
    vertex tells the facet; `gl_PrimitiveID` would too, and is slower in Mesa by a third.
    Other corners use any copy of their vertex, and vertices that are nowhere last come at the end.
    """

    def __init__(self, solid: Solid) -> None:
        facets, last = len(solid.faces), solid.faces[:, 2]
        copy = np.full(len(solid.vertices), -1)
        copy[last] = np.arange(facets)
        rest = np.flatnonzero(copy < 0)
        copy[rest] = facets + np.arange(len(rest))
        self._numbers = copy[solid.faces].astype(np.uint32)
        self._numbers[:, 2] = np.arange(facets)
        # Which facets are drawn is said anew for each image; pyrender makes the buffer for it.
        super().__init__(
            positions=solid.vertices[np.concatenate([last, rest])], indices=self._numbers[:1]
        )

    def choose(self, facets: NDArray[np.int32]) -> None:
        """Draw some of the facets, next time."""
        self._chosen = self._numbers.take(facets, axis=0)

    def draw(self) -> None:
        """Draw them, in the current context."""
        self._bind()
        content = self._chosen
        if len(content):  # PyOpenGL makes no buffer of nothing
            GL.glBufferData(GL.GL_ELEMENT_ARRAY_BUFFER, content.nbytes, content, GL.GL_STREAM_DRAW)
            GL.glDrawElements(GL.GL_TRIANGLES, content.size, GL.GL_UNSIGNED_INT, None)
        self._unbind()


class _MatrixCamera(pyrender.Camera):
    """A camera that stands at the ship origin with the whole way to clip coordinates in a matrix.

    pyrender would multiply projection, view and model in the shader, in float32.
    """

    matrix: NDArray[np.float64]

    def get_projection_matrix(
        self, width: int | None = None, height: int | None = None
    ) -> NDArray[np.float64]:
        return self.matrix


class _FacetRenderer(pyrender.Renderer):
    """pyrender's renderer with a shader and a framebuffer of our own.

    pyrender's own framebuffer has four samples a pixel, of which it then picks one that is not at
    the centre, and a depth buffer of 24 bits.
    """

    _main_fb: Any
    _main_fb_dims: tuple[int | None, int | None]

    def __init__(self) -> None:
        super().__init__(1, 1)
        self._program: Any = None
        self._program_cache = ShaderProgramCache(shader_dir=str(SHADERS))

    def __del__(self) -> None:
        """Leave what is in the context to the context, which may not be this thread's."""

    def _get_primitive_program(self, primitive: Any, flags: int, program_flags: int) -> Any:
        # pyrender asks OpenGL for its limits on lights every time.
        if self._program is None:
            self._program = super()._get_primitive_program(primitive, flags, program_flags)
        return self._program

    def _bind_and_draw_primitive(
        self, primitive: _Facets, pose: Any, program: Any, flags: int
    ) -> None:
        GL.glEnable(GL.GL_CULL_FACE)
        GL.glCullFace(GL.GL_BACK)
        primitive.draw()

    def _configure_main_framebuffer(self) -> None:
        size = self.viewport_width, self.viewport_height
        if size == self._main_fb_dims:
            return
        if self._main_fb is None:
            self._main_cb, self._main_db = GL.glGenRenderbuffers(2)
            self._main_fb = self._main_fb_ms = GL.glGenFramebuffers(1)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._main_fb)
        for buffer, attachment, content in (
            (self._main_cb, GL.GL_COLOR_ATTACHMENT0, GL.GL_R32F),
            (self._main_db, GL.GL_DEPTH_ATTACHMENT, GL.GL_DEPTH_COMPONENT32F),
        ):
            GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
            GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, content, *size)
            GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, attachment, GL.GL_RENDERBUFFER, buffer)
        self._main_fb_dims = size

    def _read_main_framebuffer(self, scene: Any, flags: int) -> NDArray[np.float32]:
        width, height = self.viewport_width, self.viewport_height
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._main_fb)
        image = np.empty(height * width, dtype=np.float32)
        GL.glReadPixels(0, 0, width, height, GL.GL_RED, GL.GL_FLOAT, image)
        return image


def _make_context(platform: str) -> Any:
    """A current context; images have framebuffers of their own, so its surface has one pixel."""
    context = OSMesaPlatform(1, 1) if platform == "osmesa" else _software_egl()
    context.init_context()
    context.make_current()
    # It ends with the process: pyrender would destroy it in whichever thread collects it.
    context.delete_context = lambda: None
    return context


def _software_egl() -> Any:
    """EGL on Mesa's software device where it is listed: the image must not depend on the machine.

    Without it, the default device; which differs at silhouettes at most.
    """
    from pyrender.platforms import egl

    extensions = 0x3055  # EGL_EXTENSIONS
    for device in egl.query_devices():
        known = egl._eglQueryDeviceStringEXT(device._display, extensions) or b""
        if b"EGL_MESA_device_software" in known:
            return egl.EGLPlatform(1, 1, device=device)
    return egl.EGLPlatform(1, 1)
