"""ModalSolver: the vibration modes of a viscoelastic cage."""

from __future__ import annotations

import json
import math
import time as clock
import weakref
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, ClassVar, NamedTuple

import numpy as np
from vtkmodules.vtkCommonCore import vtkDataArray
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk import cache
from spacemap_vtk.applicability import LIMITS
from spacemap_vtk.datasets.arrays import (
    add_array,
    add_number,
    elements_of,
    mask_reader,
    points_of,
    to_array,
)
from spacemap_vtk.datasets.cloth_data import cloth_of
from spacemap_vtk.datasets.extent import filled_share, up_axis
from spacemap_vtk.datasets.modal_model import (
    MODE_NAME,
    add_contact,
    add_model,
    add_sheet,
    add_terms,
    contact_of,
)
from spacemap_vtk.datasets.reactions import (
    PathReactions,
    add_bearings,
    add_reactions,
    remove_reactions,
)
from spacemap_vtk.errors import InputError, SolverError, SpacemapError, add_key_to_errors
from spacemap_vtk.filters.base import ProvidedArray, Stage
from spacemap_vtk.filters.cage_fittings import CageFittings
from spacemap_vtk.filters.cage_material import WOVEN
from spacemap_vtk.filters.grip import Grips, bearing_recipe, hold_with_grips, make_grips
from spacemap_vtk.filters.law_parameters import LawParameters
from spacemap_vtk.filters.layer_contact import LAYER_FRICTION
from spacemap_vtk.filters.load import DeadLoads, load_vectors
from spacemap_vtk.filters.obstacle import Obstacles
from spacemap_vtk.filters.rest_states import RestState, RestTask, load_or_solve_rest
from spacemap_vtk.filters.shape_limits import LAW_CRIMP, check_folds, check_strains
from spacemap_vtk.filters.textile import StatedYarns
from spacemap_vtk.filters.textile_sheet import content_of, sheet_of_textile, textile_of
from spacemap_vtk.filters.textiles.kind import TextileKind
from spacemap_vtk.filters.yarn_parameters import YarnParameters
from spacemap_vtk.io.rest_state import read_rest_state
from spacemap_vtk.mechanics.boundary.places import Place, find_spans, parse_places
from spacemap_vtk.mechanics.boundary.reactions import find_bearings
from spacemap_vtk.mechanics.boundary.time_functions import step
from spacemap_vtk.mechanics.contact.obstacle_term import contact_stiffness
from spacemap_vtk.mechanics.contact.path import divide_path
from spacemap_vtk.mechanics.contact.resting import (
    Resting,
    count_anchors,
    obstacles_of,
    rested_terms,
)
from spacemap_vtk.mechanics.elements.locking import Locking, estimate_locking, proportions_of
from spacemap_vtk.mechanics.elements.materials import equivalent_poissons_ratio
from spacemap_vtk.mechanics.elements.measured_fabrics import FABRICS
from spacemap_vtk.mechanics.elements.plates import DataSheet, Plate, data_sheet
from spacemap_vtk.mechanics.elements.shell import SHEET_ASPECT, Layer, find_layer
from spacemap_vtk.mechanics.equilibrium import energy_terms
from spacemap_vtk.mechanics.modal.cage_modes import CageModes
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.mechanics.modal.sheet_cells import FEWEST, SheetCells, choose_sheet_cells
from spacemap_vtk.mechanics.response.oscillator import LOST
from spacemap_vtk.memory import require_memory
from spacemap_vtk.ndarrays import Floats, Ints, Progress
from spacemap_vtk.parameters import Choice, FilePath, Flag, Integer, Real, Vector
from spacemap_vtk.textile.crimp.cloth_law import YarnLaw
from spacemap_vtk.textile.crimp.interchange import YarnMechanics
from spacemap_vtk.textile.weave.cloth import FAMILIES, Cloth
from spacemap_vtk.textile.weave.figures import fabric_figures
from spacemap_vtk.units import format_quantity

#: Quadratic tetrahedra that are at most this many thicknesses wide twist correctly, within 5 % in
#: frequency (see `spacemap_vtk.mechanics.elements.locking.estimate_locking`).
TWISTS_WELL = 4

#: Solutions that take less time than this, in s, are not always stored on disk: while a slider is
#: dragged, writing would take as long as solving.
_QUICK = 0.05
#: Least time between two stored quick solutions, in s.
_PAUSE = 1.0

#: The arrays that are stored on disk, and their shapes.
_STORED = {"eigenvalues": (-1,), "shapes": (-1, -1, 3), "rounding": (-1,)}


#: Eigenvalues, shapes and rounding, see `spacemap_vtk.mechanics.modal.eigen.Modes`.
Solution = tuple[Floats, Floats, Floats]


