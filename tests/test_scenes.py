"""Every scene that comes with the program runs, and a number of it is known from elsewhere."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import contact_scenes
import hung_scenes
import numpy as np
import pytest
import pyvista as pv
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk import SpacemapWarning
from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.datasets.modal_model import sheet_of
from spacemap_vtk.datasets.reactions import reactions_of
from spacemap_vtk.draw.graphics import prepare_offscreen
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.mechanics.boundary import loads
from spacemap_vtk.scenes import library, report
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.weave.double_weave import find_layers
from spacemap_vtk.textile.weave.figures import fabric_figures
from spacemap_vtk.units import GRAVITY

ROOT = Path(__file__).parents[1]


def displacement(scene: Scene) -> np.ndarray:
    return vtk_to_numpy(scene.deformed_cage.GetPointData().GetArray("displacement"))


def check_published_experiment(scene: Scene) -> None:
    scene.update(0.0)
    grid = scene.deformed_cage
    assert (grid.GetNumberOfPoints(), grid.GetNumberOfCells()) == (72, 125)
    assert scene.polygons.GetNumberOfCells() == scene.patches.GetNumberOfCells() * 36
    assert np.abs(displacement(scene)).max() == 0.0
    eigenvalues = vtk_to_numpy(grid.GetFieldData().GetArray("eigenvalues"))
    assert len(eigenvalues) == 180
    # Half a period of the first mode later the sheet has swung to nearly twice its static sag;
    # gravity's work on the way equals the strain energy but for the damping (alpha / 2 omega).
    half = math.pi / math.sqrt(eigenvalues[0])
    scene.update(half)
    swung = displacement(scene)[:, 2].max()
    scene.response.configure(initial="equilibrium")
    scene.update()
    static = displacement(scene)[:, 2].max()
    decay = math.exp(-scene.response.alpha / 2 * half)
    assert swung / static == pytest.approx(1 + decay, rel=0.03)


def measure_half_period(scene: Scene) -> tuple[float, float]:
    """Return the largest swing over the static sag, and what a single mode would give."""
    scene.update(0.0)
    omega = math.sqrt(vtk_to_numpy(scene.deformed_cage.GetFieldData().GetArray("eigenvalues"))[0])
    scene.update(math.pi / omega)
    swung = np.linalg.norm(displacement(scene), axis=1).max()
    scene.response.configure(initial="equilibrium")
    scene.update()
    static = np.linalg.norm(displacement(scene), axis=1).max()
    return swung / static, 1 + math.exp(-scene.response.alpha / 2 * math.pi / omega)


def cage_mass(scene: Scene) -> float:
    return float(vtk_to_numpy(scene.deformed_cage.GetPointData().GetArray("nodal_mass")).sum())


def check_soft_animal(scene: Scene) -> None:
    swung, expected = measure_half_period(scene)
    assert swung == pytest.approx(expected, rel=0.1)
    # one piece round the whole animal, and heavier than it, but not by the whole box
    assert not any("pieces" in text or "outside" in text for text in scene.warnings)
    own = pv.wrap(scene.source.GetOutputDataObject(0)).volume * scene.modal.density
    assert 1.0 < cage_mass(scene) / own < 2.5


def check_steel_lever(scene: Scene) -> None:
    """fTetWild's mesh differs from run to run; its mass is the part's."""
    scene.update(0.0)
    part = pv.wrap(scene.source.GetOutputDataObject(0))
    assert cage_mass(scene) == pytest.approx(part.volume * scene.modal.density, rel=1e-5)
    outside = re.findall(r"(\d+) of 4022 points", " ".join(scene.warnings))
    assert sum(map(int, outside)) < 0.03 * 4022
    assert np.abs(displacement(scene)).max() == 0.0
    # With edges of 8 mm it rings at 300 Hz, of linear tetrahedra at 560.
    first = scene.deformed_cage.GetFieldData().GetArray("frequencies").GetValue(0)
    assert first == pytest.approx(300.0, rel=0.06)
    # Held so that it cannot turn: it rings, and little more than its first mode.
    swung, expected = measure_half_period(scene)
    assert swung == pytest.approx(expected, rel=0.15)


def check_tube_bundle(scene: Scene) -> None:
    """First frequency of the cage against Euler's cantilever; linear tetrahedra are stiffer."""
    scene.update(0.0)
    x0, x1, y0, y1, z0, z1 = scene.deformed_cage.GetBounds()
    modal = scene.modal
    speed = math.sqrt(modal.youngs_modulus / modal.density)
    slender = min(y1 - y0, z1 - z0) / math.sqrt(12)  # radius of gyration
    euler = 1.875104**2 * slender * speed / (2 * math.pi * (x1 - x0) ** 2)
    first = scene.deformed_cage.GetFieldData().GetArray("frequencies").GetValue(0)
    # shear and rotary inertia take off some percent, the elements put on some more
    assert 0.95 < first / euler < 1.3
    swung, expected = measure_half_period(scene)
    assert swung == pytest.approx(expected, rel=0.1)


