"""TransientResponse: parameters, starts, going on, and what is kept, in a pipeline."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy

from spacemap_vtk import (
    BarycentricWarp,
    ModalResponse,
    ModalSolver,
    RotationStrain,
    TetraCage,
    TransientResponse,
    WeaveSource,
)
from spacemap_vtk.cancel import Cancelled
from spacemap_vtk.errors import InputError, SpacemapWarning
from spacemap_vtk.filters.base import connect
from spacemap_vtk.filters.load import Load
from spacemap_vtk.filters.load_parameters import LoadParameters
from spacemap_vtk.scenes.scene import Scene


@pytest.fixture(autouse=True)
def folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A cache of its own."""
    monkeypatch.setenv("SPACEMAP_CACHE", str(tmp_path))
    return tmp_path


#: A pressure that follows its side.
FOLLOWER: dict[str, Any] = {"pressure": 5.0, "on": "+z", "follower": True}


def chain(mover: Any, modes: int = 1000, **modal: Any) -> Any:
    """Return a mover of a small, soft cage."""
    solver = ModalSolver(youngs_modulus=1e3, modes=modes, elements="tetrahedra", **modal)
    return connect(WeaveSource(ends=4, picks=3), TetraCage(divisions=(3, 3, 1)), solver, mover)


def at(mover: Any, time: float, name: str = "displacement") -> np.ndarray:
    mover.update(time)
    for data in (mover.output.GetPointData(), mover.output.GetCellData()):
        if data.GetArray(name) is not None:
            return vtk_to_numpy(data.GetArray(name)).copy()
    return vtk_to_numpy(mover.output.GetFieldData().GetArray(name)).copy()


def test_parameters_are_those_of_modal_response() -> None:
    for name in LoadParameters.parameters:
        assert TransientResponse.parameter(name) is ModalResponse.parameter(name), name
    assert set(ModalResponse.parameters) - set(TransientResponse.parameters) == {"residual_vectors"}


@pytest.mark.parametrize("damping", [{"alpha": 3.0}, {"damping_ratio": (0.05, 0.02)}])
def test_small_motion_equals_the_modal_response(damping: dict[str, Any]) -> None:
    """A light breath on a hung cage, in every array that both write, with default steps."""
    load = {"pressure": 1e-4, "on": "+z", "time": "ramp", "rise": 0.01}
    given: dict[str, Any] = {"loads": [load], **damping}
    hung: dict[str, Any] = {"gravity": (0, 0, -0.05)}
    modal = chain(ModalResponse(**given), **hung)
    stepped = chain(TransientResponse(**given), **hung)
    rest = vtk_to_numpy(modal.update(0.0).output.GetPointData().GetArray("equilibrium"))
    assert abs(rest).max() > 1e-7
    for name, share in (("displacement", 1e-4), ("velocity", 2e-2), ("strain", 1e-3)):
        before = at(modal, 0.0, name)
        change = at(modal, 0.008, name) - before
        found = at(stepped, 0.008, name) - before
        np.testing.assert_allclose(found, change, atol=share * abs(change).max(), err_msg=name)


def test_hanging_cage_rests_until_loads_change() -> None:
    still = chain(TransientResponse(initial="equilibrium", gravity=(0, 0, -1)))
    first, later = at(still, 0.0), at(still, 0.5)
    assert abs(first).max() > 1e-6
    np.testing.assert_allclose(later, first, atol=1e-6 * abs(first).max())
    released = {"gravity": [0, 0, 1.0], "time": "step", "start": 0.01}
    let_go = chain(TransientResponse(initial="equilibrium", gravity=(0, 0, -1), loads=[released]))
    np.testing.assert_allclose(at(let_go, 0.009), first, atol=1e-6 * abs(first).max())
    assert max(abs(at(let_go, t) - first).max() for t in (0.011, 0.012)) > 0.1 * abs(first).max()


def test_equilibrium_is_shared_with_modal_solver(folder: Path) -> None:
    at(chain(TransientResponse(initial="equilibrium", gravity=(0, 0, -1))), 0.0)
    (kept,) = folder.rglob("rest-*")
    written = kept.stat().st_ino  # what is written anew takes the place of a file
    at(chain(ModalResponse(), modes=8, gravity=(0, 0, -1)), 0.0)
    assert [*folder.rglob("rest-*")] == [kept]
    assert kept.stat().st_ino == written


