"""Pictures, films and data, written by a process of their own that can be ended at any moment.

``python -m spacemap_vtk.draw.background`` reads an `Order` as JSON from its standard input. It
prints a line of JSON for each step: ``{"done": 3, "of": 50}``, and at last ``{"error": ...}`` if
it fails. Whoever starts it makes files whole or not at all: the order's folder is a new one.
"""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from spacemap_vtk.errors import SpacemapError, SpacemapWarning


@dataclass
class Order:
    """What is to be written."""

    #: The scene, as a file has it.
    values: dict[str, Any]
    #: Relative paths count from the folder of this file.
    base: str
    #: ``"picture"``, ``"film"``, or what data: ``"patches"``, ``"cage"``, ``"surface"``,
    #: ``"draft"``.
    kind: str
    #: The file; of a film of numbered frames, with ``%04d`` in it.
    output: str
    #: Of a picture and of data, in s.
    time: float = 0.0
    #: Of a picture or film, in pixels.
    size: tuple[int, int] = (1280, 960)
    #: What a picture shows: ``"fabric"``, ``"cage"`` or ``"both"``; none: as the scene says.
    panels: list[str] = field(default_factory=list)
    #: As `spacemap_vtk.draw.picture.Place` has it; empty: as the scene says.
    camera: dict[str, Any] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The order as JSON."""
        return json.dumps(asdict(self))


def carry_out(order: Order) -> Iterator[tuple[int, int]]:
    """Write what is ordered."""
    from spacemap_vtk.scenes.scene import Scene

    scene, output = Scene(order.values, Path(order.base)), Path(order.output)
    if order.kind != "draft":  # which needs no room for its yarns
        scene.check()
    if order.kind not in ("picture", "film"):
        from spacemap_vtk.io import registry
        from spacemap_vtk.scenes.export import content, times_of

        writer = registry.writer(output)
        moments = times_of(scene, writer, order.time)
        steps = len(moments) + 1
        yield 0, steps
        data = content(
            scene, order.kind, writer, moments, lambda done: _say({"done": done, "of": steps})
        )
        writer.write(output, data)
        yield steps, steps
        return
    from spacemap_vtk.draw.picture import Picture, Viewpoint

    film = order.kind == "film"
    times = scene.animation.frame_times() if film else [order.time]
    yield 0, len(times)
    place = Viewpoint(**order.camera) if order.camera else None
    width, height = order.size
    picture = Picture(scene, times, (width, height), order.panels or None, place)
    if film:
        yield from _filmed(picture, times, output, scene.animation.frames_per_second)
    else:
        from spacemap_vtk.draw.film import write_picture

        write_picture(output, picture.draw(order.time))
        yield 1, 1
    picture.close()


def _filmed(
    picture: Any, times: list[float], output: Path, rate: float
) -> Iterator[tuple[int, int]]:
    from spacemap_vtk.draw.film import write_film, write_frames

    def images() -> Iterator[Any]:
        for done, time in enumerate(times, 1):
            yield picture.draw(time)
            _say({"done": done, "of": len(times)})

    if "%" in output.name:
        write_frames(output, images())
    else:
        write_film(output, images(), rate)
    yield len(times), len(times)


def _say(line: dict[str, Any]) -> None:
    print(json.dumps(line), flush=True)


def main() -> None:
    """Carry out the order on standard input."""
    from spacemap_vtk.io.output import telling_refusals

    warnings.simplefilter("ignore", SpacemapWarning)  # whoever ordered shows what stages doubt
    try:
        order = Order(**json.loads(sys.stdin.read()))
        output = Path(order.output)
        with telling_refusals(output, output.name):  # of its folder the user has never heard
            for done, of in carry_out(order):
                _say({"done": done, "of": of})
    except Exception as error:
        known = isinstance(error, SpacemapError)
        names = ("message", "section", "key", "value", "allowed", "cure")
        told = {name: getattr(error, name, None) for name in names} if known else {}
        _say({"error": {**told, "message": told.get("message") or str(error)}})
        sys.exit(1)


if __name__ == "__main__":
    main()
