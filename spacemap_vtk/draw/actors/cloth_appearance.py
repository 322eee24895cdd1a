"""Tables of how a cloth looks from afar, measured on the yarns that near pictures show.

A part of the cloth with each local weave is viewed from a grid of directions. For each view, the
visible surface is sorted by family and by its normal. A sheet sums the light of a style over these
normals, so that its mean light is that of the yarns, for any weave, section and light. Nothing is
fitted.

From the view of each face also follows, for each local weave, which yarns are visible there and how
much light arrives at them, relative to the mean of the cloth. So each place has the shade of its
own weave. For yarns that are a few pixels wide, this view is kept crossing by crossing, as a tile
for each local weave.
"""

from __future__ import annotations

import hashlib
from dataclasses import fields, is_dataclass
from itertools import product
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.draw.actors.lighting import BOUNCE, arriving_light, exposure_of
from spacemap_vtk.ndarrays import Bools, Floats, Ints, Singles
from spacemap_vtk.textile.geometry.cloth_axes import YarnSelection
from spacemap_vtk.textile.geometry.partition import crop_cloth, representative_parts
from spacemap_vtk.textile.geometry.visible_surface import (
    VisibleSurface,
    sample_surface,
    view_surface,
    weights_of_crossings,
)
from spacemap_vtk.textile.weave.cloth import Cloth

#: Angles between the eye and the normal of the cloth, in degrees, and number of directions of the
#: eye around the normal.
TILTS = (0.0, 25.0, 45.0, 62.0, 78.0)
TURNS = 8
#: Normals along each side of the grid of normals, which is stereographic: a normal n lies at
#: p = (n.x, n.y) / (1 + n.z). The nodes are at p = t |t| for t in equal steps from -1 to 1, closer
#: around the normal of the cloth, where most normals are.
NODES = 9
#: Strength of contact shadows for which means of exposures are exact: about that of all styles.
_SHADOWS = 0.6
#: Neighbours on both sides of a crossing whose yarns may be visible there.
REACH = 1
#: Texels along each side of the tile of a crossing, a power of 2.
TILE = 8
#: Tiles in a row of the texture of tiles.
TILES_IN_ROW = 64
#: Largest number of crossings that are viewed, from the face and from other directions.
_MOST_CROSSINGS = 256
#: Crossings at the border of a part that are not counted.
_MARGIN = 2
#: Crossings along each side of the part that is viewed from other directions than the face.
_TILTED = 12
#: Crossings from one place that is tried for this part to the next.
_STEP = 2
#: Pixels of a view along each side of a crossing: of the face, and from other directions.
_PIXELS = 12.37
_TILTED_PIXELS = 6.37


class AppearanceTables(NamedTuple):
    """Tables for the shaders of `spacemap_vtk.draw.actors.sheet_actor`."""

    views: Singles
    """For each view, the share of a crossing that each normal of the warp and of the weft fills,
    and the exposures of both, (views, NODES² + 1, 4). Views are ordered by face (front, back), tilt
    and turn. The last column has the share that is open, 0, and for warp and weft the light with
    reflections between white yarns over that of equal exposures."""
    tiles: NDArray[np.uint8]
    """Texture of the tiles, (rows, columns, 4): six blocks of rows, one above the other. First for
    warp and weft on the front, then on the back: normal and share. Then the exposures of these
    four, times their shares. Last the open shares on both faces."""


