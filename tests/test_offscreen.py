"""Edges of what is drawn offscreen are means of the colours on both sides."""

from __future__ import annotations

import numpy as np
from vtkmodules.vtkFiltersSources import vtkPlaneSource
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from spacemap_vtk.draw.graphics import prepare_offscreen
from spacemap_vtk.draw.offscreen import OffscreenWindow

COLOR = 0.8, 0.4, 0.2


def square(color: tuple[float, float, float], half: float, height: float) -> vtkActor:
    """Return a square that is turned a little, so that its edges cut pixels."""
    source, mapper, actor = vtkPlaneSource(), vtkPolyDataMapper(), vtkActor()
    source.SetOrigin(-half, -0.9 * half, height)
    source.SetPoint1(half, -half, height)
    source.SetPoint2(-0.9 * half, half, height)
    mapper.SetInputConnection(source.GetOutputPort())
    actor.SetMapper(mapper)
    actor.GetProperty().LightingOff()
    actor.GetProperty().SetColor(*color)
    return actor


def draw(*actors: vtkActor) -> np.ndarray:
    prepare_offscreen()
    window = OffscreenWindow((60, 60), samples=4)
    window.hide_background()
    for actor in actors:
        window.renderer.AddActor(actor)
    window.renderer.ResetCamera(-1, 1, -1, 1, 0, 0.1)
    pixels = window.draw().astype(np.float64) / 255
    window.close()
    return pixels


def test_edges_are_as_bright_as_their_coverage() -> None:
    pixels = draw(square(COLOR, 0.5, 0.0))
    cover = pixels[..., 3]
    assert ((cover > 0.0) & (cover < 1.0)).sum() > 20
    np.testing.assert_allclose(pixels[..., :3], cover[..., None] * COLOR, atol=1.5 / 255)


def test_edges_before_a_translucent_surface_of_their_colour_do_not_show() -> None:
    behind = square(COLOR, 0.9, 0.0)
    behind.ForceTranslucentOn()
    pixels = draw(square(COLOR, 0.5, 0.1), behind)[15:45, 15:45]
    np.testing.assert_allclose(pixels, np.broadcast_to([*COLOR, 1.0], pixels.shape), atol=1.5 / 255)
