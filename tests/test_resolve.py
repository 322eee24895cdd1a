"""From drafts and what is asked to a cloth: counts, setts, crimps, thick yarns, intervals."""

from __future__ import annotations

import doctest
import os
from math import inf, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from weaves import changed, measured

from spacemap_vtk import WeaveSource
from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.textile.weave import yarn
from spacemap_vtk.textile.weave.resolve import FILLING, SPACING
from spacemap_vtk.textile.weave.thick_yarns import THICKNESS_SHARE, WIDTH_SHARE
from spacemap_vtk.textile.weave.yarn import parse_yarn_count, yarn_height

MM = 1e-3
REAL = Path(__file__).parents[1] / "scenes" / "32-shaft_twill.wif"


def test_examples() -> None:
    assert doctest.testmod(yarn).failed == 0


# --- yarn counts -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "tex"),
    [
        # published conversions: 1 den = 0.1111 tex, Ne = 590.5 / tex, Nm = 1000 / tex
        ("30 tex", 30.0),
        ("300 dtex", 30.0),
        ("270 den", 30.0),
        ("1 den", 0.1111),
        ("9 den", 1.0),
        ("1 Ne", 590.5),
        ("20 Ne", 29.53),
        ("Ne 30", 19.68),
        ("Ne 30/2", 39.37),
        ("2/30 Ne", 39.37),
        ("40ne", 14.76),
        ("20 Nm", 50.0),
        ("NM 60/2", 33.333),
        ("1e-5 kg/m", 10.0),
    ],
)
def test_yarn_counts_against_published_conversions(text: str, tex: float) -> None:
    assert parse_yarn_count(text) * 1e6 == pytest.approx(tex, rel=3e-4)


@pytest.mark.parametrize("ne", [6, 20, 40, 100])
def test_diameter_is_peirces(ne: float) -> None:
    # Peirce (1937): cotton of a specific volume of 1.1 cm3/g is 1 / (28 sqrt(Ne)) inch (27.93)
    source = WeaveSource(
        warp_count=f"{ne} Ne",
        warp_section="circular",
        fibre_density="1.515151515 g/cm3",
        packing=0.6,
        warp_spacing="1 cm",
    )
    assert source.cloth.warp.diameter == pytest.approx(0.0254 / 28 / sqrt(ne), rel=3e-3)


@pytest.mark.parametrize(
    ("text", "stated"),
    [
        ("30", "out of range"),
        ("0 Ne", "the yarn count must be more than 0"),
        ("20 Ne 3", "unknown unit"),
        ("fine", "must be a number"),
        ("-3 tex", "out of range"),
        (-1, "out of range"),
        (True, "must be a number"),
    ],
)
def test_invalid_yarn_counts_are_refused(text: Any, stated: str) -> None:
    with pytest.raises(InputError, match=rf'warp_count = .*{stated}.*"40 Ne"'):
        WeaveSource(warp_count=text)


def test_a_count_fixes_the_area_of_the_section() -> None:
    area = 30e-6 / (0.6 * 1520)
    for section, factor in (("circular", pi / 4), ("racetrack", 1 + pi / 4), ("elliptic", pi / 2)):
        aspect = 1.0 if section == "circular" else 2.0
        source = WeaveSource(warp_count="30 tex", warp_section=section, warp_aspect=aspect)
        cloth = source.cloth
        assert cloth.warp.diameter**2 * factor == pytest.approx(area, rel=1e-14)
        assert yarn_height(area, aspect, section) == cloth.warp.diameter


def test_setts() -> None:
    cloth = WeaveSource(warp_sett="50 /in", weft_sett="16 /cm").cloth
    assert cloth.warp.spacing == pytest.approx(25.4e-3 / 50, rel=1e-15)
    assert cloth.weft.spacing == pytest.approx(0.625 * MM, rel=1e-15)
    assert WeaveSource(warp_sett=2000).cloth.warp.spacing == 0.5 * MM


# --- asked that exclude each other ----------------------------------------------------------


