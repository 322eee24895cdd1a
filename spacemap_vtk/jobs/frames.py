"""Draw a film's frames in one process or several, encode them meanwhile, keep them until the end.

Each frame is kept as a picture in a folder next to the film. If a film is stopped or fails, its
frames stay there, and the same film continues from them. The folder is deleted when the film is
complete.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, closing, contextmanager, suppress
from contextvars import copy_context
from dataclasses import dataclass
from functools import partial
from math import prod
from pathlib import Path
from queue import Empty, Full, Queue
from threading import Thread
from typing import Any

import numpy as np
import PIL.Image

from spacemap_vtk import __version__, cache
from spacemap_vtk.cancel import Cancelled
from spacemap_vtk.draw.camera import Viewpoint
from spacemap_vtk.draw.detail.cloth_sheet import ClothSheet
from spacemap_vtk.draw.graphics import WITHOUT_OPENGL, uses_software_renderer
from spacemap_vtk.draw.picture import Extent, Image, Picture, choose_picture_facets, motion_extent
from spacemap_vtk.errors import InputError, SpacemapWarning
from spacemap_vtk.io.formats.pictures import add_record, write_png
from spacemap_vtk.io.output import write_parts
from spacemap_vtk.io.provenance import attach_record_at
from spacemap_vtk.io.registry import Writer, reader_endings
from spacemap_vtk.ndarrays import StepProgress
from spacemap_vtk.scenes.level_of_detail import choose_level
from spacemap_vtk.scenes.memory_estimates import PictureRequest
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.sweep import paths_in
from spacemap_vtk.temporary_files import hidden_path, temporary_path, try_lock
from spacemap_vtk.workers import WorkerEndedError, process_count, run_in_processes

#: Suffix of a film's name for the folder of its frames.
_FOLDER = ".frames"
#: Name of the file in this folder that identifies its frames.
_MARK = "of.txt"
#: Largest number of frames that wait for the encoder.
_QUEUE_LENGTH = 4
#: Seconds between two checks that the encoder still runs.
_CHECK_INTERVAL = 0.2
#: Number of pixels that make it worthwhile to start a process.
_PIXELS_PER_PROCESS = 20_000_000


class BusyError(InputError):
    """Another process makes the same file."""


@dataclass(frozen=True)
class FilmSettings:
    """Settings that all frames of a film share; a process needs no others to draw one."""

    file: Path | None
    settings: dict[str, dict[str, Any]]
    #: Names of the sections that the scene has.
    sections: tuple[str, ...]
    times: tuple[float, ...]
    size: tuple[int, int]
    panels: tuple[str, ...]
    viewpoint: Viewpoint | None
    wireframe: bool = False

    @classmethod
    def from_scene(
        cls,
        scene: Scene,
        times: Iterable[float],
        size: tuple[int, int],
        panels: Iterable[str] = (),
        viewpoint: Viewpoint | None = None,
        wireframe: bool = False,
    ) -> FilmSettings:
        """Return the settings of a film of a scene in its present state."""
        view = size, tuple(panels), viewpoint, wireframe
        return cls(scene.file, scene.settings, scene.given_sections, tuple(times), *view)

    @property
    def request(self) -> PictureRequest:
        """Number, size and content of the film's pictures."""
        return PictureRequest(self.size, len(self.times), self.panels, self.wireframe)

    def make_scene(self) -> Scene:
        """Return the scene before its pipeline has run."""
        scene = Scene({}, self.file)
        scene.apply_settings(self.settings, self.sections)
        return scene

    def make_picture(self, scene: Scene, extent: Extent | None = None) -> Picture:
        """Return an object that draws the frames of a scene."""
        view = self.size, self.panels, self.viewpoint, extent
        clear = scene.view.transparent
        return Picture(
            scene, self.times, *view, transparent=clear, wireframe=self.wireframe, orbits=True
        )

    @property
    def digest(self) -> str:
        """Digest of the film's settings, of its input files, and of the program's version."""
        paths = set(paths_in(self.settings))
        motion = self.settings["motion"]["file"]
        if "motion" in self.sections and motion is not None:
            meshes = {*reader_endings("mesh"), *reader_endings("motion")}
            paths |= {path for path in motion.parent.glob("*.*") if path.suffix in meshes}
        files = [(str(path), path.stat()) for path in sorted(paths) if path.is_file()]
        versions = [(name, status.st_size, status.st_mtime_ns) for name, status in files]
        return hashlib.sha256(repr((__version__, self, versions)).encode()).hexdigest()


