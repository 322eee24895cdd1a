"""Presets of motion: from any draft or textile to cloth that hangs, lies, falls or swings."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk.applicability import LIMITS, LimitWarning
from spacemap_vtk.cli.main import main
from spacemap_vtk.datasets.arrays import elements_of, points_of
from spacemap_vtk.datasets.modal_model import contact_of
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.embedding.smooth import SmoothInterpolation
from spacemap_vtk.errors import InputError, SolverError
from spacemap_vtk.filters.obstacle_surfaces import obstacle_surfaces
from spacemap_vtk.io.formats.toml import parse_toml
from spacemap_vtk.mechanics.contact.crossing import count_crossed_cells
from spacemap_vtk.mechanics.contact.obstacles import Cylinder
from spacemap_vtk.mechanics.elements.inversion import count_inverted
from spacemap_vtk.scenes import library
from spacemap_vtk.scenes.presets import PRESETS, apply, make_plan, plain_warnings, write_scene
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.weave.yarn_library import (
    COHESION,
    MATERIALS,
    YARN_MODULUS,
    YARNS,
    parse_yarn,
)

DRAFTS = library.folder() / "drafts"
TWILL = DRAFTS / "twill_2_2.wif"


def state(scene: Scene, time: float | None = None) -> Any:
    """Return the displacement of the cage at a time."""
    scene.update_stage(scene.cage_stage, time)
    return vtk_to_numpy(scene.deformed_cage.GetPointData().GetArray("displacement"))


# Initial moduli [N/tex] of Morton and Hearle (2008), table 13.1: Upper cotton, flax, crossbred wool
# 56s, silk, Fibro; specific flexural rigidities [mN mm2/tex2] of table 17.1, where it has them.
@pytest.mark.parametrize(
    ("material", "modulus", "rigidity"),
    [
        ("cotton", 5.0, None),
        ("linen", 18.0, None),
        ("wool", 2.1, 0.20),
        ("worsted", 2.1, 0.20),
        ("silk", 7.3, 0.19),
        ("rayon", 6.5, 0.19),
    ],
)
def test_fibres_have_the_published_stiffness(
    material: str, modulus: float, rigidity: float | None
) -> None:
    fibre = MATERIALS[material].fibre
    assert fibre.modulus == pytest.approx(1e6 * modulus)
    if rigidity is None:  # (1/4π) η E/ρ in N/tex, g/cm3: with η = 0.74 as viscose, or 1
        density = MATERIALS[material].density
        shape = 0.74 if material == "cotton" else 1.0
        rigidity = shape * modulus / (4 * math.pi * density / 1000)
    assert fibre.rigidity == pytest.approx(1e3 * rigidity, rel=1e-6)


@pytest.mark.parametrize("name", YARNS)
def test_a_yarn_bends_as_its_fibres_side_by_side(name: str) -> None:
    yarn = parse_yarn(name)
    fibre = yarn.material.fibre
    fibres = yarn.linear_density / fibre.linear_density
    free = fibres * fibre.rigidity * fibre.linear_density**2
    assert yarn.bending == pytest.approx(COHESION * free)
    assert yarn.tension == pytest.approx(YARN_MODULUS * fibre.modulus * yarn.linear_density)
    # Between fibres that slide freely and fibres that do not slide at all.
    assert free < yarn.bending < fibres * free


def test_spun_cotton_of_30_tex_is_that_of_the_scene_yarn_to_cloth() -> None:
    yarn = parse_yarn("30 tex cotton")
    assert yarn.tension == pytest.approx(90.0)
    assert yarn.bending == pytest.approx(2e-9, rel=0.05)  # N m2


@pytest.mark.parametrize("preset", PRESETS)
def test_each_preset_makes_a_scene_of_a_tiny_draft(preset: str, tmp_path: Path) -> None:
    scene = apply(TWILL, preset)
    scene.check()
    assert scene.modal.material == "yarns"
    assert scene.modal.elements == "sheet"
    width, _, thickness = scene.woven.extent
    # A repeat of 16 by 16 yarns, 8 mm, would not bend.
    assert width > 0.1
    assert scene.woven.cloth.size[0] % 16 == 0
    assert scene.cage.divisions[2] == 1
    assert width / scene.cage.divisions[0] > thickness
    stage = scene.stage("mover")
    assert (stage.section == "transient") == (preset in ("drop", "swing"))
    saved = tmp_path / "saved.toml"
    write_scene(scene, saved)
    again = Scene.read(saved)
    assert again.given_sections == scene.given_sections
    for section, settings in scene.settings.items():
        for key, value in settings.items():
            found = again.settings[section][key]
            if key == "draft":
                found, value = found.resolve(), value.resolve()
            assert found == value or str(found) == str(value), (section, key)
    text = saved.read_text()
    assert text.count(" # ") > 3
    width = {"hang": "at least 6 cells across a pleat", "swing": "cells are 0.7 bending lengths"}
    assert width.get(preset, "cells are 0.5 bending lengths") in text
    assert re.search(r"\d{7}", text) is None  # no digits of rounding
    assert max(map(len, text.splitlines())) <= 120


def test_a_saved_curtain_has_one_line_for_each_ring(tmp_path: Path) -> None:
    scene = apply(TWILL, "hang")
    write_scene(scene, tmp_path / "curtain.toml")
    text = (tmp_path / "curtain.toml").read_text()
    pleats = len(scene.modal.springs)
    assert pleats >= 4
    assert (
        len(re.findall(r"^    \{force = .*\}, *$|^    \{force = .*\},$", text, re.M)) == 2 * pleats
    )
    assert len(re.findall(r'^    "sphere.*:z", "sphere.*:y",$', text, re.M)) == pleats
    assert len(text.splitlines()) < 95


def test_a_cloth_drapes_under_its_own_weight_and_lies_on_the_table() -> None:
    scene = apply(TWILL, "drape", size=[0.12])
    scene.assign("cage", "divisions", [8, 8, 1])
    moved = state(scene, 0.0)
    points = points_of(scene.modal.output)
    disc = scene.modal.obstacles[0]
    away = np.hypot(*points[:, :2].T)
    on_table = away < 0.6 * disc.radius
    corners = away > 0.98 * away.max()
    assert abs(moved[on_table, 2]).max() < 2e-3
    overhang = away.max() - disc.radius
    assert (moved[corners, 2] < -0.3 * overhang).all()
    weight = scene.modal.output.GetFieldData().GetArray("areal_mass").GetValue(0) * 9.80665
    force = scene.modal.output.GetFieldData().GetArray("reaction_force")
    total = vtk_to_numpy(force).reshape(-1, 3)[:, 2].sum()
    area = float(np.prod(scene.woven.extent[:2]))
    assert total == pytest.approx(weight * area, rel=0.02)


def lowest_gap(scene: Scene) -> float:
    """Return the least distance [m] of the underside of the drawn cloth from the table."""
    moved, cage = state(scene, 0.0), scene.modal.output
    rest, cells = points_of(cage).astype(np.float64), elements_of(cage)
    low, high = rest.min(axis=0), rest.max(axis=0)
    lines = [np.linspace(low[axis], high[axis], 200) for axis in (0, 1)]
    under = np.stack(np.broadcast_arrays(*np.meshgrid(*lines), low[2]), axis=-1).reshape(-1, 3)
    where = locate(under, rest, cells, "clamp")
    drawn, _ = SmoothInterpolation(under, where, rest, cells).displace(under, moved)
    disc = scene.modal.obstacles[0]
    radius, height, rounding = disc.radius, disc.height, disc.rounding
    middle = (*disc.center[:2], disc.center[2] - height / 2)
    return float(Cylinder(radius, height, rounding, middle).gap(drawn).min())


def test_the_table_does_not_show_through_the_cloth() -> None:
    scene = apply(TWILL, "drape", size=[0.12])
    assert scene.warp.smooth
    gap = lowest_gap(scene)
    assert 0.0 < gap < scene.modal.obstacles[0].gap
    # Cloth on a round table hangs as evenly as its own weave allows.
    points, moved = points_of(scene.modal.output), state(scene, 0.0)
    corners = np.argsort(-np.hypot(*points[:, :2].T))[:8]
    assert np.ptp(moved[corners, 2]) < 0.02 * scene.woven.extent[0]


def test_the_same_scene_from_its_file_moves_in_the_same_way(tmp_path: Path) -> None:
    scene = apply(TWILL, "swing", size=[0.08])
    scene.assign("cage", "divisions", [4, 6, 1])
    write_scene(scene, tmp_path / "swing.toml")
    again = Scene.read(tmp_path / "swing.toml")
    np.testing.assert_allclose(state(again, 0.1), state(scene, 0.1), rtol=0, atol=1e-12)


def test_explicit_values_and_options_replace_those_of_the_preset(tmp_path: Path) -> None:
    from spacemap_vtk.cli.options import Motion, open_scene

    motion = Motion(
        drape=True, yarn="8/2 cotton", cloth_size="20x30cm", save_scene=tmp_path / "x.toml"
    )
    scene = open_scene(str(TWILL), ["cage.divisions=[3,4,1]", "view.camera=face"], motion)
    assert scene.cage.divisions == (3, 4, 1)
    assert scene.view.camera == "face"
    width, height = scene.woven.extent[:2]
    assert width == pytest.approx(0.20, abs=0.003)
    assert height == pytest.approx(0.30, abs=0.003)
    # 8/2 cotton at its usual 20 ends per inch.
    assert scene.woven.cloth.size[0] == pytest.approx(0.20 / 0.0254 * 20, abs=2)
    values = parse_toml((tmp_path / "x.toml").read_text())
    assert values["cage"]["divisions"] == [3, 4, 1]
    assert any("8/2 cotton" in note for note in scene.warnings)


def test_a_cloth_for_files_has_few_crossings_and_a_large_draft_is_cut() -> None:
    scene = apply(TWILL, "hang", crossings=5000)
    assert 4500 < np.prod(scene.woven.cloth.size) <= 5200
    assert any("--cloth-size makes it larger" in note for note in scene.warnings)
    plan = make_plan(Scene.read(DRAFTS / "diamond_twill.wpo"), "hang")
    assert plan.values["weave"]["ends"] < 641
    (found,) = [note for note in plan.notes if "of 641 ends" in note]
    assert "--cloth-size" in found
    assert "of 641 ends" in found.for_window
    assert "--" not in found.for_window
    plan = make_plan(Scene.read(DRAFTS / "diamond_twill.wpo"), "hang", size=[0.65])
    assert plan.values["weave"]["ends"] == pytest.approx(641, abs=2)


def test_cloth_too_large_for_the_cells_of_time_steps_is_refused() -> None:
    # 40 cm of it has cells of 1.7 bending lengths, which turned inside out on the ball.
    overshot = Scene.read(DRAFTS / "overshot.wif")
    for preset in ("drop", "swing"):
        with pytest.raises(InputError, match="bending length") as raised:
            make_plan(overshot, preset, yarn="8/2 cotton", size=[0.4])
        assert "a side of at most 259 mm" in str(raised.value)
        make_plan(overshot, preset, yarn="8/2 cotton", size=[0.25])
    make_plan(overshot, "drape", yarn="8/2 cotton", size=[0.4])
    # 70 cm of it had cells that turned inside out on the table, too, after half a minute.
    with pytest.raises(InputError, match="too large to drape") as raised:
        make_plan(overshot, "drape", yarn="8/2 cotton", size=[0.7])
    assert "a side of at most 424 mm" in str(raised.value)
    plan = make_plan(overshot, "hang", yarn="8/2 cotton", size=[1.2])
    assert math.prod(plan.values["cage"]["divisions"]) < 5000
    assert "its sharpest folds are rounder in reality" in plan.notes[-1]
    with pytest.raises(InputError, match="too large to hang"):
        make_plan(overshot, "hang", yarn="8/2 cotton", size=[30.0])


def test_warnings_of_a_preset_name_no_keys_of_scenes() -> None:
    scene = apply(TWILL, "drape")
    before = len(scene.warnings)
    for key in ("fold", "lean"):
        scene.warn(LimitWarning(LIMITS[key].warning(2.0), key, 2.0))
    (warning,) = scene.warnings[before:]
    assert warning.startswith("the sharpest folds of real cloth would be a little rounder")
    assert "--set" in warning
    # The window and the browser show it without the option.
    assert plain_warnings(scene.title)["fold"] == warning.replace(
        " (--set cage.divisions=auto)", ""
    )
    assert plain_warnings("Twill") == {}


@pytest.mark.parametrize("name", ["twill_2_2.wif", "diamond_twill.wpo"])
def test_cloth_that_falls_has_the_drag_of_air_and_cells_for_its_folds(name: str) -> None:
    scene = apply(DRAFTS / name, "drop")
    solver = scene.stage("mover")
    scene.update_stage(scene.cage_stage, 0.0)
    weight = scene.modal.output.GetFieldData().GetArray("areal_mass").GetValue(0) * 9.80665
    # At the speed v where the drag α v carries the weight, the pressure ½ ρ c_D v² does, too.
    speed = 9.80665 / solver.damping.alpha
    assert 0.5 * 1.2 * 1.17 * speed**2 == pytest.approx(weight, rel=0.05)
    # Nine bending lengths, in cells of half of one.
    assert min(scene.cage.divisions[:2]) >= 16


def test_heavy_cloth_falls_in_narrower_cells() -> None:
    # In 18 by 18 cells this knit turned inside out in a fold.
    assert min(apply("stockinette", "drop").cage.divisions[:2]) >= 24


def test_a_yarn_of_the_scene_is_kept() -> None:
    weave = {"pattern": "plain", "warp_yarn": "20/2 silk", "weft_yarn": "20/2 silk"}
    weave |= {"warp_sett": "24 epi", "weft_sett": "24 epi"}
    plan = make_plan(Scene({"weave": weave}), "hang")
    silk = parse_yarn("20/2 silk")
    assert plan.values["yarns"]["bending"] == f"{silk.bending * 1e9:.3g} mN.mm2"
    assert "20/2 silk" in plan.notes[0]
    own = {"inextensible": False, "tension": "90 N", "bending": "2 mN.mm2"}
    plan = make_plan(Scene({"weave": {}, "yarns": own}), "hang")
    assert plan.values["yarns"]["tension"] == "90 N"
    assert plan.notes == []


def test_pleats_of_a_curtain_go_to_the_front_and_the_back_in_turn() -> None:
    scene = apply(TWILL, "hang")
    scene.assign("modal", "modes", 6)
    moved = state(scene, 0.0)
    points = points_of(scene.modal.output)
    top = np.isclose(points[:, 1], points[:, 1].max()) & (points[:, 2] > 0)
    order = np.argsort(points[top, 0])
    depth = moved[top, 2][order]
    signs = np.sign(depth[np.abs(depth) > 0.3 * np.abs(depth).max()])
    assert np.count_nonzero(np.diff(signs)) >= 3
    span = np.ptp((points + moved)[top, 0]) / np.ptp(points[top, 0])
    assert span == pytest.approx(0.78, abs=0.03)
    # The rail is just above the cloth, which does not touch it.
    (contact,) = contact_of(scene.modal.output)
    assert contact.points == 0
    ((_, rail),) = obstacle_surfaces(scene.modal.output)
    radius = np.ptp(rail.points[:, 2]) / 2
    below = np.abs((points + moved)[:, 2]) < radius
    gap = rail.points[:, 1].min() - (points + moved)[below, 1].max()
    assert 0.0 <= gap < 1e-3
    assert np.ptp(rail.points[:, 0]) > np.ptp(points[:, 0])


@pytest.mark.parametrize("name", ["plain_weave", "double_weave", "leno"])
def test_other_textiles_have_presets(name: str) -> None:
    scene = apply(name, "drape")
    scene.check()
    figures = scene.modal.gravity
    assert figures[2] == pytest.approx(-9.80665)


@pytest.mark.parametrize("size", [-0.1, (0.1, 0.0), (0.1, 0.1, 0.1), ("10 cm", "10 cm"), math.nan])
def test_what_is_no_size_is_refused(size: Any) -> None:
    with pytest.raises(InputError, match="must be a size of cloth"):
        apply("plain_weave", "drape", size=size)


def test_what_is_no_cloth_is_refused_with_the_cure(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(InputError, match="only a textile"):
        apply(Scene({"object": {"file": "x.ply"}}), "drape")
    for words, expected in (
        (["--drape", "--hang"], "cannot be combined with"),
        (["--yarn", "8/2 cotton"], "needs --hang, --drape, --drop or --swing"),
        (["--drape", "--cloth-size", "3 bananas"], "must be a size of cloth"),
        (["--drape", "--cloth-size", "30"], "Write for example 30cm"),
        (["--drape", "--yarn", "8/2 hay"], "not the name of a yarn"),
    ):
        with pytest.raises(SystemExit) as left:
            main(["render", str(TWILL), "-o", "x.png", *words])
        assert left.value.code == 2
        assert expected in capsys.readouterr().err


def test_a_linear_motion_beyond_a_right_angle_is_refused_with_the_cure() -> None:
    # What a draft did whose modal response was switched on: lengths changed by thousands of times.
    scene = Scene(
        {"weave": {"ends": 60, "picks": 60, "warp_spacing": "1 mm", "weft_spacing": "1 mm"}}
    )
    scene.assign("response", "alpha", 2.0)
    state_at_start = scene.update(time=0.0)
    assert state_at_start is None
    with pytest.raises(SolverError, match="linear motion shows nothing real") as raised:
        scene.update(time=1.0)
    assert "--hang" in str(raised.value)
    cure = str(raised.value.window_cure)
    assert f"Cloth > {PRESETS['hang'].label}" in cure
    assert "Rotation strain" in cure
    assert "--hang" not in cure


@pytest.mark.nightly
@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize(
    "name",
    ["apron.wif", "overshot.wif", "tartan_gordon.wif", "huck_lace.wif", "diamond_twill.wpo"],
)
def test_real_drafts_move_without_exploding(name: str, preset: str) -> None:
    scene = apply(DRAFTS / name, preset)
    moved = state(scene, scene.view.time)
    assert np.isfinite(moved).all()
    assert abs(moved).max() < 3 * float(max(scene.woven.extent))
    assert not [text for text in scene.warnings if "inside out" in text or "pass through" in text]


@pytest.mark.nightly
@pytest.mark.parametrize("preset", ["drop", "swing"])
@pytest.mark.parametrize("name", ["diamond_twill.wpo", "twill_2_2.wif", "stockinette"])
def test_a_motion_in_steps_gains_no_energy_and_never_folds_through_itself(
    name: str, preset: str
) -> None:
    path = DRAFTS / name
    scene = apply(path if path.exists() else name, preset)
    span = scene.animation.stop
    state(scene, span)
    motion = scene.stage("mover").motion
    times = np.linspace(0.0, span, 41)
    kinetic, strain, lost, work = motion.energies(times).T
    assert kinetic + strain + lost == pytest.approx(work, abs=1e-5 * abs(work).max())
    assert (np.diff(lost) >= -1e-9 * lost.max()).all()
    model = motion.model
    surface = model.pencil.surface
    for time in times:
        moved = motion.at_time(float(time))[0]
        assert count_inverted(model.points, moved, model.cells, surface) == 0
        assert count_crossed_cells(model.points + moved, surface) == 0


@pytest.mark.nightly
@pytest.mark.parametrize(
    "name", sorted(file.name for file in DRAFTS.iterdir() if file.suffix in (".wif", ".wpo"))
)
def test_each_draft_drapes_evenly_over_a_table_that_does_not_show(name: str) -> None:
    scene = apply(DRAFTS / name, "drape")
    assert lowest_gap(scene) > 0.0
    points, moved = points_of(scene.modal.output), state(scene, 0.0)
    extent = scene.woven.extent[0]
    table = np.hypot(*points[:, :2].T) < 0.5 * scene.modal.obstacles[0].radius
    assert np.ptp(moved[table, 2]) < 0.01 * extent
    assert abs(moved).max() < extent
    assert not [text for text in scene.warnings if isinstance(text, LimitWarning)]
