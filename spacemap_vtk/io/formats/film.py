"""Write films (.gif, .mp4)."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Iterable
from contextlib import suppress
from fractions import Fraction
from itertools import chain
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

from spacemap_vtk.errors import MissingLibraryError, SpacemapError
from spacemap_vtk.io.provenance import NAME, finds_record, record_text
from spacemap_vtk.io.registry import writes

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def require_encoder(file: Path) -> None:
    """Refuse a film whose encoder is not installed, before any work is done for it."""
    try:
        import imageio_ffmpeg

        imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        raise MissingLibraryError(
            f"{file.name}: .mp4 needs the package imageio-ffmpeg and its program ffmpeg",
            cure="Run: pip install 'spacemap_vtk[movie]', or write a .gif.",
        ) from None


@writes(".gif", label="film", holds=("film",))
@writes(".mp4", label="film", holds=("film",), require=require_encoder)
def write_film(file: Path, images: Iterable[NDArray[np.uint8]], rate: float, crf: int = 10) -> None:
    """Write a film.

    Parameters
    ----------
    file : Path
        Name that ends in .gif or .mp4.
    images : iterable of ndarray, shape (height, width, 3)
        The frames, requested one at a time.
    rate : float
        Frames per second.
    crf : int
        Constant rate factor of an .mp4: 10 cannot be told from the frames, 23 makes small files.

    Raises
    ------
    MissingLibraryError
        If the file is an .mp4 and the extra ``[movie]`` is not installed.
    OSError
        If the disk cannot store the file.
    SpacemapError
        If ffmpeg fails for another reason.
    """
    if file.suffix.lower() == ".gif":
        _write_gif(file, images, rate)
    else:
        _write_mp4(file, images, rate, crf)


def _write_gif(file: Path, images: Iterable[NDArray[np.uint8]], rate: float) -> None:
    from PIL import Image

    frames = (Image.fromarray(image) for image in images)
    first = next(frames)
    # The whole film uses one palette, made of the first frame's colours; a palette for each frame
    # would make still parts flicker. GIF counts time in hundredths of a second.
    palette = first.quantize(256, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    about: dict[str, Any] = (
        {"comment": f"{NAME}: {record_text()}".encode()} if record_text() else {}
    )
    rest = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    palette.save(
        file,
        "GIF",
        save_all=True,
        append_images=rest,
        duration=max(20, round(100 / rate) * 10),
        loop=0,
        disposal=1,
        **about,
    )
    with file.open("rb") as stream:
        stream.seek(-1, 2)
        _require_end(file, stream.read() == b";")


def _write_mp4(file: Path, images: Iterable[NDArray[np.uint8]], rate: float, crf: int) -> None:
    require_encoder(file)
    import numpy as np
    from imageio_ffmpeg import get_ffmpeg_exe

    # H.264 accepts only even sizes.
    even = (image[: len(image) // 2 * 2, : image.shape[1] // 2 * 2] for image in images)
    first = next(even)
    height, width, _ = first.shape
    fps = Fraction(rate).limit_denominator()
    raw = f"-f rawvideo -pix_fmt rgb24 -s {width}x{height} -r {fps} -i -"
    kind = f"-an -c:v libx264 -crf {crf} -pix_fmt yuv420p -y"
    words = ["-metadata", f"comment={NAME}: {record_text()}"] if record_text() else []
    with TemporaryFile() as messages:
        process = subprocess.Popen(
            [get_ffmpeg_exe(), "-v", "error", *raw.split(), *kind.split(), *words, str(file)],
            stdin=subprocess.PIPE,
            stderr=messages,
            start_new_session=True,  # otherwise Ctrl-C makes ffmpeg end a short film without error
        )
        assert process.stdin is not None
        try:
            for image in chain([first], even):
                try:
                    process.stdin.write(np.ascontiguousarray(image).data)
                except BrokenPipeError:
                    break  # ffmpeg has ended; its exit status gives the reason
            process.communicate()
        finally:
            process.kill()
            process.wait()
            with suppress(BrokenPipeError):  # there may be data that ffmpeg has not read
                process.stdin.close()
        if process.returncode:
            _raise_disk_error(file)
            messages.seek(0)
            why = " ".join(messages.read().decode(errors="replace").split())
            raise SpacemapError(f"{file.name}: ffmpeg failed: {why[-200:]}")
    with file.open("rb") as stream:  # boxes that begin with their lengths; the last one is "moov"
        end, begin, box = file.stat().st_size, 0, b""
        while begin < end:
            stream.seek(begin)
            box = stream.read(16)
            begin += int.from_bytes(box[8:] if box[:4] == b"\0\0\0\1" else box[:4], "big") or end
        _require_end(file, box[4:8] == b"moov" and begin == end)


def _require_end(file: Path, complete: bool) -> None:
    if not complete:
        raise SpacemapError(
            f"{file.name}: the film is incomplete: the disk has not stored all of it"
        )


def _raise_disk_error(file: Path) -> None:
    """Append to a file that another program could not finish, so that the disk raises its error."""
    with file.open("ab") as torn:
        torn.write(bytes(2**20))
        torn.flush()
        os.fsync(torn.fileno())


@finds_record(".gif", ".mp4")
def find_record_in_film(path: Path) -> str | None:
    """Find the record in a film's comment."""
    if path.suffix.lower() == ".gif":
        from PIL import Image

        with Image.open(path) as image:
            comment = image.info.get("comment", b"").decode("latin-1")
    else:
        require_encoder(path)
        from imageio_ffmpeg import get_ffmpeg_exe

        words = ["-v", "quiet", "-i", str(path), "-f", "ffmetadata", "-"]
        found = subprocess.run(
            [get_ffmpeg_exe(), *words], stdin=subprocess.DEVNULL, capture_output=True
        )
        text = re.search(
            r"^comment=((?:\\.|[^\\\n])*)$", found.stdout.decode(errors="replace"), re.M
        )
        comment = re.sub(r"\\(.)", r"\1", text[1]) if text else ""
    return comment.partition(f"{NAME}: ")[2] or None
