"""Picture of the face of a still cloth: its size, and which part of the cloth it shows.

A weaver wants to see the whole draft, undistorted and not repeated. A picture without a given size
has the proportions of the cloth; a picture of another size shows the cloth in its middle. If a
cloth is so long that its yarns would be too small to be seen, only its beginning is drawn.
"""

from __future__ import annotations

from spacemap_vtk.errors import SpacemapError, add_section_to_errors
from spacemap_vtk.filters.textile import Woven
from spacemap_vtk.scenes.cameras import FLAT
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.settings import MANY_THREADS, SMALLEST_SIDE, USUAL_SIZE, WIDE_SIDE
from spacemap_vtk.textile.weave.cloth import Cloth

#: A cloth is drawn completely up to this many times its width.
_MAX_ASPECT = 16.0
#: A longer cloth is drawn only as far as each yarn has at least this many pixels.
_MIN_PIXELS = 1.0


def picture_size(scene: Scene) -> tuple[int, int]:
    """Return width and height of a scene's pictures in pixels, if no size is asked for."""
    if scene.view.size is not None:
        width, height = scene.view.size
        return width, height
    try:
        woven = flat_cloth(scene)
        if woven is None:
            return USUAL_SIZE
        cloth = woven.cloth
    except SpacemapError:
        return USUAL_SIZE  # drawing raises the same error and reports it
    side = WIDE_SIDE if sum(cloth.size) > MANY_THREADS else max(USUAL_SIZE)
    lengths = cloth_lengths(cloth)
    counts = _drawn_counts(scene, cloth, (side, side))
    drawn = [
        length * count / whole
        for length, count, whole in zip(lengths, counts, cloth.size, strict=True)
    ]
    width, height = (max(round(side * part / max(drawn)), SMALLEST_SIDE) for part in drawn)
    return width, height


def limit_to_beginning(scene: Scene, size: tuple[int, int]) -> None:
    """Leave out the end of a still cloth that is far longer than wide, and warn about it."""
    woven = flat_cloth(scene)
    if woven is None:
        return
    section = scene.source.section
    with scene.add_file_to_errors(), add_section_to_errors(section):
        cloth = woven.cloth
    counts = _drawn_counts(scene, cloth, size)
    for family, name in enumerate(("ends", "picks")):
        if counts[family] < (whole := cloth.size[family]):
            scene.assign(section, name, counts[family])
            scene.warn(
                f"the cloth is very long: only {name} 1 to {counts[family]} of {whole} are drawn; "
                f"--set {section}.{name}={whole} draws all"
            )


def pixels_per_metre(scene: Scene, cloth: Cloth, size: tuple[int, int]) -> float:
    """Return the pixels per metre of a scene's cloth in a picture of its whole face."""
    each = zip(size, cloth_lengths(cloth), strict=True)
    return scene.view.zoom * min(pixels / length for pixels, length in each)


def _drawn_counts(scene: Scene, cloth: Cloth, size: tuple[int, int]) -> tuple[int, int]:
    """Return how many ends and picks are drawn; only the family of the long side is reduced."""
    lengths, counts = cloth_lengths(cloth), list(cloth.size)
    long = 0 if lengths[0] > lengths[1] else 1
    if scene.source.settings[("ends", "picks")[long]] is None:
        place = cloth.yarns[long].position
        wide = int((place - place[0] < _MAX_ASPECT * lengths[1 - long]).sum())
        counts[long] = min(counts[long], max(wide, int(size[long] / _MIN_PIXELS)))
    return counts[0], counts[1]


def flat_cloth(scene: Scene) -> Woven | None:
    """Return the textile whose face a picture shows undistorted; None for other pictures."""
    return scene.woven if scene.view.camera == FLAT and not scene.moves else None


def cloth_lengths(cloth: Cloth) -> list[float]:
    """Return the size of a cloth across its ends and across its picks, in m."""
    return [
        float(yarns.position[-1] - yarns.position[0]) + threads.mean_spacing(cloth.diameter_sum)
        for yarns, threads in zip(cloth.yarns, cloth.threads, strict=True)
    ]
