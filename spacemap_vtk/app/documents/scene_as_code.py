"""Convert what the window shows into a command or a Python script."""

from __future__ import annotations

import pprint
import shlex
from pathlib import Path

from spacemap_vtk.app.documents.document import Document
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.formats.toml import format_value
from spacemap_vtk.parameters import AUTOMATIC, FilePath
from spacemap_vtk.scenes import library
from spacemap_vtk.scenes.pipeline import choose_stages
from spacemap_vtk.scenes.scene import Scene


def as_command(document: Document, time: float) -> str:
    """Return the command that draws what the window shows."""
    # A scene without a file is described by its differences from a scene that every installation
    # has.
    name = "plain_weave" if document.source is None else str(document.source)
    arguments = ["spacemap", "render", name, "-o", "picture.png", "--time", f"{time:g}"]
    base_scene, scene = Scene.read(name), document.scene
    sections_on = set(base_scene.given_sections)
    base_values, values = library.values_of(library.find(name)), document.values
    for section, part in scene.parts.items():
        for key, parameter in part.parameters.items():
            value = getattr(part, key)
            is_written = key in values.get(section, {}) or key in base_values.get(section, {})
            if not is_written or value == getattr(base_scene.parts[section], key):
                continue
            text = values.get(section, {}).get(key, value)
            if isinstance(parameter, FilePath) and value is not None:
                text = str(Path(value).resolve())
            arguments += [
                "--set",
                f"{section}.{key}={format_value(AUTOMATIC if text is None else text)}",
            ]
            sections_on.add(section)
    stages = choose_stages(base_scene.parts, sections_on)
    if [stage.section for stage in stages] != [stage.section for stage in scene.stages]:
        raise InputError(
            "a command line cannot switch stages on or off",
            cure="Save the scene, and render its file.",
        )
    return shlex.join(arguments)


def as_script(document: Document, time: float) -> str:
    """Return a Python script that computes the surface shown in the window."""
    # Align the lines below the opening brace.
    values = pprint.pformat(document.values, width=87, sort_dicts=False)
    values = values.replace("\n", "\n" + " " * len("values = "))
    return (
        "from pathlib import Path\n\n"
        "from spacemap_vtk.scenes.scene import Scene\n\n"
        f"values = {values}\n"
        "# Relative paths start at this file's folder.\n"
        f"scene = Scene(values, Path({str(document.base)!r}))\n"
        f"scene.update(time={time:g})\n"
        "surface = scene.polygons  # vtkPolyData\n"
        'print(surface.GetNumberOfPoints(), "points")\n'
    )
