"""Stitch meshes (.smobj): a mesh whose faces have types, and a library (.sf) of yarns in each type.

Yarns of a type are drawn in its polygon: from a point on one edge through points inside to a point
on another edge. In a face of the mesh a point has the same generalised barycentric coordinates
(E. L. Wachspress, "A Rational Finite Element Basis", 1975), and its height is along the normal, in
the scale of the mesh. Lines e name which edges of faces are joined; yarns go on across them.

Described in the README of github.com/textiles-lab/smobj.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import require_file
from spacemap_vtk.io.yarns.file_bytes import (
    check_curves,
    join_ends,
    no_cell,
    read_yarn_bytes,
    text_of,
)
from spacemap_vtk.io.yarns.stitch_mesh import smooth_polyline
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.rods.curves import Curve, CurveSet

#: Radius of yarns in the unit of the library.
_RADIUS = 0.1
#: Places on edges and heights are equal if they are so in these parts of 1.
_PARTS = 1000
_NUMBER = r"\s*([-+0-9.eE]+)\s*"
_EDGE = re.compile(rf"\({_NUMBER},{_NUMBER}\)\s*(\S+)")
_END = rf"\[\s*(\d+)\s*:{_NUMBER},{_NUMBER}\]"
_YARN = re.compile(rf"{_END}((?:\s*\([^()]*\))*)\s*{_END}")
_POINT = re.compile(rf"\({_NUMBER},{_NUMBER},{_NUMBER}\)")
#: Operations by which a type is derived from another one.
_OPERATIONS = ("mirror-x", "mirror-z", "reverse-yarn")


class _Refuse(Protocol):
    """A function that returns the error about a line, counted from 0."""

    def __call__(self, number: int, why: str, cure: str = ...) -> InputError: ...


class _End(NamedTuple):
    """End of a yarn on an edge of a face."""

    edge: int
    along: float
    z: float


class _Yarn(NamedTuple):
    """A yarn in a face."""

    begin: _End
    middle: Floats
    """(n, 3)"""
    end: _End


class _Type(NamedTuple):
    """A type of faces."""

    corners: Floats
    """(n, 2)"""
    labels: list[str]
    """Label of the edge that begins at each corner, as -l1."""
    yarns: list[_Yarn]

    def key(self, name: str) -> str:
        """Return the name by which meshes refer to it."""
        return " ".join([name, *self.labels])

    def derive(self, operations: Sequence[str]) -> _Type:
        """Return the type after some of `_OPERATIONS`."""
        corners, labels, count = self.corners.copy(), list(self.labels), len(self.labels)
        mirrors_x, mirrors_z = "mirror-x" in operations, "mirror-z" in operations
        turn = 0
        if mirrors_x:
            # The new first edge is the last one of those of the same kind at the bottom.
            kinds = [label.rstrip("0123456789") for label in labels]
            turn = next((k for k, kind in enumerate(kinds) if kind != kinds[0]), count)
            order = (turn - np.arange(count)) % count
            corners = corners[order] * [-1.0, 1.0]
            labels = [labels[k - 1] for k in order]
        if "reverse-yarn" in operations:
            swap = {"+": "-", "-": "+"}
            labels = [
                swap[label[0]] + label[1:] if label[:2] in ("+y", "-y") else label
                for label in labels
            ]

        def moved(end: _End) -> _End:
            edge = (turn - end.edge - 1) % count if mirrors_x else end.edge
            along = 1.0 - end.along if mirrors_x else end.along
            return _End(edge, along, -end.z if mirrors_z else end.z)

        signs = [-1.0 if mirrors_x else 1.0, 1.0, -1.0 if mirrors_z else 1.0]
        yarns = [
            _Yarn(moved(each.begin), each.middle * signs, moved(each.end)) for each in self.yarns
        ]
        return _Type(corners, labels, yarns)


class _Mesh(NamedTuple):
    """A stitch mesh; all numbers are counted from 0."""

    types: list[str]
    points: Floats
    faces: list[list[int]]
    type_of_face: list[int]
    joints: dict[tuple[int, int], tuple[int, int, bool]]
    """Face and edge that are joined to a face and edge, and whether they run in the other
    direction."""


def read_smobj(path: Path, library: Path | None = None) -> CurveSet:
    """Read the yarns of a stitch mesh with a library of faces, by default the one beside it."""
    mesh = _read_mesh(path)
    source = _find_library(path) if library is None else require_file(library)
    types = _read_library(source)
    missing = [key for key in dict.fromkeys(mesh.types) if key not in types]
    without = [kind for kind in mesh.type_of_face if mesh.types[kind] in missing]
    if len(without) == len(mesh.faces):
        raise InputError(
            f'{path}: the library {source.name} has no face "{missing[0]}", nor any other of the '
            "mesh",
            key="library",
            cure="Give the library with which the mesh was made.",
        )
    notes = []
    if without:
        names = ", ".join(f'"{mesh.types[kind]}"' for kind in dict.fromkeys(without))
        notes.append(
            f"{len(without)} of {len(mesh.faces)} faces have no yarns, because {source.name} does "
            f"not have their types: {names}"
        )
    empty = _Type(np.zeros((0, 2)), [], [])
    used = [types.get(key, empty) for key in mesh.types]
    for number, (corners, kind) in enumerate(zip(mesh.faces, mesh.type_of_face, strict=True)):
        if used[kind].labels and len(corners) != len(used[kind].labels):
            raise InputError(
                f"{path}: face {number + 1} has {len(corners)} edges, and its type "
                f"{mesh.types[kind]} has {len(used[kind].labels)}",
                key="file",
            )
    scale = _scale_of(mesh, used)
    curves = []
    for points in _join_segments(mesh, used, scale):
        nodes, periods = join_ends(smooth_polyline(points))
        curves.append(Curve(nodes, periods, 2 * _RADIUS * scale))
    return CurveSet(check_curves(path, curves), no_cell(), False, None, tuple(notes))


def _find_library(path: Path) -> Path:
    """Return the library in the folder of a mesh."""
    found = sorted(path.parent.glob("*.sf"))
    own = [each for each in found if each.stem == path.stem]
    if len(own or found) == 1:
        return (own or found)[0]
    names = ", ".join(each.name for each in found) or "no .sf"
    raise InputError(
        f"{path}: a stitch mesh has no yarns; they are in a library of its faces, and its folder "
        f"has {names}",
        key="library",
        allowed="a file .sf",
        cure="Set textile.library to the library with which the mesh was made.",
    )


def _lines_of(path: Path) -> tuple[Iterator[tuple[int, str]], _Refuse]:
    """Return the lines of a file without comments, and a function that refuses one."""
    lines = [
        line.partition("#")[0].strip() for line in text_of(path, read_yarn_bytes(path)).splitlines()
    ]

    def refuse(number: int, why: str, cure: str = "Write the file again.") -> InputError:
        return InputError(
            f'{path}: line {number + 1}, "{lines[number]}": {why}', key="file", cure=cure
        )

    return ((number, line) for number, line in enumerate(lines) if line), refuse


def _read_mesh(path: Path) -> _Mesh:
    """Read vertices, faces with their types, and joints."""
    mesh = _Mesh([], np.zeros((0, 3)), [], [], {})
    points: list[list[float]] = []
    lines, refuse = _lines_of(path)
    for number, line in lines:
        name, *words = line.split()
        try:
            if name == "L":
                mesh.types.append(" ".join(words))
            elif name == "v":
                points.append([float(word) for word in words[:3]])
            elif name == "f":
                mesh.faces.append([int(word.partition("/")[0]) - 1 for word in words])
            elif name == "T":
                mesh.type_of_face.append(int(words[0]) - 1)
            elif name == "e":
                (face, edge), (other, signed) = (
                    [int(part) for part in word.split("/")] for word in words
                )
                ends = (face - 1, edge - 1), (other - 1, abs(signed) - 1)
                for here, there in (ends, ends[::-1]):
                    mesh.joints[here] = (*there, signed < 0)
        except (ValueError, IndexError):
            raise refuse(number, "numbers are missing or wrong") from None
    count, kinds = len(points), len(mesh.types)
    ok = all(len(point) == 3 for point in points) and len(mesh.faces) == len(mesh.type_of_face)
    ok = ok and all(len(face) > 2 and 0 <= min(face) <= max(face) < count for face in mesh.faces)
    if not ok or not mesh.faces or not all(0 <= kind < kinds for kind in mesh.type_of_face):
        raise InputError(
            f"{path}: not a whole stitch mesh: each face needs 3 or more vertices and a type T of "
            "a line L",
            key="file",
        )
    return mesh._replace(points=np.array(points))


def _read_library(path: Path) -> dict[str, _Type]:
    """Read a library of faces, by their keys: name and labels of the edges."""
    faces: list[tuple[str, _Type]] = []
    derived: list[tuple[int, str, list[str], str]] = []
    is_face = False
    lines, refuse = _lines_of(path)
    for number, line in lines:
        name, _, rest = line.partition(" ")
        if name == "face" and rest.strip():
            faces.append((rest.strip(), _Type(np.zeros((0, 2)), [], [])))
        elif name == "derive":
            derived.append((number, *_parse_derive(rest, number, refuse)))
        elif name == "edge" and is_face and (found := _EDGE.fullmatch(rest.strip())):
            label, kind = faces[-1]
            corner = [_to_float(found[k], number, refuse) for k in (1, 2)]
            corners = np.concatenate([kind.corners, [corner]])
            faces[-1] = label, kind._replace(corners=corners, labels=[*kind.labels, found[3]])
        elif name == "yarn" and is_face and (found := _YARN.fullmatch(rest.strip())):
            faces[-1][1].yarns.append(_parse_yarn(found, len(faces[-1][1].labels), number, refuse))
        else:
            raise refuse(
                number,
                "not a line of a library of faces",
                "Lines are face NAME, edge (x,y) label, yarn [edge:along,z] (x,y,z) … "
                "[edge:along,z], and derive.",
            )
        is_face = name != "derive"
    known = {kind.key(name): kind for name, kind in faces}
    while derived:
        left = [each for each in derived if each[3] not in known]
        if len(left) == len(derived):
            raise refuse(left[0][0], f'there is no face "{left[0][3]}" to derive from')
        for _, key, operations, source in derived:
            if source in known:
                known[key] = known[source].derive(operations)
        derived = left
    return known


def _parse_derive(text: str, number: int, refuse: _Refuse) -> tuple[str, list[str], str]:
    """Return the key of a derived face, the operations, and the key of its source."""
    found = re.fullmatch(r"\s*(.+?)(?:\s+by((?:\s+\S+)*?))?\s+from\s+(.+?)\s*", text)
    operations = (found[2] or "").split() if found else []
    if found is None or not set(operations) <= set(_OPERATIONS):
        raise refuse(
            number,
            "not understood",
            f"Write derive FACE by {' '.join(_OPERATIONS)} from FACE, with some of these.",
        )
    return " ".join(found[1].split()), operations, " ".join(found[3].split())


def _parse_yarn(found: re.Match[str], edges: int, number: int, refuse: _Refuse) -> _Yarn:
    """Return a yarn from the parts of its line."""
    ends = []
    for first in (1, 5):
        edge, along, z = (
            int(found[first]),
            *(_to_float(found[first + k], number, refuse) for k in (1, 2)),
        )
        if not (edge < edges and 0.0 <= along <= 1.0):
            raise refuse(number, f"the face has {edges} edges, and places on them are 0 to 1")
        ends.append(_End(edge, along, z))
    middle = [
        [_to_float(word, number, refuse) for word in point.groups()]
        for point in _POINT.finditer(found[4])
    ]
    return _Yarn(ends[0], np.reshape(middle, (-1, 3)), ends[1])


def _to_float(word: str, number: int, refuse: _Refuse) -> float:
    try:
        return float(word)
    except ValueError:
        raise refuse(number, f"{word} is no number") from None


def barycentric_coordinates(corners: Floats, points: Floats) -> Floats:
    """Compute Wachspress's coordinates of points (p, 2) in a convex polygon (n, 2): (p, n)."""
    following, preceding = np.roll(corners, -1, axis=0), np.roll(corners, 1, axis=0)
    # Areas of the triangles of each point with each edge, and of each corner with its neighbours.
    areas = _area(points[:, None], corners, following)
    at_corner = _area(preceding, corners, following)
    numbers = np.arange(len(corners))
    weights = np.stack(
        [
            at_corner[k]
            * areas[:, (numbers != k) & (numbers != (k - 1) % len(numbers))].prod(axis=1)
            for k in numbers
        ],
        axis=1,
    )
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def _area(a: Floats, b: Floats, c: Floats) -> Floats:
    """Compute twice the area of triangles (…, 2), positive if counterclockwise."""
    one, two = b - a, c - a
    return np.asarray(one[..., 0] * two[..., 1] - one[..., 1] * two[..., 0])


