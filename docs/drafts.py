"""Draw the drafts of `scenes/drafts` near, middle and far for the gallery: python docs/drafts.py

It takes some minutes. Names of drafts draw only these again, the others are kept: python
docs/drafts.py overshot herringbone
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from spacemap_vtk.io.drafts.draft_file import read_draft
from spacemap_vtk.scenes import library
from spacemap_vtk.textile.drafts.draft import Draft, DraftThreads
from spacemap_vtk.textile.weave.resolve import WARP_COLOR, WEFT_COLOR

#: Draft files by sheet, with what is written below them; those of the last sheet are our own.
SHEETS = {
    "drafts_1": {
        "drafts/plain_weave.wif": "plain weave",
        "drafts/basket_weave.wif": "basket weave",
        "drafts/twill_2_2.wif": "2/2 twill",
        "drafts/sinking_shed_3_1.wif": "3/1 twill, sinking shed",
        "drafts/satin_5.wif": "satin of five",
        "drafts/herringbone.wif": "herringbone twill",
        "drafts/point_twill_diamond.wif": "point twill",
        "drafts/diamond_twill_fine.wpo": "diamond twill on 17 shafts",
        "drafts/diamond_twill.wpo": "diamond twill with long floats",
        "32-shaft_twill.wif": "fancy twill on 32 shafts",
    },
    "drafts_2": {
        "drafts/rainbow_stripes.wif": "plain weave with stripes",
        "drafts/twill_stripes.wif": "twill with stripes",
        "drafts/houndstooth.wif": "houndstooth",
        "drafts/apron.wif": "apron, colour and weave",
        "drafts/dobby_crepe.wif": "crepe from a liftplan",
        "drafts/tartan_gordon.wif": "Gordon tartan",
        "drafts/tartan_macgregor.wif": "MacGregor tartan",
        "drafts/tartan_menzies_dress.wif": "Menzies Dress tartan",
        "drafts/tartan_macleod_of_lewis.wif": "MacLeod of Lewis tartan",
        "drafts/tartan_anderson.wif": "Anderson tartan",
    },
    "drafts_3": {
        "drafts/huck_lace.wif": "huck lace, our own",
        "drafts/overshot.wif": "overshot, our own",
        "drafts/summer_and_winter.wif": "summer and winter, our own",
        "drafts/monks_belt.wif": "monk's belt, our own",
        "double_weave.wif": "double weave, our own",
    },
}
HERE = Path(__file__).parent
#: Width and height of a picture, distance between pictures, height of the text, in pixels.
CELL, GAP, TEXT = 250, 6, 26
#: Ends and picks of the drawdown, and across the near, the middle and the far picture.
DRAWN, NEAR, MIDDLE, FAR = 24, 12, 64, 320


def draw_drawdown(draft: Draft) -> Image.Image:
    """Draw the first ends and picks, the first pick at the bottom, and frame the near picture."""

    def colors(threads: DraftThreads, count: int, usual: tuple[int, int, int]) -> np.ndarray:
        own = np.array([usual]) if threads.colors is None else threads.colors
        return np.resize(np.resize(own, (count, 3)), (DRAWN, 3))

    ends, picks = draft.size
    over = draft.drawdown[np.arange(DRAWN)[:, None] % picks, np.arange(DRAWN) % ends]
    warp, weft = colors(draft.warp, ends, WARP_COLOR), colors(draft.weft, picks, WEFT_COLOR)
    cells = np.where(over[..., None], warp[None], weft[:, None])[::-1]
    size = CELL // DRAWN
    picture = Image.fromarray(np.kron(cells, np.ones((size, size, 1))).astype(np.uint8))
    pen = ImageDraw.Draw(picture)
    for place in range(0, DRAWN * size, size):
        pen.line([(place, 0), (place, picture.height)], (120, 120, 120))
        pen.line([(0, place), (picture.width, place)], (120, 120, 120))
    first, last = (DRAWN - NEAR) // 2 * size, (DRAWN + NEAR) // 2 * size
    pen.rectangle((first, first, last, last), outline=(220, 30, 30), width=2)
    return picture.resize((CELL, CELL), Image.Resampling.LANCZOS)


def render(draft: Path, yarns: int, zoom: float) -> Image.Image:
    """Draw so many ends and picks in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "picture.png"
        command = [sys.executable, "-m", "spacemap_vtk", "render", str(draft), "-o", str(file)]
        command += ["--size", f"{CELL}x{CELL}"]
        for key, value in {"weave.ends": yarns, "weave.picks": yarns, "view.zoom": zoom}.items():
            command += ["--set", f"{key}={value}"]
        subprocess.run(command, check=True)
        with Image.open(file) as picture:
            return picture.convert("RGB")


def draw_row(file: str, text: str) -> Image.Image:
    """Draw a draft: drawdown, near, middle and far, with its name below."""
    path = library.folder() / file
    pictures = [
        draw_drawdown(read_draft(path)),
        render(path, DRAWN, DRAWN / NEAR),
        render(path, MIDDLE, 1.0),
        render(path, FAR, 1.0),
    ]
    row = Image.new("RGB", (len(pictures) * (CELL + GAP), CELL + TEXT), "white")
    for number, picture in enumerate(pictures):
        row.paste(picture, (number * (CELL + GAP), 0))
    pen = ImageDraw.Draw(row)
    pen.text((2, CELL + 4), f"{text}  ({path.name})", (40, 46, 54), ImageFont.load_default(14))
    return row


def main(names: list[str]) -> None:
    """Draw the sheets; if there are names, only the rows of these drafts."""
    for sheet, drafts in SHEETS.items():
        if names and not any(Path(file).stem in names for file in drafts):
            continue
        target = HERE / f"{sheet}.jpg"
        width, height = 2 * 4 * (CELL + GAP), CELL + TEXT
        page = Image.new("RGB", (width, height * ((len(drafts) + 1) // 2)), "white")
        if names and target.exists():
            with Image.open(target) as earlier:
                page.paste(earlier)
        for number, (file, text) in enumerate(drafts.items()):
            if not names or Path(file).stem in names:
                place = number % 2 * width // 2, number // 2 * height
                page.paste(draw_row(file, text), place)
        page.save(target, quality=82, optimize=True)


if __name__ == "__main__":
    main(sys.argv[1:])
