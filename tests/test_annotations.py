"""Annotations have correct lengths and are drawn over the cloth."""

from __future__ import annotations

import numpy as np
import pytest

from spacemap_vtk.draw.annotate.annotations import Annotations
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.scenes.scene import Scene

#: Of letters and of the bar.
INK = (28, 33, 41)


def test_scale_bar_and_axes_agree_with_the_picture(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    written: dict[int, str] = {}
    write = Annotations._write

    def noting(self, number, words, place):
        written[number] = words
        write(self, number, words, place)

    monkeypatch.setattr(Annotations, "_write", noting)
    view = {"camera": "face", "background": "#ffffff", "background_top": "#ffffff"}
    weave = {"ends": 8, "picks": 6, "warp_spacing": "0.5 mm", "weft_spacing": "0.5 mm"}
    bare, signed = (
        Scene({"weave": weave, "view": {**view, "scale_bar": signs, "triad": signs}})
        for signs in (False, True)
    )
    images = []
    for scene in (bare, signed):
        picture = Picture(scene, [0.0], (640, 480))
        images.append(picture.draw(0.0).astype(int))
        picture.close()
    # The picks reach half a spacing past the last end on either side.
    across = np.flatnonzero((images[0] < 250).any(axis=(0, 2)))
    per_metre = (across[-1] - across[0] + 1) / (8 * 0.5e-3)
    # A row of the bar is the longest run of ink; a plate has made all else near it light.
    near = (np.abs(images[1] - INK).max(axis=2) < 12)[-60:]
    runs = [max(map(len, "".join(".#"[int(p)] for p in row).split("."))) for row in near]
    number, unit = written[0].split()
    assert unit == "mm"
    assert max(runs) / per_metre == pytest.approx(1e-3 * float(number), abs=1.5 / per_metre)
    assert (written[2], written[3], written[4]) == ("x", "y", "z")
    assert (images[0] == images[1])[:300].all()
