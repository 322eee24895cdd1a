"""Describe a threading or treadling as nested repeats, and cut it into bands at their borders.

A phrase is a tuple of tokens (a shaft, a treadle, a colour: anything that can be sorted) and
`Repeat`. Of all phrases that expand to a sequence, `find_repeats` returns the one with

1. the fewest symbols: 1 for each token, and 2 for the count and the brackets of each repeat;
2. among these, the fewest repeats plus repeats that do not begin with their lowest token;
3. among these, repeats that begin early.

So a straight draw of 30 ends on 8 shafts is ``3 × (1 2 3 4 5 6 7 8) 1 2 3 4 5 6``.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from spacemap_vtk.ndarrays import Ints

#: Symbols of a repeat besides its phrase.
_REPEAT_SYMBOLS = 2
#: Longer sequences are described in parts of this length: memory grows with its square.
LONGEST = 4096
#: Depth of a place that is no border.
NO_BORDER = 9


@dataclass(frozen=True)
class Repeat:
    """A phrase that is repeated."""

    count: int
    phrase: Phrase

    def __len__(self) -> int:
        return self.count * phrase_length(self.phrase)


#: Tokens and repeats, one after another.
Phrase = tuple[Any, ...]


def find_repeats(sequence: Sequence[Hashable]) -> Phrase:
    """Find the smallest description of a sequence as nested repeats.

    Exact by dynamic programming over all intervals; the repeats that end at a place are extended
    from those that end one period earlier. It takes O(n² log n) time and O(n²) memory.

    Parameters
    ----------
    sequence : sequence of hashable
        Tokens that can be sorted.

    Returns
    -------
    tuple
        Tokens and `Repeat`; `expand` returns the sequence again.

    Examples
    --------
    >>> find_repeats([1, 2, 3, 1, 2, 3, 1, 2, 3, 1])
    (Repeat(count=3, phrase=(1, 2, 3)), 1)
    """
    if len(sequence) > LONGEST:
        return find_repeats(sequence[:LONGEST]) + find_repeats(sequence[LONGEST:])
    tokens: list[Any] = sorted(set(sequence))
    number = {token: index for index, token in enumerate(tokens)}
    codes = np.array([number[token] for token in sequence], dtype=np.int64)
    return _Folding(codes).phrase(0, len(codes), tokens)


class _Folding:
    """The least cost of each interval of a sequence, and the phrases with these costs."""

    # The cost of an interval [begin, end) is its symbols times `weight`, plus the second criterion.
    # `costs[end, begin]`: rows are contiguous, because one end is computed for all begins at once.

    def __init__(self, codes: Ints) -> None:
        self.codes, self.weight = codes, len(codes) + 1
        count = len(codes)
        self.costs = np.full((count + 1, count + 1), np.iinfo(np.int32).max // 2, np.int32)
        self.costs[0, 0] = 0
        #: For each end: its periods with the number of copies of the period that end there.
        self.periods: list[list[tuple[int, int]]] = [[]]
        # (period, end modulo period): least costs of the intervals before the repeats.
        before: dict[tuple[int, int], Any] = {}
        matches = np.zeros(count + 1, dtype=np.int64)
        for end in range(1, count + 1):
            # matches[p]: how many tokens before `end` equal those p places earlier.
            last = end - 1
            equal = codes[last - 1 :: -1] == codes[last] if last else codes[:0] == 0
            matches[1:end] = np.where(equal, matches[1:end] + 1, 0)
            found = _primitive_periods(matches[:end])
            self.periods.append([(p, 1 + int(matches[p]) // p) for p in found])
            row = self.costs[end]
            row[:end] = self.costs[end - 1, :end] + self.weight
            row[end] = 0
            for period, copies in self.periods[end]:
                key = period, end % period
                earlier = self.costs[end - 2 * period]
                if copies > 2:
                    earlier = np.minimum(earlier, before[key])
                before[key] = earlier
                np.minimum(row, earlier + self._repeat_cost(end, period), out=row)

    def _repeat_cost(self, end: int, period: int) -> int:
        """Return the cost of a repeat whose last copy ends here, whatever its count."""
        root = self.codes[end - period : end]
        awkward = bool(root[0] != root.min())
        symbols = _REPEAT_SYMBOLS * self.weight
        return int(self.costs[end, end - period]) + symbols + 1 + awkward

    def phrase(self, begin: int, end: int, tokens: Sequence[Any]) -> Phrase:
        """Return the phrase of an interval."""
        items: list[Any] = []
        while end > begin:
            cost = self.costs[end, begin]
            if cost == self.costs[end - 1, begin] + self.weight:
                end -= 1
                items.append(tokens[self.codes[end]])
                continue
            period, copies = next(
                (period, copies)
                for period, most in self.periods[end]
                for copies in range(min(most, (end - begin) // period), 1, -1)
                if cost == self.costs[end - copies * period, begin] + self._repeat_cost(end, period)
            )
            items.append(Repeat(copies, self.phrase(end - period, end, tokens)))
            end -= copies * period
        return tuple(reversed(items))


def _primitive_periods(matches: Ints) -> list[int]:
    """Return the periods of which at least two copies end here, without multiples of others."""
    candidates = np.flatnonzero(matches >= np.maximum(np.arange(len(matches)), 1))
    found = []
    while len(candidates):
        period = int(candidates[0])
        found.append(period)
        multiple = (candidates % period == 0) & (matches[period] >= candidates - period)
        candidates = candidates[~multiple]
    return found


def expand(phrase: Phrase) -> Iterator[Any]:
    """Yield the tokens that a phrase describes."""
    for item in phrase:
        if isinstance(item, Repeat):
            for _ in range(item.count):
                yield from expand(item.phrase)
        else:
            yield item


def phrase_length(phrase: Phrase) -> int:
    """Return the number of tokens that a phrase describes."""
    return sum(len(item) if isinstance(item, Repeat) else 1 for item in phrase)


def count_symbols(phrase: Phrase) -> int:
    """Return the symbols of a phrase, which `find_repeats` minimises."""
    return sum(
        _REPEAT_SYMBOLS + count_symbols(item.phrase) if isinstance(item, Repeat) else 1
        for item in phrase
    )


def border_depths(phrase: Phrase) -> Ints:
    """Compute how deep the borders of a phrase are nested.

    Parameters
    ----------
    phrase : tuple
        Of `find_repeats`.

    Returns
    -------
    (n + 1,) ndarray of int
        For the place before each token and after the last one: 0 where a repeat of the phrase
        begins or ends, 1 between its copies and at borders within them, and so on; `NO_BORDER`
        elsewhere.
    """
    depths = np.full(phrase_length(phrase) + 1, NO_BORDER)
    _mark_borders(phrase, depths, 0, 0)
    depths[[0, -1]] = 0
    return depths


def _mark_borders(phrase: Phrase, depths: Ints, begin: int, depth: int) -> None:
    for item in phrase:
        if not isinstance(item, Repeat):
            begin += 1
            continue
        size = phrase_length(item.phrase)
        for copy in range(item.count + 1):
            inner = depth if copy in (0, item.count) else depth + 1
            place = begin + copy * size
            depths[place] = min(depths[place], inner, NO_BORDER)
            if copy < item.count:
                _mark_borders(item.phrase, depths, place, depth + 1)
        begin += item.count * size


def cut_into_bands(depths: Ints, most: int) -> list[tuple[int, int]]:
    """Cut a sequence into bands, preferably at its borders.

    Parameters
    ----------
    depths : (n + 1,) ndarray of int
        Of `border_depths`.
    most : int
        Largest number of tokens in a band.

    Returns
    -------
    list of tuple of int
        Begin and end of each band: the fewest bands; among these, those with the least sum of
        depths where they are cut; among these, the most equal ones (least sum of squares).
    """
    count = len(depths) - 1
    # Each criterion outweighs the next: depths are at most NO_BORDER, squares at most count².
    square_weight = 1
    depth_weight = count * count + 1
    band_weight = depth_weight * (NO_BORDER + 1) * (count + 1)
    costs = [0] * (count + 1)
    earlier = [0] * (count + 1)
    for end in range(1, count + 1):
        options = (
            (costs[begin] + square_weight * (end - begin) ** 2, begin)
            for begin in range(max(0, end - most), end)
        )
        cost, earlier[end] = min(options)
        costs[end] = cost + band_weight + depth_weight * int(depths[end])
    bands = [(earlier[count], count)]
    while bands[-1][0] > 0:
        bands.append((earlier[bands[-1][0]], bands[-1][0]))
    return bands[::-1]
