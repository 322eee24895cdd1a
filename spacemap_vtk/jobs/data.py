"""Jobs for data files: of one time, of a series of times, or in pieces."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.output import check_output, require_disk_space
from spacemap_vtk.io.provenance import attach_record_at
from spacemap_vtk.io.registry import DATA, writer, writer_endings, writers
from spacemap_vtk.jobs.job import (
    Context,
    Job,
    Times,
    film_times,
    make_job,
    register,
    require_placeholder,
    selected_times,
    to_floats,
)

if TYPE_CHECKING:
    from spacemap_vtk.draw.actors.surface_actor import Span
    from spacemap_vtk.scenes.scene import Scene

#: Keys of `DATA` whose data change with time, so that numbered files may hold one time each.
_MOVING_DATA = ("patches", "surface", "cage", "moving", "painted", "yarns")
#: A placeholder for a number in a file's name, or what looks like one.
_NUMBER = re.compile(r"%(\d+[a-z]?|[dis])(?![a-z])")
#: Default number of pieces of a file.
_PIECES = 4
#: Most pieces of a file.
_MOST_PIECES = 10_000


class ExportJob(Job):
    """A job that writes data of a scene for other programs."""

    #: Whether yarns are as irregular as in pictures. By default they are regular, as figures are.
    irregular: bool

    @property
    def is_numbered(self) -> bool:
        """Whether each time is written into a separate file."""
        return writes_numbered_files(self.output, self.kind)

    @property
    def needs_folder(self) -> bool:
        """Whether other files may appear next to the output."""
        return True

    @contextmanager
    def prepare(self, scene: Scene) -> Iterator[None]:
        """Make the yarns of the data irregular within the block if asked for, else regular."""
        from spacemap_vtk.scenes.irregular_data import yarns_of_data

        with yarns_of_data(scene, self.kind, self.irregular):
            yield


@register(*(kind for kind in DATA if kind not in ("moving", "modes")))
@dataclass
class DataJob(ExportJob):
    """Data of a scene at one time, at several times, or in pieces; see `make_data_job`."""

    output: Path
    #: A key of `spacemap_vtk.io.registry.DATA`.
    kind: str
    #: In s. Empty: the scene's time, or for a series the times of its film.
    times: Sequence[float] = ()
    #: Number of pieces that are made and written one after another, if the format has pieces.
    pieces: int = 0
    irregular: bool = False

    def __post_init__(self) -> None:
        check_data_output(self.output, self.kind, self.pieces)
        self.times = to_floats(self.times)
        if writer(self.output, self.kind).pieces:
            self.pieces = self.pieces or _PIECES

    @classmethod
    def create(cls, kind: str, output: Path, **fields: Any) -> Job:
        """Return a job of one of the kinds that this class is registered for."""
        return cls(output, kind, **fields)

    @property
    def is_series(self) -> bool:
        """Whether data of several times are written."""
        return self.is_numbered or writer(self.output, self.kind).times

    def decide_times(self, scene: Scene) -> Times:
        """Return the requested times; by default the scene's, or for a series its film's."""
        if self.is_series:
            return series_times(scene, self.times)
        return selected_times(self.times or [scene.view.time])

    def write(self, context: Context) -> str:
        """Compute and write the data; return the number of times or pieces, and the size."""
        format_ = writer(self.output, self.kind)
        if format_.pieces:
            return self._write_pieces(context)
        if self.is_series:
            painted = self.kind == "painted"
            span = common_scale(context.scene, context.times) if painted else None
            return write_series(
                self, context, lambda time: compute_data(context.scene, self.kind, time, span)
            )
        context.progress(0, 2)
        # Computed before the file is opened: if the program is ended, there is nothing to remove.
        content = compute_data(context.scene, self.kind, context.times[0])
        context.progress(1, 2)
        report_losses(self, context, content)
        self.write_output(context, self.kind, content)
        context.progress(2, 2)
        return ""

    def _write_pieces(self, context: Context) -> str:
        with self.open_output(context.atomic) as file:
            pieces = _make_pieces(context, self.kind, self.pieces)
            writer(file, self.kind).write(file, pieces)
            return f"{format_count(self.pieces, 'piece')}, {format_size(folder_size(file.parent))}"


def make_data_job(output: Path, kind: str = "", *, pieces: int = 0, **fields: Any) -> Job:
    """Return the job that writes data of a kind; by default the first kind of the file's format."""
    if not kind and output.suffix.lower() in writer_endings():
        kind = writer(output).holds[0]
    check_data_output(output, kind, pieces)
    if pieces:
        fields["pieces"] = pieces
    return make_job(kind, output, **fields)


def check_data_output(output: Path, kind: str, pieces: int = 0) -> None:
    """Refuse an output that cannot hold data of this kind, or not in pieces."""
    ending = output.suffix.lower()
    wanted = None if ending in writer_endings() or kind not in DATA else kind
    numbered = writes_numbered_files(output, kind)
    check_output(output, writer_endings(wanted), numbered)
    if ending not in writer_endings(kind):
        raise InputError(
            f"{ending} files cannot contain this kind of data",
            key="what",
            value=kind,
            allowed=", ".join(each for each in DATA if ending in writer_endings(each)),
        )
    if numbered:
        require_placeholder(output)
    format_ = writer(output, kind)
    format_.check(output)
    if pieces and not format_.pieces:
        endings = ", ".join(e for each in writers() if each.pieces for e in each.endings)
        raise InputError(
            f"{ending} files cannot be written in pieces; use {endings}", key="pieces", value=pieces
        )
    if not 0 <= pieces <= _MOST_PIECES:
        raise InputError(f"pieces must be between 1 and {_MOST_PIECES}", key="pieces", value=pieces)