@pytest.mark.parametrize(
    "asked",
    [
        {"warp_diameter": "0.2 mm", "warp_count": "30 tex"},
        {"weft_count": "30 tex", "weft_diameter": "0.2 mm"},
        {"warp_spacing": "0.5 mm", "warp_sett": "20 /cm"},
        {"weft_spacing": "0.5 mm", "weft_sett": "20 /cm"},
        {"warp_crimp": 0.1, "weft_crimp": 0.1},
        {"warp_crimp_height": "0.2 mm", "weft_crimp": 0.1},
        {"warp_crimp_height": "0.2 mm", "warp_crimp": 0.1},
    ],
)
def test_alternative_parameters_are_refused_together(asked: dict[str, Any]) -> None:
    with pytest.raises(InputError) as caught:
        WeaveSource(**asked).update()
    for name in asked:
        assert name in str(caught.value)


def test_errors_of_a_cloth_name_parameters() -> None:
    with pytest.raises(GeometryError) as caught:
        WeaveSource(warp_diameter="0.4 mm", weft_diameter="0.4 mm").cloth.check()
    assert str(caught.value) == (
        "warp_diameter: the cloth is jammed at every warp_crimp_height: the weft needs at least "
        "0.6245 mm, the warp at most 0.1755 mm; allowed: warp_diameter + weft_diameter up to "
        "0.57735 mm at these spacings, not 0.8 mm. Use thinner yarns or a larger spacing"
    )


# --- crimp -----------------------------------------------------------------------------------


def test_crimp_of_either_family() -> None:
    # published exam figure: d 0.2 and 0.3, c1 = 9 %, p2 = 0.4: h1 = 0.15556, theta1 = 30.570
    yarns = {"warp_diameter": 0.2, "weft_diameter": 0.3, "warp_spacing": 0.6, "weft_spacing": 0.4}
    cloth = WeaveSource(**yarns, warp_crimp="9 %").cloth
    warp, weft = cloth.families
    assert cloth.height == pytest.approx(0.15556, abs=5e-6)
    assert np.degrees(warp.crimp.theta) == pytest.approx(30.570, abs=5e-4)
    again = WeaveSource(**yarns, weft_crimp=float(weft.crimp.crimp)).cloth
    assert again.height == pytest.approx(cloth.height, rel=1e-9)
    with pytest.raises(GeometryError, match=r"warp_crimp = .*: .*allowed: 0 to 0\.\d+"):
        WeaveSource(**yarns, warp_crimp=2).update()


@given(st.floats(0.1, 0.9), st.floats(0.55, 3), st.floats(0.55, 3), st.floats(0, 1))
def test_any_feasible_crimp_is_reached(filling: float, p1: float, p2: float, part: float) -> None:
    yarns = {"warp_diameter": filling / 2, "weft_diameter": (1 - filling) / 2}
    cloth = measured(**yarns, warp_spacing=p1, weft_spacing=p2)
    for number, name in enumerate(("warp_crimp", "weft_crimp")):
        low, high = cloth.feasible_crimps(number)
        crimp = low + part * (high - low)
        found = changed(cloth, **{name: crimp})
        assert float(found.families[number].crimp.crimp) == pytest.approx(crimp, abs=1e-8)


# --- yarn by yarn ----------------------------------------------------------------------------


def test_lists_are_repeated_over_the_yarns() -> None:
    source = WeaveSource(
        ends=5,
        picks=4,
        warp_diameter=["0.2 mm", "0.3 mm"],
        weft_spacing="0.5 mm, 0.6 mm",
        warp_color=["#ff0000", [0, 255, 0], "#0000ff"],
        weft_color=(1, 2, 3),
    )
    cloth = source.cloth
    np.testing.assert_allclose(cloth.warp.diameter, np.array([2, 3, 2, 3, 2]) * 1e-4)
    np.testing.assert_allclose(cloth.weft.spacing, np.array([5, 6, 5]) * 1e-4)
    assert cloth.warp.colors.tolist() == [
        [255, 0, 0],
        [0, 255, 0],
        [0, 0, 255],
        [255, 0, 0],
        [0, 255, 0],
    ]
    assert cloth.weft.colors.tolist() == [[1, 2, 3]] * 4
    source.update()
    assert source.warp_diameter == (0.0002, 0.0003)
    changed = source.GetMTime()
    source.warp_diameter = "0.2 mm, 0.3 mm"
    assert source.GetMTime() == changed
    source.warp_diameter = ["0.2 mm", 0.0002]
    assert source.warp_diameter == 0.0002
    assert source.cloth.warp.diameter == 0.0002


