"""Draw offscreen with OpenGL, and read colours and depths as arrays; needs only VTK."""

from __future__ import annotations

from typing import TYPE_CHECKING

# VTK finds its implementations of rendering and text only after these modules are imported.
import vtkmodules.vtkRenderingFreeType
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkFloatArray, vtkUnsignedCharArray
from vtkmodules.vtkRenderingCore import vtkCamera, vtkProp, vtkRenderer, vtkRenderWindow

from spacemap_vtk.datasets.vtk_messages import capture_vtk_messages
from spacemap_vtk.draw.camera import add_front_renderer, make_renderer
from spacemap_vtk.draw.graphics import (
    INSTALL_DRIVERS,
    NO_DRIVER,
    prepare_offscreen,
    uses_software_renderer,
)
from spacemap_vtk.errors import MissingLibraryError
from spacemap_vtk.ndarrays import Bytes, Singles

if TYPE_CHECKING:
    from spacemap_vtk.draw.software.window import SoftwareWindow


def open_offscreen(
    size: tuple[int, int], samples: int = 0, pixels: int = 1
) -> OffscreenWindow | SoftwareWindow:
    """Open an offscreen window; it draws without OpenGL if OpenGL's libraries are missing."""
    if uses_software_renderer():
        from spacemap_vtk.draw.software.window import SoftwareWindow

        return SoftwareWindow(size, samples, pixels)
    return OffscreenWindow(size, samples, pixels)


class OffscreenWindow:
    """An offscreen window that draws one renderer with lights."""

    def __init__(self, size: tuple[int, int], samples: int = 0, pixels: int = 1) -> None:
        prepare_offscreen()
        self.renderer = make_renderer()
        self.size = size
        self.render_window = _make_window(size, samples, pixels)
        self.render_window.AddRenderer(self.renderer)
        # The arrays are reused: new memory for each frame would have to be cleared first.
        self._pixels, self._depths = vtkUnsignedCharArray(), (vtkFloatArray(), vtkFloatArray())
        #: Renderer that draws in front of everything else; None until it is needed.
        self.front: vtkRenderer | None = None

    def add_front_prop(self, prop: vtkProp) -> None:
        """Add a prop that is drawn in front of everything else."""
        if self.front is None:
            self.front = add_front_renderer(self.render_window, self.renderer)
        self.front.AddViewProp(prop)

    def hide_background(self) -> None:
        """Draw no background, so that empty pixels have a coverage of 0."""
        self.renderer.GradientBackgroundOff()
        self.renderer.SetBackground(0.0, 0.0, 0.0)
        self.renderer.SetBackgroundAlpha(0.0)

    def set_samples(self, samples: int) -> None:
        """Set the number of samples of each pixel."""
        self.render_window.SetMultiSamples(samples)

    @property
    def camera(self) -> vtkCamera:
        """The active camera."""
        return self.renderer.GetActiveCamera()

    def draw(self) -> Bytes:
        """Draw the renderer and return red, green, blue and coverage of each pixel."""
        self.renderer.ResetCameraClippingRange()
        self.render()
        return self.pixels()

    def render(self, front: bool = True, keep: bool = False) -> None:
        """Draw with the camera's current clipping range; `keep` keeps what was drawn before."""
        if self.front is not None:
            self.front.SetDraw(front)
        self.renderer.SetPreserveColorBuffer(keep)
        self.renderer.SetPreserveDepthBuffer(keep)
        # With one sample per pixel, the picture is read from the buffer in which it is drawn, so no
        # swap is needed.
        self.render_window.SetSwapBuffers(self._is_multisampled)
        self.render_window.Render()

    def pixels(self) -> Bytes:
        """Return red, green, blue and coverage of each pixel; the next call overwrites them."""
        # With several samples, the front buffer has the means of their light, and the back buffer
        # of their colours. Only the latter are proportional to the coverage: edges would otherwise
        # be too bright over a background.
        pixels = self._read(self._pixels, self._is_multisampled)
        if self._is_multisampled:
            edges = (pixels[..., 3] > 0) & (pixels[..., 3] < 255)
            if edges.any():
                pixels[edges] = self._read(vtkUnsignedCharArray(), False)[edges]
        return pixels

    def _read(self, pixels: vtkUnsignedCharArray, front: bool) -> Bytes:
        """Read the colours of a buffer."""
        width, height = self.size
        self.render_window.GetRGBACharPixelData(0, 0, width - 1, height - 1, front, pixels, 0)
        return vtk_to_numpy(pixels).reshape(height, width, 4)[::-1]

    def depths(self, second: bool = False) -> Singles:
        """Return OpenGL's depths, 1 where empty, in an array that is reused for each `second`."""
        width, height = self.size
        self.render_window.GetZbufferData(0, 0, width - 1, height - 1, self._depths[second])
        return vtk_to_numpy(self._depths[second]).reshape(height, width)[::-1]

    @property
    def _is_multisampled(self) -> bool:
        return self.render_window.GetMultiSamples() > 1

    def close(self) -> None:
        """Close the window and free its resources."""
        self.render_window.Finalize()


def _make_window(size: tuple[int, int], samples: int, pixels: int) -> vtkRenderWindow:
    with capture_vtk_messages() as messages:
        window = vtkRenderWindow()
    if "OSMesa not found" in messages.GetOutput():  # VTK's last attempt failed, and it would crash
        raise MissingLibraryError(NO_DRIVER, cure=INSTALL_DRIVERS)
    window.SetOffScreenRendering(True)
    if hasattr(window, "SetConnectContextToNSView"):
        # On macOS, a window would be created otherwise, although it is never shown.
        window.SetConnectContextToNSView(False)
    window.SetMultiSamples(samples)
    window.SetAlphaBitPlanes(True)
    window.SetSize(*size)
    window.SetDPI(72 * pixels)
    return window
