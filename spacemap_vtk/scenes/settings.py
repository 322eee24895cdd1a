"""The sections of a scene that configure no stage: its view and its animation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType

from spacemap_vtk.errors import InputError
from spacemap_vtk.parameters import Choice, Color, Flag, Integer, Parameterised, Real, Vector
from spacemap_vtk.scenes.cameras import CAMERAS
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.insets import Insets
from spacemap_vtk.scenes.saved_cameras import (
    CameraName,
    Direction,
    SavedCamera,
    SavedCameras,
    require_camera,
)
from spacemap_vtk.scenes.styles import LIGHTS, STYLES, Style
from spacemap_vtk.textile.geometry.irregularity import Irregularity

#: Size of a picture if none is given.
USUAL_SIZE = 1280, 960
#: Number of ends and picks together from which the picture of a flat cloth is larger.
MANY_THREADS = 400
#: Longer side of that larger picture, in pixels.
WIDE_SIDE = 2400
#: Shortest side of a picture, in pixels.
SMALLEST_SIDE = 16
#: A longer film is a mistake in its times.
MOST_FRAMES = 100_000
#: Colour of the cage's edges on a light background.
LINES = (57, 66, 78)
#: Colour of the cage's edges on a dark background.
LINES_ON_DARK = (150, 164, 180)

#: Backgrounds to choose from: the colours at the bottom and at the top. None is the colour of the
#: style; in a dark window it is dark.
BACKGROUNDS: dict[str, tuple[str | None, str | None]] = {
    "Automatic": (None, None),
    "Light": ("#ffffff", "#dfe6ee"),
    "White": ("#ffffff", "#ffffff"),
    "Dark": ("#1b222b", "#36424f"),
    "Black": ("#000000", "#000000"),
}

#: Condition under which the cage is drawn.
_CAGE = {"show": ("cage", "both", "side by side")}


class View(Parameterised):
    """Camera, style, colours and annotations of a scene's pictures."""

    section = "view"

    show = Choice(
        "fabric",
        "What is drawn: the fabric or object, the cage's edges, both overlaid, or both side by "
        "side.",
        ["fabric", "cage", "both", "side by side"],
    )
    color = Choice(
        "own",
        "What the surface's colours show; numbers get a colour scale. Velocity, strain, stress "
        "and the displacement to the equilibrium (modal.gravity) are interpolated from the cage.",
        list(COLORINGS),
    )
    camera = CameraName(
        "three-quarter",
        "Where the camera is, or the name of a saved camera; side is right. lying: z points up, as "
        "for cloth on a table. face: from the front without perspective; if a draft makes the "
        "cloth far longer than wide, only its beginning is drawn.",
        [*CAMERAS],
        automatic="three-quarter, or lying if z points up in an object",
    )
    cameras = SavedCameras((), "Cameras with names of their own, for view.camera.")
    size = Vector(
        None,
        "Width and height of the picture in pixels.",
        component=Integer(1, "", minimum=SMALLEST_SIDE, maximum=8192),
        labels="wh",
        automatic="{0} x {1}; for still cloth seen from its face, the proportions of the cloth "
        "with a longer side of {0}, or {2} for more than {3} ends and picks together".format(
            *USUAL_SIZE, WIDE_SIDE, MANY_THREADS
        ),
    )
    time = Real(0.0, "Time of a still picture.", unit="s", minimum=0.0)
    zoom = Real(1.0, "Magnification; above 1 the camera is nearer.", minimum=0.1, maximum=100.0)
    aperture = Real(
        0.0,
        "Diameter of the camera's lens, as a share of its distance from what is sharp. What is "
        "nearer or farther is blurred, as in photographs; 0.02 to 0.2 is usual. 0: all is sharp. "
        "Only in pictures and films, not in the window.",
        minimum=0.0,
        maximum=1.0,
    )
    focus = Vector(
        None,
        "A point that is sharp, with all others at its distance from the plane of the lens.",
        component=Real(0.0, "", unit="m"),
        automatic="what is nearest in the middle of the picture",
    )
    insets = Insets(
        (),
        "Close-ups of places of the picture, each in a frame; only in pictures and films, not in "
        "the window.",
    )
    supports = Flag(True, "Draw dots at the cage's fixed vertices.", when=_CAGE)
    loads = Flag(
        False, "Draw arrows for the loads on the cage; their length shows the present strength."
    )
    obstacles = Flag(
        True, "Draw the obstacles of modal.obstacles; of a plane the part around the cloth."
    )
    ghost = Flag(False, "Also draw the undeformed fabric or object, in pale colours.")
    scale_bar = Flag(
        False,
        "Draw a scale bar of a round length; with perspective it is valid in the plane of focus.",
    )
    triad = Flag(False, "Draw the axes: x along the weft, y along the warp, z normal to the cloth.")
    time_stamp = Flag(False, "Write the time into the picture.")
    line_scale = Real(
        1.0, "Factor on the width of lines and the size of dots.", minimum=0.1, maximum=20.0
    )
    clip_normal = Direction(
        None,
        "Cut the scene with a plane: the plane's normal, towards the part that stays visible.",
        component=Real(0.0, ""),
        automatic="not cut",
    )
    clip_origin = Vector(
        None,
        "A point of the cutting plane.",
        component=Real(0.0, "", unit="m"),
        automatic="the middle of the fabric or object at rest",
        when={"clip_normal": ()},
    )
    style = Choice(
        "studio",
        "Style of drawing. studio: cloth in warm and cool light. paper: plain, on white, for "
        "printing. schematic: flat colours, black lines. blueprint: white lines on blue.",
        list(STYLES),
    )
    light = Choice(
        None,
        "Light on the scene; its lamps turn with the camera. "
        + "; ".join(f"{name}: {light.help}" for name, light in LIGHTS.items())
        + ".",
        list(LIGHTS),
        automatic="the light of the style",
    )
    background = Color(
        None, "Colour of the background at the bottom.", automatic="the colour of the style"
    )
    background_top = Color(
        None, "Colour of the background at the top.", automatic="the colour of the style"
    )
    transparent = Flag(
        False, "Leave out the background, in formats that support transparency, such as .png."
    )
    cage_color = Color(
        None,
        "Colour of the cage's edges.",
        automatic="the colour of the style, else dark, or light on a dark background",
        when=_CAGE,
    )
    support_color = Color(
        "#d9642c", "Colour of the cage's fixed vertices.", when={**_CAGE, "supports": (True,)}
    )
    object_color = Color("#b9c4cf", "Colour of an object without colours of its own.")
    shadows = Flag(
        True,
        "Draw soft shadows where yarns touch and in an object's folds, and shade behind the holes "
        "of closed cloth; never on colours with a scale.",
    )
    irregularity = Real(
        None,
        "How irregular woven yarns are drawn in position, width and brightness: 0 regular, 1 as "
        "good yarns are. Figures and measurements are always those of regular yarns, and so are "
        "colours with a scale. Files have regular yarns unless an export asks for these.",
        minimum=0.0,
        maximum=2.0,
        automatic="1 in the style studio, 0 in the others",
    )
    irregularity_seed = Integer(
        0, "Number that selects one of many equally irregular cloths.", minimum=0, maximum=2**31
    )
    ground = Flag(
        False,
        "Draw a soft shadow on level ground at the height of the lowest visible point; the camera "
        "defines which way is up.",
    )

    @property
    def saved_camera(self) -> SavedCamera | None:
        """The chosen camera, if it is a saved one; an unknown name is refused."""
        return require_camera(self.camera, self.cameras)

    @property
    def yarn_look(self) -> Irregularity:
        """How irregular woven yarns are drawn."""
        given, usual = self.irregularity, STYLES[self.style].irregularity
        amount = usual if given is None else given
        regular = COLORINGS[self.color].shows_numbers
        return Irregularity(0.0 if regular else amount, self.irregularity_seed)

    @property
    def resolved_style(self) -> Style:
        """The style with the chosen light and background."""
        style = STYLES[self.style]
        if self.light is not None:
            style = LIGHTS[self.light].apply_to(style)
        below = style.bottom_color if self.background is None else self.background
        above = style.top_color if self.background_top is None else self.background_top
        return replace(style, bottom_color=below, top_color=above)

    def for_window(self, dark: bool) -> View:
        """Return the view for a window: dark like it, unless the scene chooses its background."""
        own = {"background", "background_top", "style"} & self.given_values.keys()
        if not dark or own or (self.light is not None and LIGHTS[self.light].background):
            return self
        below, above = BACKGROUNDS["Dark"]
        return View(**{**self.settings, "background": below, "background_top": above})

    @property
    def line_color(self) -> tuple[int, int, int]:
        """Colour of the cage's edges that can be seen: red, green and blue from 0 to 255."""
        if self.cage_color is not None:
            return self.cage_color
        style = self.resolved_style
        dark = is_dark(style.bottom_color)
        if style.line_color is not None and is_dark(style.line_color) != dark:
            return style.line_color
        return LINES_ON_DARK if dark else LINES


