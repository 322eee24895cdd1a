"""Surfaces of obstacles: their shapes against distances, and how pictures show them."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from scipy.spatial import cKDTree
from test_every_format import usd_points

from spacemap_vtk import ModalSolver, TetraCage, WeaveSource, connect
from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.draw.actors.obstacle_shading import (
    exposure,
    sample_surface,
    smooth_over_edges,
)
from spacemap_vtk.draw.obstacles import show_obstacles
from spacemap_vtk.draw.picture import Picture, motion_extent
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.obstacle_surfaces import ObstacleSurfaces, obstacle_surfaces
from spacemap_vtk.filters.patch_tessellator import LOOK
from spacemap_vtk.jobs import make_data_job
from spacemap_vtk.mechanics.contact.obstacles import Cylinder, Obstacle, Plane, RoundedBox, Sphere
from spacemap_vtk.mechanics.contact.surfaces import (
    Surface,
    box_surface,
    plane_surface,
    turned_surface,
)
from spacemap_vtk.scenes.figure_list import contact_figures
from spacemap_vtk.scenes.report import report_modes
from spacemap_vtk.scenes.scene import Scene

# Most tests need the same modes.
pytestmark = pytest.mark.usefixtures("kept_modes")

SIZE, EDGE = (1.0, 0.8, 0.6), 0.1
BODIES: list[tuple[Surface, Obstacle, float]] = [
    (turned_surface(0.5, 1.0, 0.5), Sphere(0.5), 4 / 3 * math.pi * 0.5**3),
    (turned_surface(0.5, 0.9, 0.0), Cylinder(0.5, 0.9), math.pi * 0.25 * 0.9),
    (turned_surface(0.5, 0.2, 0.05), Cylinder(0.5, 0.2, 0.05), math.nan),
    # Steiner's formula: the core and its faces, edges and corners thickened by the rounding.
    (
        box_surface(SIZE, EDGE),
        RoundedBox(SIZE, EDGE),
        0.8 * 0.6 * 0.4
        + 2 * EDGE * (0.48 + 0.32 + 0.24)
        + math.pi * EDGE**2 * 1.8
        + 4 / 3 * math.pi * EDGE**3,
    ),
    (box_surface(SIZE, 0.0), RoundedBox(SIZE), 0.48),
    (plane_surface(2.0, 8), Plane(), 0.0),
]


def volume(surface: Surface) -> float:
    """Return the volume that triangles enclose, by Gauss's theorem."""
    a, b, c = (surface.points[corners] for corners in surface.triangles.T)
    return float(np.einsum("nk,nk->", a, np.cross(b, c))) / 6


@pytest.mark.parametrize(
    ("surface", "body", "enclosed"), BODIES, ids=["ball", "can", "disc", "box", "sharp", "plane"]
)
def test_surfaces_lie_on_their_bodies_and_face_outwards(
    surface: Surface, body: Obstacle, enclosed: float
) -> None:
    assert abs(body.gap(surface.points)).max() < 1e-12
    above = body.distance(surface.points + 1e-3 * surface.normals)
    assert above.gap == pytest.approx(1e-3)
    a, b, c = (surface.points[corners] for corners in surface.triangles.T)
    across = np.cross(b - a, c - a)
    assert (np.einsum("nk,nk->n", across, surface.normals[surface.triangles[:, 0]]) > 0).all()
    if not math.isnan(enclosed):
        assert volume(surface) == pytest.approx(enclosed, rel=2e-3)


def test_exposure_under_a_disc_is_that_of_the_closed_form() -> None:
    # Of the light on a level point, a disc of radius R at the height h above it hides the share
    # R²/(R² + h²) (Nusselt).
    radius = 1.0
    disc, spacing = sample_surface(pv.Disc(inner=0, outer=radius, r_res=20, c_res=60))
    for height in (0.3, 1.0, 3.0):
        point = np.array([[0.0, 0.0, -height]])
        found = exposure(point, np.array([[0.0, 0.0, 1.0]]), disc, spacing, 600)
        assert found[0] == pytest.approx(1 - radius**2 / (radius**2 + height**2), abs=0.03)
    aside = exposure(np.array([[5.0, 0.0, 0.5]]), np.array([[0.0, 0.0, 1.0]]), disc, spacing)
    assert aside[0] == 1.0


@pytest.mark.parametrize("surface", [turned_surface(0.5, 4.0, 0.1), box_surface(SIZE, EDGE)])
def test_shade_has_no_seam_where_points_of_a_surface_coincide(surface: Surface) -> None:
    shade = smooth_over_edges((surface.points[:, 0] > surface.points[:, 2]) * 1.0, surface)
    places = np.hstack([surface.points, surface.normals])
    apart = [abs(shade[i] - shade[j]) for i, j in cKDTree(places).query_pairs(1e-9)]
    assert len(apart) > 100
    assert max(apart) < 1e-12
    assert np.unique(np.round(shade, 6)).size > 10  # it is smoothed


