"""Jobs for films and numbered frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.output import check_output, explain_disk_errors
from spacemap_vtk.io.registry import writer, writer_endings
from spacemap_vtk.jobs.job import (
    Context,
    Job,
    Times,
    film_times,
    register,
    require_placeholder,
    to_size,
    to_texts,
    to_viewpoint,
)
from spacemap_vtk.jobs.picture import fill_background

if TYPE_CHECKING:
    from spacemap_vtk.draw.camera import Viewpoint
    from spacemap_vtk.scenes.scene import Scene

#: Smallest side, in pixels, of a film that is drawn at half the scene's size.
_SMALLEST = 16


@register()
@dataclass
class FilmJob(Job):
    """A film, or a separate file for each of its frames."""

    output: Path
    #: In pixels. None: the scene's size, or half of it for a .gif.
    size: tuple[int, int] | None = None
    #: Content of each panel: ``"fabric"``, ``"cage"`` or ``"both"``. Empty: as in the scene.
    panels: Sequence[str] = ()
    #: Viewpoint. None: the scene's.
    place: Viewpoint | None = None
    #: Whether only the edges of the fabric's facets are drawn.
    wireframe: bool = False
    #: Number of processes that draw. None: as many as the work is worth and the memory allows.
    workers: int | None = None
    #: Whether frames that a stopped film has left are drawn again.
    again: bool = False

    kind = "film"
    command = "animate"
    unrecorded = ("workers", "again")

    def __post_init__(self) -> None:
        check_output(
            self.output, writer_endings("film") | writer_endings("frames"), self.is_numbered
        )
        writer(self.output, self._content).check(self.output)
        if self.is_numbered:
            require_placeholder(self.output)
        self.size = to_size(self.size)
        self.panels = to_texts(self.panels)
        self.place = to_viewpoint(self.place)
        if self.workers is not None and self.workers < 1:
            raise InputError("workers must be at least 1", key="workers", value=self.workers)

    @property
    def is_numbered(self) -> bool:
        """Whether each frame is written into a separate file."""
        return self.output.suffix.lower() in writer_endings("frames")

    @property
    def _content(self) -> str:
        return "frames" if self.is_numbered else "film"

    @property
    def needs_folder(self) -> bool:
        """Whether other files may appear next to the output."""
        return self.is_numbered

    def decide_times(self, scene: Scene) -> Times:
        """Return the times of the frames."""
        if not (scene.is_animated or scene.animation.orbit):
            motion = "add loads to [response]"
            if not scene.moves:
                motion = "let it move with --hang, --drop, --swing or a section [response]"
            raise InputError(
                "nothing in this scene moves, so all frames would be the same",
                cure=f'Let the camera go round it with "--orbit 360deg", {motion}, or draw a '
                'picture with "spacemap render".',
            )
        scene.check()
        return film_times(scene)

    def write(self, context: Context) -> str:
        """Draw and encode the frames; return a sentence on those that existed before."""
        from spacemap_vtk.jobs.frames import FilmSettings, FrameFolder, write_film
        from spacemap_vtk.scenes import flat_picture

        scene, atomic = context.scene, context.atomic
        width, height = self.size or flat_picture.picture_size(scene)
        if self.size is None and self.output.suffix.lower() == ".gif":
            width, height = max(_SMALLEST, width // 2), max(_SMALLEST, height // 2)
        fill_background(self.output, self._content, scene)
        settings = FilmSettings.from_scene(
            scene, context.times, (width, height), self.panels, self.place, self.wireframe
        )
        frame_folder = FrameFolder(self.output, settings.digest, self.again)
        # A frame that is kept is a .png already, so it is copied.
        is_png = self.is_numbered and self.output.suffix.lower() == ".png"
        format_ = None if is_png else writer(self.output, self._content)
        with (
            explain_disk_errors(self.output, "" if atomic else self.output.name),
            frame_folder.lock(),
        ):
            with self.open_output(atomic) as file:
                message = write_film(
                    file, format_, scene, settings, frame_folder, context.progress, self.workers
                )
            frame_folder.remove()  # only after the film is complete
        return message