def is_dark(color: Sequence[int]) -> bool:
    """Return whether lines over a colour must be light."""
    return sum(color) < 384


class Animation(Parameterised):
    """Times, frame rate and speed of a film."""

    section = "animation"
    synonyms = MappingProxyType({"fps": "frames_per_second"})  # the command line's --fps

    start = Real(0.0, "Time of the first frame.", unit="s", minimum=0.0)
    stop = Real(2.0, "Time at which the film ends.", unit="s", above=0.0)
    frames_per_second = Real(25.0, "Frames per second of film.", above=0.0, maximum=1000.0)
    speed = Real(1.0, "Seconds of motion per second of film.", above=0.0)
    orbit = Real(
        0.0,
        "Angle through which the camera goes round the scene during the film, anticlockwise seen "
        "from above; a still scene can be filmed, too. 1 turn: once round.",
        unit="deg",
        minimum=-36000.0,
        maximum=36000.0,
    )

    @property
    def span(self) -> tuple[float, float]:
        """Start and end; the end is slightly later than the start if there is nothing to show."""
        return self.start, max(self.stop, self.start * (1 + 1e-9))

    def turn_at(self, time: float) -> float:
        """Return the angle through which the camera has gone round at a time, in degrees."""
        start, stop = self.span
        return self.orbit * (time - start) / (stop - start) if stop > start else 0.0

    def frame_times(self) -> list[float]:
        """Return the time of each frame."""
        span = self.stop - self.start
        if span <= 0.0:
            raise InputError(
                "the animation has no frames",
                key="stop",
                value=self.stop,
                allowed=f"a time after animation.start = {self.start:g} s",
            )
        count = span / self.speed * self.frames_per_second
        if count > MOST_FRAMES:
            raise InputError(
                f"too many frames: {count:.0f}",
                key="frames_per_second",
                value=self.frames_per_second,
                allowed=f"up to {MOST_FRAMES} frames in total",
                cure="Shorten the animation, or increase animation.speed.",
            )
        step = self.speed / self.frames_per_second
        # Half a step of tolerance, so that rounding does not add a frame.
        return [self.start + k * step for k in range(max(1, math.ceil(count - 0.5)))]
