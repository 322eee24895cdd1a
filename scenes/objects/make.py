"""Make the meshes of this folder: an animal as a scanner would see it, a lever, tubes, an arm.

The last is the state in which the search of the scene `fold` begins: its cage, folded.

    python scenes/objects/make.py

Everything is drawn by formulas here; nothing is taken from elsewhere.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv
from scipy import ndimage
from scipy.integrate import OdeSolution, solve_ivp
from scipy.optimize import root

from spacemap_vtk.scenes.scene import Scene

HERE = Path(__file__).parent


def contour(field: np.ndarray, origin: np.ndarray, step: float) -> pv.PolyData:
    """Return where a field sampled on a grid, first index x, is zero."""
    image = pv.ImageData(dimensions=field.shape, spacing=(step,) * 3, origin=origin)
    image["f"] = field.ravel(order="F")
    return image.contour([0.0], scalars="f").clean()


def animal() -> pv.PolyData:
    """Return a cat-like animal of blended balls, 0.4 m long, with a scan's fine bumps and noise."""
    rng = np.random.default_rng(7)
    step = 0.006
    low, high = np.array([-0.29, -0.03, -0.12]), np.array([0.32, 0.40, 0.12])
    x, y, z = np.meshgrid(
        *(np.arange(a, b, step) for a, b in zip(low, high, strict=True)), indexing="ij"
    )
    balls = [(t, 0.20 + 0.02 * np.sin(7 * t), 0, 0.062) for t in np.linspace(-0.12, 0.1, 6)]
    balls += [(0.16, 0.24, 0, 0.045), (0.2, 0.28, 0, 0.058), (0.245, 0.268, 0, 0.03)]
    for side in (-1, 1):
        balls += [(0.185 + 0.008 * t, 0.325 + 0.02 * t, side * 0.034, 0.02) for t in (0, 1)]
        for leg in (-0.12, 0.09):
            balls += [
                (leg + 0.008 * np.sin(3 * t), 0.16 - 0.05 * t, side * 0.045, 0.031)
                for t in np.linspace(0, 2.9, 6)
            ]
    balls += [
        (-0.17 - 0.055 * np.sin(t), 0.21 + 0.045 * t, 0, 0.021) for t in np.linspace(0, 2.4, 9)
    ]
    field = np.zeros_like(x)
    for bx, by, bz, radius in balls:
        field += np.exp(-((x - bx) ** 2 + (y - by) ** 2 + (z - bz) ** 2) / (0.55 * radius**2))
    fur = ndimage.gaussian_filter(rng.normal(size=x.shape), 1.7)
    field += 0.05 * fur / fur.std() * field
    mesh = contour(field - np.exp(-1 / 0.55), low, step).connectivity("largest")
    mesh.clear_data()
    mesh.points = mesh.points + rng.normal(scale=1.5e-4, size=mesh.points.shape)
    px, py, pz = mesh.points.T
    stripes = 0.5 + 0.5 * np.sin(70 * px + 4 * np.sin(18 * py) + 2 * np.sin(30 * pz))
    belly = np.clip((py - 0.13) / 0.08, 0, 1)
    share = (0.35 + 0.65 * (stripes > 0.55)) * belly
    light, dark = np.array([236, 190, 130]), np.array([176, 84, 30])
    mesh["RGB"] = (light + share[:, None] * (dark - light)).astype(np.uint8)
    return mesh


def lever() -> pv.PolyData:
    """Return a forged lever of 0.2 m: two bored eyes and a web between them."""
    step = 0.0032
    low, high = np.array([-0.14, -0.05, -0.02]), np.array([0.12, 0.05, 0.02])
    x, y, z = np.meshgrid(
        *(np.arange(a, b, step) for a, b in zip(low, high, strict=True)), indexing="ij"
    )

    def plate(distance: np.ndarray, half: float) -> np.ndarray:
        return np.maximum(distance, np.abs(z) - half)

    big, small = np.hypot(x + 0.09, y), np.hypot(x - 0.08, y)
    width = 0.014 + 0.01 * np.clip((0.08 - x) / 0.17, 0, 1)
    web = np.maximum(np.abs(y) - width, np.abs(x + 0.005) - 0.085)
    solid = np.minimum(
        plate(web, 0.006), np.minimum(plate(big - 0.04, 0.014), plate(small - 0.026, 0.011))
    )
    solid = np.maximum(solid, np.maximum(0.022 - big, 0.012 - small))
    return contour(solid, low, step)