@dataclass(frozen=True)
class FrameFolder:
    """Frames of a film that exist already, in a folder next to it."""

    output: Path
    #: Digest of the film's settings.
    digest: str = ""
    #: Whether frames that exist already are drawn again.
    redraw: bool = False

    @property
    def folder(self) -> Path:
        """Folder of the frames."""
        return self.output.with_name(self.output.name + _FOLDER)

    @property
    def count(self) -> int:
        """Number of frames that exist."""
        return len(list(self.folder.glob("*.png")))

    def path(self, number: int) -> Path:
        """Return the path of a frame."""
        return self.folder / f"{number:06d}.png"

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Lock the folder against other processes; the system frees the locks of ended ones."""
        mark = self.folder / _MARK
        while True:
            if self.folder.is_symlink() or mark.is_symlink():
                raise InputError(
                    f"{self.output}: the folder of its frames, {self.folder}, is a symbolic link",
                    cure="Remove the link, or choose another name.",
                )
            if self.folder.exists() and not mark.is_file() and any(self.folder.iterdir()):
                raise InputError(
                    f"{self.output}: the folder of its frames, {self.folder}, has other files",
                    cure="Move the folder away, or choose another name.",
                )
            self.folder.mkdir(exist_ok=True)
            with ExitStack() as locks:
                try:
                    locked = try_lock(self.folder, locks)
                except BlockingIOError:
                    raise BusyError(
                        f"{self.output} is being made by another process, whose frames are in "
                        f"{self.folder}",
                        cure="Wait until that process ends, or choose another name.",
                    ) from None
                except OSError:
                    locked = True  # the disk has no locks
                # A process that has just ended may have deleted the folder; then try again.
                if locked:
                    mark.touch()
                    yield
                    return

    def prepare(self, count: int) -> list[int]:
        """Return the numbers of frames that exist; delete those of another film."""
        mark = self.folder / _MARK
        if self.redraw or mark.read_text() != self.digest:
            for path in self.folder.iterdir():
                if path.is_dir() and not path.is_symlink():
                    shutil.rmtree(path)
                elif path != mark:
                    path.unlink()
            try:
                write_parts(mark, [self.digest.encode()])
            except OSError:
                self.remove()
                raise
        return [number for number in range(count) if self._is_complete(number)]

    def write(self, number: int, image: Image) -> Image:
        """Keep a frame, and return it."""
        part = self.path(number).with_suffix(f".{os.getpid()}")
        part.unlink(missing_ok=True)  # it may be a link to another place
        write_png(part, image)
        os.replace(part, self.path(number))
        return image

    def read(self, number: int) -> Image:
        """Read a frame."""
        with PIL.Image.open(self.path(number)) as image:
            return np.asarray(image)

    def remove(self) -> None:
        """Delete the folder and its frames."""
        if (self.folder / _MARK).is_file():
            # The folder is moved away first. Otherwise a process that is killed meanwhile would
            # leave frames that no film recognises.
            with suppress(OSError), temporary_path(hidden_path(self.folder.parent)) as doomed:
                os.replace(self.folder, doomed)

    def _is_complete(self, number: int) -> bool:
        try:
            with PIL.Image.open(self.path(number)) as image:
                image.verify()  # reads its checksums: the machine may have lost its power
        except (OSError, SyntaxError):
            return False
        return True


def write_film(
    file: Path,
    format_: Writer | None,
    scene: Scene,
    settings: FilmSettings,
    frame_folder: FrameFolder,
    report_progress: StepProgress,
    workers: int | None = None,
) -> str:
    """Write a film, or numbered frames without a format; return how many existed before."""
    existing = set(frame_folder.prepare(len(settings.times)))
    try:
        _write_film(
            file, format_, scene, settings, frame_folder, existing, report_progress, workers
        )
    except BaseException as error:
        # After a full disk or a cancellation frames are deleted, unless some existed before.
        abandoned = isinstance(error, (OSError, Cancelled)) and not existing
        if abandoned or not frame_folder.count:
            frame_folder.remove()
        raise
    return f"{len(existing)} of {len(settings.times)} frames existed already" if existing else ""


def _write_film(
    file: Path,
    format_: Writer | None,
    scene: Scene,
    settings: FilmSettings,
    frame_folder: FrameFolder,
    existing: set[int],
    report_progress: StepProgress,
    workers: int | None,
) -> None:
    steps = range(len(settings.times))
    missing = [number for number in steps if number not in existing]
    count = _worker_count(scene, settings, len(missing), workers)
    done = len(existing)
    report_progress(done, len(steps))
    frames: Queue[Future[Image] | None] = Queue(_QUEUE_LENGTH)
    encode = partial(_encode, file, format_, scene.animation.frames_per_second, frames)
    # One thread converts frames to files or back, one makes the film, and this one draws.
    with (
        ThreadPoolExecutor(1) as pool,
        _shared_cache(frame_folder.folder, count),
        _run_in_thread(encode) as encoding,
    ):
        drawn = (_draw_here if count == 1 else partial(_draw_in_processes, count))(
            scene, settings, frame_folder, missing
        )
        try:
            with closing(drawn):
                for number in steps:
                    if number in existing:
                        _put_frame(pool.submit(frame_folder.read, number), frames, encoding)
                    else:
                        _put_frame(pool.submit(next(drawn)), frames, encoding)
                        done += 1
                        report_progress(done, len(steps))
            _put_frame(None, frames, encoding)
        except BaseException:
            with suppress(Empty):
                while True:
                    frames.get_nowait()
            frames.put(pool.submit(_raise_cancelled))
            raise
        encoding.result()
    if format_ is None:
        for number in steps:
            with attach_record_at(settings.times[number], what="picture", framed=True):
                png = frame_folder.path(number).read_bytes()
                write_parts(file.with_name(file.name % number), add_record(png))
            frame_folder.path(number).unlink()


def _encode(
    file: Path, format_: Writer | None, rate: float, frames: Queue[Future[Image] | None]
) -> None:
    images = (frame.result() for frame in iter(frames.get, None))
    if format_ is None:
        for _ in images:
            pass
    else:
        format_.write(file, images, rate)


@contextmanager
def _run_in_thread(work: Callable[[], None]) -> Iterator[Future[None]]:
    """Run work in a thread that ends before the block is left, and cannot hold up the program."""
    # A signal that arrives in Python code called by VTK ends the program at once. At the end Python
    # waits for the threads of a pool, and these would wait for frames for ever.
    done: Future[None] = Future()

    def run() -> None:
        try:
            work()
            done.set_result(None)
        except BaseException as error:
            done.set_exception(error)

    thread = Thread(target=copy_context().run, args=(run,), daemon=True)
    thread.start()
    try:
        yield done
    finally:
        thread.join()


def _put_frame(
    frame: Future[Image] | None, frames: Queue[Future[Image] | None], encoding: Future[None]
) -> None:
    """Wait until the queue has room; if the encoder has ended, raise its error."""
    while not encoding.done():
        with suppress(Full):
            frames.put(frame, timeout=_CHECK_INTERVAL)
            return
    encoding.result()


def _raise_cancelled() -> Image:
    raise Cancelled("the film was stopped")  # writers then clean up their files


def _draw_here(
    scene: Scene, settings: FilmSettings, frame_folder: FrameFolder, missing: list[int]
) -> Generator[Callable[[], Image]]:
    """Draw frames, and yield a function for each that keeps it."""
    picture = settings.make_picture(scene)
    try:
        for number in missing:
            yield partial(frame_folder.write, number, picture.draw(settings.times[number]))
    finally:
        picture.close()


def _draw_in_processes(
    count: int, scene: Scene, settings: FilmSettings, frame_folder: FrameFolder, missing: list[int]
) -> Generator[Callable[[], Image]]:
    """Let processes draw frames, and yield a function for each that reads it."""
    if uses_software_renderer():
        scene.warn(WITHOUT_OPENGL)
    # The processes find in the cache what is solved here.
    choose = partial(
        choose_picture_facets, scene, settings.size, settings.panels, settings.viewpoint, False
    )
    sheet = ClothSheet(scene) if choose_level(scene, settings.request).has_sheet else None
    extent = motion_extent(scene, settings.times, sheet, choose)
    tasks = [(settings, frame_folder, extent, number) for number in missing]
    drawn: set[int] = set()
    with closing(run_in_processes(f"{__name__}:{draw_frame.__name__}", tasks, count)) as answers:
        for number in missing:
            while number not in drawn:
                task, answer = next(answers)
                if isinstance(answer, WorkerEndedError):
                    answer.cure = "Run the same command again to continue, with fewer --workers."
                if isinstance(answer, Exception):
                    raise answer
                drawn.add(missing[task])
                for text in answer:
                    scene.warn(text)
            yield partial(frame_folder.read, number)


#: Object with which this process draws, by the frames that it draws.
_pictures: dict[FrameFolder, Picture] = {}


def draw_frame(task: tuple[FilmSettings, FrameFolder, Extent, int]) -> list[str]:
    """Draw one frame of a film, and return the warnings of its stages."""
    settings, frame_folder, extent, number = task
    if frame_folder not in _pictures:
        warnings.simplefilter("ignore", SpacemapWarning)  # they are returned
        _pictures.clear()
        _pictures[frame_folder] = settings.make_picture(settings.make_scene(), extent)
    frame_folder.write(number, _pictures[frame_folder].draw(settings.times[number]))
    return _pictures[frame_folder].scene.warnings


def _worker_count(scene: Scene, settings: FilmSettings, frames: int, requested: int | None) -> int:
    """Return the number of processes that draw frames."""
    if requested == 1 or not frames:
        return 1
    level = choose_level(scene, settings.request)
    if level.has_sheet:
        return requested or 1  # a sheet is drawn in pieces, which keeps all cores busy
    pixels = frames * prod(settings.size)
    return process_count(frames, pixels // _PIXELS_PER_PROCESS, level.bytes, requested)


@contextmanager
def _shared_cache(folder: Path, count: int) -> Iterator[None]:
    """Let processes share solved results even if there is no lasting cache."""
    if count == 1 or cache.folder() is not None:
        yield
        return
    former = os.environ.get(cache.VARIABLE, "")
    os.environ[cache.VARIABLE] = str(folder / "cache")
    try:
        yield
    finally:
        os.environ[cache.VARIABLE] = former
