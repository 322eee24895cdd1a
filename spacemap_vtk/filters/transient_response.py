"""TransientResponse: the cage's displacement from steps of the nonlinear equations of motion."""

from __future__ import annotations

import time as clock
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk import cache
from spacemap_vtk.datasets.arrays import add_number, mask_reader
from spacemap_vtk.datasets.modal_model import ModesReader, add_obstacle_moves, bodies_of
from spacemap_vtk.datasets.reactions import (
    REACTION,
    bearings_recipe,
    held_forces,
    set_reactions,
)
from spacemap_vtk.errors import InputError, add_key_to_errors
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.cage_fittings import Supports
from spacemap_vtk.filters.grip import read_bearings
from spacemap_vtk.filters.load_parameters import (
    MOTION_ARRAYS,
    LoadParameters,
    add_energies,
    add_motion,
    add_stress,
)
from spacemap_vtk.filters.rest_states import RestTask, load_or_solve_rest
from spacemap_vtk.filters.shape_limits import (
    check_crossing,
    check_folds,
    check_inversion,
    check_strains,
)
from spacemap_vtk.mechanics.boundary.reactions import Reaction
from spacemap_vtk.mechanics.boundary.supports import held_components, held_directions
from spacemap_vtk.mechanics.contact.resting import layers_of, obstacles_of
from spacemap_vtk.mechanics.equilibrium.energy_terms import digest_of
from spacemap_vtk.mechanics.modal.cage_modes import CageModes, LoadVector
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.parameters import Real

if TYPE_CHECKING:
    from spacemap_vtk.mechanics.transient.stepper import SteppedMotion


#: Prefix of entries on disk. Change it when the same parameters give other states.
_ENTRY = "steps-held"

#: Field arrays of a cage with obstacles or with friction of its layers: the energy that friction
#: dissipates, a part of dissipated_energy, and the work of moving obstacles, a part of
#: external_work.
CONTACT_ENERGIES = ("friction_energy", "obstacle_work")
#: Field array of the work of moving grips, another part of external_work.
GRIP_WORK = "grip_work"

#: Number of states in an entry on disk.
_CHUNK = 512
#: Time between two writes of an entry that is not full, in s.
_PAUSE = 5.0

#: Steps are short if at least so many were halved, and at least this share of all.
_MOST_HALVINGS, _MOST_HALVED = 50, 0.1


