"""Where a scene's models are valid, and what its last update found of it."""

from __future__ import annotations

import math
from typing import Any

from spacemap_vtk.applicability import Finding
from spacemap_vtk.scenes.scene import Scene


def collect_findings(scene: Scene, motion: dict[str, Any] | None = None) -> list[Finding]:
    """Return what the stages of a scene found in their last runs, the worst value of each limit."""
    # Rotations of a linear motion are the largest of all times, if its figures are given.
    worst: dict[str, Finding] = {}
    for stage in scene.stages:
        for found in stage.findings:
            former = worst.get(found.key)
            if former is None or (found.value or 0.0) > (former.value or 0.0):
                worst[found.key] = found
    if motion is not None:
        angle = math.radians(motion["largest_rotation_deg"])
        for key in ("rotation", "swing"):
            if key in worst:
                worst[key] = Finding(key, angle)
    return list(worst.values())


def describe_finding(finding: Finding) -> tuple[str, str, str]:
    """Return what must hold, up to which value, and the value that was found, as texts."""
    limit = finding.limit
    if not limit.quantity:
        return f"[{limit.stage}] assumed: {limit.assumes}", "", ""
    found = "–" if finding.value is None else limit.format(finding.value)
    if finding.is_valid is False:
        found += ", beyond"
    return f"[{limit.stage}] {limit.quantity}", limit.format(limit.most), found