def check_calculix_fabric(scene: Scene) -> None:
    scene.update(0.0)
    assert np.abs(displacement(scene)).max() == 0.0
    rest = vtk_to_numpy(scene.patches.GetPoints().GetData()).copy()
    yarn = np.flatnonzero(np.abs(rest[:, 0] - rest[:, 0][np.argmin(np.abs(rest[:, 0]))]) < 1e-9)
    scene.update(0.018)
    moved = vtk_to_numpy(scene.patches.GetPoints().GetData())
    # the raw result, read by pyvista and sampled by VTK at the same places
    raw = pv.read(ROOT / "scenes" / "calculix" / "sheet_09.vtu")
    sampled = pv.PolyData(rest).sample(raw)
    assert sampled["vtkValidPointMask"].all()
    largest = np.abs(raw["U"]).max()
    assert largest > 1e-3  # a third of its length
    assert np.abs(moved - rest - sampled["U"]).max() < 0.03 * largest
    # It has turned and not stretched, which a linear model cannot do.
    top, bottom = yarn[np.argmax(rest[yarn, 1])], yarn[np.argmin(rest[yarn, 1])]
    chord = np.linalg.norm(moved[top] - moved[bottom]) / np.linalg.norm(rest[top] - rest[bottom])
    assert chord == pytest.approx(1.0, abs=0.08)


def check_still_and_feasible(scene: Scene) -> None:
    scene.update()
    assert not scene.moves
    assert scene.polygons.GetNumberOfCells() > 0


def check_gust(scene: Scene) -> None:
    # It hangs exactly as the whole stiffness matrix says, though few of its modes are kept.
    scene.update(0.0)
    model = scene.response.motion.modes.model
    weight = loads.acceleration_forces(model.nodal_mass, [0.0, -9.80665, 0.0])
    back = loads.find_side_faces(model.points, model.cells, "-z", sheet=True)
    flutter = -loads.traction_forces(len(model.points), back, [0.5, 0.0, 0.0])
    hung = model.statics((weight + flutter).ravel())[0].reshape(-1, 3)
    assert len(scene.response.motion.modes.eigenvalues) < model.free.sum() / 5
    np.testing.assert_allclose(displacement(scene), hung, atol=1e-10 * np.abs(hung).max())
    scene.update(0.033)
    assert displacement(scene)[:, 2].max() > 10 * np.abs(hung).max()
    field = scene.deformed_cage.GetFieldData()
    names = ("kinetic_energy", "strain_energy", "dissipated_energy", "external_work")
    *parts, work = (field.GetArray(name).GetValue(0) for name in names)
    assert sum(parts) == pytest.approx(work, rel=1e-10)


