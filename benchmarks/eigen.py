"""Lowest modes: ours beside scipy's eigsh, in one run, each in a process of its own.

python benchmarks/eigen.py [divisions [modes]]

Clamped at one side, consistent mass. Divisions are "n" for a cube of n x n x n hexahedra, or
"n,m,k"; "31" is the cube of 95,232 degrees of freedom. Ours runs with its own factors, and with
those of CHOLMOD and Pardiso where they are installed. Memory is what the process takes beyond the
matrices; seconds are the clock's, and in "CPU" those that the process got, which tell more where
others compute, too. For one core, set OPENBLAS_NUM_THREADS=1 and MKL_NUM_THREADS=1.
"""

from __future__ import annotations

import importlib.util
import json
import os
import resource
import subprocess
import sys
import time

import numpy as np
import scipy.sparse.linalg as sla

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.elements.elasticity import assemble, mass_matrix, stiffness_matrix
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.linalg import factors, lanczos
from spacemap_vtk.mechanics.modal.eigen import solve_modes
from spacemap_vtk.mechanics.modal.pencil import Pencil, free_columns

#: Name of each method, and the package it needs.
METHODS = {"spacemap": "", "cholmod": "sksparse", "pardiso": "pypardiso", "eigsh": ""}


def absent(matrix: object) -> factors.Solve:
    """Stand for a library that is not installed."""
    raise ImportError


def peak() -> float:
    """Return the most memory that the process has held, in MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def solve(method: str, divisions: tuple[int, ...], count: int) -> dict[str, object]:
    """Solve one problem by one method."""
    bounds = (0.0, 1.0, 0.0, divisions[1] / divisions[0], 0.0, divisions[2] / divisions[0])
    points, tetrahedra = build_lattice(bounds, divisions)  # type: ignore[arg-type]
    assembly = assemble(points, tetrahedra)
    springs, inertia = stiffness_matrix(assembly, isotropic(1e6, 0.3)), mass_matrix(assembly, 300.0)
    free = np.repeat(points[:, 1] < points[:, 1].max(), 3)
    for name in {"cholmod", "pardiso"} - {method}:
        setattr(factors, name, absent)
    before, start, cpu = peak(), time.perf_counter(), time.process_time()
    if method == "eigsh":
        k, m = springs[free][:, free].tocsc(), inertia[free][:, free].tocsc()
        values, modes = sla.eigsh(k, count, m, sigma=-lanczos.choose_shift(k.tocsr(), m.tocsr()))
        order = np.argsort(values)
        values, modes = values[order], modes[:, order]
    else:
        values, shapes = solve_modes(Pencil(springs, inertia, free_columns(free)), count)[:2]
        modes = shapes.reshape(count, -1).T[free]
    seconds, megabytes = time.perf_counter() - start, peak() - before
    cpu = time.process_time() - cpu
    k, m = springs[free][:, free], inertia[free][:, free]
    force = k @ modes
    residual = np.linalg.norm(force - (m @ modes) * values, axis=0) / np.linalg.norm(force, axis=0)
    return {
        "dof": int(free.sum()),
        "seconds": seconds,
        "cpu": cpu,
        "megabytes": megabytes,
        "residual": float(residual.max()),
        "orthonormality": float(abs(modes.T @ (m @ modes) - np.eye(count)).max()),
        "values": values.tolist(),
    }


def main() -> None:
    """Run all methods and print a table."""
    if len(sys.argv) > 3:
        divisions = tuple(int(n) for n in sys.argv[2].split(","))
        print(json.dumps(solve(sys.argv[1], divisions, int(sys.argv[3]))))
        return
    numbers = [int(n) for n in (sys.argv[1] if len(sys.argv) > 1 else "12").split(",")]
    divisions = numbers * 3 if len(numbers) == 1 else numbers
    count = sys.argv[2] if len(sys.argv) > 2 else "30"
    found = {}
    print("load {:.1f} {:.1f} {:.1f}".format(*os.getloadavg()))
    print(f"{'':10}{'dof':>9}{'s':>9}{'CPU':>9}{'MB':>9}{'residual':>11}{'SᵀMS - I':>11}")
    for method, package in METHODS.items():
        if package and importlib.util.find_spec(package) is None:
            continue
        command = [sys.executable, __file__, method, ",".join(map(str, divisions)), count]
        answer = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        found[method] = row = json.loads(answer)
        print(
            f"{method:10}{row['dof']:9}{row['seconds']:9.2f}{row['cpu']:9.2f}{row['megabytes']:9.0f}"
            f"{row['residual']:11.1e}{row['orthonormality']:11.1e}"
        )
    values = np.array([row["values"] for row in found.values()])
    print(f"largest relative difference of eigenvalues {(np.ptp(values, 0) / values[0]).max():.1e}")


if __name__ == "__main__":
    main()