class ClothAppearance:
    """How a cloth looks from afar; its views are made when they are needed."""

    def __init__(self, cloth: Cloth) -> None:
        crop = _middle_part(cloth)
        parts, weaves = representative_parts(crop, _MOST_CROSSINGS)
        self._weights = weights_of_crossings(weaves, parts, _MARGIN)
        self._facets = [
            sample_surface(crop, YarnSelection(ends, picks), _PIXELS) for ends, picks in parts
        ]
        self._sizes = [each.size for each in self._facets]
        tilted = _typical_part(weaves, parts[0])
        self._tilted_facets = sample_surface(crop, YarnSelection(*tilted), _TILTED_PIXELS)
        self._spacing = self._tilted_facets.spacing
        self._tilted_weights = weights_of_crossings(weaves, [tilted], _MARGIN)[0]
        self._tilted_drawdown = crop.drawdown[tilted[1], tilted[0]]
        self._drawdowns = [crop.drawdown[picks, ends] for ends, picks in parts]
        self._weaves = [weaves[picks, ends] for ends, picks in parts]
        #: Crossings of each part that tiles are made of.
        self._viewed = [each > 0.0 for each in self._weights]
        self._views: dict[tuple[float, float, int], list[VisibleSurface]] = {}
        self._tables: dict[bool, AppearanceTables] = {}
        self._light_shares: dict[tuple[int, bool], Singles] = {}
        self._warp_over = float(cloth.drawdown.mean())
        #: Tile of each crossing of the cloth.
        self.numbers = self._number_tiles(cloth, crop, weaves, parts)

    def _number_tiles(
        self, cloth: Cloth, crop: Cloth, weaves: Ints, parts: list[tuple[slice, slice]]
    ) -> NDArray[np.uint16]:
        """Number the tiles; two more stand for local weaves that were not viewed."""
        # A tile without any viewed crossing would be a hole. Local weaves that are only found in
        # the margins are viewed there, except at the borders, where their neighbours are missing.
        seen = self._viewed_weaves()
        near_borders = weights_of_crossings(weaves, parts, 1)
        for viewed, there, weave in zip(self._viewed, near_borders, self._weaves, strict=True):
            viewed |= (there > 0.0) & ~np.isin(weave, seen)
        seen = self._viewed_weaves()
        self._tile_of_weave = np.full(int(weaves.max()) + 1, -1)
        self._tile_of_weave[seen] = np.arange(len(seen))
        self._tile_count = len(seen) + 2
        if crop is not cloth:
            return len(seen) + cloth.drawdown.astype(np.uint16)
        numbers = self._tile_of_weave[weaves]
        missing = numbers < 0
        numbers[missing] = len(seen) + cloth.drawdown[missing]
        return numbers.astype(np.uint16)

    def _viewed_weaves(self) -> Ints:
        """Return the local weaves with a viewed crossing."""
        both = zip(self._weaves, self._viewed, strict=True)
        return np.unique(np.concatenate([weave[viewed] for weave, viewed in both]))

    def tables(self, tilted: bool) -> AppearanceTables:
        """Return the tables for all directions, or only for that of the face."""
        if tilted not in self._tables:
            rows = []
            for side in (1, -1):
                face = self._row((0.0, 0.0, side))
                rows += [face] * TURNS
                for tilt in TILTS[1:]:
                    turns = [(tilt, 360.0 * turn / TURNS, side) for turn in range(TURNS)]
                    rows += [self._row(view) if tilted else face for view in turns]
            views = [row.T for row in rows]
            self._tables[tilted] = AppearanceTables(
                np.stack(views).astype(np.float32), self._tiles()
            )
            self._facets.clear()  # the views of both faces are kept
        return self._tables[tilted]

    def _visible(self, view: tuple[float, float, int]) -> list[VisibleSurface]:
        if view not in self._views:
            tilt, turn = np.radians(view[:2])
            eye = np.array([np.cos(turn) * np.sin(tilt), np.sin(turn) * np.sin(tilt), np.cos(tilt)])
            eye[2] *= view[2]
            if tilt == 0.0:
                self._views[view] = [view_surface(each, eye, _PIXELS) for each in self._facets]
            else:
                self._views[view] = [view_surface(self._tilted_facets, eye, _TILTED_PIXELS)]
        return self._views[view]

    def _row(self, view: tuple[float, float, int]) -> Floats:
        """Return a view as in `AppearanceTables`, (4, NODES² + 1)."""
        tables = np.zeros((3, 4, NODES, NODES))
        on_top, open_, whole = np.zeros(2), 0.0, 0.0
        for number, visible in enumerate(self._visible(view)):
            weights, drawdown = self._weights[number], self._drawdowns[number]
            if view[0] > 0.0:
                weights, drawdown = self._tilted_weights, self._tilted_drawdown
            weights, warp_over = weights.ravel(), drawdown.ravel() == (view[2] > 0)
            weight = np.where(visible.crossing >= 0, weights[visible.crossing], 0.0)
            pixels = self._spacing[0] * self._spacing[1] / visible.pixel**2
            pixels *= np.cos(np.radians(view[0]))
            family = visible.family
            over = warp_over[visible.crossing] == (family == 0)
            layer = np.where(over, family, 2 + family)
            chosen = (family >= 0) & (weight > 0.0)
            x, y = _grid_places(visible.normals[chosen], view[2])
            amount = weight[chosen] / pixels
            arrived = arriving_light(visible.exposure[chosen], _SHADOWS)
            bounced = arrived / (1.0 - BOUNCE * (1.0 - arrived))
            for i, j, share in _corners(x, y):
                node = (layer[chosen] * NODES + j) * NODES + i
                for table, factor in zip(tables, (1.0, arrived, bounced), strict=True):
                    values = amount * share * factor
                    table += np.bincount(node, values, table.size).reshape(table.shape)
            open_ += float(weight[family < 0].sum()) / pixels
            whole += float(weights.sum())
            on_top += [weights[warp_over].sum(), weights[~warp_over].sum()]
        # The part may have another share of crossings with warp on top than the whole cloth.
        crossings = np.concatenate([on_top, on_top[::-1]])
        upper = self._warp_over if view[2] > 0 else 1.0 - self._warp_over
        parts = np.array([upper, 1.0 - upper, 1.0 - upper, upper])
        tables *= (parts / np.maximum(crossings, 1e-9))[:, None, None]
        tables = tables[:, :2] + tables[:, 2:]
        # The exposure at which as much light arrives as at all of these. With reflections between
        # white yarns, unequal places together have less light than equal ones.
        mean = np.where(tables[0] > 0.0, tables[1] / np.maximum(tables[0], 1e-12), 1.0)
        equal = (tables[1] / (1.0 - BOUNCE * (1.0 - mean))).sum(axis=(1, 2))
        unequal = tables[2].sum(axis=(1, 2)) / np.maximum(equal, 1e-12)
        tables[1] = exposure_of(mean, _SHADOWS)
        row = tables[:2].reshape(4, -1)
        return np.column_stack([row, [open_ / whole, 0.0, *np.where(equal > 0.0, unequal, 1.0)]])

    def light_shares(self, side: int, shadows: bool) -> Singles:
        """Return how much light each local weave sends to the eye, (tiles, 2, 2 REACH + 1)."""
        # For warp and weft, and for the yarn of a crossing between its neighbours: the visible
        # share of the crossing, times the light that arrives there over the mean of the family. So
        # the mean over the whole cloth is the visible share of the family. `side` is 1 for the face
        # and -1 for the reverse; without `shadows` all light arrives.
        if (side, shadows) in self._light_shares:
            return self._light_shares[side, shadows]
        width = 2 * REACH + 1
        shape = self._tile_count, 2, width
        pixels, sums = np.zeros(self._tile_count), np.zeros((2, *shape))
        for number, visible in enumerate(self._visible((0.0, 0.0, side))):
            drawn, tiles = self._tiles_of(number, visible)
            cell = np.floor(visible.place[drawn]).astype(int)
            family, yarn = visible.family[drawn], visible.yarn[drawn]
            shown = family >= 0
            own = np.take_along_axis(cell, np.maximum(family, 0)[:, None], axis=1)[:, 0]
            step = np.clip(yarn - own, -REACH, REACH) + REACH
            arrived = arriving_light(visible.exposure[drawn], _SHADOWS)
            for tile in tiles:
                pixels += np.bincount(tile, minlength=self._tile_count)
                place = ((2 * tile + family) * width + step)[shown]
                sums[0] += np.bincount(place, minlength=sums[0].size).reshape(shape)
                sums[1] += np.bincount(place, arrived[shown], sums[0].size).reshape(shape)
        sums /= np.maximum(pixels, 1.0)[:, None, None]
        if shadows:
            counts = np.bincount(self.numbers.ravel(), minlength=self._tile_count)
            share, light = np.einsum("t,atfs->af", counts, sums)
            sums[0] = sums[1] * (share / np.maximum(light, 1e-9))[:, None]
        self._light_shares[side, shadows] = made = sums[0].astype(np.float32)
        return made

    def visible_normals(self, strength: float) -> tuple[Floats, Floats]:
        """Return the normals that are visible from the face, (n, 3), and their light, (n,)."""
        # The light that arrives at a normal is a share of that of all; without shadows, the sum
        # is 1.
        face = self._row((0.0, 0.0, 1))[:, :-1]
        steps = np.linspace(-1.0, 1.0, NODES)
        y, x = np.meshgrid(steps * np.abs(steps), steps * np.abs(steps), indexing="ij")
        square = x**2 + y**2
        normals = np.stack([2.0 * x, 2.0 * y, 1.0 - square], axis=-1) / (1.0 + square)[..., None]
        amounts = face[:2] * arriving_light(face[2:], strength)
        return normals.reshape(-1, 3), amounts.sum(axis=0) / face[:2].sum()

    def _tiles_of(self, number: int, visible: VisibleSurface) -> tuple[Bools, list[Ints]]:
        """Return which pixels of a part's view belong to tiles, and the two tiles of each."""
        cells = np.floor(visible.place).astype(int)
        ends, picks = self._sizes[number]
        drawn = (cells >= 0).all(axis=-1) & (cells < (ends, picks)).all(axis=-1)
        end, pick = np.clip(cells, 0, (ends - 1, picks - 1)).transpose(2, 0, 1)
        drawn &= self._viewed[number][pick, end]
        end, pick = end[drawn], pick[drawn]
        weave, upper = self._weaves[number][pick, end], self._drawdowns[number][pick, end]
        return drawn, [self._tile_of_weave[weave], self._tile_count - 2 + upper]

    def _tiles(self) -> NDArray[np.uint8]:
        """Return the texture of the tiles."""
        count, texels = self._tile_count, self._tile_count * TILE**2
        sums, pixels = np.zeros((2, texels, 2, 5)), np.zeros((2, texels))
        for side, view in enumerate(((0.0, 0.0, 1), (0.0, 0.0, -1))):
            for number, visible in enumerate(self._visible(view)):
                drawn, numbers = self._tiles_of(number, visible)
                across, along = (visible.place[drawn] % 1.0 * TILE).astype(int).T
                family = visible.family[drawn]
                shown = family >= 0
                ones = np.ones((len(family), 1))
                normals = visible.normals[drawn] * (1, 1, view[2])
                values = np.hstack([normals, ones, visible.exposure[drawn][:, None]])[shown]
                for tile in numbers:
                    texel = tile * TILE**2 + along * TILE + across
                    pixels[side] += np.bincount(texel, minlength=texels)
                    place = 2 * texel[shown] + family[shown]
                    for k, value in enumerate(values.T):
                        sums[side, ..., k] += np.bincount(place, value, 2 * texels).reshape(-1, 2)
        share = sums / np.maximum(pixels, 1.0)[..., None, None]
        share[..., :2] = (128.0 + 127.0 * share[..., :2]) / 255.0  # 0 is a whole number of steps
        blocks = [share[side, :, family, :4] for side in (0, 1) for family in (0, 1)]
        blocks.append(share[..., 4].transpose(1, 0, 2).reshape(texels, 4))
        blocks.append(np.zeros((texels, 4)))
        blocks[-1][:, :2] = 1.0 - share[..., 3].sum(axis=-1).T
        rows = -(-count // TILES_IN_ROW)
        image = np.zeros((6, rows * TILES_IN_ROW, TILE, TILE, 4))
        image[:, :count] = np.stack(blocks).reshape(6, count, TILE, TILE, 4)
        image = image.reshape(6, rows, TILES_IN_ROW, TILE, TILE, 4).transpose(0, 1, 3, 2, 4, 5)
        bytes_ = np.rint(255.0 * np.clip(image, 0.0, 1.0)).astype(np.uint8)
        return bytes_.reshape(6 * rows * TILE, TILES_IN_ROW * TILE, 4)


#: Appearances of the cloths that exist.
_APPEARANCES: WeakKeyDictionary[Cloth, ClothAppearance] = WeakKeyDictionary()
#: Digest and appearance of the cloth that was measured last. They outlive the cloth, because one
#: with other colours usually comes next.
_LAST: dict[bytes, ClothAppearance] = {}
#: Fields of cloths and threads that the appearance does not depend on.
_IGNORED = {"colors", "size", "density", "warnings", "cure", "names"}
#: Largest number of crossings of a cloth whose local weaves are all numbered.
_NUMBERED = 4_000_000


def appearance_of(cloth: Cloth) -> ClothAppearance:
    """Return the appearance of a cloth, which is measured once, whatever its colours."""
    if cloth not in _APPEARANCES:
        digest = _compute_digest(cloth)
        if digest not in _LAST:
            _LAST.clear()
            _LAST[digest] = ClothAppearance(cloth)
        _APPEARANCES[cloth] = _LAST[digest]
    return _APPEARANCES[cloth]


def _compute_digest(cloth: Cloth) -> bytes:
    """Compute a digest of the shape of a cloth's yarns."""
    digest = hashlib.sha256()

    def update(value: Any) -> None:
        if is_dataclass(value):
            for each in fields(value):
                if each.name not in _IGNORED:
                    update(getattr(value, each.name))
        elif isinstance(value, np.ndarray):
            digest.update(f"{value.dtype} {value.shape} ".encode())
            digest.update(value.tobytes())
        else:
            digest.update(f"{value!r} ".encode())

    update(cloth)
    return digest.digest()


def _typical_part(weaves: Ints, part: tuple[slice, slice]) -> tuple[slice, slice]:
    """Return the ends and picks in a part whose local weaves cover most of the cloth."""
    share = np.bincount(weaves.ravel()) / weaves.size
    starts = [range(each.start, max(each.stop - _TILTED, each.start) + 1, _STEP) for each in part]
    found = (
        tuple(
            slice(start, min(start + _TILTED, each.stop))
            for start, each in zip(at, part, strict=True)
        )
        for at in product(*starts)
    )

    def covered(chosen: tuple[slice, ...]) -> float:
        inner = weaves[chosen[1], chosen[0]]
        if min(inner.shape) > 2 * _MARGIN:
            inner = inner[_MARGIN:-_MARGIN, _MARGIN:-_MARGIN]
        return float(share[np.unique(inner)].sum())

    ends, picks = max(found, key=covered)
    return ends, picks


def _middle_part(cloth: Cloth) -> Cloth:
    """Return the middle of a cloth that has too many crossings; else the cloth."""
    if cloth.drawdown.size <= _NUMBERED:
        return cloth
    side = int(_NUMBERED**0.5)
    ends, picks = (
        slice(max(0, (count - side) // 2), max(0, (count - side) // 2) + min(side, count))
        for count in cloth.size
    )
    return crop_cloth(cloth, YarnSelection(ends, picks))


def _grid_places(normals: Singles, side: int) -> tuple[Floats, Floats]:
    """Return places of normals in the grid of normals, 0 to NODES - 1; z points to the viewer."""
    up = np.maximum(normals[:, 2].astype(np.float64) * side, -0.5)
    place = np.clip(normals[:, :2] / (1.0 + up)[:, None], -1.0, 1.0)
    steps = np.linspace(-1.0, 1.0, NODES)
    x, y = np.interp(place, steps * np.abs(steps), np.arange(NODES)).T
    return x, y


def _corners(x: Floats, y: Floats) -> list[tuple[Ints, Ints, Floats]]:
    """Return the four grid nodes around each point, and their bilinear weights."""
    i, j = (np.minimum(each.astype(int), NODES - 2) for each in (x, y))
    right, up = x - i, y - j
    return [
        (i, j, (1 - right) * (1 - up)),
        (i + 1, j, right * (1 - up)),
        (i, j + 1, (1 - right) * up),
        (i + 1, j + 1, right * up),
    ]