def check_twill_of_counted_yarns(scene: Scene) -> None:
    figures = report.report_fabric(scene)
    assert figures["warp"]["tex"] == pytest.approx(30)
    assert figures["weft"]["tex"] == pytest.approx(30)
    assert figures["repeat"] == [4, 4]
    assert figures["warp"]["longest_float"] == figures["weft"]["longest_float"] == 2
    # g/m2 by hand: tex times threads in a cm, a tenth, and what crimp adds to the length
    mass = 0.1 * 30 * (24 * (1 + figures["warp"]["mean_crimp"]))
    mass += 0.1 * 30 * (22 * (1 + figures["weft"]["mean_crimp"]))
    assert 1e3 * figures["areal_mass"] == pytest.approx(mass)
    # as published for cotton: d = 1 / (28 sqrt(Ne)) inch, Ne = 590.5 / tex; the lens has the area
    # of that circle: R² (2φ - sin 2φ), with tan(φ/2) = height / width
    width, height = figures["warp"]["width"], figures["warp"]["diameter"]
    radius, turn = (width**2 + height**2) / (4 * height), 4 * np.arctan(height / width)
    published = 0.0254 / 28 / (590.5 / 30) ** 0.5
    area = radius**2 * (turn - np.sin(turn))
    assert area == pytest.approx(np.pi / 4 * published**2, rel=1e-2)
    assert abs(figures["least_clearance"]["distance"]) < 1e-15


def check_satin(shafts: int, step: int) -> Callable[[Scene], None]:
    def check(scene: Scene) -> None:
        figures = report.report_fabric(scene)
        assert figures["repeat"] == [shafts, shafts]
        assert figures["warp"]["longest_float"] == shafts - 1
        # one binding point in each pick of a repeat, `step` ends further with each pick
        for pick, row in enumerate(figures["drawdown"][:shafts]):
            assert row[:shafts].count("0") == 1
            assert row.index("0") == pick * step % shafts
        assert abs(figures["least_clearance"]["distance"]) < 1e-15

    return check


def check_basket(scene: Scene) -> None:
    figures = report.report_fabric(scene)
    assert figures["drawdown"][0].startswith("1100")
    # a yarn changes side at every other crossing: half of Peirce's crimp, but for the edge
    gaps = figures["picks"] - 1
    assert figures["warp"]["mean_crimp"] == pytest.approx(
        figures["warp"]["crimp"] * (figures["picks"] / 2 - 1) / gaps
    )
    # square cloth: tan(theta / 2) = h / (p + s), s = sqrt(p**2 - h (2 D - h)), h = D / 2
    p, d = 1.4, 1.5
    s = (p * p - 0.75 * d * d) ** 0.5
    theta = math.degrees(2 * math.atan2(d / 2, p + s))
    assert figures["warp"]["theta_deg"] == pytest.approx(theta)


def check_tartan(scene: Scene) -> None:
    cloth = scene.woven.cloth
    assert len(np.unique(cloth.warp.colors, axis=0)) == 4
    np.testing.assert_array_equal(cloth.warp.colors[0], cloth.warp.colors[14])
    thick = np.flatnonzero(np.asarray(cloth.warp.diameter) > 0.3e-3)
    np.testing.assert_array_equal(thick, [13, 27, 41, 55])
    assert abs(report.report_fabric(scene)["least_clearance"]["distance"]) < 1e-15


def check_real_draft(scene: Scene) -> None:
    figures = report.report_fabric(scene)
    assert (figures["ends"], figures["picks"]) == (62, 62)
    assert figures["warp"]["section"] == "lenticular"
    assert figures["warp"]["size"] == "assumed"
    assert figures["cover"] == pytest.approx(1 - 0.1**2)  # both 90 % covered
    assert figures["warp"]["crimp"] == pytest.approx(0.05, abs=2e-3)
    assert abs(figures["least_clearance"]["distance"]) < 1e-15


def check_double_cloth(scene: Scene) -> None:
    cloth = scene.woven.cloth
    found = find_layers(cloth.drawdown)
    assert found is not None
    assert cloth.layers is not None
    np.testing.assert_array_equal(found.ends, cloth.layers.ends)
    np.testing.assert_array_equal(found.picks, cloth.layers.picks)
    thickness = fabric_figures(cloth)["thickness"]
    assert thickness == pytest.approx(2 * (2e-3 + 2e-3) + 0.4e-3)
    # dark squares in front are light ones behind
    dark = cloth.warp.colors[0]
    assert (cloth.warp.colors[~cloth.layers.ends] == dark).all()
    assert not (cloth.warp.colors[cloth.layers.ends] == dark).any()


#: Loop length over course and wale spacing of stockinette of 16 diameters, by another program.
STOCKINETTE = 5.42, 3.97


