"""Read and write pictures, numbered frames and plots."""

from __future__ import annotations

import re
import warnings
import zlib
from collections.abc import Callable, Iterable
from html import unescape
from io import BytesIO
from pathlib import Path
from struct import pack
from typing import TYPE_CHECKING, Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.output import write_parts
from spacemap_vtk.io.provenance import NAME, finds_record, record_text
from spacemap_vtk.io.registry import writes

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.figure import Figure
    from numpy.typing import NDArray
    from PIL.Image import Image as PillowImage

#: Level of zlib. For a picture of yarns, level 6 makes a file a tenth smaller in more than twice
#: the time.
_COMPRESSION = 3
#: Formats that are decoded, by Pillow's names. PostScript is excluded, because it is a program that
#: would be run.
_DECODED = ("PNG", "JPEG", "BMP", "GIF", "TIFF", "WEBP", "PPM", "TGA", "DDS", "JPEG2000", "PCX")
#: Most bytes of one comment in a JPEG.
_COMMENT_BYTES = 60_000


@writes(".jpg", ".jpeg", label="picture", holds=("picture",))
@writes(".png", label="picture", holds=("picture",), alpha=True)
def write_picture(file: Path, image: NDArray[np.uint8], **more: Any) -> None:
    """Write a picture."""
    from PIL import Image

    if file.suffix.lower() == ".png" and not more:
        write_png(file, image)
    else:
        made, kind = BytesIO(), file.suffix[1:].lower().replace("jpg", "jpeg")
        Image.fromarray(image).save(made, kind, **{"extra": _jpeg_comments(), **more})
        write_parts(file, [made.getbuffer()])


def write_png(file: Path, image: NDArray[np.uint8]) -> None:
    """Write a PNG in half the time of Pillow, which tries five filters on each row."""
    import numpy as np

    height, width, depth = image.shape  # depth is 3, or 4 with coverage
    rows = np.ascontiguousarray(image).reshape(height, -1)
    lines = np.empty((height, 1 + depth * width), np.uint8)
    # Each row holds the differences to the pixel before: filter 1 of the PNG format.
    lines[:, 0] = 1
    lines[:, 1 : 1 + depth] = rows[:, :depth]
    np.subtract(rows[:, depth:], rows[:, :-depth], out=lines[:, 1 + depth :])
    head = pack(">IIBBBBB", width, height, 8, 2 if depth == 3 else 6, 0, 0, 0)
    data = zlib.compress(lines.data, _COMPRESSION)
    parts = [
        *_chunk(b"IHDR", head),
        *_record_chunk(),
        *_chunk(b"IDAT", data),
        *_chunk(b"IEND", b""),
    ]
    write_parts(file, [b"\x89PNG\r\n\x1a\n", *parts])


def _chunk(kind: bytes, data: bytes) -> list[bytes]:
    return [pack(">I", len(data)), kind, data, pack(">I", zlib.crc32(data, zlib.crc32(kind)))]


def _record_chunk() -> list[bytes]:
    """Return the record as a chunk of a PNG, or nothing without a record."""
    return _chunk(b"tEXt", f"{NAME}\0{record_text()}".encode("latin-1")) if record_text() else []


def _jpeg_comments() -> bytes:
    """Return the record as comments of a JPEG, in as many segments as it needs."""
    text = record_text().encode()
    parts = [text[begin : begin + _COMMENT_BYTES] for begin in range(0, len(text), _COMMENT_BYTES)]
    heads = [b"\xff\xfe" + (2 + len(NAME) + 1 + len(part)).to_bytes(2, "big") for part in parts]
    return b"".join(h + NAME.encode() + b"\0" + p for h, p in zip(heads, parts, strict=True))


def add_record(png: bytes) -> list[bytes]:
    """Add the record to a PNG that was made without it."""
    return [png[:33], *_record_chunk(), png[33:]]