def tubes() -> pv.PolyData:
    """Return 19 tubes of 0.3 m in hexagonal packing, twisted by a sixth of a turn."""
    radius, parts = 0.008, []
    ring = [(i, j) for i in range(-2, 3) for j in range(-2, 3) if abs(i + j) <= 2]
    along = np.linspace(0, 0.3, 41)
    for number, (i, j) in enumerate(ring):
        away = 2.05 * radius * complex(i + 0.5 * j, j * np.sqrt(3) / 2)
        turned = away * np.exp(1j * np.pi / 3 * along / 0.3)
        line = pv.lines_from_points(np.stack((along, turned.real, turned.imag), axis=1))
        tube = line.tube(radius=radius, n_sides=14).triangulate()
        tube.clear_data()
        hue = np.array([[214, 90, 49], [47, 111, 142], [226, 176, 78]])[(i - j) % 3]
        tube.cell_data["tube"] = np.full(tube.n_cells, number, dtype=np.int32)
        tube.cell_data["color"] = np.tile(hue.astype(np.uint8), (tube.n_cells, 1))
        parts.append(tube)
    return pv.merge(parts, merge_points=False)


def arm() -> pv.PolyData:
    """Return a bent arm of 0.4 m whose elbow is at the origin: cones that blend, and a fist."""
    step = 0.006
    low, high = np.array([-0.25, -0.07, -0.12]), np.array([0.26, 0.14, 0.06])
    grid = np.meshgrid(
        *(np.arange(a, b, step) for a, b in zip(low, high, strict=True)), indexing="ij"
    )
    points = np.stack(grid, axis=-1)
    shoulder, elbow = np.array([-0.18, 0.05, -0.045]), np.zeros(3)
    wrist, fist = np.array([0.17, 0.045, -0.005]), np.array([0.205, 0.055, -0.008])
    distances = []
    for begin, end, first, last in (
        (shoulder, elbow, 0.046, 0.035),
        (elbow, 0.3 * wrist, 0.035, 0.037),
        (0.3 * wrist, wrist, 0.037, 0.023),
        (wrist, fist, 0.026, 0.034),
    ):
        along = end - begin
        share = np.clip((points - begin) @ along / (along @ along), 0, 1)
        away = np.linalg.norm(points - begin - share[..., None] * along, axis=-1)
        distances.append(away - first - share * (last - first))
    blend = 0.006
    field = -blend * np.log(np.exp(-np.stack(distances) / blend).sum(axis=0))
    mesh = contour(field, low, step).smooth_taubin(n_iter=20)
    mesh.clear_data()
    return mesh


def folded_strip() -> pv.UnstructuredGrid:
    """Return the cage of the scene `fold`, and the displacement that lays it on an elastica."""
    scene = Scene.read(HERE.parent / "fold.toml")
    scene.update_stage(scene.cage)
    cage = pv.wrap(scene.cage.output)
    points = cage.points - [cage.bounds[0], 0, cage.center[2]]
    unit, gap = 0.04, 1.75e-3  # of the scene: natural length; above the reach of contact
    front = 3.4 * unit

    def loop(reaction: float, length: float) -> OdeSolution:
        """Solve for angle, curvature, x and z along a loop; its ends pull by half of the gap."""

        def slopes(along: float, state: np.ndarray) -> list[float]:
            angle, bent = state[:2]
            bends = (reaction - along) * np.cos(angle) - gap / unit / 2 * np.sin(angle)
            return [bent, bends, np.cos(angle), np.sin(angle)]

        return solve_ivp(slopes, (0, length), np.zeros(4), rtol=1e-9, dense_output=True).sol

    def misses(guess: np.ndarray) -> np.ndarray:
        return loop(*guess)(guess[1])[:2] - [np.pi, 0.0]

    found = root(misses, [3.745, 4.683]).x
    along = (points[:, 0] - front) / unit
    angle, _, x, z = loop(*found)(np.clip(along, 0, found[1]))
    x += np.minimum(along, 0) - np.maximum(along - found[1], 0)
    above = points[:, 2]
    place = [front + unit * x - above * np.sin(angle), points[:, 1]]
    place = np.stack([*place, unit * z + above * np.cos(angle)], axis=1)
    folded = pv.UnstructuredGrid(cage.cells, cage.celltypes, cage.points)
    folded["displacement"] = place - points
    return folded


if __name__ == "__main__":
    animal().save(HERE / "animal.ply", texture="RGB")
    lever().save(HERE / "lever.stl")
    tubes().save(HERE / "tubes.vtp")
    arm().save(HERE / "arm.ply")
    folded_strip().save(HERE / "folded_strip.vtu")
