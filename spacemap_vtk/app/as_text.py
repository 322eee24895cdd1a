"""A document as a command line and as a Python script."""

from __future__ import annotations

import json
import pprint
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from spacemap_vtk.app.document import Document
from spacemap_vtk.parameters import AUTOMATIC, FilePath
from spacemap_vtk.scenes import library
from spacemap_vtk.scenes.scene import Scene


def as_command(document: Document, time: float) -> str:
    """Return the command that draws what the window shows."""
    # A scene that was never saved is told as what it changes of the one that everyone has.
    name = "plain_weave" if document.source is None else str(document.source)
    words = ["spacemap", "render", name, "-o", "picture.png", "--time", f"{time:g}"]
    before, here = Scene.read(name), document.scene
    was_written, written = library.values_of(library.find(name)), document.values
    for section, part in here.parts.items():
        for key, parameter in part.parameters.items():
            value = getattr(part, key)
            said = key in written.get(section, {}) or key in was_written.get(section, {})
            if not said or value == getattr(getattr(before, section), key):
                continue
            told = written.get(section, {}).get(key, value)
            if isinstance(parameter, FilePath) and value is not None:
                told = str(Path(value).resolve())
            words += ["--set", f"{section}.{key}={_toml(AUTOMATIC if told is None else told)}"]
    return shlex.join(words)


def _toml(value: Any) -> str:
    """Return a value as TOML in one line; tables too."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key} = {_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_toml, value)) + "]"
    # A JSON string, number or flag is TOML too.
    return json.dumps(value, ensure_ascii=False)


def as_script(document: Document, time: float) -> str:
    """Return a Python script that makes the surface that the window shows."""
    # Indented below the brace of the first line.
    values = pprint.pformat(document.values, width=87, sort_dicts=False)
    values = values.replace("\n", "\n" + " " * len("values = "))
    return (
        "from pathlib import Path\n\n"
        "from spacemap_vtk.scenes.scene import Scene\n\n"
        f"values = {values}\n"
        "# Relative paths count from this file's folder.\n"
        f"scene = Scene(values, Path({str(document.base)!r}))\n"
        f"scene.update(time={time:g})\n"
        "surface = scene.polygons  # vtkPolyData\n"
        'print(surface.GetNumberOfPoints(), "points")\n'
    )
