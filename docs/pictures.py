"""Draw the picture at the top of the README: python docs/pictures.py (some minutes)."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

HERE = Path(__file__).parent
_COLORS = str(["#b3262e"] * 13 + ["#f4ecdc"] * 12).replace("'", '"')
#: The tablecloth of the scene `drape`, in yarns 1.5 mm apart.
_FINE = {
    "weave.ends": "400",
    "weave.picks": "500",
    "weave.warp_spacing": "1.5 mm",
    "weave.weft_spacing": "1.5 mm",
    "weave.warp_diameter": "0.84 mm",
    "weave.weft_diameter": "0.84 mm",
    "weave.warp_color": _COLORS,
    "weave.weft_color": _COLORS,
}
_VIEWS = {
    "whole": ("1040x820", {}),
    "near": ("520x820", {"view.zoom": "9"}),
}


def draw(folder: Path) -> Image.Image:
    """Return both views of the tablecloth side by side."""
    pictures = []
    for name, (size, more) in _VIEWS.items():
        file = folder / f"{name}.png"
        words = [sys.executable, "-m", "spacemap_vtk", "render", "drape", "-o", str(file)]
        words += ["--size", size]
        for key, value in {**_FINE, **more}.items():
            words += ["--set", f"{key}={value}"]
        subprocess.run(words, check=True)
        pictures.append(Image.open(file).convert("RGB"))
    width = sum(picture.width for picture in pictures)
    page = Image.new("RGB", (width, pictures[0].height))
    left = 0
    for picture in pictures:
        page.paste(picture, (left, 0))
        left += picture.width
    return page


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        draw(Path(folder)).save(HERE / "drape.png", optimize=True)
