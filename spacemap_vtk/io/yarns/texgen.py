"""Textiles of TexGen (.tg3): XML with points ("master nodes"), sections and repeats of each yarn.

TexGen stores no unit; its own examples and its window mean millimetres. A textile that TexGen is to
build from a pattern has no yarns in its file until it is saved with them.

Read from files that TexGen writes, and from its sources at github.com/louisepb/TexGen.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.provenance import record_comments
from spacemap_vtk.io.registry import damaged_error
from spacemap_vtk.io.yarns.bcc import split_curves
from spacemap_vtk.io.yarns.file_bytes import check_curves, read_yarn_bytes
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.rods.curves import Curve, CurveSet

if TYPE_CHECKING:
    from spacemap_vtk.datasets.moving_surface import YarnCurves

#: Length of 1 in TexGen's files [m].
_UNIT = 1e-3
#: Version of TexGen whose files are like those that are written.
_VERSION = "3.13.0"
#: Distance by which a yarn that repeats itself may miss its point in the next cell, over its
#: repeats.
_NEAR = 1e-6


def read_tg3(path: Path) -> CurveSet:
    """Read the first textile of a TexGen file."""
    data = read_yarn_bytes(path)
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise InputError(f"{path}: the file declares XML entities; textiles have none", key="file")
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        raise damaged_error(path, f"not whole XML: {error}") from None
    textile = root.find("Textile")
    if root.tag != "TexGenModel" or textile is None:
        raise damaged_error(path, "not a textile of TexGen: no Textile in a TexGenModel")
    yarns = textile.findall("Yarn")
    if not yarns and textile.get("type", "CTextile") != "CTextile":
        raise InputError(
            f"{path}: the file has a pattern, but no yarns",
            key="file",
            value=textile.get("type"),
            cure="Open it in TexGen, and save it with its yarns (standard or full output).",
        )
    notes = []
    if len(root.findall("Textile")) > 1:
        notes.append(f"only the first textile of the file is read: {textile.get('name')}")
    cell, more = _read_cell(path, yarns)
    if more:
        notes.append("repeats through the thickness are left out: a cell has two periods")
    curves = [_read_yarn(path, yarn, number, cell) for number, yarn in enumerate(yarns)]
    shapes = {each.get("type", "") for yarn in yarns for each in yarn.findall("Interpolation")}
    if shapes - {"CInterpolationCubic"}:
        notes.append("yarns are drawn as cubic splines through their points, whatever TexGen draws")
    sections = {each.get("type", "") for yarn in yarns for each in yarn.iter("Section")} - {
        "CSectionEllipse"
    }
    if sections:
        notes.append(
            "sections are read as ellipses of the same width and height "
            f"({', '.join(sorted(each.removeprefix('CSection').lower() for each in sections))})"
        )
    return CurveSet(check_curves(path, curves), cell, True, _UNIT, tuple(notes))


def _read_cell(path: Path, yarns: list[ElementTree.Element]) -> tuple[Floats, bool]:
    """Read the period vectors that all yarns share; and whether there are more than two."""
    found: list[Floats] = []
    for yarn in yarns:
        for each in yarn.findall("Repeat"):
            vector = _numbers(path, each, "value")
            size = float(np.linalg.norm(vector))
            if size and not any(np.linalg.norm(vector - other) < _NEAR * size for other in found):
                found.append(vector)
    flat = [vector for vector in found if abs(vector[2]) < abs(vector).max()]
    if len(flat) > 2:
        raise InputError(
            f"{path}: its yarns repeat themselves by {len(flat)} different vectors",
            key="file",
            allowed="two vectors that all yarns share",
            cure="Give all yarns the same repeats in TexGen.",
        )
    cell = np.zeros((2, 3))
    cell[: len(flat)] = flat[:2] if flat else np.zeros((0, 3))
    if len(flat) == 1 and abs(flat[0][1]) > abs(flat[0][0]):
        cell = cell[::-1].copy()
    if len(flat) == 2 and abs(cell[0, 1]) > abs(cell[0, 0]):
        cell = cell[::-1].copy()
    return cell, len(found) > len(flat)


def _read_yarn(path: Path, yarn: ElementTree.Element, number: int, cell: Floats) -> Curve:
    """Read points and section of a yarn."""
    placed = [
        (_number(path, each, "index", float(place)), _numbers(path, each, "Position"))
        for place, each in enumerate(yarn.findall("MasterNode"))
    ]
    placed.sort(key=lambda each: each[0])
    if len(placed) < 2:
        raise damaged_error(path, f"yarn {number} has {len(placed)} points")
    nodes = np.array([point for _, point in placed])
    interpolation = yarn.find("Interpolation")
    periods = None
    if interpolation is None or interpolation.get("Periodic", "1") == "1":
        periods = _periods_between(nodes[0], nodes[-1], cell)
        nodes = nodes if periods is None else nodes[:-1]
    width = height = 0.0
    if (section := next(yarn.iter("Section"), None)) is not None:
        width, height = (_number(path, section, key, 0.0) for key in ("Width", "Height"))
        edge = [_numbers(path, each, "value", 2) for each in section.findall("EdgePoint")]
        if not width and len(edge) > 2:
            width, height = np.ptp(np.array(edge), axis=0).tolist()
    if min(width, height) < 0.0 or bool(width) != bool(height):
        raise damaged_error(path, f"the section of yarn {number} is {width:g} by {height:g}")
    return Curve(nodes, periods, height, width / height if height else 1.0)


def _periods_between(first: Floats, last: Floats, cell: Floats) -> tuple[int, int] | None:
    """Return the whole periods from one point to another; None if they are not whole."""
    move = last - first
    share = np.linalg.lstsq(cell.T, move, rcond=None)[0] if cell.any() else np.zeros(2)
    whole = np.round(share)
    scale = max(float(abs(cell).max()), float(abs(move).max()))
    if not np.linalg.norm(whole @ cell - move) <= _NEAR * scale:
        return None
    return int(whole[0]), int(whole[1])


def _numbers(path: Path, element: ElementTree.Element, key: str, count: int = 3) -> Floats:
    """Read numbers with commas between them from an attribute."""
    text = element.get(key, "")
    try:
        found = np.array([float(word) for word in text.split(",")])
    except ValueError:
        found = np.zeros(0)
    if len(found) != count or not np.isfinite(found).all():
        raise damaged_error(path, f'{element.tag} has {key}="{text}", which is not {count} numbers')
    return found


def _number(path: Path, element: ElementTree.Element, key: str, default: float) -> float:
    """Read a number from an attribute."""
    text = element.get(key)
    try:
        found = default if text is None else float(text)
    except ValueError:
        found = float("nan")
    if not isfinite(found):
        raise damaged_error(path, f'{element.tag} has {key}="{text}", which is not a number')
    return found


def format_tg3(curves: YarnCurves, name: str) -> Iterator[str]:
    """Yield the lines of a file: points at the ends of the Bézier curves, in millimetres."""
    parts = list(split_curves(curves))
    largest = float(curves.widths.max()) / 2
    points = np.concatenate([nodes for nodes, _ in parts])
    low, high = points.min(axis=0) - largest, points.max(axis=0) + largest
    yield '<?xml version="1.0" ?>'
    if record := record_comments(""):
        yield "<!--"
        yield from record
        yield "-->"
    yield f'<TexGenModel version="{_VERSION}">'
    yield f'    <Textile name={quoteattr(name)} type="CTextile" NeedsBuilding="0">'
    yield '        <Domain type="CDomainPlanes">'
    for axis in range(3):
        for side, end in ((1, low), (-1, high)):
            normal = np.zeros(3)
            normal[axis] = side
            distance = f"{side * end[axis] / _UNIT:.12g}"
            yield f'            <Plane Normal="{_join(normal)}" d="{distance}" />'
    yield "        </Domain>"
    for number, ((nodes, is_loop), width) in enumerate(
        zip(parts, curves.widths.tolist(), strict=True)
    ):
        yield (
            f'        <Yarn index="{number}" NumSlaveNodes="{2 * len(nodes)}" '
            'NumSectionPoints="24" NeedsBuilding="7">'
        )
        yield (
            f'            <Interpolation Periodic="{int(is_loop)}" ForceInPlaneTangent="0" '
            'ForceMasterNodeTangent="0" type="CInterpolationCubic" />'
        )
        size = f"{width / _UNIT:.12g}"
        yield '            <YarnSection type="CYarnSectionConstant">'
        yield f'                <Section type="CSectionEllipse" Width="{size}" Height="{size}" />'
        yield "            </YarnSection>"
        for place, node in enumerate(np.vstack([nodes, nodes[:1]]) if is_loop else nodes):
            yield (
                f'            <MasterNode index="{place}" Position="{_join(node / _UNIT)}" '
                'Tangent="0, 0, 0" Up="0, 0, 1" Angle="0" />'
            )
        yield "        </Yarn>"
    yield "    </Textile>"
    yield "</TexGenModel>"


def _join(values: Floats) -> str:
    return ", ".join(f"{value:.12g}" for value in values.tolist())


def tg3_losses(curves: YarnCurves | None) -> list[str]:
    """Return sentences about what a .tg3 cannot store of yarns."""
    return (
        []
        if curves is None
        else ["a .tg3 stores no colours; sections become circles of the same area"]
    )
