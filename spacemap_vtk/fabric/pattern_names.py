"""The words by which weavers name a pattern: ``"twill 2/1 left"``, ``"satin 8/3"``, ``"basket 2"``.

A name is a weave, the counts that it takes (with ``/`` between them) and a word for its side, in
any order and case: "Left twill 2/1" and "2/1 twill left" are the same.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric import patterns
from spacemap_vtk.ndarrays import Bools
from spacemap_vtk.parameters import suggestion

_Counts = tuple[int, ...]
#: A repeat has no more yarns than this: more is a slip of the keyboard.
MOST_YARNS = 1000


@dataclass(frozen=True)
class _Weave:
    """How a weave is named."""

    #: How many numbers it takes.
    counts: tuple[int, ...]
    #: The sides that it can have, the usual one first.
    words: tuple[str, ...]
    #: From the numbers and the side to one repeat.
    make: Callable[[_Counts, str], Bools]
    #: As a user might write it.
    example: str


def _satin(counts: _Counts, face: str) -> Bools:
    step = counts[1] if counts[1:] else patterns.satin_step(counts[0])
    return patterns.satin(counts[0], step, face)


_WEAVES = {
    "plain": _Weave((0,), (), lambda counts, word: patterns.plain(), "plain"),
    "twill": _Weave(
        tuple(range(2, 17, 2)),
        ("right", "left"),
        lambda counts, word: patterns.twill(*counts, direction=word),
        "twill 2/1 left",
    ),
    "satin": _Weave((1, 2), ("warp", "weft"), _satin, "satin 8/3"),
    "basket": _Weave((1,), (), lambda counts, word: patterns.basket(counts[0]), "basket 2"),
    "rib": _Weave(
        (1, 2),
        ("warp", "weft"),
        lambda counts, word: patterns.rib(counts[0], counts[-1], word),
        "rib 2/1 weft",
    ),
}
#: Other words of the trade for the same.
_SYNONYMS = {
    "tabby": "plain",
    "hopsack": "basket",
    "z": "right",
    "s": "left",
}
#: What may be said of a weave and says nothing.
_IDLE = {"weave", "faced"}

#: The grammar, for messages and help.
GRAMMAR = (
    '"plain", "twill 2/1" (over/under; also 3/1/1/2; "left" or "right"), "satin 8/3" '
    '(shafts/step; "warp" or "weft" faced), "basket 2", "rib 2/1 warp" (or "weft")'
)


def canonical(text: str) -> str:
    """Return a pattern's name in one spelling.

    Parameters
    ----------
    text : str
        As a user wrote it.

    Returns
    -------
    str
        Weave, counts and side, in small letters; the usual side left out.

    Raises
    ------
    InputError
        If it names no weave, or one that cannot be woven.

    Examples
    --------
    >>> canonical("2/2 Twill, Z")
    'twill 2/2'
    """
    name, counts, word = _parsed(text)
    _made(name, counts, word)  # so that what is stored can be woven
    usual = _WEAVES[name].words[:1]
    parts = [name, "/".join(map(str, counts)), "" if word in usual else word]
    return " ".join(part for part in parts if part)


def named(text: str) -> Bools:
    """Return one repeat of a pattern.

    Parameters
    ----------
    text : str
        Its name.

    Returns
    -------
    (picks, ends) bool
        End 0 lies over pick 0, but for warp satins.

    Raises
    ------
    InputError
        As for `canonical`.

    Examples
    --------
    >>> named("twill 1/2 left").astype(int).tolist()
    [[1, 0, 0], [0, 0, 1], [0, 1, 0]]
    """
    return _made(*_parsed(text))


def _made(name: str, counts: _Counts, word: str) -> Bools:
    try:
        return _WEAVES[name].make(counts, word)
    except InputError as error:
        # key and value are of a function that the user did not call: put them into the sentence
        raise InputError(
            f"{error.message}: {error.key} {error.value}, allowed: {error.allowed}", cure=error.cure
        ) from None


def _parsed(text: str) -> tuple[str, _Counts, str]:
    """Return the weave, its counts and its side."""
    names: list[str] = []
    counts: list[_Counts] = []
    words: list[str] = []
    side_words = {word for weave in _WEAVES.values() for word in weave.words}
    # weavers write 2-2 for 2/2, and weft-faced
    text = re.sub(r"(?<=\d)\s*-\s*(?=\d)", "/", text.lower()).replace("-", " ")
    for token in re.findall(r"\d+(?:\s*/\s*\d+)*|[^\s,\d]+", text):
        word = _SYNONYMS.get(token, token)
        if word[0].isdigit():
            counts.append(tuple(int(number[:9]) for number in re.findall(r"\d+", word)))
        elif word == "sateen":
            names.append("satin")
            words.append("weft")
        elif word in _WEAVES:
            names.append(word)
        elif word in side_words:
            words.append(word)
        elif word not in _IDLE:
            known = [*_WEAVES, *side_words, *_SYNONYMS, "sateen"]
            raise InputError(f'"{token}" is not a word for a weave', cure=suggestion(token, known))
    if len(names) != 1:
        raise InputError("a pattern names one weave")
    weave = _WEAVES[names[0]]
    if len(counts) > 1 or len(sum(counts, ())) not in weave.counts:
        raise InputError(f'not the numbers of a {names[0]}; write, for example, "{weave.example}"')
    if sum(sum(counts, ())) > MOST_YARNS:
        raise InputError(f"a repeat of more than {MOST_YARNS} yarns")
    if len(words) > 1 or not set(words) <= set(weave.words):
        sides = " or ".join(weave.words) or "none"
        raise InputError(f'"{" ".join(words)}" is no side of a {names[0]}; its sides: {sides}')
    return names[0], sum(counts, ()), (words or [*weave.words[:1], ""])[0]