class CageSheet(NamedTuple):
    """A cage that is a sheet."""

    plate: Plate
    areal_mass: float
    """Mass per area [kg/m²]."""
    thickness: float
    """Mean thickness of the cage [m]."""


class ModalSolver(LawParameters, CageFittings, Stage):
    """Compute the lowest vibration modes of a cage of tetrahedra: K s = λ M s.

    Modes are kept: another modulus or density only scales them. Modes that were computed before are
    read from the user's cache folder (see `spacemap_vtk.cache`).

    Notes
    -----
    Equations (9) to (15) of Furukawa, Kitagawa and Shimizu; the volume in (9) needs its absolute
    value. The modes are mass-normalised. None is missing, as the inertia of K - μM proves.

    Point arrays of the output: ``fixed`` is 1 where a vertex is held in some direction,
    ``fixed_components`` gives the held axes, ``fixed_directions`` other held directions (Σ n nᵀ);
    ``rigid_body`` numbers the rigid bodies from 1; ``spring_stiffness`` (N/m) and ``point_mass``
    (kg) are those of springs and masses; ``nodal_mass`` (kg) contains the row sums of M. Cell
    arrays: ``stiffness_factor`` and ``density_factor``. The field array ``eigenvalue_rounding``
    estimates the share of each eigenvalue that is rounding; ``frequencies`` are in Hz, and the
    point arrays ``mode_000`` … are the shapes. For a sheet its constants are field arrays, too,
    named as the parameters (``bending_length`` …), in SI, with the value of the warp first. If a
    cage has a field array ``filled``, as TetraCage makes it around an object's surface, modulus
    and density are multiplied by it, so that the cage weighs as much as its content.

    Examples
    --------
    >>> from spacemap_vtk import ModalSolver
    >>> ModalSolver(youngs_modulus="2 MPa").youngs_modulus
    2000000.0
    >>> ModalSolver(fixed=["+y", "sphere(0, 0, 0, 1 mm):z"]).fixed
    ('+y', 'sphere(0, 0, 0, 0.001):z')
    """

    section = "modal"
    role = "solver"
    inputs = ("vtkUnstructuredGrid",)
    takes = ("cage",)
    makes = "cage"
    provides: ClassVar = {
        "fixed": ProvidedArray("point"),
        "fixed_components": ProvidedArray("point"),
        "rigid_body": ProvidedArray("point", "", {"rigid": ()}),
        "spring_stiffness": ProvidedArray("point", "N/m", {"springs": ()}),
        "point_mass": ProvidedArray("point", "kg", {"masses": ()}),
        "stiffness_factor": ProvidedArray("cell", "", {"stiffness_factors": ()}),
        "density_factor": ProvidedArray("cell", "", {"density_factors": ()}),
        "nodal_mass": ProvidedArray("point", "kg"),
        "equilibrium": ProvidedArray("point", "m"),
        "reaction": ProvidedArray("point", "N"),
        "eigenvalues": ProvidedArray("field", "1/s2"),
        "frequencies": ProvidedArray("field", "Hz"),
        "eigenvalue_rounding": ProvidedArray("field"),
    }

    mass = Choice(
        "consistent",
        "Mass matrix: consistent with the elements' shape functions, or lumped at the vertices.",
        ["consistent", "lumped"],
    )
    modes = Integer(
        30,
        "Number of modes, from the lowest on; at most the number of degrees of freedom.",
        minimum=1,
        maximum=100_000,
    )
    gravity = Vector(
        (0.0, 0.0, 0.0),
        "Gravity under which the cage hangs before it moves. Deformations can be large; the modes "
        "are those about this equilibrium.",
        component=Real(0.0, "", unit="m/s2"),
        group="Hung",
    )
    dead_loads = DeadLoads(
        (),
        "Pressures, tractions, forces and arrays under which the cage hangs, in addition to "
        "gravity; their directions and sizes are constant.",
        group="Hung",
    )
    obstacles = Obstacles(
        (),
        "Rigid bodies that the cage rests on or hangs over. Undeformed, it may be anywhere above "
        "them: if nothing else holds it, it first falls along its load until it touches one.",
        group="Hung",
    )
    start = FilePath(
        None,
        "File of the state from which the search for the equilibrium begins: a cage with the array "
        "displacement, as `spacemap export --what cage` writes it. Cloth that falls from another "
        "place lies in other folds. What is held stays where it is in the file.",
        automatic="the undeformed cage",
        group="Hung",
    )
    grips = Grips(
        (),
        "Grips that hold places of the cage, and move and turn them through states at rest. The "
        "modes are those about the last state, in which the grips hold.",
        group="Hung",
    )
    path_steps = Integer(
        10,
        "Number of equilibria along each straight line of the paths of obstacles and grips.",
        minimum=1,
        maximum=10_000,
        group="Hung",
    )
    hang = Flag(
        True,
        "Let the cage hang under gravity and dead_loads, if they are given; otherwise it starts "
        "undeformed.",
        group="Hung",
    )

    #: Keeps parts alive that are found by content: other supports or materials reuse them.
    _model: Model | None = None
    #: Digest, and the last solution, for unit modulus and density.
    _last_modes: tuple[str, Solution] | None = None
    #: Digest, number and density of the modes in the output's arrays, and these arrays.
    _arrays: tuple[tuple[str, int, float], list[vtkDataArray]] | None = None
    #: Digest of the last model, and the locking of its tetrahedra.
    _locking: tuple[str, Locking] | None = None
    #: The undeformed model of a hanging cage; then the digest of the last equilibrium, its
    #: displacement, and the share of the load at which the cage buckled.
    _undeformed: Model | None = None
    _last_equilibrium: tuple[str, Sequence[Floats]] | None = None
    _stored: float = -math.inf
    #: Stiffness of the yarns; of a stage, a copy of its parameters. That stage may be below this
    #: one, and a pipeline with a reference cycle is never freed.
    _yarns: YarnParameters | YarnMechanics | StatedYarns | None = None
    _followed: weakref.ref[Stage] | None = None

    #: The recipes of `terms`.
    _terms: tuple[dict[str, Any], ...] = ()

    def __init__(self, *, terms: Sequence[Mapping[str, Any]] = (), **values: Any) -> None:
        super().__init__(**values)
        self.terms = terms

    def __reduce__(self) -> tuple[Any, ...]:
        # The second of a pair is set attribute by attribute.
        return *super().__reduce__(), (None, {"terms": self.terms, "yarns": self.yarns})

    @property
    def terms(self) -> Sequence[Mapping[str, Any]]:
        """Further terms of the cage's energy: for each, its kind and the arguments of its maker.

        A kind is registered with `spacemap_vtk.mechanics.equilibrium.energy_terms.energy_term`.
        Equilibrium, modes and steps include the terms. Positions are relative to the base. Scene
        files have no key for terms.
        """
        return self._terms

    @terms.setter
    def terms(self, recipes: Sequence[Mapping[str, Any]]) -> None:
        for number, recipe in enumerate(recipes):
            with add_key_to_errors(f"terms[{number}]"):
                energy_terms.check_recipe(recipe)
        try:
            found = tuple(json.loads(json.dumps([dict(recipe) for recipe in recipes])))
        except TypeError as error:
            allowed = "numbers, texts, lists and tables"
            raise InputError(f"{error}", key="terms", value=recipes, allowed=allowed) from None
        if found != self._terms:
            self._terms = found
            self.Modified()

    @property
    def yarns(self) -> YarnParameters | YarnMechanics | StatedYarns | None:
        """Stiffness of the yarns of the weave in the cage; changes of a stage are followed."""
        return self._yarns

    @yarns.setter
    def yarns(self, value: YarnParameters | YarnMechanics | StatedYarns | None) -> None:
        if value is not None and not isinstance(
            value, (YarnParameters, YarnMechanics, StatedYarns)
        ):
            raise InputError(
                f"a {type(value).__name__} is not the stiffness of yarns",
                key="yarns",
                allowed="a CrimpInterchange, YarnParameters, YarnMechanics, the property "
                "mechanics of a TextileSource, or None",
            )
        followed = self._followed and self._followed()
        self._followed = weakref.ref(value) if isinstance(value, Stage) else None
        if isinstance(value, Stage) and value is not followed:
            value.AddObserver("ModifiedEvent", _make_observer(self))
        self._use_yarns(value)

    def _use_yarns(self, yarns: YarnParameters | YarnMechanics | StatedYarns | None) -> None:
        """Store the stiffness of yarns; run again if it has changed and has an effect."""
        before, now = _settings_of(self._yarns), _settings_of(yarns)
        if len(before) == len(now) and all(map(np.array_equal, before, now)):
            return
        if isinstance(yarns, YarnParameters):
            yarns = YarnParameters(**{n: getattr(yarns, n) for n in YarnParameters.parameters})
        self._yarns = yarns
        if self.material == WOVEN:
            self.Modified()

    @property
    def has_textile(self) -> bool:
        """Whether the yarns are those of a textile, whose law takes long."""
        return isinstance(self._yarns, StatedYarns)

    def progress_of(self, step: str) -> Progress:
        """Return what reports the share of a step that is done."""
        return partial(self.report_progress, step=step)

    def check(self) -> None:
        """Check the material."""
        self.check_material(self._yarns)

    def run(
        self, inputs: list[vtkUnstructuredGrid], output: vtkUnstructuredGrid, time: float
    ) -> None:
        """Assemble the matrices, solve, and attach the modes as point arrays."""
        self.report_progress(0.0)
        grid = inputs[0]
        if (textile := textile_of(grid)) is not None:
            self._yarns = self._yarns or StatedYarns()
            if self.material == WOVEN:
                textile.require_bending()  # the automatic cage of yarns without it is no sheet
        vertices, elements = points_of(grid).astype(np.float64, copy=False), elements_of(grid)
        self.choose_modulus(vertices, elements, up_axis(grid))
        held, fittings, warnings = self.make_fittings(grid, vertices, elements)
        grips = make_grips(
            self.grips, vertices, self.path_steps, self.path_lines, mask_reader(grid)
        )
        held = hold_with_grips(held, grips)
        for text in warnings:
            self.warn(text)
        sheet = self._find_sheet(vertices, elements)
        extent, layers = float(np.ptp(vertices[:, 2])), proportions_of(vertices, elements).layers
        material: Floats | Plate
        if sheet is None:
            filled = filled_share(grid)
            elasticity, density = self.solid_constants(extent)
            material, density = filled * elasticity, filled * density
        else:
            material, mass = self._sheet_and_mass(grid, sheet)
            density, layers = mass / sheet.thickness, 1.0
        linear = elements.shape[1] == 4
        terms = [energy_terms.make_term(recipe, vertices, elements) for recipe in self._terms]
        recipes = [*self._terms, *self._contact_recipes(grid, material, sheet)]
        made = recipes[len(self._terms) :]
        terms += [energy_terms.make_term(recipe, vertices, elements) for recipe in made]
        data = vertices, elements, material, density, held, self.mass == "lumped"
        self._model = model = Model(*data, None, fittings, terms)
        anchors: Floats | None = None
        task: RestTask | None = None
        found: RestState | None = None
        layers = layers if linear else 2 * layers
        if self.is_hung:
            load, start, path = self._dead_load(grid, model), *self._start_and_path(model)
            acts = load.any() or any(term.forces(vertices).any() for term in terms)
            acts = acts or (isinstance(material, Plate) and material.curvature is not None)
            if acts or start is not None or path is not None:
                # Keep the undeformed model, too: the next equilibrium uses its strains.
                self._undeformed = model
                fixed = self.values_in_use["fixed"] if self.fixed is None else self.fixed
                bearings = find_bearings(vertices, fixed, grips, mask_reader(grid))
                task = RestTask(model, load, start, path, grips, bearings)
                found = self._equilibrium(task, layers)
                rest, anchors = found.displacement, found.anchors
                terms = rested_terms(terms, vertices + rest, anchors)
                self._model = model = Model(*data, rest, fittings, terms)
        eigenvalues, shapes, rounding = self._load_or_solve_modes(model, layers)

        output.ShallowCopy(grid)
        self._check_law(grid, output)
        if model.displacement is not None:
            surface = model.pencil.surface
            check_folds(self, grid, vertices, vertices + model.displacement, surface)
            strain, _ = model.strain_and_stress(np.zeros_like(vertices))
            check_strains(self, output, strain, model)
        add_model(output, model, self.gravity)
        add_terms(output, recipes, anchors)
        add_contact(output, model)
        self._add_reactions(output, task, found)
        self._check_obstacles(model, output, _mean_edge(grid) if sheet is None else sheet.cell)
        if model.plate is not None:
            add_sheet(output, data_sheet(model.plate, mass))
        for array in self._mode_arrays(shapes, model.density):
            output.GetPointData().AddArray(array)
        eigenvalues = eigenvalues * (model.modulus / model.density)
        add_array(output.GetFieldData(), "eigenvalues", eigenvalues)
        add_array(output.GetFieldData(), "frequencies", np.sqrt(eigenvalues) / (2 * math.pi))
        add_array(output.GetFieldData(), "eigenvalue_rounding", rounding)
        for text in self.warnings_for_other_elements(sheet is not None):
            self.warn(text)
        self._check_rounding(rounding)
        if sheet is not None:
            return
        if self.material in FABRICS and self.youngs_moduli is None:
            self._check_thickness(FABRICS[self.material].plate_thickness, extent)
        self._check_locking(model)
        if linear:
            self._check_volume(model.elasticity)

    def _contact_recipes(
        self, grid: vtkUnstructuredGrid, material: Floats | Plate, sheet: Layer | None
    ) -> list[dict[str, Any]]:
        """Return the recipes of the terms of obstacles, and of contact of the cage with itself."""
        touches = grid.GetFieldData().GetArray(LAYER_FRICTION)
        if touches is not None and sheet is None:
            raise InputError(
                "only a sheet can touch itself",
                key="elements",
                value=self.elements,
                cure='Use [cage] divisions such as [20, 20, 1] and elements = "sheet", or leave '
                "out [contact].",
            )
        if not self.obstacles and touches is None:
            return []
        if sheet is None:
            offset, cell = 0.0, _mean_edge(grid)
        else:
            cloth = cloth_of(grid)
            thickness = sheet.thickness
            if cloth is not None:
                thickness = 2 * cloth.level + cloth.sheet_thickness
            offset, cell = thickness / 2, sheet.cell
        common = {
            "kind": "obstacle",
            "stiffness": contact_stiffness(material, cell),
            "sheet": sheet is not None,
        }
        recipes: list[dict[str, Any]] = [
            {
                **common,
                "body": obstacle.body,
                "offset": offset + obstacle.gap,
                "friction": obstacle.friction,
                "motion": obstacle.motion,
            }
            for obstacle in self.obstacles
        ]
        if touches is not None:
            layers = {"thickness": 2 * offset, "stiffness": common["stiffness"]}
            recipes.append({"kind": "self-contact", **layers})
            if friction := touches.GetValue(0):
                recipes.append({"kind": "layer-friction", "friction": friction, **layers})
        return recipes

    @property
    def path_lines(self) -> int:
        """Largest number of straight lines in the path of an obstacle or grip."""
        paths = [obstacle.path for obstacle in self.obstacles]
        paths += [path for grip in self.grips for path in (grip.path, grip.turns)]
        return max((len(path) for path in paths if path), default=0)

    def _start_and_path(self, model: Model) -> tuple[Resting | None, Floats | None]:
        """Return the state where the equilibrium begins, and displacements of the obstacles."""
        start = None
        if self.start is not None:
            try:
                start = read_rest_state(self.start, model.points, count_anchors(model))
            except SpacemapError as error:
                error.key = "start"  # readers name their own parameter
                raise
        if not self.path_lines:
            return start, None
        corners = [obstacle.path or () for obstacle in self.obstacles]
        path = divide_path([*corners, [(0.0, 0.0, 0.0)] * self.path_lines], self.path_steps)[:, :-1]
        steps = np.linalg.norm(np.diff(path, axis=0), axis=2).max(axis=0)
        for number, (length, term) in enumerate(zip(steps, obstacles_of(model), strict=True)):
            if length > term.obstacle.depth:
                raise InputError(
                    f"obstacle {number} moves so far in a step that it could jump past the cage",
                    key="path_steps",
                    value=self.path_steps,
                    allowed=f"at least {math.ceil(length * self.path_steps / term.obstacle.depth)}",
                )
        return start, path

    def sheet_figures(self, grid: vtkUnstructuredGrid) -> DataSheet | None:
        """Return the figures of a cage that is a sheet, without solving anything.

        Parameters
        ----------
        grid : vtkUnstructuredGrid
            The cage.

        Returns
        -------
        DataSheet or None
            None if the cage is a solid.
        """
        found = self.sheet_of_cage(grid)
        return None if found is None else data_sheet(found.plate, found.areal_mass)

    def sheet_of_cage(self, grid: vtkUnstructuredGrid) -> CageSheet | None:
        """Return the sheet that a cage is, without solving anything.

        Parameters
        ----------
        grid : vtkUnstructuredGrid
            The cage.

        Returns
        -------
        CageSheet or None
            None if the cage is a solid.
        """
        sheet = self._find_sheet(points_of(grid).astype(np.float64, copy=False), elements_of(grid))
        if sheet is None:
            return None
        return CageSheet(*self._sheet_and_mass(grid, sheet), sheet.thickness)

    def choose_cells(
        self,
        bounds: Floats,
        cloth: Cloth | TextileKind | None = None,
        mass: float | None = None,
    ) -> SheetCells | None:
        """Choose the cells of a sheet for its modes, folds, supports and obstacles.

        Parameters
        ----------
        bounds : ndarray of float64, shape (3, 2)
            From and to along x, y and z: the cage's box [m].
        cloth : Cloth or TextileKind, optional
            The weave or textile in the cage.
        mass : float, optional
            Its mass per area [kg/m²].

        Returns
        -------
        SheetCells or None
            Along the two longer sides, in the order of the axes. None if the cage will not be a
            sheet.

        Raises
        ------
        InputError
            If the material is contradictory.
        """
        low, high = bounds.T
        extent = high - low
        normal = int(extent.argmin())
        thickness = float(extent[normal])
        first, second = (float(side) for axis, side in enumerate(extent) if axis != normal)
        if self.elements == "tetrahedra" or thickness <= 0.0:
            return None
        # Cells as narrow as the cloth is thick show folds that no cloth has; of cells narrower than
        # SHEET_ASPECT "auto" would make a solid.
        narrowest = thickness if self.elements == "sheet" else 1.1 * SHEET_ASPECT * thickness
        if max(first, second) < FEWEST * narrowest:
            return None
        length = None
        if self.is_hung:
            plate, own_mass = self.sheet_stiffness(thickness, normal, mass, cloth, self._yarns)
            length = min(data_sheet(plate, own_mass).bending_length)
            if plate.curvature is not None:
                length = min(length, 1.0 / float(abs(plate.curvature).max()))
        spans = find_spans(low, high, self.held_places, normal)
        del spans[normal]
        return choose_sheet_cells(
            (first, second),
            self.modes,
            length,
            narrowest,
            spans,
            [radius for each in self.obstacles if (radius := each.radius_of_curvature) is not None],
        )

    @property
    def held_places(self) -> list[Place]:
        """The places of supports that were given, and of grips."""
        texts = (*(self.fixed or ()), *(place for grip in self.grips for place in grip.place))
        return parse_places(" ".join(map(str, texts)))

    def _sheet_and_mass(self, grid: vtkUnstructuredGrid, sheet: Layer) -> tuple[Plate, float]:
        """Return the stiffness of a cage that is a sheet, and its mass per area."""
        cloth = content_of(grid) if self.material == WOVEN else None
        return self.sheet_stiffness(
            sheet.thickness, sheet.normal, _woven_mass(grid), cloth, self._yarns
        )

    def _find_sheet(self, vertices: Floats, elements: Ints) -> Layer | None:
        """Return the sheet as which the cage is modelled; None for a solid."""
        if self.elements == "tetrahedra":
            return None
        found = find_layer(vertices, elements)
        if self.elements == "auto":
            return found if found is not None and found.aspect > SHEET_ASPECT else None
        if found is None:
            raise InputError(
                "the cage cannot be a sheet: it is not a lattice of one layer",
                key="elements",
                value=self.elements,
                cure="Set [cage] divisions such as [20, 20, 1] and order = 1, or set elements = "
                '"tetrahedra".',
            )
        return found

    @property
    def is_hung(self) -> bool:
        """Whether the cage is to hang, and there is a load under which it hangs."""
        given = any(self.gravity) or self.dead_loads or self._terms or self.start
        given = given or self.obstacles or self.grips
        given = given or (self.material == WOVEN and self.has_textile)
        return self.hang and bool(given)

    @property
    def arrays(self) -> dict[str, ProvidedArray]:
        """The arrays that the next run adds, by name."""
        hung = ("equilibrium", "reaction")
        return {k: v for k, v in super().arrays.items() if self.is_hung or k not in hung}

    def _dead_load(self, grid: vtkUnstructuredGrid, model: Model) -> Floats:
        """Return the forces on the vertices under which the cage hangs [N], (3V,)."""
        self.check()
        nothing = np.empty((0, model.points.size))
        cage = CageModes(model, np.empty(0), nothing, np.empty(0))
        vectors = load_vectors(cage, grid, self.dead_loads, "dead_loads")
        if any(self.gravity):
            vectors.append(cage.load_vector("gravity", self.gravity, step()))
        total = np.zeros(model.points.size)
        for vector in vectors:
            total += cage.vertex_forces(vector)
        return total

    def _equilibrium(self, task: RestTask, layers: float) -> RestState:
        """Return the state in equilibrium, from memory, from disk or solved."""
        model = task.model

        def allow() -> None:
            require_memory(
                model.estimate_bytes(layers),
                f"the equilibrium of {model.pencil.size} degrees of freedom",
                key="gravity",
                value=self.gravity,
                cure="Use a coarser cage.",
            )

        def solve() -> list[Floats]:
            return list(
                load_or_solve_rest(
                    task, lambda share: self.report_progress(share, "hanging"), allow
                )
            )

        if self._last_equilibrium is None or self._last_equilibrium[0] != task.digest:
            processes = self._processes
            self._last_equilibrium = (
                task.digest,
                solve() if processes is None else processes.make_in_first(solve),
            )
        found = RestState(*self._last_equilibrium[1])
        if not math.isnan(found.critical[0]):
            self.warn(
                f"the cage buckles at {found.critical[0]:.3g} of the load under which it hangs; if "
                "it can fold to either of two sides, rounding chooses one"
            )
        return found

    def _add_reactions(
        self, output: vtkUnstructuredGrid, task: RestTask | None, found: RestState | None
    ) -> None:
        """Write what holds the cage, and its reactions at rest and along the path."""
        fixed = self.values_in_use["fixed"] if self.fixed is None else self.fixed
        add_bearings(output, bearing_recipe(fixed, self.grips))
        if task is None or found is None:
            remove_reactions(output)
            return
        reactions = found.last_reactions(task)
        shapes = iter(obstacle.shape for obstacle in self.obstacles)
        named = [
            each._replace(name=next(shapes)) if each.kind == "obstacle" else each
            for each in reactions
        ]
        path = None
        if len(table := found.reactions):
            steps = [
                np.stack([getattr(grip, key) for grip in task.grips], axis=1)
                if task.grips
                else np.empty((len(table), 0, 3))
                for key in ("moves", "turns")
            ]
            assert task.path is not None
            steps.append(task.path - task.path[0])
            path = PathReactions(table[..., :3], table[..., 3:6], *steps)
        add_reactions(output, found.holding, named, path)

    def _solve(self, model: Model, count: int, layers: float) -> Solution:
        # This imports scipy's solvers, which results from disk do not need.
        from spacemap_vtk.mechanics.modal.eigen import estimate_bytes

        dof = model.pencil.size
        require_memory(
            estimate_bytes(dof, count, layers, model.pencil.surface is not None),
            f"solving {count} modes of {dof} degrees of freedom",
            key="modes",
            value=self.modes,
            cure="Use a coarser cage or fewer modes.",
        )
        try:
            return model.modes(count, lambda share: self.report_progress(share, "modes"))
        except SolverError as error:
            if not self.obstacles or model.displacement is None:
                raise
            raise SolverError(
                "the cage rests on its obstacles, but there are no vibrations about this state: "
                "where all points of contact slide, nothing brings the cage back",
                cure="Raise the friction of the obstacles, or hold a part of the cage with "
                "modal.fixed",
            ) from error

    def _load_or_solve_modes(self, model: Model, layers: float) -> Solution:
        """Return the modes for unit modulus and density, from memory, from disk or solved."""
        count, digest = min(self.modes, model.pencil.size), model.digest

        def solve() -> Solution:
            found = _read_modes(digest, count, len(model.points))
            if found is None:
                begun = clock.perf_counter()
                found = self._solve(model, count, layers)
                now = clock.perf_counter()
                if now - begun > _QUICK or now - self._stored > _PAUSE:
                    arrays = dict(zip(_STORED, found, strict=True))
                    cache.store(f"modes-{digest}-{count}", **arrays)
                    self._stored = now
            return found

        # Never return the first of more modes: they differ by rounding, and the result must be the
        # same, to the bit, as when the modes are solved anew.
        missing = (
            self._last_modes is None
            or self._last_modes[0] != digest
            or len(self._last_modes[1][0]) != count
        )
        processes = self._processes
        if processes is not None and processes.maximum([missing])[0]:
            values, shapes, rounding = processes.make_in_first(solve)
            self._last_modes = digest, (values, shapes, rounding)
        elif missing:
            self._last_modes = digest, solve()
        assert self._last_modes is not None
        self.report_progress(1.0, "modes")
        return self._last_modes[1]

    def _mode_arrays(self, shapes: Floats, density: float) -> list[vtkDataArray]:
        """Return the mode shapes as VTK arrays: the same objects for the same modes."""
        assert self._last_modes is not None
        modes = self._last_modes[0], len(shapes), density
        if self._arrays is None or self._arrays[0] != modes:
            scaled = shapes / math.sqrt(density)
            arrays = [to_array(shape, MODE_NAME.format(k)) for k, shape in enumerate(scaled)]
            self._arrays = modes, arrays
        return self._arrays[1]

    def _check_thickness(self, plate: float, extent: float) -> None:
        times = (extent / plate) ** 2
        softly, lower = ("softly", "raise") if times < 1 else ("stiffly", "lower")
        times = max(times, 1 / times)
        shown_plate = format_quantity(float(f"{plate:.3g}"), "m")
        self.check_limit(
            "thickness",
            times,
            found=f"the cage stretches like {self.material}, but bends {{}} too {softly} "
            f"({self.material} bends like a plate of {shown_plate})",
            cure=f'set modal.elements = "sheet", or {lower} youngs_moduli and shear_moduli '
            f"{times:.2g} times",
        )

    def _check_rounding(self, rounding: Floats) -> None:
        worst, most = float(rounding.max()), LIMITS["rounding"].most
        poor = np.flatnonzero(rounding > (LOST if worst > LOST else most))
        beyond = ""
        if len(poor):
            which = f"mode {poor[0] + 1}"
            if len(poor) > 1:
                which = f"modes {poor[0] + 1} to {poor[-1] + 1}"
            digits = int(-math.log10(worst))
            verb = "is" if digits == 1 else "are"
            beyond = (
                f"about {digits} digit{'s' * (digits != 1)} of the frequency of {which} {verb} "
                "correct"
            )
            if worst > LOST:
                beyond = f"the frequency of {which} is lost in rounding"
        self.check_limit("rounding", worst, beyond=beyond)

    def _check_law(self, grid: vtkUnstructuredGrid, output: vtkUnstructuredGrid) -> None:
        """State what cloth from its yarns assumes; store the crimp that limits a linear law."""
        output.GetFieldData().RemoveArray(LAW_CRIMP)
        if self.material != WOVEN:
            return
        cloth = content_of(grid)
        assert cloth is not None
        if isinstance(cloth, TextileKind):
            self.check_limit("frictionless")
            for note in sheet_of_textile(cloth).notes:
                self.warn(note)
            return
        self.check_limit("no_slip")
        plate = None if self._model is None else self._model.plate
        if plate is not None and isinstance(plate.law, YarnLaw):
            self.check_limit("kinds", plate.law.kinds_error)
        figures = fabric_figures(cloth)
        crimp = min(figures[family]["mean_crimp"] for family in FAMILIES)
        if crimp > 0.0:
            add_number(output.GetFieldData(), LAW_CRIMP, crimp)

    def _check_obstacles(self, model: Model, output: vtkUnstructuredGrid, cell: float) -> None:
        found = zip(obstacles_of(model), contact_of(output), strict=True)
        depths = [term.obstacle.depth for term, contact in found if contact.points]
        if depths:
            self.check_limit("obstacle", cell / min(depths))

    def _check_locking(self, model: Model) -> None:
        if self._locking is None or self._locking[0] != model.digest:
            held = ~model.free.reshape(-1, 3)
            found = estimate_locking(model.points, model.cells, model.elasticity, held)
            self._locking = model.digest, found
        bending, twist = self._locking[1]
        sheet = proportions_of(model.points, model.cells)
        linear = model.cells.shape[1] == 4
        factors = {"bend": bending} if linear else {}
        if twist > LIMITS["locking"].most:
            factors["twist"] = twist
        widest = format_quantity(float(f"{TWISTS_WELL * sheet.thickness:.3g}"), "m")
        fine = f"cells no wider than {TWISTS_WELL} thicknesses ({widest})"
        if len(sheet.long) == 1:  # a bar
            cure = "set cage.order = 2 (quadratic tetrahedra)"
        elif not linear:
            cure = f'set modal.elements = "sheet" with cage.order = 1, or use {fine}'
        else:
            cure = (
                'set modal.elements = "sheet" with cage.divisions = [nx, ny, 1], or cage.order = 2'
            )
            if sheet.width > TWISTS_WELL * sheet.thickness:
                cure += f" with {fine}"
        too_stiff = [
            f"{what}s about {_format_factor(times)} times" for what, times in factors.items()
        ]
        too_high = " and ".join(_format_factor(math.sqrt(times)) for times in factors.values())
        self.check_limit(
            "locking",
            max(bending, twist),
            found=f"the cage of {'linear' if linear else 'quadratic'} tetrahedra "
            f"{' and '.join(too_stiff)} too stiffly",
            beyond=f"frequencies are about {too_high} times too high",
            cure=cure,
        )

    def _check_volume(self, elasticity: Floats) -> None:
        isotropic = self.material == "isotropic"
        kind = "" if isotropic else "the equivalent "
        parameter = "poissons_ratio to 0.45" if isotropic else "poissons_ratios"
        self.check_limit(
            "volume",
            round(equivalent_poissons_ratio(elasticity), 9),
            found=f"{kind}Poisson's ratio is {{}}",
            cure=f"set [cage] order = 2 (quadratic tetrahedra), or lower {parameter}",
        )


