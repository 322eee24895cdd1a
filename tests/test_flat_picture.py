"""How a draft is drawn that nobody has asked more of: as its weaver sees the cloth."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from spacemap_vtk.draw.graphics import prepare_offscreen
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.io.drafts.draft_file import read_draft
from spacemap_vtk.jobs import PictureJob
from spacemap_vtk.scenes.flat_picture import picture_size
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.settings import USUAL_SIZE
from spacemap_vtk.textile.drafts.drawdown import to_rows

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


def test_draft_is_drawn_like_its_drawdown() -> None:
    scene = red_and_blue(REAL, f"weave.ends={ENDS}", f"weave.picks={PICKS}")
    image = drawn(scene, (20 * ENDS, 20 * PICKS))
    # end 1 at the left, pick 1 below, a pixel in the middle of each crossing
    seen = image[10::20, 10::20][::-1]
    np.testing.assert_array_equal(seen[..., 0] > seen[..., 2], scene.woven.cloth.drawdown)
    # the cloth fills the picture, and its yarns their spacing
    background = (image.min(axis=2) > 180).mean()
    assert background < 0.06
    scene.set("weave.thick_yarns=scale")
    net = drawn(scene, (20 * ENDS, 20 * PICKS))
    assert (net.min(axis=2) > 180).mean() > 3 * background


def test_yarns_without_diameter_fill_their_spacing(tmp_path: Path) -> None:
    file = tmp_path / "bare.txt"
    file.write_text("\n".join(to_rows(read_draft(REAL).drawdown[:6, :8])))
    scene = Scene({"weave": {"draft": str(file), "thick_yarns": "flatten"}})
    widths = [threads.aspect * threads.diameter for threads in scene.woven.cloth.threads]
    assert widths == pytest.approx([0.45e-3, 0.45e-3])
    # a pattern has its own
    other = Scene({"weave": {"thick_yarns": "flatten"}}).woven.cloth
    assert other.warp.diameter == pytest.approx(0.25e-3)


@pytest.fixture
def narrow(tmp_path: Path) -> Path:
    """A draft of 8 ends and 62 picks."""
    file = tmp_path / "long.wif"
    file.write_text(REAL.read_text().replace("Threads=62", "Threads=8", 1))
    return file


def ordered(scene: Scene, size: tuple[int, int] | None, folder: Path) -> np.ndarray:
    file = folder / "a.png"
    PictureJob(file, size=size).run(scene)
    return np.asarray(Image.open(file)).astype(int)


@pytest.mark.nightly
def test_narrow_draft_is_drawn_once_and_completely(narrow: Path, tmp_path: Path) -> None:
    prepare_offscreen()  # without OpenGL there is a warning about that
    scene = red_and_blue(narrow)
    image = ordered(scene, (620, 620), tmp_path)
    assert scene.woven.cloth.size == (8, 62)
    # It stands in the middle, as high as the picture but for a hundredth at each edge.
    high = 0.98 * 620
    left = 310 - 0.5 * high * 8 / 62
    x, y = (
        (begin + length * (np.arange(count) + 0.5) / count).astype(int)
        for begin, length, count in ((left, high * 8 / 62, 8), (0.01 * 620, high, 62))
    )
    seen = image[np.ix_(y, x)][::-1]
    over = seen[..., 0] > seen[..., 2]
    np.testing.assert_array_equal(over, scene.woven.cloth.drawdown)
    beside = np.concatenate([image[:, : int(left) - 4], image[:, -int(left) + 4 :]], axis=1)
    assert beside.min() > 180
    assert not any("picture" in text or "drawn" in text for text in scene.warnings)
    # It is repeated for those who ask for that.
    scene = red_and_blue(narrow, "weave.ends=24")
    ordered(scene, (160, 160), tmp_path)
    assert scene.woven.cloth.size == (24, 62)


@pytest.mark.nightly
def test_default_picture_has_the_proportions_of_the_draft(narrow: Path, tmp_path: Path) -> None:
    assert picture_size(Scene.read(REAL)) == (1280, 1280)
    assert picture_size(red_and_blue(REAL, "weave.picks=45")) == (1280, round(1280 * 45 / 62))
    assert picture_size(Scene.read(narrow)) == (round(1280 * 8 / 62), 1280)
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


def test_draft_of_many_yarns_has_a_larger_picture(narrow: Path) -> None:
    fits = red_and_blue(REAL, "weave.ends=200", "weave.picks=200")
    assert picture_size(fits) == (1280, 1280)
    more = red_and_blue(REAL, "weave.ends=200", "weave.picks=201")
    assert picture_size(more) == (round(2400 * 200 / 201), 2400)
    assert picture_size(red_and_blue(narrow, "weave.picks=951")) == (round(2400 * 8 / 951), 2400)


@pytest.mark.nightly
def test_only_the_beginning_of_a_very_long_draft_is_drawn(tmp_path: Path) -> None:
    file = tmp_path / "long.txt"
    whole = np.add.outer(np.arange(3000), np.arange(20)) % 5 < 2
    file.write_text("\n".join(to_rows(whole)))
    values = {"weave": {"draft": str(file)}, "view": {"camera": "face"}}
    scene = Scene(values)
    # A pixel for each pick: 2400 of them.
    assert picture_size(scene) == (20, 2400)
    # In a picture of 310 pixels, sixteen times as many picks as ends.
    image = ordered(scene, (310, 310), tmp_path)
    (text,) = (text for text in scene.warnings if "are drawn" in text)
    assert text == (
        "the cloth is very long: only picks 1 to 320 of 3000 are drawn; "
        "--set weave.picks=3000 draws all"
    )
    assert scene.woven.cloth.size == (20, 320)
    np.testing.assert_array_equal(scene.woven.cloth.drawdown, whole[:320])
    assert image[:, :140].min() > 180  # beside the cloth
    file.write_text("\n".join(to_rows(whole[:800])))
    for word in ("weave.picks=800", "view.camera=front"):
        scene = Scene(values)
        scene.set(word)
        ordered(scene, (160, 160), tmp_path)
        assert scene.woven.cloth.size == (20, 800)
