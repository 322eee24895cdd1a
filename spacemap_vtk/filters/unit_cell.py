"""UnitCell: one repeat of a textile in a matrix, as voxels."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from vtkmodules.vtkCommonDataModel import (
    VTK_BEZIER_QUADRILATERAL,
    vtkImageData,
    vtkUnstructuredGrid,
)

from spacemap_vtk.datasets.arrays import array_of, cells_of, points_of
from spacemap_vtk.datasets.cloth_data import CORNER, REPEAT
from spacemap_vtk.datasets.voxel_image import fill_image
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.base import ProvidedArray, Stage
from spacemap_vtk.memory import require_memory
from spacemap_vtk.ndarrays import AnyFloats, Floats
from spacemap_vtk.parameters import Choice, Integer, Real, Vector
from spacemap_vtk.unit_cell.materials import FIBRES, MATRICES
from spacemap_vtk.unit_cell.mixtures import YARN_RULES, Constituent
from spacemap_vtk.unit_cell.phases import Phases, UnitCellModel, assign_materials
from spacemap_vtk.unit_cell.rasterise import Voxels, rasterise, stack
from spacemap_vtk.unit_cell.surfaces import YarnSurfaces, sample_surfaces
from spacemap_vtk.units import format_quantity

#: Bytes per voxel while the constants are computed, measured and rounded up.
_VOXEL_BYTES = 900
#: Voxels along the longer side, if none are given: at least, for each yarn, and at most.
_LEAST, _PER_YARN, _MOST = 64, 16, 256
#: Fewest voxels for each yarn, if none are given.
_LEAST_PER_YARN = 8
#: Fewest voxels along any side.
FEWEST_VOXELS = 8
#: Share of the yarns' volume inside other yarns from which it is reported.
_OVERLAP = 0.002
#: Share of the height of the layers by which a mould may be higher without a warning.
_INFLATED = 0.01


def _own(help: str, unit: str, of: str, **more: Any) -> Real:
    """Declare a constant that replaces one of the library."""
    return Real(None, help, unit=unit, automatic=f"of the {of}", **more)


class UnitCell(Stage):
    """Fill one repeat of a textile and the matrix around it with voxels.

    The input are the patches of a piece that contains a repeat and its neighbours. A voxel has the
    share of yarn in it, the number of the yarn, the direction of its fibres and their share of the
    yarn. Several layers lie on top of each other.

    Examples
    --------
    >>> from spacemap_vtk import UnitCell, WeaveSource, connect
    >>> cell = connect(WeaveSource(), UnitCell(voxels=32))
    >>> cell.output.GetDimensions()
    (33, 33, 17)
    """

    section = "unit_cell"
    role, after = "unit_cell", "source"
    inputs = ("vtkUnstructuredGrid",)
    takes = ("object",)
    makes = "cell"
    output_type = "vtkImageData"
    provides: ClassVar = {
        "fraction": ProvidedArray("cell"),
        "yarn": ProvidedArray("cell"),
        "direction": ProvidedArray("cell"),
        "packing": ProvidedArray("cell"),
    }

    voxels = Integer(
        None,
        "Number of voxels along the longer side of the repeat.",
        minimum=FEWEST_VOXELS,
        maximum=1024,
        automatic="16 for each yarn, at least 64 and at most 256",
    )
    height = Real(
        None,
        "Height of a layer.",
        unit="m",
        above=0.0,
        usual_units="mm",
        automatic="thickness of the textile",
    )
    layers = Integer(1, "Number of layers of cloth on top of each other.", minimum=1, maximum=64)
    shift = Vector(
        (0.0, 0.0),
        "How far each layer is moved along x and y from the one below, as a share of the repeat.",
        component=Real(0.0, "", minimum=-1.0, maximum=1.0),
        labels="xy",
    )
    nesting = Real(
        0.0,
        "How far each layer reaches into the one below.",
        unit="m",
        minimum=0.0,
        usual_units="mm",
    )
    thickness = Real(
        None,
        "Thickness of the composite between the halves of a mould. Where the textile is pressed, "
        "sheared or narrowed, matrix leaves the yarns, and their fibres lie closer.",
        unit="m",
        above=0.0,
        usual_units="mm",
        automatic="height of the layers; yarns and matrix keep their volume in shear and stretch",
    )
    shear = Real(
        0.0,
        "Angle by which the textile is sheared: weft stays along x, and warp leans towards it. "
        "Yarns keep their length; without thickness they keep their volume, and the cell becomes "
        "higher.",
        unit="deg",
        minimum=-75.0,
        maximum=75.0,
    )
    fibre = Choice("e_glass", "Material of the fibres.", choices=tuple(FIBRES))
    matrix = Choice("epoxy", "Material between the fibres and yarns.", choices=tuple(MATRICES))
    packing = Real(0.65, "Share of fibre in the yarns; the rest is matrix.", above=0.0, maximum=0.9)
    yarn_rule = Choice(
        "chamis",
        "How the stiffness of a yarn follows from fibre and matrix: Chamis's formulas, or Mori and "
        "Tanaka's estimate.",
        choices=tuple(YARN_RULES),
    )
    fibre_modulus = _own("Young's modulus along the fibres.", "Pa", "fibre", above=0.0)
    fibre_transverse_modulus = _own("Young's modulus across them.", "Pa", "fibre", above=0.0)
    fibre_shear_modulus = _own("Shear modulus along them.", "Pa", "fibre", above=0.0)
    fibre_poissons_ratio = _own(
        "Contraction across fibres that are pulled.", "", "fibre", above=-1.0, maximum=1.0
    )
    fibre_transverse_poissons_ratio = _own(
        "Poisson's ratio between two directions across them.", "", "fibre", above=-1.0, below=1.0
    )
    fibre_expansion = _own("Thermal expansion along them.", "1/K", "fibre")
    fibre_transverse_expansion = _own("Thermal expansion across them.", "1/K", "fibre")
    fibre_density = _own("Density of the fibres.", "kg/m3", "fibre", above=0.0)
    matrix_modulus = _own("Young's modulus of the matrix.", "Pa", "matrix", above=0.0)
    matrix_poissons_ratio = _own(
        "Poisson's ratio of the matrix.", "", "matrix", above=-1.0, below=0.5
    )
    matrix_expansion = _own("Thermal expansion of the matrix.", "1/K", "matrix")
    matrix_density = _own("Density of the matrix.", "kg/m3", "matrix", above=0.0)

    def run(self, inputs: list[vtkUnstructuredGrid], output: vtkImageData, time: float) -> None:
        """Fill the voxels."""
        cell = make_unit_cell(self, inputs[0], self.voxels)
        for text in self.find_warnings(*cell):
            self.warn(text)
        fill_image(output, *cell, self.packing, self.gradient(*cell))

    @property
    def fibre_material(self) -> Constituent:
        """Material of the fibres, with own constants."""
        known = FIBRES[self.fibre].constituent
        given = {
            "axial_modulus": self.fibre_modulus,
            "transverse_modulus": self.fibre_transverse_modulus,
            "axial_shear": self.fibre_shear_modulus,
            "axial_poisson": self.fibre_poissons_ratio,
            "transverse_poisson": self.fibre_transverse_poissons_ratio,
            "axial_expansion": self.fibre_expansion,
            "transverse_expansion": self.fibre_transverse_expansion,
            "density": self.fibre_density,
        }
        own = {name: value for name, value in given.items() if value is not None}
        if known.is_isotropic:
            # An isotropic fibre of another modulus stays isotropic, unless more is given.
            modulus = own.get("axial_modulus", known.axial_modulus)
            poisson = own.get("axial_poisson", known.axial_poisson)
            known = Constituent.isotropic(
                modulus, poisson, own.get("axial_expansion", known.axial_expansion), known.density
            )
        return replace(known, **own)

    @property
    def matrix_material(self) -> Constituent:
        """Material of the matrix, with own constants."""
        known = MATRICES[self.matrix].constituent
        given = (
            (self.matrix_modulus, known.axial_modulus),
            (self.matrix_poissons_ratio, known.axial_poisson),
            (self.matrix_expansion, known.axial_expansion),
            (self.matrix_density, known.density),
        )
        return Constituent.isotropic(*(own if one is None else one for one, own in given))

    def _yarn_material(self, area: float = 1.0) -> Constituent:
        """Return the material of a yarn where its section has a share of its mean area."""
        packing = self.packing / area
        if packing > 1.0:
            raise InputError(
                f"a yarn is squeezed to {area:.0%} of its mean section, where fibres have no room",
                key="packing",
                value=self.packing,
                allowed=f"at most {area:.2g}",
            )
        rule = YARN_RULES[self.yarn_rule]
        return rule(self.fibre_material, self.matrix_material, packing)

    def assign(self, voxels: Voxels, spacing: Floats, gradient: Floats | None = None) -> Phases:
        """Assign a material to each voxel.

        Parameters
        ----------
        voxels : Voxels
            Share, number and direction of yarns.
        spacing : ndarray, shape (3,)
            Size of a voxel [m].
        gradient : ndarray, shape (3, 3), optional
            Gradient of the deformation from the box of the voxels to the cell; by default that of
            the parameters.

        Returns
        -------
        Phases
            Materials of the voxels.
        """
        return assign_materials(
            voxels,
            spacing,
            self._yarn_material,
            self.matrix_material,
            gradient=self.gradient(voxels, spacing) if gradient is None else gradient,
        )

    def gradient(
        self, voxels: Voxels, spacing: Floats, shear: float | None = None
    ) -> Floats | None:
        """Compute the gradient of the deformation from the box of the voxels to the cell.

        Parameters
        ----------
        voxels : Voxels
            Voxels of the textile.
        spacing : ndarray, shape (3,)
            Size of a voxel [m].
        shear : float, optional
            Shear angle [degrees]; by default that of the parameters.

        Returns
        -------
        ndarray, shape (3, 3), or None
            None if the cell is the box.
        """
        shear = self.shear if shear is None else shear
        factor = None
        if self.thickness is not None:
            factor = self.thickness / (len(voxels.fraction) * float(spacing[2]))
        if not shear and factor is None:
            return voxels.base
        made = shear_gradient(np.radians(shear), factor)
        return made if voxels.base is None else made @ voxels.base

    def find_warnings(self, voxels: Voxels, spacing: Floats) -> list[str]:
        """Describe what is doubtful in a cell.

        Parameters
        ----------
        voxels : Voxels
            Voxels of the textile.
        spacing : ndarray, shape (3,)
            Size of a voxel [m].

        Returns
        -------
        list of str
            One sentence for yarns that overlap, and one for a mould that is higher than the layers.
        """
        found = []
        if voxels.overlap > _OVERLAP:
            found.append(
                f"{voxels.overlap:.1%} of the yarns' volume lies inside other yarns, so that there "
                "is less fibre in the cell than in the cloth"
            )
        height = len(voxels.fraction) * float(spacing[2])
        if self.thickness is not None and self.thickness > (1 + _INFLATED) * height:
            found.append(
                f"unit_cell.thickness = {format_quantity(self.thickness, 'm', 3)} is more than the "
                f"height of the layers, {format_quantity(height, 'm', 3)}: yarns become "
                f"{self.thickness / height:.3g} times as high with the same fibres. For matrix "
                f"above and below the yarns set unit_cell.height = "
                f'"{format_quantity(self.thickness / self.layers, "m", 3)}" instead'
            )
        return found

    def model(self, title: str, patches: vtkUnstructuredGrid) -> UnitCellModel:
        """Make voxels and materials for a file.

        Parameters
        ----------
        title : str
            Title of the scene.
        patches : vtkUnstructuredGrid
            Patches of a piece, with the field arrays of its repeat.

        Returns
        -------
        UnitCellModel
            Voxels and materials.
        """
        voxels, spacing = make_unit_cell(self, patches, self.voxels)
        return UnitCellModel(
            title,
            voxels,
            spacing,
            self._yarn_material,
            self.matrix_material,
            self.packing,
            gradient=self.gradient(voxels, spacing),
        )


def shear_gradient(angle: float, height: float | None = None) -> Floats:
    """Compute the deformation gradient of a cell that is sheared.

    Parameters
    ----------
    angle : float
        Angle by which the warp leans towards the weft [rad].
    height : float, optional
        Stretch of the cell's height; by default the volume is kept.

    Returns
    -------
    ndarray, shape (3, 3)
        Gradient with unchanged lengths of weft and warp.
    """
    sine, cosine = np.sin(angle), np.cos(angle)
    up = 1 / cosine if height is None else height
    return np.array([[1.0, sine, 0.0], [0.0, cosine, 0.0], [0.0, 0.0, up]])


def make_unit_cell(
    stage: UnitCell, patches: vtkUnstructuredGrid, count: int | None
) -> tuple[Voxels, Floats]:
    """Fill the voxels of a repeat.

    Parameters
    ----------
    stage : UnitCell
        Its parameters.
    patches : vtkUnstructuredGrid
        Patches of a piece, with the field arrays of its repeat.
    count : int or None
        Voxels along the longer side.

    Returns
    -------
    Voxels, ndarray of shape (3,)
        The voxels, and the size of one [m].
    """
    field = patches.GetFieldData()
    if not field.HasArray(REPEAT):
        raise InputError(
            "the patches hold no whole repeat of the textile with its neighbours",
            cure="Make a larger piece of a weave, for example weave.ends = 12 and "
            "weave.picks = 12; for other textiles connect the stage to "
            "TextileSource.around_repeat().",
        )
    repeat = array_of(field, REPEAT, "a textile").reshape(2, 3)[:, :2].astype(np.float64)
    corner = array_of(field, CORNER, "a textile").ravel().astype(np.float64)
    if np.linalg.det(repeat) < 0:
        repeat = repeat[::-1]
    sides: Floats = np.linalg.norm(repeat, axis=1).astype(np.float64)
    base = np.eye(3)
    base[:2, :2] = (repeat / sides[:, None]).T
    is_skew = abs(base - np.eye(3)).max() > 1e-9
    base = base if is_skew else np.eye(3)
    to_box = np.linalg.inv(base)
    if count is None:
        count = _choose_count(_count_yarns(patches, corner, sides, to_box))
    ends = corner[:2] + np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) @ repeat
    surfaces = _surfaces_of(patches, ends.min(axis=0), ends.max(axis=0))
    inside = surfaces.points[..., 2]
    low, high = float(inside.min()), float(inside.max())
    height = high - low if stage.height is None else stage.height
    size = np.array([*sides, height])
    shape = _shape(size, count)
    pitch = height - stage.nesting
    if pitch <= 0:
        raise InputError(
            "the layers reach into each other by more than their height",
            key="nesting",
            value=stage.nesting,
            allowed=f"less than {format_quantity(height, 'm', 3)}",
        )
    spacing = size / shape
    require_memory(
        int(np.prod(shape)) * stage.layers * _VOXEL_BYTES,
        f"a unit cell of {' × '.join(map(str, shape))} voxels",
        cure="Use fewer voxels.",
    )
    origin = np.array([*corner[:2], (low + high - height) / 2])
    layer = rasterise(
        (surfaces.points - origin) @ to_box.T / spacing,
        surfaces.tangents @ to_box.T,
        surfaces.area / np.linalg.det(base),
        surfaces.yarn,
        (int(shape[0]), int(shape[1]), int(shape[2])),
    )
    if is_skew:
        layer = replace(layer, base=base)
    if stage.layers == 1:
        return layer, spacing
    levels = [round(number * pitch / spacing[2]) for number in range(stage.layers)]
    moved = np.outer(np.arange(stage.layers), np.array(stage.shift) * shape[:2])
    shifts = [(round(x), round(y)) for x, y in moved]
    depth = levels[-1] + int(shape[2])
    return stack(layer, levels, shifts, depth + depth % 2), spacing


def _surfaces_of(patches: vtkUnstructuredGrid, low: Floats, high: Floats) -> YarnSurfaces:
    weights = patches.GetPointData().GetRationalWeights()
    return sample_surfaces(
        points_of(patches),
        cells_of(patches, VTK_BEZIER_QUADRILATERAL, "patches"),
        None if weights is None else array_of(patches.GetPointData(), "RationalWeights", "patches"),
        array_of(patches.GetCellData(), "yarn", "patches"),
        low,
        high,
    )


def _count_yarns(
    patches: vtkUnstructuredGrid, corner: Floats, sides: Floats, to_box: AnyFloats
) -> int:
    """Count the yarns side by side in a repeat: half of all that lie in it."""
    first = cells_of(patches, VTK_BEZIER_QUADRILATERAL, "patches")[:, 0]
    place = (points_of(patches)[first, :2] - corner[:2]) @ to_box[:2, :2].T
    inside = ((place > 0) & (place < sides)).all(axis=1)
    yarn = array_of(patches.GetCellData(), "yarn", "patches")
    return len(np.unique(yarn[inside])) // 2


def _choose_count(yarns: int) -> int:
    """Choose the number of voxels along a repeat of some yarns."""
    count = int(np.clip(_PER_YARN * yarns, _LEAST, _MOST))
    if count < _LEAST_PER_YARN * yarns:
        raise InputError(
            f"the repeat has about {yarns} yarns side by side, for which {count} voxels along it "
            "are too few",
            key="voxels",
            value=None,
            allowed=f"a number, best {_PER_YARN * yarns} or more",
            cure="Choose a smaller repeat, or give the number: --set unit_cell.voxels="
            f"{_LEAST_PER_YARN * yarns}.",
            window_cure="Choose a smaller repeat, or give the number.",
        )
    return count


def _shape(size: Floats, count: int) -> Any:
    """Choose the numbers of voxels along x, y and z; all are even."""
    from scipy.fft import next_fast_len

    sides = size[:2] / size[:2].max() * count
    # Cloth is thin: half as many voxels through it as along it, or cubes.
    through = max(size[2] / size[:2].max() * count, count / 2)
    # Halves of these numbers are sizes of fast Fourier transforms.
    halves = [max(FEWEST_VOXELS, round(side)) // 2 for side in (*sides, through)]
    return np.array([2 * next_fast_len(half, real=True) for half in halves])
