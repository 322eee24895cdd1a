"""Jobs for sweeps: a folder with a picture, a scene and figures for each value."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from spacemap_vtk.errors import InputError
from spacemap_vtk.jobs.job import Context, Job, register, to_floats, to_texts


@register()
@dataclass
class SweepJob(Job):
    """A folder of pictures, scenes and figures: one run for each combination of values."""

    output: Path
    #: Swept values, ``section.key=value,value``.
    lists: Sequence[str] = ()
    #: Whether the lists are paired: the first values of all lists together, and so on.
    paired: bool = False
    #: Times of the pictures, in s. Empty: the scene's time.
    times: Sequence[float] = ()
    #: Number of processes. None: as many as the memory allows.
    workers: int | None = None

    kind = "sweep"
    command = "sweep"
    unrecorded = ("workers",)

    def __post_init__(self) -> None:
        self.lists, self.times = to_texts(self.lists), to_floats(self.times)
        if self.output.exists():
            raise InputError(f"{self.output} exists already", cure="Choose another name.")
        if not self.output.parent.is_dir():
            raise InputError(
                f"{self.output}: the folder {self.output.parent} does not exist",
                cure="Choose another place.",
            )

    @property
    def needs_folder(self) -> bool:
        """Whether other files may appear next to the output."""
        return True

    def write(self, context: Context) -> str:
        """Run the scene with all values; return how many runs failed."""
        from spacemap_vtk.jobs.sweep import execute_sweep
        from spacemap_vtk.scenes.scene_record import scene_values
        from spacemap_vtk.scenes.sweep import make_sweep

        scene = context.scene
        file = (scene.file or Path("scene")).absolute()
        sweep = make_sweep(
            scene,
            scene_values(scene),
            self.lists,
            file=file,
            paired=self.paired,
            times=self.times,
        )
        with self.open_output(context.atomic) as folder:
            results = execute_sweep(sweep, folder, context.progress, workers=self.workers)
        errors = [result.error for result in results.values() if result.error]
        failed = f", of which {len(errors)} failed: {errors[0]}" if errors else ""
        return f"{len(results)} runs{failed}"
