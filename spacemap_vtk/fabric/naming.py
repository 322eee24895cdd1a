"""Names of the two families of threads, and of their quantities in messages."""

from __future__ import annotations

from collections.abc import Callable

#: Warp and weft, by their numbers.
FAMILIES = ("warp", "weft")

#: Returns how a message names a quantity, as "diameter", of the warp (0) or the weft (1). Whoever
#: makes a cloth of a user's values hands in the names that the user knows these by.
Naming = Callable[[str, int], str]


def in_words(quantity: str, family: int) -> str:
    """Name a quantity of a family in words: "crimp height of the warp"."""
    return f"{quantity.replace('_', ' ')} of the {FAMILIES[family]}"
