"""Depth of field: blur as large as geometrical optics says, and none in the plane of focus."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from vtkmodules.vtkFiltersSources import vtkPlaneSource
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from spacemap_vtk.draw.camera import Viewpoint
from spacemap_vtk.draw.depth_of_field import (
    focus_distance,
    lens_points,
    mean_over_lens,
    point_in_middle,
)
from spacemap_vtk.draw.offscreen import OffscreenWindow
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.errors import InputError
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.settings import View

SIZE = 300, 200
#: Distance of the camera from the edge that it sees, in m.
DISTANCE = 2.0


def edge_through_lens(view: View) -> NDArray[np.float64]:
    """Return the light across the edge of a white half plane at x = 0, z = 0, in a middle row."""
    window = OffscreenWindow(SIZE)
    source, mapper, actor = vtkPlaneSource(), vtkPolyDataMapper(), vtkActor()
    source.SetOrigin(0.0, -5.0, 0.0)
    source.SetPoint1(5.0, -5.0, 0.0)
    source.SetPoint2(0.0, 5.0, 0.0)
    mapper.SetInputConnection(source.GetOutputPort())
    actor.SetMapper(mapper)
    actor.GetProperty().LightingOff()
    window.renderer.AddActor(actor)
    Viewpoint((0.0, 0.0, DISTANCE), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)).apply_to(window.camera)

    def draw(place: Callable[[], None]) -> NDArray[np.uint8]:
        place()
        return window.draw()[..., :3].copy()

    picture = mean_over_lens(window.camera, view, SIZE, draw)
    assert window.camera.GetWindowCenter() == (0.0, 0.0)
    assert window.camera.GetPosition() == (0.0, 0.0, DISTANCE)
    window.close()
    return np.square(picture[SIZE[1] // 2, :, 0] / 255.0)


def test_points_of_a_lens_have_the_moments_of_a_disc() -> None:
    points = lens_points(64)
    assert np.abs(points.mean(axis=0)).max() < 0.01
    assert points.T @ points / len(points) == pytest.approx(np.eye(2) / 4, abs=0.01)


@pytest.mark.parametrize("focus", [0.5, 0.0, -0.4])
def test_an_edge_is_blurred_over_the_circle_of_confusion(focus: float) -> None:
    view = View(aperture=0.2, focus=(0.3, 0.1, focus))
    light = edge_through_lens(view)
    pixel = 2 * DISTANCE * np.tan(np.radians(12.0)) / SIZE[1]
    places = pixel * (np.arange(SIZE[0] - 1) + 1 - SIZE[0] / 2)
    spread = np.diff(light)
    assert spread.sum() == pytest.approx(1.0, abs=0.01)
    assert places @ spread == pytest.approx(0.0, abs=pixel)
    # A disc of diameter c has a variance of c²/16 along each axis.
    circle = view.aperture * abs(focus)
    variance = (places - places @ spread) ** 2 @ spread
    assert variance == pytest.approx(circle**2 / 16, rel=0.05, abs=0.3 * pixel**2)


def test_a_focus_behind_the_camera_is_refused() -> None:
    here = Viewpoint((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    assert focus_distance(here, None) == pytest.approx(1.0)
    assert focus_distance(here, (5.0, 0.0, -1.0)) == pytest.approx(2.0)
    with pytest.raises(InputError, match="behind the camera"):
        focus_distance(here, (0.0, 0.0, 2.0))


def test_the_nearest_cloth_in_the_middle_of_the_picture_is_sharp() -> None:
    here = Viewpoint((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 201), np.linspace(-1.0, 1.0, 201))
    # A slope that rises by 0.5 at x = 0, in front of a level plane; what is nearer is aside.
    levels = [0.5 + 0.4 * x, 0.0 * x, np.full_like(x, 5.0)]
    points = np.concatenate([np.stack([x, y, z], axis=-1).reshape(-1, 3) for z in levels])
    assert point_in_middle(here, points) == pytest.approx([0.0, 0.0, 0.5], abs=0.02)
    aside = points[points[:, 0] > 0.5]
    assert point_in_middle(here, aside)[0] == pytest.approx(0.51, abs=0.02)


def test_a_camera_without_perspective_warns_that_it_has_no_depth_of_field() -> None:
    weave = {"ends": 2, "picks": 2}
    scene = Scene({"weave": weave, "view": {"camera": "face", "aperture": 0.1}})
    Picture(scene, [0.0], (32, 32)).close()
    assert any("without perspective" in text for text in scene.warnings)
