"""Draw the picture at the top of the README, which takes some minutes: python docs/pictures.py"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

COLORS = json.dumps(["#b3262e"] * 13 + ["#f4ecdc"] * 12)

#: The tablecloth of the scene `drape`, woven of 400 by 500 yarns in place of 80 by 100.
FINE_CLOTH = {
    "weave.ends": "400",
    "weave.picks": "500",
    "weave.warp_spacing": "1.5 mm",
    "weave.weft_spacing": "1.5 mm",
    "weave.warp_diameter": "0.84 mm",
    "weave.weft_diameter": "0.84 mm",
    "weave.warp_color": COLORS,
    "weave.weft_color": COLORS,
    "modal.modes": "12",  # the cloth hangs at rest: modes are not used
}


def render(file: Path, size: str, **settings: str) -> Image.Image:
    """Draw the tablecloth in a process of its own, whose memory is then free again."""
    command = [sys.executable, "-m", "spacemap_vtk", "render", "drape", "-o", str(file)]
    command += ["--size", size]
    for key, value in {**FINE_CLOTH, **settings}.items():
        command += ["--set", f"{key}={value}"]
    subprocess.run(command, check=True)
    return Image.open(file).convert("RGB")


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        whole = render(Path(folder) / "whole.png", "1040x820")
        near = render(Path(folder) / "near.png", "520x820", **{"view.zoom": "9"})
    page = Image.new("RGB", (whole.width + near.width, whole.height))
    page.paste(whole, (0, 0))
    page.paste(near, (whole.width, 0))
    page.save(Path(__file__).with_name("drape.jpg"), quality=90, optimize=True)


if __name__ == "__main__":
    main()
