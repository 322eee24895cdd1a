"""A web page (.html) that shows a surface with its motion: one file, opened by a double click.

Places, shapes and normals are integers: multiples of a length that the tolerance allows, so that
most of their bytes are zeros or alike, and packed they take a fifth of what a .glb does. What draws
them is in `spacemap_vtk/io/page`.
"""

from __future__ import annotations

import base64
import html
import json
import re
import zlib
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk.io.output import write
from spacemap_vtk.io.provenance import NAME, tells, told
from spacemap_vtk.io.registry import SMALLER, writes

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from spacemap_vtk.datasets.moving_surface import MovingSurface

_PAGE = Path(__file__).parent.parent / "page"
_SCRIPTS = ("data.js", "drawing.js", "viewer.js")
#: Shares of the tolerance that rounding takes, and may take where shapes have left it less.
_USUAL, _LEAST = 0.2, 0.02
#: Steps of a normal's length, and of a scale.
_NORMAL, _SCALE = 1024, 1024
#: Bytes that a page's arrays take, of each point, and each of a target.
_POINT, _OF_TARGET = 150, 18
#: Bytes of packed data in one element of the page, and numbers that are rounded at once.
_PART, _AT_ONCE = 3 * 2**21, 2**18


# In single precision, as it is counted, twice as much as on the page: browsers give one page's
# arrays, and its textures, 2 GiB at most, and many less.
@writes(".html", label="Web page", holds=("moving", "modes"), numbers=True, most=2**30)
def write_html(file: Path, moving: MovingSurface) -> None:
    """Write a page with a surface, its shapes and how much there is of each over time."""
    from spacemap_vtk.memory import require

    require(
        (_POINT + _OF_TARGET * len(moving.targets)) * len(moving.points),
        "a page of {1} points in {0} shapes".format(*moving.targets.shape),
        cure=SMALLER,
    )
    record = json.loads(told() or "{}")
    generator = f"spacemap_vtk {record.get('version', '')}".rstrip()
    title = moving.title or file.stem
    content, arrays = _content(moving)
    described = {"title": title, "generator": generator, **moving.about}
    described |= {NAME: record} if record else {}
    words = {
        "generator": html.escape(generator),
        "title": html.escape(title),
        "scene": _json(described),
        "content": _json(content),
        "script": "\n".join((_PAGE / name).read_text(encoding="utf-8") for name in _SCRIPTS),
    }
    page = (_PAGE / "page.html").read_text(encoding="utf-8").split("{{data}}")
    head, tail = (re.sub(r"\{\{(\w+)\}\}", lambda found: words[found[1]], part) for part in page)
    write(file, chain([head.encode()], _elements(arrays), [tail.encode()]))


