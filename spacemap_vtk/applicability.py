"""What each model of the program cannot do: one table of the ranges in which they are valid.

An entry names what a model assumes, the quantity that shows whether that holds, the largest value
for which it does, what goes wrong beyond it, and what to do. A stage measures the quantity
(`spacemap_vtk.filters.algorithm.Algorithm.check_limit`). Warnings, the list that ``spacemap info``
prints, and the page of the documentation are made of these entries.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

#: Rotations beyond this angle [rad] stretch a line by more than 6 % in a linear motion.
_LARGE_ROTATION = math.radians(20.0)
#: Largest rotation [rad] up to which shapes rebuilt of a linear motion are accurate.
TRUSTED_ROTATION = math.radians(35.0)

#: Rotation [rad] from which on a linear motion shows nothing real, and is not drawn: a line that
#: turns by a right angle would become infinitely long.
REFUSED_ROTATION = math.radians(90.0)


class Limit(NamedTuple):
    """The range in which a model of a stage is valid."""

    stage: str
    """Section of the stage in scene files."""
    model: str
    """The model, with its article."""
    assumes: str
    quantity: str
    """What is measured, as a heading."""
    found: str
    """Clause of a warning, with {} for the value."""
    most: float
    """Largest valid value, in SI; infinite for an assumption that nothing measures."""
    unit: str
    """"deg" (of a value in rad), "%" (of a share), "times", or "" for a plain number."""
    basis: str
    """Where the limit comes from."""
    beyond: str
    """What is wrong beyond the limit."""
    cure: str

    def format(self, value: float) -> str:
        """Format a value of the quantity."""
        if self.unit == "deg":
            return f"{math.degrees(value):.3g}°"
        if self.unit == "%":
            return f"{round(100 * value, 4):.3g} %"
        return f"{round(value, 4):.3g}{' times' * (self.unit == 'times')}"

    def warning(self, value: float, **words: str) -> str:
        """Compose the warning about a value; `words` replace the entry's found, beyond and cure."""
        found = words.get("found", self.found).format(self.format(value))
        beyond, cure = words.get("beyond", self.beyond), words.get("cure", self.cure)
        if self.most == 0.0:
            return f"{found}: {beyond}; {cure}"
        return (
            f"{found}, but {self.model} is valid up to {self.format(self.most)}: {beyond}; {cure}"
        )


class LimitWarning(str):
    """A warning about a value beyond a limit. Of several about one limit the worst counts."""

    def __new__(cls, text: str, key: str = "", value: float = 0.0) -> LimitWarning:
        """Make a warning about the value of a limit's quantity."""
        made = super().__new__(cls, text)
        made.key, made.value = key, value
        return made

    key: str
    value: float


class Finding(NamedTuple):
    """The value of a limit's quantity in a scene."""

    key: str
    value: float | None
    """In SI; None if it is not known or cannot be measured."""

    @property
    def limit(self) -> Limit:
        """The entry of the table."""
        return LIMITS[self.key]

    @property
    def is_valid(self) -> bool | None:
        """Whether the value is within the limit; None if it is not known."""
        return None if self.value is None else self.value <= self.limit.most

    def as_json(self) -> dict[str, Any]:
        """Return the entry and the value as a dictionary; values are in SI."""
        row = self.limit._asdict()
        del row["found"]
        unit = {"deg": "rad", "%": "", "times": ""}.get(row["unit"], row["unit"])
        row |= {"unit": unit, "most": row["most"] if math.isfinite(row["most"]) else None}
        return {"limit": self.key, **row, "value": self.value, "valid": self.is_valid}


def key_of_warning(text: str) -> str:
    """Return the name of the limit that a warning is about, or its text."""
    return text.key if isinstance(text, LimitWarning) else text


def add_warning(known: dict[str, str], text: str) -> None:
    """Add a warning to those known by their keys; of several about a limit the worst stays."""
    key = key_of_warning(text)
    former = known.get(key)
    if not (isinstance(former, LimitWarning) and isinstance(text, LimitWarning)):
        known.setdefault(key, text)
    elif text.value > former.value:
        known[key] = text


#: Cure for motions that are too large for linear vibrations.
_STEPS = (
    "use [transient] instead of [response], or let it hang under the load ([modal] gravity, "
    "dead_loads)"
)
#: Cure for strains that are too large for a linear law.
_LESS_STRAIN = "lower the loads, or give a stiffer material"

