"""Make the textures of a cloth drawn as a sheet: colours, tiles and tables of its yarns' light."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.draw.actors.cloth_appearance import AppearanceTables, appearance_of
from spacemap_vtk.draw.actors.lighting import mean_light
from spacemap_vtk.draw.actors.sheet_shaders import LEVELS, MOST_LIGHT
from spacemap_vtk.draw.actors.surface_actor import CLASSES, Span, ramp_colors, rgb_table
from spacemap_vtk.ndarrays import AnyInts, Bytes, Floats, Singles
from spacemap_vtk.scenes.level_of_detail import texture_halvings
from spacemap_vtk.scenes.styles import Style
from spacemap_vtk.textile.geometry.cloth_texture import visible_colors
from spacemap_vtk.textile.weave.cloth import Cloth

#: Names of the textures of colours, and the face and family that they show. A texel contains the
#: colours of the visible yarns of a crossing, each times the light that it sends to the eye.
_LAYERS = {
    "warpFront": (1, 0),
    "weftFront": (1, 1),
    "warpBack": (-1, 0),
    "weftBack": (-1, 1),
}
#: Number of picks whose texels are made together, a power of 2.
_BAND = 512


class SheetTextures(NamedTuple):
    """What `spacemap_vtk.draw.actors.sheet_shaders` draws a cloth with."""

    layers: dict[str, Bytes]
    """Colours of the visible yarns as sRGB values, by the names of the textures."""
    tile_numbers: Bytes
    """Tile of each crossing, (picks, ends, 3): its low and its high byte."""
    tables: AppearanceTables
    crossings: tuple[float, float]
    """Numbers of ends and picks, in texels."""
    averaged: bool
    """Whether the textures are halved, so that their texels are no crossings."""
    mixing: tuple[float, float]
    """Coloured and white light for which the colours were computed."""


def make_sheet_textures(
    cloth: Cloth,
    color: str,
    span: Span | None,
    style: Style,
    crossings: NDArray[Any] | None = None,
    strength: float = 0.0,
    shows_face: bool = False,
) -> SheetTextures:
    """Make the textures of a cloth; `strength` is that of the yarns' contact shadows, 0 to 1."""
    # `crossings` are numbers that colours show, of warp and weft, (2 or 1, picks, ends), and `span`
    # the ends of their scale. If the cloth only `shows_face`, the tables are made sooner.
    halvings = texture_halvings(cloth.size)
    if crossings is None:
        colors = _yarn_colors(cloth, color)
    else:
        colors = _crossing_colors(crossings, color, span)
    appearance = appearance_of(cloth)
    mixing = mean_light(style, *appearance.visible_normals(strength))
    displayed = decode(response(style, np.arange(256) / 255, mixing))
    layers = {}
    for name, (side, family) in _LAYERS.items():
        # Nothing is seen of the reverse of a cloth that faces the camera.
        tiles = appearance.numbers if side > 0 or not shows_face else np.zeros((1, 1), int)
        shares = appearance.light_shares(side, strength > 0.0)[:, family]
        pixels = _make_layer(tiles, shares, family, displayed[colors[family]], halvings)
        layers[name] = _pad(pixels, LEVELS)
    tiles = appearance.numbers[:1, :1] if halvings else appearance.numbers
    bytes_ = [(tiles % 256).astype(np.uint8), (tiles // 256).astype(np.uint8)]
    return SheetTextures(
        layers,
        np.stack([*bytes_, bytes_[1]], axis=-1),
        appearance.tables(tilted=not shows_face),
        (cloth.size[0] / 2**halvings, cloth.size[1] / 2**halvings),
        halvings > 0,
        mixing,
    )


def response(style: Style, hue: Floats, mixing: tuple[float, float]) -> Floats:
    """Return the displayed values of hues under a coloured and a white light, 0 to 1."""
    # The textures contain these values, because means over many yarns are those of displayed light,
    # in which bright colours are compressed. The shader turns the means back into hues, which it
    # lights as a surface is lit.
    received, white = mixing
    shown = np.sqrt(hue**2 * received + white * (0.6 + 0.4 * hue))
    if style.knee < 1.0:
        room = 1.0 - style.knee
        bent = style.knee + room * np.tanh((shown - style.knee) / room)
        shown = np.where(shown > style.knee, bent, shown)
    return np.minimum(shown, 1.0)


def _yarn_colors(cloth: Cloth, color: str) -> tuple[Bytes, Bytes]:
    """Return the colours of ends and picks; white for colourings that do not use them."""
    if color == "own":
        return cloth.warp.colors, cloth.weft.colors
    if color not in ("family", "yarn"):
        white = np.full((1, 3), 255, np.uint8)
        return white, white
    ends, picks = cloth.size
    palette = rgb_table(CLASSES[color])
    numbers = np.repeat([0, 1], cloth.size) if color == "family" else np.arange(ends + picks)
    chosen = palette[numbers % len(palette)]
    return chosen[:ends], chosen[ends:]


def _crossing_colors(crossings: NDArray[Any], color: str, span: Span | None) -> tuple[Bytes, Bytes]:
    """Return the colours of ends and picks at each crossing."""
    if span is None:
        colors = rgb_table(CLASSES[color])[crossings.astype(np.uint8)]
    else:
        colors = ramp_colors(crossings, span)
    return colors[0], colors[-1]


def _make_layer(
    weaves: AnyInts, shares: Singles, family: int, colors: Singles, halvings: int
) -> Bytes:
    """Return a texture of a cloth, halved some times; it is made in bands of picks."""
    bands = []
    for start in range(0, len(weaves), _BAND):
        band = weaves[start : start + _BAND]
        light = visible_colors(band, shares / MOST_LIGHT, family, colors, start)
        for _ in range(halvings):
            light = _halve(light)
        bands.append(_encode(light))
    return np.concatenate(bands)


def decode(shares: Floats) -> Singles:
    """Return the linear light of sRGB values from 0 to 1."""
    light = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    return light.astype(np.float32)


def _encode(light: Singles) -> Bytes:
    """Return texels of linear light: colours as sRGB values, and their sum of shares."""
    # A table is faster than powers.
    steps = np.arange(65536) / 65535
    code = np.where(steps <= 0.0031308, 12.92 * steps, 1.055 * steps ** (1 / 2.4) - 0.055)
    table = np.rint(255 * code).astype(np.uint8)
    texels = np.empty(light.shape, np.uint8)
    texels[..., :3] = table[np.rint(65535 * np.minimum(light[..., :3], 1.0)).astype(np.uint16)]
    texels[..., 3] = np.rint(255 * np.minimum(light[..., 3], 1.0))
    return texels


def _pad(pixels: Bytes, levels: int) -> Bytes:
    """Return an image padded with empty texels, so that its sides can be halved `levels` times."""
    more = [(0, -count % 2**levels) for count in pixels.shape[:2]]
    return np.pad(pixels, (*more, (0, 0)))


def _halve(light: Singles) -> Singles:
    """Return the means of blocks of 2 x 2 texels."""
    even = np.pad(light, [(0, count % 2) for count in light.shape[:2]] + [(0, 0)])
    tall = even[::2] + even[1::2]
    return np.asarray(0.25 * (tall[:, ::2] + tall[:, 1::2]), np.float32)