class TransientResponse(LoadParameters, Stage):
    """Move a cage by time steps of its nonlinear equations of motion, for any rotation.

    Loads, damping and initial state are those of ModalResponse. Strains are Green's strains, so
    rotations cause no stretch, and tension adds stiffness. Each state is computed once and kept in
    memory and in the user's cache folder. Later times continue from the last state; times between
    two states are interpolated. A run that was stopped continues from its last state.

    The output has the arrays of ModalResponse except the modal coordinates. Strain and stress are
    in axes that turn with the fabric. A cage that touches obstacles, or has friction of its layers,
    has two more field arrays: ``friction_energy``, the part of the dissipated energy that is due to
    friction, and ``obstacle_work``, the part of the external work that moving obstacles do;
    ``grip_work`` is that of moving grips. ``reaction_force`` (N) and ``reaction_moment`` (N m) are
    means over the time step, for each support, grip and obstacle.

    Notes
    -----
    Two-stage Gauss collocation of positions, rates and strains is of fourth order and conserves
    energy for any step, also when the cage hits obstacles. beta damps rates of strain; about an
    unstrained state this is Rayleigh damping.

    Examples
    --------
    >>> from spacemap_vtk import TransientResponse
    >>> TransientResponse(held="-x -y", max_step="5 ms").held
    ('-x', '-y')
    """

    section = "transient"
    role = "mover"
    inputs = ("vtkUnstructuredGrid",)
    takes = ("cage",)
    makes = "cage"
    excludes = ("rotation",)  # a stepped motion has no artificial stretch
    provides: ClassVar = MOTION_ARRAYS

    held = Supports(
        "",
        "Places that are held in their undeformed positions until t = 0, in addition to the "
        "supports. The motion starts from this equilibrium, when these places are released.",
    )
    tolerance = Real(
        1e-4,
        "Largest error after ten periods, as a share of the largest displacement; it determines "
        "the length of the steps.",
        above=0.0,
    )
    max_step = Real("20 ms", "Longest step.", unit="s", above=0.0)

    _modes: ModesReader | None = None
    _last_motion: tuple[str, SteppedMotion] | None = None
    _last_key: tuple[int, int] | None = None
    _stored: tuple[int, float] = (0, 0.0)

    @property
    def motion(self) -> SteppedMotion | None:
        """The motion as of the last update; None before the first."""
        return None if self._last_motion is None else self._last_motion[1]

    def check(self) -> None:
        """Check damping, loads and initial state."""
        super().check()
        for number, load in enumerate(self.loads):
            if load.steady:
                raise InputError(
                    "time stepping does not support steady loads, because they have no start",
                    key=f"loads[{number}].steady",
                    value=True,
                    cure="Leave out steady; with damping, the motion becomes steady by itself.",
                )
            if load.follower and self._starts_at_rest and load.function.value(0.0) != 0.0:
                raise InputError(
                    "the initial equilibrium does not support follower pressures",
                    key=f"loads[{number}].follower",
                    value=True,
                    cure='Start the load later (start = "1 ms"), or leave out held and initial.',
                )
        if self.held and self.initial != "rest":
            raise InputError(
                "held and initial both define the initial state",
                key="held",
                value=" ".join(self.held),
                cure='Leave out held, or initial = "equilibrium".',
            )

    def run(
        self, inputs: list[vtkUnstructuredGrid], output: vtkUnstructuredGrid, time: float
    ) -> None:
        """Step to `time`, or look it up; before t = 0 the cage is at rest in its initial state."""
        grid = inputs[0]
        key = grid.GetMTime(), self.GetMTime()
        if self._last_motion is None or self._last_key != key:
            if self._modes is None:
                self._modes = ModesReader()
            self._make_motion(grid, self._modes.read(grid))
            self._last_key = key
        assert self._last_motion is not None
        digest, motion = self._last_motion

        def report(share: float) -> None:
            rings = self._rings(motion)
            self.report_progress(share, "short steps: give beta" if rings else "stepping")

        try:
            motion.step_until(max(time, 0.0), report)
        finally:
            self._store_states(digest, motion)
        if self._rings(motion):
            self.warn(
                f"{motion.halvings} of {motion.steps} time steps were halved: without damping that "
                "is proportional to stiffness, cloth rings where it becomes slack or taut, and "
                f"{len(motion.states)} steps led to {motion.last_time:.3g} s; give beta = "
                '"0.1 ms", or a damping_ratio'
            )
        displacement, velocity, acceleration = motion.at_time(time)
        output.ShallowCopy(grid)
        add_motion(output, (displacement, velocity, acceleration))
        output.GetPointData().RemoveArray(REACTION)
        if time > 0.0:
            set_reactions(output, self._reactions(output, motion, time))
        model, moves = motion.model, motion.obstacle_moves(time)
        if moves.any():
            add_obstacle_moves(output, moves)
        at, surface = model.points + displacement, model.pencil.surface
        check_inversion(self, model.points, at, model.cells, surface)
        check_folds(self, grid, model.points, at, surface)
        check_crossing(self, at, surface)
        moved = displacement - motion.rest - motion.base_motion(time)[0]
        strain, stress = model.strain_and_stress(moved, large=True)
        check_strains(self, grid, strain, model)
        if self.stress:
            add_stress(output, strain, stress)
        if self.energy:
            add_energies(output, motion.energies(np.array([time]))[0])
            if motion.grips_move:
                work = float(motion.grip_work(np.array([time]))[0])
                add_number(output.GetFieldData(), GRIP_WORK, work)
            if obstacles_of(model) or layers_of(model):
                exchanged = motion.contact_energies(np.array([time]))[0]
                for name, value in zip(CONTACT_ENERGIES, exchanged, strict=True):
                    add_number(output.GetFieldData(), name, value)

    @property
    def _starts_at_rest(self) -> bool:
        return bool(self.held) or self.initial == "equilibrium"

    def _make_motion(self, grid: vtkUnstructuredGrid, modes: CageModes) -> None:
        """Make the motion, unless everything that it depends on is unchanged."""
        # This imports scipy's solvers, which listing the parameters does not need.
        from spacemap_vtk.mechanics.transient.stepper import SteppedMotion

        self.check()
        for text in self.warnings_of_far_loads(modes):
            self.warn(text)
        model, vectors = modes.model, self.load_vectors(grid, modes)
        displacement, velocity = self.initial_fields(grid)
        if self._starts_at_rest:
            displacement += self._equilibrium(grid, modes, vectors)
        elif model.displacement is not None:
            displacement += model.displacement
        ratios = [modes.eigenvalues, modes.shapes] if np.any(self.damping.ratio) else []
        damping = self.damping
        parts = [
            part
            for vector in vectors
            for part in (
                modes.vertex_forces(vector),
                vector.moves_base,
                vector.faces is None,
                *vector.function,
            )
        ]
        grips, bearings = read_bearings(bearings_recipe(grid), model.points, mask_reader(grid))
        holding = held_forces(grid)
        for grip in grips:
            parts += [grip.held, grip.center, grip.moves, *(grip.motion or ())[:2]]
            parts += [] if grip.motion is None else [*grip.motion.function]
        for bearing in bearings:
            parts += [bearing.shares.any(axis=(1, 2)), bearing.about]
        for term in obstacles_of(model):
            if term.motion is not None:
                parts += [term.motion.displacement, *term.motion.function]
        bounds = self.tolerance, self.max_step
        numbers = (model.modulus, model.density, *damping[:2], *bounds)
        ratios += [np.asarray(damping.ratio)] if ratios else []
        digest = digest_of(
            model.digest,
            *parts,
            *ratios,
            displacement,
            velocity,
            self._starts_at_rest,
            *map(float, numbers),
        )
        if self._last_motion is not None and self._last_motion[0] == digest:
            return
        motion = SteppedMotion(
            modes,
            vectors,
            damping,
            displacement=displacement,
            velocity=velocity,
            settled=self._starts_at_rest,
            tolerance=self.tolerance,
            max_step=self.max_step,
            grips=grips,
            bearings=bearings,
            holding=holding,
        )
        self._last_motion = digest, motion
        self._stored = 0, 0.0
        if kept := _read_states(digest):
            rows, slips = np.concatenate(kept), None
            if len(motion.slips):
                entry = cache.load(f"{_ENTRY}-{digest}-slips", count=(1,), slips=(-1, 3))
                if entry is None or entry["slips"].shape != motion.slips.shape:
                    return
                rows, slips = rows[: int(entry["count"][0])], entry["slips"]
            motion.resume(rows, slips)
            self._stored = len(motion.states), 0.0

    def _equilibrium(
        self, grid: vtkUnstructuredGrid, modes: CageModes, vectors: list[LoadVector]
    ) -> Floats:
        """Return the displacement at rest under the loads at t = 0 [m], (V, 3)."""
        model, load = modes.model, modes.model.forces.copy()
        for vector in vectors:
            if vector.moves_base is None:
                load += vector.function.value(0.0) * modes.vertex_forces(vector)
        if self.held:
            with add_key_to_errors("held"):
                held = held_components(model.points, self.held, mask_reader(grid))
                normals = held_directions(model.points, self.held, mask_reader(grid))
            fittings = model.fittings
            if normals is not None:
                both = normals if fittings.normals is None else normals + fittings.normals
                fittings = fittings._replace(normals=both)
            model = Model(
                model.points,
                model.cells,
                model.plate or model.elasticity,
                model.density,
                held | ~model.free.reshape(-1, 3),
                model.lumped,
                None,
                fittings,
                model.terms,
            )
        found = load_or_solve_rest(
            RestTask(model, load), lambda share: self.report_progress(share, "hanging")
        ).displacement
        return found if model.displacement is None else found + model.displacement

    def _reactions(
        self, grid: vtkUnstructuredGrid, motion: SteppedMotion, time: float
    ) -> list[Reaction]:
        """Return the mean reactions of the time step that ends at or after a time."""
        table, points = motion.reactions(np.array([time]))[0], motion.reaction_points(time)
        bodies = self.reacting_bodies(grid, motion)
        return [
            Reaction(*body, row[:3], row[3:], point)
            for body, row, point in zip(bodies, table, points, strict=True)
        ]

    def _rings(self, motion: SteppedMotion) -> bool:
        """Return whether many steps were halved because undamped yarns become slack and taut."""
        plate = motion.model.plate
        if plate is None or plate.law is None or self.damping.beta or np.any(self.damping.ratio):
            return False
        return motion.halvings >= max(_MOST_HALVINGS, _MOST_HALVED * motion.steps)

    @staticmethod
    def reacting_bodies(grid: vtkUnstructuredGrid, motion: SteppedMotion) -> list[tuple[str, str]]:
        """Return kind and name of each body in `SteppedMotion.reactions`.

        Parameters
        ----------
        grid : vtkUnstructuredGrid
            Output of the stage.
        motion : SteppedMotion
            Its motion.

        Returns
        -------
        list of (str, str)
            Kind and name of each support and grip, then of each obstacle.
        """
        bodies = [(bearing.kind, bearing.name) for bearing in motion.bearings]
        return bodies + [("obstacle", body["shape"]) for body in bodies_of(grid)]

    def _store_states(self, digest: str, motion: SteppedMotion) -> None:
        """Store the states computed since the last time on disk."""
        (count, last), rows, now = self._stored, motion.states, clock.monotonic()
        if len(rows) == count or (now - last < _PAUSE and len(rows) // _CHUNK == count // _CHUNK):
            return
        for number in range(count // _CHUNK, -(-len(rows) // _CHUNK)):
            chunk = rows[number * _CHUNK : (number + 1) * _CHUNK]
            cache.store(f"{_ENTRY}-{digest}-{number}", rows=chunk)
        if len(slips := motion.slips):
            count_now = np.array([float(len(rows))])
            cache.store(f"{_ENTRY}-{digest}-slips", count=count_now, slips=slips)
        self._stored = len(rows), now


def _read_states(digest: str) -> list[Floats]:
    """Read the states on disk, entry by entry."""
    found: list[Floats] = []
    while not found or len(found[-1]) == _CHUNK:
        shape = (-1, found[0].shape[1] if found else -1)
        entry = cache.load(f"{_ENTRY}-{digest}-{len(found)}", rows=shape)
        if entry is None or not entry["rows"].size or not np.isfinite(entry["rows"]).all():
            break
        found.append(entry["rows"])
    return found
