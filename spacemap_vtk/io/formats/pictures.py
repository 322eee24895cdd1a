"""Pictures: one, a film's numbered frames, plots."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk.io.output import write
from spacemap_vtk.io.registry import writes

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

#: Of zlib. Of a picture of yarns, 6 makes files a tenth smaller, in more than twice the time.
_COMPRESSION = 3


@writes(".png", ".jpg", ".jpeg", label="picture", holds=("picture",))
def write_picture(file: Path, image: NDArray[np.uint8], **more: Any) -> None:
    """Write a picture."""
    from PIL import Image

    if file.suffix.lower() == ".png" and not more:
        write_png(file, image)
    else:
        Image.fromarray(image).save(file, **more)


def write_png(file: Path, image: NDArray[np.uint8]) -> None:
    """Write a picture, in half the time that Pillow takes, which tries five filters on each row."""
    import zlib
    from struct import pack

    import numpy as np

    height, width, _ = image.shape
    rows = np.ascontiguousarray(image).reshape(height, -1)
    lines = np.empty((height, 1 + 3 * width), np.uint8)
    # Each row is that of the differences to the pixel before: filter 1 of the format.
    lines[:, 0] = 1
    lines[:, 1:4] = rows[:, :3]
    np.subtract(rows[:, 3:], rows[:, :-3], out=lines[:, 4:])
    parts = [b"\x89PNG\r\n\x1a\n"]
    for kind, data in (
        (b"IHDR", pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)),
        (b"IDAT", zlib.compress(lines.data, _COMPRESSION)),
        (b"IEND", b""),
    ):
        parts += [pack(">I", len(data)), kind, data, pack(">I", zlib.crc32(kind + data))]
    write(file, parts)


@writes(".png", label="numbered frames, as in frames/%04d.png", holds=("frames",))
def write_frames(file: Path, images: Iterable[NDArray[np.uint8]], rate: float = 0.0) -> None:
    """Write numbered pictures; they know of no rate."""
    for number, image in enumerate(images):
        write_picture(file.with_name(file.name % number), image)


@writes(".svg", label="drawing", holds=("plot",))
@writes(".pdf", label="document", holds=("plot",))
@writes(".png", ".jpg", ".jpeg", label="picture", holds=("plot",))
def write_figure(file: Path, figure: Figure, **more: Any) -> None:
    """Write a figure of matplotlib."""
    from io import BytesIO

    made = BytesIO()  # matplotlib leaves a file open that it cannot write
    figure.savefig(made, format=file.suffix[1:].lower(), **more)
    write(file, [made.getbuffer()])
