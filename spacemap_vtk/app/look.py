"""Which things the view shows."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Look:
    """What the view shows; all else is said by the scene's section ``[view]``."""

    #: Whether each is drawn.
    fabric: bool = True
    cage: bool = True
    #: Whether of the fabric only the facets' edges are drawn.
    wireframe: bool = False
