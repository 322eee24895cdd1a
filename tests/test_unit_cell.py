"""Unit cells: constants of voxels against exact solutions, and those of textiles."""

from __future__ import annotations

import json
import shutil
import subprocess
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from unit_cells import phases_without_mixing

from spacemap_vtk import UnitCell, WeaveSource, connect
from spacemap_vtk.cli.main import main
from spacemap_vtk.cli.options import open_scene
from spacemap_vtk.datasets.arrays import array_of
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.unit_cell import make_unit_cell, shear_gradient
from spacemap_vtk.io.formats.unit_cell import STRAIN, write_deck
from spacemap_vtk.scenes.composite import (
    compute_constants,
    directional_moduli,
    find_unit_cell,
    unit_cell_model,
)
from spacemap_vtk.scenes.composite_map import map_constants
from spacemap_vtk.unit_cell.homogenise import homogenise, homogenise_plate
from spacemap_vtk.unit_cell.mixtures import (
    UPPER,
    Constituent,
    chamis,
    mix_layers,
    mori_tanaka,
    turn_stiffness,
)
from spacemap_vtk.unit_cell.phases import UnitCellModel, assign_materials, stretch_factors
from spacemap_vtk.unit_cell.rasterise import Voxels, rasterise
from spacemap_vtk.unit_cell.voxel_elasticity import VoxelElasticity, symmetric

GLASS = Constituent.isotropic(72e9, 0.22, 5e-6, 2540.0)
EPOXY = Constituent.isotropic(3.5e9, 0.35, 60e-6, 1200.0)
YARN = chamis(GLASS, EPOXY, 0.65)
PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


