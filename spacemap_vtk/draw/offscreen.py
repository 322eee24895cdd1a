"""A window that nobody sees: what VTK draws, as arrays. Needs nothing but VTK."""

from __future__ import annotations

from typing import TYPE_CHECKING

# VTK finds the classes that draw and that write letters once these modules are loaded.
import vtkmodules.vtkRenderingFreeType
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkFloatArray, vtkUnsignedCharArray
from vtkmodules.vtkRenderingCore import vtkCamera, vtkProp, vtkRenderer, vtkRenderWindow

from spacemap_vtk.datasets.quiet import silent_vtk
from spacemap_vtk.draw.camera import front_of, lit_renderer
from spacemap_vtk.draw.graphics import (
    DRIVERS,
    NO_DRIVER,
    draws_without_opengl,
    prepare_offscreen,
)
from spacemap_vtk.errors import MissingLibraryError
from spacemap_vtk.ndarrays import Bytes, Singles

if TYPE_CHECKING:
    from spacemap_vtk.draw.software.window import SoftwareWindow


def open_offscreen(
    size: tuple[int, int], samples: int = 0, pixels: int = 1
) -> Offscreen | SoftwareWindow:
    """Open a window that nobody sees: of OpenGL, or without it where its libraries are missing."""
    if draws_without_opengl():
        from spacemap_vtk.draw.software.window import SoftwareWindow

        return SoftwareWindow(size, samples, pixels)
    return Offscreen(size, samples, pixels)


class Offscreen:
    """Draws one renderer, lit."""

    def __init__(self, size: tuple[int, int], samples: int = 0, pixels: int = 1) -> None:
        prepare_offscreen()
        self.renderer = lit_renderer()
        self.size = size
        self.render_window = _window(size, samples, pixels)
        self.render_window.AddRenderer(self.renderer)
        # New memory for each frame would have to be cleared first.
        self._pixels, self._depths = vtkUnsignedCharArray(), (vtkFloatArray(), vtkFloatArray())
        #: Draws over all else; None while nothing is to be.
        self.front: vtkRenderer | None = None

    def add_in_front(self, prop: vtkProp) -> None:
        """Add what is drawn over all else, wherever it stands."""
        if self.front is None:
            self.front = front_of(self.render_window, self.renderer)
        self.front.AddViewProp(prop)

    def leave_background(self) -> None:
        """Draw no background: where nothing is, a pixel is covered by nothing."""
        self.renderer.GradientBackgroundOff()
        self.renderer.SetBackground(0.0, 0.0, 0.0)
        self.renderer.SetBackgroundAlpha(0.0)

    def take_samples(self, samples: int) -> None:
        """Take so many samples of each pixel."""
        self.render_window.SetMultiSamples(samples)

    @property
    def camera(self) -> vtkCamera:
        """What the picture is seen through."""
        return self.renderer.GetActiveCamera()

    def draw(self) -> Bytes:
        """Draw."""
        self.renderer.ResetCameraClippingRange()
        self.render()
        return self.pixels()

    def render(self, front: bool = True, over: bool = False) -> None:
        """Draw within the camera's present range, over what was drawn before or in place of it."""
        if self.front is not None:
            self.front.SetDraw(front)
        self.renderer.SetPreserveColorBuffer(over)
        self.renderer.SetPreserveDepthBuffer(over)
        # One sample a pixel is read where it is drawn, and copied nowhere.
        self.render_window.SetSwapBuffers(self._sampled)
        self.render_window.Render()

    def pixels(self) -> Bytes:
        """Return red, green, blue, and how much is covered; until it is asked for again."""
        width, height = self.size
        # Of several from the buffer in front: the one behind holds all, and whoever reads it gets a
        # plain mean of them.
        front = self._sampled
        self.render_window.GetRGBACharPixelData(0, 0, width - 1, height - 1, front, self._pixels, 0)
        return vtk_to_numpy(self._pixels).reshape(height, width, 4)[::-1]

    def depths(self, over: bool = False) -> Singles:
        """Return OpenGL's depths, 1 where nothing is; until they are asked for again."""
        width, height = self.size
        self.render_window.GetZbufferData(0, 0, width - 1, height - 1, self._depths[over])
        return vtk_to_numpy(self._depths[over]).reshape(height, width)[::-1]

    @property
    def _sampled(self) -> bool:
        return self.render_window.GetMultiSamples() > 1

    def close(self) -> None:
        """Free the window."""
        self.render_window.Finalize()


def _window(size: tuple[int, int], samples: int, pixels: int) -> vtkRenderWindow:
    with silent_vtk() as said:
        window = vtkRenderWindow()
    if "OSMesa not found" in said.GetOutput():  # the last that it tries; it would crash
        raise MissingLibraryError(NO_DRIVER, cure=DRIVERS)
    window.SetOffScreenRendering(True)
    if hasattr(window, "SetConnectContextToNSView"):
        # macOS: otherwise a window is made, though nothing shows it.
        window.SetConnectContextToNSView(False)
    window.SetMultiSamples(samples)
    window.SetAlphaBitPlanes(True)
    window.SetSize(*size)
    window.SetDPI(72 * pixels)
    return window
