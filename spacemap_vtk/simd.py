"""Vector instructions for compiled loops that Numba does not vectorise.

Each function here is inlined as a few LLVM instructions into a loop that
`spacemap_vtk.parallel.compile_function` compiles.

- Arrays are flat and contiguous. Nothing is checked: the caller must keep to the bounds that each
  function states.
- A point occupies the first three of four lanes of a vector. The fourth number is never read from
  an array of points, because it may lie beyond the end of the memory.
- Numba's cache of machine code depends only on the file of the loop that calls these functions.
  After a change here, delete ``__pycache__``.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

#: Bytes of a cache line.
LINE = 64

_INT32 = ir.IntType(32)
_INT64 = ir.IntType(64)
#: A multiply-add may be rounded once (fused), as `spacemap_vtk.parallel.compile_function` allows.
_CONTRACT = ("contract",)


class _Emitter:
    """Emits the instructions for one call of an intrinsic function."""

    def __init__(self, context: Any, builder: Any, signature: Any, arguments: Any) -> None:
        self._context, self._builder = context, builder
        self._types, self._arguments = signature.args, arguments

    def number_type(self, place: int) -> Any:
        """Return the type of an array argument's numbers."""
        return self._context.get_data_type(self._types[place].dtype)

    def address(self, place: int, index: Any, kind: Any) -> Any:
        """Return the address of one number of an array argument, as a pointer to a type."""
        array = self._context.make_array(self._types[place])
        data = array(self._context, self._builder, self._arguments[place]).data
        return self._builder.bitcast(self._builder.gep(data, [index]), kind.as_pointer())

    def load_point(self, place: int, index: Any) -> Any:
        """Load three numbers into a vector of four; the fourth repeats the third."""
        # Two loads, because one masked load takes three times as long on AMD's Zen 5.
        number = self.number_type(place)
        kind = ir.VectorType(number, 2)
        low = self._builder.load(self.address(place, index, kind), align=_size(number))
        after = self._builder.add(index, ir.Constant(_INT64, 2))
        high = self._builder.load(self.address(place, after, number))
        pair = self._builder.insert_element(ir.Constant(kind, ir.Undefined), high, _INT32(0))
        mask = ir.Constant(ir.VectorType(_INT32, 4), [0, 1, 2, 2])
        return self._builder.shuffle_vector(low, pair, mask)

    def load(self, place: int, index: Any) -> Any:
        """Load four numbers."""
        number = self.number_type(place)
        pointer = self.address(place, index, ir.VectorType(number, 4))
        return self._builder.load(pointer, align=_size(number))

    def store(self, vector: Any, place: int, index: Any) -> None:
        """Store four numbers."""
        number = self.number_type(place)
        pointer = self.address(place, index, vector.type)
        self._builder.store(vector, pointer, align=_size(number))

    def cast(self, vector: Any, number: Any) -> Any:
        """Convert a vector of four to another precision."""
        if vector.type.element == number:
            return vector
        kind = ir.VectorType(number, 4)
        wider = isinstance(number, ir.DoubleType)
        return (self._builder.fpext if wider else self._builder.fptrunc)(vector, kind)

    def lane(self, vector: Any, which: int) -> Any:
        """Return a vector that repeats one lane four times."""
        mask = ir.Constant(ir.VectorType(_INT32, 4), [which] * 4)
        return self._builder.shuffle_vector(vector, ir.Constant(vector.type, ir.Undefined), mask)


def _size(number: Any) -> int:
    return 8 if isinstance(number, ir.DoubleType) else 4


@intrinsic
def subtract_point(
    _context: Any, points: Any, i: Any, origins: Any, j: Any, result: Any, k: Any
) -> Any:
    """Write ``points[i : i + 3] - origins[j : j + 3]`` to ``result[k : k + 3]``."""
    # ``result[k + 3]`` is overwritten, too. `origins` has the type of `points`, and an element at
    # ``j + 3``. The difference is computed in the precision of the points, then rounded.

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        on = _Emitter(context, builder, signature, arguments)
        away = builder.fsub(on.load_point(0, arguments[1]), on.load(2, arguments[3]))
        on.store(on.cast(away, on.number_type(4)), 4, arguments[5])
        return context.get_dummy_value()

    return types.void(points, types.intp, origins, types.intp, result, types.intp), emit


@intrinsic
def map_point(
    _context: Any, maps: Any, row: Any, points: Any, i: Any, shift: Any, moved: Any, k: Any
) -> Any:
    """Write the displacement and the new position of ``points[i : i + 3]``."""
    # A row of `maps` has 20 numbers in double precision: the origin, the displacement there, and
    # the derivatives of the displacement along x, y and z, each followed by a zero. `shift` and
    # `moved` have the type of `points`, and are overwritten from `k` to ``k + 3`` inclusive.

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        on = _Emitter(context, builder, signature, arguments)
        number = on.number_type(2)
        first = builder.mul(arguments[1], ir.Constant(_INT64, 20))
        origin, constant, *slopes = (
            on.load(0, builder.add(first, ir.Constant(_INT64, 4 * k))) for k in range(5)
        )
        point = on.load_point(2, arguments[3])
        away = builder.fsub(on.cast(point, ir.DoubleType()), origin)
        total = constant
        for axis, slope in enumerate(slopes):
            gain = builder.fmul(slope, on.lane(away, axis), flags=_CONTRACT)
            total = builder.fadd(total, gain, flags=_CONTRACT)
        # The position is computed from the rounded displacement, so that both agree exactly.
        rounded = on.cast(total, number)
        on.store(rounded, 4, arguments[6])
        on.store(builder.fadd(point, rounded), 5, arguments[6])
        return context.get_dummy_value()

    whole = types.intp
    return types.void(maps, whole, points, whole, shift, moved, whole), emit


@intrinsic
def stream_line(_context: Any, target: Any, i: Any, source: Any, j: Any) -> Any:
    """Copy 64 bytes, from ``source[j]`` on, to ``target[i]`` on, past the cache."""
    # The bytes in `target` must begin at a multiple of 64: otherwise the processor ends the
    # program. The processor need not read the line before it writes it, and the cache keeps its
    # contents. Other threads see the bytes once this thread has released a lock, which happens
    # whenever a compiled loop returns to Python.

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        on = _Emitter(context, builder, signature, arguments)
        number = on.number_type(0)
        kind = ir.VectorType(number, LINE // _size(number))
        line = builder.load(on.address(2, arguments[3], kind), align=_size(number))
        store = builder.store(line, on.address(0, arguments[1], kind), align=LINE)
        hint = builder.module.add_metadata([ir.Constant(_INT32, 1)])
        store.set_metadata("nontemporal", hint)
        return context.get_dummy_value()

    return types.void(target, types.intp, source, types.intp), emit