def voxels_of(inside: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Stiffness of voxels of two materials."""
    one, other = (c[UPPER][None, None, :, None] for c in (first, second))
    return np.where(inside[:, :, None, :], one, other)


def turn(stiffness: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Turn a stiffness as a tensor of fourth order."""
    tensor = np.zeros((3, 3, 3, 3))
    for (a, (i, j)), (b, (k, m)) in product(enumerate(PAIRS), enumerate(PAIRS)):
        for (p, q), (r, s) in product(((i, j), (j, i)), ((k, m), (m, k))):
            tensor[p, q, r, s] = stiffness[a, b]
    tensor = np.einsum("ai,bj,ck,dl,ijkl->abcd", *[rotation] * 4, tensor, optimize=True)
    return np.array([[tensor[i, j, k, m] for k, m in PAIRS] for i, j in PAIRS])


def laminate(first: np.ndarray, second: np.ndarray, share: float, normal: Any) -> np.ndarray:
    """Layers of two materials: strains differ by sym(a ⊗ n), tractions are equal."""
    x, y, z = normal
    across = np.array([[x, 0, 0], [0, y, 0], [0, 0, z], [0, z, y], [z, 0, x], [y, x, 0]])
    traction = across.T @ ((1 - share) * first + share * second) @ across
    # ε₁ − ε₂ = across @ a for a mean strain of 1 in each component.
    jump = across @ np.linalg.solve(traction, -across.T @ (first - second))
    eye = np.eye(6)
    return share * first @ (eye + (1 - share) * jump) + (1 - share) * second @ (eye - share * jump)


@pytest.mark.parametrize("points", [1, 8])
def test_a_homogeneous_material_keeps_its_stiffness(points: int) -> None:
    rotation = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    stiffness = turn(YARN.stiffness, rotation)
    box = voxels_of(np.zeros((4, 6, 8), bool), stiffness, stiffness)
    found = VoxelElasticity(box, np.array([1.0, 2.0, 3.0]), points).solve(np.eye(6))
    np.testing.assert_allclose(found.energies, stiffness, rtol=0, atol=3e-15 * stiffness.max())


@pytest.mark.parametrize("points", [1, 8])
@pytest.mark.parametrize("axis", [0, 2])
def test_layers_are_exact(points: int, axis: int) -> None:
    inside = np.zeros((8, 4, 8), bool)
    inside[(slice(None),) * (2 - axis) + (slice(0, 3),)] = True
    box = voxels_of(inside, GLASS.stiffness, EPOXY.stiffness)
    found = VoxelElasticity(box, np.ones(3), points).solve(np.eye(6), 1e-8)
    exact = laminate(GLASS.stiffness, EPOXY.stiffness, 3 / 8, np.eye(3)[axis])
    np.testing.assert_allclose(found.energies, exact, rtol=0, atol=1e-14 * exact.max())


def test_mixed_voxels_are_layers() -> None:
    rng = np.random.default_rng(1)
    axes, normal = (
        one / np.linalg.norm(one, axis=1)[:, None] for one in rng.normal(size=(2, 9, 3))
    )
    share = rng.uniform(0.05, 0.95, 9)
    first = turn_stiffness(YARN, axes)
    second = np.repeat(EPOXY.stiffness[UPPER][:, None], 9, axis=1)
    mixed = symmetric(mix_layers(first, second, share, normal).T)
    for one, axis, part, across in zip(mixed, axes, share, normal, strict=True):
        basis = np.linalg.qr(np.column_stack([axis, np.eye(3)]))[0] * np.sign(axis[0]) * -1
        turned = turn(YARN.stiffness, basis)
        exact = laminate(turned, EPOXY.stiffness, part, across)
        np.testing.assert_allclose(one, exact, rtol=0, atol=1e-13 * exact.max())


# To compile the loop of eight points takes seconds; the default is one.
@pytest.mark.parametrize("points", [1, pytest.param(8, marks=pytest.mark.nightly)])
def test_compiled_loops_give_what_numpy_gives(points: int, monkeypatch: pytest.MonkeyPatch) -> None:
    inside = np.random.default_rng(2).random((5, 6, 7)) < 0.4
    box = voxels_of(inside, GLASS.stiffness, EPOXY.stiffness)
    found = []
    for setting in ("always", "never"):
        monkeypatch.setenv("SPACEMAP_COMPILED", setting)
        elasticity = VoxelElasticity(box, np.array([1.0, 1.5, 2.0]), points)
        found.append(elasticity.solve(np.eye(6), 1e-6))
    np.testing.assert_allclose(found[0].energies, found[1].energies, rtol=1e-11)
    # Mean stresses of the local fields are the stiffness, too.
    for load, one in zip(np.eye(6), found[1].displacements, strict=True):
        strain, stress = elasticity.fields(one, load)
        if points == 1:
            mean = stress.mean(axis=(1, 2, 3))
            np.testing.assert_allclose(mean, found[1].energies @ load, rtol=0, atol=1e5)
        np.testing.assert_allclose(strain.mean(axis=(1, 2, 3)), load, atol=1e-12)


def test_bounds_of_voigt_and_reuss_hold() -> None:
    inside = np.random.default_rng(3).random((6, 6, 6)) < 0.5
    box = voxels_of(inside, YARN.stiffness, EPOXY.stiffness)
    found = VoxelElasticity(box, np.ones(3)).solve(np.eye(6), 1e-6).energies
    share = inside.mean()
    voigt = share * YARN.stiffness + (1 - share) * EPOXY.stiffness
    reuss = np.linalg.inv(
        share * np.linalg.inv(YARN.stiffness) + (1 - share) * np.linalg.inv(EPOXY.stiffness)
    )
    assert np.linalg.eigvalsh(voigt - found).min() > 0
    assert np.linalg.eigvalsh(found - reuss).min() > 0


def test_a_sphere_of_equal_shear_modulus_has_the_exact_bulk_modulus() -> None:
    # R. Hill, J. Mech. Phys. Solids 11 (1963) 357: 1 / (K + 4G/3) is the mean of the phases'.
    shear, bulks = 2e9, (20e9, 3e9)
    phases = [
        Constituent.isotropic(
            9 * k * shear / (3 * k + shear), (3 * k - 2 * shear) / (6 * k + 2 * shear)
        )
        for k in bulks
    ]
    count = 24
    places = (np.arange(4 * count) + 0.5) / (4 * count) - 0.5
    fine = sum(one**2 for one in np.meshgrid(places, places, places)) < 0.3**2
    share = fine.reshape(count, 4, count, 4, count, 4).mean(axis=(1, 3, 5))
    none = np.broadcast_to([1.0, 0.0, 0.0], (*share.shape, 3))
    number = np.where(share > 0, 0, -1).astype(np.int32)
    voxels = Voxels(share, number, none, np.ones_like(share), 0.0)
    made = assign_materials(voxels, np.ones(3), lambda _: phases[0], phases[1], np.float64)
    found = homogenise(made, np.ones(3))[0].stiffness
    bulk = found[:3, :3].mean()
    mean = share.mean() / (bulks[0] + 4 * shear / 3) + (1 - share.mean()) / (
        bulks[1] + 4 * shear / 3
    )
    assert abs(bulk / (1 / mean - 4 * shear / 3) - 1) < 3e-3
    assert abs(found[3, 3] / shear - 1) < 1e-6


def rods(radius: float, facets: int = 512) -> tuple[np.ndarray, np.ndarray]:
    """Points and tangents of a rod along x through the middle of a box of size 1."""
    along, around = np.array([-0.2, 1.2]), np.linspace(0, 2 * np.pi, facets + 1)
    angle, x = np.meshgrid(around, along, indexing="ij")
    points = np.stack([x, 0.5 + radius * np.cos(angle), 0.5 + radius * np.sin(angle)], axis=-1)
    return points[None], np.broadcast_to([1.0, 0.0, 0.0], points.shape)[None]


def test_a_square_array_of_fibres_has_the_shear_modulus_by_rayleigh() -> None:
    # W. T. Perrins, D. R. McKenzie, R. C. McPhedran, Proc. R. Soc. A 369 (1979) 207, eq. 14: the
    # conductivity, to which shear along the fibres is equivalent.
    share, contrast = 0.6, 8.4
    matrix, fibre = (Constituent.isotropic(2.5e9 * k, 0.25, 1e-6 * k) for k in (1.0, contrast))
    points, tangents = rods((share / np.pi) ** 0.5)
    shape = (4, 32, 32)
    spacing = 1 / np.array(shape)
    voxels = rasterise(points * shape, tangents, np.ones(points.shape[:3]), [0], shape)
    assert abs(voxels.fraction.mean() / share - 1) < 1e-3
    made = assign_materials(voxels, spacing, lambda _: fibre, matrix)
    constants, _ = homogenise(made, spacing)
    t = (1 + contrast) / (1 - contrast)
    exact = 1 - 2 * share / (
        t + share - 0.305827 * share**4 * t / (t**2 - 1.402958 * share**8) - 0.013362 * share**8 / t
    )
    np.testing.assert_allclose(constants.stiffness[[4, 5], [4, 5]] / 1e9, exact, rtol=1.3e-3)
    # V. M. Levin: the expansion of two isotropic phases follows from the stiffness.
    whole, one, other = (
        np.linalg.inv(c) for c in (constants.stiffness, fibre.stiffness, matrix.stiffness)
    )
    step = (fibre.axial_expansion - matrix.axial_expansion) / (one - other)[0, :3].sum()
    levin = matrix.axial_expansion + step * (whole - other)[:3, :3].sum(axis=1)
    np.testing.assert_allclose(constants.expansion[:3], levin, rtol=2e-2)


def test_a_plate_of_layers_bends_as_laminate_theory_says() -> None:
    # Two layers of isotropic materials with equal Poisson's ratio: A, B and D are exact.
    first, second = (Constituent.isotropic(e, 0.3) for e in (70e9, 7e9))
    depth, height = 16, 2e-3
    share = np.zeros((depth, 4, 4))
    share[: depth // 2] = 1.0
    axis = np.broadcast_to([1.0, 0.0, 0.0], (*share.shape, 3))
    number = np.where(share > 0, 0, -1).astype(np.int32)
    voxels = Voxels(share, number, axis, np.ones_like(share), 0.0)
    spacing = np.array([1e-3, 1e-3, height / depth])
    made = assign_materials(voxels, spacing, lambda _: first, second, np.float64)
    plate = homogenise_plate(made, spacing, tolerance=1e-6)
    stiff, soft = (e / (1 - 0.09) for e in (70e9, 7e9))
    exact = [
        (stiff + soft) * height / 2,
        (soft - stiff) * height**2 / 8,
        (stiff + soft) * height**3 / 24,
    ]
    found = [one[0, 0] for one in (plate.membrane, plate.coupling, plate.bending)]
    np.testing.assert_allclose(found, exact, rtol=2e-3)


def test_mori_and_tanaka_meet_the_bounds_of_hashin() -> None:
    # Z. Hashin, J. Mech. Phys. Solids 13 (1965) 119: the lower bound of the axial shear modulus.
    share = 0.55
    found = mori_tanaka(GLASS, EPOXY, share)
    gm, gf = EPOXY.axial_shear, GLASS.axial_shear
    bound = gm * (gf * (1 + share) + gm * (1 - share)) / (gf * (1 - share) + gm * (1 + share))
    assert found.axial_shear == pytest.approx(bound, rel=1e-12)
    assert mori_tanaka(GLASS, EPOXY, 1e-9).transverse_modulus == pytest.approx(3.5e9, rel=1e-6)
    assert found.is_isotropic is False
    assert found.transverse_modulus < chamis(GLASS, EPOXY, share).transverse_modulus


def test_a_weave_fills_its_voxels() -> None:
    weave = WeaveSource(pattern="twill 2/2", warp_diameter=2e-4, weft_diameter=3e-4)
    cell = connect(weave.around_repeat(), UnitCell(voxels=64))
    output = cell.update().output
    data = output.GetCellData()
    fraction = array_of(data, "fraction", "a cell")
    yarn = array_of(data, "yarn", "a cell")
    volume = fraction.sum() * np.prod(output.GetSpacing())
    # Length of a yarn in its repeat: spacing times one plus crimp.
    cloth = weave.cloth
    exact = 0.0
    for family, threads in zip(cloth.families, cloth.threads, strict=True):
        crimped = family.crimp.length * 2 + family.crossed * 2
        exact += 4 * crimped * np.pi / 4 * threads.diameter**2
    assert volume == pytest.approx(exact, rel=2e-3)
    direction = array_of(data, "direction", "a cell")
    along = np.abs(direction[(yarn >= 0) & (fraction > 0.5)])
    np.testing.assert_allclose(np.linalg.norm(along, axis=1), 1.0, rtol=1e-5)
    assert len(np.unique(yarn[yarn >= 0])) == 8


def test_a_piece_that_is_too_small_has_no_unit_cell() -> None:
    with pytest.raises(InputError, match="no whole repeat"):
        connect(WeaveSource(ends=2, picks=2), UnitCell(voxels=16)).update()


def test_constants_are_printed_with_their_errors(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["constants", "plain_weave", "--voxels", "32", "--plate", "--json", "-q"])
    assert end.value.code == 0
    found = json.loads(capsys.readouterr().out)
    assert found["voxels"] == [32, 32, 16]
    # Round yarns of d = 0.25 mm and p = 0.5 mm: Peirce's crimp of 14.35 %.
    share = 2 * np.pi / 4 * 0.25**2 * 0.5 * 1.1435 / (0.5 * 0.5 * 0.5)
    assert found["yarn_share"] == pytest.approx(share, rel=2e-3)
    assert found["fibre_share"] == pytest.approx(0.65 * share, rel=2e-3)
    stiffness, error = np.array(found["stiffness"]), np.array(found["error"]["stiffness"])
    np.testing.assert_allclose(stiffness, stiffness.T, rtol=1e-12)
    assert 0 < error[0, 0] < 0.01 * stiffness[0, 0]
    assert found["constants"]["Ex"] == pytest.approx(found["constants"]["Ey"], rel=1e-4)
    bending, membrane = found["plate"]["D"][0][0], found["plate"]["A"][0][0]
    # A plate bends more softly than its membrane stiffness suggests.
    assert 0.6 < 12 * bending / 5e-4**2 / membrane < 0.85


@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
@pytest.mark.parametrize("shear", [0, pytest.param(35, marks=pytest.mark.nightly)])
def test_calculix_finds_the_same_stiffness_from_the_deck(
    shear: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # A fibre whose shear moduli differ, so that axes and moduli may not be swapped.
    words = ["unit_cell.voxels=8", "unit_cell.fibre=carbon_t300", f"unit_cell.shear={shear}"]
    sets = [word for one in words for word in ("--set", one)]
    with pytest.raises(SystemExit) as end:
        main(["unit-cell", "plain_weave", *sets, "-o", str(tmp_path / "cell.inp"), "-q"])
    assert end.value.code == 0
    model = unit_cell_model(open_scene("plain_weave", words))
    exact = homogenise(phases_without_mixing(model), model.spacing, 8, 1e-6)[0].stiffness
    found = run_calculix(tmp_path / "cell.inp")
    np.testing.assert_allclose(found, exact, rtol=0, atol=2e-7 * exact.max())


def run_calculix(deck: Path) -> np.ndarray:
    """Return the stiffness (6, 6) that CalculiX finds from a deck, with seven digits."""
    words = ["ccx", deck.stem]
    done = subprocess.run(words, cwd=deck.parent, capture_output=True, check=True)
    assert b"Job finished" in done.stdout
    steps = deck.with_suffix(".dat").read_text().split("stresses")[1:]
    rows = [[line.split()[2:8] for line in step.splitlines()[2:] if line.strip()] for step in steps]
    # CalculiX prints xx, yy, zz, xy, xz, yz.
    return np.array(rows, float).mean(axis=1)[:, [0, 1, 2, 5, 4, 3]] / STRAIN


@dataclass(frozen=True)
class Orthotropic(Constituent):
    """A material of nine moduli, which no yarn has, so that none can be swapped in a file."""

    @property
    def stiffness(self) -> np.ndarray:
        e1, e2, e3, nu12, nu13, nu23 = 130e9, 11e9, 7e9, 0.31, 0.26, 0.42
        g12, g13, g23 = 5.1e9, 3.7e9, 2.3e9
        compliance = np.diag([1 / e1, 1 / e2, 1 / e3, 1 / g23, 1 / g13, 1 / g12])
        compliance[0, 1] = compliance[1, 0] = -nu12 / e1
        compliance[0, 2] = compliance[2, 0] = -nu13 / e1
        compliance[1, 2] = compliance[2, 1] = -nu23 / e2
        return np.linalg.inv(compliance)


@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, 0, 0.8)])
def test_a_brick_of_nine_moduli_comes_back_from_calculix(
    direction: tuple[float, ...], tmp_path: Path
) -> None:
    full = np.ones((2, 2, 2))
    along = np.broadcast_to(np.array(direction, float), (2, 2, 2, 3))
    voxels = Voxels(full, np.zeros((2, 2, 2), np.int32), along, full, 0.0)
    brick = Orthotropic(2.0, 1.0, 1.0, 0.3, 0.3)
    spacing = np.array([1e-3, 2e-3, 3e-3])
    write_deck(
        tmp_path / "a.inp", UnitCellModel("brick", voxels, spacing, lambda _: brick, EPOXY, 1.0)
    )
    lines = (tmp_path / "a.inp").read_text().splitlines()
    # The deck's own axes 1 and 2, of the first element; the line before is the default.
    words = lines[lines.index("*DISTRIBUTION, NAME=AXES") + 2].split(",")
    first, second = np.array(words[1:], float).reshape(2, 3)
    np.testing.assert_allclose(first, direction, atol=1e-12)
    exact = turn(brick.stiffness, np.column_stack([first, second, np.cross(first, second)]))
    found = run_calculix(tmp_path / "a.inp")
    # Half of the seventh digit.
    np.testing.assert_allclose(found, exact, rtol=5e-7, atol=1e-9 * exact.max())