def test_counts_yarn_by_yarn() -> None:
    cloth = WeaveSource(ends=3, warp_count=["30 tex", "15 tex"]).cloth
    thick, thin, again = np.asarray(cloth.warp.diameter)
    assert thick == again
    assert thick / thin == pytest.approx(sqrt(2))


@pytest.mark.parametrize(
    ("value", "stated"),
    [
        (["0.2 mm", "x"], 'value 2, "x": must be a number'),
        ([], "must not be an empty list"),
        ("0.2 mm,", "value 2"),
        ([0.1, -1], "value 2, -1: out of range"),
        ({}, "must not be an empty list"),
    ],
)
def test_a_bad_list_names_the_value(value: Any, stated: str) -> None:
    with pytest.raises(InputError, match=f"warp_diameter = .*{stated}.*repeated over the yarns"):
        WeaveSource(warp_diameter=value)


def wif(tmp_path: Path, *extra: str, threads: int = 4) -> Path:
    """A draft of 4 x 4 with what is in the lines."""
    file = tmp_path / "draft.wif"
    heads = {"WARP": [f"Threads={threads}", "Units=centimeters"]}
    heads |= {"WEFT": ["Threads=4", "Units=centimeters"]}
    lines = ["[WIF]", "Version=1.1", "[WEAVING]", "Shafts=2", "Treadles=2", "Rising Shed=1"]
    sections: dict[str, list[str]] = {}
    for line in extra:
        section, _, text = line.partition(":")
        (heads.get(section) or sections.setdefault(section, [])).append(text)
    for name, body in {**heads, **sections}.items():
        lines += [f"[{name}]", *body]
    lines += ["[THREADING]", *(f"{k}={(k - 1) % 2 + 1}" for k in range(1, threads + 1))]
    lines += ["[TIEUP]", "1=1", "2=2", "[TREADLING]", "1=1", "2=2", "3=1", "4=2"]
    file.write_text("\n".join(lines))
    return file


def test_thread_values_of_a_wif_are_repeated_over_the_yarns(tmp_path: Path) -> None:
    file = wif(
        tmp_path,
        "WARP:Spacing=0.1",
        "WARP:Thickness=0.03",
        "WARP SPACING:2=0.2",
        "WARP THICKNESS:4=0.05",
        "WEFT:Spacing=0.1",
        "WEFT:Thickness=0.04",
    )
    cloth = WeaveSource(draft=file).cloth
    # each thread in the middle of its own space
    np.testing.assert_allclose(cloth.warp.spacing, [1.5 * MM, 1.5 * MM, 1 * MM])
    np.testing.assert_allclose(cloth.warp.diameter, np.array([0.3, 0.3, 0.3, 0.5]) * MM)
    assert (cloth.weft.spacing, cloth.weft.diameter) == (1 * MM, 0.4 * MM)
    wide = WeaveSource(draft=file, ends=7).cloth
    np.testing.assert_allclose(wide.warp.spacing, np.array([1.5, 1.5, 1, 1, 1.5, 1.5]) * MM)
    np.testing.assert_allclose(wide.warp.diameter, np.array([3, 3, 3, 5, 3, 3, 3]) * 0.1 * MM)
    assert not [text for text in wide.warnings if "thick" in text]
    # the user's word comes first
    assert WeaveSource(draft=file, warp_diameter="0.2 mm").cloth.warp.diameter == 0.2 * MM
    WeaveSource(draft=file).update()


def test_a_draft_with_a_thickness_and_no_spacing_lies_side_by_side(tmp_path: Path) -> None:
    file = wif(tmp_path, "WARP:Thickness=0.2")
    cloth = WeaveSource(draft=file, thick_yarns="scale").cloth
    assert cloth.warp.spacing == 2 * MM
    assert cloth.weft.spacing == SPACING
    assert cloth.weft.diameter == FILLING * SPACING


