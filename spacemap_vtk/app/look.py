"""Which things the view shows."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Look:
    """What the view shows, apart from the data; colours are the scene's own.

    Parameters
    ----------
    fabric, cage, supports, loads, ghost : bool
        Whether each is drawn; the ghost is the fabric at rest.
    """

    fabric: bool = True
    cage: bool = True
    supports: bool = True
    loads: bool = True
    ghost: bool = False
