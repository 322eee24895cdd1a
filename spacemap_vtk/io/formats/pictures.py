"""Pictures: one, a film's numbered frames, plots."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk.io.registry import writes

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

#: Of zlib. Of a picture of yarns, 6 makes files a twelfth smaller, in more than twice the time.
_COMPRESSION = 3


@writes(".png", ".jpg", ".jpeg", label="picture", holds=("picture",))
def write_picture(file: Path, image: NDArray[np.uint8], **more: Any) -> None:
    """Write a picture."""
    from PIL import Image

    Image.fromarray(image).save(file, **{"compress_level": _COMPRESSION} | more)


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

    from spacemap_vtk.io.output import write

    made = BytesIO()  # matplotlib leaves a file open that it cannot write
    figure.savefig(made, format=file.suffix[1:].lower(), **more)
    write(file, [made.getbuffer()])