def _content(moving: MovingSurface) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return what the page says of its arrays, and these: rows of integers, columns last."""
    middle = 0.5 * (moving.points.min(axis=0) + moving.points.max(axis=0)).astype(float)
    left = 1.0 - moving.about.get("largest_error", 0.0) / moving.tolerance
    # each place and each shape is off by half of it along each axis, and no shape counts twice
    most = max(min(left, _USUAL), _LEAST) * moving.tolerance
    unit = most / (0.5 * 3**0.5 * (1 + len(moving.targets)))
    arrays = {
        "points": _rounded(moving.points - middle, unit),
        "colors": moving.colors.astype("u1"),
        "triangles": moving.triangles.astype("u4"),
        "targets": _rounded(moving.targets, unit),
    }
    if moving.normals is not None and moving.normal_targets is not None:
        arrays["normals"] = _rounded(moving.normals, 1 / _NORMAL)
        arrays["normal_targets"] = _rounded(moving.normal_targets, 1 / _NORMAL)
    content: dict[str, Any] = {
        "figures": _figures(moving, most),
        "middle": middle.tolist(),
        "unit": unit,
        "sight": moving.sight._asdict(),
        "clips": [
            {
                "name": clip.name,
                "times": clip.times.tolist(),
                "weights": clip.weights.astype(float).round(7).tolist(),
                "start": clip.start,
                "speed": clip.speed,
            }
            for clip in moving.clips
        ],
    }
    if moving.numbers is not None:
        title, span, ramp, values, changes, weights = moving.numbers
        step = (span[1] - span[0]) / _SCALE
        arrays["values"] = _rounded(values[:, None], step)
        arrays["changes"] = _rounded(changes[..., None], step)
        content["numbers"] = {"title": title, "span": span, "ramp": ramp, "unit": step}
        content["numbers"]["weights"] = weights.round(7).tolist()
    content["arrays"] = [
        {"name": name, "kind": values.dtype.str[1:], "shape": values.shape}
        for name, values in arrays.items()
    ]
    return content, arrays


def _rounded(values: NDArray[np.floating], unit: float) -> NDArray[np.integer[Any]]:
    """Return multiples of a unit, in two bytes if they are small."""
    import numpy as np

    from spacemap_vtk.parallel import blocks

    # a piece at a time: in double precision all are more than there is of anything else
    flat = values.reshape(-1)
    largest = max(values.max(initial=0.0), -values.min(initial=0.0)) / unit
    found = np.empty(flat.shape, np.int16 if np.rint(largest) < 2**15 else np.int32)
    for part in blocks(len(flat), _AT_ONCE):
        found[part] = np.rint(flat[part] / unit)
    return found.reshape(values.shape)


def _figures(moving: MovingSurface, rounding: float) -> list[str]:
    """Return what a person may want to know."""
    from spacemap_vtk.units import UNITS, format_quantity

    lengths = moving.points.max(axis=0) - moving.points.min(axis=0)
    unit = format_quantity(float(lengths.max()), "m").split()[-1]
    size = UNITS["m"][unit]
    found = [" × ".join(f"{length / size:.3g}" for length in lengths) + f" {unit}"]
    if moving.curves is not None:
        found.insert(0, f"{len(moving.curves.counts)} yarns")
    if "largest_error" in moving.about:
        count, error = len(moving.targets), moving.about["largest_error"] + rounding
        near = format_quantity(error, "m", 2)
        found.append(f"{count} shape{'s' * (count != 1)}, within {near} of the motion")
    elif len(moving.targets):
        found.append(f"{len(moving.targets)} modes")
    return found


def _json(value: Any) -> str:
    """Return JSON that ends no element of a page."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _elements(arrays: dict[str, NDArray[Any]]) -> Iterator[bytes]:
    """Yield elements with all arrays, packed."""
    kept = b""
    for part in _packed(arrays):
        kept += part
        while len(kept) >= _PART or (not part and kept):
            text = base64.b64encode(kept[:_PART])
            kept = kept[_PART:]
            yield b'<script type="text/plain" class="data">' + text + b"</script>\n"


def _packed(arrays: dict[str, NDArray[Any]]) -> Iterator[bytes]:
    """Yield "raw deflate" of all arrays, and at last nothing."""
    # Of each column there is the step from row to row, of all of these the first bytes, then the
    # second ones: neighbours are alike, and what is alike takes no room.

    import numpy as np

    packer = zlib.compressobj(6, zlib.DEFLATED, -zlib.MAX_WBITS)
    for values in arrays.values():
        blocks, width = values.reshape(-1, *values.shape[-2:]), values.dtype.itemsize
        for byte in range(width):
            for block in blocks:
                unsigned = np.ascontiguousarray(block.T).view(f"<u{width}")
                steps = np.diff(unsigned, axis=-1, prepend=unsigned.dtype.type(0))
                yield packer.compress(steps.reshape(-1, 1).view(np.uint8)[:, byte].tobytes())
    yield packer.flush()
    yield b""


@tells(".html")
def told_in_page(path: Path) -> str | None:
    """Find the record in what a page says of its scene, which comes before its data."""
    with path.open("rb") as stream:
        begin = stream.read(2**24)
    found = re.search(rb'<script type="application/json" id="scene">(.*?)</script>', begin, re.S)
    return json.dumps(json.loads(found[1])[NAME]) if found else None
