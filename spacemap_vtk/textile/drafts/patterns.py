"""Classical weaves (plain weave, twill, satin, basket, rib) and the words that name them.

A name consists of a weave, its numbers (separated by ``/``) and a word for its side, in any order
and in upper or lower case: "Left twill 2/1" and "2/1 twill left" are the same.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from itertools import cycle
from math import gcd

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Bools
from spacemap_vtk.parameters import suggestion
from spacemap_vtk.textile.drafts.drawdown import check_counts

_Counts = tuple[int, ...]
#: Largest number of yarns in a repeat; a larger one is a typing error.
MOST_YARNS = 1000


def plain() -> Bools:
    """Build plain weave: every end goes over one pick and under the next."""
    return twill(1, 1)


def twill(*counts: int, direction: str = "right") -> Bools:
    """Build a twill: each end repeats its neighbour, one pick later."""
    # Any even number of floats is possible: 3, 1, 1, 2 goes over 3, under 1, over 1, under 2.
    for name, count in zip(cycle(("over", "under")), counts, strict=False):
        check_counts(**{name: count})
    line = np.repeat(np.arange(len(counts)) % 2 == 0, counts)
    end = np.arange(len(line))
    pick = end[:, None]
    return line[(end - pick if direction == "right" else end + pick) % len(line)]


def satin(shafts: int, step: int, face: str = "warp") -> Bools:
    """Build a satin: one binding point in each end and pick of the repeat, none adjacent."""
    check_counts(shafts=shafts)
    if step not in range(2, shafts - 1) or gcd(step, shafts) != 1:
        steps = [str(k) for k in range(2, min(shafts, 100) - 1) if gcd(k, shafts) == 1]
        raise InputError(
            f"a satin of {shafts} shafts cannot have this step",
            key="step",
            value=step,
            allowed=", ".join(steps[:12]) or "none: use 5 shafts, or 7 or more",
            cure="Step and shafts must have no common divisor, and 1 < step < shafts - 1",
        )
    place = np.arange(shafts)
    bound = (place - step * place[:, None]) % shafts == 0
    return ~bound if face == "warp" else bound


def basket(n: int) -> Bools:
    """Build basket (hopsack) weave: plain weave of groups of n ends and n picks."""
    check_counts(n=n)
    return np.kron(plain(), np.ones((n, n), dtype=bool))


def rib(over: int, under: int, family: str = "warp") -> Bools:
    """Build a rib: plain weave extended along one family, whose floats lie side by side."""
    check_counts(over=over, under=under)
    return np.repeat(plain(), (over, under), axis=0 if family == "warp" else 1)


def satin_step(shafts: int) -> int:
    """Find the smallest step of a satin; if there is none, return a step that `satin` refuses."""
    return next((k for k in range(2, shafts - 1) if gcd(k, shafts) == 1), 2)


@dataclass(frozen=True)
class _WeaveGrammar:
    """Grammar of the names of a weave."""

    #: Allowed numbers of counts.
    counts: tuple[int, ...]
    #: Allowed words for the side, the usual one first.
    words: tuple[str, ...]
    #: Makes one repeat from the counts and the side.
    make: Callable[[_Counts, str], Bools]
    #: A typical name.
    example: str


def _build_satin(counts: _Counts, face: str) -> Bools:
    step = counts[1] if counts[1:] else satin_step(counts[0])
    return satin(counts[0], step, face)


_WEAVES = {
    "plain": _WeaveGrammar((0,), (), lambda counts, word: plain(), "plain"),
    "twill": _WeaveGrammar(
        tuple(range(2, 17, 2)),
        ("right", "left"),
        lambda counts, word: twill(*counts, direction=word),
        "twill 2/1 left",
    ),
    "satin": _WeaveGrammar((1, 2), ("warp", "weft"), _build_satin, "satin 8/3"),
    "basket": _WeaveGrammar((1,), (), lambda counts, word: basket(counts[0]), "basket 2"),
    "rib": _WeaveGrammar(
        (1, 2),
        ("warp", "weft"),
        lambda counts, word: rib(counts[0], counts[-1], word),
        "rib 2/1 weft",
    ),
}
#: Synonyms used by weavers.
_SYNONYMS = {
    "tabby": "plain",
    "hopsack": "basket",
    "z": "right",
    "s": "left",
}
#: Words that are allowed and have no effect.
_IGNORED_WORDS = {"weave", "faced"}

#: The grammar, for messages and help.
GRAMMAR = (
    '"plain", "twill 2/1" (over/under; also 3/1/1/2; "left" or "right"), "satin 8/3" '
    '(shafts/step; "warp" or "weft" faced), "basket 2", "rib 2/1 warp" (or "weft")'
)


def normalise_name(text: str) -> str:
    """Normalise the name of a pattern.

    Parameters
    ----------
    text : str
        Name as the user wrote it.

    Returns
    -------
    str
        Weave, counts and side in small letters; the usual side is left out.

    Raises
    ------
    InputError
        The text names no weave, or one that cannot be woven.

    Examples
    --------
    >>> normalise_name("2/2 Twill, Z")
    'twill 2/2'
    """
    name, counts, word = _parse_name(text)
    _build(name, counts, word)  # refuse names of weaves that cannot be woven
    default = _WEAVES[name].words[:1]
    parts = [name, "/".join(map(str, counts)), "" if word in default else word]
    return " ".join(part for part in parts if part)


def build_pattern(text: str) -> Bools:
    """Build one repeat of a named pattern.

    Parameters
    ----------
    text : str
        Name of the pattern.

    Returns
    -------
    (picks, ends) bool
        End 0 lies over pick 0, except in warp satins.

    Raises
    ------
    InputError
        As for `normalise_name`.

    Examples
    --------
    >>> build_pattern("twill 1/2 left").astype(int).tolist()
    [[1, 0, 0], [0, 0, 1], [0, 1, 0]]
    """
    return _build(*_parse_name(text))


def _build(name: str, counts: _Counts, word: str) -> Bools:
    try:
        return _WEAVES[name].make(counts, word)
    except InputError as error:
        # Key and value belong to a function that the user did not call, so name them in the text.
        raise InputError(
            f"{error.message}: {error.key} {error.value}, allowed: {error.allowed}", cure=error.cure
        ) from None


def _parse_name(text: str) -> tuple[str, _Counts, str]:
    """Split a name into the weave, its counts and its side."""
    names: list[str] = []
    counts: list[_Counts] = []
    words: list[str] = []
    side_words = {word for weave in _WEAVES.values() for word in weave.words}
    # Weavers also write 2-2 for 2/2, and weft-faced.
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
        elif word not in _IGNORED_WORDS:
            known = [*_WEAVES, *side_words, *_SYNONYMS, "sateen"]
            raise InputError(f'unknown word "{token}"', cure=suggestion(token, known))
    if len(names) != 1:
        raise InputError("a pattern must name exactly one weave")
    weave = _WEAVES[names[0]]
    if len(counts) > 1 or len(sum(counts, ())) not in weave.counts:
        raise InputError(f'wrong numbers for a {names[0]}; write, for example, "{weave.example}"')
    if sum(sum(counts, ())) > MOST_YARNS:
        raise InputError(f"a repeat must not have more than {MOST_YARNS} yarns")
    if len(words) > 1 or not set(words) <= set(weave.words):
        sides = " or ".join(weave.words) or "none"
        raise InputError(f'a {names[0]} has no side "{" ".join(words)}"; allowed: {sides}')
    return names[0], sum(counts, ()), (words or [*weave.words[:1], ""])[0]
