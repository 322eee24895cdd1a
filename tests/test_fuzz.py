"""A sample of the runs of fuzz.py, with changes chosen and minimised by hypothesis."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import fuzz
import fuzz_seeds
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spacemap_vtk.workers import WORKER_VARIABLE

#: Targets that need neither VTK's readers nor a scene.
QUICK = (".wif", ".dtx", ".wpo", ".txt", ".twa", "picture", "table", "modes")
RECORD = Path(__file__).with_name("fuzz.toml")
STEP = st.tuples(st.integers(0, 255), st.integers(0, 2**40 - 1), st.integers(0, 2**30 - 1))


@pytest.fixture(scope="module")
def folder() -> Path:
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


@given(st.sampled_from(QUICK), st.integers(0, 99), st.lists(STEP, min_size=1, max_size=6))
def test_a_damaged_file_is_read_or_refused_with_one_line(
    folder: Path, name: str, number: int, steps: list[fuzz_seeds.Step]
) -> None:
    target = fuzz.targets()[name]
    seed, other = (target.seeds[each % len(target.seeds)] for each in (number, number + 1))
    data = fuzz_seeds.changed(seed, steps, target.words, other)
    assert fuzz.fault(target, data, folder)[1] is None


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("names", "runs"),
    [
        (("scene", "set", *QUICK, "texture", "record.html", "convert.wif"), 2000),
        ((".ply", ".stl", ".obj", ".vtk", ".vtu", ".glb", ".vtkhdf", ".e", "motion.pvd"), 200),
    ],
)
def test_a_sample_of_runs_finds_no_fault(tmp_path: Path, names: tuple[str, ...], runs: int) -> None:
    words = [sys.executable, fuzz.__file__, *names, f"--runs={runs}", "--seed=7"]
    done = subprocess.run([*words, f"--keep={tmp_path}"], capture_output=True, text=True)
    campaigns = tomllib.loads(f"campaigns = [{done.stdout}]")["campaigns"]
    assert [each["target"] for each in campaigns] == list(names), done.stderr
    assert [each["found"] for each in campaigns] == [0] * len(names), list(tmp_path.glob("found*"))


def test_every_seed_is_read(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A seed that is refused would hide the faults of all its variants."""
    monkeypatch.setenv(WORKER_VARIABLE, "1")  # seeds are valid files
    for number, target in enumerate(each for each in fuzz.targets().values() if each.tried):
        folder = tmp_path / str(number)
        folder.mkdir()
        fuzz.write_companions(folder)
        for seed in target.seeds:
            assert len(seed) < fuzz_seeds.LONGEST, target.name
            target.read(seed, folder)


def test_a_million_runs_are_recorded() -> None:
    record = tomllib.loads(RECORD.read_text(encoding="utf-8"))
    campaigns = record["campaigns"]
    assert sum(each["runs"] for each in campaigns) == record["runs"] >= 1_000_000
    assert {each["target"] for each in campaigns} <= fuzz.targets().keys()
    assert {"atheris", "steps"} == {each["by"] for each in campaigns}
