"""A threading or treadling by groups, as lines of text that a weaver marks off."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from spacemap_vtk.textile.drafts.repeats import Phrase, Repeat, find_repeats

#: Most numbers on a line that does not repeat, and the least number of tokens.
_LINE_NUMBERS, _LEAST_TOKENS = 16, 4
#: Writes a token; the one before it in the same brackets is None at their beginning.
WriteToken = Callable[[Any, Any], str]


@dataclass(frozen=True)
class GroupLine:
    """Some threads, one after another, that repeat a group of tokens."""

    #: First thread and the one after the last, from 0.
    begin: int
    end: int
    count: int
    #: Tokens of one repetition.
    tokens: tuple[Any, ...]


@dataclass(frozen=True)
class Groups:
    """A sequence of tokens in its smallest description, and line by line."""

    sequence: Sequence[Any]
    write_token: WriteToken
    #: Number of the first thread.
    first: int = 1

    @cached_property
    def phrase(self) -> Phrase:
        """The smallest description."""
        return find_repeats(self.sequence)

    def lines(self) -> list[GroupLine]:
        """Return the lines, each thread on one of them; nested repeats are written out."""
        numbers = max(len(self.write_token(token, None).split("+")) for token in self.sequence)
        most = max(_LINE_NUMBERS // numbers, _LEAST_TOKENS)
        return list(_unroll(self.phrase, 0, most))

    @property
    def has_repeats(self) -> bool:
        """Whether the smallest description is shorter than the sequence."""
        return any(isinstance(item, Repeat) for item in self.phrase)

    def write_phrase(self) -> list[str]:
        """Return the words of the smallest description, such as ``3 × (1 2) 4``."""
        return _phrase_words(self.phrase, self.write_token)

    def write_range(self, line: GroupLine) -> str:
        """Return the numbers of a line's threads."""
        begin, end = self.first + line.begin, self.first + line.end - 1
        return f"{begin}–{end}" if end > begin else str(begin)

    def write_line(self, line: GroupLine) -> list[str]:
        """Return the words of a line."""
        phrase = line.tokens if line.count == 1 else (Repeat(line.count, line.tokens),)
        return _phrase_words(phrase, self.write_token)


def _unroll(phrase: Phrase, begin: int, most: int) -> Iterator[GroupLine]:
    """Yield the lines of a phrase; loose tokens on lines of at most so many."""
    loose: list[Any] = []

    def flush() -> Iterator[GroupLine]:
        for start in range(0, len(loose), most):
            part = tuple(loose[start : start + most])
            first = begin - len(loose) + start
            yield GroupLine(first, first + len(part), 1, part)
        loose.clear()

    for item in phrase:
        if not isinstance(item, Repeat):
            loose.append(item)
            begin += 1
            continue
        yield from flush()
        if any(isinstance(inner, Repeat) for inner in item.phrase):
            size = len(item) // item.count
            for copy in range(item.count):
                yield from _unroll(item.phrase, begin + copy * size, most)
        else:
            yield GroupLine(begin, begin + len(item), item.count, item.phrase)
        begin += len(item)
    yield from flush()


def _phrase_words(phrase: Phrase, write_token: WriteToken) -> list[str]:
    words: list[str] = []
    before: Any = None
    for item in phrase:
        if isinstance(item, Repeat):
            inner = _phrase_words(item.phrase, write_token)
            if len(inner) > 1:
                inner = [f"({inner[0]}", *inner[1:-1], f"{inner[-1]})"]
            words += [f"{item.count} ×", *inner]
            before = None
        else:
            words.append(write_token(item, before))
            before = item
    return words