def test_colours_of_the_user_come_before_the_drafts() -> None:
    own = WeaveSource(draft=REAL).cloth.warp.colors
    assert len(np.unique(own, axis=0)) >= 1
    assert (WeaveSource(draft=REAL, warp_color="#010203").cloth.warp.colors == [1, 2, 3]).all()
    np.testing.assert_array_equal(
        WeaveSource(draft=REAL, ends=70).cloth.warp.colors, np.resize(own, (70, 3))
    )


# --- yarns too thick to interlace ------------------------------------------------------------


def test_thick_yarns_are_scaled_to_a_share_of_the_limit() -> None:
    cloth = WeaveSource(draft=REAL, thick_yarns="scale").cloth
    assert isinstance(cloth.warp.spacing, float)
    # jammed square cloth: p / D = sqrt(3) / 2
    limit = 2 / sqrt(3) * cloth.warp.spacing
    assert cloth.diameter_sum == pytest.approx(THICKNESS_SHARE * limit, rel=1e-8)
    (note,) = cloth.warnings
    assert "1.058 mm" in note
    assert "too thick to interlace: " in note
    assert "; drawn " in note
    assert "85%" in note


def test_thick_yarns_are_flattened() -> None:
    cloth = WeaveSource(draft=REAL, thick_yarns="flatten").cloth
    assert cloth.warp.section == cloth.weft.section == "racetrack"
    assert isinstance(cloth.warp.diameter, float)
    width = cloth.warp.aspect * cloth.warp.diameter
    assert width == pytest.approx(WIDTH_SHARE * cloth.warp.spacing)
    # Kemp: p less the flat stands for p, so at the limit (p - width + b) / 2b = sqrt(3) / 2
    limit = (cloth.warp.spacing - width) / (sqrt(3) - 1)
    assert cloth.warp.diameter == pytest.approx(THICKNESS_SHARE * limit, rel=1e-8)
    assert "flattened to 0.9526 mm" in cloth.warnings[0]


def test_yarns_of_cloths_that_change_places_leave_4_percent_open() -> None:
    cloth = WeaveSource(draft=REAL.with_name("double_weave.wif")).cloth
    space = cloth.warp.spacing
    assert cloth.warp.aspect * cloth.warp.diameter == pytest.approx(0.8 * space)
    # A yarn passes between two of the other cloth if 1.05 (d + d) fits into the spacing p less
    # the flat w - d; with w = 0.8 p this gives d.
    assert cloth.warp.diameter == pytest.approx(THICKNESS_SHARE * 0.2 * space / 1.1, rel=1e-8)


def test_thick_yarns_are_refused() -> None:
    with pytest.raises(GeometryError, match='Set thick_yarns to "scale" or "flatten"'):
        WeaveSource(draft=REAL, thick_yarns="refuse").update()
    source = WeaveSource(draft=REAL, thick_yarns="refuse", warp_diameter=3e-4, weft_diameter=3e-4)
    assert source.cloth.warnings == ()


@pytest.mark.parametrize("choice", ["scale", "flatten"])
def test_given_diameters_are_not_changed(choice: str) -> None:
    cloth = WeaveSource(draft=REAL, thick_yarns=choice, warp_diameter="0.3 mm").cloth
    assert cloth.warp.diameter == 0.3 * MM
    assert cloth.warp.section == "circular"
    with pytest.raises(GeometryError):
        WeaveSource(draft=REAL, thick_yarns=choice, warp_diameter="2 mm").update()


@pytest.mark.parametrize("choice", ["scale", "flatten"])
def test_thick_yarns_of_unequal_diameters_are_scaled(choice: str, tmp_path: Path) -> None:
    file = wif(tmp_path, "WARP:Spacing=0.1", "WARP:Thickness=0.1", "WARP THICKNESS:2=0.3")
    source = WeaveSource(draft=file, thick_yarns=choice)
    first, second, *_ = np.asarray(source.cloth.warp.diameter)
    assert second / first == pytest.approx(3)
    source.update()


