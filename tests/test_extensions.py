"""Another package adds a format, a stage, a job and commands; the core needs no optional part."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from test_layers import OPTIONAL

ROOT = Path(__file__).parents[1]
FILES = {
    "alphabet/__init__.py": "",
    "alphabet/files.py": """
from spacemap_vtk.io.registry import reads, writes

@reads(".abc", label="Alphabet", holds="mesh")
def read_abc(path):
    import pyvista as pv
    return pv.Sphere(radius=float(path.read_text()))

@writes(".abc", label="Alphabet", holds=("surface",))
def write_abc(file, surface):
    file.write_text(f"{surface.GetLength() / 2}\\n")
""",
    "alphabet/stages.py": """
from spacemap_vtk.datasets.arrays import add_array, points_of
from spacemap_vtk.filters.base import ProvidedArray, Stage
from spacemap_vtk.parameters import Real

class Lift(Stage):
    \"\"\"Lift a cage, in place of a motion.\"\"\"

    section = "lift"
    role = "mover"
    inputs = ("vtkUnstructuredGrid",)
    takes = ("cage",)
    makes = "cage"
    provides = {"displacement": ProvidedArray("point", "m")}

    height = Real(1e-3, "How far it is lifted.", unit="m")

    def run(self, inputs, output, time):
        output.ShallowCopy(inputs[0])
        lifted = 0.0 * points_of(output)
        lifted[:, 2] = self.height
        add_array(output.GetPointData(), "displacement", lifted)
""",
    "alphabet/commands.py": """
def spell(word: str, /) -> None:
    \"\"\"Spell a word.\"\"\"
    print(*word, sep="-")

def recite(scene: str, output: str, /) -> None:
    \"\"\"Write a scene as a poem.\"\"\"
    from pathlib import Path
    from spacemap_vtk.jobs import make_job
    from spacemap_vtk.scenes.scene import Scene
    print(make_job("poem", Path(output)).run(Scene.read(scene)))
""",
    "alphabet/poems.py": """
from dataclasses import dataclass
from pathlib import Path
from spacemap_vtk.jobs.job import Job, register

@register()
@dataclass
class PoemJob(Job):
    output: Path
    kind = "poem"
    command = "recite"

    def write(self, context):
        with self.open_output(context.atomic) as file:
            file.write_text(context.scene.title)
        return "a poem"
""",
    "alphabet-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: alphabet\nVersion: 1.0\n",
    "alphabet-1.0.dist-info/entry_points.txt": """
[spacemap_vtk.commands]
spell = alphabet.commands:spell
recite = alphabet.commands:recite
[spacemap_vtk.jobs]
poem = alphabet.poems:PoemJob
[spacemap_vtk.formats]
abc = alphabet.files
[spacemap_vtk.stages]
Lift = alphabet.stages:Lift
""",
}


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """Return a folder for PYTHONPATH with another package installed in it."""
    for name, text in FILES.items():
        file = tmp_path / "site" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return tmp_path / "site"


#: Runs commands one after another, as most take less time than a process takes to start; a line of
#: JSON has the exit status and the text of each.
_RUN = """
import contextlib, io, json, sys
done = []
for words in json.loads(sys.argv[1]):
    text = io.StringIO()
    with contextlib.redirect_stdout(text), contextlib.redirect_stderr(text):
        try:
            from spacemap_vtk.cli.main import main
            main(words)
        except SystemExit as ended:
            done.append((ended.code, text.getvalue()))
print(json.dumps(done))
"""


def run(
    *commands: str, path: list[Path], folder: Path, code: str = "pass"
) -> list[tuple[int, str]]:
    """Run commands of the program; return the exit status of each and what it printed."""
    words = json.dumps([shlex.split(command) for command in commands])
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\n{_RUN}", words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, path))},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return [(code, text) for code, text in json.loads(done.stdout)]


def test_package_adds_a_member_to_each_group(installed: Path, tmp_path: Path) -> None:
    few = "--set weave.ends=3 --set weave.picks=3 --set cage.divisions=[2,2,1] --set modal.modes=6"
    lifted = f"export plain_weave -q {few} --set lift.height=2mm -o"
    commands = ("--help", "spell yarn", "recite plain_weave poem.txt", "keys lift")
    commands += (f"{lifted} a.abc", "info a.abc", f"{lifted} a.vtu")
    found = run(*commands, path=[installed, ROOT], folder=tmp_path)
    assert [status for status, _ in found] == [0] * len(commands), found
    text, spelled, recited, keys, _, told, _ = (text for _, text in found)
    shown = " ".join(text.split())
    assert "spell Spell a word." in shown
    assert "serve Show a scene in a browser, with its motion and parameters." in shown
    assert spelled == "y-a-r-n\n"
    assert recited == "a poem\n"
    assert (tmp_path / "poem.txt").read_text().startswith("Plain weave")
    assert "How far it is lifted" in keys
    assert float((tmp_path / "a.abc").read_text()) > 0
    assert "vtkPolyData" in told
    moved = pv.read(tmp_path / "a.vtu")["displacement"][:, 2]
    np.testing.assert_allclose(moved, 0.002, rtol=1e-6)


def test_package_that_cannot_be_loaded_is_named_and_ignored(
    installed: Path, tmp_path: Path
) -> None:
    (installed / "alphabet/files.py").write_text("import no_such_module")
    ((status, text),) = run("scenes", path=[installed, ROOT], folder=tmp_path)
    assert status == 0
    assert "plain_weave" in text
    assert "the package alphabet is ignored: cannot load alphabet.files" in text
    assert "No module named 'no_such_module'" in text


def test_core_runs_without_its_optional_parts(tmp_path: Path) -> None:
    for folder in ("spacemap_vtk", "scenes"):
        ignored = shutil.ignore_patterns("*.pyc.*")
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=ignored)
    for root in (root for roots in OPTIONAL.values() for root in roots):
        place = tmp_path.joinpath(*root.split("."))
        if place.is_dir():
            shutil.rmtree(place)
        else:
            place.with_suffix(".py").unlink()

    export = "export plain_weave -q --set weave.ends=3 --set weave.picks=3"
    commands = ("--help", "render satin_5_2 -q -o a.png --size 80x60", f"{export} -o a.vtu")
    unknown = ("a.usdc", "a.dtx")
    commands += tuple(f"{export} -o {name}" for name in unknown)
    commands += (f"{export} -o a.vtp --set warp.smooth=true",)
    code = "from spacemap_vtk import extensions; extensions.BUILT_IN.clear()"
    shown, drawn, written, *refused, smooth = run(
        *commands, path=[tmp_path], folder=tmp_path, code=code
    )
    assert shown[0] == 0
    assert "serve" not in shown[1]
    assert drawn == written == (0, "")
    for status, text in refused:
        assert status == 2
        assert "unsupported format" in text
    assert smooth[0] == 1
    assert 'no installed package provides "smooth" in its maps' in smooth[1]