#: The entries, by the names under which stages and JSON know them.
LIMITS: dict[str, Limit] = {
    "locking": Limit(
        stage="modal",
        model="a thin cage of tetrahedra",
        assumes="strains that are uniform (linear) or linear (quadratic) in each tetrahedron",
        quantity="stiffness in bending or twist over that of a plate",
        found="the cage bends or twists {} too stiffly",
        most=2.0,
        unit="times",
        basis="bending and twist of plates, estimated within 30 % for linear tetrahedra "
        "(`tests/test_locking.py`)",
        beyond="frequencies are too high by the square root",
        cure='set modal.elements = "sheet" with cage.divisions = [nx, ny, 1], or cage.order = 2',
    ),
    "volume": Limit(
        stage="modal",
        model="a cage of linear tetrahedra",
        assumes="a material whose volume can change",
        quantity="Poisson's ratio, or its equivalent for an orthotropic material",
        found="Poisson's ratio is {}",
        most=0.45,
        unit="",
        basis="the usual limit: volumetric locking grows as 1/(1 - 2 ν)",
        beyond="it is too stiff (volumetric locking)",
        cure="set [cage] order = 2 (quadratic tetrahedra), or lower poissons_ratio to 0.45",
    ),
    "thickness": Limit(
        stage="modal",
        model="a solid with the stretch of a measured fabric",
        assumes="a thickness at which the fabric's stretch and bending belong together",
        quantity="bending rigidity over that of the fabric, or its inverse",
        found="the cage bends {} too stiffly or too softly",
        most=2.0,
        unit="times",
        basis="a plate bends with the cube of its thickness and stretches with the first power",
        beyond="it sags and vibrates unlike the fabric",
        cure='set modal.elements = "sheet"',
    ),
    "rounding": Limit(
        stage="modal",
        model="an eigenvalue in 64-bit numbers",
        assumes="bending that is not too soft beside stretching",
        quantity="rounding error of an eigenvalue",
        found="rounding errors of eigenvalues reach {}",
        most=1e-4,
        unit="%",
        basis="error bound of the solver (`spacemap_vtk.mechanics.modal.eigen`)",
        beyond="low frequencies have few correct digits",
        cure="use a thicker cage, fewer divisions or more modes",
    ),
    "fold": Limit(
        stage="modal",
        model="a sheet of bilinear cells",
        assumes="folds that are wide compared with a cell",
        quantity="largest turn of the sheet from one vertex to the next",
        found="the sheet turns by up to {} within a cell",
        most=math.radians(60.0),
        unit="deg",
        basis="clamped strips that hang, 4 and 7.3 bending lengths long: their ends are wrong by "
        "0.5 to 2 % of the length at 60°, 2 to 5 % at 90° (`tests/test_applicability.py`)",
        beyond="it bends too softly in this fold",
        cure="make cells narrower than a third of the bending length, as "
        'cage.divisions = "auto" does',
    ),
    "lean": Limit(
        stage="modal",
        model="a sheet whose shear is sampled at edges",
        assumes="normals of vertices that stay upright on the cells around them",
        quantity="largest angle between the normal of a vertex and its cells",
        found="a normal leans by {} against the cells around it",
        most=math.radians(45.0),
        unit="deg",
        basis="normals that lean to opposite sides at the ends of an edge are upright on average; "
        "in cells six times as wide as the radius of a bend they save more than 80 % of its "
        "energy, and reversed from one line of vertices to the next two thirds in any cells "
        "(`tests/test_applicability.py`); normals at a clamp lean by half the turn of its cell",
        beyond="the fold has lost most of its rigidity",
        cure="increase cage.divisions, so that cells are no longer than the radius of the folds, "
        "along both sides",
    ),
    "strain": Limit(
        stage="modal",
        model="a linear law of material",
        assumes="stress that is proportional to Green's strain (St. Venant and Kirchhoff)",
        quantity="largest change of a length within the cage or sheet",
        found="the material is stretched or compressed by up to {}",
        most=0.1,
        unit="%",
        basis="forces of linear laws in Green's, nominal and logarithmic strain differ by 15 % at "
        "10 %; in compression the force of this one has a maximum at 42 % (closed form)",
        beyond="real materials stiffen in compression, and this law softens",
        cure=_LESS_STRAIN,
    ),
    "law": Limit(
        stage="modal",
        model="linear stretch of woven cloth",
        assumes="yarns that keep their crimp",
        quantity="largest strain along warp or weft over the least crimp of the yarns",
        found="the sheet is stretched or compressed by {} of the crimp of its yarns",
        most=0.1,
        unit="%",
        basis="second derivative of the energy of crimp interchange against the energy itself: "
        "the force of a free strip is about 11 % too low at a tenth of the crimp, 38 % at a third "
        "(`tests/test_applicability.py`)",
        beyond="cloth stiffens as its yarns straighten, and does not resist compression like this",
        cure='set modal.law = "yarns", with [transient] if the cloth moves, or lower the loads',
    ),
    "kinds": Limit(
        stage="modal",
        model="a law of twelve kinds of crossings",
        assumes="other crossings that are like these",
        quantity="largest difference of forces from those of all kinds of crossings",
        found="forces of the yarns differ by up to {} from those of all kinds of crossings",
        most=0.05,
        unit="%",
        basis="computed at seven stretches of the cloth; drafts of equal yarns have at most twelve "
        "kinds that differ (`tests/test_membrane_law.py`)",
        beyond="the cloth is pulled with this error",
        cure="give yarns of one family the same thickness, or choose a draft with fewer floats "
        "that differ",
    ),
    "no_slip": Limit(
        stage="modal",
        model="cloth from its yarns",
        assumes="circular or lens-shaped yarns that touch as Peirce drew them, rods that bend over "
        "their whole length, crossings that do not slip",
        quantity="",
        found="",
        most=math.inf,
        unit="",
        basis="the papers that `spacemap_vtk.textile.crimp.stiffness` names; the page of measured "
        "cloth compares",
        beyond="bending is that of yarns without friction, the least possible; set yarns that "
        "press less at crossings shear more softly",
        cure="give the measured values ([modal] bending_rigidity, shear_rigidity) where there are",
    ),
    "frictionless": Limit(
        stage="modal",
        model="a sheet of relaxed yarns",
        assumes="round yarns without friction; those of a weft knit are straight if free, all "
        "others are set in their shape, without any force there; a linear law holds for strains of "
        "a few thousandths, in which what touches stays in touch",
        quantity="",
        found="",
        most=math.inf,
        unit="",
        basis="energies of one cell (`spacemap_vtk.textile.rods.stiffness`); the tangent of "
        "stockinette at rest is four to five times its secant at 4 %, that of heat-set tricot ten "
        "times",
        beyond="friction makes real knits stiffer in bending and shear, and set lets them curl "
        "less; loops stiffen as they straighten",
        cure='give measured values ([modal] bending_rigidity, shear_rigidity), or law = "yarns"',
    ),
    "obstacle": Limit(
        stage="modal",
        model="contact at samples of the cells",
        assumes="obstacles that are wide compared with a cell",
        quantity="width of a cell over the half width of an obstacle that it touches",
        found="the width of a cell is {} of half that of an obstacle that it touches",
        most=1.0,
        unit="%",
        basis="trials of strips over rods: where cells are as wide as the radius, the rod enters "
        "the sheet by 3 to 10 % of it, and at twice that by 10 to 43 %",
        beyond="the cage lies on it too flat, and enters it or passes it between two samples",
        cure="increase cage.divisions, or use a thicker obstacle",
    ),
    "rotation": Limit(
        stage="response",
        model="a linear motion",
        assumes="displacements that are small against the cage",
        quantity="largest rotation of an element",
        found="the cage turns by up to {}",
        most=_LARGE_ROTATION,
        unit="deg",
        basis="a line that turns by θ is stretched by 1/cos θ: 6 % at 20°",
        beyond="it stretches parts that turn",
        cure="add a section [rotation] (RotationStrain), or lower the load",
    ),
    "contact": Limit(
        stage="response",
        model="a linear motion about a state in contact",
        assumes="that what touches at rest stays in touch, and nothing else touches",
        quantity="displacement over that at which contact with an obstacle first opens",
        found="the motion is {} of that at which the cage lifts off an obstacle",
        most=1.0,
        unit="%",
        basis="force of contact that becomes a pull, spread over a cell "
        "(`spacemap_vtk.mechanics.contact.opening`)",
        beyond="it holds what would lift off",
        cure="use [transient] instead of [response], or lower the load",
    ),
    "inversion": Limit(
        stage="response",
        model="a shape of the cage",
        assumes="elements that are not turned inside out",
        quantity="share of the elements that are turned inside out",
        found="{} of the elements are turned inside out",
        most=0.0,
        unit="%",
        basis="sign of their volumes; of a sheet, of its cells' normals",
        beyond="the object inside them is, too",
        cure="lower the loads or make the cage stiffer",
    ),
    "crossing": Limit(
        stage="response",
        model="a sheet without contact of its layers",
        assumes="layers that do not meet",
        quantity="share of the cells through which other cells pass",
        found="{} of the cells pass through others",
        most=0.0,
        unit="%",
        basis="edges of cells that pierce triangles of other cells",
        beyond="cloth cannot do that",
        cure="set contact.self = true (with the extra [contact]), choose a smaller or stiffer "
        "cloth, or show an earlier time",
    ),
    "swing": Limit(
        stage="rotation",
        model="a shape rebuilt from a linear motion",
        assumes="forces that turn with the cage, and frequencies of small motions",
        quantity="largest rotation of an element",
        found="the cage turns by up to {}",
        most=TRUSTED_ROTATION,
        unit="deg",
        basis="clamped strips under a load: wrong by 5 % of their length at 37°, 13 % at 57°, 51 % "
        "at 115° (`tests/test_rotation_coordinates.py`); pendulums: 2 K(sin θ/2)/π",
        beyond="its shape is not reliable, and a large swing is too fast (its period is that of a "
        "small one, which is 4 % too short at 45° and 18 % at 90°)",
        cure=_STEPS,
    ),
    "turned_strain": Limit(
        stage="rotation",
        model="a shape rebuilt from rotation and strain",
        assumes="elements that are strained first, then turned",
        quantity="largest rotation in rad times largest strain of an element",
        found="rotation times strain reaches {}",
        most=0.05,
        unit="%",
        basis="exp(ω)(1 + ε) and exp(ω + ε) differ by up to |ω||ε| "
        "(Baker, Campbell and Hausdorff); a strip twisted by 90° does not converge below 0.3 % of "
        "its length",
        beyond="the order of strain and rotation, which a linear motion does not know, shows",
        cure=_STEPS,
    ),
    "jam": Limit(
        stage="yarns",
        model="Peirce's arcs",
        assumes="yarns that have room to bend further",
        quantity="share of the crossings that are jammed",
        found="{} of the crossings are jammed",
        most=0.0,
        unit="%",
        basis="no straight part of a yarn is left: θ = l/D",
        beyond="yarns cannot bend further",
        cure="compress the cage less",
    ),
    "slack": Limit(
        stage="yarns",
        model="a path of arcs and straight lines",
        assumes="yarns that are as long as their path",
        quantity="excess of a yarn's length over its path",
        found="yarns are up to {} longer than their path",
        most=0.02,
        unit="%",
        basis="an excess of 2 % would be a wave of 9 % of its length in height",
        beyond="a slack yarn would form waves or loops, which are not drawn",
        cure="compress the cage less",
    ),
    "no_crimp": Limit(
        stage="yarns",
        model="a yarn that keeps its length",
        assumes="crimp that is left to give",
        quantity="strain of the yarns",
        found="yarns have no crimp left: they are strained by up to {}",
        most=0.01,
        unit="%",
        basis="spun yarns break at a few percent",
        beyond="a real yarn would stretch, or break",
        cure="lower the loads, or make the cage stiffer along its yarns",
    ),
    "embedded": Limit(
        stage="warp",
        model="a weave that is embedded without [yarns]",
        assumes="yarns that stretch as the space around them",
        quantity="largest change of a length of the cloth along warp or weft",
        found="yarns are stretched or compressed by up to {} with the space around them",
        most=0.05,
        unit="%",
        basis="a basket weave pulled by 1/6 strains its yarns by 12 % in this way, where a "
        "simulation of its yarns gives 3 % (MADYPG, github.com/kamleshbhalui/MADYPG)",
        beyond="real yarns keep their length and exchange crimp",
        cure="add a section [yarns]",
    ),
    "thick_fold": Limit(
        stage="warp",
        model="a thick cloth in a thin sheet",
        assumes="bends that are wide compared with the cloth's thickness",
        quantity="half the thickness of the cloth times its largest curvature",
        found="bends are so tight that half the thickness is {} of their radius",
        most=0.5,
        unit="%",
        basis="yarns on the inner side are compressed by this share; at 100 % they fold over",
        beyond="yarns on the inner side overlap each other",
        cure="make the sheet stiffer in bending, or the yarns thinner",
    ),
    "locked": Limit(
        stage="warp",
        model="a weave in a sheared cage",
        assumes="neighbouring yarns that do not touch",
        quantity="angle of shear over that at which neighbours of one family touch",
        found="the cloth is sheared to {} of the angle that its yarns allow",
        most=1.0,
        unit="%",
        basis="cos γ = width/spacing",
        beyond="neighbouring yarns overlap",
        cure="raise modal.shear_rigidity, or lower the loads",
    ),
}
