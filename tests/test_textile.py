"""A source of yarns that is not woven says what it is, and nothing answers as a weave for it."""

from __future__ import annotations

import json
from abc import abstractmethod
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
import pyvista as pv
from scipy.interpolate import CubicHermiteSpline
from vtkmodules.util.numpy_support import vtk_to_numpy

import spacemap_vtk
from spacemap_vtk.cli.main import main
from spacemap_vtk.datasets.arrays import add_array
from spacemap_vtk.datasets.cloth_data import add_cloth, set_patches
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.base import ProvidedArray, Stage
from spacemap_vtk.filters.textile import FabricFigure, Textile, Woven
from spacemap_vtk.io.drafts.draft_file import read_draft
from spacemap_vtk.jobs.sweep import execute_run
from spacemap_vtk.mechanics.elements.plates import data_sheet
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.parameters import Integer, Real
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.sweep import read_sweep
from spacemap_vtk.textile.crimp.interchange import YarnMechanics
from spacemap_vtk.textile.crimp.stiffness import cloth_stiffness
from spacemap_vtk.textile.drafts.draft import Draft
from spacemap_vtk.textile.geometry.section import build_section
from spacemap_vtk.textile.geometry.sweep import CentreLines, sweep
from spacemap_vtk.textile.geometry.weave import PatchCounts, build_weave, estimate_counts
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.threads import Threads

#: Places on a yarn between which it is a cubic.
STATIONS = 25


def centre_lines(lines: Floats, slopes: Floats, bends: Floats, radius: float) -> CentreLines:
    """Return lines through places (yarns, stations, 3), by their first two derivatives there."""
    count, stations = lines.shape[:2]
    speed = np.linalg.norm(slopes, axis=2, keepdims=True)
    tangent = slopes / speed
    normal = [0.0, 0.0, 1.0] - tangent[..., 2:] * tangent
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    lateral = np.cross(normal, tangent)
    curved = (bends - tangent * (bends * tangent).sum(axis=2, keepdims=True)) / speed**2

    def both_ends(values: Floats) -> Floats:
        return np.stack([values[:, :-1].ravel(), values[:, 1:].ravel()])

    def along(vectors: Floats) -> tuple[Floats, ...]:
        return tuple(vectors.reshape(-1, 3).T)

    return CentreLines(
        np.arange(count),
        np.full(count, radius),
        np.full(count, stations - 1),
        along(lines),
        along(tangent),
        along(normal),
        along(lateral),
        both_ends((curved * normal).sum(axis=2)),
        both_ends(speed[..., 0]) / 3,
        np.ones(1),
        both_ends((curved * lateral).sum(axis=2)),
    )


class Yarns(Stage, Textile):
    """Yarns along curves."""

    role = "source"
    provides: ClassVar = {"yarn": ProvidedArray("cell"), "color": ProvidedArray("cell")}

    count = Integer(20, "Number of yarns.", minimum=1)
    diameter = Real(4e-4, "Diameter of the yarns.", unit="m", above=0.0)

    @property
    def yarn_diameters(self) -> Floats:
        return np.full(self.count, self.diameter)

    @property
    def closed(self) -> bool:
        return True

    @abstractmethod
    def curves(self) -> tuple[Floats, Floats, Floats]: ...

    def run(self, inputs: list[Any], output: Any, time: float) -> None:
        lines = centre_lines(*self.curves(), self.diameter / 2)
        made = sweep([(lines, build_section("circular", 1.0, False))], caps=True, exact=False)
        set_patches(output, made)
        add_array(output.GetCellData(), "yarn", made.line)
        shade = (made.line % 2)[:, None].astype(np.uint8)
        add_array(output.GetCellData(), "color", np.uint8([200, 80, 60]) + shade * np.uint8(40))


