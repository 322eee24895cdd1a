"""Strains of a sheet whose membrane follows a nonlinear law.

The first three strains at each point are those of the membrane, see
`spacemap_vtk.mechanics.elements.shell.sheet_strains`. Their energy is that of a `MembraneLaw`; all
others are as linear as without one.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from spacemap_vtk.mechanics.elements.membrane_law import LinearLaw, MembraneLaw
from spacemap_vtk.mechanics.elements.strains import StrainResponse, Strains
from spacemap_vtk.mechanics.equilibrium.energy_terms import digest_of
from spacemap_vtk.ndarrays import Floats

#: Number of membrane strains; they are the first ones.
MEMBRANE = 3


@dataclass(frozen=True, eq=False)
class LawStrains(Strains):
    """Strains of a sheet's quadrilaterals, the first three of which follow a law."""

    #: Law of the membrane.
    law: MembraneLaw = field(default_factory=lambda: LinearLaw(np.eye(MEMBRANE)), kw_only=True)
    #: (E, Q) Factor of the law's energy per area [m²].
    weights: Floats = field(default_factory=lambda: np.ones((1, 1)), kw_only=True)

    @property
    def digest(self) -> str:
        """Digest of the elements, their material and the law."""
        return digest_of(super().digest, self.law.digest, self.weights)

    @cached_property
    def _others(self) -> Floats:
        """Elasticity of all strains but those of the membrane."""
        result = self.stiffness.copy()
        result[..., :MEMBRANE, :MEMBRANE] = 0.0
        return result

    def respond(self, strain: Floats) -> StrainResponse:
        """Compute energy, stress and moduli, those of the membrane by the law."""
        energy, stress, tangent = self.law.evaluate(strain[..., :MEMBRANE])
        moduli = self._others.copy()
        result = (moduli @ strain[..., None])[..., 0]
        total = float(np.vdot(self.weights, energy)) + 0.5 * float(np.vdot(strain, result))
        result[..., :MEMBRANE] += self.weights[..., None] * stress
        moduli[..., :MEMBRANE, :MEMBRANE] = self.weights[..., None, None] * tangent
        return StrainResponse(total, result, moduli)

    def definite_moduli(self, moduli: Floats) -> Floats:
        """Replace negative eigenvalues of the membrane's moduli by zero."""
        block = moduli[..., :MEMBRANE, :MEMBRANE]
        small = np.linalg.eigvalsh(block)[..., 0] < 0.0
        if not small.any():
            return moduli
        values, vectors = np.linalg.eigh(block[small])
        result = moduli.copy()
        result[small, :MEMBRANE, :MEMBRANE] = (
            vectors * np.maximum(values, 0.0)[..., None, :]
        ) @ vectors.swapaxes(-1, -2)
        return result
