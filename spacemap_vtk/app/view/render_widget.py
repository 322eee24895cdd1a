"""A Qt widget in which VTK renders.

VTK renders into its framebuffers in the OpenGL context that Qt has made for the widget; it has no
access to the window. Therefore the widget works on X11, Wayland, Windows and macOS, and can be
placed among other Qt widgets.

- VTK requests its context by an event. The handler calls ``makeCurrent`` of the context, not of
  the widget: the widget's method also binds a framebuffer, without VTK's knowledge.
- A context belongs to the thread that made it. In other threads the event is ignored, because Qt
  would abort.
- VTK's resources are freed while the context exists and is current. Otherwise the driver would
  free them in another context, which crashes much later.
"""

from __future__ import annotations

import ctypes
import threading

from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QEnterEvent, QMouseEvent, QOpenGLContext, QSurfaceFormat, QWheelEvent
from PySide6.QtOpenGLWidgets import QOpenGLWidget
from PySide6.QtWidgets import QSizePolicy, QWidget
from vtkmodules.util.misc import calldata_type
from vtkmodules.vtkCommonCore import VTK_INT
from vtkmodules.vtkRenderingOpenGL2 import vtkGenericOpenGLRenderWindow
from vtkmodules.vtkRenderingUI import vtkGenericRenderWindowInteractor

#: VTK's name of each mouse button.
_BUTTONS = {
    Qt.MouseButton.LeftButton: "LeftButton",
    Qt.MouseButton.MiddleButton: "MiddleButton",
    Qt.MouseButton.RightButton: "RightButton",
}
#: VTK's number of the hand cursor (VTK_CURSOR_HAND), for which VTK's Python modules have no name.
_CURSOR_HAND = 9
#: Angle that Qt reports for one step of a mouse wheel, in 1/8 degree.
_WHEEL_STEP = 120


def _surface_format() -> QSurfaceFormat:
    """Return the OpenGL format that VTK needs; multisampling is done in VTK's framebuffers."""
    surface_format = QSurfaceFormat()
    # On Wayland Qt may otherwise choose OpenGL ES, which cannot compile VTK's shaders.
    surface_format.setRenderableType(QSurfaceFormat.RenderableType.OpenGL)
    surface_format.setProfile(QSurfaceFormat.OpenGLContextProfile.CoreProfile)
    surface_format.setVersion(3, 2)
    surface_format.setAlphaBufferSize(8)
    surface_format.setDepthBufferSize(8)
    return surface_format


