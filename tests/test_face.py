"""How a draft is drawn that nobody has asked more of: as its weaver sees the cloth."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from spacemap_vtk.draw.order import Order, carry_out
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.fabric.drawdown import rows
from spacemap_vtk.io.draft_file import read_draft
from spacemap_vtk.scenes import face
from spacemap_vtk.scenes.face import picture_size
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.settings import USUAL_SIZE

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


@pytest.fixture
def narrow(tmp_path: Path) -> Path:
    """A draft of 8 ends and 62 picks."""
    file = tmp_path / "long.wif"
    file.write_text(REAL.read_text().replace("Threads=62", "Threads=8", 1))
    return file


def ordered(scene: Scene, size: tuple[int, int] | None, folder: Path) -> np.ndarray:
    file = folder / "a.png"
    carry_out(Order("picture", file, size=size), scene, lambda *done: None)
    return np.asarray(Image.open(file)).astype(int)


def test_a_draft_is_repeated_until_it_fills_its_picture(narrow: Path, tmp_path: Path) -> None:
    whole = Scene.read(narrow).weave.cloth.drawdown
    scene = red_and_blue(narrow)
    image = ordered(scene, (620, 620), tmp_path)
    assert scene.weave.cloth.size == (62, 62)
    # a hundredth of the picture is left free at its edges
    at = (620 * (0.01 + 0.98 * (np.arange(62) + 0.5) / 62)).astype(int)
    seen = image[np.ix_(at, at)][::-1]
    over = np.tile(whole, (1, 8))[:, :62]
    assert np.mean((seen[..., 0] > seen[..., 2]) == over) > 0.99
    (told,) = (text for text in scene.warnings if "repeated" in text)
    assert told.startswith("the draft's 8 ends are repeated to 62, which fill the picture: ")
    assert told.endswith("weave.ends = 8 shows them once")
    # What somebody has said stays, and so does what is seen from elsewhere.
    for word in ("weave.ends=8", "view.camera=front"):
        scene = red_and_blue(narrow, word)
        ordered(scene, (160, 160), tmp_path)
        assert scene.weave.cloth.size == (8, 62)
        assert not any("repeated" in text for text in scene.warnings)


def test_a_picture_of_no_given_size_has_the_draft_s_proportions(
    narrow: Path, tmp_path: Path
) -> None:
    assert picture_size(Scene.read(REAL)) == (1280, 1280)
    assert picture_size(red_and_blue(REAL, "weave.picks=45")) == (1280, round(1280 * 45 / 62))
    assert picture_size(Scene.read(narrow)) == (640, 1280)  # and no narrower
    assert picture_size(red_and_blue(REAL, "view.size=[300, 200]")) == (300, 200)
    assert picture_size(red_and_blue(REAL, "view.camera=front")) == USUAL_SIZE
    assert picture_size(Scene({"weave": {}})) == USUAL_SIZE
    scene = red_and_blue(REAL, "weave.picks=31")
    image = ordered(scene, None, tmp_path)
    assert image.shape == (640, 1280, 3)
    # Nothing but yarns, to the edges.
    edges = [image[16, 16:-16], image[-16, 16:-16], image[16:-16, 16], image[16:-16, -16]]
    assert max((edge.min(axis=1) > 180).mean() for edge in edges) < 0.1
    assert not any("picture" in text for text in scene.warnings)


def test_cloth_too_fine_to_be_seen_whole_is_cropped(
    narrow: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = Scene.read(narrow).weave.cloth.drawdown
    monkeypatch.setattr(face, "_SEEN", 8)
    scene = red_and_blue(narrow)
    image = ordered(scene, (160, 160), tmp_path)
    told = next(text for text in scene.warnings if "in the picture" in text)
    assert told.startswith("picks 1 to 8 of 62 ")
    assert scene.weave.cloth.size == (8, 8)  # no more is woven
    seen = image[10::20, 10::20][::-1]
    np.testing.assert_array_equal(seen[..., 0] > seen[..., 2], whole[:8])
    # the whole, where that is asked for
    scene = red_and_blue(narrow, "view.camera=front")
    ordered(scene, (160, 160), tmp_path)
    assert scene.weave.cloth.size == (8, 62)
