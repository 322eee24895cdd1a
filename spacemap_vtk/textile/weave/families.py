"""Names of the two families of threads, and of their quantities in messages."""

from __future__ import annotations

from collections.abc import Callable

#: Warp and weft, by their numbers.
FAMILIES = ("warp", "weft")

#: Function that names a quantity, such as "diameter", of the warp (0) or weft (1) in messages. Code
#: that makes a cloth from a user's values passes one with the names that the user knows.
QuantityNames = Callable[[str, int], str]


def quantity_name(quantity: str, family: int) -> str:
    """Name a quantity of a family in words: "crimp height of the warp"."""
    return f"{quantity.replace('_', ' ')} of the {FAMILIES[family]}"