def test_held_places_are_released_at_zero() -> None:
    both = chain(ModalSolver(), modes=8)
    both.configure(fixed="+y -y", gravity=(0, 0, -1), youngs_modulus=1e3, elements="tetrahedra")
    hung = vtk_to_numpy(both.update().output.GetPointData().GetArray("equilibrium"))
    mover = chain(TransientResponse(held="-y", gravity=(0, 0, -1)))
    start = at(mover, 0.0)
    np.testing.assert_allclose(start, hung, atol=1e-7 * abs(hung).max())
    low = np.isclose(start, 0.0).all(axis=1)
    assert max(abs(at(mover, t)[low]).max() for t in (0.001, 0.002, 0.003)) > abs(start).max()
    mover.initial = "equilibrium"
    with pytest.raises(InputError, match=r"held.*both define the initial state"):
        mover.update()


def test_given_initial_state_is_added() -> None:
    mover = chain(TransientResponse(initial_velocity=(0, 0, "1 cm/s"), gravity=(0, 0, 0)))
    assert at(mover, 0.0, "velocity")[:, 2].max() == pytest.approx(0.01)
    assert at(mover, -1.0, "velocity").max() == 0.0
    solver = mover.GetInputConnection(0, 0).GetProducer()
    grid = solver.update().output
    field = np.zeros((grid.GetNumberOfPoints(), 3))
    field[:, 2] = 1e-5
    array = numpy_to_vtk(field, deep=True)
    array.SetName("lift")
    moved = grid.NewInstance()
    moved.ShallowCopy(grid)
    moved.GetPointData().AddArray(array)
    alone = TransientResponse(initial_displacement_array="lift", gravity=(0, 0, 0))
    assert vtk_to_numpy(alone(moved).GetPointData().GetArray("displacement")).max() == 1e-5


def test_states_are_computed_once_cached_and_continued(folder: Path) -> None:
    mover = chain(TransientResponse(max_step="1 ms", tolerance=0.1))
    at(mover, 0.03)
    motion = mover.motion
    count = len(motion.states)
    late = at(mover, 0.02)
    assert mover.motion is motion
    assert len(motion.states) == count
    # What shows it differently does not step it anew.
    mover.configure(duration=20.0, stress=False, frames=7)
    at(mover, 0.02)
    assert mover.motion is motion
    assert list(folder.glob("steps-*"))
    other = chain(TransientResponse(max_step="1 ms", tolerance=0.1))
    np.testing.assert_array_equal(at(other, 0.02), late)
    assert len(other.motion.states) == count
    # Another load is another motion.
    other.alpha = 2.0
    assert abs(at(other, 0.02) - late).max() > 0
    assert len(other.motion.states) < count
    for entry in folder.glob("steps-*"):
        entry.write_bytes(b"nothing")
    np.testing.assert_array_equal(
        at(chain(TransientResponse(max_step="1 ms", tolerance=0.1)), 0.02), late
    )


@pytest.mark.nightly
def test_stopped_run_continues() -> None:
    mover = chain(TransientResponse(max_step="0.1 ms", tolerance=0.1))
    mover.update(0.0)
    shares: list[float] = []

    def stop(stage: Any, event: str) -> None:
        shares.append(stage.GetProgress())
        if stage.GetProgressText() == "stepping" and stage.GetProgress() > 0.4:
            stage.SetAbortExecute(1)

    tag = mover.AddObserver("ProgressEvent", stop)
    with pytest.raises(Cancelled):
        mover.update(0.02)
    mover.RemoveObserver(tag)
    mover.SetAbortExecute(0)
    reached = mover.motion.last_time
    assert 0.004 < reached < 0.02
    assert np.diff(shares).min() >= 0.0
    motion = mover.motion
    whole = at(mover, 0.02)
    assert mover.motion is motion
    other = at(chain(TransientResponse(max_step="0.1 ms", tolerance=0.1)), 0.02)
    np.testing.assert_allclose(other, whole, atol=1e-6 * abs(whole).max())


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"loads": [{"gravity": [0, 0, 1], "time": "harmonic", "frequency": 3, "steady": True}]},
            r"loads\[0\]\.steady.*Leave out steady",
        ),
        ({"held": "sphere(1, 1, 1, 1 mm)"}, "held"),
        (
            {"loads": [FOLLOWER], "initial": "equilibrium"},
            r"loads\[0\]\.follower.*follower pressures.*Start the load later",
        ),
    ],
)
def test_unsupported_parameters_are_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        chain(TransientResponse(**values), modes=6).update()


