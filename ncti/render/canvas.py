"""Drawing of facet numbers by pyrender's renderer and scene.

Importing this module imports OpenGL: call `ncti.render.opengl.bind_platform` first. Only this
module uses private names of pyrender 0.1.45 and PyOpenGL 3.1.7: the public API walks through the
scene for every image.
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

from ncti.render.solid import CACHED_SOLIDS, Solid

SHADERS = Path(__file__).with_name("shaders")


class Canvas:
    """A context, a renderer and a scene, reused for all images.

    The scene holds the last ships drawn; pyrender uploads a ship when it joins the scene and frees
    it when it leaves.
    """

    def __init__(self, platform: str) -> None:
        self._context = _make_context(platform)
        self._scene = pyrender.Scene()
        self._renderer = _FacetRenderer()
        self._nodes: OrderedDict[Solid, pyrender.Node] = OrderedDict()

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
        return self._renderer.draw(self._upload_facets(solid), facets, clip, shape)

    def _upload_facets(self, solid: Solid) -> _Facets:
        """Return the facets of a ship, uploaded to the context."""
        node = self._nodes.pop(solid, None)
        if node is None:
            node = self._scene.add(pyrender.Mesh([_Facets(solid)]))
            if len(self._nodes) == CACHED_SOLIDS:
                _, oldest = self._nodes.popitem(last=False)
                self._scene.remove_node(oldest)
            self._renderer.upload(self._scene)
        self._nodes[solid] = node
        return node.mesh.primitives[0]


class _Facets(pyrender.Primitive):
    """Facets, with vertices in such an order that vertex i is the last of facet i.

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
        # pyrender makes the index buffer; its content is set for each image.
        super().__init__(
            positions=solid.vertices[np.concatenate([last, rest])], indices=self._numbers[:1]
        )

    def draw(self, facets: NDArray[np.int32]) -> None:
        """Draw some of the facets, in the current context."""
        self._bind()
        content = self._numbers.take(facets, axis=0)
        if len(content):  # PyOpenGL makes no empty buffer
            GL.glBufferData(GL.GL_ELEMENT_ARRAY_BUFFER, content.nbytes, content, GL.GL_STREAM_DRAW)
            GL.glDrawElements(GL.GL_TRIANGLES, content.size, GL.GL_UNSIGNED_INT, None)
        self._unbind()


class _FacetRenderer(pyrender.Renderer):
    """pyrender's renderer with our own depth pass.

    pyrender's pass walks through the scene, and queries and sets constant state for every image,
    which takes a tenth of the time of a small image. Its framebuffer has four samples per pixel, of
    which it picks one off the centre, and a depth buffer of 24 bits. It multiplies projection, view
    and model in the shader, in float32; here they are one matrix.
    """

    def __init__(self) -> None:
        super().__init__(1, 1)
        self._program_cache = ShaderProgramCache(shader_dir=str(SHADERS))
        program = self._program_cache.get_program("mesh_depth.vert", "mesh_depth.frag")
        program._add_to_context()
        program._bind()
        self._matrix = GL.glGetUniformLocation(program._program_id, "P")
        GL.glClearColor(-1.0, -1.0, -1.0, -1.0)
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glEnable(GL.GL_CULL_FACE)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, GL.glGenFramebuffers(1))
        self._buffers = GL.glGenRenderbuffers(2)
        self._shape = (0, 0)

    def __del__(self) -> None:
        """Do nothing: the context, perhaps of another thread, frees its own objects."""

    def upload(self, scene: pyrender.Scene) -> None:
        """Upload new objects of a scene, and free removed ones."""
        self._update_context(scene, pyrender.RenderFlags.DEPTH_ONLY)

    def draw(
        self,
        ship: _Facets,
        facets: NDArray[np.int32],
        clip: NDArray[np.float64],
        shape: tuple[int, int],
    ) -> NDArray[np.float32]:
        """Return the number of the facet behind each pixel: see `Canvas.draw`."""
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


def _make_context(platform: str) -> Any:
    """Return a current context of one pixel: images have their own framebuffers."""
    context = OSMesaPlatform(1, 1) if platform == "osmesa" else _software_egl()
    context.init_context()
    context.make_current()
    # Keep it until the process ends: pyrender would destroy it in whichever thread collects it.
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
