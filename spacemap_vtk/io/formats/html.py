"""Write a web page (.html) that shows a surface in motion: one file, opened by a double click.

Points, shapes and normals are stored as integers, in units of a length that the tolerance allows.
Most of their bytes are then zero or equal, and compressed they take a fifth of a .glb. The scripts
that draw them are in `spacemap_vtk/io/page`.
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

from spacemap_vtk.io.output import write_parts
from spacemap_vtk.io.provenance import NAME, finds_record, record_text
from spacemap_vtk.io.registry import SMALLER_FILE_CURE, writes

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from spacemap_vtk.datasets.moving_surface import FarCloth, MovingSurface

_PAGE = Path(__file__).parent.parent / "page"
_SCRIPTS = ("data.js", "far.js", "drawing.js", "viewer.js")
#: Usual share of the tolerance for rounding.
_ROUNDING = 0.2
#: Least share of the tolerance for rounding, if the shapes leave less.
_LEAST_ROUNDING = 0.02
#: Number of steps in the length of a normal.
_NORMAL_STEPS = 1024
#: Number of steps in the range of a scale.
_SCALE_STEPS = 1024
#: Largest integer that stands for a share or an exposure of normals.
_VIEW_STEPS = 2**15 - 1
#: Bytes of a page's arrays per point.
_POINT = 150
#: Bytes of a page's arrays per point of each target.
_TARGET_POINT = 18
#: Bytes of compressed data in one element of the page.
_ELEMENT_BYTES = 3 * 2**21
#: Number of values that are rounded together.
_BLOCK_VALUES = 2**18


# The limit counts single precision, which takes twice the bytes of the page. Browsers limit the
# arrays of a page, and its textures, to 2 GiB, and many browsers to less.
@writes(".html", label="Web page", holds=("moving", "modes"), numbers=True, shaded=True, most=2**30)
def write_html(file: Path, moving: MovingSurface) -> None:
    """Write a page with a surface, its shapes and the weight of each shape over time."""
    from spacemap_vtk.memory import require_memory

    require_memory(
        (_POINT + _TARGET_POINT * len(moving.targets)) * len(moving.points),
        "a page of {1} points in {0} shapes".format(*moving.targets.shape),
        cure=SMALLER_FILE_CURE,
    )
    record = json.loads(record_text() or "{}")
    generator = f"spacemap_vtk {record.get('version', '')}".rstrip()
    title = moving.title or file.stem
    content, arrays = _page_content(moving)
    described = {"title": title, "generator": generator, **moving.metadata}
    described |= {NAME: record} if record else {}
    words = {
        "generator": html.escape(generator),
        "title": html.escape(title),
        "scene": _script_json(described),
        "content": _script_json(content),
        "script": "\n".join((_PAGE / name).read_text(encoding="utf-8") for name in _SCRIPTS),
    }
    page = (_PAGE / "page.html").read_text(encoding="utf-8").split("{{data}}")
    head, tail = (re.sub(r"\{\{(\w+)\}\}", lambda found: words[found[1]], part) for part in page)
    write_parts(file, chain([head.encode()], _data_elements(arrays), [tail.encode()]))


def _page_content(moving: MovingSurface) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return the description of the page's arrays, and the arrays: rows of integers."""
    middle = 0.5 * (moving.points.min(axis=0) + moving.points.max(axis=0)).astype(float)
    left = 1.0 - moving.metadata.get("largest_error", 0.0) / moving.tolerance
    # Each point and each shape is rounded by up to half a unit along each axis, and no weight of a
    # shape exceeds 1.
    most = max(min(left, _ROUNDING), _LEAST_ROUNDING) * moving.tolerance
    unit = most / (0.5 * 3**0.5 * (1 + len(moving.targets)))
    arrays = {
        "points": _round_to_unit(moving.points - middle, unit),
        "colors": moving.colors.astype("u1"),
        "triangles": moving.triangles.astype("u4"),
        "targets": _round_to_unit(moving.targets, unit),
    }
    if moving.normals is not None and moving.normal_targets is not None:
        arrays["normals"] = _round_to_unit(moving.normals, 1 / _NORMAL_STEPS)
        arrays["normal_targets"] = _round_to_unit(moving.normal_targets, 1 / _NORMAL_STEPS)
    content: dict[str, Any] = {
        "figures": _page_figures(moving, most),
        "middle": middle.tolist(),
        "unit": unit,
        "sight": moving.view._asdict(),
        "plane_points": moving.plane_points,
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
        step = (span[1] - span[0]) / _SCALE_STEPS
        arrays["values"] = _round_to_unit(values[:, None], step)
        arrays["changes"] = _round_to_unit(changes[..., None], step)
        content["numbers"] = {"title": title, "span": span, "ramp": ramp, "unit": step}
        content["numbers"]["weights"] = weights.round(7).tolist()
    assert moving.shading is not None
    light, outline, exposures, far = moving.shading
    content |= {"light": light, "outline": outline}
    if exposures is not None:
        arrays["exposures"] = exposures[:, None]
    if far is not None:
        content["far"] = _describe_far_cloth(far)
        arrays |= _far_cloth_arrays(far, content)
    content["arrays"] = [
        {"name": name, "kind": values.dtype.str[1:], "shape": values.shape}
        for name, values in arrays.items()
    ]
    return content, arrays


def _describe_far_cloth(far: FarCloth) -> dict[str, Any]:
    """Return what the page needs to know of a cloth as a sheet, without its arrays."""
    return {
        "triangles": far.triangles,
        "columns": far.columns.tolist(),
        "rows": far.rows.tolist(),
        "spacing": far.spacing,
        "leastPixels": far.least_pixels,
        "levels": far.levels,
        "tileLevels": far.tile_levels,
        "viewUnit": float(abs(far.views).max()) / _VIEW_STEPS,
        "uniforms": far.uniforms,
        "vertex": far.vertex,
        "fragment": far.fragment,
    }


def _far_cloth_arrays(far: FarCloth, content: dict[str, Any]) -> dict[str, NDArray[Any]]:
    """Return the arrays of a cloth as a sheet: rows of integers."""
    import numpy as np

    unit = content["unit"]
    found: dict[str, NDArray[Any]] = {
        "far_points": _round_to_unit(far.points - np.array(content["middle"]), unit),
        "far_targets": _round_to_unit(far.targets, unit),
        "views": _round_to_unit(far.views, content["far"]["viewUnit"]),
        **far.colors,
        **far.tiles,
    }
    if far.values is not None and far.changes is not None:
        step = content["numbers"]["unit"]
        found["far_values"] = _round_to_unit(far.values[:, None], step)
        found["far_changes"] = _round_to_unit(far.changes[..., None], step)
    return found


def _round_to_unit(values: NDArray[np.floating], unit: float) -> NDArray[np.integer[Any]]:
    """Round values to multiples of a unit, in two bytes if they are small enough."""
    import numpy as np

    from spacemap_vtk.parallel import blocks

    # One block at a time: all values in double precision would need more memory than all else.
    flat = values.reshape(-1)
    largest = max(values.max(initial=0.0), -values.min(initial=0.0)) / unit
    found = np.empty(flat.shape, np.int16 if np.rint(largest) < 2**15 else np.int32)
    for part in blocks(len(flat), _BLOCK_VALUES):
        found[part] = np.rint(flat[part] / unit)
    return found.reshape(values.shape)


def _page_figures(moving: MovingSurface, rounding: float) -> list[str]:
    """Return figures of the surface that the page shows."""
    from spacemap_vtk.units import UNITS, format_quantity

    points = moving.points[: len(moving.points) - moving.obstacle_points]
    lengths = points.max(axis=0) - points.min(axis=0)
    unit = format_quantity(float(lengths.max()), "m").split()[-1]
    size = UNITS["m"][unit]
    found = [" × ".join(f"{length / size:.3g}" for length in lengths) + f" {unit}"]
    if moving.curves is not None:
        found.insert(0, f"{len(moving.curves.counts)} yarns")
    elif "yarns" in moving.metadata:
        found.insert(0, f"{moving.metadata['yarns']} yarns")
    if "largest_error" in moving.metadata and len(moving.targets):
        count, error = len(moving.targets), moving.metadata["largest_error"] + rounding
        near = format_quantity(error, "m", 2)
        found.append(f"{count} shape{'s' * (count != 1)}, within {near} of the motion")
    elif len(moving.targets):
        found.append(f"{len(moving.targets)} modes")
    return found


def _script_json(value: Any) -> str:
    """Return JSON without "<", which could end an element of the page."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _data_elements(arrays: dict[str, NDArray[Any]]) -> Iterator[bytes]:
    """Yield elements of the page with all arrays, compressed."""
    pending = b""
    for part in _compress_arrays(arrays):
        pending += part
        while len(pending) >= _ELEMENT_BYTES:
            yield _data_element(pending[:_ELEMENT_BYTES])
            pending = pending[_ELEMENT_BYTES:]
    yield _data_element(pending)


def _data_element(data: bytes) -> bytes:
    """Return an element of the page with some of its data."""
    text = base64.b64encode(data)
    return b'<script type="text/plain" class="data">' + text + b"</script>\n"


def _compress_arrays(arrays: dict[str, NDArray[Any]]) -> Iterator[bytes]:
    """Yield "raw deflate" of all arrays, in parts, of which some are empty."""
    # Each column is stored as differences from row to row: first the first bytes of all of them,
    # then the second bytes. Neighbouring values are similar, so equal bytes follow each other and
    # compress well.

    import numpy as np

    packer = zlib.compressobj(6, zlib.DEFLATED, -zlib.MAX_WBITS)
    for values in arrays.values():
        blocks, width = values if values.ndim == 3 else values[None], values.dtype.itemsize
        for byte in range(width):
            for block in blocks:
                unsigned = np.ascontiguousarray(block.T).view(f"<u{width}")
                steps = np.diff(unsigned, axis=-1, prepend=unsigned.dtype.type(0))
                yield packer.compress(steps.reshape(-1, 1).view(np.uint8)[:, byte].tobytes())
    yield packer.flush()


@finds_record(".html")
def find_record_in_page(path: Path) -> str | None:
    """Find the record in the page's description of its scene, which precedes the data."""
    with path.open("rb") as stream:
        begin = stream.read(2**24)
    found = re.search(rb'<script type="application/json" id="scene">(.*?)</script>', begin, re.S)
    return json.dumps(json.loads(found[1])[NAME]) if found else None
