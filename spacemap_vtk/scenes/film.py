"""Files of pictures: one, numbered frames, a film."""

from __future__ import annotations

import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from spacemap_vtk.errors import MissingLibraryError, SpacemapError

if TYPE_CHECKING:
    from spacemap_vtk.scenes.picture import Image as Pixels

#: Of zlib. Of a picture of yarns, 6 makes files a twelfth smaller, in more than twice the time.
_COMPRESSION = 3


def write_picture(file: Path, image: Pixels) -> None:
    """Write a picture.

    Parameters
    ----------
    file : Path
        Ending in .png, .jpg or .jpeg.
    image : ndarray of uint8, shape (height, width, 3)
        Red, green and blue.
    """
    Image.fromarray(image).save(file, compress_level=_COMPRESSION)


def require_encoder(file: Path) -> None:
    """Refuse a film that nothing here can write, before any work is done for it.

    Parameters
    ----------
    file : Path
        Ending in .gif, .mp4, or whatever.

    Raises
    ------
    MissingLibraryError
        If .mp4 is asked for without the extra ``[movie]``, or without a program ffmpeg.
    """
    if file.suffix.lower() != ".mp4":
        return
    try:
        import imageio_ffmpeg

        imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        raise MissingLibraryError(
            f"{file.name}: .mp4 needs the package imageio-ffmpeg, with its program ffmpeg",
            cure="Run: pip install 'spacemap_vtk[movie]', or write a .gif.",
        ) from None


def write_film(file: Path, images: Iterable[Pixels], rate: float) -> None:
    """Write a film.

    Parameters
    ----------
    file : Path
        Ending in .gif or .mp4.
    images : iterable of ndarray, shape (height, width, 3)
        The frames, taken one at a time.
    rate : float
        Frames per second.

    Raises
    ------
    MissingLibraryError
        If .mp4 is asked for without the extra ``[movie]``.
    """
    if file.suffix.lower() == ".gif":
        _write_gif(file, images, rate)
    else:
        _write_mp4(file, images, rate)


def write_frames(file: Path, images: Iterable[Pixels]) -> None:
    """Write numbered pictures.

    Parameters
    ----------
    file : Path
        Its name has a number in it, as in ``%04d.png``.
    images : iterable of ndarray, shape (height, width, 3)
        The frames, taken one at a time.
    """
    for number, image in enumerate(images):
        write_picture(file.with_name(file.name % number), image)


def _write_gif(file: Path, images: Iterable[Pixels], rate: float) -> None:
    frames = (Image.fromarray(image) for image in images)
    first = next(frames)
    # One palette for the whole film, of the first frame's colours: palettes of their own make
    # still parts flicker. GIF counts time in hundredths of a second.
    palette = first.quantize(256, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    rest = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    palette.save(
        file,
        save_all=True,
        append_images=rest,
        duration=max(20, round(100 / rate) * 10),
        loop=0,
        disposal=1,
    )


def _write_mp4(file: Path, images: Iterable[Pixels], rate: float) -> None:
    require_encoder(file)
    import imageio_ffmpeg

    writer = None
    for image in images:
        # H.264 takes even sizes only.
        even = np.ascontiguousarray(image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2])
        if writer is None:
            writer = imageio_ffmpeg.write_frames(
                str(file), (even.shape[1], even.shape[0]), fps=rate, quality=8, macro_block_size=2
            )
            writer.send(None)
        try:
            writer.send(even)
        except (OSError, subprocess.SubprocessError) as error:
            raise SpacemapError(f"{file.name}: ffmpeg failed: {error}") from None
    if writer is not None:
        writer.close()
