"""Refuse a scene whose yarns do not fit into memory, before any of its stages works.

Each stage refuses what it cannot store itself. That comes late: the last stage, which makes the
surface, needs most, and those before it take minutes for a large cloth. Here the needs of all
stages are added. The sum is right within a factor of 1.5 (`tests/test_memory.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from spacemap_vtk.errors import SpacemapError, add_section_to_errors
from spacemap_vtk.filters import barycentric_warp, crimp_interchange, patch_tessellator
from spacemap_vtk.filters.barycentric_warp import BarycentricWarp
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.crimp_interchange import CrimpInterchange
from spacemap_vtk.filters.patch_tessellator import PatchTessellator
from spacemap_vtk.filters.tetra_cage import TetraCage
from spacemap_vtk.filters.textile import Textile, Woven
from spacemap_vtk.memory import require_memory

#: Fewest control points around the section of a yarn; sections with flat sides have more.
_RING = 12
#: Components of the displacement, which every surface that moves has as a point array.
_MOVED = 3


def require_stages(stages: Sequence[Stage], pieces: int = 1) -> None:
    """Refuse stages that do not fit into memory together; yarns are made in pieces."""
    source, surface = stages[0], stages[-1]
    if not isinstance(source, Textile) or not isinstance(surface, PatchTessellator):
        return
    try:
        bytes_with_sides = estimate_stages(stages)
    except SpacemapError:
        return  # the stage raises this error when it runs
    if bytes_with_sides is None:
        return
    sides, counts = surface.sides, tuple(source.families.values())
    woven = isinstance(source, Woven)
    what = f"a scene with {' x '.join(map(str, counts)) if woven else sum(counts)} yarns"

    def cure(free: int) -> str:
        fewer = suggest_fewer(
            lambda sides, share: round(bytes_with_sides(sides) * share**2 / pieces),
            free,
            sides,
            counts if woven else (),
        )
        return f"{fewer} Pictures and films need less, as they make only the yarns in view."

    with add_section_to_errors(source.section):
        require_memory(
            bytes_with_sides(sides) // pieces,
            what,
            key="ends" if woven else None,
            value=counts[0] if woven else None,
            cure=cure,
        )


def suggest_fewer(
    needed: Callable[[int, float], int], free: int, sides: int, counts: Sequence[int]
) -> str:
    """Return a sentence with subdivisions, or numbers of ends and picks, that fit into memory."""
    # `needed` returns bytes for subdivisions of each side of a patch and for a share of the yarns
    # of each family; `counts` are the ends and picks that do not fit, empty for other textiles.
    fewer = "use fewer repeats"
    if counts:
        share = next((k / 100 for k in range(99, 0, -1) if needed(sides, k / 100) <= free), 0.01)
        fewer = "use fewer ends and picks, about {} x {}"
        fewer = fewer.format(*(max(1, int(share * count)) for count in counts))
    for less in range(sides - 1, 0, -1):
        if needed(less, 1.0) <= free:
            return f"Lower surface.subdivisions to {less}, or {fewer}."
    return f"{fewer.capitalize()}."


def estimate_stages(stages: Sequence[Stage]) -> Callable[[int], int] | None:
    """Return a function that estimates the bytes that stages need, by subdivisions of each side."""
    source, by_type = stages[0], {type(stage): stage for stage in stages}
    found = source.estimate_patches() if isinstance(source, Textile) else None
    if found is None:
        return None
    counts, size = found
    labels = patch_tessellator.LABEL_BYTES
    crimp, warp, cage = (by_type.get(cls) for cls in (CrimpInterchange, BarycentricWarp, TetraCage))
    single = isinstance(source, Woven) and source.single
    if crimp is not None:
        size += crimp_interchange.estimate_bytes(counts.points, single)
        labels += 4 * sum(array.association == "cell" for array in crimp.arrays.values())
    if isinstance(warp, BarycentricWarp):
        size += barycentric_warp.estimate_bytes(
            counts.points,
            10 if isinstance(cage, TetraCage) and cage.order == 2 else 4,
            warp.smooth,
            single=single,
            embedded=None if crimp is None else counts.points // _RING,
        )
    columns = 0 if warp is None else _MOVED

    def with_sides(sides: int) -> int:
        surface = patch_tessellator.estimate_bytes(counts.patches, sides, columns, labels)
        return size + surface

    return with_sides
