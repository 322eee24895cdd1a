"""Knits whose sides are joined to a tube, and mandrels that are drawn."""

from __future__ import annotations

import math

import numpy as np
import pytest

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.textiles.braid import Braid
from spacemap_vtk.filters.textiles.knit import Knit


def test_courses_of_a_tube_are_rings_round_it_with_the_face_outside():
    sleeve = Knit(edges="joined", wales=24, courses=3, diameter=1e-3)
    found = {figure.key: figure.value for figure in sleeve.all_figures()}
    round_ = 24 * found["wale_spacing"]
    assert found["tube_diameter"] == pytest.approx(round_ / math.pi, rel=0.02)
    assert found["largest_overlap"] < 0.005
    flat = sleeve.rest().yarns[0].points
    for ring in sleeve.lines():
        np.testing.assert_allclose(ring[-3:], ring[:3], atol=1e-12)
        turns = np.unwrap(np.arctan2(ring[:-3, 0], ring[:-3, 2]))
        assert abs(turns[-1] - turns[0]) == pytest.approx(2 * math.pi, rel=0.05)
        away = np.hypot(ring[:, 0], ring[:, 2]) / 1e-3
        # All repeats are alike, and what lies on the face of the flat knit lies outside.
        np.testing.assert_allclose(away[: len(flat)], away[len(flat) : 2 * len(flat)], atol=1e-9)
        assert np.corrcoef(away[: len(flat)], flat[:, 2])[0, 1] > 0.99
    low, *_, high = (ring[:-3, 1].mean() for ring in sleeve.lines())
    assert (high - low) / 2 == pytest.approx(found["course_spacing"], rel=0.03)


def test_repeats_that_close_no_tube_are_refused():
    for wales in (25, 4):
        with pytest.raises(InputError, match="close a tube"):
            Knit(rows="rib 1x1", edges="joined", wales=wales).lines()
    with pytest.raises(InputError, match="no sheet"):
        Knit(edges="joined", wales=24).cell_of_sheet()


def test_a_mandrel_lies_in_its_braid():
    tube = Braid(carriers=8, mandrel=2e-3, diameter=5e-4, braid_angle=40.0, draw_mandrel=True)
    *carriers, mandrel = tube.lines()
    assert len(carriers) == 8
    assert not mandrel[:, [0, 2]].any()
    assert tube.line_diameters[-1] == 2e-3
    assert len(tube.line_colors) == len(tube.line_families) == 9
    assert mandrel[:, 1].min() < min(line[:, 1].min() for line in carriers)
    assert len(Braid(carriers=8, draw_mandrel=False).line_families) == 8