#: A square of cloth on a round table, with the ground below.
TABLE: dict[str, Any] = {
    "weave": {
        "ends": 12,
        "picks": 12,
        **{f"{family}_spacing": "10 mm" for family in ("warp", "weft")},
        **{f"{family}_diameter": "5 mm" for family in ("warp", "weft")},
    },
    "cage": {"divisions": [6, 6, 1]},
    "modal": {
        "elements": "sheet",
        "fixed": "",
        "modes": 1,
        "gravity": [0.0, 0.0, -9.81],
        "bending_rigidity": "10 uN.m",
        "tensile_rigidity": "1 kN/m",
        "areal_mass": "0.15 kg/m2",
        "obstacles": [
            {"shape": "disc", "radius": "40 mm", "center": [0, 0, "-20 mm"], "friction": 0.3},
            {"shape": "plane", "center": [0, 0, "-90 mm"]},
        ],
    },
    "response": {},
    "surface": {"subdivisions": 1},
    "view": {"camera": "lying"},
}


def table(**view: Any) -> Scene:
    return Scene({**TABLE, "view": {**TABLE["view"], **view}})


def draw(scene: Scene, size: tuple[int, int] = (240, 180)) -> np.ndarray:
    picture = Picture(scene, [0.0], size)
    image = picture.draw(0.0).astype(int)
    picture.close()
    return image


def test_obstacles_are_drawn_and_can_be_hidden() -> None:
    hidden = table(obstacles=False)
    seen, bare = draw(table()), draw(hidden)
    assert (abs(seen - bare).max(axis=2) > 8).mean() > 0.2  # the ground, behind all else
    assert hidden.view.obstacles is False


@pytest.mark.nightly
def test_the_ground_is_dark_under_the_cloth_and_does_not_move_the_camera() -> None:
    scene = table()
    scene.update(0.0)
    shown = show_obstacles(scene.deformed_cage, scene.polygons)
    assert shown is not None
    light = np.asarray(pv.wrap(shown.planes)[LOOK])[:, 0]
    away = np.hypot(*points_of(shown.planes)[:, :2].T)
    assert light[away < 0.03].max() < 0.6
    assert light[away > 0.25].min() > 0.95
    with_ground = motion_extent(scene, [0.0])[0]
    scene.assign("modal", "obstacles", TABLE["modal"]["obstacles"][:1])
    assert np.ptp(with_ground, axis=0) == pytest.approx(
        np.ptp(motion_extent(scene, [0.0])[0], axis=0), rel=0.01
    )


def test_a_body_does_not_show_through_cloth_that_dips_into_it() -> None:
    scene = table()
    scene.update(0.0)
    cloth = pv.wrap(scene.polygons).copy()
    on_top = np.hypot(*cloth.points[:, :2].T) < 0.035
    cloth.points[:, 2] -= cloth.points[on_top, 2].min() + 0.0203  # 0.3 mm below the table's top
    shown = show_obstacles(scene.deformed_cage, cloth, shadows=False)
    assert shown is not None
    top = points_of(shown.bodies)[:, 2].max()
    assert -0.0205 < top < cloth.points[on_top, 2].min()


def test_mesh_whose_triangles_face_inwards_becomes_a_surface_that_faces_outwards(
    tmp_path: Path,
) -> None:
    cube = pv.Cube(x_length=0.02, y_length=0.02, z_length=0.02).triangulate()
    cube.flip_faces().save(tmp_path / "cube.ply")
    obstacle = {"shape": "mesh", "file": str(tmp_path / "cube.ply"), "center": [0, 0, -0.05]}
    solver = ModalSolver(obstacles=[obstacle], hang=False, modes=1)
    connect(WeaveSource(), TetraCage(), solver).update()
    ((_, surface),) = obstacle_surfaces(solver.output)
    assert volume(surface) == pytest.approx(0.02**3, rel=1e-6)
    away = surface.points - [0, 0, -0.05]
    assert (np.einsum("nk,nk->n", away, surface.normals) > 0).all()
    (term,) = solver._model.terms
    assert term.obstacle.gap(np.array([[0, 0, -0.05], [0, 0, -0.03]])) == pytest.approx(
        [-0.01, 0.01], abs=5e-4
    )


