"""Jobs for pictures of a scene at one time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk import extensions
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.output import check_output
from spacemap_vtk.io.registry import writer, writer_endings
from spacemap_vtk.jobs.job import (
    Context,
    Job,
    Times,
    register,
    selected_times,
    to_size,
    to_texts,
    to_viewpoint,
)

if TYPE_CHECKING:
    from spacemap_vtk.draw.camera import Viewpoint
    from spacemap_vtk.draw.picture import Image
    from spacemap_vtk.scenes.scene import Scene

#: Default number of rays for each pixel of a traced picture.
SAMPLES = 64
#: Steps of the progress of a drawn picture.
_SHARES = 100
#: Most rays for each pixel.
MOST_SAMPLES = 65_536


@register()
@dataclass
class PictureJob(Job):
    """A picture of a scene at one time."""

    output: Path
    #: In s. None: the scene's time.
    time: float | None = None
    #: In pixels. None: the scene's size.
    size: tuple[int, int] | None = None
    #: Content of each panel: ``"fabric"``, ``"cage"`` or ``"both"``. Empty: as in the scene.
    panels: Sequence[str] = ()
    #: Viewpoint. None: the scene's.
    place: Viewpoint | None = None
    #: Whether only the edges of the fabric's facets are drawn.
    wireframe: bool = False
    #: Whether the camera is that of the scene's film.
    framed: bool = False
    #: Number of rays for each pixel. 0: the picture is drawn without ray tracing.
    samples: int = 0

    kind = "picture"
    command = "render"

    def __post_init__(self) -> None:
        check_output(self.output, writer_endings("picture"))
        self.time = None if self.time is None else float(self.time)
        self.size = to_size(self.size)
        self.panels = to_texts(self.panels)
        self.place = to_viewpoint(self.place)
        self.samples = int(self.samples)
        if not 0 <= self.samples <= MOST_SAMPLES:
            raise InputError(
                f"samples must be between 1 and {MOST_SAMPLES}", key="samples", value=self.samples
            )

    def as_json(self) -> dict[str, Any]:
        """Return the requested values, with the time as a list of one."""
        record = super().as_json()
        time = record.pop("time", None)
        times = {} if time is None else {"times": [time]}
        return {"what": self.kind, **times, **record}

    @classmethod
    def from_json(cls, record: Mapping[str, Any], output: Path) -> Job:
        """Return the job that `as_json` has described."""
        if times := record.get("times"):
            record = {**record, "time": times[0]}
        return super().from_json({k: v for k, v in record.items() if k != "times"}, output)

    def decide_times(self, scene: Scene) -> Times:
        """Return the requested time; by default the scene's."""
        return selected_times([scene.view.time if self.time is None else self.time])

    def write(self, context: Context) -> str:
        """Draw the picture and write it."""
        # Drawn before the file is opened: if the program is ended, there is nothing to remove.
        self.write_output(context, "picture", self._draw(context))
        return ""

    def _draw(self, context: Context) -> Image:
        from spacemap_vtk.draw.picture import Picture
        from spacemap_vtk.scenes import flat_picture

        scene, time = context.scene, context.times[0]
        size = self.size or flat_picture.picture_size(scene)
        fill_background(self.output, "picture", scene)
        if self.place is None:
            flat_picture.limit_to_beginning(scene, size)
        if self.samples:
            raytraced: Callable[..., Image] = extensions.load("renderers", "raytrace")
            return raytraced(scene, time, size, self.samples, context.progress)
        context.progress(0, _SHARES)
        picture = Picture(
            scene,
            scene.animation.frame_times() if self.framed else [time],
            size,
            self.panels,
            self.place,
            transparent=scene.view.transparent,
            wireframe=self.wireframe,
            orbits=self.framed,
        )
        picture.report_progress = lambda share: context.progress(int(share * _SHARES), _SHARES)
        image = picture.draw(time)
        picture.close()
        context.progress(_SHARES, _SHARES)
        return image


def fill_background(output: Path, holds: str, scene: Scene) -> None:
    """Draw the background of a transparent scene if the format needs one."""
    if scene.view.transparent and not writer(output, holds).alpha:
        scene.warn(f"{output.suffix} files cannot be transparent: the background is drawn")
        scene.assign("view", "transparent", False)
