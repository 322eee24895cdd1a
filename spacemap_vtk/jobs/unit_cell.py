"""Jobs of composites: the voxels of a unit cell, and its modulus in all directions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.formats.unit_cell import MAP, VOXELS
from spacemap_vtk.io.output import check_output, format_csv, write_parts
from spacemap_vtk.io.registry import writer, writer_endings
from spacemap_vtk.jobs.job import Context, Job, register

#: Solvers for which decks are written.
SOLVERS = ("calculix", "abaqus")
#: Steps of the progress of one job.
_STEPS = 100


@register()
@dataclass
class UnitCellJob(Job):
    """Voxels of one repeat of a textile in its matrix, or input of another solver."""

    output: Path
    #: One of `SOLVERS`, for a deck.
    solver: str = SOLVERS[0]
    #: Whether the stresses and strains under six unit strains are written.
    fields: bool = False

    kind = "unit_cell"
    command = "unit-cell"

    def __post_init__(self) -> None:
        check_output(self.output, writer_endings("unit_cell"))
        writer(self.output, "unit_cell").check(self.output)
        if self.solver not in SOLVERS:
            raise InputError(
                "there is no deck for this solver",
                key="solver",
                value=self.solver,
                allowed=" or ".join(SOLVERS),
            )
        if self.fields and self.output.suffix.lower() not in VOXELS:
            raise InputError(
                f"{self.output}: files for other solvers hold no fields",
                key="fields",
                value=True,
                allowed=" or ".join(VOXELS),
                cure="Write voxels instead.",
            )

    @property
    def needs_folder(self) -> bool:
        """Whether other files may appear next to the output."""
        return True

    def write(self, context: Context) -> str:
        """Fill the voxels and write them; returns the largest stresses."""
        from spacemap_vtk.scenes.composite import largest_stresses, unit_cell_model

        def report(share: float) -> None:
            context.progress(round(_STEPS * share), _STEPS)

        model = unit_cell_model(context.scene, self.fields, report)
        self.write_output(context, "unit_cell", replace(model, solver=self.solver))
        context.progress(_STEPS, _STEPS)
        if not self.fields:
            return ""
        parts = [
            f"{name} {part} {size / 1e9:.3g} GPa" for name, part, size in largest_stresses(model)
        ]
        return f"largest equivalent stress for a strain of 1: {', '.join(parts)}"


@register()
@dataclass
class CompositeMapJob(Job):
    """Constants of a composite in each cell of deformed cloth, as .csv or .vtp."""

    output: Path
    #: Time in s. None: that of the scene's picture.
    time: float | None = None

    kind = "composite_map"
    command = "constants --map"

    def __post_init__(self) -> None:
        check_output(self.output, {".csv": "table", MAP: "surface"})

    def write(self, context: Context) -> str:
        """Compute the constants of all cells and write them."""
        from spacemap_vtk.scenes.composite_map import map_as_rows, map_as_surface, map_constants

        def report(share: float) -> None:
            context.progress(round(_STEPS * share), _STEPS)

        time = context.scene.view.time if self.time is None else self.time
        found = map_constants(context.scene, time, report)
        if self.output.suffix.lower() == ".csv":
            with self.open_output(context.atomic) as file:
                write_parts(file, [format_csv(map_as_rows(found)).encode()])
        else:
            self.write_output(context, "surface", map_as_surface(found))
        context.progress(_STEPS, _STEPS)
        # Rounded before 0 is added, so that no angle is -0°.
        angles = ", ".join(f"{angle:g}°" for angle in dict.fromkeys(found.angles.round() + 0.0))
        areas = ", ".join(f"{area:.1%}" for area in found.areas)
        low, high = found.fibre_share.min(), found.fibre_share.max()
        fibres = f"{low:.1%}" if high - low < 5e-4 else f"{low:.1%} to {high:.1%}"
        return (
            f"{len(found.shear)} cells, from cells sheared by {angles} with areas of {areas}; "
            f"fibres are {fibres} of the volume"
        )


@register()
@dataclass
class ConstantsJob(Job):
    """Young's modulus of a composite in all directions of its plane, as a plot or .csv."""

    output: Path

    kind = "constants"
    command = "constants"

    def __post_init__(self) -> None:
        check_output(self.output, {**writer_endings("plot"), ".csv": "table"})

    def write(self, context: Context) -> str:
        """Compute the constants, and write the moduli."""
        from spacemap_vtk.scenes.composite import compute_constants, directional_moduli

        def report(share: float) -> None:
            context.progress(round(_STEPS * share), _STEPS)

        found = compute_constants(context.scene, False, report)
        if self.output.suffix.lower() == ".csv":
            rows = zip(*directional_moduli(found.constants.compliance), strict=True)
            text = format_csv([("angle_rad", "youngs_modulus_Pa"), *rows])
            with self.open_output(context.atomic) as file:
                write_parts(file, [text.encode()])
        else:
            from spacemap_vtk.draw.figure.polar_plot import polar_plot

            self.write_output(context, "plot", polar_plot(context.scene.title, found))
        context.progress(_STEPS, _STEPS)
        return ""