def check_knit(course: float, wale: float) -> Callable[[Scene], None]:
    """Return a check of the spacings over those of stockinette of the same yarn."""

    def check(scene: Scene) -> None:
        found = {figure.key: figure.value for figure in scene.textile.figures}
        assert STOCKINETTE[0] / found["kc"] == pytest.approx(course, rel=0.03)
        assert STOCKINETTE[1] / found["kw"] == pytest.approx(wale, rel=0.05)
        assert found["largest_overlap"] < 0.005

    return check


def check_yarn(
    stitches: float, places: int, wale: tuple[float, float] = (0.0, 9.0)
) -> Callable[[Scene], None]:
    """Return a check of the yarn in a repeat, in stitches, by its mass; of the crossings, too."""

    def check(scene: Scene) -> None:
        found = {figure.key: figure.value for figure in scene.textile.figures}
        area = found["course_spacing"] * found["wale_spacing"] * places
        length = found["areal_mass"] * area / scene.textile.linear_densities[0]
        assert length / found["loop_length"] == pytest.approx(stitches, rel=1e-6)
        assert wale[0] < STOCKINETTE[1] / found["kw"] < wale[1]
        # Relaxing refuses yarns whose crossings are not those of the pattern.
        assert found["largest_overlap"] <= 0.005

    return check


def check_figures(**expected: float) -> Callable[[Scene], None]:
    """Return a check of figures of a textile, each within 3 per cent."""

    def check(scene: Scene) -> None:
        found = {figure.key: figure.value for figure in scene.textile.figures}
        assert found["largest_overlap"] < 0.005
        for key, value in expected.items():
            assert found[key] == pytest.approx(value, rel=0.03)

    return check


def check_orthogonal(scene: Scene) -> None:
    found = {figure.key: figure.value for figure in scene.textile.figures}
    # Four picks and three stuffers lie on each other; binders press into both faces.
    assert 7e-3 < found["thickness"] < 9e-3
    assert (found["unbound_picks"], found["cloths"]) == (0, 1)
    assert found["largest_overlap"] < 0.005


def check_tricot(scene: Scene) -> None:
    found = {figure.key: figure.value for figure in scene.textile.figures}
    assert found["largest_overlap"] < 0.005
    # Mass of both yarns of a stitch on its area.
    yarn = (found["loop_length"] + found["back_loop_length"]) * scene.textile.linear_densities[0]
    area = found["course_spacing"] * found["wale_spacing"]
    assert found["areal_mass"] == pytest.approx(yarn / area)
    assert 2.0 < found["thickness"] / 1e-4 < 6.0


def check_braid_on_rod(scene: Scene) -> None:
    """What the upper half of the rod does not need of the braid's length hangs on both sides."""
    scene.update_stage(scene.modal)
    grid = scene.modal.output
    points = points_of(grid) + vtk_to_numpy(grid.GetPointData().GetArray("equilibrium"))
    flat, (_, width, height) = np.ptp(points_of(grid), axis=0), np.ptp(points, axis=0)
    thickness = flat[2]
    radius = 16e-3 + thickness / 2
    hanging = (flat[1] - math.pi * radius) / 2
    assert height == pytest.approx(hanging + radius + thickness / 2, rel=0.03)
    assert width == pytest.approx(2 * radius + thickness, rel=0.03)


def check_leno(scene: Scene) -> None:
    found = {figure.key: figure.value for figure in scene.textile.figures}
    assert found["crossing_crimp"] > found["standing_crimp"] > 0.0
    assert found["largest_overlap"] < 0.005


def half_the_yarns(ends: int, picks: int, spacing: str) -> tuple[str, ...]:
    """Return the settings of a cloth that is as large as before, with half as many yarns."""
    spacings = (f'weave.{family}_spacing="{spacing}"' for family in ("warp", "weft"))
    return f"weave.ends={ends}", f"weave.picks={picks}", *spacings


