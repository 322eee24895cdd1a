"""Differences between cloth drawn from afar and the same cloth drawn yarn by yarn, in codes of 255.

    python benchmarks/far_cloth.py [--pixels 1.3] [--tilts 0,30,50,65] [--section lens]
    python benchmarks/far_cloth.py --weaves scenes/drafts/overshot.wif --colors own,white,black

The near picture has many times the size and is averaged in linear light over each pixel. Both have
one camera. Each row gives, for a weave and its colours, the mean difference (far minus near) over
the cloth for each tilt of the camera, and in brackets the largest of 16 regions. A weave can be the
file of a draft, and the colours "own" are those of the draft.
"""

from __future__ import annotations

import argparse
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.draw.camera import Viewpoint
from spacemap_vtk.draw.graphics import prepare_offscreen
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.scenes import level_of_detail
from spacemap_vtk.scenes.scene import Scene

WEAVES = ("plain", "twill 2/2", "satin 5/2")
COLORS = {
    "white": ("#f4f4f0", "#f4f4f0"),
    "black": ("#101012", "#101012"),
    "red": ("#c01820", "#c01820"),
    "black on white": ("#101012", "#f4f4f0"),
    "blue on yellow": ("#2040a0", "#f0c820"),
}
#: Measures of yarns, 0.5 mm apart.
SECTIONS: dict[str, dict[str, Any]] = {
    "round": {"diameter": 0.28e-3},
    "racetrack": {"diameter": 0.058e-3, "section": "racetrack", "aspect": 7.75},
    "lens": {"diameter": 0.14e-3, "section": "lenticular", "aspect": 3.2},
}
SPACING = 0.5e-3
Image = NDArray[np.float64]


def light_of(codes: Image) -> Image:
    """Return the linear light of sRGB values."""
    share = codes / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def codes_of(light: Image) -> Image:
    """Return the sRGB values of linear light."""
    low = light <= 0.0031308
    return 255 * np.where(low, 12.92 * light, 1.055 * np.maximum(light, 0) ** (1 / 2.4) - 0.055)


def draw(scene: Scene, size: int, view: Viewpoint) -> tuple[Image, Picture]:
    """Return the linear light of a picture."""
    picture = Picture(scene, [0.0], (size, size), ["fabric"], view)
    image = picture.draw(0.0)
    picture.close()
    return light_of(image.astype(np.float64)), picture


def compare(weave: dict[str, Any], yarns: int, pixels: float, tilt: float) -> tuple[Image, Image]:
    """Return the codes of 4 x 4 regions from afar and near."""
    values = {
        "weave": {**weave, "ends": yarns, "picks": yarns},
        "view": {"camera": "face", "irregularity": 0.0},
    }
    scene = Scene(values)
    assert scene.woven is not None
    spacings = [threads.mean_spacing(0.0) for threads in scene.woven.cloth.threads]
    spacing = max(spacings)
    distance, turn = 60 * yarns * spacing, math.radians(25)
    angle = math.radians(tilt)
    place = np.array([math.sin(turn) * math.sin(angle), -math.cos(turn) * math.sin(angle)])
    eye = (*(distance * place), distance * math.cos(angle))
    # A square in the middle, which the cloth fills at any tilt.
    half = 0.14 * yarns * min(spacings)
    view = Viewpoint(eye, (0.0, 0.0, 0.0), (0.0, 1.0, 0.05), half)
    side = 8 * round(2 * half * pixels / spacing / 8)
    fine = math.ceil(10 / pixels)
    near, picture = draw(Scene({**values, "surface": {"subdivisions": 5}}), fine * side, view)
    assert picture.sheet is None
    many, level_of_detail.MANY_PATCHES = level_of_detail.MANY_PATCHES, 0
    far, picture = draw(scene, side, view)
    level_of_detail.MANY_PATCHES = many
    assert picture.sheet is not None
    assert picture.pieces is None
    images = []
    for image in (far, near):
        block = len(image) // 4
        images.append(codes_of(image.reshape(4, block, 4, block, 3).mean(axis=(1, 3))))
    return images[0], images[1]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pixels", type=float, default=1.3)
    parser.add_argument("--tilts", default="0,30,50,65")
    parser.add_argument("--section", default="lens", choices=SECTIONS)
    parser.add_argument("--yarns", type=int, default=72)
    parser.add_argument("--colors", default=",".join(COLORS))
    parser.add_argument("--weaves", default=",".join(WEAVES))
    given = parser.parse_args()
    tilts = [float(tilt) for tilt in given.tilts.split(",")]
    prepare_offscreen()
    print("weave, colours".ljust(28), *(f"{tilt:.0f} degrees".rjust(16) for tilt in tilts))
    for pattern in given.weaves.split(","):
        for name in given.colors.split(","):
            weave = {"draft": pattern} if "." in pattern else {"pattern": pattern}
            if name != "own":
                weave["warp_color"], weave["weft_color"] = COLORS[name]
            for family in ("warp", "weft") if "pattern" in weave else ():
                weave |= {f"{family}_{key}": v for key, v in SECTIONS[given.section].items()}
                weave[f"{family}_spacing"] = SPACING
            cells = []
            for tilt in tilts:
                far, near = compare(weave, given.yarns, given.pixels, tilt)
                apart = far - near
                mean = ", ".join(f"{part:+.0f}" for part in apart.mean(axis=(0, 1)))
                cells.append(f"{mean} ({np.abs(apart).max():.0f})".rjust(16))
            print(f"{pattern}, {name}".ljust(28), *cells, flush=True)


if __name__ == "__main__":
    main()
