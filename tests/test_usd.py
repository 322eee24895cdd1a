"""Universal Scene Description files, read by Pixar's library."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.draw.morph_surface import make_mode_surface, make_moving_surface
from spacemap_vtk.io.registry import writer
from spacemap_vtk.scenes.scene import Scene

usd, usd_geom = (pytest.importorskip(f"pxr.{name}") for name in ("Usd", "UsdGeom"))
SMALL = {"weave": {"ends": 3, "picks": 4}, "surface": {"subdivisions": 2}}


def deformed_points(stage: Any, second: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of the mesh and the weights of its blend shapes at a time."""
    from pxr import UsdSkel, Vt

    mesh = usd_geom.Mesh(stage.GetPrimAtPath("/Cloth/Surface"))
    cache, root = UsdSkel.Cache(), UsdSkel.Root(stage.GetDefaultPrim())
    cache.Populate(root, usd.PrimDefaultPredicate)
    (binding,) = cache.ComputeSkelBindings(root, usd.PrimDefaultPredicate)
    skeleton = cache.GetSkelQuery(binding.GetSkeleton())
    (skinned,) = binding.GetSkinningTargets()
    code = second * stage.GetTimeCodesPerSecond()
    weights = skeleton.GetAnimQuery().ComputeBlendShapeWeights(code)
    query = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(mesh))
    subs = query.ComputeSubShapeWeights(skinned.GetBlendShapeMapper().Remap(weights))
    points = Vt.Vec3fArray(mesh.GetPointsAttr().Get())
    offsets, indices = query.ComputeSubShapePointOffsets(), query.ComputeBlendShapePointIndices()
    assert query.ComputeDeformedPoints(*subs, indices, offsets, points)
    return np.array(points), np.array(weights)


def curve_samples(stage: Any, second: float) -> np.ndarray:
    """Return many points of the yarn curves, computed with Bernstein polynomials."""
    curves = usd_geom.BasisCurves(stage.GetPrimAtPath("/Cloth/Yarns"))
    points = np.array(curves.GetPointsAttr().Get(second * stage.GetTimeCodesPerSecond()), float)
    assert set(curves.GetWidthsAttr().Get()) == {np.float32(0.25e-3)}
    u = np.linspace(0.0, 1.0, 33)
    basis = np.stack([(1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u**2 * (1 - u), u**3], axis=1)
    lines = np.split(points, np.cumsum(curves.GetCurveVertexCountsAttr().Get())[:-1])
    assert len(lines) == 7
    parts = [line[k : k + 4] for line in lines for k in range(0, len(line) - 1, 3)]
    return np.concatenate([basis @ part for part in parts])


def test_blend_shapes_give_the_same_points(tmp_path: Path) -> None:
    values = {**SMALL, "modal": {"youngs_modulus": 500}, "response": {}}
    scene, times = Scene(values), np.linspace(0.0, 0.1, 6)
    made = make_moving_surface(scene, times.tolist(), 1e-6, lambda done, of: None)
    for file in (tmp_path / "a.usdc", tmp_path / "a.usda"):
        writer(file).write(file, made)
        stage = usd.Stage.Open(str(file))
        assert stage.GetFramesPerSecond() == pytest.approx(50.0)
        for number in (0, 2, 5):
            points, weights = deformed_points(stage, times[number])
            np.testing.assert_allclose(weights, made.clips[0].weights[number], atol=1e-7)
            scene.update(times[number])
            surface = points_of(scene.polygons)
            assert cKDTree(points).query(surface)[0].max() < 1.01e-6
            off = cKDTree(curve_samples(stage, times[number])).query(surface)[0]
            inside = off < 0.9 * 0.125e-3  # on the caps of 14 ends
            assert inside.sum() == 4 * 14
            np.testing.assert_allclose(off[~inside], 0.125e-3, rtol=0.1)
    assert np.ptp(points, axis=0).max() > 1e-3


def test_each_mode_is_a_variant(tmp_path: Path) -> None:
    scene = Scene({**SMALL, "modal": {"modes": 3}, "response": {}, "view": {"camera": "lying"}})
    made, file = make_mode_surface(scene, lambda done, of: None), tmp_path / "a.usdc"
    writer(file).write(file, made)
    stage = usd.Stage.Open(str(file))
    choice = stage.GetDefaultPrim().GetVariantSet("motion")
    for number in range(3):
        choice.SetVariantSelection(f"motion_{number}")
        points, _ = deformed_points(stage, 0.3)  # a swing takes 1.2 s
        np.testing.assert_allclose(points, made.points + made.targets[number], atol=1e-9)
    assert usd_geom.GetStageUpAxis(stage) == "Z"
    assert usd_geom.GetStageMetersPerUnit(stage) == 1.0


def test_plies_and_fibres_are_splines_inside_their_yarns(tmp_path: Path) -> None:
    weave = {"ends": 2, "picks": 3, "warp_plies": 2, "warp_twist": "S 900", "weft_twist": "Z 400"}
    scene = Scene({"weave": weave, "surface": {"subdivisions": 2}})
    axes = make_moving_surface(scene, [0.0], None, lambda done, of: None).curves
    assert axes is not None
    u = np.linspace(0.0, 1.0, 257)
    bezier = np.stack([(1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u**2 * (1 - u), u**3], axis=1)
    middles = [
        np.concatenate([bezier @ line[k : k + 4] for k in range(0, len(line) - 1, 3)])
        for line in np.split(axes.points[0], np.cumsum(axes.counts)[:-1])
    ]
    for strands, strength in (("plies", [2, 2, 1, 1, 1]), ("40", [40] * 5)):
        made = make_moving_surface(scene, [0.0], None, lambda done, of: None, strands=strands)
        writer(file := tmp_path / f"{strands}.usdc").write(file, made)
        stage = usd.Stage.Open(str(file))
        curves = usd_geom.BasisCurves(stage.GetPrimAtPath("/Cloth/Yarns"))
        assert curves.GetBasisAttr().Get() == usd_geom.Tokens.bspline
        points = np.array(curves.GetPointsAttr().Get(), float)
        lines = np.split(points, np.cumsum(curves.GetCurveVertexCountsAttr().Get())[:-1])
        widths = curves.GetWidthsAttr().Get()
        assert len(lines) == len(widths) == sum(strength)
        for line, yarn, width in zip(lines, np.repeat(np.arange(5), strength), widths, strict=True):
            knots = (line[:-2] + 4 * line[1:-1] + line[2:]) / 6
            off = cKDTree(middles[yarn]).query(knots)[0]
            assert off.max() + width / 2 < 1.02 * 0.125e-3
            for end in (0, -1):  # as long as the yarn
                assert np.abs(knots[end] - middles[yarn][end]).max() < 0.126e-3
