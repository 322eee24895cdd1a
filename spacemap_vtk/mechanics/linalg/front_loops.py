"""Compiled loops that fill the fronts of a factorisation, see `spacemap_vtk.parallel`.

All dense blocks are stored column by column, and passed transposed: a block of one column counts as
stored row by row, and Numba would compile the loops once more for it.
"""

from __future__ import annotations

from spacemap_vtk.ndarrays import Floats, Ints
from spacemap_vtk.parallel import compile_function


@compile_function
def fill_columns(
    starts: Ints,
    rows: Ints,
    values: Floats,
    first: int,
    last: int,
    place: Ints,
    pivot: Floats,
    side: Floats,
) -> None:
    """Copy the columns from `first` up to `last` of a lower triangle into blocks of zeros."""
    for column in range(first, last):
        for entry in range(starts[column], starts[column + 1]):
            row = rows[entry]
            if row < last:
                pivot[column - first, row - first] = values[entry]
            else:
                side[column - first, place[row]] = values[entry]


@compile_function
def fill_rows(
    starts: Ints,
    columns: Ints,
    values: Floats,
    first: int,
    last: int,
    place: Ints,
    pivot: Floats,
    side: Floats,
) -> None:
    """Copy the rows from `first` up to `last` of an upper triangle into blocks of zeros."""
    for row in range(first, last):
        for entry in range(starts[row], starts[row + 1]):
            column = columns[entry]
            if column < last:
                pivot[column - first, row - first] = values[entry]
            else:
                side[place[column], row - first] = values[entry]


@compile_function
def add_triangle(
    update: Floats, at: Ints, cut: int, pivot: Floats, side: Floats, rest: Floats
) -> None:
    """Add the lower triangle of an update, of which the first `cut` rows are pivots."""
    count = len(at)
    for k in range(cut):
        column = at[k]
        for i in range(k, cut):
            pivot[column, at[i]] += update[k, i]
        for i in range(cut, count):
            side[column, at[i]] += update[k, i]
    for k in range(cut, count):
        column = at[k]
        for i in range(k, count):
            rest[column, at[i]] += update[k, i]


@compile_function
def add_square(
    update: Floats,
    at: Ints,
    cut: int,
    pivot: Floats,
    below: Floats,
    right: Floats,
    rest: Floats,
) -> None:
    """Add an unsymmetric update, of which the first `cut` rows and columns are pivots."""
    count = len(at)
    for k in range(cut):
        column = at[k]
        for i in range(cut):
            pivot[column, at[i]] += update[k, i]
        for i in range(cut, count):
            below[column, at[i]] += update[k, i]
    for k in range(cut, count):
        column = at[k]
        for i in range(cut):
            right[column, at[i]] += update[k, i]
        for i in range(cut, count):
            rest[column, at[i]] += update[k, i]
