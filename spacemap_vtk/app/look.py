"""Which things the view shows."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Look:
    """What the view shows; all else is said by the scene's section ``[view]``.

    Parameters
    ----------
    fabric, cage : bool
        Whether each is drawn.
    wireframe : bool
        Whether of the fabric only the facets' edges are drawn.
    """

    fabric: bool = True
    cage: bool = True
    wireframe: bool = False