def check_helicoid(scene: Scene) -> None:
    """Fibres at x from the axis have the stretch λ² + τ² x²: their pull is force and moment."""
    scene.update_stage(scene.modal)
    *_, grip = reactions_of(scene.modal.output)
    points, sheet = points_of(scene.modal.output), sheet_of(scene.modal.output)
    assert sheet is not None
    width, length, _ = np.ptp(points, axis=0)
    stretch, twist = 1 + 4e-3 / length, 1.5 * math.pi / length
    x = width * (np.arange(10_000) + 0.5) / 10_000 - width / 2
    pull = sheet.tensile_rigidity[0] * (stretch**2 + (twist * x) ** 2 - 1) / 2 * width
    torsion = 4 * sheet.twisting_rigidity * width * twist
    assert grip.force[1] == pytest.approx((pull * stretch).mean(), rel=5e-3)
    assert grip.moment[1] == pytest.approx((pull * twist * x**2).mean() + torsion, rel=2e-2)


CHECKS: dict[str, Callable[[Scene], None]] = {
    "basket_2": check_basket,
    "double_weave": check_double_cloth,
    "gust": check_gust,
    "handweaving": check_real_draft,
    "helicoid": check_helicoid,
    "plain_weave": check_published_experiment,
    "satin_5_2": check_satin(5, 2),
    "satin_8_3": check_satin(8, 3),
    "tartan": check_tartan,
    "twill_2_2": check_twill_of_counted_yarns,
    "animal_in_carved_cage": check_soft_animal,
    "calculix_fabric": check_calculix_fabric,
    "lever_in_tetwild_cage": check_steel_lever,
    "tube_bundle": check_tube_bundle,
    "stockinette": check_knit(1.0, 1.0),
    "rib_1x1": check_knit(1.04, 0.52),
    "rib_2x2": check_knit(1.08, 0.40),
    "garter": check_knit(0.71, 1.04),
    "seed_stitch": check_knit(0.77, 0.91),
    # Half cardigan: half as high and wider than the rib. One of four stitches is a tuck.
    "tuck": check_yarn(3 + 23 / 32, 4, wale=(0.6, 0.9)),
    # Four of 36 loops pass two needles, each with a quarter of a stitch more.
    "cable": check_yarn(36 + 4 * 2 / 4, 36),
    # Six of twelve stitches of each row miss.
    "fair_isle": check_yarn(6 + 6 / 4, 6),
    # One stitch in each of two rows of six, and four in one row of four, are yarn overs.
    "eyelet": check_yarn(34 + 2 * 23 / 32, 36),
    "feather_and_fan": check_yarn(44 + 4 * 23 / 32, 48),
    # Both yarns of a row make 8 stitches, on two beds, and float past 8 needles.
    "jacquard": check_yarn(4 * (8 + 8 / 4), 16),
    "tricot": check_tricot,
    # 32 stitches of a 3.98th of 19.2 mm each.
    "sleeve": check_figures(tube_diameter=32 * 19.2e-3 / 3.98 / math.pi),
    "braid_on_rod": check_braid_on_rod,
    # Taut strands lie in two layers at each crossing.
    "three_strand_plait": check_figures(pick_length=15e-3, thickness=12e-3),
    # Helices on the mean radius, half a diameter more than mandrel and inner yarns.
    "tubular_braid": check_figures(lay_length=math.pi * 7e-3, braid_angle=45.0),
    "orthogonal_weave": check_orthogonal,
    "leno": check_leno,
    # Peirce: spacing of three diameters.
    "wire_mesh": check_figures(warp_crimp=0.05848, weft_crimp=0.05848),
    **hung_scenes.CHECKS,
    **contact_scenes.CHECKS,
}


