"""HDF5 files that are written as their data come: groups, tables that grow, attributes.

By the HDF5 File Format Specification, version 3.0, in its oldest form (superblock 1, version 1 of
B-trees and object headers), which every library reads. It is written here because VTK's own writer
must not be let near a disk (`spacemap_vtk.io.output`), writes all that stays the same once more for
each time, and knows times in single precision only.
"""

from __future__ import annotations

import struct
from hashlib import blake2b
from math import prod
from typing import TYPE_CHECKING, Any, BinaryIO

from spacemap_vtk.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

#: Where nothing is.
_NOWHERE = 2**64 - 1
#: The bytes before the first data: the superblock, see `Hdf5Writer.close`.
_HEAD = 104
#: Group nodes have one entry each; times may be so many, in one node of a table's tree.
_GROUP_K, _MOST = 16, 65_534
#: Kinds of messages in an object's header.
_SPACE, _TYPE, _FILL, _LAYOUT, _ATTRIBUTE, _SYMBOLS = 1, 3, 5, 8, 12, 17


class _Table:
    """Rows that are added in pieces of one shape."""

    def __init__(self, piece: NDArray[Any]) -> None:
        self.shape, self.dtype = piece.shape, piece.dtype
        self.pieces: list[int] = []
        self.digest = b""


