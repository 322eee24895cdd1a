"""Pictures: one, a film's numbered frames, plots."""

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
from spacemap_vtk.io.output import write
from spacemap_vtk.io.provenance import NAME, tells, told
from spacemap_vtk.io.registry import writes

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.figure import Figure
    from numpy.typing import NDArray
    from PIL.Image import Image as PillowImage

#: Of zlib. Of a picture of yarns, 6 makes files a tenth smaller, in more than twice the time.
_COMPRESSION = 3
#: What is decoded, in Pillow's words. Not PostScript, which is a program, and runs as one.
_DECODED = ("PNG", "JPEG", "BMP", "GIF", "TIFF", "WEBP", "PPM", "TGA", "DDS", "JPEG2000", "PCX")
#: Bytes of a comment in a JPEG, at most.
_SEGMENT = 60_000


@writes(".jpg", ".jpeg", label="picture", holds=("picture",))
@writes(".png", label="picture", holds=("picture",), alpha=True)
def write_picture(file: Path, image: NDArray[np.uint8], **more: Any) -> None:
    """Write a picture."""
    from PIL import Image

    if file.suffix.lower() == ".png" and not more:
        write_png(file, image)
    else:
        made, kind = BytesIO(), file.suffix[1:].lower().replace("jpg", "jpeg")
        Image.fromarray(image).save(made, kind, **{"extra": _comments(), **more})
        write(file, [made.getbuffer()])


def write_png(file: Path, image: NDArray[np.uint8]) -> None:
    """Write a picture, in half the time that Pillow takes, which tries five filters on each row."""
    import numpy as np

    height, width, depth = image.shape  # the third number: four with how much is covered
    rows = np.ascontiguousarray(image).reshape(height, -1)
    lines = np.empty((height, 1 + depth * width), np.uint8)
    # Each row is that of the differences to the pixel before: filter 1 of the format.
    lines[:, 0] = 1
    lines[:, 1 : 1 + depth] = rows[:, :depth]
    np.subtract(rows[:, depth:], rows[:, :-depth], out=lines[:, 1 + depth :])
    head = pack(">IIBBBBB", width, height, 8, 2 if depth == 3 else 6, 0, 0, 0)
    data = zlib.compress(lines.data, _COMPRESSION)
    parts = [*_chunk(b"IHDR", head), *_text_chunk(), *_chunk(b"IDAT", data), *_chunk(b"IEND", b"")]
    write(file, [b"\x89PNG\r\n\x1a\n", *parts])


def _chunk(kind: bytes, data: bytes) -> list[bytes]:
    return [pack(">I", len(data)), kind, data, pack(">I", zlib.crc32(data, zlib.crc32(kind)))]


def _text_chunk() -> list[bytes]:
    """Return the record as PNG has it; nothing where there is none."""
    return _chunk(b"tEXt", f"{NAME}\0{told()}".encode("latin-1")) if told() else []


def _comments() -> bytes:
    """Return the record as JPEG has it: in as many segments as it takes."""
    text = told().encode()
    parts = [text[begin : begin + _SEGMENT] for begin in range(0, len(text), _SEGMENT)]
    heads = [b"\xff\xfe" + (2 + len(NAME) + 1 + len(part)).to_bytes(2, "big") for part in parts]
    return b"".join(h + NAME.encode() + b"\0" + p for h, p in zip(heads, parts, strict=True))


def add_record(png: bytes) -> list[bytes]:
    """Return a PNG that has been made without its record."""
    return [png[:33], *_text_chunk(), png[33:]]


def decoded(content: bytes, check: Callable[[int, int], None]) -> PillowImage:
    """Return a picture's pixels, once its width and height have been checked."""
    from PIL import Image

    from spacemap_vtk.datasets.quiet import quiet_stderr

    # From memory, which gives no more than it has: Pillow believes a length that a file says.
    try:
        with (
            warnings.catch_warnings(),
            quiet_stderr(),
            Image.open(BytesIO(content), formats=_DECODED) as picture,
        ):
            warnings.simplefilter("ignore")  # of what a camera has added
            check(*picture.size)
            picture.load()
            return picture
    except InputError:
        raise
    except Exception:  # what its decoders raise of damaged files, they do not list
        raise InputError(
            "no picture, or a damaged one",
            allowed="a .png, .jpg, .bmp, .tif or other picture",
            cure="Save it again, as PNG.",
        ) from None


@tells(".png", ".jpg", ".jpeg")
def told_in_picture(path: Path) -> str | None:
    """Find the record among a picture's texts."""
    from PIL import Image

    with Image.open(
        BytesIO(path.read_bytes()), formats=("PNG", "JPEG")
    ) as image:  # of its pixels nothing is read
        if path.suffix.lower() == ".png":
            return getattr(image, "text", {}).get(NAME)
        begin = f"{NAME}\0".encode()
        parts = [data for kind, data in getattr(image, "applist", ()) if kind == "COM"]
    text = b"".join(part[len(begin) :] for part in parts if part.startswith(begin))
    return text.decode("latin-1") or None


@writes(".png", label="numbered frames, as in frames/%04d.png", holds=("frames",), alpha=True)
def write_frames(file: Path, images: Iterable[NDArray[np.uint8]], rate: float = 0.0) -> None:
    """Write numbered pictures; they know of no rate."""
    for number, image in enumerate(images):
        write_picture(file.with_name(file.name % number), image)


@writes(".svg", label="drawing", holds=("plot",))
@writes(".pdf", label="document", holds=("plot",))
@writes(".png", ".jpg", ".jpeg", label="picture", holds=("plot",))
def write_figure(file: Path, figure: Figure, **more: Any) -> None:
    """Write a figure of matplotlib."""
    from matplotlib import rc_context

    # matplotlib leaves a file open that it cannot write
    ending, made, record = file.suffix[1:].lower(), BytesIO(), told()
    if ending in ("jpg", "jpeg"):
        more["pil_kwargs"] = {"extra": _comments()}
    elif ending == "png":
        more["metadata"] = {NAME: record} if record else {}
    else:  # the same figure is the same file: no date, and names of its parts not by chance
        key, date = ("Description", "Date") if ending == "svg" else ("Keywords", "CreationDate")
        more["metadata"] = {date: None, **({key: f"{NAME}: {record}"} if record else {})}
    # Letters stay letters, to be found, read aloud and edited.
    with rc_context({"svg.hashsalt": NAME, "svg.fonttype": "none", "pdf.fonttype": 42}):
        figure.savefig(made, format=ending, **more)
    write(file, [made.getbuffer()])


@tells(".svg", ".pdf")
def told_in_figure(path: Path) -> str | None:
    """Find the record among a drawing's, or a document's, own words."""
    content, name = path.read_bytes(), NAME.encode()
    if path.suffix.lower() == ".svg":
        found = re.search(rb"<dc:description>%s: (.*?)</dc:description>" % name, content)
        return unescape(found[1].decode("ascii", "replace")) if found else None
    found = re.search(rb"/Keywords \(%s: ((?:[^\\()]|\\.)*)\)" % name, content)
    return re.sub(rb"\\(.)", rb"\1", found[1]).decode("ascii", "replace") if found else None
