"""Parameters for the stiffness of yarns."""

from __future__ import annotations

from typing import Any

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.io import registry
from spacemap_vtk.parameters import Choice, FilePath, Flag, Parameterised, Real, Series
from spacemap_vtk.textile.crimp.contact_law import ContactLaw, MeasuredContact, VanWykContact
from spacemap_vtk.textile.crimp.interchange import YarnMechanics
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.yarn import section_factor

_FLATTEST = YarnMechanics().flattest
#: Condition for parameters that have an effect only if yarns stretch.
_ELASTIC = {"inextensible": (False,)}


class WarpAndWeft(Series):
    """One value for both directions of a fabric, or one for the warp and one for the weft."""

    list_meaning = "for the warp and the weft"

    def convert(self, value: Any) -> Any:
        """Convert to a checked value, or to a tuple of two."""
        result = super().convert(value)
        if isinstance(result, tuple) and len(result) != 2:
            raise InputError(f"there must be 1 or 2 values, not {len(result)}")
        return result

    @staticmethod
    def pair(value: Any) -> tuple[float, float] | None:
        """Return the values for warp and weft; None if there is no value."""
        if value is None or isinstance(value, tuple):
            return value
        return value, value

    def format_figure(self, value: Any) -> str:
        """Format the figures of warp and weft, or one for both if they are equal."""
        warp, weft = (self.component.format_figure(each) for each in self.pair(value) or ())
        return warp if warp == weft else f"warp {warp}, weft {weft}"


