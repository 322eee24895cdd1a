"""Strains that are quadratic in the positions: one kernel for cloth and solids at any deformation.

Each strain of an element depends on the positions z of its nodes as

    ε_s = ½ Σ_ab b_sab z_a · z_b - ε⁰_s

with a constant symmetric form b. Energy, forces and their exact tangent are then a few products:

    W = ½ Σ ε C ε      f = Σ_s σ_s b_s z,  σ = C ε      K = Gᵀ C G + Σ_s σ_s b_s ⊗ I,  G_s = b_s z

At zero strain the second part of K, the geometric stiffness, is zero, and K is the linear
stiffness. The stress may also be a nonlinear function of the strain (`respond`); C is then its
derivative, and W is not ½ ε C ε. Tetrahedra have Green's strain E = ½ (FᵀF - I), F = Σ x_a ⊗ ∇N_a;
the strains of a sheet are in `spacemap_vtk.mechanics.elements.shell`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from spacemap_vtk.mechanics.elements.elasticity import barycentric_gradients
from spacemap_vtk.mechanics.elements.kinematics import QUADRATURE_POINTS
from spacemap_vtk.mechanics.elements.tetrahedra import shape_slopes
from spacemap_vtk.mechanics.equilibrium.energy_terms import (
    EnergyTerm,
    TermState,
    digest_of,
    sum_at_nodes,
)
from spacemap_vtk.ndarrays import Bools, Floats, Ints
from spacemap_vtk.parallel import blocks

#: Axes of the strain components xx, yy, zz, yz, zx, xy.
_AXES = ((0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1))

#: A negative eigenvalue of a form is rounding if it is below this share of the largest one.
_DEFINITE = 1e-9

#: Forms that differ by at most this share of the largest entry are equal but for rounding.
_EQUAL = 1e-12

#: Largest rotation in a Newton step [rad].
MAX_ROTATION = 0.5

#: Number of elements whose matrices stay in the processor's cache between two passes.
_CACHED = 128

#: Smallest rotation that is not zero; it avoids a division by zero.
_MIN_ROTATION = float(np.finfo(np.float64).tiny)


class StrainResponse(NamedTuple):
    """Response of elements of one kind to their strains; quadrature weights are included."""

    energy: float
    """W [J]."""
    stress: Floats
    """σ = ∂W/∂ε, (E, Q, s)."""
    moduli: Floats
    """C = ∂σ/∂ε, (E, Q, s, s)."""


@dataclass(frozen=True, eq=False)
class Strains(EnergyTerm):
    """Strains of elements of one kind at their quadrature points, and their energy."""

    #: (E, n) Nodes of each of the E elements, as row numbers of the positions.
    nodes: Ints
    #: (E, Q, s, n, n) Symmetric forms b of s strains at each of Q quadrature points; (1, …) if
    #: those of all elements are equal.
    forms: Floats
    #: (E, Q, s) ε⁰, which makes the strains of the undeformed shape zero.
    reference: Floats
    #: (E, Q, s, s) Elasticity C at rest, multiplied by the quadrature weights.
    stiffness: Floats
    #: (3, n) Node weights of three vectors whose handedness changes if an element is inside out.
    frame: Floats | None = field(default=None, kw_only=True)

    @property
    def digest(self) -> str:
        """Digest of the elements and their material."""
        return digest_of(self.nodes, self.forms, self.reference, self.stiffness)

    def evaluate(self, positions: Floats) -> StrainState:
        """Evaluate strains and stresses at positions (V, 3)."""
        return StrainState(self, positions)

    def strains_and_gradients(self, positions: Floats) -> tuple[Floats, Floats]:
        """Compute strains ε, (E, Q, s), at positions (V, 3), and G = ∂ε/∂z, (E, Q, s, n, 3)."""
        squares, gradients = self.second_order_strains(positions)
        return squares - self.reference, gradients

    def second_order_strains(self, positions: Floats) -> tuple[Floats, Floats]:
        """Compute ½ z b z, (E, Q, s), the second-order part of the strain of a move z, and b z."""
        gradients = self.spins(positions)
        elements, nodes = self.nodes.shape
        z = positions[self.nodes].reshape(elements, -1, 1)
        flat = gradients.reshape(elements, -1, 3 * nodes) @ z
        return 0.5 * flat.reshape(self.reference.shape), gradients

    def gradients(self, positions: Floats) -> Floats:
        """Compute G = ∂ε/∂z at positions (V, 3), (E, Q, s, n, 3)."""
        return self.spins(positions)

    def spins(self, move: Floats) -> Floats:
        """Compute b z, the change of G with a move z (V, 3), (E, Q, s, n, 3)."""
        elements, nodes = self.nodes.shape
        if len(self.forms) == 1:
            found = move[self.nodes].reshape(elements, -1) @ self._wide_forms
        else:
            found = self.forms.reshape(elements, -1, nodes) @ move[self.nodes]
        return found.reshape(elements, *self.forms.shape[1:4], 3)

    @cached_property
    def _wide_forms(self) -> Floats:
        """Equal forms of all elements as one matrix b ⊗ I, (3 n, Q s n 3)."""
        # One product of large matrices takes less time than a small one for each element.
        forms = self.forms.reshape(-1, self.nodes.shape[1])
        return np.ascontiguousarray(np.kron(forms, np.eye(3)).T)

    def energy(self, positions: Floats) -> float:
        """Compute W [J]."""
        return self.respond(self.strains_and_gradients(positions)[0]).energy

    def forces(self, positions: Floats) -> Floats:
        """Compute ∂W/∂z, (V, 3): the forces that hold the shape [N]."""
        strain, gradients = self.strains_and_gradients(positions)
        return self.sum_forces(self.respond(strain).stress, gradients, len(positions))

    def respond(self, strain: Floats) -> StrainResponse:
        """Compute energy, stress and moduli at strains (E, Q, s): here W = ½ Σ εᵀ C ε."""
        stress = self.stresses(strain)
        return StrainResponse(0.5 * float(np.vdot(strain, stress)), stress, self.stiffness)

    def stresses(self, strain: Floats) -> Floats:
        """Compute C ε of strains (E, Q, s) with C at rest, quadrature weights included."""
        return (self.stiffness @ strain[..., None])[..., 0]

    def definite_moduli(self, moduli: Floats) -> Floats:
        """Replace moduli by those without negative eigenvalues; C at rest has none."""
        return moduli

    def sum_forces(self, stress: Floats, gradients: Floats, count: int) -> Floats:
        """Sum σ_s G_s over the strains at each of `count` nodes, (count, 3)."""
        elements, nodes = self.nodes.shape
        force = stress.reshape(elements, 1, -1) @ gradients.reshape(elements, -1, 3 * nodes)
        return sum_at_nodes(self.nodes, force, count)

    def tangent(self, positions: Floats) -> Floats:
        """Compute ∂²W/∂z² of each element [N/m], (E, 3 n, 3 n), node by node."""
        strain, gradients = self.strains_and_gradients(positions)
        found = self.respond(strain)
        return self.tangent_with_stress(
            found.stress, gradients, stress_changes(found.moduli, gradients)
        )

    def remove_compression(self, stress: Floats) -> Floats:
        """Keep only the stresses, (E, Q, s), with which K is positive definite at any shape."""
        # Compression is removed, and so are stresses of strains whose form is indefinite.
        return np.where(self._can_stabilise, np.maximum(stress, 0.0), 0.0)

    def strain_changes(self, gradients: Floats, move: Floats) -> Floats:
        """Compute G Δz of a move (V, 3), (E, Q, s)."""
        elements, nodes = self.nodes.shape
        flat = gradients.reshape(elements, -1, 3 * nodes) @ move[self.nodes].reshape(
            elements, -1, 1
        )
        return flat.reshape(self.reference.shape)

    def admits(self, start: Floats, positions: Floats) -> bool:
        """Check that no element is inside out; its mirror image would have the same energy."""
        return bool((self._handedness(positions) * self._handedness(start) > 0).all())

    def _handedness(self, positions: Floats) -> Floats:
        """Compute the triple product of each element's frame, (E,)."""
        if self.frame is None:
            return np.ones(len(self.nodes))
        return np.linalg.det(self.frame @ positions[self.nodes])

    def largest_step(self, positions: Floats, move: Floats) -> float:
        """Compute the largest multiple of a move (V, 3) that turns no element too far."""
        # The estimate is of first order and counts a stretch as a rotation: a line whose end moves
        # across it by θ of its length has a strain of θ²/2.
        z = move[self.nodes]
        forms = self._stabilising_forms
        squares = (z @ z.swapaxes(1, 2)).reshape(len(forms), -1, forms.shape[1]) @ forms
        return MAX_ROTATION / max(_MIN_ROTATION, float(np.sqrt(squares.max(initial=0.0))))

    def tangent_with_stress(self, stress: Floats, gradients: Floats, changes: Floats) -> Floats:
        """Compute Gᵀ ∂σ/∂z + Σ σ b ⊗ I of each element, with any stresses (E, Q, s)."""
        # `changes` is ∂σ/∂z, (E, Q, s, n, 3); the stress may change by other strains than G Δz.
        elements, _, _, nodes, _ = gradients.shape
        flat = gradients.reshape(elements, -1, 3 * nodes)
        changes, pull = changes.reshape(flat.shape), self._sum_forms(stress)
        result = np.empty((elements, 3 * nodes, 3 * nodes))
        by_axes = result.reshape(elements, nodes, 3, nodes, 3)
        for part in blocks(elements, _CACHED):
            np.matmul(flat[part].swapaxes(1, 2), changes[part], out=result[part])
            for axis in range(3):
                by_axes[part, :, axis, :, axis] += pull[part]
        return result

    def stiffness_products(self, positions: Floats, fields: Floats) -> Floats:
        """Compute φᵀ K φ for each pair of the fields (m, V, 3), as a sum over strains, (m, m)."""
        # If K is a sum of large forces that cancel, as for a thin sheet that bends, this sum keeps
        # more digits.
        strain, gradients = self.strains_and_gradients(positions)
        _, stress, moduli = self.respond(strain)
        elements, nodes = self.nodes.shape
        moved = fields[:, self.nodes]
        rows = moved.reshape(len(fields), elements, 3 * nodes).transpose(1, 2, 0)
        strained = gradients.reshape(elements, -1, 3 * nodes) @ rows
        strained = strained.reshape(*self.reference.shape, len(fields))
        left, right = (moduli @ strained), strained
        total = left.reshape(-1, len(fields)).T @ right.reshape(-1, len(fields))
        if stress.any():
            pull = self._sum_forms(stress)
            total += np.einsum("meak,enak->mn", pull @ moved, moved.swapaxes(0, 1))
        return (total + total.T) / 2

    def resistance_matrices(self) -> Floats:
        """Compute matrices, (E, 3 n, 3 n), that are zero for moves which strain no element."""
        nodes = self.nodes.shape[1]
        rows = self.forms.reshape(len(self.forms), -1, nodes)
        found = np.asarray(np.kron(rows.swapaxes(1, 2) @ rows, np.eye(3)), dtype=np.float64)
        return np.broadcast_to(found, (len(self.nodes), 3 * nodes, 3 * nodes))

    def _sum_forms(self, stress: Floats) -> Floats:
        """Compute Σ_s σ_s b_s of each element, (E, n, n)."""
        elements, nodes = self.nodes.shape
        kinds, points, count = self.forms.shape[:3]
        forms = self.forms.reshape(kinds, points * count, nodes * nodes)
        found = stress.reshape(kinds, -1, points * count) @ forms
        return found.reshape(elements, nodes, nodes)

    @cached_property
    def _stabilising_forms(self) -> Floats:
        """Forms of the strains that can stabilise, (E, n², m), zero in other elements."""
        can = self._can_stabilise
        forms = np.where(can[..., None, None], self.forms, 0.0)[:, can.any(axis=0)]
        flat = forms.reshape(*forms.shape[:2], self.nodes.shape[1] ** 2)
        return np.ascontiguousarray(flat.swapaxes(1, 2))

    @cached_property
    def _can_stabilise(self) -> Bools:
        """Strains whose tensile stress adds to the stiffness."""
        values = np.linalg.eigvalsh(self.forms)
        return values[..., 0] > -_DEFINITE * abs(values).max(axis=-1)


