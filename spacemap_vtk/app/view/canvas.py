"""The VTK widget of the 3D view."""

from __future__ import annotations

import ctypes
import re
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import Signal
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QWidget
from vtkmodules.vtkCommonCore import vtkObject
from vtkmodules.vtkInteractionStyle import vtkInteractorStyleTrackballCamera
from vtkmodules.vtkRenderingCore import vtkCamera
from vtkmodules.vtkRenderingOpenGL2 import vtkOpenGLFXAAFilter

from spacemap_vtk.app.view.render_widget import RenderWidget
from spacemap_vtk.draw.actors.shadow_layer import ShadowLayer
from spacemap_vtk.draw.camera import add_front_renderer, make_renderer

# Constants of OpenGL.
_READ_FRAMEBUFFER = 0x8CA8
_DRAW_FRAMEBUFFER = 0x8CA9
_COLOR_BUFFER = 0x4000
_NEAREST = 0x2600
_SCISSOR_TEST = 0x0C11
_LEQUAL = 0x0203
#: Replacement of the texture lookups in VTK's shader; see `Canvas._patch_fxaa`.
_TEXEL = """
vec4 texel(vec2 at)
{
  ivec2 most = textureSize(Input, 0) - 1;
  return texelFetch(Input, clamp(ivec2(at / InvTexSize), ivec2(0), most), 0);
}

"""


