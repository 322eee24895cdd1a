"""How the view shows things: what is shown, in which colours, in which light."""

from __future__ import annotations

from dataclasses import dataclass, field

#: What the fabric's colours can mean: a name for people, and the array that is shown.
COLORINGS: dict[str, str] = {
    "Yarn colours": "color",
    "Warp and weft": "family",
    "Yarn by yarn": "yarn",
    "Displacement": "displacement",
}


@dataclass
class Look:
    """What the view shows, apart from the data.

    Parameters
    ----------
    fabric, cage, supports, ghost : bool
        Whether each is drawn; the ghost is the fabric at rest.
    coloring : str
        A key of `COLORINGS`.
    """

    fabric: bool = True
    cage: bool = True
    supports: bool = True
    ghost: bool = False
    coloring: str = field(default="Yarn colours")
