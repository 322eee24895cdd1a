"""Tetrahedralise the inside of a surface by fTetWild, with a cache.

Y. Hu, T. Schneider, B. Wang, D. Zorin, D. Panozzo, "Fast Tetrahedral Meshing in the Wild", ACM
Trans. Graph. 39 (2020). It accepts any triangles, also open and self-intersecting ones, and
produces a different mesh at each run. So a finished mesh is kept in the user's cache folder, under
a hash of surface and parameters.

It runs in a process of its own, because it writes a file into the working folder, which must not be
the user's, and because a crash on a difficult surface must become a message.
"""

from __future__ import annotations

import hashlib
import importlib.util
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk import cache, cancel
from spacemap_vtk.errors import GeometryError, MissingLibraryError
from spacemap_vtk.ndarrays import Floats, Ints
from spacemap_vtk.temporary_files import delay_signals, temporary_folder

#: Largest distance of the mesh from the surface, as a share of the diagonal. fTetWild's default of
#: 1e-3 makes ten times as many tetrahedra near flat faces as a cage needs.
EPSILON = 4e-3

#: Seconds between two looks at the process, and at whether the work is cancelled.
_POLL_INTERVAL = 0.05

#: Program of the child process. It skips pytetwild's accessor, because importing PyVista takes as
#: long as filling a small surface.
_PROGRAM = """
import sys, types
sys.modules["pytetwild._accessor"] = types.ModuleType("_accessor")
import numpy as np, pytetwild
given = np.load("surface.npz", allow_pickle=False)
try:
    vertices, tetrahedra = pytetwild.tetrahedralize(
        given["points"], given["triangles"], edge_length_abs=float(given["edge_length"]),
        epsilon=float(given["epsilon"]), coarsen=True, stop_energy=20.0, num_opt_iter=20,
        num_threads=2, quiet=True)
except RuntimeError as error:
    sys.exit(str(error))
np.savez("mesh.npz", vertices=vertices, tetrahedra=tetrahedra)
"""

Mesh = tuple[Floats, Ints]


def fill_surface(points: Floats, triangles: Ints, edge_length: float) -> Mesh:
    """Fill a surface with tetrahedra.

    Parameters
    ----------
    points : (N, 3) float64
        In m.
    triangles : (F, 3) int64
        Point indices.
    edge_length : float
        Desired length of edges, in m.

    Returns
    -------
    tuple of (V, 3) float64 and (T, 4) int64
        Vertices in m, tetrahedra.

    Raises
    ------
    MissingLibraryError
        If pytetwild is not installed.
    GeometryError
        If the surface encloses no volume, or fTetWild fails.
    """
    if importlib.util.find_spec("pytetwild") is None:
        raise MissingLibraryError(
            'method "tetwild" needs the package pytetwild',
            cure='Run "pip install pytetwild", or use method = "carved".',
        )
    from importlib.metadata import version  # imported here: it brings email and socket

    def make() -> dict[str, NDArray[Any]]:
        # Scale to unit size at the origin: fTetWild has relative tolerances and float32 files.
        middle, size = points.mean(axis=0), float(np.ptp(points, axis=0).max())
        mesh_arrays = _run_tetwild(
            points=(points - middle) / size,
            triangles=triangles.astype(np.int32),
            edge_length=np.float64(edge_length / size),
            epsilon=np.float64(EPSILON),
        )
        if len(mesh_arrays["tetrahedra"]) == 0:
            raise GeometryError("the surface encloses no volume", cure=_CURE)
        return {
            "vertices": mesh_arrays["vertices"].astype(np.float64) * size + middle,
            "tetrahedra": mesh_arrays["tetrahedra"].astype(np.int64),
        }

    mesh = load_or_make(make, points, triangles, edge_length, EPSILON, version("pytetwild"))
    return mesh["vertices"], mesh["tetrahedra"]


def load_or_make(
    make: Callable[[], dict[str, NDArray[Any]]], *inputs: Any
) -> dict[str, NDArray[Any]]:
    """Load a mesh from the cache, or make and store it.

    Parameters
    ----------
    make : callable
        Returns the arrays of a mesh, ``vertices`` and ``tetrahedra`` among them.
    *inputs : array_like or number or str
        Everything that the mesh depends on.

    Returns
    -------
    dict of str to numpy.ndarray
        The arrays of the mesh.
    """
    digest = hashlib.sha256()
    settings = tuple(part for part in inputs if not isinstance(part, np.ndarray))
    arrays = [part.tobytes() for part in inputs if isinstance(part, np.ndarray)]
    for text in (*arrays, repr(settings).encode()):
        digest.update(hashlib.sha256(text).digest())
    key = f"tetwild-{digest.hexdigest()[:40]}"
    entry = cache.load(key)
    if entry is None or not _is_mesh(entry):
        entry = make()
        cache.store(key, **entry)
    return entry


def _is_mesh(entry: dict[str, NDArray[Any]]) -> bool:
    points, cells = (entry.get(name, np.empty(0)) for name in ("vertices", "tetrahedra"))
    if (points.dtype, cells.dtype) != (np.float64, np.int64) or not cells.size:
        return False
    known = points.shape[1:] == (3,) and cells.shape[1:] == (4,) and np.isfinite(points).all()
    return bool(known and cells.min() >= 0 and cells.max() < len(points))


_CURE = 'Close the holes of the surface, or set inflate = "1 mm" or method = "carved"'


def _run_tetwild(**surface: Any) -> dict[str, NDArray[Any]]:
    """Make a mesh in a child process, in a folder of its own."""
    with temporary_folder() as folder:
        np.savez(folder / "surface.npz", **surface)
        done = run_process([sys.executable, "-c", _PROGRAM], folder)
        if done.returncode or not (folder / "mesh.npz").is_file():
            lines = done.stderr.strip().splitlines()
            reason = lines[-1][:200] if lines else f"its process ended with code {done.returncode}"
            raise GeometryError(f"fTetWild failed: {reason}", cure=_CURE)
        with np.load(folder / "mesh.npz", allow_pickle=False) as mesh:
            return dict(mesh)


def run_process(command: Sequence[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a program to its end, or end it where the work that waits for it is cancelled."""
    # Files, not pipes: a pipe that nobody reads stops the program when it is full.
    with tempfile.TemporaryFile() as output, tempfile.TemporaryFile() as errors:
        process = None
        try:
            # A signal that raises between the start of the program and its assignment would leave
            # the program running.
            with delay_signals():
                process = subprocess.Popen(command, cwd=folder, stdout=output, stderr=errors)
            while process.poll() is None:
                cancel.check()
                time.sleep(_POLL_INTERVAL)
        finally:
            if process is not None:
                process.kill()
                process.wait()
        texts = []
        for file in (output, errors):
            file.seek(0)
            texts.append(file.read().decode(errors="replace"))
        return subprocess.CompletedProcess(command, process.returncode, *texts)
