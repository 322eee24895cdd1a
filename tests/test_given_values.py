"""A given value counts as given, also where it equals the default."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from spacemap_vtk import ModalResponse
from spacemap_vtk.errors import InputError
from spacemap_vtk.parameters import Parameter
from spacemap_vtk.scenes.pipeline import section_classes
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.scene_record import scene_values

AUTOMATIC = [
    (section, name, parameter)
    for section, cls in section_classes().items()
    for name, parameter in cls.parameters.items()
    if parameter.automatic
]
#: Automatic for objects alone: of cloth they have a value of their own.
OF_OBJECTS = [each for each in AUTOMATIC if each[2].default is not None]


def test_default_of_automatic_parameters_is_none() -> None:
    assert {name for _, name, _ in OF_OBJECTS} == {"camera", "divisions", "fixed", "youngs_modulus"}
    assert len(AUTOMATIC) > 40


@pytest.mark.parametrize(("section", "name", "parameter"), OF_OBJECTS)
def test_default_for_cloth_counts_as_given_for_an_object(
    section: str, name: str, parameter: Parameter[Any]
) -> None:
    scene = Scene({"object": {}, section: {name: parameter.default}})
    assert getattr(scene.parts[section], name) == parameter.default
    assert getattr(Scene({"object": {}}).parts[section], name) is None


@pytest.mark.parametrize(
    "damping", [{"damping_ratio": 0.05}, {"damping_pairs": [[1, 0.1], [9, 0.1]]}]
)
@pytest.mark.parametrize("alpha", [1.0, 2.0])
def test_two_kinds_of_damping_contradict(damping: dict[str, Any], alpha: float) -> None:
    for response in (
        ModalResponse(alpha=alpha, **damping),
        Scene({"response": {"alpha": alpha, **damping}}).response,
    ):
        with pytest.raises(InputError, match="alpha both define the damping"):
            response.check()
    ModalResponse(**damping).check()
    assert ModalResponse().damping.alpha == 1.0


def test_given_value_without_effect_is_reported() -> None:
    weave = {"ends": 2, "picks": 2}
    for modulus in ("1 MPa", "2 MPa"):
        modal = {"material": "denim", "youngs_modulus": modulus, "modes": 2}
        scene = Scene({"weave": weave, "cage": {"divisions": [1, 1, 1]}, "modal": modal})
        scene.update()
        assert any("modal.youngs_modulus has no effect" in text for text in scene.warnings)


def test_pattern_replaced_by_a_draft_is_reported(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("1100\n0110\n")
    for pattern, stated in (({"pattern": "plain"}, True), ({}, False)):
        scene = Scene({"weave": {"draft": str(tmp_path / "a.txt"), **pattern}})
        scene.update()
        assert any("weave.pattern has no effect" in text for text in scene.warnings) == stated


def test_given_gravity_is_kept_in_records_and_copies() -> None:
    values = {"modal": {"gravity": [0, -9.80665, 0]}, "response": {"gravity": [0, 0, "-1 g"]}}
    scene = Scene(values)
    down = (0.0, 0.0, -9.80665)
    assert Scene(scene_values(scene)).response.gravity == down
    copy = Scene({})
    copy.apply_settings(scene.settings, scene.given_sections)
    assert copy.response.gravity == down
    assert "gravity" not in scene_values(Scene({"response": {}}))["response"]


def test_given_style_keeps_its_background_in_a_dark_window() -> None:
    usual = Scene({}).view
    assert usual.for_window(dark=True).background is not None
    given = Scene({"view": {"style": usual.style}}).view
    assert given.for_window(dark=True) is given
