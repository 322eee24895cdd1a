"""CrimpInterchange: keep the length of yarns in a stretched cage; they exchange crimp."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonCore import vtkDataArray
from vtkmodules.vtkCommonDataModel import vtkPointSet, vtkUnstructuredGrid

from spacemap_vtk.applicability import LIMITS
from spacemap_vtk.datasets.arrays import add_array, array_of, elements_of, points_of, to_array
from spacemap_vtk.datasets.cloth_data import FOOT, OFFSET, cloth_arrays, cloth_of
from spacemap_vtk.datasets.geometry_snapshot import GeometrySnapshot
from spacemap_vtk.embedding.plane_slopes import PlaneSlopes
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.algorithm import SAME_AS_INPUT
from spacemap_vtk.filters.base import ProvidedArray, Stage
from spacemap_vtk.filters.yarn_parameters import YarnParameters
from spacemap_vtk.memory import require_memory
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.parallel import blocks
from spacemap_vtk.textile.crimp.crimp_geometry import CrimpGeometry
from spacemap_vtk.textile.crimp.interchange import CrimpState, Interchange, YarnMechanics
from spacemap_vtk.textile.geometry.cloth_axes import ALL_YARNS, YarnSelection
from spacemap_vtk.textile.geometry.partition import select_piece
from spacemap_vtk.textile.weave.cloth import FAMILIES, Cloth

#: Tolerance between the input's points and those of its cloth, over its size: float32 precision.
_APART = 1e-5
#: Crossings whose slopes are prepared at a time; they need some hundred megabytes.
_BLOCK = 250_000


class CrimpInterchange(YarnParameters, Stage):
    """Keep the length of yarns in a stretched cage by changing their crimp.

    Port 0 is the weave, port 1 the moving cage. Without this stage yarns would stretch with the
    cage. Real yarns straighten along the pull and bend more across it. For each crossing the stage
    computes the stretches along warp and weft, and from these the crimp heights and the distance of
    the axes. It lays new axes through the crossings by Peirce's arcs; BarycentricWarp moves them
    with the cage. Sections turn with the cloth and change only where yarns press each other flat.

    Notes
    -----
    The output has the points of the input and two point arrays: ``foot`` is the position, in the
    plane between warp and weft, of the ring that a control point belongs to; ``interchange`` is the
    vector from the moved foot to the point.

    Examples
    --------
    >>> from spacemap_vtk import CrimpInterchange
    >>> CrimpInterchange(inextensible=False, modulus="300 cN/tex").modulus
    3000000.0
    """

    section = "yarns"
    role, after = "crimp", "rotation"
    inputs = ("vtkPointSet", "vtkUnstructuredGrid")
    takes = ("object", "cage")
    provides: ClassVar = {
        FOOT: ProvidedArray("point", "m"),
        OFFSET: ProvidedArray("point", "m"),
        "crimp": ProvidedArray("cell"),
        "yarn_strain": ProvidedArray("cell"),
        "yarn_tension": ProvidedArray("cell", "N", {"inextensible": (False,)}),
        "contact_force": ProvidedArray("cell", "N"),
        "jammed": ProvidedArray("cell"),
    }
    input_names = ("Input", "Cage")
    output_type = SAME_AS_INPUT

    _kept: _PreparedYarns | None = None
    _cloth_crossings: _ClothCrossings | None = None
    #: The crossings of a whole cloth, and the share of them that the input has.
    _borrowed: tuple[_ClothCrossings, YarnSelection] | None = None

    def run(self, inputs: list[Any], output: vtkPointSet, time: float) -> None:
        """Compute the heights at the crossings and the axes through them."""
        output.ShallowCopy(inputs[0])
        if self.piece.total > 1 and inputs[0].GetNumberOfPoints() == 0:
            return  # this process has no points
        borrowed = self._borrowed
        whole, part = borrowed or (self._crossings(*inputs), ALL_YARNS)
        kept = self._prepare(inputs[0], inputs[1])
        field = array_of(inputs[1].GetPointData(), "displacement", "CrimpInterchange, on port 1,")
        state, stretch = whole.solve(field).crop(part)
        slopes, ends = kept.slopes.compute(field), kept.geometry.warp_rings
        along = np.concatenate([slopes[1, :ends], slopes[0, ends:]])
        normal = np.cross(slopes[0], slopes[1])
        size = np.sqrt(np.einsum("rc,rc->r", normal, normal))
        normal /= np.where(size > 0.0, size, 1.0)[:, None]
        data = output.GetPointData()
        data.AddArray(kept.foot)
        offsets = kept.geometry.offsets(state.height, stretch, along, normal, kept.precision)
        add_array(data, OFFSET, offsets)
        tension = whole.tension
        if tension.size > 2:
            tension = tension[:, part.picks, part.ends]
        weights = kept.geometry.weights(state.height, stretch)
        if weights is not None:
            data.SetRationalWeights(to_array(weights, "RationalWeights"))
        # Keep the order of `arrays`, which a set would lose: pieces of a cloth must agree in it to
        # be joined, and files must be reproducible.
        for name in [n for n, array in self.arrays.items() if array.association == "cell"]:
            values = _crossing_values(name, state, tension)
            if len(values) == 1:
                values = np.concatenate([values, values])
            add_array(output.GetCellData(), name, values.ravel()[kept.geometry.crossing])
        if borrowed is None:
            self._check_limits(state, stretch, whole.crimp)

    def crossing_values(
        self, name: str, weave: vtkPointSet, cage: vtkUnstructuredGrid
    ) -> NDArray[np.float32 | np.uint8]:
        """Return the values of a provided array at all crossings, without laying yarns.

        Parameters
        ----------
        name : str
            Name of a cell array.
        weave : vtkPointSet
            A weave or one piece of it.
        cage : vtkUnstructuredGrid
            The cage with its displacement.

        Returns
        -------
        ndarray of float32, or of uint8 for ``"jammed"``, shape (2 or 1, picks, ends)
            Values of warp and weft, or one value for both.

        Raises
        ------
        GeometryError
            If the yarns at rest do not fit.
        InputError
            If the input is not a weave, its axes are splines, or its yarns are impossible.
        """
        whole = self._crossings(weave, cage)
        field = array_of(cage.GetPointData(), "displacement", "CrimpInterchange, on port 1,")
        current = whole.solve(field)
        self._check_limits(*current, whole.crimp)
        return _crossing_values(name, current.state, whole.tension)

    def use_crossings_of(
        self, whole: CrimpInterchange | None, part: YarnSelection = ALL_YARNS
    ) -> None:
        """Use the crossings of another stage's last update, which has the whole cloth.

        Parameters
        ----------
        whole : CrimpInterchange or None
            A stage with the same settings and the same cage; None: use none.
        part : YarnSelection, optional
            Slices of the yarns whose crossings the input has.
        """
        borrowed = None
        if whole is not None and whole._cloth_crossings is not None:
            borrowed = whole._cloth_crossings, part
        if self._borrowed != borrowed:
            self._borrowed = borrowed
            self.Modified()

    def _check_limits(self, state: CrimpState, stretch: Floats, crimp: Floats) -> None:
        """Check for jammed, slack and strained yarns."""
        count = state.distance.size
        jammed = state.jammed.any(axis=0)
        words = {}
        if jammed.any():
            pressed = np.where(state.jammed, stretch, np.inf)
            family, pick, end = np.unravel_index(int(np.argmin(pressed)), pressed.shape)
            words = {
                "found": f"{jammed.sum()} of {count} crossings are jammed",
                "beyond": "yarns cannot bend further, worst at end "
                f"{end + 1} and pick {pick + 1}, where the cage compresses the "
                f"{FAMILIES[family]} to {pressed.min():.3g} of its length",
            }
        self.check_limit("jam", float(jammed.mean()), **words)
        # Excess length: yarn length over path length, both per length of the cloth at rest.
        spare = (1.0 + crimp) / ((1.0 + state.crimp) * stretch) - 1.0
        slack = (state.slack & (spare > LIMITS["slack"].most)).any(axis=0) & ~jammed
        excess = np.where(state.slack & ~jammed, spare, 0.0)
        found = (
            f"yarns are slack at {slack.sum()} of {count} crossings: they are up to {{}} longer "
            "than their path"
        )
        self.check_limit("slack", float(excess.max()), found=found)
        if self.inextensible:
            family, pick, end = np.unravel_index(int(np.argmax(state.strain)), state.strain.shape)
            found = (
                f"yarns have no crimp left: the {FAMILIES[family]} is strained by up to {{}}, most "
                f"at end {end + 1} and pick {pick + 1}"
            )
            self.check_limit("no_crimp", float(state.strain.max()), found=found)

    def _crossings(self, weave: vtkPointSet, cage: vtkUnstructuredGrid) -> _ClothCrossings:
        """Return the crossings of the whole cloth of a weave or of a piece of it."""
        kept, settings = self._cloth_crossings, tuple(self.settings.values())
        if kept is None or not kept.is_valid_for(settings, weave, cage):
            cloth = cloth_of(weave)
            if cloth is None:
                raise InputError(
                    "the data on port 0 are not a weave",
                    allowed="output of WeaveSource, also from a file",
                    cure="Remove [yarns]: it applies only to weaves",
                )
            if cloth.axis != "arcs":
                raise InputError(
                    f'crimp interchange cannot be computed for yarns with axis = "{cloth.axis}"',
                    allowed='axis = "arcs" in [weave]',
                )
            arrays = cloth_arrays(weave)
            kept = self._cloth_crossings = _ClothCrossings(
                settings, arrays, cloth, self.yarns(cloth), cage
            )
        return kept

    def _prepare(self, weave: vtkPointSet, cage: vtkUnstructuredGrid) -> _PreparedYarns:
        kept = self._kept
        settings = *self.settings.values(), *self.piece
        if kept is not None and kept.settings == settings and kept.is_valid_for(weave, cage):
            return kept
        count = weave.GetNumberOfPoints()
        require_memory(
            estimate_bytes(count, points_of(weave).dtype.itemsize == 4),
            f"crimp interchange of yarns with {count} control points",
            cure="Use fewer ends and picks, or remove [yarns].",
        )
        cloth = cloth_of(weave)
        assert cloth is not None
        share = (
            ALL_YARNS
            if self.piece.total == 1
            else select_piece(cloth, self.piece.number, self.piece.total)
        )
        recrimp = CrimpGeometry(cloth, share)
        points = points_of(weave)
        feet, apart = recrimp.repeat_rings(recrimp.feet), recrimp.rest_offsets
        if len(apart) == len(points):
            # In place: a large cloth has gigabytes of points.
            apart += feet
            apart -= points
        if len(apart) != len(points) or _largest(apart) > _APART * _largest(points):
            raise InputError(
                "the points on port 0 have been moved",
                cure="Connect WeaveSource directly, and move the result after BarycentricWarp",
            )
        precision = points.dtype.type
        vertices = points_of(cage).astype(np.float64)
        self._kept = _PreparedYarns(
            settings=settings,
            weave=GeometrySnapshot(weave),
            cage=GeometrySnapshot(cage),
            geometry=recrimp,
            slopes=PlaneSlopes(recrimp.feet, vertices, elements_of(cage)),
            foot=to_array(feet.astype(precision, copy=False), FOOT),
            precision=precision,
        )
        return self._kept


def _largest(values: NDArray[Any]) -> float:
    """Return the largest absolute value; needs no memory."""
    return float(max(values.max(), -values.min()))


def estimate_bytes(points: int, single: bool = False) -> int:
    """Estimate the memory for yarns that keep their length.

    Parameters
    ----------
    points : int
        Number of control points.
    single : bool, optional
        Whether points are in single precision.

    Returns
    -------
    int
        Bytes.
    """
    # Feet and offsets; for each ring of twelve points its slopes, their weights and its frames.
    return points * (2 * (12 if single else 24) + 500 // 12)


class _CrossingState(NamedTuple):
    """State of the crossings at one time."""

    state: CrimpState
    stretch: Floats
    """(2, picks, ends) Of space along warp and weft."""

    def crop(self, part: YarnSelection) -> _CrossingState:
        """Return the state of a share of the yarns."""
        ends, picks = part
        fields: Any = (values[..., picks, ends] for values in self.state)
        return _CrossingState(CrimpState(*fields), self.stretch[:, picks, ends])


class _ClothCrossings:
    """Crossings of a whole cloth in a cage, computed once for a cloth, its yarns and a cage."""

    def __init__(
        self,
        settings: tuple[Any, ...],
        arrays: dict[str, NDArray[Any]],
        cloth: Cloth,
        yarns: YarnMechanics,
        cage: vtkUnstructuredGrid,
    ) -> None:
        self._settings, self._arrays, self._cage = settings, arrays, GeometrySnapshot(cage)
        self._interchange = Interchange(cloth, yarns)
        self._shape = 2, *cloth.drawdown.shape
        #: Crimp at rest, (2, picks, ends).
        self.crimp: Floats = self._interchange.solve(np.ones(self._shape)).crimp
        tension = np.asarray(yarns.tension, np.float64)
        #: EA of warp and weft in N, at each crossing or one value each.
        self.tension: Floats = tension if tension.ndim == 3 else tension.reshape(2, 1, 1)
        ends, picks = (each.position for each in cloth.yarns)
        places = np.zeros((cloth.drawdown.size, 3))
        places[:, 0], places[:, 1] = np.tile(ends, len(picks)), np.repeat(picks, len(ends))
        vertices, elements = points_of(cage).astype(np.float64), elements_of(cage)
        self._slopes = [
            PlaneSlopes(places[some], vertices, elements) for some in blocks(len(places), _BLOCK)
        ]
        self._last: tuple[NDArray[Any], _CrossingState] | None = None

    def is_valid_for(
        self, settings: tuple[Any, ...], weave: vtkPointSet, cage: vtkUnstructuredGrid
    ) -> bool:
        """Return whether these crossings are still valid for a weave and a cage."""
        arrays = cloth_arrays(weave)
        same = settings == self._settings and arrays.keys() == self._arrays.keys()
        same = same and all(np.array_equal(a, arrays[n], True) for n, a in self._arrays.items())
        return same and self._cage.matches(cage)

    def solve(self, field: NDArray[Any]) -> _CrossingState:
        """Return the state of the crossings for a displacement of the cage's vertices."""
        if self._last is None or not np.array_equal(self._last[0], field):
            # `compute` gives unit vectors along x (weft), then y (warp); here warp comes first.
            found = [slopes.compute(field)[::-1] for slopes in self._slopes]
            stretch = [np.sqrt(np.einsum("anc,anc->an", two, two)) for two in found]
            stretches = np.concatenate(stretch, axis=1).reshape(self._shape)
            self._last = field.copy(), _CrossingState(self._interchange.solve(stretches), stretches)
        return self._last[1]


def _crossing_values(
    name: str, state: CrimpState, tension: Floats
) -> NDArray[np.float32 | np.uint8]:
    """Return an array's values at the crossings, (2 or 1, picks, ends)."""
    values: NDArray[Any] = {
        "crimp": state.crimp,
        "yarn_strain": state.strain,
        "yarn_tension": state.strain,
        "contact_force": state.contact[None] + 0.0,  # not -0
        "jammed": state.jammed,
    }[name]
    if name == "yarn_tension":
        values = tension * values
    return values.astype(np.uint8 if name == "jammed" else np.float32)


@dataclass
class _PreparedYarns:
    """Results that depend only on the weave and the cage at rest."""

    settings: tuple[Any, ...]
    weave: GeometrySnapshot
    cage: GeometrySnapshot
    geometry: CrimpGeometry
    slopes: PlaneSlopes
    foot: vtkDataArray
    precision: Any

    def is_valid_for(self, weave: vtkPointSet, cage: vtkUnstructuredGrid) -> bool:
        return self.weave.matches(weave) and self.cage.matches(cage)
