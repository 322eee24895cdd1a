"""Wire mesh, leno, and weaves of several layers."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from spacemap_vtk.filters.textile import FabricFigure
from spacemap_vtk.filters.textiles.kind import STEEL, Crossed, Rest, yarn_lengths
from spacemap_vtk.ndarrays import Bools, Ints
from spacemap_vtk.parameters import Choice, Integer, Parameter, Real
from spacemap_vtk.textile.rods.crossed import draw_leno, draw_mesh
from spacemap_vtk.textile.rods.guess import Guess
from spacemap_vtk.textile.rods.layers import (
    GRAMMAR,
    MOST_LAYERS,
    LiftPlan,
    build_plan,
    draw_layers,
    parse_lifts,
)

#: Weaves of a mesh: whether each end is above each pick.
_MESHES = {
    "plain": np.eye(2, dtype=bool),
    "twill": np.array([np.roll([True, True, False, False], k) for k in range(4)]),
}


class Mesh(Crossed):
    """Wires that are crimped by each other."""

    name = "mesh"
    family_names = ("warp wires", "weft wires")
    colors = ((176, 180, 186), (160, 164, 172))
    usual_density, usual_packing = STEEL, 1.0

    weave = Choice("plain", "Weave of a mesh.", ["plain", "twill"])

    @property
    def _over(self) -> Bools:
        return _MESHES[self.weave]

    def guess(self) -> Guess:
        """Draw one repeat."""
        return draw_mesh(self._over, self.spacings, self.diameters)

    def families_of_cell(self, guess: Guess) -> Ints:
        """Return 0 for the ends, and 1 for the picks."""
        return np.repeat([0, 1], self._over.shape[::-1])

    def figures(self, rest: Rest) -> list[FabricFigure]:
        """Return apertures and crimps."""
        size = np.array([rest.cell[1, 1], rest.cell[0, 0]])
        lengths, ends = yarn_lengths(rest), self._over.shape[1]
        warp, weft = lengths[0] / size[0] - 1.0, lengths[ends] / size[1] - 1.0
        first, second = self.diameters
        open_ = (self.spacings[0] - first) * self.scale, (self.spacings[1] - second) * self.scale
        return [
            FabricFigure("aperture_across", "aperture across", open_[0], "m"),
            FabricFigure("aperture_along", "aperture along", open_[1], "m"),
            FabricFigure("warp_crimp", "crimp of the warp wires", float(warp)),
            FabricFigure("weft_crimp", "crimp of the weft wires", float(weft)),
        ]


class Leno(Crossed):
    """Pairs of ends, one of which crosses below the other one between the picks."""

    name = "leno"
    family_names = ("standing ends", "crossing ends", "picks")
    colors = ((222, 210, 186), (196, 92, 66), (222, 210, 186))
    usual_spacings = (4.0, 4.0)

    def guess(self) -> Guess:
        """Draw a pair of ends and two picks."""
        return draw_leno(self.spacings, self.diameters)

    def families_of_cell(self, guess: Guess) -> Ints:
        """Return 0 and 1 for the ends, and 2 for the picks."""
        return np.array([0, 1, 2, 2])

    def figures(self, rest: Rest) -> list[FabricFigure]:
        """Return the take-up of both ends."""
        standing, crossing = (yarn_lengths(rest)[:2] / rest.cell[1, 1] - 1.0).tolist()
        return [
            FabricFigure("standing_crimp", "crimp of the standing ends", standing),
            FabricFigure("crossing_crimp", "crimp of the crossing ends", crossing),
        ]


class Lifts(Parameter[Any]):
    """Lifts of the ends of a weave in layers."""

    kind = "lifts"
    annotation = "str or sequence of str"
    expected = GRAMMAR

    def convert(self, value: Any) -> tuple[str, ...]:
        """Convert to a text for each place across."""
        parse_lifts(value)
        texts = value.split(",") if isinstance(value, str) else value
        return tuple(" ".join(str(text).split()) for text in texts)

    def text(self, value: Any) -> str:
        """Format as texts with commas."""
        return f'"{", ".join(value)}"'


class Layers(Crossed):
    """Picks in several layers, bound by ends that go through them."""

    name = "layers"
    family_names = ("stuffers", "binders", "picks")
    colors = ((86, 96, 112), (214, 164, 62), (150, 160, 170))
    usual_spacings: ClassVar = (2.0, 2.6)

    structure = Choice(
        "orthogonal",
        "Weave in layers. orthogonal: straight stuffers, and binders through all layers; layer to "
        "layer: each end binds two layers; through thickness: ends go to and fro between the "
        "faces; double: two plain cloths, joined by some ends.",
        ["orthogonal", "layer to layer", "through thickness", "double"],
        when={"lifts": (None,)},
    )
    layers = Integer(
        4,
        "Number of layers of picks; a double weave has 2.",
        minimum=2,
        maximum=MOST_LAYERS,
        when={"lifts": (None,)},
    )
    lifts = Lifts(
        None,
        "Way of each end: the number of picks below it at each column.",
        automatic="those of the structure",
    )
    binder_diameter = Real(
        None,
        "Diameter of the ends that bind layers.",
        unit="m",
        above=0.0,
        plausible=(1e-6, 0.05),
        usual_units="mm",
        automatic="diameter of the other ends",
    )

    @property
    def plan(self) -> LiftPlan:
        """The ways of the ends."""
        if self.lifts is not None:
            return parse_lifts(self.lifts)
        return build_plan(self.structure, self.layers)

    @property
    def scale(self) -> float:
        """The largest diameter [m]."""
        return max(super().scale, self.binder_diameter or 0.0)

    def guess(self) -> Guess:
        """Draw one repeat."""
        end, pick = self.diameters
        binder = end if self.binder_diameter is None else self.binder_diameter / self.scale
        return draw_layers(self.plan, self.spacings, (end, binder, pick))

    def families_of_cell(self, guess: Guess) -> Ints:
        """Return 0 for stuffers, 1 for binders, and 2 for picks."""
        binds = [int(binds) for binds in self.plan.binds]
        return np.array(binds + [2] * (len(guess.yarns) - len(binds)))

    @property
    def notes(self) -> list[str]:
        """Sentences about picks that are not bound, and on whether the weave falls apart."""
        plan = self.plan
        notes = [
            f"pick {layer + 1} of column {column + 1} is not bound: all ends are on one side of it"
            for column, layer in plan.unbound
        ]
        if not notes and plan.cloths > 1:
            notes.append(f"the weave falls apart into {plan.cloths} cloths that nothing joins")
        return notes

    def figures(self, rest: Rest) -> list[FabricFigure]:
        """Return the crimp of the binders, unbound picks, and the number of separate cloths."""
        plan = self.plan
        crimps = yarn_lengths(rest)[: len(plan.ends)] / rest.cell[1, 1] - 1.0
        binders = crimps[np.array(plan.binds, dtype=bool)]
        found = [
            FabricFigure("layers", "layers of picks", plan.layers),
            FabricFigure("unbound_picks", "unbound picks in a repeat", len(plan.unbound)),
            FabricFigure("cloths", "separate cloths", plan.cloths),
        ]
        if len(binders):
            found.append(
                FabricFigure("binder_crimp", "crimp of the binders", float(binders.mean()))
            )
        return found