class StrainState(TermState):
    """Strains and stresses of elements of one kind at fixed positions."""

    def __init__(self, kind: Strains, positions: Floats) -> None:
        super().__init__(kind, positions)
        self.kind = kind
        #: Strains ε, (E, Q, s), and gradients G, (E, Q, s, n, 3).
        self.strain, self.gradients = kind.strains_and_gradients(positions)
        #: Energy, stresses and moduli.
        self.response = kind.respond(self.strain)
        self._count = len(positions)

    @property
    def stress(self) -> Floats:
        """Stresses σ, (E, Q, s)."""
        return self.response.stress

    @property
    def energy(self) -> float:
        """Energy [J]."""
        return self.response.energy

    @cached_property
    def definite_moduli(self) -> Floats:
        """Moduli without negative eigenvalues."""
        return self.kind.definite_moduli(self.response.moduli)

    @cached_property
    def forces(self) -> Floats:
        """Forces Σ σ G [N], (V, 3)."""
        return self.kind.sum_forces(self.stress, self.gradients, self._count)

    def tangent(self, removed: float = 0.0, predicted: StrainResponse | None = None) -> Floats:
        """Compute the tangent, with the predicted stress if one is given."""
        # `removed` is the share of compressive stresses, and of negative moduli, that is removed.
        # If all of it is removed, the tangent is definite.
        _, stress, moduli = self.response
        if predicted is not None and predicted.moduli is not moduli:
            # The mean of the moduli takes the predicted stress to the one that the forces contain.
            moduli = 0.5 * (moduli + predicted.moduli)
        if predicted is not None:
            stress = predicted.stress
        stress = stress + removed * (self.kind.remove_compression(stress) - stress)
        if removed and (definite := self.kind.definite_moduli(moduli)) is not moduli:
            moduli = moduli + removed * (definite - moduli)
        changes = stress_changes(moduli, self.gradients)
        return self.kind.tangent_with_stress(stress, self.gradients, changes)

    def predict(self, move: Floats, curve: Floats | None = None) -> StrainResponse:
        """Predict the response to a linear solution, without that to spurious stretch."""
        # Magisano, Leonetti and Garcea, Comput. Methods Appl. Mech. Eng. 313 (2017) 986.
        strain = self.strain + self.kind.strain_changes(self.gradients, move)
        if curve is not None:
            strain = strain + self.kind.second_order_strains(move)[0]
            strain = strain + self.kind.strain_changes(self.gradients, curve)
        return self.kind.respond(strain)

    def predict_unstressed(self) -> StrainResponse:
        """Predict the response to no strain."""
        return self.kind.respond(np.zeros_like(self.strain))