def _settings_of(yarns: YarnParameters | YarnMechanics | StatedYarns | None) -> Sequence[Any]:
    if isinstance(yarns, StatedYarns):
        return [yarns]
    return list(yarns.settings.values()) if isinstance(yarns, YarnParameters) else yarns or ()


def _make_observer(solver: ModalSolver) -> Callable[[Any, str], None]:
    """Return an observer of the stage that a solver follows; it does not keep the solver alive."""
    known = weakref.ref(solver)

    def follow(caller: Any, event: str) -> None:
        solver = known()
        if solver is not None and solver._followed is not None and solver._followed() is caller:
            solver._use_yarns(caller)

    return follow


def _woven_mass(grid: vtkUnstructuredGrid) -> float | None:
    """Return the mass per area [kg/m²] of the weave in a cage; None if there is no weave."""
    mass = grid.GetFieldData().GetArray("areal_mass")
    return None if mass is None else float(mass.GetValue(0))


def _mean_edge(grid: vtkUnstructuredGrid) -> float:
    """Return the mean length of the edges of a cage's tetrahedra [m]."""
    corners = points_of(grid)[elements_of(grid)[:, :4]].astype(np.float64)
    ends = corners[:, [0, 0, 0, 1, 1, 2]] - corners[:, [1, 2, 3, 2, 3, 3]]
    return float(np.linalg.norm(ends, axis=2).mean())


def _format_factor(times: float) -> str:
    """Format a number with two digits, without an exponent while it is short."""
    return f"{float(f'{times:.2g}'):.7g}"


def _read_modes(digest: str, count: int, vertices: int) -> Solution | None:
    """Read modes from disk; None if they are missing or invalid."""
    entry = cache.load(f"modes-{digest}-{count}", **_STORED)
    if entry is None or not all(np.isfinite(array).all() for array in entry.values()):
        return None
    values, shapes, rounding = entry.values()
    fits = shapes.shape[:2] == (count, vertices) and rounding.shape == values.shape == (count,)
    return (values, shapes, rounding) if fits else None