class Hdf5Writer:
    """A file in the making."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream, self._end = stream, 0
        self._tables: dict[str, _Table] = {}
        self._attributes: dict[str, dict[str, Any]] = {}
        self._put(bytes(_HEAD))

    def add(self, path: str, rows: NDArray[Any]) -> int:
        """Add rows to a table, unless they are its last ones; return the first one's number."""
        import numpy as np

        rows = np.ascontiguousarray(rows, rows.dtype.newbyteorder("<"))
        table = self._tables.setdefault(path, _Table(rows))
        if rows.shape != table.shape or rows.dtype != table.dtype:
            raise InputError(
                f"{path} has {len(rows)} rows where it had {table.shape[0]}",
                cure="Write a .pvd: its files need not be alike.",
            )
        if rows.nbytes >= 2**32 or len(table.pieces) >= _MOST:
            raise InputError(
                f"{path} is too large",
                allowed=f"4 GiB at a time, {_MOST} times",
                cure="Write .pvd.",
            )
        digest = blake2b(rows.data).digest()
        if rows.size and digest != table.digest:
            table.pieces.append(self._put(rows))
            table.digest = digest
        return max(0, len(table.pieces) - 1) * len(rows)

    def tell(self, path: str, **attributes: Any) -> None:
        """Give attributes, of text or integers, to a group or table."""
        self._attributes.setdefault(path, {}).update(attributes)

    def close(self) -> None:
        """Write what tells where all of it is."""
        tree: dict[str, Any] = {}
        for path, table in self._tables.items():
            *groups, name = path.split("/")
            group = tree
            for each in groups:
                group = group.setdefault(each, {})
            group[name] = table
        # One node each holds all, so that there are no trees of several.
        self._leaf_k = max(4, -(-_widest(tree) // 2))
        self._tree_k = max(1, -(-max(len(t.pieces) for t in self._tables.values()) // 2))
        root = self._group("", tree)
        head = b"\x89HDF\r\n\x1a\n" + bytes([1, 0, 0, 0, 0, 8, 8, 0])
        head += struct.pack("<HHIHH", self._leaf_k, _GROUP_K, 0, self._tree_k, 0)
        head += struct.pack("<QQQQ", 0, _NOWHERE, self._end, _NOWHERE)
        head += struct.pack("<QQII16x", 0, root, 0, 0)
        self._stream.seek(0)
        self._stream.write(head)

    def _put(self, data: Any) -> int:
        """Append something, and return its address."""
        at, size = self._end, memoryview(data).nbytes
        self._stream.write(data)
        self._stream.write(bytes(-size % 8))
        self._end += size + -size % 8
        return at

    def _group(self, path: str, members: dict[str, Any]) -> int:
        heap, entries, place = bytearray(8), [], 0
        for name in sorted(members, key=str.encode):
            below, member = f"{path}/{name}".lstrip("/"), members[name]
            made = self._group if isinstance(member, dict) else self._dataset
            place = len(heap)
            entries.append(struct.pack("<QQII16x", place, made(below, member), 0, 0))
            heap += _padded(name.encode() + b"\0")
        room = bytes(40 * (2 * self._leaf_k - len(entries)))
        leaf = struct.pack("<4sBBH", b"SNOD", 1, 0, len(entries)) + b"".join(entries) + room
        node = struct.pack(
            "<4sBBHQQQQQ", b"TREE", 0, 0, 1, _NOWHERE, _NOWHERE, 0, self._put(leaf), place
        )
        tree = self._put(node + bytes(16 * (2 * _GROUP_K - 1)))
        names = self._put(heap)
        own = self._put(struct.pack("<4sB3xQQQ", b"HEAP", 0, len(heap), 1, names))
        return self._object(path, [(_SYMBOLS, struct.pack("<QQ", tree, own))])

    def _dataset(self, path: str, table: _Table) -> int:
        shape, size, count = table.shape, table.dtype.itemsize, len(table.pieces)
        if not count:
            layout = struct.pack("<BBQQ", 3, 1, _NOWHERE, 0)
        else:
            rank, length, piece_size = len(shape), shape[0], size * prod(shape)
            key = f"<II{rank + 1}Q"
            node = struct.pack("<4sBBHQQ", b"TREE", 1, 0, count, _NOWHERE, _NOWHERE)
            for number, piece in enumerate(table.pieces):
                node += struct.pack(key, piece_size, 0, number * length, *[0] * rank)
                node += struct.pack("<Q", piece)
            node += struct.pack(key, piece_size, 0, count * length, *[0] * rank)
            node += bytes((struct.calcsize(key) + 8) * (2 * self._tree_k - count))
            layout = struct.pack(f"<BBBQ{rank + 1}I", 3, 2, rank + 1, self._put(node), *shape, size)
        rows = (count * shape[0], *shape[1:])
        messages = [(_SPACE, _space(rows)), (_TYPE, _type(table.dtype))]
        return self._object(path, [*messages, (_FILL, bytes([2, 3, 2, 0])), (_LAYOUT, layout)])

    def _object(self, path: str, messages: list[tuple[int, bytes]]) -> int:
        import numpy as np

        for name, value in self._attributes.get(path, {}).items():
            told = np.array(value.encode() if isinstance(value, str) else value)
            parts = name.encode() + b"\0", _type(told.dtype), _space(told.shape)
            head = struct.pack("<BxHHH", 1, *map(len, parts))
            messages.append((_ATTRIBUTE, head + b"".join(map(_padded, parts)) + told.tobytes()))
        body = b""
        for kind, data in messages:
            data = _padded(data)
            body += struct.pack("<HHB3x", kind, len(data), 0) + data
        return self._put(struct.pack("<BxHII4x", 1, len(messages), 1, len(body)) + body)


def _widest(tree: dict[str, Any]) -> int:
    return max([len(tree), *(_widest(each) for each in tree.values() if isinstance(each, dict))])


def _padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 8)


def _space(shape: tuple[int, ...]) -> bytes:
    return struct.pack(f"<BBB5x{len(shape)}Q", 1, len(shape), 0, *shape)


def _type(dtype: np.dtype[Any]) -> bytes:
    size = dtype.itemsize
    if dtype.kind == "S":
        return struct.pack("<BBBBI", 0x13, 0, 0, 0, size)
    if dtype.kind in "iu":
        signed = 8 * (dtype.kind == "i")
        return struct.pack("<BBBBIHH", 0x10, signed, 0, 0, size, 0, 8 * size)
    assert dtype.kind == "f", dtype
    mantissa, exponent = {4: (23, 8), 8: (52, 11)}[size]
    where = struct.pack("<HHBBBB", 0, 8 * size, mantissa, exponent, 0, mantissa)
    bias = 2 ** (exponent - 1) - 1
    return (
        struct.pack("<BBBBI", 0x11, 0x20, 8 * size - 1, 0, size) + where + struct.pack("<I", bias)
    )