#: Long scenes as they run in the gate: the same cloth with fewer yarns and cells, or longer steps.
#: The nightly run takes them as they come with the program.
SHORTER = {
    "arm": ("cage.divisions=[12,12,1]", *half_the_yarns(55, 55, "5 mm")),
    "capstan": (
        "cage.divisions=[60,1,1]",
        "modal.path_steps=4",
        *half_the_yarns(127, 24, "2 mm"),
        'weave.warp_diameter="1.14 mm"',
        'weave.weft_diameter="1.14 mm"',
    ),
    "cantilever_test": half_the_yarns(40, 10, "2.5 mm"),
    "catenary": ("modal.modes=30", "cage.divisions=[40,4,1]", *half_the_yarns(50, 22, "40 mm")),
    "curtain": ("cage.divisions=[16,8,1]", *half_the_yarns(40, 50, "20 mm")),
    "curtain_on_rod": ("cage.divisions=[4,40,1]", *half_the_yarns(50, 110, "5 mm")),
    "drape": ("cage.divisions=[16,20,1]", *half_the_yarns(40, 50, "15 mm")),
    "overhang": half_the_yarns(40, 12, "3 mm"),
    "pennant": ("cage.divisions=[10,2,1]", *half_the_yarns(35, 10, "20 mm")),
    "sleeve": ("cage.divisions=[6,14,6]", "surface.subdivisions=1"),
    "squall": ("cage.divisions=[4,8,1]", *half_the_yarns(30, 40, "20 mm")),
    "drop": (
        "cage.divisions=[8,8,1]",
        'view.time="0.12 s"',
        *half_the_yarns(75, 75, "4 mm"),
    ),
    "helicoid": ("cage.divisions=[4,30,1]", "modal.path_steps=6"),
    "fold": ("cage.divisions=[80,1,1]", *half_the_yarns(245, 32, "1.5 mm")),
    "let_go": ("cage.divisions=[4,12,1]", *half_the_yarns(20, 20, "20 mm")),
    "tablecloth": ("cage.divisions=[20,20,1]", *half_the_yarns(75, 75, "4 mm")),
    "swing": ("cage.divisions=[10,2,1]", "transient.tolerance=0.01"),
}


#: Scenes whose stages other tests run on less. Of these the gate makes the cloth and the cage only.
LONG = {
    "animal_in_carved_cage",
    "arm",
    "braid_on_rod",
    "cable",
    "capstan",
    "catenary",
    "curl",
    "curtain",
    "curtain_on_rod",
    "double_weave",
    "drape",
    "drop",
    "eyelet",
    "fair_isle",
    "feather_and_fan",
    "fold",
    "garter",
    "handweaving",
    "helicoid",
    "jacquard",
    "leno",
    "let_go",
    "lever_in_tetwild_cage",
    "orthogonal_weave",
    "rib_1x1",
    "rib_2x2",
    "seed_stitch",
    "sleeve",
    "squall",
    "swing",
    "tablecloth",
    "three_strand_plait",
    "tricot",
    "tubular_braid",
    "tuck",
    "yarn_tension",
    "yarn_to_cloth",
}


#: Of these, scenes without a cage, or whose cage takes long to make.
NO_CAGE = {
    "cable",
    "eyelet",
    "fair_isle",
    "feather_and_fan",
    "garter",
    "handweaving",
    "jacquard",
    "leno",
    "lever_in_tetwild_cage",
    "orthogonal_weave",
    "rib_1x1",
    "rib_2x2",
    "seed_stitch",
    "sleeve",
    "three_strand_plait",
    "tricot",
    "tubular_braid",
    "tuck",
}


def scenes() -> list[Any]:
    """Return each scene as the gate runs it, and those that are shorter there as they are."""
    nightly = pytest.mark.nightly
    short = [
        pytest.param(name, SHORTER.get(name, ()), id=name, marks=[nightly] * (name in LONG))
        for name in library.names()
    ]
    return short + [
        pytest.param(name, (), id=f"{name} as it is", marks=nightly) for name in SHORTER
    ]


@pytest.mark.usefixtures("kept_modes")
@pytest.mark.parametrize(("name", "changes"), scenes())
def test_scene(name: str, changes: tuple[str, ...]) -> None:
    scene = Scene.read(name)
    assert scene.title
    scene.check()
    for change in changes:
        scene.set(change)
    if scene.woven and sum(scene.woven.cloth.size) > 60:
        scene.surface.subdivisions = 2  # of a picture this small more is not seen
    if name == "drape":
        scene.modal.modes = 12  # what hangs is checked; 300 modes take as long as the equilibrium
    picture = Picture(scene, [scene.view.time], (200, 150))
    image = picture.draw(scene.view.time).astype(int)
    picture.close()
    # The yarns' colours differ from the background's pale blue, in a good part of the picture.
    coloured = np.ptp(image, axis=2) > 40
    assert 0.02 < coloured.mean() < 0.9
    CHECKS.get(name, check_still_and_feasible)(scene)


