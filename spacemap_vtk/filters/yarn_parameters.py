"""Parameters for the stiffness of yarns."""

from __future__ import annotations

from typing import Any

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.parameters import Flag, Parameterised, Real, Series
from spacemap_vtk.textile.crimp.interchange import YarnMechanics
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.yarn import section_factor

_FLATTEST = YarnMechanics().flattest
#: Condition for parameters that have an effect only if yarns stretch.
_ELASTIC = {"inextensible": (False,)}


class WarpAndWeft(Series):
    """One value for both directions of a fabric, or one for the warp and one for the weft."""

    each = "for the warp and the weft"

    def convert(self, value: Any) -> Any:
        """Convert to a checked value, or to a tuple of two."""
        result = super().convert(value)
        if isinstance(result, tuple) and len(result) != 2:
            raise InputError(f"{len(result)} values in place of 2")
        return result

    @staticmethod
    def pair(value: Any) -> tuple[float, float] | None:
        """Return the values for warp and weft; None if there is no value."""
        if value is None or isinstance(value, tuple):
            return value
        return value, value

    def tell(self, value: Any) -> str:
        """Format the figures of warp and weft, or one for both if they are equal."""
        warp, weft = (self.component.tell(each) for each in self.pair(value) or ())
        return warp if warp == weft else f"warp {warp}, weft {weft}"


class YarnParameters(Parameterised):
    """Parameters for the stiffness of yarns."""

    inextensible = Flag(
        True,
        "Yarns keep their length: where the cloth is pulled they give their crimp, and then "
        "flatten each other; what neither gives is yarn strain, which is shown and told. False: "
        "they stretch, and trade crimp, as their stiffnesses say.",
    )
    tension = WarpAndWeft(
        Real(
            None,
            "Force EA by which a yarn would be stretched to twice its length: the slope of its "
            "tensile test, force over strain. One value, or one for the warp and one for the weft.",
            unit="N",
            above=0.0,
        ),
        automatic="from the modulus",
        when=_ELASTIC,
    )
    modulus = WarpAndWeft(
        Real(
            None,
            'The yarn\'s modulus over its count, in place of the tension: "300 cN/tex" of a spun '
            "cotton, whose fibres have some 500; of fibres of wool 230, nylon 260, polyester 1000, "
            "flax 1800, glass 2800. One value, or one for the warp and one for the weft; each "
            "yarn's EA is this times its own count.",
            unit="N.m/kg",
            above=0.0,
        ),
        automatic="from the tension",
        when=_ELASTIC,
    )
    contact = Real(
        None,
        "Force by which yarns at a crossing would be pressed to nothing, were they springs: the "
        "slope of force over the share of the thickness that they lose.",
        unit="N",
        minimum=0.0,
        automatic="none: crossings flatten as the yarns need",
    )
    flattest = Real(
        None,
        "Least distance of the axes at a crossing, over that of the yarns as woven: where fibres "
        "lie as close as they can. 1: crossings are hard, and do not flatten.",
        above=0.0,
        maximum=1.0,
        automatic=f"{_FLATTEST:.3g}, for fibres that fill 0.6 of a yarn's section",
    )
    bending = WarpAndWeft(
        Real(
            None,
            "Bending rigidity B of a yarn: moment over curvature. It decides how slack yarns lie. "
            "One value, or one for the warp and one for the weft.",
            unit="N.m2",
            minimum=0.0,
        ),
        automatic="none: they bend alike",
    )

    def yarns(self, cloth: Cloth) -> YarnMechanics:
        """Return the mechanics of a cloth's yarns; a modulus is multiplied by their counts."""
        if cloth.layers is not None:
            raise InputError(
                "the yarns of a double weave cannot trade crimp yet: each of its two cloths has "
                "crossings of its own",
                allowed="warp_layer = 1 of [weave], which draws one layer",
                cure='Write that, or leave out [yarns], and modal.material = "yarns"',
            )
        rest = YarnMechanics(
            contact=self.contact or 0.0,
            bending=WarpAndWeft.pair(self.bending) or (0.0, 0.0),
            flattest=_FLATTEST if self.flattest is None else self.flattest,
        )
        if self.inextensible:
            return rest
        self.check()
        tension, modulus = WarpAndWeft.pair(self.tension), WarpAndWeft.pair(self.modulus)
        if modulus is None:
            return rest if tension is None else rest._replace(tension=tension)
        if cloth.density is None:
            raise InputError(
                "a modulus is for a yarn count, and this cloth does not say how heavy yarns are",
                key="modulus",
                value=modulus[0],
                cure="Give the tension instead",
            )
        each = np.empty((2, *cloth.drawdown.shape))
        for number, (yarns, size) in enumerate(zip(cloth.yarns, modulus, strict=True)):
            area = section_factor(yarns.aspect, yarns.section) * yarns.diameter**2
            force = size * cloth.density * area
            each[number] = force[:, None] if number else force
        return rest._replace(tension=each)

    def check(self) -> None:
        """Check that extensible yarns have exactly one stiffness."""
        if self.inextensible:
            return
        if self.tension is not None and self.modulus is not None:
            raise InputError(
                "there are a tension and a modulus, and each follows from the other",
                key="tension",
                value=self.tension,
                cure="Leave out one of the two",
            )
        if self.tension is None and self.modulus is None:
            raise InputError(
                "yarns that stretch need to resist it",
                key="tension",
                allowed='a force as "50 N", or modulus = "300 cN/tex"',
                cure="Give one of the two, or leave inextensible true",
            )