def writes_numbered_files(output: Path, kind: str) -> bool:
    """Return whether each time is written into a separate file."""
    if kind not in _MOVING_DATA or output.suffix.lower() not in writer_endings(kind):
        return False
    format_ = writer(output, kind)
    return not (format_.times or format_.pieces) and bool(_NUMBER.search(output.name))


def series_times(scene: Scene, times: Sequence[float]) -> Times:
    """Return the requested times of a series; by default those of the scene's film."""
    if not times:
        return film_times(scene) if scene.is_animated else selected_times([scene.view.time])
    if len(times) > 1 and not scene.moves:
        raise InputError(
            "a scene that does not move cannot have several times",
            key="times",
            cure="Add a section [response], or remove the times.",
        )
    for before, after in pairwise(times):
        if not before < after:
            raise InputError(
                f"times must increase, but {after:g} s follows {before:g} s", key="times"
            )
    return selected_times(times)


def write_series(job: Job, context: Context, content_at: Callable[[float], Any]) -> str:
    """Compute and write data of several times, one by one; return their number and size."""
    times, steps = context.times, len(context.times) + 1
    context.progress(0, steps)

    def series(folder: Path) -> Iterator[tuple[float, Any]]:
        # The data of all times together may not fit into memory.
        used = 0
        for done, time in enumerate(times, 1):
            yield time, content_at(time)
            if done <= 2:
                more, used = folder_size(folder) - used, folder_size(folder)
                if done == 2:  # constant data may be in the first time only
                    left = (len(times) - 2) * more
                    require_disk_space(folder / job.output.name, left, f"{len(times)} times")
            context.progress(done, steps)

    with job.open_output(context.atomic) as file:
        format_ = writer(file, job.kind)
        if job.is_numbered:
            for number, (time, content) in enumerate(series(file.parent)):
                if not number:
                    report_losses(job, context, content)
                with attach_record_at(time):
                    format_.write(file.with_name(file.name % number), content)
        else:
            format_.write(file, series(file.parent))
        size = folder_size(file.parent)
    context.progress(steps, steps)
    return f"{format_count(len(times), 'time')}, {format_size(size)}"


def compute_data(scene: Scene, kind: str, time: float, span: Span | None = None) -> Any:
    """Return data of a kind at a time; `span` gives the ends of their colour scale."""
    moved = scene.last_object  # the surface, which costs most, is left out
    if kind == "yarns":
        from spacemap_vtk.draw.detail.yarn_recorder import YarnRecorder

        scene.update_stage(moved, time)
        seen = YarnRecorder(scene, 1)
        seen.record(0)
        return seen.curves
    if kind == "painted":
        from spacemap_vtk.draw.morph_surface import make_moving_surface

        return make_moving_surface(scene, [time], None, lambda *_: None, span, sides=None)
    if kind in ("draft", "analysis"):  # a draft is valid even if its yarns do not fit
        return scene.data(kind)
    from spacemap_vtk.datasets.arrays import shallow_copy

    # A cage needs none of the stages after it.
    last = moved if kind == "patches" else scene.stages[-1]
    of_cage = kind == "cage" or (kind == "obstacles" and scene.moves)
    scene.update_stage(scene.cage_stage if of_cage else last, time)
    data = shallow_copy(
        scene.data(kind)
    )  # with a time, the pipeline would take its data for up to date
    if scene.moves:
        data.GetInformation().Set(data.DATA_TIME_STEP(), time)  # VTK's formats store it
    return data


def report_losses(job: Job, context: Context, content: Any) -> None:
    """Report what the format cannot store of some data."""
    loses = writer(job.output, job.kind).loses
    for text in loses(content) if loses else ():
        context.report_loss(text)


def folder_size(folder: Path) -> int:
    """Return the size of all files in a folder, in bytes."""
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())


def format_size(size: int) -> str:
    """Return a number of bytes as text in MB."""
    return f"{size / 1e6:.3g} MB"


def format_count(count: int, what: str) -> str:
    """Return a number and its noun, in the plural if needed."""
    return f"{count} {what}{'s' * (count > 1)}"


def common_scale(scene: Scene, times: Sequence[float]) -> Span | None:
    """Return the ends of the colour scale that all files share; None if there is no scale."""
    from spacemap_vtk.scenes.colorings import COLORINGS

    if not COLORINGS[scene.view.color].shows_numbers:
        return None
    from spacemap_vtk.draw.picture import motion_extent

    return motion_extent(scene, times)[1]


def _make_pieces(context: Context, kind: str, count: int) -> Iterator[Any]:
    """Yield the pieces of a surface or of patches; each is made when it is requested."""
    from spacemap_vtk.datasets.processes import WHOLE, Piece
    from spacemap_vtk.filters.algorithm import PIECE

    scene = context.scene
    try:
        for number in range(count):
            context.progress(number, count)
            scene.update(context.times[0], Piece(number, count))
            yield scene.data(kind)
        context.progress(count, count)
    finally:
        for key, value in zip(PIECE, WHOLE, strict=True):  # the next update needs the whole again
            scene.stages[-1].GetOutputInformation(0).Set(key, value)
