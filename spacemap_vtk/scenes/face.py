"""How the face of a still cloth fills its picture: by the picture's size, or by repeats.

A weaver looks for the whole draft, undistorted. A picture of no given size has the cloth's own
proportions. One of another size, or of a cloth too long for that, shows more repeats of the draft
beside or above; of a draft that would be too fine to be seen so, its beginning.
"""

from __future__ import annotations

from spacemap_vtk.errors import SpacemapError, naming_section
from spacemap_vtk.fabric.cloth import Cloth
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.settings import FLAT, USUAL_SIZE

#: A picture of the cloth's proportions is at most so many times as long as wide.
_LONGEST = 2.0
#: A longer cloth is shown as a whole where its yarns are at least so many pixels wide.
_SEEN = 0.25
#: Ends and picks of what is repeated, at most; and what share of a cloth is no bar beside it.
_MOST, _SLIT = 100_000, 0.01


def picture_size(scene: Scene) -> tuple[int, int]:
    """Return width and height of a scene's pictures, in pixels, where nobody asks for others."""
    if scene.view.size is not None:
        width, height = scene.view.size
        return width, height
    try:
        lengths = lengths_of(scene.weave.cloth) if _is_flat(scene) else None
    except SpacemapError:
        lengths = None  # whoever draws it says why
    if lengths is None:
        return USUAL_SIZE
    side = max(USUAL_SIZE)
    shares = (max(length / max(lengths), 1.0 / _LONGEST) for length in lengths)
    width, height = (round(side * share) for share in shares)
    return width, height


def fill(scene: Scene, size: tuple[int, int]) -> None:
    """Let a still cloth that is seen flat fill its picture, and say what has become of it."""
    if not _is_flat(scene):
        return
    with scene.naming_file(), naming_section("weave"):
        counts, lengths = scene.weave.cloth.size, lengths_of(scene.weave.cloth)
    per_pixel = [length / pixels for length, pixels in zip(lengths, size, strict=True)]
    long, short = (0, 1) if per_pixel[0] > per_pixel[1] else (1, 0)
    name = ("ends", "picks")
    if per_pixel[long] > _LONGEST * per_pixel[short] and size[long] < _SEEN * counts[long]:
        cloth = scene.weave.cloth
        places = cloth.yarns[long].position
        seen = int((places - places[0] < (1 - 1e-9) * per_pixel[short] * size[long]).sum())
        scene.weave.configure(**{name[long]: max(seen, 1)})
        scene.warn(
            f"{name[long]} 1 to {max(seen, 1)} of {counts[long]} are in the picture, which the "
            'cloth is far longer than: view.camera = "front" shows all'
        )
        return
    wanted = round(counts[short] * per_pixel[long] / per_pixel[short])
    asked = scene.weave.ends if short == 0 else scene.weave.picks
    more = counts[short] * (1.0 + _SLIT) < wanted <= _MOST
    if scene.weave.draft is None or asked is not None or not more:
        return
    scene.weave.configure(**{name[short]: wanted})
    scene.warn(
        f"the draft's {counts[short]} {name[short]} are repeated to {wanted}, which fill the "
        f"picture: weave.{name[short]} = {counts[short]} shows them once"
    )


def _is_flat(scene: Scene) -> bool:
    return scene.view.camera == FLAT and not scene.moves and scene.source is scene.weave


def lengths_of(cloth: Cloth) -> list[float]:
    """Return how long a cloth is across its ends and its picks, in m."""
    return [
        float(yarns.position[-1] - yarns.position[0]) + threads.mean_spacing(cloth.diameter_sum)
        for yarns, threads in zip(cloth.yarns, cloth.threads, strict=True)
    ]