def test_pressure_follows_its_side_only_as_follower() -> None:
    """Both start alike, and part where the cage has turned."""
    ways = {"loads": [FOLLOWER]}, {"loads": [FOLLOWER | {"follower": False}]}
    movers = [
        chain(TransientResponse(gravity=(0, 0, 0), tolerance=0.1, **way), modes=6) for way in ways
    ]
    early, late = ([at(mover, time) for mover in movers] for time in (2e-4, 0.04))
    assert abs(early[0] - early[1]).max() < 5e-3 * abs(early[0]).max()
    assert abs(late[0] - late[1]).max() > 0.05 * abs(late[0]).max()
    with pytest.raises(InputError, match=r"loads\[0\]\.follower.*linear.*\[transient\]"):
        chain(ModalResponse(loads=[FOLLOWER]), modes=6).update()
    with pytest.raises(InputError, match=r"dead_loads\[0\]\.follower.*cannot follow its side"):
        ModalSolver(dead_loads=[FOLLOWER])
    with pytest.raises(InputError, match=r"follower.*only a pressure can follow its side"):
        Load(gravity=(0, 0, 1), follower=True)


def test_scene_has_transient_instead_of_response() -> None:
    small = {"weave": {"ends": 2, "picks": 2}, "surface": {"subdivisions": 1}}
    scene = Scene({**small, "transient": {"tolerance": 10.0}})
    assert scene.stage("mover") is scene.part(TransientResponse)
    scene.update(time=0.01)
    assert "strain" in scene.colorings
    turned = Scene({**small, "transient": {"tolerance": 10.0}, "rotation": {}, "yarns": {}})
    for time in (0.0, 0.01):  # though two ask it, the second once the first was refused
        with pytest.raises(InputError, match=r"Leave out the section \[rotation\]"):
            turned.update(time=time)
    # whoever else needs it is served, and this one not by what another has let run
    plain, rotation = BarycentricWarp(), turned.part(RotationStrain)
    connect((turned.source, turned.stage("mover")), plain)
    for time in (0.0, 0.01):
        plain.update(time=time)
        with pytest.raises(InputError, match=r"Leave out the section \[rotation\]"):
            rotation.update(time=time)


SWINGING = """
[weave]
pattern = "plain"
ends = 40
picks = 80
warp_spacing = "0.5 mm"
weft_spacing = "0.5 mm"
warp_diameter = "0.2 mm"
weft_diameter = "0.2 mm"
[yarns]
inextensible = false
tension = "60 N"
contact = "9 N"
bending = "1 mN.mm2"
[cage]
divisions = [1, 3, 1]
[modal]
elements = "sheet"
material = "yarns"
areal_mass = "0.15 kg/m2"
modes = 2
fixed = "+y"
[transient]
beta = {beta}
[[transient.loads]]
gravity = [0, -9.81, 0]
"""


@pytest.mark.nightly
def test_steps_that_ringing_yarns_shorten_are_reported_with_a_cure(tmp_path: Path) -> None:
    """Yarns that jerk taut ring without damping; with the damping of the message they do not."""
    counts = []
    for beta in ("0", "'0.1 ms'"):
        (tmp_path / "swing.toml").write_text(SWINGING.format(beta=beta), encoding="utf-8")
        stage = Scene.read(tmp_path / "swing.toml").stage("mover")
        assert isinstance(stage, TransientResponse)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SpacemapWarning)
            stage.update(0.02)
        assert stage.motion is not None
        counts.append(stage.motion.steps)
        found = [text for text in stage.warnings if "were halved" in text]
        assert len(found) == (beta == "0")
        assert all('beta = "0.1 ms"' in text for text in found)
    assert counts[0] > 1.8 * counts[1]