class Canvas(RenderWidget):
    """Show one renderer with lights; the mouse turns it as in other VTK programs."""

    #: Emitted before each drawing.
    painting = Signal()

    def __init__(self, parent: QWidget | None) -> None:
        super().__init__(parent)
        self._painting = False
        #: Time of the last drawing in s.
        self.draw_time = 0.0
        self.renderer = make_renderer()
        self.render_window.SetMultiSamples(0)
        # Avoids a copy into a second buffer; Qt reads the first one.
        self.render_window.SwapBuffersOff()
        self.render_window.AddRenderer(self.renderer)
        #: Renderer in front of everything, off by default.
        self.front = add_front_renderer(self.render_window, self.renderer)
        self.front.SetLayer(2)
        self.front.DrawOff()
        #: Layer of contact shadows between the two renderers, off by default.
        self.shade = ShadowLayer(self.render_window, 1)
        self.render_window.SetNumberOfLayers(3)
        self.interactor.SetInteractorStyle(vtkInteractorStyleTrackballCamera())
        # Mouse moves only request a paint event, so that Qt draws once for many moves.
        self.interactor.EnableRenderOff()
        self._render_observer = self.interactor.AddObserver("RenderEvent", self._request_paint)
        self.interactor.Initialize()

    def initializeGL(self) -> None:
        """Find ``glFinish`` of the present OpenGL context."""
        super().initializeGL()
        place = int(self.context().getProcAddress(b"glFinish"))
        self._gl_finish = ctypes.CFUNCTYPE(None)(place)
        self._fxaa_patched = False

    def _patch_fxaa(self) -> None:
        """Patch the FXAA shader to take two thirds of its time, with the same pixels."""
        # VTK's shader interpolates the texture even at texel centres, which is slow in software
        # OpenGL. Only its last lookup lies between texels; the others read the texel directly.
        self._fxaa_patched = True
        smooth = vtkOpenGLFXAAFilter()
        smooth.Execute(self.renderer)
        cache = self.render_window.GetShaderCache()
        program = cache.GetLastShaderBound()
        if program is None:
            return
        shader = program.GetFragmentShader()
        source = shader.GetSource()
        before, search, rest = source.partition("int vtkEndpointSearch(")
        rest, count = re.subn(r"texture(2D)?\(Input, (?!posEdgeAA)", "texel(", rest)
        smooth.ReleaseGraphicsResources()
        # If the shader of another VTK version differs, or the driver cannot compile the patched
        # one, the original stays in use.
        for text in (before + _TEXEL + search + rest, source) if count else ():
            program.ReleaseGraphicsResources(self.render_window)
            # Otherwise the vertex shader stays compiled although the fragment shader is not.
            program.GetVertexShader().Cleanup()
            shader.SetSource(text)
            program.SetCompiled(False)
            vtkObject.GlobalWarningDisplayOff()
            ready = cache.ReadyShaderProgram(program)
            vtkObject.GlobalWarningDisplayOn()
            if ready:
                break

    def paintGL(self) -> None:
        """Render with VTK, and copy the picture into Qt's framebuffer."""
        # Software OpenGL renders in its own threads, and reading the result waits for them. A wait
        # through ctypes (`_gl_finish`) lets other Python threads run; VTK's and Qt's functions do
        # not.
        window = self.render_window
        if self._painting or not window.GetReadyForRendering():
            return
        state = window.GetState()
        state.Reset()  # Qt has changed the OpenGL state since the last time
        state.Push()
        state.vtkglDepthFunc(_LEQUAL)
        self._painting = True
        self.painting.emit()
        begin = perf_counter()
        try:
            # Not Render of the window: VTK releases Python's lock (GIL) in it. VTK's garbage
            # collector, which holds a global lock, then needs the GIL to free an array, while a
            # thread with the GIL waits for the collector's lock: a deadlock.
            self.interactor.EnableRenderOn()
            if not self._fxaa_patched and self.renderer.GetUseFXAA():
                self.interactor.Render()
                self._patch_fxaa()
            if self.shade.is_on:
                self._draw_shaded()
            else:
                self.interactor.Render()
                self._gl_finish()
        finally:
            self.interactor.EnableRenderOff()
            self._painting = False
            self.draw_time = perf_counter() - begin
        # Handlers called during drawing may have made another context current.
        self.makeCurrent()
        # Round as Qt does: at a scale of 1.5 its buffer can have a row or column more than VTK's.
        scale = self.devicePixelRatioF()
        place = 0, 0, int(self.width() * scale + 0.5), int(self.height() * scale + 0.5)
        state.vtkglBindFramebuffer(_DRAW_FRAMEBUFFER, self.defaultFramebufferObject())
        drawn = window.GetRenderFramebuffer()
        drawn.Bind(_READ_FRAMEBUFFER)
        drawn.ActivateReadBuffer(0)
        state.vtkglDisable(_SCISSOR_TEST)
        state.vtkglBlitFramebuffer(0, 0, *window.GetSize(), *place, _COLOR_BUFFER, _NEAREST)
        state.Pop()

    def _draw_shaded(self) -> None:
        """Draw the scene, then its contact shadows and the front renderer over it."""
        # The shadows are computed between two renderings: NumPy releases the GIL, which must not
        # happen while VTK renders.
        front = self.front.GetDraw()
        self.front.DrawOff()
        self.interactor.Render()
        self._gl_finish()
        self.shade.update(self.renderer)
        self.front.SetDraw(front)
        self.renderer.DrawOff()
        self.shade.renderer.DrawOn()
        try:
            self.interactor.Render()
            self._gl_finish()
        finally:
            self.shade.renderer.DrawOff()
            self.renderer.DrawOn()

    def close(self) -> bool:
        """Detach from the interactor, which keeps this widget alive, and free VTK's resources."""
        self.interactor.RemoveObserver(self._render_observer)
        return super().close()

    def _request_paint(self, _interactor: object, _event: str) -> None:
        if not self._painting:
            self.update()

    @property
    def camera(self) -> vtkCamera:
        """The active camera."""
        return self.renderer.GetActiveCamera()

    def image(self) -> NDArray[np.uint8]:
        """Draw the view, and return its pixels, shape (height, width, 3)."""
        drawn = self.grabFramebuffer().convertToFormat(QImage.Format.Format_RGB888)
        rows = np.frombuffer(drawn.constBits(), np.uint8).reshape(drawn.height(), -1)
        # Each row of a QImage is padded to a multiple of four bytes.
        return rows[:, : 3 * drawn.width()].reshape(drawn.height(), drawn.width(), 3).copy()
