"""Double weaves are found, and nothing else is taken for one."""

import doctest
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from spacemap_vtk.fabric import double_weave, patterns
from spacemap_vtk.fabric.double_weave import upper_cloth
from spacemap_vtk.fabric.drawdown import rows, tile
from spacemap_vtk.scenes.scene import Scene


def two_cloths(above: NDArray[np.bool_], weave: NDArray[np.bool_], first: int) -> NDArray[np.bool_]:
    """Weave two cloths crossing by crossing, from what lies above what."""
    picks, ends = (2 * size for size in above.shape)
    found = np.zeros((picks, ends), dtype=bool)
    for pick in range(picks):
        for end in range(ends):
            of_first = end % 2 == 0, (pick % 2 == 0) == (first == 0)
            if of_first[0] == of_first[1]:
                found[pick, end] = weave[pick // 2 % len(weave), end // 2 % weave.shape[1]]
            else:
                found[pick, end] = above[pick // 2, end // 2] == of_first[0]
    return found


def blocks(size: int) -> NDArray[np.bool_]:
    row, column = np.indices((24, 20)) // size
    return (row + column) % 2 == 0


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("size", [4, 6, 100])
@pytest.mark.parametrize("weave", [patterns.plain(2, 2), patterns.twill(2, 2)])
def test_two_cloths_are_found(weave: NDArray[np.bool_], size: int, first: int) -> None:
    above = blocks(size)
    found = upper_cloth(two_cloths(above, weave, first))
    assert found is not None
    np.testing.assert_array_equal(found, above)


def test_one_cloth_is_one() -> None:
    for weave in (
        patterns.plain(2, 2),
        patterns.twill(2, 2),
        patterns.twill(3, 1),
        patterns.satin(8, 3),
        patterns.basket(2),
        patterns.rib(2),
        patterns.rib(1),
        np.ones((4, 4), dtype=bool),
    ):
        for turned in (weave, weave.T, ~weave):
            for ends in (32, 33, 2, 3):
                assert upper_cloth(tile(turned, ends, 40)) is None
    random = np.random.default_rng(1)
    for _ in range(200):
        assert upper_cloth(random.random((8, 8)) < 0.5) is None


def test_a_draft_of_two_cloths_says_so(tmp_path: Path) -> None:
    file = tmp_path / "double.txt"
    file.write_text("\n".join(rows(two_cloths(blocks(6), patterns.plain(2, 2), 0))))
    scene = Scene({"weave": {"draft": str(file)}})
    assert "double weave" in scene.draft.warnings[-1]
    assert any("double weave" in text for text in scene.warnings)


def test_examples() -> None:
    assert doctest.testmod(double_weave).failed == 0