def _scale_of(mesh: _Mesh, types: Sequence[_Type]) -> float:
    """Return the length in the mesh over that in the library: the root of the mean of areas."""
    ratios = []
    for corners, kind in zip(mesh.faces, mesh.type_of_face, strict=True):
        place, flat = mesh.points[corners], types[kind].corners
        if not len(flat):
            continue
        spokes = place - place.mean(axis=0)
        area = np.linalg.norm(np.cross(spokes, np.roll(spokes, -1, axis=0)), axis=1).sum()
        ratios.append(area / abs(_area(flat[:1], flat, np.roll(flat, -1, axis=0)).sum()))
    return float(np.sqrt(np.mean(ratios)))


def _normals_of(mesh: _Mesh) -> Floats:
    """Compute a normal at each vertex from the areas of its faces, (n, 3)."""
    normals = np.zeros_like(mesh.points)
    for corners in mesh.faces:
        place = mesh.points[corners]
        area = np.cross(place, np.roll(place, -1, axis=0)).sum(axis=0)
        normals[corners] += area
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.where(length > 0.0, length, 1.0))


def _join_segments(mesh: _Mesh, types: Sequence[_Type], scale: float) -> Iterator[Floats]:
    """Yield the points of each yarn, from face to face."""
    normals = _normals_of(mesh)
    weights = [[_weights_of(kind, yarn) for yarn in kind.yarns] for kind in types]
    # Each end of each segment by its place, and the place at which the yarn goes on.
    ends: dict[tuple[int, int, int, int], tuple[int, int, int]] = {}
    for face, kind in enumerate(mesh.type_of_face):
        for number, yarn in enumerate(types[kind].yarns):
            for side, end in enumerate((yarn.begin, yarn.end)):
                ends[_place(face, end)] = face, number, side
    left = {(face, number) for face, number, _ in ends.values()}

    def run(face: int, number: int, side: int) -> Iterator[tuple[int, int, int]]:
        """Yield segments from one on, each with the side at which the yarn enters."""
        while (face, number) in left:
            left.remove((face, number))
            yield face, number, side
            yarn = types[mesh.type_of_face[face]].yarns[number]
            end = yarn.begin if side else yarn.end
            joint = mesh.joints.get((face, end.edge))
            if joint is None:
                return
            other, edge, is_reversed = joint
            along = 1.0 - end.along if is_reversed else end.along
            following = ends.get(_place(other, _End(edge, along, end.z)))
            if following is None:
                return
            face, number, side = following

    for face, number, _ in list(dict.fromkeys((f, n, 0) for f, n, _ in ends.values())):
        if (face, number) not in left:
            continue
        forward = list(run(face, number, 0))
        left.add((face, number))
        back = [(f, n, 1 - side) for f, n, side in run(face, number, 1)][:0:-1]
        points: list[Floats] = []
        for at, which, side in back + forward:
            shares, heights = weights[mesh.type_of_face[at]][which]
            corners = mesh.faces[at]
            normal = shares @ normals[corners]
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
            own = shares @ mesh.points[corners] + scale * heights[:, None] * normal
            own = own[::-1] if side else own
            points.append(own[1:] if points else own)
        yield np.concatenate(points)


def _place(face: int, end: _End) -> tuple[int, int, int, int]:
    return face, end.edge, round(end.along * _PARTS), round(end.z * _PARTS)


def _weights_of(kind: _Type, yarn: _Yarn) -> tuple[Floats, Floats]:
    """Return coordinates (p, n) and heights (p,) of the points of a yarn in its face."""
    count = len(kind.labels)
    rows, heights = [], []
    for end in (yarn.begin, yarn.end):
        row = np.zeros(count)
        row[end.edge], row[(end.edge + 1) % count] = 1.0 - end.along, end.along
        rows.append(row)
        heights.append(end.z)
    inside = barycentric_coordinates(kind.corners, yarn.middle[:, :2])
    shares = np.concatenate([rows[:1], inside, rows[1:]])
    return shares, np.concatenate([heights[:1], yarn.middle[:, 2], heights[1:]])
