"""Base class of all jobs, their registry, and their form in JSON.

A job holds what is requested and where it goes, and nothing of the scene. If its output cannot be
written, it is refused when it is made, so that nobody waits for a scene first. `Job.run` decides
the times once, by `Job.decide_times`, and makes the file; the record in the file states the same
times.
"""

from __future__ import annotations

import json
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeVar

from spacemap_vtk import extensions
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.output import atomic_file, atomic_files
from spacemap_vtk.io.provenance import attach_record
from spacemap_vtk.io.registry import writer

if TYPE_CHECKING:
    from spacemap_vtk.draw.camera import Viewpoint
    from spacemap_vtk.scenes.scene import Scene

#: Keys that all records from versions before the job classes contain, whatever the kind. A class
#: ignores those for which it has no field.
_EARLIER_KEYS = {
    *("what", "times", "size", "panels", "place", "wireframe", "motions", "tolerance"),
    *("subdivisions", "pieces", "framed", "point", "quantity", "curves", "samples", "page"),
}
#: Called with the number of steps done and of all steps. It raises `Cancelled` to cancel the job.
Progress = Callable[[int, int], object]
#: Called with a sentence for each thing that the format of the file cannot store.
ReportLoss = Callable[[str], object]


class Times(NamedTuple):
    """The times that a job shows."""

    #: In s.
    values: Sequence[float] = ()
    #: Times that the record in the file states: one, or the first and the last; empty if none.
    span: tuple[float, ...] = ()


def selected_times(times: Sequence[float]) -> Times:
    """Return the times that a user has chosen, with their ends."""
    ends = times[:1] if len(times) == 1 else [*times[:1], *times[-1:]]
    return Times(times, tuple(ends))


def film_times(scene: Scene) -> Times:
    """Return the times of the frames of a scene's film."""
    animation = scene.animation
    return Times(animation.frame_times(), (animation.start, animation.stop))


@dataclass(frozen=True)
class Context:
    """Scene, times and callbacks of a job that runs."""

    scene: Scene
    #: Times from `Job.decide_times`, in s.
    times: Sequence[float]
    progress: Progress
    report_loss: ReportLoss
    #: Whether the output appears only when it is complete. Otherwise the caller ensures that.
    atomic: bool


class Job(ABC):
    """A piece of work that makes a file, or a series of files, from a scene."""

    # A kind of job is a dataclass that `register` decorates. It has a field `output`, and the
    # fields that this kind needs, with defaults.

    #: Name of the kind, which the record in the file stores as ``what``.
    kind: str
    #: The file; for a series of files, a name with a number such as ``%04d``.
    output: Path
    #: The command and the options that request this kind of job.
    command: ClassVar[str] = "export"
    #: Fields that change how the job is done but not its result; a record does not store them.
    unrecorded: ClassVar[tuple[str, ...]] = ()

    @property
    def is_numbered(self) -> bool:
        """Whether each time is written into a separate file."""
        return False

    @property
    def needs_folder(self) -> bool:
        """Whether other files may appear next to the output."""
        return False

    @property
    def is_series(self) -> bool:
        """Whether data of several times are written."""
        return False

    def decide_times(self, scene: Scene) -> Times:
        """Return the times that are shown; refuse those that the scene does not have."""
        return Times()

    @abstractmethod
    def write(self, context: Context) -> str:
        """Make the file, and return a sentence about it, or an empty text."""

    @contextmanager
    def prepare(self, scene: Scene) -> Iterator[None]:
        """Keep a scene as this job needs it while the output is written."""
        yield

    def run(
        self,
        scene: Scene,
        progress: Progress = lambda done, of: None,
        report_loss: ReportLoss | None = None,
        atomic: bool = True,
    ) -> str:
        """Make the file from a scene, and return a sentence about it, or an empty text."""
        # By default the scene warns of what the format cannot store. Without `atomic` the caller
        # ensures that the output appears complete or not at all.
        from spacemap_vtk.scenes.scene_record import make_record

        times = self.decide_times(scene)
        record = {k: v for k, v in self.as_json().items() if k not in self.unrecorded}
        with self.prepare(scene), attach_record(make_record(scene, record, times.span)):
            return self.write(
                Context(scene, times.values, progress, report_loss or scene.warn, atomic)
            )

    @contextmanager
    def open_output(self, atomic: bool) -> Iterator[Path]:
        """Yield the path to which the output is written."""
        if not atomic:
            yield self.output
        elif self.needs_folder:
            with atomic_files(self.output) as folder:
                yield folder / self.output.name
        else:
            with atomic_file(self.output) as file:
                yield file

    def write_output(self, context: Context, holds: str, content: Any) -> None:
        """Write content with the writer for a key of `registry.DRAWN` or `registry.DATA`."""
        with self.open_output(context.atomic) as file:
            writer(file, holds).write(file, content)

    def as_json(self) -> dict[str, Any]:
        """Return the kind, as ``what``, and all fields but `output` that differ from defaults."""
        record: dict[str, Any] = {"what": self.kind}
        for each in fields(self):  # type: ignore[arg-type]
            if each.name not in ("output", "kind"):
                value = json.loads(json.dumps(getattr(self, each.name)))
                if value not in (each.default, []):
                    record[each.name] = value
        return record

    @classmethod
    def from_json(cls, record: Mapping[str, Any], output: Path) -> Job:
        """Return the job that `as_json` has described, here or in an earlier version."""
        field_names = {each.name for each in fields(cls)}  # type: ignore[arg-type]
        values = {k: v for k, v in record.items() if k in field_names or k not in _EARLIER_KEYS}
        return cls.create(record["what"], output, **values)

    @classmethod
    def create(cls, kind: str, output: Path, **fields: Any) -> Job:
        """Return a job of one of the kinds that this class is registered for."""
        return cls(output, **fields)  # type: ignore[call-arg]


