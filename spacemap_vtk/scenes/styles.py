"""Styles of drawing: backgrounds, lines, light, cloth and shadows. Each style is one declaration.

Light is added in linear space; the displayed value is its square root (a gamma of 2). A yarn of
colour c under the light L shows c √L, or √(c² L + W) if it also reflects white light W.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

RGB = tuple[int, int, int]
Light3 = tuple[float, float, float]

WHITE: Light3 = (1.0, 1.0, 1.0)


class Lamp(NamedTuple):
    """A light that is fixed to the camera."""

    #: Position from the middle of the picture, in the camera's coordinates: it looks along -z, y is
    #: up.
    place: Light3
    strength: float
    color: Light3 = WHITE


@dataclass(frozen=True)
class Style:
    """Appearance of surfaces, lines and background."""

    label: str
    #: Colours of the background, at the bottom and at the top.
    bottom_color: RGB = (255, 255, 255)
    top_color: RGB = (255, 255, 255)
    #: Colour of a cage's edges; None: dark, or light on a dark background.
    line_color: RGB | None = None
    #: Width of the line round each yarn in points, its colour, and its largest width on either side
    #: of the edge as a share of the yarn's diameter.
    outline: float = 0.0
    outline_color: RGB = (0, 0, 0)
    outline_share: float = 0.04
    #: Share of the line's colour over yarns that are too small to be seen.
    outline_far_share: float = 0.2
    #: Light from all sides, from above and from below. With this light alone colours are unchanged.
    sky: Light3 = WHITE
    earth: Light3 = WHITE
    lamps: tuple[Lamp, ...] = ()
    #: How far light reaches round the object, as it does between fibres.
    wrap: float = 0.0
    #: White light that fibres reflect: its strength, and the exponent of its highlight.
    gloss: float = 0.0
    gloss_power: float = 8.0
    #: Light on protruding fibres at a yarn's rim.
    sheen: float = 0.0
    #: Displayed value of white from which brighter ones are compressed, so that none reaches 1; 1:
    #: none is.
    knee: float = 1.0
    #: How much surfaces darken that face away from the camera, the same for all colours.
    facing: float = 0.0
    #: Share of the colour that stays; the rest is `tint` of the same brightness.
    colored: float = 1.0
    tint: tuple[Light3, Light3] = ((0.0, 0.0, 0.0), WHITE)
    #: Depth of the contact shadows, and of the shadow on the ground.
    occlusion: float = 0.0
    shadow: float = 0.0
    #: Colours of obstacles, which are matt: of bodies, and of planes, which fade out.
    obstacle_color: RGB = (226, 226, 224)
    ground_color: RGB = (255, 255, 255)
    #: Irregularity of woven yarns, unless a scene gives it.
    irregularity: float = 0.0
    #: Whether the light behind the cloth shines through holes that would be dark inside.
    shines_through: bool = False

    @property
    def for_obstacles(self) -> Style:
        """This style for obstacles: as smooth and matt as plaster, without fibres."""
        return replace(self, gloss=0.3 * self.gloss, sheen=0.0, wrap=0.0)

    @property
    def for_numbers(self) -> Style:
        """This style for colours that represent numbers: seen from front they match their scale."""
        return replace(
            self,
            sky=WHITE,
            earth=WHITE,
            lamps=(),
            gloss=0.0,
            sheen=0.0,
            knee=1.0,
            facing=0.6 if self.lamps else 0.0,
            colored=1.0,
            occlusion=0.0,
            irregularity=0.0,
            # Without shadows, only lines show where yarns of one colour cross.
            outline=max(self.outline, 1.2),
            outline_color=(0, 0, 0) if self.lamps else self.outline_color,
            outline_share=0.02 if self.lamps else self.outline_share,
            outline_far_share=0.08 if self.lamps else self.outline_far_share,
        )


#: The styles, the usual one first. The light "style" of a scene is the light of its style.
STYLES = {
    "studio": Style(
        "Studio",
        top_color=(223, 230, 238),
        sky=(0.34, 0.37, 0.41),
        earth=(0.20, 0.18, 0.16),
        # A warm key light from the upper left shows the crowns of the yarns, a cool fill light from
        # the right brightens the shadows, and a rim light from behind separates the cloth from the
        # background.
        lamps=(
            Lamp((-0.8, 0.95, 0.9), 0.86, (1.0, 0.95, 0.87)),
            Lamp((1.0, 0.1, 0.6), 0.18, (0.78, 0.89, 1.0)),
            Lamp((0.35, 0.7, -0.6), 0.12, (0.95, 0.97, 1.0)),
        ),
        wrap=0.25,
        gloss=0.08,
        gloss_power=8.0,
        sheen=0.16,
        knee=0.75,
        occlusion=0.75,
        shadow=0.42,
        obstacle_color=(236, 222, 203),
        ground_color=(250, 247, 243),
        irregularity=1.0,
    ),
    "paper": Style(
        "Paper",
        line_color=(70, 74, 80),
        outline=0.8,
        outline_color=(60, 60, 62),
        outline_share=0.03,
        outline_far_share=0.15,
        sky=(0.72, 0.72, 0.72),
        earth=(0.5, 0.5, 0.5),
        lamps=(Lamp((-0.6, 0.9, 1.0), 0.42),),
        wrap=0.5,
        occlusion=0.5,
        shadow=0.22,
    ),
    "schematic": Style("Schematic", line_color=(0, 0, 0), outline=1.6),
    "blueprint": Style(
        "Blueprint",
        bottom_color=(22, 62, 122),
        top_color=(22, 62, 122),
        line_color=(214, 230, 250),
        outline=1.4,
        outline_color=(236, 244, 255),
        colored=0.0,
        tint=((0.05, 0.17, 0.38), (0.30, 0.50, 0.78)),
        obstacle_color=(120, 120, 120),
        ground_color=(60, 60, 60),
    ),
}


@dataclass(frozen=True)
class Light:
    """A light that replaces the light of a style; its lamps turn with the camera."""

    label: str
    help: str
    sky: Light3
    earth: Light3
    lamps: tuple[Lamp, ...]
    wrap: float
    #: Factor on the depth of the style's contact shadows.
    shadows: float = 1.0
    #: Factor on the gloss and sheen of the style.
    gloss: float = 1.0
    #: Colours of the background, at the bottom and at the top; None: those of the style.
    background: tuple[RGB, RGB] | None = None
    shines_through: bool = False

    def apply_to(self, style: Style) -> Style:
        """Return a style in this light."""
        bottom, top = self.background or (style.bottom_color, style.top_color)
        return replace(
            style,
            bottom_color=bottom,
            top_color=top,
            sky=self.sky,
            earth=self.earth,
            lamps=self.lamps,
            wrap=self.wrap,
            gloss=self.gloss * style.gloss,
            sheen=self.gloss * style.sheen,
            occlusion=self.shadows * style.occlusion,
            shines_through=self.shines_through,
        )


#: Lights to choose from in place of a style's own light.
LIGHTS = {
    "studio": Light(
        "Studio",
        "a warm lamp on the left, a cool fill light on the right",
        STYLES["studio"].sky,
        STYLES["studio"].earth,
        STYLES["studio"].lamps,
        STYLES["studio"].wrap,
    ),
    "window": Light(
        "Window",
        "soft daylight from the left, as beside a window",
        sky=(0.19, 0.22, 0.26),
        earth=(0.17, 0.16, 0.15),
        lamps=(
            Lamp((-1.0, 0.3, 0.32), 1.05, (0.96, 0.98, 1.0)),
            Lamp((1.0, -0.2, 0.4), 0.06, (1.0, 0.90, 0.78)),
        ),
        wrap=0.4,
        gloss=0.6,
    ),
    "raking": Light(
        "Raking",
        "a lamp almost in the plane of the picture, which shows the relief of yarns",
        sky=(0.085, 0.09, 0.10),
        earth=(0.07, 0.066, 0.062),
        lamps=(Lamp((-1.0, 0.5, 0.24), 1.4, (1.0, 0.96, 0.90)),),
        wrap=0.12,
    ),
    "backlit": Light(
        "Backlit",
        "light from behind, which shines through holes and thin places",
        sky=(0.09, 0.085, 0.08),
        earth=(0.07, 0.066, 0.06),
        lamps=(
            Lamp((0.15, 0.35, -1.0), 1.75, (1.0, 0.91, 0.76)),
            Lamp((-0.4, 0.6, 1.0), 0.10, (0.92, 0.96, 1.0)),
        ),
        wrap=1.15,
        gloss=0.3,
        background=((255, 248, 234), (255, 252, 245)),
        shines_through=True,
    ),
    "flat": Light(
        "Flat",
        "the same light from all sides, as in a scan: the colours of the yarns themselves",
        WHITE,
        WHITE,
        (),
        0.0,
        shadows=0.6,
        gloss=0.0,
    ),
}