@pytest.mark.parametrize("name", sorted(LONG - NO_CAGE))
def test_long_scene_has_an_object_in_its_cage(name: str) -> None:
    scene = Scene.read(name)
    scene.check()
    scene.update_stage(scene.source)
    scene.update_stage(scene.cage)
    low, high = np.reshape(scene.source.output.GetBounds(), (3, 2)).T
    least, most = np.reshape(scene.cage.output.GetBounds(), (3, 2)).T
    slack = 1e-6 * (high - low).max()
    assert (least <= low + slack).all()
    assert (most >= high - slack).all()


def test_the_cells_of_the_drape_are_at_most_half_as_wide_as_its_bending_length() -> None:
    scene = Scene.read("drape")
    scene.update_stage(scene.cage)
    low, high = np.reshape(scene.cage.output.GetBounds(), (3, 2)).T
    widths = (high - low)[:2] / scene.cage.divisions[:2]
    weight = scene.modal.areal_mass * GRAVITY
    assert widths.max() <= (scene.modal.bending_rigidity / weight) ** (1 / 3) / 2


def test_film_shows_cage_and_fabric_moving() -> None:
    scene = Scene.read("plain_weave")
    times = [0.0, 0.02]
    picture = Picture(scene, times, (240, 120))
    first, second = (picture.draw(time).astype(int) for time in times)
    picture.close()
    for half in (slice(0, 120), slice(120, 240)):
        assert np.abs(second[:, half] - first[:, half]).max() > 60


#: Runs scripts one after another: most of them take less time than a process takes to start.
_RUN_SCRIPTS = """
import runpy, sys, warnings
scripts = sys.argv[1:]
for script in scripts:
    sys.argv = [script]
    with warnings.catch_warnings():
        runpy.run_path(script, run_name="__main__")
    print("end of", script)
"""


#: Scripts that do what another one does, in PyVista's words or with several processes.
SLOW_SCRIPTS = {"film_with_pyvista", "in_pieces"}


@pytest.mark.parametrize(
    ("draws", "slow"),
    [
        pytest.param(True, False, id="drawing"),
        pytest.param(False, False, id="not drawing", marks=pytest.mark.nightly),
        pytest.param(True, True, id="slow and drawing", marks=pytest.mark.nightly),
        pytest.param(False, True, id="slow and not drawing", marks=pytest.mark.nightly),
    ],
)
def test_pipeline_scripts_run_without_a_warning(draws: bool, slow: bool) -> None:
    if draws:
        prepare_offscreen()  # in this process, which then skips where it cannot draw
    scripts = [
        str(path)
        for path in sorted((ROOT / "pipelines").glob("*.py"))
        if ("prepare_offscreen()" in path.read_text()) == draws
        and (path.stem in SLOW_SCRIPTS) == slow
    ]
    assert scripts
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", _RUN_SCRIPTS, *scripts],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stdout + done.stderr
    printed = done.stdout
    for script in scripts:
        own, end, printed = printed.partition(f"end of {script}\n")
        assert own, script
        assert end, script


def test_python_of_the_readme_runs() -> None:
    code = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert len(code) == 1
    assert len(code[0].strip().splitlines()) <= 10
    names: dict[str, object] = {}
    exec(code[0], names)
    assert names["cloth"].GetNumberOfCells() == 1176 * 16  # type: ignore[attr-defined]
    assert names["response"].executions == 1  # type: ignore[attr-defined]
    with pytest.warns(SpacemapWarning, match=r"bends about 4\.2 times"):
        exec(code[0].replace('elements="sheet"', ""), names)
    assert names["modal"].warnings  # type: ignore[attr-defined]


def test_documentation_names_every_command() -> None:
    from spacemap_vtk.cli.main import app

    pages = (ROOT / "README.md", *(ROOT / "docs" / "how-to").glob("*.md"))
    text = "".join(page.read_text("utf-8") for page in pages)
    for command in app:
        if not command.startswith("-"):
            assert f"spacemap {command}" in text