class Rods(Yarns):
    """Parallel straight rods."""

    section = "rods"
    length = Real(1e-2, "Length of each rod.", unit="m", above=0.0)

    @property
    def extent(self) -> Floats:
        return np.array([(1.5 * self.count - 0.5) * self.diameter, self.length, self.diameter])

    @property
    def linear_densities(self) -> Floats:
        return np.full(self.count, 7850.0 * np.pi / 4 * self.diameter**2)

    @property
    def figures(self) -> list[FabricFigure]:
        return [FabricFigure("rod_length", "length of a rod", self.length, "m")]

    def curves(self) -> tuple[Floats, Floats, Floats]:
        share = np.linspace(0.0, 1.0, STATIONS)
        lines = np.zeros((self.count, STATIONS, 3))
        lines[..., 0] = 1.5 * self.diameter * np.arange(self.count)[:, None]
        lines[..., 1] = self.length * share
        slopes = np.zeros_like(lines)
        slopes[..., 1] = self.length / (STATIONS - 1)
        return lines, slopes, np.zeros_like(lines)


class Loops(Yarns):
    """Courses of knitted loops, one in the other, as sines make them (not relaxed)."""

    section = "loops"
    wales = Integer(4, "Number of loops in a course.", minimum=1)

    @property
    def families(self) -> dict[str, int]:
        return {"courses": self.count}

    @property
    def figures(self) -> list[FabricFigure]:
        return [FabricFigure("wale_spacing", "wale spacing", 6 * self.diameter, "m")]

    def curves(self) -> tuple[Floats, Floats, Floats]:
        d, turns = self.diameter, 2 * np.pi * self.wales
        t = np.linspace(0.0, turns, (STATIONS - 1) * self.wales + 1)
        wide, high, deep = 6 * d / (2 * np.pi), 3.2 * d, 0.6 * d
        x = wide * (t + 0.9 * np.sin(2 * t))
        parts = [
            np.stack([x, -high * np.cos(t), deep * np.cos(2 * t)]),
            np.stack(
                [wide * (1 + 1.8 * np.cos(2 * t)), high * np.sin(t), -2 * deep * np.sin(2 * t)]
            ),
            np.stack([-3.6 * wide * np.sin(2 * t), high * np.cos(t), -4 * deep * np.cos(2 * t)]),
        ]
        step = t[1] - t[0]
        lines, slopes, bends = (
            np.repeat(part.T[None] * step**power, self.count, axis=0)
            for power, part in enumerate(parts)
        )
        lines[..., 1] += 4 * d * np.arange(self.count)[:, None]
        return lines, slopes, bends


class Tabby(Stage, Woven):
    """Plain weave of warp and weft, by other parameters than those of [weave]."""

    section = "tabby"
    role = "source"
    provides: ClassVar = {"yarn": ProvidedArray("cell"), "color": ProvidedArray("cell")}

    threads = Integer(4, "Number of ends, and of picks.", minimum=2)
    _made: Cloth | None = None

    @property
    def cloth(self) -> Cloth:
        if self._made is None or self._made.size[0] != self.threads:
            alike = Threads(diameter=2.5e-4, spacing=5e-4)
            over = np.indices((self.threads, self.threads)).sum(axis=0) % 2 == 0
            self._made = Cloth(drawdown=over, warp=alike, weft=alike, density=900.0)
        return self._made

    @property
    def counts(self) -> PatchCounts:
        return estimate_counts(self.cloth)

    @property
    def source(self) -> Draft:
        return Draft(self.cloth.drawdown)

    @property
    def fibre_share(self) -> float:
        return 0.6

    @property
    def mechanics(self) -> YarnMechanics:
        return YarnMechanics(tension=(50.0, 50.0), contact=5.0, bending=(2e-9, 2e-9))

    def make_draft(self) -> Draft:
        return Draft(self.cloth.drawdown, self.source.find_loom(self.cloth.drawdown))

    def run(self, inputs: list[Any], output: Any, time: float) -> None:
        made = build_weave(self.cloth)
        add_cloth(output, self.cloth)
        set_patches(output, made)
        add_array(output.GetCellData(), "yarn", made.yarn)
        add_array(output.GetCellData(), "color", np.full((len(made.yarn), 3), 180, np.uint8))


