"""Tetrahedra inside a surface by fTetWild, kept from run to run.

Y. Hu, T. Schneider, B. Wang, D. Zorin, D. Panozzo, "Fast Tetrahedral Meshing in the Wild", ACM
Trans. Graph. 39 (2020). It takes any triangles, open and self-intersecting ones too, and gives
another mesh at each run: so a mesh once made is kept in the user's cache folder under a hash of
surface and parameters, and found again there.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import GeometryError, MissingLibraryError

#: The cache holds at most this many bytes; the meshes longest unused go first.
CACHE_BYTES = 256 * 2**20
#: Name of an environment variable with another folder for the cache.
CACHE_VARIABLE = "SPACEMAP_CACHE"

#: How far the mesh may leave the surface, as a share of the diagonal. fTetWild's own thousandth
#: makes ten times as many tetrahedra near flat faces as a cage needs.
_EPSILON = 4e-3

Mesh = tuple[NDArray[np.float64], NDArray[np.int64]]


def filled(
    points: NDArray[np.float64], triangles: NDArray[np.int64], edge_length: float
) -> tuple[Mesh, bool]:
    """Return tetrahedra inside a surface.

    Parameters
    ----------
    points : (N, 3) float64
        In m.
    triangles : (F, 3) int64
        Point numbers.
    edge_length : float
        Length to aim for, in m.

    Returns
    -------
    mesh : tuple of (V, 3) float64 and (T, 4) int64
        Vertices in m, tetrahedra.
    known : bool
        Whether it came from the cache.

    Raises
    ------
    MissingLibraryError
        If pytetwild is not installed.
    GeometryError
        If the surface has no inside.
    """
    try:
        import pytetwild
    except ImportError:
        raise MissingLibraryError(
            'method "tetwild" needs the package pytetwild',
            cure='Run "pip install pytetwild", or use method = "carved".',
        ) from None
    digest = hashlib.sha256()
    settings = (edge_length, getattr(pytetwild, "__version__", ""), _EPSILON)
    for part in (points.tobytes(), triangles.tobytes(), repr(settings).encode()):
        digest.update(hashlib.sha256(part).digest())
    file = _folder() / f"{digest.hexdigest()[:40]}.npz"
    with contextlib.suppress(OSError, ValueError, KeyError, EOFError):
        mesh = _read(file)
        os.utime(file)
        return mesh, True
    # Near the origin and of unit size: fTetWild's own tolerances are relative, its files float32.
    middle, size = points.mean(axis=0), float(np.ptp(points, axis=0).max())
    try:
        vertices, tetrahedra = pytetwild.tetrahedralize(
            np.ascontiguousarray((points - middle) / size),
            np.ascontiguousarray(triangles, dtype=np.int32),
            edge_length_abs=edge_length / size,
            epsilon=_EPSILON,
            coarsen=True,
            stop_energy=20.0,
            num_opt_iter=20,
            num_threads=2,
            quiet=True,
        )
    except RuntimeError as error:
        raise GeometryError(f"fTetWild failed: {error}", cure=_CURE) from None
    if len(tetrahedra) == 0:
        raise GeometryError("the surface encloses no volume", cure=_CURE)
    mesh = np.asarray(vertices, np.float64) * size + middle, np.asarray(tetrahedra, np.int64)
    with contextlib.suppress(OSError):  # a full disk only costs the next run its time
        _write(file, mesh)
    return mesh, False


_CURE = 'Close its holes, or give the cage an envelope: inflate = "1 mm", or method = "carved"'


def _folder() -> Path:
    if os.environ.get(CACHE_VARIABLE):
        return Path(os.environ[CACHE_VARIABLE])
    from platformdirs import user_cache_dir

    return Path(user_cache_dir("spacemap_vtk", appauthor=False)) / "tetwild"


def _read(file: Path) -> Mesh:
    with np.load(file, allow_pickle=False) as held:
        return held["vertices"], held["tetrahedra"]


def _write(file: Path, mesh: Mesh) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    # Whole or not at all: two programs may write at once.
    handle, name = tempfile.mkstemp(suffix=".part", dir=file.parent)
    try:
        with os.fdopen(handle, "wb") as stream:
            arrays: dict[str, Any] = {"vertices": mesh[0], "tetrahedra": mesh[1]}
            np.savez_compressed(stream, **arrays)
        os.replace(name, file)
    finally:
        Path(name).unlink(missing_ok=True)
    _bound(file.parent)


def _bound(folder: Path) -> None:
    files = sorted(folder.glob("*.npz"), key=lambda f: f.stat().st_mtime, reverse=True)
    total = 0
    for file in files:
        total += file.stat().st_size
        if total > CACHE_BYTES and file != files[0]:
            file.unlink(missing_ok=True)
