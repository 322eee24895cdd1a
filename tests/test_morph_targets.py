"""Few shapes of which a motion is a sum."""

from __future__ import annotations

import numpy as np
import pytest

from spacemap_vtk.embedding.morph_targets import find_morph_targets


@pytest.mark.parametrize(("tolerance", "count"), [(2.0, 0), (0.2, 1), (0.011, 2), (1e-12, 3)])
def test_number_of_terms_follows_the_tolerance(tolerance: float, count: int) -> None:
    # a Fourier series is its own decomposition: a point moves by sin t, another by 0.1 sin 2t ...
    times = 2 * np.pi * np.arange(64) / 64
    motion = np.zeros((64, 3, 3))
    for k, size in enumerate((1.0, 0.1, 0.01)):
        motion[:, k, k] = size * np.sin((k + 1) * times)
    found = find_morph_targets(motion, tolerance)
    assert found.weights.shape == (64, count)
    made = np.tensordot(found.weights, found.shapes, 1)
    assert np.linalg.norm(made - motion, axis=2).max() == pytest.approx(found.error, abs=1e-15)
    assert found.error <= tolerance
    np.testing.assert_allclose(np.abs(found.weights).max(axis=0), 1.0)
    sizes = np.linalg.norm(found.shapes, axis=2).max(axis=1)
    np.testing.assert_allclose(sizes, (1.0, 0.1, 0.01)[:count])


def test_points_inside_meet_the_tolerance_of_the_cage() -> None:
    rng = np.random.default_rng(0)
    motion = rng.standard_normal((40, 4, 3)).cumsum(axis=0)
    found = find_morph_targets(motion, 2.0)
    assert 0 < len(found.shapes) < 12
    inside = rng.dirichlet(np.ones(4), 500)
    off = inside @ (np.tensordot(found.weights, found.shapes, 1) - motion)
    assert 0.5 * found.error < np.linalg.norm(off, axis=2).max() <= found.error <= 2.0
