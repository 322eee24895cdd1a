"""Tensile tests of a cloth by its yarns, as kernel, figure and table."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from spacemap_vtk.cli.main import main
from spacemap_vtk.textile.crimp.biaxial import TESTS, simulate_tensile_tests
from spacemap_vtk.textile.crimp.interchange import Interchange, YarnMechanics
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.threads import Threads

ELASTIC = ("--set", "yarns.inextensible=false", "--set", "yarns.tension=50 N")


def run(*arguments: str) -> int:
    with pytest.raises(SystemExit) as done:
        main(("plot", "plain_weave", "--biaxial", "-q", *arguments))
    return int(done.value.code or 0)


def test_a_strip_of_loose_cloth_pulls_where_it_jams(tmp_path: Path) -> None:
    """Hard crossings trade crimp for nothing, until the weft jams at +5.287, -8.991 %."""
    file = tmp_path / "pulled.csv"
    assert run("-o", str(file), *ELASTIC, "--set", "yarns.flattest=1") == 0
    head, *rows = csv.reader(file.read_text().splitlines())
    assert head[0] == "test"
    assert [name for name in TESTS if any(row[0] == name for row in rows)] == list(TESTS)
    strip = np.array([row[1:] for row in rows if row[0] == TESTS[0]], float)
    loose = strip[:, 0] < 0.0528
    assert np.all(strip[loose, 2] < 1e-3)
    assert np.all(strip[~loose, 2] > 1.0)
    assert np.all(strip[:, 3] == 0.0)
    assert strip[-1, 1] == pytest.approx(-0.089910, abs=1e-5)
    # the inextensible curve of Peirce's geometry
    assert np.interp(0.02896, strip[:, 0], strip[:, 1]) == pytest.approx(-0.03640, abs=2e-4)
    both = np.array([row[1:] for row in rows if row[0] == TESTS[2]], float)
    assert both[:, 2] == pytest.approx(both[:, 3], rel=1e-6, abs=1e-6)


def test_straight_yarns_take_their_own_force() -> None:
    """Of 4 yarns a millimetre with EA 50 N, far apart: 50 N * 4 / mm * extension."""
    threads = Threads(diameter=0.01e-3, spacing=0.25e-3)
    cloth = Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads)
    tests = simulate_tensile_tests(
        Interchange(cloth, YarnMechanics((50.0, 50.0), np.inf)), 0.05, 11
    )
    for family in (0, 1):
        strip, both = tests[family], tests[2]
        assert strip.force[family, -1] == pytest.approx(50.0 * 4000.0 * 0.05, rel=0.02)
        assert both.force[family, -1] == pytest.approx(50.0 * 4000.0 * 0.05, rel=0.02)


def test_a_figure_is_drawn_and_yarns_without_stiffness_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "pulled.png"
    assert run("-o", str(file), *ELASTIC, "--set", "yarns.contact=10 N") == 0
    with Image.open(file) as image:
        assert (np.ptp(np.asarray(image.convert("RGB")).astype(int), axis=2) > 60).mean() > 1e-3
    assert run("-o", str(tmp_path / "none.png")) == 2
    assert "yarns.inextensible" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["pulled.png"]
