"""A command imports only what it needs, because imports take most of its start."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

from spacemap_vtk.draw.actors.contact_shadows import STRIP, blur, contact_shadows
from spacemap_vtk.draw.graphics import prepare_offscreen

#: Modules that take at least a tenth of a second to import.
_HEAVY = (
    "numpy",
    "scipy",
    "vtkmodules.vtkCommonExecutionModel",
    "vtkmodules.vtkRenderingCore",
    "pyvista",
    "matplotlib",
    "PySide6",
    "tomlkit",
)
_KERNELS = {"numpy"}
_FILTERS = {*_KERNELS, "vtkmodules.vtkCommonExecutionModel"}
_PICTURES = {*_FILTERS, "vtkmodules.vtkRenderingCore"}


def _imported(cache: Path, *commands: str) -> set[str]:
    """Return the modules that some commands import, one command after another."""
    code = (
        "import sys\n"
        "from spacemap_vtk.cli.main import main\n"
        "for command in sys.argv[1:]:\n"
        "    try: main(command.split())\n"
        "    except SystemExit as ended: assert ended.code == 0\n"
        "print(*sys.modules, file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *commands],
        capture_output=True,
        text=True,
        check=True,
        cwd=cache,
        env={**os.environ, "SPACEMAP_CACHE": str(cache / "kept")},
    )
    return set(done.stderr.splitlines()[-1].split())


@pytest.mark.parametrize(
    ("commands", "needs"),
    [
        (["--help", "render --help", "scenes"], set()),
        (["materials"], _KERNELS),
        (["keys view", "validate plain_weave -q", "export plain_weave -q -o a.wif"], _FILTERS),
        (["info plain_weave -q --json"], {*_FILTERS, "scipy"}),
    ],
)
def test_a_command_imports_only_what_it_needs(
    commands: list[str], needs: set[str], tmp_path: Path
) -> None:
    assert _imported(tmp_path, *commands) & set(_HEAVY) == needs


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a cache folder with the modes that the commands below need."""
    folder = tmp_path_factory.mktemp("solved")
    (folder / "small.toml").write_text(
        "weave = { ends = 3, picks = 3 }\ncage = { divisions = [2, 2, 1] }\n"
        "modal = { modes = 100 }\nresponse = { gravity = [0.0, 0.0, -9.8] }\n"
    )
    assert "scipy" in _imported(folder, "export small.toml -q -o a.vtu")
    return folder


@pytest.mark.parametrize(
    ("commands", "needs"),
    [
        pytest.param(
            [
                "render small.toml -q -o a.png --set view.size=[64,48]",
                "animate small.toml -q -o a.gif --size 64x48 --set animation.stop=0.01",
                "modes small.toml -q --plot a.png",
            ],
            _PICTURES,
            marks=pytest.mark.nightly,
        ),
        (
            [
                "export small.toml -q -o a.vtu",
                "export small.toml -q -o a.stl",
                "modes small.toml -q --json --no-errors",
            ],
            _FILTERS,
        ),
        pytest.param(
            ["plot small.toml -q -o a.png"],
            {*_FILTERS, "matplotlib"},
            marks=pytest.mark.nightly,
        ),
    ],
)
def test_with_cached_modes_a_command_imports_only_what_it_needs(
    commands: list[str], needs: set[str], solved: Path
) -> None:
    if needs == _PICTURES:
        prepare_offscreen()  # what draws without OpenGL is compiled, by a library that takes SciPy
    imported = _imported(solved, *commands)
    assert imported & set(_HEAVY) == needs
    # The progress bar is shown only in a terminal.
    assert not {"rich.progress", "psutil"} & imported


def test_the_blur_equals_scipys() -> None:
    image = np.random.default_rng(1).random((3 * STRIP // 2, 2 * STRIP + 1), dtype=np.float32)
    for sigma in (0.7, 3.3, 21.8):
        known = ndimage.gaussian_filter(image, sigma, mode="nearest", truncate=2.5)
        np.testing.assert_array_equal(blur(image, sigma), known)


def test_shades_refuse_strips() -> None:
    rows, columns = np.mgrid[: 2 * STRIP + 8, : STRIP + 4]
    depth = (1.0 + 1e-3 * np.sin(rows / 9) * np.cos(columns / 7)).astype(np.float32)
    depth[rows < columns / 3] = np.nan
    shade = contact_shadows(depth, 1e-3, 12.0)
    # The strips of a surface seen from its other side end elsewhere.
    np.testing.assert_allclose(shade[::-1], contact_shadows(depth[::-1], 1e-3, 12.0), atol=1e-3)
    assert shade[np.isnan(depth)].min() == 1.0
    assert shade.min() < 0.9
    # A picture of twice the size is as dark, because it is reduced further before the blur.
    shade = contact_shadows(depth, 1e-3, 36.0)
    large = contact_shadows(np.kron(depth, np.ones((2, 2), np.float32)), 1e-3, 72.0)
    np.testing.assert_allclose(large[::2, ::2], shade, atol=0.03)