class RenderWidget(QOpenGLWidget):
    """Connect a VTK render window and its interactor to Qt."""

    def __init__(self, parent: QWidget | None) -> None:
        # Set the default format, not the widget's: on Wayland a widget stays black if its format
        # differs from that of the window around it.
        QSurfaceFormat.setDefaultFormat(_surface_format())
        super().__init__(parent)
        self.setUpdateBehavior(QOpenGLWidget.UpdateBehavior.NoPartialUpdate)
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.FocusPolicy.WheelFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.render_window = vtkGenericOpenGLRenderWindow()
        self.render_window.SetReadyForRendering(False)
        self.render_window.SetFrameBlitModeToNoBlit()
        self.interactor = vtkGenericRenderWindowInteractor()
        self.interactor.SetRenderWindow(self.render_window)
        self._context: QOpenGLContext | None = None
        self._wheel_angle = 0
        # VTK keeps these methods, and therefore the widget, alive until the observers are removed.
        self._observers = [
            self.render_window.AddObserver(event, answer)
            for event, answer in (
                ("WindowMakeCurrentEvent", self._make_current),
                ("WindowIsCurrentEvent", self._set_is_current),
                ("CursorChangedEvent", self._change_cursor),
            )
        ]

    def initializeGL(self) -> None:
        """Prepare VTK for the present OpenGL context."""
        context = self._context = self.context()
        context.aboutToBeDestroyed.connect(self._leave_context)
        window = self.render_window
        # VTK loads the OpenGL functions through Qt. The callback is kept, as VTK may call it later.
        self._loader = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_char_p)(
            lambda name: int(context.getProcAddress(name) or 0)
        )
        window.SetOpenGLSymbolLoader2(ctypes.cast(self._loader, ctypes.c_void_p).value, 0)
        window.OpenGLInitContext()
        window.OpenGLInit()
        window.GetState().Reset()
        window.SetForceMaximumHardwareLineWidth(1)
        window.SetReadyForRendering(True)
        window.SetOwnContext(0)

    def resizeGL(self, width: int, height: int) -> None:
        """Give VTK the size of the widget in device pixels."""
        scale = self.devicePixelRatioF()
        self.interactor.UpdateSize(max(1, round(width * scale)), max(1, round(height * scale)))
        self.interactor.ConfigureEvent()
        self.render_window.SetDPI(round(72 * scale))

    def close(self) -> bool:
        """Free VTK's resources in the context; nothing can be drawn afterwards."""
        closed = super().close()
        self.render_window.Finalize()
        for observer in self._observers:
            self.render_window.RemoveObserver(observer)
        return closed

    def _leave_context(self) -> None:
        """Free VTK's resources in a context that is being destroyed; another one may follow."""
        self._make_current()
        self.render_window.Finalize()
        self.render_window.SetReadyForRendering(False)
        self._context = None

    def _make_current(self, *_: object) -> None:
        context = self._context
        if context is not None and threading.current_thread() is threading.main_thread():
            context.makeCurrent(context.surface())

    def _set_is_current(self, *_: object) -> None:
        context = self._context
        self.render_window.SetIsCurrent(
            context is not None and QOpenGLContext.currentContext() is context
        )

    @calldata_type(VTK_INT)
    def _change_cursor(self, _window: object, _event: str, cursor: int) -> None:
        hand = cursor == _CURSOR_HAND
        self.setCursor(Qt.CursorShape.PointingHandCursor if hand else Qt.CursorShape.ArrowCursor)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Pass the event to VTK."""
        self._press_or_release(event, "Press")

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """Pass the event to VTK."""
        self._press_or_release(event, "Release")

    def _press_or_release(self, event: QMouseEvent, action: str) -> None:
        button = _BUTTONS.get(event.button())
        if button is not None:
            self._send_position(event)
            self.interactor.InvokeEvent(f"{button}{action}Event")

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Pass the event to VTK."""
        self._send_position(event)
        self.interactor.MouseMoveEvent()

    def enterEvent(self, event: QEnterEvent) -> None:
        """Pass the event to VTK."""
        self._send_position(event)
        self.interactor.EnterEvent()

    def leaveEvent(self, _event: QEvent) -> None:
        """Pass the event to VTK."""
        self.interactor.LeaveEvent()

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Pass whole wheel steps to VTK; a touchpad sends parts of a step, which are summed."""
        self._send_position(event)
        self._wheel_angle += event.angleDelta().y()
        if abs(self._wheel_angle) >= _WHEEL_STEP:
            if self._wheel_angle > 0:
                self.interactor.MouseWheelForwardEvent()
            else:
                self.interactor.MouseWheelBackwardEvent()
            self._wheel_angle = 0

    def _send_position(self, event: QMouseEvent | QEnterEvent | QWheelEvent) -> None:
        """Give VTK the mouse position in device pixels from the bottom, and the modifier keys."""
        scale, position, modifiers = self.devicePixelRatioF(), event.position(), event.modifiers()
        self.interactor.SetEventInformation(
            round(position.x() * scale),
            round((self.height() - position.y() - 1) * scale),
            bool(modifiers & Qt.KeyboardModifier.ControlModifier),
            bool(modifiers & Qt.KeyboardModifier.ShiftModifier),
            chr(0),
            int(event.type() == QEvent.Type.MouseButtonDblClick),
            None,
        )
