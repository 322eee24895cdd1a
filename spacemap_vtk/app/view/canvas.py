"""The widget that VTK draws the view into."""

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
from spacemap_vtk.draw.actors.shade_layer import ShadeLayer
from spacemap_vtk.draw.camera import front_of, lit_renderer

# Of OpenGL.
_READ_FRAMEBUFFER, _DRAW_FRAMEBUFFER = 0x8CA8, 0x8CA9
_COLOR_BUFFER, _NEAREST, _SCISSOR_TEST, _LEQUAL = 0x4000, 0x2600, 0x0C11, 0x0203
_TEXEL = """
vec4 texel(vec2 at)
{
  ivec2 most = textureSize(Input, 0) - 1;
  return texelFetch(Input, clamp(ivec2(at / InvTexSize), ivec2(0), most), 0);
}

"""


class Canvas(RenderWidget):
    """Shows one renderer, lit, that the mouse turns as in every VTK program."""

    #: It is about to draw.
    painting = Signal()

    def __init__(self, parent: QWidget | None) -> None:
        super().__init__(parent)
        self._painting = False
        #: Seconds that the last picture took.
        self.took = 0.0
        self.renderer = lit_renderer()
        self.render_window.SetMultiSamples(0)
        # VTK would copy what it has drawn into a second buffer; Qt gets it from the first.
        self.render_window.SwapBuffersOff()
        self.render_window.AddRenderer(self.renderer)
        #: Draws over all else, if it is to.
        self.front = front_of(self.render_window, self.renderer)
        self.front.SetLayer(2)
        self.front.DrawOff()
        #: Draws shadows between, if it is to.
        self.shade = ShadeLayer(self.render_window, self.renderer, 1)
        self.render_window.SetNumberOfLayers(3)
        self.interactor.SetInteractorStyle(vtkInteractorStyleTrackballCamera())
        # What the mouse turns is drawn when Qt comes to it, once, however many moves came before.
        self.interactor.EnableRenderOff()
        self._asking = self.interactor.AddObserver("RenderEvent", self._ask_for_paint)
        self.interactor.Initialize()

    def initializeGL(self) -> None:
        """Find the OpenGL function that waits, for the context that there is now."""
        super().initializeGL()
        place = int(self.context().getProcAddress(b"glFinish"))
        self.wait = ctypes.CFUNCTYPE(None)(place)
        self._quickened = False

    def _quicken(self) -> None:
        """Let smooth edges take two thirds of their time, to the same pixels."""
        # VTK's filter has its texture interpolated even in the middle of texels, which software
        # OpenGL does at full length; only its last look lies between them.
        self._quickened = True
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
        # Where another VTK says it otherwise, or a driver takes no such words, all stays as it is.
        for text in (before + _TEXEL + search + rest, source) if count else ():
            program.ReleaseGraphicsResources(self.render_window)
            program.GetVertexShader().Cleanup()  # it stays compiled where the other was not
            shader.SetSource(text)
            program.SetCompiled(False)
            vtkObject.GlobalWarningDisplayOff()
            ready = cache.ReadyShaderProgram(program)
            vtkObject.GlobalWarningDisplayOn()
            if ready:
                break

    def paintGL(self) -> None:
        """Draw, and hand Qt what was drawn."""
        # Software draws in threads of its own, and whoever wants the result waits for them: ctypes
        # lets the other threads of Python work meanwhile, where VTK's and Qt's functions do not.
        window = self.render_window
        if self._painting or not window.GetReadyForRendering():
            return
        state = window.GetState()
        state.Reset()  # Qt has drawn since
        state.Push()
        state.vtkglDepthFunc(_LEQUAL)
        self._painting = True
        self.painting.emit()
        begin = perf_counter()
        try:
            # Not the window's own Render: VTK lets go of Python's lock in that. Then its collector,
            # which holds a lock of all threads, needs Python's to free an array, and a thread that
            # has Python's waits for the collector's: both would stand for ever.
            self.interactor.EnableRenderOn()
            if not self._quickened and self.renderer.GetUseFXAA():
                self.interactor.Render()
                self._quicken()
            if self.shade.on:
                self._draw_shaded()
            else:
                self.interactor.Render()
                self.wait()
        finally:
            self.interactor.EnableRenderOff()
            self._painting = False
            self.took = perf_counter() - begin
        # What is told while drawing may have made another context current.
        self.makeCurrent()
        # As Qt rounds: at a scale of 1.5 it may have a row or column more than VTK.
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
        """Draw what is below, and over it, once it is there, its shadows and what is in front."""
        # Not while VTK draws: numpy lets go of Python's lock.
        front = self.front.GetDraw()
        self.front.DrawOff()
        self.interactor.Render()
        self.wait()
        self.shade.make(self.renderer)
        self.front.SetDraw(front)
        self.renderer.DrawOff()
        self.shade.renderer.DrawOn()
        try:
            self.interactor.Render()
            self.wait()
        finally:
            self.shade.renderer.DrawOff()
            self.renderer.DrawOn()

    def close(self) -> bool:
        """Let go of the interactor, which would keep this widget, and free what VTK holds."""
        self.interactor.RemoveObserver(self._asking)
        return super().close()

    def _ask_for_paint(self, _interactor: object, _event: str) -> None:
        if not self._painting:
            self.update()

    @property
    def camera(self) -> vtkCamera:
        """What the view is seen through."""
        return self.renderer.GetActiveCamera()

    def image(self) -> NDArray[np.uint8]:
        """Draw, and return what is seen."""
        drawn = self.grabFramebuffer().convertToFormat(QImage.Format.Format_RGB888)
        rows = np.frombuffer(drawn.constBits(), np.uint8).reshape(drawn.height(), -1)
        # Each row begins at a multiple of four bytes.
        return rows[:, : 3 * drawn.width()].reshape(drawn.height(), drawn.width(), 3).copy()
