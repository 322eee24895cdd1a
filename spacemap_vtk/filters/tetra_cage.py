"""TetraCage: a coarse tetrahedral mesh around any data set."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike
from vtkmodules.vtkCommonDataModel import (
    VTK_QUADRATIC_TETRA,
    VTK_TETRA,
    vtkDataSet,
    vtkUnstructuredGrid,
)

from spacemap_vtk import cancel
from spacemap_vtk.cage.carve import count_pieces, find_touched_cells, grow_cells
from spacemap_vtk.cage.lattice import (
    TETRAHEDRA_PER_CELL,
    build_lattice,
    coarsen_divisions,
    estimate_bytes,
    pad_bounds,
)
from spacemap_vtk.cage.split import (
    count_bodies,
    count_parts,
    repair_tetrahedra,
    tetrahedron_volumes,
)
from spacemap_vtk.cage.tetwild import EPSILON, fill_surface, load_or_make
from spacemap_vtk.datasets.arrays import add_array, points_of, to_cells, to_points
from spacemap_vtk.datasets.cloth_data import cloth_of, copy_cloth, set_patches
from spacemap_vtk.datasets.extent import FILLED, UP, bounds_of_whole
from spacemap_vtk.datasets.outline import Outline, count_edge_faults, extract_outline, make_envelope
from spacemap_vtk.datasets.volume import split_into_tetrahedra
from spacemap_vtk.embedding.enclose import enclose_points, enclosed_share
from spacemap_vtk.errors import GeometryError, InputError, SpacemapError, add_key_to_errors
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.patch_tessellator import polygons_of
from spacemap_vtk.filters.textile_sheet import content_of
from spacemap_vtk.filters.textiles.kind import TextileKind
from spacemap_vtk.io.reading import merge_blocks, read_blocks
from spacemap_vtk.mechanics.elements.tetrahedra import add_midpoints
from spacemap_vtk.mechanics.modal.sheet_cells import MOST_CELLS, SheetCells
from spacemap_vtk.memory import require_memory
from spacemap_vtk.ndarrays import Bools, Floats, Ints
from spacemap_vtk.parameters import Choice, FilePath, Flag, Integer, Real, Vector
from spacemap_vtk.textile.geometry.cloth_axes import YarnSelection
from spacemap_vtk.textile.geometry.weave import build_weave
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.units import format_quantity

if TYPE_CHECKING:
    from spacemap_vtk.filters.modal_solver import ModalSolver

#: Distances of the envelope around an object that falls apart, as shares of its diagonal.
_ENVELOPES = (0.01, 0.02)
#: Points further outside than this multiple of fTetWild's tolerance stay outside.
_FURTHEST = 2.0
#: Warn if the cage's volume exceeds the enclosed volume by more than this factor.
_LARGER = 1.1
#: Number of hexahedra along the longest side of an object's box.
_ALONG = 8
#: Crossings of the yarns that are built together, for a cage that is carved yarn by yarn.
_CROSSINGS = 1_500
#: One yarn in this many is built first, for such a cage.
_APART = 16
#: Tolerance for rounding, as a share.
_SLACK = 1e-6


class TetraCage(Stage):
    """Enclose the fabric or object in a coarse cage of tetrahedra.

    ``"lattice"`` divides the bounding box into hexahedra and each of these into five tetrahedra,
    mirrored from one hexahedron to the next, so that the mesh conforms. ``"carved"`` keeps only the
    hexahedra that the object touches. ``"tetwild"`` fills the object's surface, or an envelope
    around it, by fTetWild. ``"file"`` reads any volume mesh and splits its cells into tetrahedra;
    points keep their numbers.

    Notes
    -----
    After section 3 of Furukawa, Kitagawa and Shimizu, "Deformation of Flexible Objects Based on
    Space Mapping". BarycentricWarp reports how many points of the object lie outside the cage, and
    how far. A cage made by fTetWild is moved outwards where points lie outside. The field array
    ``filled`` is the share of the cage's volume that the object's surface encloses.

    Examples
    --------
    >>> from spacemap_vtk import TetraCage, WeaveSource
    >>> weave, cage = WeaveSource(), TetraCage(divisions=(5, 5, 1))
    >>> cage.SetInputConnection(weave.GetOutputPort())
    >>> cage.update().output.GetNumberOfCells()
    125
    """

    section = "cage"
    role = "cage"
    inputs = ("vtkDataSet",)
    takes = ("object",)
    makes = "cage"

    method = Choice(
        "lattice",
        "How to make the cage: all hexahedra of the box (lattice), those that the object touches "
        "(carved), tetrahedra inside the object's surface (tetwild), or a mesh from a file.",
        ["lattice", "carved", "tetwild", "file"],
    )
    divisions = Vector(
        (5, 5, 1),
        "Number of hexahedra along x, y and z of the box. One layer can be a sheet, see "
        "modal.elements. The stiffness of a thin cage of tetrahedra depends more on their width "
        "than on the number of layers.",
        component=Integer(1, "", minimum=1, maximum=100_000),
        automatic="as many as the modes of a sheet need, its folds if it hangs, its supports and "
        "the obstacles over which it bends, but at most "
        f"{MOST_CELLS} cells; for other cloth 5 x 5 x 1; otherwise nearly cubes, {_ALONG} along "
        "the longest side, and one layer if the object is thin",
        automatic_in_scenes=True,
        when={"method": ("lattice", "carved")},
    )
    order = Integer(
        1,
        "1: linear tetrahedra, also needed for sheets (see modal.elements). 2: quadratic "
        "tetrahedra with midpoints on their edges: one layer bends correctly, and twists correctly "
        "if no cell is wider than four thicknesses.",
        minimum=1,
        maximum=2,
        when={"method": ("lattice", "carved", "tetwild")},
    )
    padding = Real(
        0.0,
        "Distance between the object and the box on each side, as a share of the side's length.",
        minimum=0.0,
        maximum=10.0,
        when={"method": ("lattice", "carved")},
    )
    margin = Integer(
        0,
        "Number of layers of hexahedra around those that the object touches.",
        minimum=0,
        maximum=100,
        when={"method": ("carved",)},
    )
    fill = Flag(
        True, "Also keep the hexahedra that the object encloses.", when={"method": ("carved",)}
    )
    edge_length = Real(
        None,
        "Desired edge length of the tetrahedra.",
        unit="m",
        above=0.0,
        when={"method": ("tetwild",)},
        automatic="a tenth of the object's diagonal",
    )
    inflate = Real(
        0.0,
        "Distance of the filled envelope from the object. 0: fill the object's surface itself, "
        "unless its parts are joined only by an edge or a vertex.",
        unit="m",
        minimum=0.0,
        when={"method": ("tetwild",)},
    )
    file = FilePath(None, "A volume mesh to read.", automatic="no file", when={"method": ("file",)})

    #: Share of the cage's volume that the object's surface encloses.
    _filled_share = 1.0
    #: The stage that treats the cage as a sheet, and chooses its cells. It is below this one, and a
    #: pipeline with a reference cycle is never freed.
    _solver: weakref.ref[ModalSolver] | None = None
    #: Function of that stage that chooses the cells of the last input.
    _choose: Callable[[ModalSolver], SheetCells | None] | None = None
    #: The cells that it has chosen.
    _sheet_cells: SheetCells | None = None

    @property
    def solver(self) -> ModalSolver | None:
        """The ModalSolver below, which decides automatic divisions of a sheet; it is followed.

        Scenes set it. Without it no automatic cage is a sheet.
        """
        return None if self._solver is None else self._solver()

    @solver.setter
    def solver(self, value: ModalSolver | None) -> None:
        if value is self.solver:
            return
        self._solver = None if value is None else weakref.ref(value)
        if value is not None:
            value.AddObserver("ModifiedEvent", _make_observer(self))
        if self.divisions is None:
            self.Modified()

    def _choose_again(self, solver: ModalSolver) -> None:
        """Run again if a change of the solver changes automatic divisions."""
        if self.divisions is None and self._choose is not None:
            chosen = self._choose(solver) if self.order == 1 else None
            if chosen != self._sheet_cells:
                self.Modified()

    def run(self, inputs: list[vtkDataSet], output: vtkUnstructuredGrid, time: float) -> None:
        """Make the mesh."""
        self.values_in_use, self._filled_share = {}, 1.0
        if self.method == "file":
            self._read_file(output)
        else:
            self._make_around(inputs[0], output)
        # A sheet may take its mass and stiffness from the weave inside.
        copy_cloth(inputs[0], output)
        if (mass := inputs[0].GetFieldData().GetArray("areal_mass")) is not None:
            output.GetFieldData().AddArray(mass)
        if (up := inputs[0].GetFieldData().GetArray(UP)) is not None:
            output.GetFieldData().AddArray(up)
        if self._filled_share != 1.0:
            add_array(output.GetFieldData(), FILLED, np.array([self._filled_share]))

    def make_coarser(
        self, edges: Sequence[Sequence[float]] = ((), (), ())
    ) -> tuple[TetraCage, float]:
        """Make a stage for a cage of about half as many cells along each axis.

        Parameters
        ----------
        edges : sequence of 3 sequences of float, optional
            Edges of what holds vertices, as for `spacemap_vtk.cage.lattice.coarsen_divisions`.

        Returns
        -------
        cage : TetraCage
            The stage, without an input.
        ratio : float
            Width of its cells over that of this stage's cells.

        Raises
        ------
        InputError
            If the cage is from a file, or has one cell only.
        """
        if self.method == "file":
            raise InputError("the cage is from a file, and has no coarser one")
        if self.method == "tetwild":
            length = self.edge_length or self.GetInputDataObject(0, 0).GetLength() / 10
            return TetraCage(**{**self.settings, "edge_length": 2 * length}), 2.0
        divisions = self.divisions or self.values_in_use["divisions"]
        if max(divisions) == 1:
            raise InputError("the cage has only one cell, and no coarser one")
        fewer, ratio = coarsen_divisions(divisions, edges)
        changes = {"divisions": fewer, "margin": (self.margin + 1) // 2}
        return TetraCage(**{**self.settings, **changes}), ratio

    def _make_around(self, data: vtkDataSet, output: vtkUnstructuredGrid) -> None:
        if data.GetNumberOfPoints() == 0 and self.piece.total == 1:
            raise GeometryError("there is nothing to enclose: the input has no points")
        # Asking the stages above for the whole object would also give the whole to their other
        # consumers. A cloth, however, is known from any of its pieces.
        apart, is_tetwild = (
            self.piece.total > 1 and self._processes is None,
            self.method == "tetwild",
        )
        by_yarns = apart and (self.inflate > 0.0 if is_tetwild else self.method == "carved")
        cloth = cloth_of(data) if by_yarns else None
        if (
            self.piece.total > 1
            and cloth is None
            and (is_tetwild or (apart and self.method == "carved"))
        ):
            raise InputError(
                f"a cage of this method needs the whole object, but this process has only piece "
                f"{self.piece.number} of {self.piece.total}",
                key="method",
                value=self.method,
                cure='Write the cage of the whole object to a file, and use method = "file".',
            )
        vertices, tetrahedra = (
            self._make_tetwild(data, cloth) if is_tetwild else self._make_lattice(data, cloth)
        )
        cell_type = VTK_TETRA
        if self.order == 2:
            vertices, tetrahedra = add_midpoints(vertices, tetrahedra)
            cell_type = VTK_QUADRATIC_TETRA
        output.SetPoints(to_points(vertices))
        output.SetCells(cell_type, to_cells(tetrahedra))

    def _make_lattice(self, data: vtkDataSet, cloth: Cloth | None) -> tuple[Floats, Ints]:
        whole = bounds_of_whole(data, self.piece, self._processes)
        bounds = np.array(pad_bounds(whole, self.padding)).reshape(3, 2)
        chosen = self.divisions or self._choose_divisions(data, bounds)
        divisions = np.array(chosen)
        carved = self.method == "carved"
        if carved:  # add whole hexahedra for the margin
            step = (bounds[:, 1] - bounds[:, 0]) / divisions
            bounds += np.array([-1, 1]) * self.margin * step[:, None]
            divisions = divisions + 2 * self.margin
        require_memory(
            # Numbering the edges of quadratic tetrahedra takes more memory than the cage.
            round(estimate_bytes(divisions.tolist()) * (1.1 if self.order == 1 else 10.5)),
            "this cage",
            key="divisions",
            value=list(chosen),
            cure="Use fewer divisions; a cage should be coarse.",
        )
        vertices, tetrahedra = build_lattice(bounds.ravel().tolist(), divisions.tolist())
        if not carved:
            return vertices, tetrahedra
        kept = np.zeros(divisions[::-1], dtype=bool)
        cells = bounds[:, 0], (bounds[:, 1] - bounds[:, 0]) / divisions, divisions.tolist()
        if cloth is not None:
            kept = _find_cells_of_yarns(cloth, points_of(data).dtype, whole, *cells)
        elif data.GetNumberOfPoints():  # a process may have no points
            kept = find_touched_cells(*extract_outline(data, polygons_of(data)), *cells)
        if self._processes is not None:
            kept = self._processes.maximum(kept.ravel()).reshape(kept.shape) > 0.0
        kept = grow_cells(kept, self.margin, self.fill)
        sizes, loose = count_pieces(kept)
        if len(sizes) > 1:
            self.warn(
                f"the cage consists of {len(sizes)} separate pieces of "
                + ", ".join(str(size) for size in sizes[:8])
                + (", ..." if len(sizes) > 8 else "")
                + " hexahedra"
                + (
                    f"; {len(sizes) - loose} of them are joined only by an edge or a corner"
                    if loose < len(sizes)
                    else "; pieces that are not fixed move separately"
                )
                + ": raise cage.margin or lower cage.divisions to join them"
            )
        groups = tetrahedra.reshape(-1, TETRAHEDRA_PER_CELL, 4)[kept.ravel()]
        used, numbers = np.unique(groups, return_inverse=True)
        return vertices[used], numbers.reshape(-1, 4)

    def _choose_divisions(self, data: vtkDataSet, bounds: Floats) -> tuple[int, ...]:
        """Choose automatic divisions of a box, (3, 2)."""
        extent, cloth = bounds[:, 1] - bounds[:, 0], cloth_of(data)
        mass = data.GetFieldData().GetArray("areal_mass")
        weight = None if mass is None else float(mass.GetValue(0))
        content = content_of(data)
        self._choose = partial(_choose_cells, bounds=bounds, cloth=content, mass=weight)
        solver = self.solver if self.order == 1 else None
        self._sheet_cells = None if solver is None else self._choose(solver)
        chosen = (5, 5, 1) if cloth is not None else _cubic_divisions(extent)
        if self._sheet_cells is not None:
            chosen, wanted = (
                tuple(np.insert(cells, extent.argmin(), 1).tolist()) for cells in self._sheet_cells
            )
            if wanted != chosen:
                self.warn(
                    "the modes, folds, supports or obstacles of this sheet need cage.divisions of "
                    f"about {list(wanted)}; the automatic cage is limited to {MOST_CELLS} cells, "
                    f"{list(chosen)}"
                )
        self.values_in_use = {"divisions": chosen}
        return chosen

    def _make_tetwild(self, data: vtkDataSet, cloth: Cloth | None) -> tuple[Floats, Ints]:
        whole = bounds_of_whole(data, self.piece, self._processes)
        low, high = np.array(whole).reshape(3, 2).T
        diagonal = float(np.linalg.norm(high - low))
        if diagonal == 0.0:
            raise GeometryError("the object is a single point")
        if cloth is not None:
            touch = partial(_find_cells_of_yarns, cloth, points_of(data).dtype, whole)
            return self._fill(make_envelope(low, high, touch, self.inflate), diagonal)
        points, triangles = extract_outline(data, polygons_of(data))
        touch = partial(find_touched_cells, points, triangles)
        tolerance = EPSILON * diagonal
        if self.inflate > 0.0:
            made = self._fill(make_envelope(low, high, touch, self.inflate), diagonal)
            return enclose_points(points, *made, _FURTHEST * tolerance), made[1]
        triangles = triangles[triangles[:, 1] != triangles[:, 2]]
        if not len(triangles):
            raise GeometryError(
                "the object has no surface to fill",
                key="inflate",
                value=self.inflate,
                cure='Use an envelope, for example inflate = "1 mm", or method = "carved".',
            )
        open_, crowded = count_edge_faults(triangles, points)
        kinds = (open_, "open"), (crowded, "branching")
        if faults := [f"{count} {kind} edges" for count, kind in kinds if count]:
            self.warn(
                f"the object's surface has {' and '.join(faults)}, which fTetWild repairs in its "
                "own way: check the cage, or use an envelope (cage.inflate)"
            )
        vertices, tetrahedra = self._fill((points, triangles), diagonal)
        inside = float(tetrahedron_volumes(vertices, tetrahedra).sum())
        sizes, loose = count_parts(tetrahedra)
        if len(sizes) > loose:
            # A part that can rotate about an edge or a vertex is not held: solvers would fail.
            join = partial(self._join_parts, partial(make_envelope, low, high, touch), diagonal)
            length = self.edge_length or diagonal / 10
            mesh = load_or_make(join, points, triangles, length, _ENVELOPES, EPSILON)
            vertices, tetrahedra = mesh["vertices"], mesh["tetrahedra"]
            distance = format_quantity(float(f"{float(mesh['distance']):.3g}"), "m")
            self.warn(
                f"the object's surface encloses {len(sizes)} parts, some joined only by an edge or "
                f"a vertex: the cage fills an envelope at {distance} from it (cage.inflate "
                "sets another distance)"
            )
        vertices = enclose_points(points, vertices, tetrahedra, _FURTHEST * tolerance)
        volume = float(tetrahedron_volumes(vertices, tetrahedra).sum())
        closed = triangles[: 0 if open_ else None]
        self._filled_share = enclosed_share(points, closed, inside, volume, tolerance)
        if self._filled_share * _LARGER < 1.0:
            self.warn(
                f"the volume of the cage is {1 / self._filled_share:.2g} times that of the object: "
                "the material is spread over the whole cage, which has the same mass but is "
                "stiffer in bending"
            )
        return vertices, tetrahedra

    def _join_parts(self, around: Callable[[float], Outline], diagonal: float) -> dict[str, Any]:
        """Return the mesh of the narrowest envelope that joins all that the widest one joins."""
        most = count_bodies(*around(_ENVELOPES[-1] * diagonal))
        for share in _ENVELOPES:
            skin = around(share * diagonal)
            if count_bodies(*skin) <= most:
                vertices, tetrahedra = self._fill(skin, diagonal)
                sizes, loose = count_parts(tetrahedra)
                if len(sizes) == loose <= most:
                    break
        return {
            "vertices": vertices,
            "tetrahedra": tetrahedra,
            "distance": np.array(share * diagonal),
        }

    def _fill(self, surface: Outline, diagonal: float) -> tuple[Floats, Ints]:
        vertices, made = fill_surface(*surface, self.edge_length or diagonal / 10)
        tetrahedra, _, flat = repair_tetrahedra(vertices, made)
        if not len(tetrahedra):
            raise GeometryError(
                f"all {flat} tetrahedra of the cage are flat",
                cure="Use an envelope (cage.inflate).",
            )
        used, numbers = np.unique(tetrahedra, return_inverse=True)
        return vertices[used], numbers.reshape(-1, 4)

    def _read_file(self, output: vtkUnstructuredGrid) -> None:
        if self.order == 2:
            raise InputError(
                "a cage from a file cannot get midpoints on its edges",
                key="order",
                value=2,
                cure="Leave order out, or use another method.",
            )
        if self.file is None:
            raise InputError(
                'method "file" needs a file', key="file", allowed=type(self).file.allowed
            )
        with add_key_to_errors("file"):
            volume = split_into_tetrahedra(
                merge_blocks(read_blocks(self.file), self.file), str(self.file)
            )
        for note in volume.notes:
            self.warn(note)
        output.ShallowCopy(volume.grid)


def _choose_cells(
    solver: ModalSolver, bounds: Floats, cloth: Cloth | TextileKind | None, mass: float | None
) -> SheetCells | None:
    """Return the cells that a solver chooses for a sheet; None for a solid."""
    try:
        return solver.choose_cells(bounds, cloth, mass)
    except SpacemapError:  # of the material; the solver raises it as its own
        return None


def _make_observer(cage: TetraCage) -> Callable[[Any, str], None]:
    """Return an observer of the solver that a cage follows; it does not keep the cage alive."""
    known = weakref.ref(cage)

    def follow(caller: Any, event: str) -> None:
        cage = known()
        if cage is not None and (solver := cage.solver) is caller and solver is not None:
            cage._choose_again(solver)

    return follow


def _cubic_divisions(sides: Floats) -> tuple[int, ...]:
    """Return the numbers of hexahedra that make them nearly cubes."""
    return tuple(np.maximum(1, np.rint(_ALONG * sides / sides.max())).astype(int).tolist())


def _find_cells_of_yarns(
    cloth: Cloth,
    kind: DTypeLike,
    whole: Sequence[float],
    origin: Floats,
    spacing: Floats,
    divisions: Sequence[int],
) -> Bools:
    """Find the hexahedra that a cloth touches, as `touched` does, building few yarns at a time."""
    # `whole` are the bounds of all control points, and `kind` is their data type.
    kept = np.zeros(divisions[::-1], np.bool_)
    bounds, nothing = np.array(whole).reshape(3, 2), np.empty(0, np.int64)

    def box(number: int, yarn: int) -> tuple[slice, ...]:
        """Return the hexahedra that a yarn may touch."""
        own, room = cloth.yarns[number], bounds.copy()
        reach = 0.5 * float(own.aspect) * float(own.diameter[yarn]) * (1.0 + _SLACK)
        room[number] = own.position[yarn] + np.array([-reach, reach])
        places = (room - origin[:, None]) / spacing[:, None] + [-_SLACK, _SLACK]
        last = np.array(divisions)[:, None] - 1
        first_last = np.clip(np.floor(places).astype(np.int64), 0, last)
        return tuple(slice(a, b + 1) for a, b in first_last[::-1].tolist())

    for number, across in enumerate(cloth.size[::-1]):
        boxes = [box(number, yarn) for yarn in range(cloth.size[number])]
        # A few yarns far apart touch most hexahedra. Another yarn is built only if it may touch
        # more.
        apart = np.arange(len(boxes)) % _APART == 0
        for yarns in (np.flatnonzero(apart), np.flatnonzero(~apart)):
            waiting = yarns.tolist()
            while waiting:
                some: list[int] = []
                while waiting and len(some) * across < _CROSSINGS:
                    if not kept[boxes[waiting[0]]].all():
                        some.append(waiting[0])
                    waiting.pop(0)
                if not some:
                    break
                cancel.check()
                chosen = np.array(some)
                share = YarnSelection(nothing, chosen) if number else YarnSelection(chosen, nothing)
                patches = vtkUnstructuredGrid()
                set_patches(patches, build_weave(cloth, share, kind))
                shape = extract_outline(patches, polygons_of(patches))
                kept |= find_touched_cells(*shape, origin, spacing, divisions)
    return kept
