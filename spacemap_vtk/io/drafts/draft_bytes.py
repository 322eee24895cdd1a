"""Code shared by the readers of all draft formats."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from spacemap_vtk.errors import InputError, SizeError
from spacemap_vtk.io.drafts.wif_text import MAX_LENGTH
from spacemap_vtk.textile.drafts.draft import Draft
from spacemap_vtk.textile.drafts.loom import Loom
from spacemap_vtk.textile.weave.resolve import WARP_COLOR, WEFT_COLOR

#: Most crossings in a draft: 4096 by 4096, a wide jacquard.
MAX_CROSSINGS = 2**24


def read_draft_bytes(path: Path) -> bytes:
    """Read a draft file; refuse one that is too long for a draft."""
    try:
        with open(path, "rb") as stream:
            data = stream.read(MAX_LENGTH + 1)
    except (OSError, ValueError) as error:  # ValueError: the path has a null character
        raise unreadable_error(error) from None
    if len(data) > MAX_LENGTH:
        raise SizeError("the file is too large", allowed=f"up to {MAX_LENGTH} bytes")
    return data


def color_table(draft: Draft) -> tuple[list[list[int]], list[tuple[int, ...]]]:
    """Return the colour index of each end and of each pick, counted from 0, and the table."""
    # A family without colours gets the colour in which this program draws it.
    table: dict[tuple[int, ...], int] = {}
    places = []
    usual = WARP_COLOR, WEFT_COLOR
    for family, count, color in zip((draft.warp, draft.weft), draft.size, usual, strict=True):
        own = [color] * count if family.colors is None else map(tuple, family.colors.tolist())
        places.append([table.setdefault(each, len(table)) for each in own])
    return places, list(table)


def unreadable_error(error: Exception) -> InputError:
    """Return the error for a file that the system cannot open."""
    reason = getattr(error, "strerror", None) or str(error)
    return InputError(f"the draft cannot be read ({reason})", cure="Check the file name.")


def check_size(ends: int, picks: int) -> None:
    """Refuse a draft without crossings, or with more than a draft can have."""
    if not ends * picks:
        raise InputError(
            f"the draft has {ends} ends and {picks} picks", allowed="at least one of each"
        )
    if ends * picks > MAX_CROSSINGS:
        raise SizeError(
            f"a cloth of {ends} x {picks} yarns is too large",
            allowed=f"up to {MAX_CROSSINGS} crossings",
            cure="Cut it to one repeat.",
        )


#: Text that all sentences of `loose_threads` contain.
LOOSE_THREAD = "across the cloth"


def loose_threads(loom: Loom) -> Iterator[tuple[str, int, str]]:
    """Yield "end" or "pick", the first number, and a sentence, for threads that nothing moves."""
    # A thread that nothing moves stays below a rising shed, and above a sinking one.
    unmoved, other = ("under", "over") if loom.rising else ("over", "under")
    for name, rows, place, reason in (
        ("end", loom.threading, f"{unmoved} every pick", "in no heddle"),
        ("pick", loom.sheds(), f"{other} every end", "in no shed"),
    ):
        loose = [index for index, row in enumerate(rows, start=1) if not row]
        if loose:
            which, are = f"{name} {loose[0]} floats", "it is"
            if len(loose) > 1:
                which, are = f"{name}s {_list_numbers(loose)} float", "they are"
            yield name, loose[0], f"{which} {LOOSE_THREAD}, {place}: {are} {reason}"


def loose_thread_warnings(loom: Loom) -> list[str]:
    """Return the sentences of `loose_threads`."""
    return [text for _, _, text in loose_threads(loom)]


def _list_numbers(items: Sequence[int]) -> str:
    return ", ".join(map(str, items[:8])) + (f" and {len(items) - 8} more" if items[8:] else "")
