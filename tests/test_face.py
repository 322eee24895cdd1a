"""How a draft is drawn that nobody has asked more of: as its weaver sees the cloth."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from spacemap_vtk.draw.order import Order, carry_out
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.fabric.drawdown import rows
from spacemap_vtk.io.draft_file import read_draft
from spacemap_vtk.scenes.scene import Scene

REAL = Path(__file__).parent.parent / "scenes" / "32-shaft_twill.wif"
ENDS, PICKS = 20, 15


def drawn(scene: Scene, size: tuple[int, int]) -> np.ndarray:
    picture = Picture(scene, [0.0], size)
    image = picture.draw(0.0)
    picture.close()
    return image.astype(int)


def red_and_blue(file: Path, *words: str) -> Scene:
    """Return the scene of a draft whose warp is red and whose weft is blue."""
    scene = Scene.read(file)
    for word in ("weave.warp_color=#ff0000", "weave.weft_color=#0000ff", *words):
        scene.set(word)
    return scene


def test_a_draft_is_drawn_as_its_drawdown() -> None:
    scene = red_and_blue(REAL, f"weave.ends={ENDS}", f"weave.picks={PICKS}")
    image = drawn(scene, (20 * ENDS, 20 * PICKS))
    # end 1 at the left, pick 1 below, a pixel in the middle of each crossing
    seen = image[10::20, 10::20][::-1]
    np.testing.assert_array_equal(seen[..., 0] > seen[..., 2], scene.weave.cloth.drawdown)
    # the cloth fills the picture, and its yarns their spacing
    background = (image.min(axis=2) > 180).mean()
    assert background < 0.06
    scene.set("weave.thick_yarns=scale")
    net = drawn(scene, (20 * ENDS, 20 * PICKS))
    assert (net.min(axis=2) > 180).mean() > 3 * background


def test_a_draft_without_thickness_fills_its_spacing(tmp_path: Path) -> None:
    file = tmp_path / "bare.txt"
    file.write_text("\n".join(rows(read_draft(REAL).drawdown[:6, :8])))
    scene = Scene({"weave": {"draft": str(file), "thick_yarns": "flatten"}})
    widths = [threads.aspect * threads.diameter for threads in scene.weave.cloth.threads]
    assert widths == pytest.approx([0.45e-3, 0.45e-3])
    # a pattern has its own
    other = Scene({"weave": {"thick_yarns": "flatten"}}).weave.cloth
    assert other.warp.diameter == pytest.approx(0.25e-3)


def test_fine_cloth_that_is_far_longer_is_cropped(tmp_path: Path) -> None:
    file, picture = tmp_path / "long.wif", tmp_path / "a.png"
    file.write_text(REAL.read_text().replace("Threads=62", "Threads=8", 1))
    whole = Scene.read(file).weave.cloth.drawdown
    scene = red_and_blue(file)
    carry_out(Order("picture", picture, size=(160, 160)), scene, lambda *done: None)
    told = next(text for text in scene.warnings if "in the picture" in text)
    assert told.startswith("picks 1 to 8 of 62 ")
    assert scene.weave.cloth.size == (8, 8)  # no more is woven
    seen = np.asarray(Image.open(picture)).astype(int)[10::20, 10::20][::-1]
    np.testing.assert_array_equal(seen[..., 0] > seen[..., 2], whole[:8])
    # the whole, where its yarns are wide enough, or where that is asked for
    for words, size in ((), (160, 620)), (["view.camera=front"], (160, 160)):
        scene = red_and_blue(file, *words)
        carry_out(Order("picture", picture, size=size), scene, lambda *done: None)
        assert scene.weave.cloth.size == (8, 62)
        assert not any("in the picture" in text for text in scene.warnings)