def decode_picture(content: bytes, check: Callable[[int, int], None]) -> PillowImage:
    """Decode a picture after `check` has accepted its width and height."""
    from PIL import Image

    from spacemap_vtk.datasets.vtk_messages import silence_stderr

    # Pillow trusts the lengths in a file. Read from memory, a file gives no more than it has.
    try:
        with (
            warnings.catch_warnings(),
            silence_stderr(),
            Image.open(BytesIO(content), formats=_DECODED) as picture,
        ):
            warnings.simplefilter("ignore")  # Pillow warns about what cameras have added
            check(*picture.size)
            picture.load()
            return picture
    except InputError:
        raise
    except Exception:  # Pillow does not list what its decoders raise for damaged files
        raise InputError(
            "not a picture, or damaged",
            allowed="a .png, .jpg, .bmp, .tif or other picture",
            cure="Save it again as PNG.",
        ) from None


@finds_record(".png", ".jpg", ".jpeg")
def find_record_in_picture(path: Path) -> str | None:
    """Find the record among a picture's texts or comments."""
    from PIL import Image

    with Image.open(
        BytesIO(path.read_bytes()), formats=("PNG", "JPEG")
    ) as image:  # its pixels are not read
        if path.suffix.lower() == ".png":
            return getattr(image, "text", {}).get(NAME)
        begin = f"{NAME}\0".encode()
        parts = [data for kind, data in getattr(image, "applist", ()) if kind == "COM"]
    text = b"".join(part[len(begin) :] for part in parts if part.startswith(begin))
    return text.decode("latin-1") or None


@writes(".png", label="numbered frames, as in frames/%04d.png", holds=("frames",), alpha=True)
def write_frames(file: Path, images: Iterable[NDArray[np.uint8]], rate: float = 0.0) -> None:
    """Write numbered pictures, which store no rate."""
    for number, image in enumerate(images):
        write_picture(file.with_name(file.name % number), image)


@writes(".svg", label="drawing", holds=("plot",))
@writes(".pdf", label="document", holds=("plot",))
@writes(".png", ".jpg", ".jpeg", label="picture", holds=("plot",))
def write_figure(file: Path, figure: Figure, **more: Any) -> None:
    """Write a figure of matplotlib's."""
    from matplotlib import rc_context

    # The figure is made in memory, because matplotlib leaves a file open that it cannot write.
    ending, made, record = file.suffix[1:].lower(), BytesIO(), record_text()
    if ending in ("jpg", "jpeg"):
        more["pil_kwargs"] = {"extra": _jpeg_comments()}
    elif ending == "png":
        more["metadata"] = {NAME: record} if record else {}
    else:  # the same figure must give the same bytes: no date, and no random names of its parts
        key, date = ("Description", "Date") if ending == "svg" else ("Keywords", "CreationDate")
        more["metadata"] = {date: None, **({key: f"{NAME}: {record}"} if record else {})}
    # Text stays text, so that it can be found, read aloud and edited.
    with rc_context({"svg.hashsalt": NAME, "svg.fonttype": "none", "pdf.fonttype": 42}):
        figure.savefig(made, format=ending, **more)
    write_parts(file, [made.getbuffer()])


@writes(".pdf", label="document", holds=("pages",))
def write_pages(file: Path, figures: Iterable[Figure]) -> None:
    """Write figures of matplotlib's as the pages of a document."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_pdf import PdfPages

    made, record = BytesIO(), record_text()
    metadata = {"CreationDate": None, **({"Keywords": f"{NAME}: {record}"} if record else {})}
    with rc_context({"pdf.fonttype": 42}), PdfPages(made, metadata=metadata) as document:
        for figure in figures:
            document.savefig(figure, facecolor="auto")
    write_parts(file, [made.getbuffer()])


@finds_record(".svg", ".pdf")
def find_record_in_figure(path: Path) -> str | None:
    """Find the record in a drawing's description or a document's keywords."""
    content, name = path.read_bytes(), NAME.encode()
    if path.suffix.lower() == ".svg":
        found = re.search(rb"<dc:description>%s: (.*?)</dc:description>" % name, content)
        return unescape(found[1].decode("ascii", "replace")) if found else None
    found = re.search(rb"/Keywords \(%s: ((?:[^\\()]|\\.)*)\)" % name, content)
    return re.sub(rb"\\(.)", rb"\1", found[1]).decode("ascii", "replace") if found else None