@dataclass(frozen=True, eq=False)
class BaseSprings(Strains):
    """Displacements of vertices as strains, which springs between vertices and a base resist."""

    # ε = Σ_a w_a (z_a - Z_a) is linear in the positions with scalar weights w_a: forms are zero.

    #: (E, n) Weights w.
    weights: Floats

    def strains_and_gradients(self, positions: Floats) -> tuple[Floats, Floats]:
        """Compute displacements, (E, 1, 3), and their constant gradients, (E, 1, 3, n, 3)."""
        moved = np.einsum("en,enk->ek", self.weights, positions[self.nodes])
        return moved[:, None] - self.reference, self.gradients(positions)

    def gradients(self, positions: Floats) -> Floats:
        """Compute the constant gradients, (E, 1, 3, n, 3)."""
        return np.einsum("en,sk->esnk", self.weights, np.eye(3))[:, None]

    def resistance_matrices(self) -> Floats:
        """Compute a matrix of each spring that is zero for moves which it does not resist."""
        size = abs(self.stiffness).max(axis=(2, 3), keepdims=True)
        scaled = BaseSprings(
            self.nodes, self.forms, self.reference, self.stiffness / size, self.weights
        )
        return scaled.tangent(np.zeros((self.nodes.max(initial=0) + 1, 3)))