@pytest.fixture(autouse=True)
def sources(monkeypatch: pytest.MonkeyPatch) -> None:
    """A line of the program's table for each source."""
    for source in (Rods, Loops, Tabby):
        monkeypatch.setitem(spacemap_vtk.FILTERS, source.__name__, __name__)


MOVING = """
[cage]
divisions = [4, 4, 1]
[modal]
youngs_modulus = "60 kPa"
[response]
[view]
size = [320, 240]
"""


@pytest.fixture(params=[pytest.param("rods", marks=pytest.mark.nightly), "loops"])
def scene(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A scene that hangs and swings."""
    file = tmp_path / f"{request.param}.toml"
    file.write_text(f"[{request.param}]\ncount = 5\n{MOVING}", "utf-8")
    return file


def called(*words: object) -> int:
    with pytest.raises(SystemExit) as ended:
        main([str(word) for word in words])
    return int(ended.value.code or 0)


def test_loops_have_the_stated_diameter() -> None:
    scene = Scene({"loops": {"count": 1}})
    scene.update()
    places, slopes, _ = scene.part(Loops).curves()
    middle = CubicHermiteSpline(np.arange(len(places[0])), places[0], slopes[0])
    fine = middle(np.linspace(0, len(places[0]) - 1, 4000))
    points = np.asarray(pv.wrap(scene.polygons).points, dtype=np.float64)
    far = np.array([np.linalg.norm(fine - point, axis=1).min() for point in points[::7]])
    assert far.max() == pytest.approx(2e-4, rel=0.03)


def test_a_textile_has_its_own_figures(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert called("info", scene, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    own = found["textile"]
    assert (own["kind"], own["yarns"], own["diameters"]) == (scene.stem, 5, [4e-4, 4e-4])
    assert own["families"] == ({"yarns": 5} if scene.stem == "rods" else {"courses": 5})
    assert (own["rod_length"] if scene.stem == "rods" else own["wale_spacing"]) > 0
    if scene.stem == "rods":
        assert own["extent"] == pytest.approx(found["size"], rel=1e-6)
        assert own["linear_densities"] == pytest.approx([9.8646e-4] * 2, rel=1e-4)
    else:
        assert (own["extent"], own["linear_densities"]) == (None, None)
    assert not {"ends", "picks", "drawdown", "warp", "weft"} & found.keys()
    assert called("info", scene) == 0
    reported = capsys.readouterr().out
    assert "0.4 mm" in reported
    assert ("2.8 mm x 10 mm x 0.4 mm" in reported) == (scene.stem == "rods")
    assert ("986.46 tex" in reported) == (scene.stem == "rods")
    assert "crimp" not in reported


def test_a_weave_states_the_same_figures() -> None:
    scene = Scene({"weave": {"ends": 3, "picks": 2, "weft_diameter": 3e-4}})
    assert scene.textile is scene.source
    np.testing.assert_allclose(scene.textile.yarn_diameters, [2.5e-4] * 3 + [3e-4] * 2)
    assert scene.textile.families == {"warp": 3, "weft": 2}
    scene.update()
    low, high = np.reshape(scene.patches.GetBounds(), (3, 2)).T
    np.testing.assert_allclose(scene.textile.extent, high - low)
    # 0.25 mm and 0.3 mm of cotton, 1520 kg/m3, that fills 0.6 of the section.
    expected = [0.6 * 1520 * np.pi / 4 * d**2 for d in [2.5e-4] * 3 + [3e-4] * 2]
    np.testing.assert_allclose(scene.textile.linear_densities, expected)
    assert scene.textile.make_draft().size == (3, 2)
    assert scene.woven is scene.textile


def test_a_textile_without_draft_is_drawn_and_exported(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert called("render", scene, "-o", tmp_path / "a.png", "--size=320x240", "-q") == 0
    picture = pv.read(tmp_path / "a.png").point_data.active_scalars
    assert len(np.unique(picture.reshape(-1, picture.shape[-1]), axis=0)) > 1000
    assert called("export", scene, "-o", tmp_path / "a.vtp", "-q") == 0
    assert set(np.unique(pv.read(tmp_path / "a.vtp").cell_data["yarn"])) == set(range(5))
    assert called("export", scene, "-o", tmp_path / "a.glb", "-q", "--to=0.1") == 0
    capsys.readouterr()
    assert called("export", scene, "-o", tmp_path / "a.wif") == 2
    assert "not woven" in capsys.readouterr().err
    assert not (tmp_path / "a.wif").exists()


def test_a_figure_has_its_pictures_and_no_weave(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert called("figure", scene, "-o", tmp_path / "a.png", "-q") == 0
    capsys.readouterr()
    assert called("figure", scene, "-o", tmp_path / "b.png", "--panels=draft") == 2
    assert "not woven" in capsys.readouterr().err


def test_a_sweep_has_its_figures_and_its_pictures(scene: Path) -> None:
    # Run here: another process would not know the sources of this file.
    runs = read_sweep(scene, [f"{scene.stem}.diameter=0.2mm,0.3mm"]).runs
    found = [execute_run(run) for run in runs]
    assert [one.error for one in found] == ["", ""]
    assert [float(one.figures["diameter [mm]"]) for one in found] == [0.2, 0.3]
    assert {one.figures["yarns"] for one in found} == {"5"}
    assert all(len(one.pictures[0]) > 10_000 for one in found)


def test_another_source_of_cloth_has_what_a_weave_has(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "tabby.toml"
    file.write_text(f"[tabby]\nthreads = 5\n{MOVING}", "utf-8")
    assert called("info", file, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["ends"], found["picks"], found["shafts"]) == (5, 5, 2)
    assert found["warp"]["crimp"] == pytest.approx(0.1435, abs=1e-4)
    assert called("render", file, "-o", tmp_path / "a.png", "--size=320x240", "-q") == 0
    assert called("export", file, "-o", tmp_path / "a.wif", "-q") == 0
    np.testing.assert_array_equal(
        read_draft(tmp_path / "a.wif").drawdown, Scene.read(file).woven.cloth.drawdown
    )
    assert called("figure", file, "-o", tmp_path / "b.png", "--panels=draft,section", "-q") == 0


def test_what_needs_a_weave_is_absent_or_refused(scene: Path) -> None:
    read = Scene.read(scene)
    assert read.woven is None
    assert not hasattr(read, "weave")
    assert read.draft_file is None
    assert read.find_obstacle() is None
    with pytest.raises(InputError, match="the scene is not woven and has no draft"):
        _ = read.draft


def test_yarns_without_a_diameter_are_refused() -> None:
    class Bare(Stage, Textile):
        section = "bare"
        role = "source"

    with pytest.raises(NotImplementedError, match="Bare must define yarn_diameters"):
        _ = Bare().yarn_diameters


def test_a_source_may_define_the_mechanics_of_its_yarns() -> None:
    modal = {"elements": "sheet", "material": "yarns"}
    scene = Scene({"tabby": {}, "modal": modal})
    scene.update()
    known = scene.part(Tabby)
    expected = data_sheet(cloth_stiffness(known.cloth, known.mechanics), 1.0)
    tension = vtk_to_numpy(scene.modal.output.GetFieldData().GetArray("tensile_rigidity"))
    np.testing.assert_allclose(tension, expected.tensile_rigidity, rtol=1e-12)
    # A section [yarns] takes precedence.
    yarns = {"inextensible": False, "tension": 50.0, "contact": 5.0, "bending": 4e-9}
    scene = Scene({"tabby": {}, "yarns": yarns, "modal": modal})
    scene.update()
    other = vtk_to_numpy(scene.modal.output.GetFieldData().GetArray("bending_rigidity"))
    assert other == pytest.approx(2 * np.array(expected.bending_rigidity))
