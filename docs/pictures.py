"""Draw the pictures of the README and of the guides: python docs/pictures.py

All of them take some twenty minutes on two cores. Names draw only these pictures: python
docs/pictures.py figure styles. The name "textiles" draws those of the page of textiles. The picture
"close" needs the extra [raytrace], "paraview" needs ParaView and xvfb-run.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from PIL import Image

HERE = Path(__file__).parent
ROOT = HERE.parent

#: The cloth of the scene `tablecloth`, closely woven of 400 by 500 yarns in place of 150 by 150, in
#: cells half as wide, so that thin yarns do not sink into the rim of the table.
FINE_CLOTH = {
    "cage.divisions": "[80, 80, 1]",
    "weave.ends": "400",
    "weave.picks": "500",
    "weave.warp_spacing": "0.75 mm",
    "weave.weft_spacing": "0.6 mm",
    "weave.warp_section": "lenticular",
    "weave.weft_section": "lenticular",
    "weave.warp_diameter": "auto",
    "weave.weft_diameter": "auto",
    "weave.warp_color": json.dumps(["#274b78"] * 13 + ["#f1ead9"] * 13),
    "weave.weft_color": json.dumps(["#274b78"] * 16 + ["#f1ead9"] * 16),
    "modal.modes": "1",  # the cloth lies at rest: modes are not used
}

#: A view in which the textile goes on beyond the picture.
NEAR = {"view.zoom": "2.8"}
ALONG = {"view.zoom": "2.2"}
#: Pictures of the page of textiles: scene, and settings.
TEXTILES: dict[str, tuple[str, dict[str, str]]] = {
    "plain_weave": (
        "basket_2",
        {
            "weave.pattern": "plain",
            "weave.ends": "24",
            "weave.picks": "24",
            "weave.warp_color": "#e9e0cb",
            "weave.weft_color": "#6f8fae",
            **NEAR,
        },
    ),
    "twill": ("handweaving", {"view.camera": "three-quarter", "view.zoom": "4"}),
    "stockinette": ("stockinette", {"textile.wales": "24", "textile.courses": "30", **NEAR}),
    "rib": ("rib_2x2", {"textile.wales": "60", "textile.courses": "36", **NEAR}),
    "seed": ("seed_stitch", {"textile.wales": "24", "textile.courses": "30", **NEAR}),
    "tuck": ("tuck", {"textile.wales": "18", "textile.courses": "26", "view.zoom": "2.2"}),
    "fair_isle": (
        "fair_isle",
        {"textile.wales": "48", "textile.courses": "48", "view.zoom": "2.2"},
    ),
    "tricot": ("tricot", {"textile.wales": "18", "textile.courses": "26", **NEAR}),
    "eyelet": ("eyelet", {"textile.wales": "30", "textile.courses": "33", **ALONG}),
    "feather_and_fan": (
        "feather_and_fan",
        {"textile.wales": "48", "textile.courses": "44", **ALONG},
    ),
    "jacquard": ("jacquard", {"textile.wales": "30", "textile.courses": "36", **ALONG}),
    "cable": ("cable", {"textile.wales": "24", "textile.courses": "24", **ALONG}),
    "plait": ("three_strand_plait", ALONG),
    "tubular_braid": ("tubular_braid", {"textile.repeats_along": "16", **ALONG}),
    "orthogonal_weave": ("orthogonal_weave", {"view.zoom": "1.2"}),
    "leno": (
        "leno",
        {"textile.repeats_across": "14", "textile.repeats_along": "10", **NEAR},
    ),
    "wire_mesh": (
        "wire_mesh",
        {"textile.repeats_across": "8", "textile.repeats_along": "8", **NEAR},
    ),
    "braid_on_rod": ("braid_on_rod", {}),
    "sleeve": ("sleeve", {"view.zoom": "1.15"}),
}


def run(*words: str, **settings: str) -> None:
    """Run a command of the program in a process of its own, whose memory is then free again."""
    command = [sys.executable, "-m", "spacemap_vtk", *words]
    for key, value in settings.items():
        command += ["--set", f"{key}={value}"]
    subprocess.run(command, check=True)


def draw_tablecloth(file: Path) -> None:
    """Draw the tablecloth whole, and beside it a part of it from near."""
    parts = []
    with tempfile.TemporaryDirectory() as folder:
        for size, zoom in (("1040x820", "1"), ("520x820", "9")):
            part = Path(folder) / f"{zoom}.png"
            settings = {**FINE_CLOTH, "view.zoom": zoom}
            run("render", "tablecloth", "-o", str(part), "--size", size, **settings)
            with Image.open(part) as picture:
                parts.append(picture.convert("RGB"))
    page = Image.new("RGB", (sum(part.width for part in parts), parts[0].height))
    page.paste(parts[0], (0, 0))
    page.paste(parts[1], (parts[0].width, 0))
    page.save(file, quality=90, optimize=True)


def draw_sheet(file: Path, scene: str, size: str, scale: float, **settings: str) -> None:
    """Draw the contact sheet of a sweep, scaled."""
    with tempfile.TemporaryDirectory() as folder:
        run("sweep", scene, "-o", folder, "--size", size, **settings)
        with Image.open(Path(folder) / "contact_sheet.png") as sheet:
            page = sheet.convert("RGB")
    small = page.resize([round(scale * side) for side in page.size], Image.Resampling.LANCZOS)
    small.save(file, quality=88, optimize=True)


def draw_styles(file: Path) -> None:
    """Draw a twill in each style."""
    styles = {"view.style": "studio,paper,schematic,blueprint", "view.zoom": "3"}
    draw_sheet(file, "twill_2_2", "520x390", 1.0, **styles)


def draw_lights(file: Path) -> None:
    """Draw a twill in each light."""
    lights = {"view.light": "window,raking,backlit,flat", "view.zoom": "3"}
    draw_sheet(file, "twill_2_2", "390x390", 0.9, **lights)


def draw_inset(file: Path) -> None:
    """Draw a twill with a close-up, at twice the size, and scale it."""
    with tempfile.TemporaryDirectory() as folder:
        large = Path(folder) / "large.png"
        settings = ("--light", "window", "--inset", "0.62,0.3,5")
        run("render", "twill_2_2", "-o", str(large), "--size", "1520x1140", *settings)
        with Image.open(large) as picture:
            small = picture.convert("RGB").resize((760, 570), Image.Resampling.LANCZOS)
    small.save(file, quality=86, optimize=True)


def draw_sweep(file: Path) -> None:
    """Draw strips of three spacings and three yarns, as the guide compares them."""
    values = {
        "weave.weft_spacing": "0.4 mm,0.5 mm,0.6 mm",
        "yarns.bending": "1 mN.mm2,2 mN.mm2,4 mN.mm2",
    }
    draw_sheet(file, "yarn_to_cloth", "640x400", 2.0 / 3.0, **values)


def draw_textile(file: Path) -> None:
    """Draw a textile at twice the size, and scale it."""
    scene, settings = TEXTILES[file.stem]
    with tempfile.TemporaryDirectory() as folder:
        large = Path(folder) / "large.png"
        run("render", scene, "-o", str(large), "--size", "1200x900", **settings)
        with Image.open(large) as picture:
            small = picture.convert("RGB").resize((600, 450), Image.Resampling.LANCZOS)
    small.save(file, quality=84, optimize=True)


def draw_close(file: Path) -> None:
    """Trace each fibre of a plain weave."""
    words = ("--raytrace", "--samples", "196", "--size", "520x390")
    run(
        "render",
        "plain_weave",
        "-o",
        str(file),
        *words,
        **{"view.zoom": "5", "weave.weft_plies": "2"},
    )


def draw_motions(file: Path) -> None:
    """Draw a banner that swings, by three models of its motion."""
    models = ("--motions", "response,rotation,transient", "--times", "0,0.15,0.3,0.5,1")
    run("storyboard", "swing", *models, "--size", "1900x1080", "-o", str(file))


def draw_paraview(file: Path) -> None:
    """Photograph ParaView's window."""
    screen = ["xvfb-run", "-a", "-s", "-screen 0 1200x900x24 -noreset"]
    script = ROOT / "tests" / "paraview" / "photograph.py"
    subprocess.run([*screen, sys.executable, str(script), str(file)], check=True)


PICTURES: dict[str, Callable[[Path], None]] = {
    "tablecloth.jpg": draw_tablecloth,
    "styles.jpg": draw_styles,
    "lights.jpg": draw_lights,
    "inset.jpg": draw_inset,
    "close.jpg": draw_close,
    "sweep.jpg": draw_sweep,
    "motions.png": draw_motions,
    "storyboard.png": lambda file: run("storyboard", "plain_weave", "-o", str(file)),
    "figure.png": lambda file: run("figure", "twill_2_2", "-o", str(file), "--dpi", "150"),
    "interchange.png": lambda file: subprocess.run(
        [sys.executable, str(ROOT / "pipelines" / "keep_length.py"), str(file)], check=True
    ),
    "paraview.png": draw_paraview,
    **{f"textiles/{name}.jpg": draw_textile for name in TEXTILES},
}


def main(names: list[str]) -> None:
    """Draw all pictures, or those that are named."""
    for name, draw in PICTURES.items():
        if not names or {Path(name).stem, Path(name).parent.name} & {*names}:
            draw(HERE / name)


if __name__ == "__main__":
    main(sys.argv[1:])
