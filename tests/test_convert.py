"""The command ``convert``, and trimming the edges of drafts."""

import json
from pathlib import Path

import numpy as np
import pytest

from spacemap_vtk.cli.main import main
from spacemap_vtk.io.drafts.wif import read_wif

REAL = Path(__file__).parent.parent / "scenes" / "32-shaft_twill.wif"
#: A draft of 1200 x 1200 threads of which 6 ends and 4 picks are woven.
WIDE = """[WIF]
Version=1.1
[WEAVING]
Shafts=2
Treadles=2
Rising Shed=true
[COLOR PALETTE]
Range=0,255
[COLOR TABLE]
1=255,0,0
[WARP]
Threads=1200
Color=1
[WEFT]
Threads=1200
Color=1
[THREADING]
1=1
2=2
3=1
4=2
5=1
6=1
[TIEUP]
1=1
2=2
[TREADLING]
1=1
2=2
3=1
4=2
"""


def run(*words: str) -> int:
    with pytest.raises(SystemExit) as done:
        main(words)
    return int(done.value.code or 0)


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert run(*words) == 2
    printed = capsys.readouterr().err
    assert len(printed.splitlines()) == 1
    return printed


def test_drafts_are_converted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second, third = (tmp_path / name for name in ("a.dtx", "b.wif", "c.txt"))
    real = REAL
    assert run("convert", str(real), str(first)) == 0
    assert "is rounded to units of 0.53 mm" in capsys.readouterr().err
    assert run("convert", str(first), str(second)) == 0
    assert capsys.readouterr().err == ""
    np.testing.assert_array_equal(read_wif(second).drawdown, read_wif(real).drawdown)
    assert read_wif(second).loom == read_wif(real).loom
    assert run("convert", str(second), str(third)) == 0
    assert "store only the drawdown: no threading" in capsys.readouterr().err
    assert run("convert", str(third), str(second), "-q") == 0
    np.testing.assert_array_equal(read_wif(second).drawdown, read_wif(real).drawdown)
    before = second.read_bytes()
    assert "a.toml: not a draft" in refused(capsys, "convert", "a.toml", str(second))
    first.write_text("@@StartDTX\n")
    assert "the file has no Threading" in refused(capsys, "convert", str(first), str(second))
    assert 'unsupported format ".png"' in refused(capsys, "convert", str(real), "a.png")
    assert second.read_bytes() == before


def test_a_warning_offers_to_trim_unwoven_edges(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, cut = tmp_path / "wide.wif", tmp_path / "cut.wif"
    file.write_text(WIDE)
    assert run("validate", str(file)) == 0
    printed = capsys.readouterr().err
    assert "only 6 x 4 of 1200 x 1200 yarns are woven" in printed
    assert "weave.trim" in printed
    assert run("validate", str(file), "--set", "weave.trim=true") == 0
    assert "1200" not in capsys.readouterr().err
    trim = ["--set", "weave.trim=true"]
    assert run("info", str(file), "--json", "-q", *trim) == 0
    assert json.loads(capsys.readouterr().out)["drawdown"] == ["101011", "010100"] * 2
    assert run("convert", str(file), str(cut), "--trim", "-q") == 0
    assert read_wif(cut).drawdown.shape == (4, 6)
    assert run("export", str(file), "-o", str(file.with_name("b.wif")), "-q", *trim) == 0
    # An exported draft also has its record, after the draft.
    assert file.with_name("b.wif").read_bytes().startswith(cut.read_bytes())