@pytest.mark.nightly
def test_each_shape_has_a_surface_at_its_place(tmp_path: Path) -> None:
    pv.Sphere(radius=0.002, theta_resolution=20, phi_resolution=20).save(tmp_path / "ball.stl")
    center = [0.001, 0.002, -0.02]
    shapes: list[dict[str, Any]] = [
        {"shape": "plane", "normal": [0, 0.1, 1]},
        {"shape": "sphere", "radius": "2 mm"},
        {"shape": "cylinder", "radius": "1 mm", "height": "9 mm", "axis": [1, 1, 0]},
        {"shape": "box", "size": ["2 mm", "3 mm", "4 mm"], "axis": [1, 0, 1]},
        {"shape": "disc", "radius": "3 mm", "axis": [0, 1, 1]},
        {"shape": "mesh", "file": str(tmp_path / "ball.stl")},
    ]
    obstacles = [{**shape, "center": center} for shape in shapes]
    solver = ModalSolver(obstacles=obstacles, gravity=(0, 0, -9.81), modes=1)
    stage = connect(WeaveSource(), TetraCage(), solver, ObstacleSurfaces()).update()
    found = pv.wrap(stage.output)
    assert found.cell_data["obstacle"].max() == len(shapes) - 1
    terms = solver._model.terms  # the bodies that the cage meets
    for (shape, surface), term in zip(obstacle_surfaces(solver.output), terms, strict=True):
        most = 1e-4 if shape == "mesh" else 1e-9
        assert abs(term.obstacle.gap(surface.points)).max() < most, shape


def test_files_that_show_a_scene_have_the_obstacles(tmp_path: Path) -> None:
    scene = table()
    faces = {}
    for name in ("with.ply", "without.ply", "moving.glb", "modes.glb"):
        scene.assign("view", "obstacles", name != "without.ply")
        kind = {".ply": "painted"}.get(name[-4:], "modes" if name == "modes.glb" else "")
        job = make_data_job(tmp_path / name, kind)
        job.run(scene)
        read = pv.read(tmp_path / name)
        if isinstance(read, pv.MultiBlock):
            read = read.combine(merge_points=False).extract_surface(algorithm=None)
        faces[name] = read.n_points
        # Of the ground a square is written, six times as wide as the half diagonal of the cloth.
        assert (read.length > 0.5) == (name != "without.ply"), name
    disc, ground = (part for _, part in obstacle_surfaces(scene.deformed_cage))
    assert faces["with.ply"] - faces["without.ply"] == len(disc.points) + len(ground.points)


@pytest.mark.parametrize(
    "name",
    [
        "cloth.obj",
        *(pytest.param(f"cloth.{k}", marks=pytest.mark.nightly) for k in ("usdc", "html")),
    ],
)
def test_other_files_that_show_a_scene_have_the_ground(name: str, tmp_path: Path) -> None:
    reaches = []
    for shown in (True, False):
        job = make_data_job(tmp_path / name, "painted" if name == "cloth.obj" else "")
        job.run(table(obstacles=shown))
        reaches.append(_read_size(tmp_path / name))
    # The cloth is 12 cm wide, the ground six times as wide as its half diagonal.
    assert reaches[0] > 0.5
    assert reaches[1] < 0.15


def _read_size(file: Path) -> float:
    """Return the width of what a file shows [m]."""
    if file.suffix == ".html":  # its figures, as a page prints them
        (width,) = re.findall(
            r'"([\d.]+) \\u00d7 [\d.]+ \\u00d7 [\d.]+ mm"', file.read_text("utf-8")
        )
        return float(width) / 1000
    points = usd_points(file) if file.suffix == ".usdc" else pv.read(file).points
    return float(np.ptp(points[:, 0]))


@pytest.mark.parametrize("ending", [".ply", ".stl"])
def test_meshes_of_obstacles_are_those_of_the_stage(ending: str, tmp_path: Path) -> None:
    scene = table()
    make_data_job(tmp_path / f"table{ending}", "obstacles").run(scene)
    found = pv.read(tmp_path / f"table{ending}")
    parts = [part for _, part in obstacle_surfaces(scene.deformed_cage)]
    assert found.n_cells == sum(len(part.triangles) for part in parts)
    points = np.concatenate([part.points for part in parts])
    ends = np.stack([points.min(axis=0), points.max(axis=0)])
    assert pytest.approx(ends, abs=1e-6) == np.reshape(found.bounds, (3, 2)).T


def test_surfaces_of_obstacles_are_written_by_themselves(tmp_path: Path) -> None:
    file = tmp_path / "table.vtp"
    make_data_job(file, "obstacles").run(table())
    found = pv.read(file)
    top = found.threshold([0, 0], scalars="obstacle")
    # The table's radius, and its top face.
    assert top.bounds == pytest.approx((-0.04, 0.04, -0.04, 0.04, -0.024, -0.02), abs=1e-6)
    scene = Scene({"weave": {"ends": 2, "picks": 2}, "response": {}})
    with pytest.raises(InputError, match="the scene has no obstacles"):
        make_data_job(file, "obstacles").run(scene)


def test_the_report_says_that_friction_depends_on_the_path() -> None:
    for friction, sticks in ((0.3, True), (0.0, False)):
        scene = table()
        disc, plane = TABLE["modal"]["obstacles"]
        scene.assign("modal", "fixed", "box(-1 mm, 1 mm, -1 mm, 1 mm, -1, 1)")
        scene.assign("modal", "obstacles", [{**disc, "friction": friction}, plane])
        figures = {each.key: each for each in contact_figures(report_modes(scene))}
        assert ("contact_path" in figures) == sticks
        assert figures["contact_1"].text == "none, nothing touches it"