JobClass = TypeVar("JobClass", bound=type[Job])
#: The class of each kind of job.
JOBS: dict[str, type[Job]] = {}


def register(*kinds: str) -> Callable[[JobClass], JobClass]:
    """Register a job class under the names of its kinds; by default under its `kind`."""

    def add(job_class: JobClass) -> JobClass:
        JOBS.update(dict.fromkeys(kinds or (job_class.kind,), job_class))
        return job_class

    return add


def job_class(kind: str) -> type[Job]:
    """Return the class of a kind of job."""
    if kind not in JOBS:
        extensions.load_all("jobs")
    if kind not in JOBS:
        raise InputError("unknown kind of job", key="what", value=kind, allowed=", ".join(JOBS))
    return JOBS[kind]


def make_job(kind: str, output: Path, **fields: Any) -> Job:
    """Return a job of a kind, with the fields of its class."""
    return job_class(kind).create(kind, output, **fields)


def job_from_json(record: Mapping[str, Any], output: Path) -> Job:
    """Return the job that a record or another process describes; do not trust a record."""
    try:
        return job_class(str(record["what"])).from_json(record, output)
    except InputError:
        raise
    except (TypeError, ValueError, LookupError) as error:
        raise InputError(f"invalid description of a job: {error}") from None


def to_floats(numbers: Sequence[Any]) -> list[float]:
    """Convert the numbers of a field to floats."""
    return [float(number) for number in numbers]


def to_texts(texts: Sequence[Any]) -> list[str]:
    """Convert the items of a field to texts."""
    return [str(text) for text in texts]


def to_size(size: Sequence[Any] | None) -> tuple[int, int] | None:
    """Convert a field to width and height in pixels."""
    if not size:
        return None
    width, height = map(int, size)
    return width, height


def to_viewpoint(place: Sequence[Any] | None) -> Viewpoint | None:
    """Convert a field, which may be a list of numbers, to a viewpoint."""
    if not place:
        return None
    from spacemap_vtk.draw.camera import Viewpoint

    return Viewpoint.from_json(place)


def require_placeholder(path: Path) -> None:
    """Refuse a file name that does not contain exactly one placeholder for a number."""
    if not re.fullmatch(r"[^%]*%0?\d*d[^%]*", path.name):
        stem = re.sub("%[0-9]*[a-z]?", "", path.stem).rstrip("-_")
        example = path.with_name(f"{stem}-%04d{path.suffix}")
        raise InputError(
            f"{path}: the name of a series must contain one number such as %04d",
            cure=f"For example {example}",
        )