# --- what is feasible ------------------------------------------------------------------------


def test_feasible_intervals_against_peirces_closed_forms() -> None:
    yarns = {"warp_diameter": 0.3, "weft_diameter": 0.25, "warp_spacing": 0.5, "weft_spacing": 0.52}
    found = WeaveSource(**yarns).feasible
    d, p1, p2 = 0.55, 0.5, 0.52
    low, high = sqrt(d * d - p1 * p1), d - sqrt(d * d - p2 * p2)
    assert found["warp_crimp_height"] == pytest.approx((low, high))
    limit = sqrt((p1**2 + p2**2 + 2 * sqrt(p1**4 - (p1 * p2) ** 2 + p2**4)) / 3)
    assert found["warp_diameter"] == pytest.approx((0, limit - 0.25), rel=1e-9)
    assert found["weft_diameter"] == pytest.approx((0, limit - 0.3), rel=1e-9)
    assert found["warp_spacing"] == (pytest.approx(sqrt(d * d - high * high), rel=1e-9), inf)
    fixed = WeaveSource(**yarns, warp_crimp_height=0.3).feasible
    assert fixed["warp_crimp_height"] == pytest.approx((low, high))
    # D from h1 on, and until warp or weft jams
    most = min(0.5 * (p2**2 / 0.3 + 0.3), sqrt(p1**2 + 0.09))
    assert fixed["warp_diameter"] == pytest.approx((0.05, most - 0.25), rel=1e-9)
    assert fixed["weft_spacing"] == (pytest.approx(sqrt(0.3 * (2 * d - 0.3)), rel=1e-9), inf)


@given(
    st.floats(0.05, 2),
    st.floats(0.05, 2),
    st.sampled_from([{}, {"warp_crimp_height": 0.1}, {"weft_crimp": 0.05}]),
    st.sampled_from(["circular", "racetrack"]),
)
def test_accepted_values_are_those_of_the_feasible_intervals(
    d1: float, d2: float, crimp: dict[str, float], section: str
) -> None:
    values = {"warp_diameter": d1, "weft_diameter": d2, "warp_spacing": 1.0, "weft_spacing": 1.2}
    source = WeaveSource(**values, **crimp, warp_section=section)
    for name, (low, high) in source.feasible.items():
        if "crimp" in name:
            others: dict[str, Any] = dict.fromkeys(crimp)
        else:
            others = {}
        for value, good in ((low, low > 0), (high, high < inf), (high * 1.001 + 1e-9, False)):
            if not 0 < value < inf:
                continue
            made = WeaveSource(**{**source.settings, **others, name: value})
            if good:
                made.cloth.check()
            else:
                with pytest.raises(GeometryError):
                    made.cloth.check()


def test_feasible_intervals_exist_for_impossible_values() -> None:
    found = WeaveSource(warp_diameter="0.7 mm").feasible
    assert found["warp_diameter"][1] == pytest.approx((1 / sqrt(3) - 0.25) * MM, rel=1e-9)
    assert "warp_crimp_height" not in found
    assert "warp_diameter" not in WeaveSource(warp_diameter=[1e-4, 2e-4]).feasible


def test_feasible_reports_an_unreadable_draft(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none.wif\": no such file"):
        WeaveSource(draft=tmp_path / "none.wif").feasible  # noqa: B018


def test_a_draft_is_read_once_until_it_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import spacemap_vtk.filters.weave_source as module

    reads = []
    real = module.read_draft
    monkeypatch.setattr(module, "read_draft", lambda *given: reads.append(1) or real(*given))
    file = wif(tmp_path)
    source = WeaveSource(draft=file)
    first = source.cloth
    assert source.cloth is first
    source.update()
    assert len(reads) == 1
    source.ends = 6
    assert source.cloth.drawdown.shape == (4, 6)
    assert len(reads) == 1
    os.utime(file, ns=(0, 0))
    assert source.cloth.drawdown.shape == (4, 6)
    assert len(reads) == 2