def stress_changes(moduli: Floats, gradients: Floats) -> Floats:
    """Compute C G, the change of stress with the positions, (E, Q, s, n, 3)."""
    elements, points, count, nodes, _ = gradients.shape
    flat = gradients.reshape(elements, points, count, 3 * nodes)
    return (moduli @ flat).reshape(gradients.shape)


def springs_to_base(points: Floats, nodes: Ints, weights: Floats, stiffness: Floats) -> BaseSprings:
    """Make springs (E, 3, 3) that resist the displacements Σ_a w_a z_a of nodes (E, n)."""
    forms = np.zeros((len(nodes), 1, 3, nodes.shape[1], nodes.shape[1]))
    reference = np.zeros((len(nodes), 1, 3))
    bare = BaseSprings(nodes, forms, reference, stiffness[:, None], weights)
    return BaseSprings(
        nodes, forms, bare.strains_and_gradients(points)[0], stiffness[:, None], weights
    )


def tetrahedron_strains(
    points: Floats, cells: Ints, elasticity: Floats, factors: Floats | None = None
) -> Strains:
    """Make Green's strains of linear or quadratic tetrahedra: xx, yy, zz, yz, zx, xy."""
    slope, weights = shape_gradients(points, cells)
    forms = np.stack([product_form(slope[..., i], slope[..., j]) for i, j in _AXES], axis=2)
    forms[:, :, :3] /= 2
    reference = np.broadcast_to([0.5, 0.5, 0.5, 0.0, 0.0, 0.0], (*weights.shape, 6))
    weights = weights if factors is None else weights * factors[:, None]
    frame = np.eye(4, cells.shape[1])[1:] - np.eye(1, cells.shape[1])
    return Strains(cells, forms, reference, weights[..., None, None] * elasticity, frame=frame)


def shape_gradients(points: Floats, cells: Ints) -> tuple[Floats, Floats]:
    """Compute ∇N of tetrahedra at their quadrature points, (T, Q, n, 3), and weights (T, Q)."""
    gradients, volume = barycentric_gradients(points, cells)
    slopes = np.eye(4)[None] if cells.shape[1] == 4 else shape_slopes(QUADRATURE_POINTS)
    weights = np.repeat(volume[:, None] / len(slopes), len(slopes), axis=1)
    return np.einsum("qna,tai->tqni", slopes, gradients), weights


def share_forms(forms: Floats) -> Floats:
    """Keep one of the forms (E, …) if they are equal but for rounding, as on a regular lattice."""
    if len(forms) and abs(forms - forms[:1]).max() <= _EQUAL * abs(forms[0]).max():
        return forms[:1]
    return forms


def product_form(left: Floats, right: Floats) -> Floats:
    """Build the form b whose strain is (Σ left_a z_a) · (Σ right_b z_b)."""
    outer = left[..., :, None] * right[..., None, :]
    return outer + outer.swapaxes(-1, -2)