def test_a_file_has_the_fields_under_unit_strains(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "cell.vti"
    words = ["plain_weave", "--voxels", "16", "--fields"]
    with pytest.raises(SystemExit) as end:
        main(["unit-cell", *words, "-o", str(file)])
    assert end.value.code == 0
    assert "xx yarns" in capsys.readouterr().out
    cell = pv.read(file)
    assert cell.cell_data["stress_xy"].shape == (16 * 16 * 8, 6)
    np.testing.assert_allclose(cell.cell_data["strain_xy"].mean(axis=0), np.eye(6)[5], atol=1e-5)
    # Stresses do work on strains as the mean stress does on the mean strain (Hill and Mandel).
    stress, strain = (cell.cell_data[f"{name}_xx"].astype(float) for name in ("stress", "strain"))
    energy = np.einsum("ni,ni->n", stress, strain).mean()
    assert energy == pytest.approx(stress.mean(axis=0)[0], rel=1e-4)


def test_moduli_are_plotted_over_the_direction(tmp_path: Path) -> None:
    compliance = YARN.stiffness
    angle, modulus = directional_moduli(np.linalg.inv(compliance), 5)
    np.testing.assert_allclose(angle[:2], [0, np.pi / 2])
    expected = [YARN.axial_modulus, YARN.transverse_modulus]
    np.testing.assert_allclose(modulus[:2], expected)
    file = tmp_path / "moduli.svg"
    with pytest.raises(SystemExit) as end:
        main(["constants", "plain_weave", "--voxels", "16", "-o", str(file), "-q"])
    assert end.value.code == 0
    assert b"<svg" in file.read_bytes()


def test_cloth_that_is_not_sheared_has_the_same_constants_in_every_cell(tmp_path: Path) -> None:
    words = ["constants", "yarn_to_cloth", "--voxels", "16"]
    file = tmp_path / "map.csv"
    with pytest.raises(SystemExit) as end:
        main([*words, "--map", str(file), "-q"])
    assert end.value.code == 0
    rows = np.genfromtxt(file, delimiter=",", names=True)
    scene = open_scene("yarn_to_cloth", ["unit_cell.voxels=16"])
    exact = compute_constants(scene).constants.stiffness
    np.testing.assert_allclose(rows["C11_Pa"], exact[0, 0], rtol=1e-4)
    np.testing.assert_allclose(rows["C12_Pa"], exact[0, 1], rtol=1e-4)
    np.testing.assert_allclose(rows["C66_Pa"], exact[5, 5], rtol=1e-4)
    # A motion shears it by hundredths of a degree, which only turns the coupling to shear.
    assert abs(rows["shear_deg"]).max() < 0.1
    weft = np.stack([rows[f"weft_{axis}"] for axis in "xyz"])
    np.testing.assert_allclose(np.linalg.norm(weft, axis=0), 1.0, rtol=1e-12)


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore")
def test_a_map_has_the_constants_of_each_cell_of_a_drape() -> None:
    scene = open_scene("drape", ["unit_cell.voxels=16"])
    found = map_constants(scene)
    area = found.stretch.prod(axis=1)
    assert np.ptp(area) > 0.03
    stage, patches = find_unit_cell(scene)
    voxels, spacing = make_unit_cell(stage, patches, 16)
    for cell in (area.argmin(), area.argmax(), found.shear.argmax(), 7):
        # Each direction by its own stretch, where the table stretches both alike.
        along, across = found.stretch[cell]
        size = np.array([along, across, 1 / (along * across)])
        turned = voxels.direction * size
        turned /= np.maximum(np.linalg.norm(turned, axis=-1, keepdims=True), 1e-9)
        own = replace(voxels, direction=turned)
        gradient = shear_gradient(np.radians(found.shear[cell]))
        phases = stage.assign(own, spacing * size, gradient)
        exact = homogenise(phases, spacing * size)[0].stiffness
        np.testing.assert_allclose(found.stiffness[cell], exact, rtol=0, atol=5e-3 * exact.max())


def test_what_has_no_unit_cell_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    for words, text in (
        (["animal_in_carved_cage"], "has none"),
        (["plain_weave", "--fibre", "wool"], "unit_cell.fibre"),
        (["plain_weave", "-o", "a.vti"], "a.vti"),
        (["plain_weave", "--map", "a.csv", "--set", "cage.divisions=[2,2,2]"], "need a sheet"),
        (
            ["plain_weave", "--set", "unit_cell.layers=2", "--set", "unit_cell.nesting=1mm"],
            "nesting",
        ),
    ):
        with pytest.raises(SystemExit) as end:
            main(["constants", *words, "-q"])
        assert end.value.code == 2
        assert text in capsys.readouterr().err


def test_a_sheared_cell_of_layers_is_exact() -> None:
    # Layers along z stay layers; the fibres of one of them turn with the warp.
    share = np.zeros((8, 4, 4))
    share[:4] = 1.0
    number = np.where(share > 0, 0, -1).astype(np.int32)
    axis = np.broadcast_to([0.0, 1.0, 0.0], (*share.shape, 3))
    voxels = Voxels(share, number, axis, np.ones_like(share), 0.0)
    gradient = shear_gradient(np.radians(40.0))
    made = assign_materials(voxels, np.ones(3), lambda _: YARN, EPOXY, np.float64, gradient)
    found, _ = homogenise(made, np.ones(3), tolerance=1e-8)
    lean = np.array([np.sin(np.radians(40.0)), np.cos(np.radians(40.0)), 0.0])
    turned = symmetric(turn_stiffness(YARN, lean[None])[:, 0])
    exact = laminate(turned, EPOXY.stiffness, 0.5, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(found.stiffness, exact, rtol=0, atol=1e-13 * exact.max())


def test_a_stretched_cell_is_exact() -> None:
    # Layers of inclined fibres and of matrix; (1.2, 1.2, 1 / 1.44) tilts the fibres down.
    share = np.zeros((8, 4, 4))
    share[:3] = 1.0
    number = np.where(share > 0, 0, -1).astype(np.int32)
    axis = np.broadcast_to([0.6, 0.0, 0.8], (*share.shape, 3))
    voxels = Voxels(share, number, axis, np.ones_like(share), 0.0)
    packings = []

    def yarn(area: float) -> Constituent:
        packings.append(area)
        return YARN

    size = stretch_factors(1.44)
    made = assign_materials(voxels, np.ones(3), yarn, EPOXY, np.float64, np.diag(size))
    found, _ = homogenise(made, np.ones(3), tolerance=1e-8)
    tilted = np.array([0.6 * 1.2, 0.0, 0.8 / 1.44])
    turned = turn_stiffness(YARN, tilted[None] / np.linalg.norm(tilted))[:, 0]
    exact = laminate(symmetric(turned), EPOXY.stiffness, 3 / 8, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(found.stiffness, exact, rtol=0, atol=1e-13 * exact.max())
    assert size.prod() == pytest.approx(1.0, rel=1e-14)
    assert packings == [pytest.approx(1.0, rel=1e-14)]