class YarnParameters(Parameterised):
    """Parameters for the stiffness of yarns."""

    inextensible = Flag(
        True,
        "Keep the length of yarns: where the cloth is pulled, they lose crimp, and then flatten "
        "each other. The rest is reported as yarn strain. False: yarns stretch and exchange crimp "
        "according to their stiffness.",
    )
    tension = WarpAndWeft(
        Real(
            None,
            "Tensile stiffness EA of a yarn: force over strain, the slope of its tensile test. One "
            "value, or one for the warp and one for the weft.",
            unit="N",
            above=0.0,
        ),
        automatic="from the modulus",
        when=_ELASTIC,
    )
    modulus = WarpAndWeft(
        Real(
            None,
            "Specific modulus of a yarn, instead of the tension; EA is the modulus times the yarn "
            'count. Spun cotton has about "300 cN/tex"; fibres have, in cN/tex: cotton 500, wool '
            "230, nylon 260, polyester 1000, flax 1800, glass 2800. One value, or one for the warp "
            "and one for the weft.",
            unit="N.m/kg",
            above=0.0,
        ),
        automatic="from the tension",
        when=_ELASTIC,
    )
    contact = Real(
        None,
        "Stiffness of a crossing against flattening: half the contact force over the relative loss "
        "of thickness.",
        unit="N",
        minimum=0.0,
        automatic="none: crossings flatten as much as the yarns require",
    )
    van_wyk = Real(
        None,
        "Constant c of van Wyk's law of contact, instead of contact: the contact force of a "
        "crossing is c ((D0/D)^3 - 1), where D0/D is the thickness at rest over that when pressed. "
        "c is K E times the cube of the share of fibre and the area of contact; K is the user's: "
        "no value for yarns was verified.",
        unit="N",
        above=0.0,
        automatic="none",
    )
    contact_curve = FilePath(
        None,
        "Text file of a measured law of contact, instead of contact: a line for each point, with "
        "the relative loss of thickness of a crossing (0 at rest) and the contact force in N.",
        automatic="none",
    )
    flattest = Real(
        None,
        "Least distance of the axes at a crossing, over that of the yarns as woven, at which the "
        "fibres are packed as closely as possible. 1: crossings are hard and do not flatten.",
        above=0.0,
        maximum=1.0,
        automatic=f"{_FLATTEST:.3g}, for fibres that fill 60 % of a yarn's section",
    )
    bending = WarpAndWeft(
        Real(
            None,
            "Bending rigidity B of a yarn: moment over curvature. It decides the shape of slack "
            "yarns. "
            "One value, or one for the warp and one for the weft.",
            unit="N.m2",
            minimum=0.0,
        ),
        automatic="none: all yarns bend equally",
    )
    bending_arcs = Choice(
        "free",
        "How much of a yarn bends with the cloth. free: its whole length, as without friction; "
        "this is the least bending rigidity that such yarns give a cloth. rigid: only the straight "
        "parts between its arcs around other yarns, to which friction holds it; this is the "
        'largest. "spacemap info" prints both.',
        ["free", "rigid"],
    )

    friction = Real(
        None,
        "Coefficient of friction of yarns on each other. In the shear test of spacemap measure, "
        "crossings then slip and give hysteresis.",
        minimum=0.0,
        automatic="not known: hysteresis is not modelled",
        when=_ELASTIC,
    )

    def yarns(self, cloth: Cloth) -> YarnMechanics:
        """Return the mechanics of a cloth's yarns; a modulus is multiplied by their counts."""
        if cloth.layers is not None:
            raise InputError(
                "yarns of a double weave cannot exchange crimp: its two cloths have separate "
                "crossings",
                allowed="warp_layer = 1 in [weave]",
                cure='Set this to draw one layer, or remove [yarns] and modal.material = "yarns"',
            )
        contact, law = self._contact_law()
        rest = YarnMechanics(
            contact=contact,
            law=law,
            rigid_arcs=self.bending_arcs == "rigid",
            bending=WarpAndWeft.pair(self.bending) or (0.0, 0.0),
            flattest=_FLATTEST if self.flattest is None else self.flattest,
        )
        if self.inextensible:
            return rest
        self.check()
        tension, modulus = WarpAndWeft.pair(self.tension), WarpAndWeft.pair(self.modulus)
        if modulus is None:
            return rest if tension is None else rest._replace(tension=tension)
        if cloth.densities is None:
            raise InputError(
                "a modulus needs the yarn count, which this cloth does not have",
                key="modulus",
                value=modulus[0],
                cure="Give the tension instead",
            )
        each = np.empty((2, *cloth.drawdown.shape))
        for number, (yarns, size) in enumerate(zip(cloth.yarns, modulus, strict=True)):
            area = section_factor(yarns.aspect, yarns.section) * yarns.diameter**2
            force = size * cloth.densities[number] * area
            each[number] = force[:, None] if number else force
        return rest._replace(tension=each)

    def _contact_law(self) -> tuple[float, ContactLaw]:
        """Return the law of contact and its factor; half of a contact force, see `contact`."""
        given = [n for n in ("contact", "van_wyk", "contact_curve") if getattr(self, n) is not None]
        if len(given) > 1:
            raise InputError(
                f"{given[0]} is given, too, and states the same",
                key=given[1],
                value=str(getattr(self, given[1])),
                cure=f"Leave out {given[0]} or {given[1]}",
            )
        if self.van_wyk is not None:
            return 0.5 * self.van_wyk, VanWykContact()
        if self.contact_curve is None:
            return self.contact or 0.0, ContactLaw()
        try:
            points = np.transpose(registry.read(self.contact_curve, "table"))
            return 0.5, MeasuredContact(points)
        except InputError as error:
            error.key = "contact_curve"  # readers name their own parameter
            raise

    def check(self) -> None:
        """Check that extensible yarns have exactly one stiffness."""
        if self.inextensible:
            return
        if self.tension is not None and self.modulus is not None:
            raise InputError(
                "tension and modulus cannot be given together",
                key="tension",
                value=self.tension,
                cure="Leave out one of the two",
            )
        if self.tension is None and self.modulus is None:
            raise InputError(
                "yarns that stretch need a tension or a modulus",
                key="tension",
                allowed='a force as "50 N", or modulus = "300 cN/tex"',
                cure="Give one of them, or set inextensible = true",
            )
