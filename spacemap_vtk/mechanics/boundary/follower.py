"""Follower pressure: it stays normal to the surface on which it acts, at any rotation.

On a face with nodes at x and shape functions N, the forces of a unit pressure from inside

    f_a = ∫ N_a x,ξ × x,η dξ dη = Σ_bc t_abc x_b × x_c
    t_abc = ½ ∫ N_a (N_b,ξ N_c,η - N_c,ξ N_b,η) dξ dη

are quadratic in the positions. On a closed surface they are the gradient of its volume. Free edges
of the surface make the tangent unsymmetric (Schweizerhof and Ramm, Computers & Structures 18 (1984)
1099).
"""

from __future__ import annotations

from functools import cache

import numpy as np

from spacemap_vtk.mechanics.equilibrium.energy_terms import EnergyTerm, digest_of, sum_at_nodes
from spacemap_vtk.ndarrays import Floats, Ints

#: Levi-Civita symbol: (s × d)_a = Σ _CROSS_abc s_b d_c.
_CROSS = np.zeros((3, 3, 3))
_CROSS[[0, 1, 2], [1, 2, 0], [2, 0, 1]], _CROSS[[0, 1, 2], [2, 0, 1], [1, 2, 0]] = 1.0, -1.0


class FollowerPressure(EnergyTerm):
    """Unit pressure on the faces (f, k) of a wall, from outside."""

    #: It would be conservative only on a closed surface.
    conservative = False

    def __init__(self, faces: Ints) -> None:
        self.nodes, self._triple_products = faces, _triple_products(faces.shape[1])

    @property
    def digest(self) -> str:
        """Digest of the faces."""
        return digest_of("pressure", self.nodes)

    def energy(self, positions: Floats) -> float:
        """Compute the volume of the cone from the origin to the wall; a closed wall's volume."""
        return float(np.vdot(positions, self.forces(positions))) / 3

    def forces(self, positions: Floats) -> Floats:
        """Compute the outward forces that hold the wall against the pressure, (V, 3)."""
        return sum_at_nodes(self.nodes, self._face_forces(positions[self.nodes]), len(positions))

    def tangent(self, positions: Floats) -> Floats:
        """Compute the derivatives of each face's forces by its nodes, (f, 3 k, 3 k)."""
        arms = 2 * np.einsum("abc,fbi->faci", self._triple_products, positions[self.nodes])
        found = np.einsum("jik,faci->fajck", _CROSS, arms)
        return np.asarray(found.reshape(len(arms), 3 * arms.shape[1], -1))

    def _face_forces(self, x: Floats) -> Floats:
        """Compute f_a of faces with nodes at x, (f, k, 3) both."""
        arms = np.einsum("abc,fbi->faci", self._triple_products, x)
        return np.cross(arms, x[:, None]).sum(axis=2)


@cache
def _triple_products(nodes: int) -> Floats:
    """Compute t of a face with the given number of nodes."""
    if nodes == 4:
        corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        places, weights = corners / 3**0.5, np.ones(4)
        in_xi, in_eta = (1 + places[:, i, None] * corners[:, i] for i in (0, 1))
        shape = in_xi * in_eta / 4
        along, across = corners[:, 0] * in_eta / 4, corners[:, 1] * in_xi / 4
    else:
        # Quadrature of fourth degree: Dunavant, Int. J. Numer. Meth. Eng. 21 (1985) 1129.
        offsets = (0.445948490915965, 0.091576213509771)
        shares = (0.223381589678011, 0.109951743655322)
        area = np.array([np.roll([a, a, 1 - 2 * a], k) for a in offsets for k in range(3)])
        weights = np.repeat(shares, 3) / 2
        slope = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
        if nodes == 3:
            shape, slopes = area, np.broadcast_to(slope, (len(area), 3, 2))
        else:
            ends = np.array([[0, 1], [1, 2], [2, 0]]).T
            first, second = area[:, ends[0]], area[:, ends[1]]
            shape = np.concatenate([area * (2 * area - 1), 4 * first * second], axis=1)
            middle = first[..., None] * slope[ends[1]] + second[..., None] * slope[ends[0]]
            slopes = np.concatenate([(4 * area - 1)[..., None] * slope, 4 * middle], axis=1)
        along, across = slopes[..., 0], slopes[..., 1]
    half = np.einsum("q,qa,qb,qc->abc", weights / 2, shape, along, across)
    return half - half.swapaxes(1, 2)
