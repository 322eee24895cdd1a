"""Crimp interchange comes near to a published yarn-level simulation, with one fitted number."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np

SCRIPT = Path(__file__).parent.parent / "benchmarks" / "published_yarns.py"


def test_the_published_table_in_trend() -> None:
    script = runpy.run_path(str(SCRIPT))
    for weave, rows in script["PUBLISHED"].items():
        known, ours = np.array(rows), script["figures"](weave, 0.0563)
        embedded, simulated = known[:, 2:4], known[:, 4:6]
        error = np.sqrt(np.mean((ours[:, :2] - simulated) ** 2))
        assert error < 0.25 * np.sqrt(np.mean((embedded - simulated) ** 2))
        # the pulled yarn gives crimp, the other takes some, in both
        for row, now in zip(known, ours, strict=True):
            pulled = int(row[1] > row[0])
            if row[0] != row[1]:
                assert now[2 + pulled] < 0.85 * script["WEAVES"][weave][2 + pulled]
                assert now[3 - pulled] > script["WEAVES"][weave][3 - pulled]
                assert now[pulled] > now[1 - pulled]
    # what was fitted is the best
    assert script["off"](0.0563) <= min(script["off"](0.045), script["off"](0.07))
