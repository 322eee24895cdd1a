"""Machine knitting files (.k) in the format knitout, as rows of stitches.

An operation forms a loop on a needle of the front or of the back bed (knit, tuck), or moves loops
(xfer). Operations of a carrier in one direction are a pass, and a pass is a row; passes of several
carriers that knit different needles of a row are one row of several colours. What a needle holds
decides the stitch: a loop that is pulled through by the front bed is a knit stitch, by the back bed
a purl stitch; loops of two wales on a needle become a decrease, and an empty needle a yarn over.

Described in "The Knitout (.k) File Format" of the Textiles Lab at Carnegie Mellon,
github.com/textiles-lab/knitout. Written for version 2 of its magic string.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from spacemap_vtk.errors import InfoMessage, InputError
from spacemap_vtk.io.registry import damaged_error
from spacemap_vtk.io.yarns.file_bytes import read_yarn_bytes, text_of
from spacemap_vtk.textile.rods.stitches import DECREASES, MOST_COLORS, MOST_STITCHES, loops_used

#: Version of the magic string.
_VERSION = 2
#: Colours of carriers whose header names none.
_COLORS = ("#b5473c", "#e9d9b0", "#2f5d8a", "#5b8c5a")
_NEEDLE = re.compile(r"([fb]s?)(-?\d+)")
#: Operations that are not needed for the stitches.
_WITHOUT_EFFECT = {"in", "inhook", "releasehook", "out", "outhook", "stitch", "pause", "amiss"}
#: Headers of the specification.
_HEADERS = {"Machine", "Gauge", "Carriers", "Position"}


class KnitoutFile(NamedTuple):
    """A knit that a machine makes."""

    values: dict[str, Any]
    """Values of [textile]."""
    notes: list[str]
    """Sentences on what is not drawn."""


class Needle(NamedTuple):
    """A place for loops."""

    bed: str
    """f or b; fs or bs for sliders."""
    place: int


class _Form(NamedTuple):
    """A loop that is formed on a needle."""

    needle: Needle
    is_tuck: bool
    line: int


class _Pass(NamedTuple):
    """What a carrier does in one direction."""

    carrier: str
    way: int
    """1 to larger numbers of needles, or -1."""
    forms: list[_Form]
    reached: list[int]
    """Numbers of the needles at which the carrier was, misses included."""


class _Move(NamedTuple):
    """Loops that are moved from needle to needle; dropped if there is no target."""

    source: Needle
    target: Needle | None
    line: int


def read_knitout(path: Path) -> KnitoutFile:
    """Read a knitout file."""
    lines = text_of(path, read_yarn_bytes(path)).splitlines()
    found = re.fullmatch(r";!knitout-(\d+)\s*", lines[0]) if lines else None
    if found is None:
        raise damaged_error(path, "not a knitout file: it does not begin with ;!knitout-2")
    notes = []
    if int(found[1]) > _VERSION:
        notes.append(f"the file is of version {found[1]} of knitout; it is read as {_VERSION}")
    headers = {}
    for line in lines[1:]:
        if not line.startswith(";;"):
            break
        name, _, value = line[2:].partition(":")
        headers[name.strip()] = value.strip()
    if "Carriers" not in headers:
        notes.append("the file has no header Carriers, which knitout requires")
    unknown = sorted(
        name for name in headers if name not in _HEADERS and not name.startswith("Yarn-")
    )
    reader = _Operations(path, lines)
    events = list(reader.events())
    for what, names in (("headers", unknown), ("operations", sorted(reader.extensions))):
        if names:
            notes.append(f"{what} of extensions are ignored: {', '.join(names)}")
    rows, more = _Machine(reader.refuse).knit(events)
    return KnitoutFile(_values_of(rows, headers, path), [*notes, *more])


class _Operations:
    """The operations of a file as passes and moves."""

    def __init__(self, path: Path, lines: Sequence[str]) -> None:
        self._path, self._lines = path, lines
        self._racking = 0.0
        #: Names of ignored operations.
        self.extensions: set[str] = set()

    def refuse(self, line: int, why: str, cure: str) -> InputError:
        """Return the error about a line, counted from 0."""
        words = self._lines[line].partition(";")[0].strip()
        return InputError(f'{self._path}: line {line + 1}, "{words}": {why}', key="file", cure=cure)

    def events(self) -> Iterator[_Pass | _Move]:
        """Yield passes and moves in their order; a pass is complete when the next event follows."""
        found: list[_Pass | _Move] = []
        open_passes: dict[str, _Pass] = {}
        for number, line in enumerate(self._lines[1:], 1):
            name, *words = line.partition(";")[0].split() or [""]
            if name.startswith("x-"):
                self.extensions.add(name)
            elif name == "rack":
                self._racking = self._number(number, words)
            elif name in ("xfer", "drop") or (name in ("knit", "split") and self._is_bare(words)):
                open_passes.clear()
                found.append(self._read_move(number, name, words))
            elif name == "split":
                raise self.refuse(
                    number,
                    "a split loop is not a stitch of a row",
                    "Replace it by knit, or by xfer without carriers.",
                )
            elif name in ("knit", "tuck", "miss") and not self._is_bare(words):
                self._add(number, name, words, open_passes, found)
            elif name and name not in _WITHOUT_EFFECT and name != "tuck":
                raise self.refuse(
                    number,
                    "not an operation of knitout",
                    "Operations are knit, tuck, miss, xfer, drop, split, rack, in, inhook, "
                    "releasehook, out, outhook, stitch, pause and x-….",
                )
        return iter(found)

    def _is_bare(self, words: list[str]) -> bool:
        """Return whether an operation has needles, but no carriers."""
        return not any(_NEEDLE.fullmatch(word) is None and word not in "+-" for word in words)

    def _add(
        self,
        number: int,
        name: str,
        words: list[str],
        open_passes: dict[str, _Pass],
        found: list[_Pass | _Move],
    ) -> None:
        """Add a loop, or a miss, to the pass of its carrier."""
        if len(words) < 3 or words[0] not in ("+", "-"):
            raise self.refuse(
                number, "a direction, a needle and a carrier are needed", f"Write {name} + f1 A."
            )
        way, needle, carriers = int(words[0] + "1"), self._needle(number, words[1]), words[2:]
        if len(carriers) > 1:
            raise self.refuse(
                number,
                f"{len(carriers)} yarns make one loop",
                "Knit with one carrier; give the yarn the diameter of both.",
            )
        if len(needle.bed) > 1:
            raise self.refuse(number, "a slider cannot knit", "Knit on the needle itself.")
        own = open_passes.get(carriers[0])
        if own is None or own.way != way or way * (needle.place - own.reached[-1]) <= 0:
            own = open_passes[carriers[0]] = _Pass(carriers[0], way, [], [])
            found.append(own)
        own.reached.append(needle.place)
        if name == "miss":
            return
        if self._racking:
            raise self.refuse(
                number,
                f"the beds are racked by {self._racking:g}",
                "Rack only for transfers, and write rack 0 before loops are formed.",
            )
        own.forms.append(_Form(needle, name == "tuck", number))

    def _read_move(self, number: int, name: str, words: list[str]) -> _Move:
        """Read a transfer, or a loop that is dropped."""
        needles = [self._needle(number, word) for word in words if word not in ("+", "-")]
        if len(needles) != (2 if name in ("xfer", "split") else 1):
            raise self.refuse(number, "needles are missing", "Write xfer f1 b1, or drop f1.")
        if name in ("drop", "knit"):
            return _Move(needles[0], None, number)
        front, back = sorted(needles, key=lambda each: each.bed[0] == "b")
        if front.bed[0] == back.bed[0]:
            raise self.refuse(
                number,
                "both needles are on one bed",
                "Transfer to the other bed, rack, and transfer back.",
            )
        if front.place != back.place + self._racking:
            raise self.refuse(
                number,
                f"these needles do not face each other at a racking of {self._racking:g}",
                f"Write rack {front.place - back.place} before it.",
            )
        return _Move(needles[0], needles[1], number)

    def _needle(self, number: int, word: str) -> Needle:
        found = _NEEDLE.fullmatch(word)
        if found is None:
            raise self.refuse(number, f"{word} is no needle", "Write f1, b-2, fs3 or bs4.")
        return Needle(found[1], int(found[2]))

    def _number(self, number: int, words: list[str]) -> float:
        try:
            (word,) = words
            return float(word)
        except ValueError:
            raise self.refuse(number, "a number is needed", "Write rack 1.") from None


class _Row(NamedTuple):
    """Stitches of a row, from the left."""

    words: list[str]
    carriers: list[str]
    """The carrier of each stitch."""
    is_shared: bool
    """Whether several carriers knit it."""


class _Machine:
    """Loops on the needles while rows are knitted."""

    def __init__(self, refuse: Callable[[int, str, str], InputError]) -> None:
        self._refuse = refuse
        #: Wales of the row below whose loops a needle holds, from front to back.
        self._held: dict[Needle, list[int]] = {}
        #: Numbers of the needles, from the left.
        self._wales: list[int] = []

    def knit(self, events: Sequence[_Pass | _Move]) -> tuple[list[_Row], list[str]]:
        """Return the rows, with sentences on passes that are not rows."""
        occupied = list(self._occupied(events))
        most = max(map(len, occupied), default=0)
        is_pass = [isinstance(event, _Pass) and bool(event.forms) for event in events]
        full = [k for k, indices in enumerate(occupied) if len(indices) == most and is_pass[k]]
        if not full or most < 1:
            raise InputError("the file forms no loops", key="file")
        self._wales = sorted(occupied[full[0]])
        whole = [
            k
            for k in full
            if len({form.needle.place for form in _forms(events[k])}) >= most / 2 or k == full[0]
        ]
        start, end = full[0] + 1, whole[-1] + 1
        while end < len(events) and self._complements(events[end - 1], events[end]):
            end += 1
        for needle, indices in self._state_after(events[:start]).items():
            self._held[needle] = [self._wales.index(indices)]
        notes: list[str] = []
        for what, part in (("cast-on", events[:start]), ("end of the piece", events[end:])):
            if lines := [form.line + 1 for event in part for form in _forms(event)]:
                text = f"lines {lines[0]} to {lines[-1]} are the {what}, which is not drawn"
                notes.append(InfoMessage(text))
        rows, at = [], start
        while at < end:
            event = events[at]
            if isinstance(event, _Move):
                self._move(event)
                at += 1
                continue
            passes = self._passes_of_row(events[at:end])
            if event.forms:
                self._require_whole(event, events[at + 1 :], len(passes))
                rows.append(self._row(passes))
            at += len(passes)
        if not rows:
            raise InputError(
                "the file knits no rows above its cast-on",
                key="file",
                cure="Knit a row of all needles at least.",
            )
        return rows, notes

    def _occupied(self, events: Sequence[_Pass | _Move]) -> Iterator[set[int]]:
        """Yield the numbers of the needles that hold loops after each event."""
        held: set[Needle] = set()
        for event in events:
            if isinstance(event, _Pass):
                held |= {form.needle for form in event.forms}
            elif event.source in held:
                held.remove(event.source)
                held |= {event.target} if event.target else set()
            yield {needle.place for needle in held}

    def _state_after(self, events: Sequence[_Pass | _Move]) -> dict[Needle, int]:
        """Return the needles that hold loops after the cast-on, with their numbers."""
        held: dict[Needle, int] = {}
        for event in events:
            if isinstance(event, _Pass):
                held.update({form.needle: form.needle.place for form in event.forms})
            elif event.source in held:
                del held[event.source]
                if event.target:
                    held[event.target] = event.target.place
        return held

    def _complements(self, first: _Pass | _Move, second: _Pass | _Move) -> bool:
        """Return whether two passes knit different needles that are all needles together."""
        parts = [{form.needle.place for form in _forms(each)} for each in (first, second)]
        return all(parts) and not parts[0] & parts[1] and parts[0] | parts[1] == {*self._wales}

    def _passes_of_row(self, events: Sequence[_Pass | _Move]) -> list[_Pass]:
        """Return the passes of a row: several if their carriers share its stitches."""
        first = events[0]
        assert isinstance(first, _Pass)
        done, group = {form.needle.place for form in first.forms}, [first]
        for event in events[1:MOST_COLORS]:
            own = {form.needle.place for form in _forms(event)}
            if len(done) == len(self._wales) or not isinstance(event, _Pass) or not own:
                break
            if own & done or event.carrier in {each.carrier for each in group}:
                break
            done |= own
            group.append(event)
        on_front = all(needle.bed == "f" for needle, loops in self._held.items() if loops)
        is_row = len(group) > 1 and len(done) == len(self._wales) and on_front
        return group if is_row else [first]

    def _require_whole(self, event: _Pass, later: Sequence[_Pass | _Move], shared: int) -> None:
        """Refuse a row in which the yarn turns before the side."""
        side = max(event.way * index for index in self._wales)
        last = max(event.way * index for index in event.reached)
        following = next(
            (e for e in later if isinstance(e, _Pass) and e.carrier == event.carrier), None
        )
        if shared > 1 or last == side or following is None or following.way == event.way:
            return
        if max(event.way * index for index in following.reached) <= last:
            raise self._refuse(
                following.forms[0].line if following.forms else event.forms[-1].line,
                "the yarn turns before it has reached the side: a short row",
                "Knit all needles, or write a miss of the last one.",
            )

    def _move(self, move: _Move) -> None:
        """Move loops; loops that arrive on a needle come nearer to the other bed."""
        loops = self._held.pop(move.source, [])
        if move.target is None:
            if loops:
                raise self._refuse(
                    move.line,
                    "a loop is dropped between rows, and ravels",
                    "Leave it on its needle, or bind it off at the end of the file.",
                )
            return
        there = self._held.pop(move.target, [])
        both = there + loops if move.target.bed[0] == "f" else loops + there
        if both:
            self._held[move.target] = both

    def _row(self, passes: Sequence[_Pass]) -> _Row:
        """Knit a row."""
        forms = {form.needle.place: form for each in passes for form in each.forms}
        carriers = {form.needle.place: each.carrier for each in passes for form in each.forms}
        line = passes[0].forms[0].line
        if strange := sorted(set(forms) - {*self._wales}):
            raise self._refuse(
                forms[strange[0]].line,
                "the row is wider than that below",
                "Knit the same needles in all rows; widening is not drawn.",
            )
        words, new, seen = [], {}, []
        for number, index in enumerate(self._wales):
            form = forms.get(index)
            held = [needle for needle in self._held if needle.place == index]
            if len(held) > 1 or any(len(needle.bed) > 1 for needle in held):
                raise self._refuse(
                    line if form is None else form.line,
                    f"{' and '.join(''.join(map(str, n)) for n in sorted(held))} hold loops when "
                    "the row is knitted",
                    "Let one needle of each pair f and b hold loops, and no slider.",
                )
            bed = held[0].bed if held else "" if form is None else form.needle.bed
            if not bed:
                raise self._refuse(
                    line,
                    f"needle {index} is empty and gets no loop, so that the piece becomes narrower",
                    "Knit or tuck on the empty needle: a yarn over.",
                )
            if form is not None and form.needle.bed != bed:
                raise self._refuse(
                    form.line,
                    f"{held[0].bed}{index} holds a loop, and another one is formed opposite",
                    f"Write xfer {held[0].bed}{index} {form.needle.bed}{index} before the row.",
                )
            loops = self._held[held[0]] if held else []
            words.append(self._word(loops, form, bed, line))
            seen += sorted(set(loops))
            new[Needle(bed, index)] = [number]
        if seen != list(range(len(self._wales))):
            raise self._refuse(
                line,
                "loops have changed their order since the last row, or have gone beyond the side",
                "Write cables as c4f or c4b in rows of a scene.",
            )
        self._held = new
        by = [carriers.get(index, passes[0].carrier) for index in self._wales]
        return _Row(words, by, len(passes) > 1)

    def _word(self, loops: list[int], form: _Form | None, bed: str, line: int) -> str:
        """Return the stitch on a needle that holds loops of some wales, from front to back."""
        kinds = list(dict.fromkeys(loops))
        if form is None and len(kinds) == 1:
            return "m" if bed == "f" else "f"
        if form is not None and not kinds:
            return "yo"
        if form is not None and len(kinds) == 1:
            return "t" if form.is_tuck else "k" if bed == "f" else "p"
        if form is not None and not form.is_tuck and bed == "f":
            order = tuple(kind - min(kinds) for kind in kinds)
            for word, known in DECREASES.items():
                if order == known:
                    return word
        raise self._refuse(
            line if form is None else form.line,
            f"its needle holds loops of {len(kinds)} wales",
            f"Knit them together on the front bed; {', '.join(DECREASES)} are known.",
        )


def _forms(event: _Pass | _Move) -> list[_Form]:
    return event.forms if isinstance(event, _Pass) else []


def _values_of(rows: Sequence[_Row], headers: dict[str, str], path: Path) -> dict[str, Any]:
    """Return the values of a textile with the smallest repeat."""
    height = _period([(row.words, row.carriers) for row in rows])
    width = _period(list(zip(*(row.words for row in rows), strict=True)))
    wales = len(rows[0].words)
    while width < wales and any(sum(map(loops_used, row.words[:width])) != width for row in rows):
        width += 1
    names = list(dict.fromkeys(carrier for row in rows for carrier in row.carriers))
    colors = dict(zip(names, _colors_of(names, headers), strict=True))
    values: dict[str, Any] = {
        "kind": "knit",
        "rows": ["".join(row.words[:width]) for row in rows[:height]],
        "wales": wales,
        "courses": len(rows),
    }
    if any(row.is_shared for row in rows):
        letters = dict(zip(names, "ABCDEFGHIJKLMNOPQRSTUVWXYZ", strict=False))
        if len(letters) < len(names):
            raise InputError(f"{path}: more than 26 carriers are used", key="file")
        across = _period(list(zip(*(row.carriers for row in rows), strict=True)))
        grid = ["".join(letters[name] for name in row.carriers[:across]) for row in rows]
        values["chart"] = grid[: _period(grid)]
        values["color"] = list(colors.values())
    else:
        ways = [colors[row.carriers[0]] for row in rows]
        values["color"] = ways[: _period(ways)]
    values["rows"] = values["rows"][: _period(values["rows"])]
    if len(values["rows"]) * width > MOST_STITCHES:
        raise InputError(
            f"{path}: the pattern repeats itself only after {width} x {height} stitches",
            key="file",
            allowed=f"{MOST_STITCHES} stitches or fewer",
            cure="Cut the file to one repeat of the pattern.",
        )
    return values


def _period(items: Sequence[Any]) -> int:
    """Return the smallest number of items that repeat themselves at least once, to the end."""
    return next(
        count
        for count in (*range(1, len(items) // 2 + 1), len(items))
        if all(a == b for a, b in zip(items, items[count:], strict=False))
    )


def _colors_of(names: Sequence[str], headers: dict[str, str]) -> list[str]:
    """Return the colours of carriers, as their headers name them or any others."""
    found = []
    for number, name in enumerate(names):
        word = headers.get(f"Yarn-{name}", "").split()[-1:]
        is_hex = bool(word) and re.fullmatch(r"#[0-9a-fA-F]{6}", word[0]) is not None
        found.append(word[0].lower() if is_hex else _COLORS[number % len(_COLORS)])
    return found
