"""Bias extension: a strip cut at 45° to its yarns, 10 cm by 5 cm between clamps, is pulled.

FAST-3 measures its extension EB5 at 5 gf/cm, and takes G = 123/EB5 (EB5 in %, G in N/m): a strip
that is sheared alike everywhere has F/w = 4 G e. Between clamps only its middle is wholly sheared:
if yarns keep their length, cloth at the clamps stays as it is, and between both the shear is half
of that of the middle (Potluri et al., Composites A 37 (2006) 303; Cao et al., Composites A 39
(2008) 1037). With the width w, the distance L >= 2 w of the clamps and their move δ, the middle is
sheared by

    γ = 90° - 2 arccos[(L - w + δ)/(√2 (L - w))]

and for small moves the force is F/w = 4 G δ (L - 5 w/4)/(L - w)². Yarns that stretch shear less.

Cells across the yarns would lock: with a stretching stiffness of 400 G, 12 cells in the width give
a force that is 43 % too high. The cells therefore lie along the yarns.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from spacemap_vtk.cage.lattice import TETRAHEDRA_PER_CELL, build_lattice
from spacemap_vtk.laboratory.fabric import Fabric
from spacemap_vtk.laboratory.records import (
    DEGREE,
    GF_PER_CM,
    N_PER_M,
    PERCENT,
    Axis,
    Curve,
    Measurement,
    Reading,
    States,
    add_errors,
)
from spacemap_vtk.mechanics.boundary.fittings import NO_FITTINGS
from spacemap_vtk.mechanics.boundary.grips import Grip
from spacemap_vtk.mechanics.contact.path import states_on_path
from spacemap_vtk.mechanics.contact.surfaces import Surface
from spacemap_vtk.mechanics.elements.shell import MidSurface, find_mid_surface, shape_slopes
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.ndarrays import Floats, Progress

#: Width of the specimen and distance of the clamps [m].
WIDTH, LENGTH = 0.05, 0.10
#: Diagonals of cells in the width, in the solutions that give the figures and their errors, and
#: the share of the work after each.
_CELLS = ((10, 0.75), (5, 0.92), (3, 1.0))
#: Order in which figures converge if yarns hardly stretch, as zones of different shear meet along
#: yarns. Measured: 0.9.
_ORDER = 1.0
#: Extension at the end, where the middle is sheared by 39°, and number of steps.
LARGEST, _STEPS = 0.14, 28
#: Force per width at which FAST-3 reads the extension [N/m], and its factor of G [N/m · %].
_FORCE, _FAST = 5.0 * GF_PER_CM.size, 123.0
#: Extension at which shear angles are printed.
_PRINTED = 0.10
#: Radius of the middle, over the width.
_MIDDLE = 1 / 6
#: Mass per volume that the model needs, but no state at rest [kg/m³].
_DENSITY = 1.0


class Pulled(NamedTuple):
    """A strip on the bias at n extensions."""

    force: Floats
    """(n,), force per width [N/m]."""
    angle: Floats
    """(n,), shear angle in the middle [rad]."""
    states: States
    """Its states, pulled upwards."""


def measure(fabric: Fabric, progress: Progress) -> Measurement:
    """Pull a strip along its bias."""
    extension = np.linspace(0.0, LARGEST, _STEPS + 1)
    kinematic = kinematic_angle(extension)
    # the loops of a knit have no angle that rigid yarns would keep
    curves = [] if fabric.loops else [Curve("rigid yarns", extension, kinematic)]
    figures, states, before = [], None, 0.0
    for cells, after in _CELLS:
        found = pull_bias(fabric, extension, partial(_report_part, progress, before, after), cells)
        figures.append(_readings(extension, found))
        before = after
        if states is None:
            states = found.states
            curves.insert(0, Curve("middle", extension, found.angle))
    count = [cells for cells, _ in _CELLS]
    ratios = count[0] / count[1], count[1] / count[2]
    readings, doubts = add_errors(*figures, ratios=ratios, order=_ORDER)
    if not fabric.loops:
        value = float(np.interp(_PRINTED, extension, kinematic))
        name = f"of rigid yarns at {_PRINTED:.0%}"
        readings.append(Reading("γ", name, "bias", value, DEGREE, exact=True))
    note = "G of FAST is that of a strip without clamps: it is too high by a half here"
    return Measurement(
        readings,
        curves,
        Axis("extension", PERCENT),
        Axis("shear angle", DEGREE),
        [note, *doubts],
        states=states,
    )


def _readings(extension: Floats, found: Pulled) -> list[Reading]:
    """Return the figures of a strip that is pulled to extensions (n,)."""
    middle = float(np.interp(_PRINTED, extension, found.angle))
    name = f"shear in the middle at {_PRINTED:.0%}"
    angle = Reading("γ", name, "bias", middle, DEGREE)
    if found.force[-1] < _FORCE:
        note = f"the force stays below 5 gf/cm up to {LARGEST:.0%}"
        return [Reading("EB5", "extension", "bias", None, PERCENT, note=note), angle]
    value = float(np.interp(_FORCE, found.force, extension))
    rigidity = _FAST / (100.0 * value)
    return [
        Reading("EB5", "extension", "bias", value, PERCENT),
        Reading("G", "shear rigidity, 123/EB5", "bias", rigidity, N_PER_M),
        angle,
    ]


def _report_part(progress: Progress, before: float, after: float, share: float) -> None:
    """Report the progress of a part of the work."""
    progress(before + share * (after - before))


def kinematic_angle(extension: Floats, width: float = WIDTH, length: float = LENGTH) -> Floats:
    """Compute the shear angle [rad] of the middle if yarns keep their length, (n,)."""
    diagonal = (length - width + extension * length) / (2**0.5 * (length - width))
    found: Floats = np.pi / 2 - 2 * np.arccos(np.minimum(diagonal, 1.0))
    return found


def pull_bias(
    fabric: Fabric,
    extension: Floats,
    progress: Progress = lambda share: None,
    cells: int = _CELLS[0][0],
) -> Pulled:
    """Pull a strip on the bias to extensions from 0 on, (n,), in cells along the yarns."""
    # Zones of different shear meet along yarns, so that cells along the yarns do not lock. Vertices
    # lie on the edges of the specimen; cells that an edge halves have half of the stiffness.
    thick, side = fabric.thickness / 2, WIDTH / (2**0.5 * cells)
    along = round(cells * LENGTH / WIDTH)
    count = cells + along + 2
    reach = side * count / 2
    points, tetrahedra = build_lattice((-reach, reach) * 2 + (-thick, thick), (count, count, 1))
    blocks = tetrahedra.reshape(-1, TETRAHEDRA_PER_CELL, 4)
    corners = points[blocks.reshape(len(blocks), -1)]
    middle = (corners.min(axis=1) + corners.max(axis=1)) / 2
    half = 0.5**0.5
    way = np.array([half, half, 0.0])
    across = abs(middle @ [half, -half, 0.0]) / (WIDTH / 2)
    height = abs(middle @ way) / (LENGTH / 2)
    kept = (across < 1 + 1e-9) & (height < 1 - 1e-9 + 1.0 / along)
    share = np.where((across > 1 - 1e-9) | (height > 1 - 1e-9), 0.5, 1.0)[kept]
    used, blocks_of = np.unique(blocks[kept], return_inverse=True)
    points, tetrahedra = points[used], blocks_of.reshape(-1, 4)
    far = abs(points @ way) > LENGTH / 2 * (1 - 1e-9)
    upper = far & (points @ way > 0)
    moves = np.outer(LENGTH * extension, way)
    held = np.repeat(upper[:, None], 3, axis=1)
    grip = Grip(held, LENGTH / 2 * way, moves, np.zeros_like(moves))
    whole = np.repeat(far[:, None], 3, axis=1)
    whole[:, 2] = True  # flat
    fittings = NO_FITTINGS._replace(stiffness_factors=np.repeat(share, TETRAHEDRA_PER_CELL))
    model = Model(points, tetrahedra, fabric.plate, _DENSITY, whole, fittings=fittings)
    surface = find_mid_surface(points, tetrahedra)
    assert surface is not None
    rest = surface.to_nodes(points)[surface.quads][..., :2]
    near = np.linalg.norm(rest.mean(axis=1), axis=1) < _MIDDLE * WIDTH
    slopes = shape_slopes(np.zeros(2))
    legs = np.linalg.inv(np.einsum("ka,eai->eik", slopes, rest[near]))
    force, angle, moved = [], [], []
    # In the film the bias points upwards.
    upright = np.array([[half, -half, 0.0], way, [0.0, 0.0, 1.0]])
    for number, state in enumerate(states_on_path(model, grips=[grip])):
        places = surface.to_nodes(points + state.displacement)[surface.quads][near][..., :2]
        weft, warp = (np.einsum("ka,eai->eik", slopes, places) @ legs).mean(axis=0).T
        cosine = weft @ warp / np.linalg.norm(weft) / np.linalg.norm(warp)
        # Pulled along the bisector of weft and warp, they close.
        angle.append(np.pi / 2 - np.arccos(cosine))
        force.append(float(state.holding[upper].sum(axis=0) @ way) / WIDTH)
        moved.append((points + state.displacement) @ upright.T - points)
        progress((number + 1) / len(extension))
    states = States(
        points,
        tetrahedra,
        np.array(moved),
        np.stack([extension, angle], axis=1),
        "front",
        _cut_strip(points, surface),
    )
    return Pulled(np.array(force), np.array(angle), states)


def _cut_strip(points: Floats, surface: MidSurface) -> Surface:
    """Make the mid-surface of the specimen, whose edges halve cells."""
    middle = surface.to_nodes(points)[: len(surface.pairs)]
    along, across = abs(middle @ [[1.0, 1.0], [1.0, -1.0], [0.0, 0.0]]).T / 2**0.5
    inside = ((along < LENGTH / 2 * (1 + 1e-9)) & (across < WIDTH / 2 * (1 + 1e-9)))[surface.quads]
    whole, cut = surface.quads[inside.all(axis=1)], inside.sum(axis=1) == 3
    triangles = np.concatenate(
        [whole[:, [0, 1, 2]], whole[:, [0, 2, 3]], surface.quads[cut][inside[cut]].reshape(-1, 3)]
    )
    return Surface(middle, np.tile([0.0, 0.0, 1.0], (len(middle), 1)), triangles)
