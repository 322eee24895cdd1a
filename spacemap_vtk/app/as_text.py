"""A document as a command line and as a Python script."""

from __future__ import annotations

import json
import pprint
import shlex

from spacemap_vtk.app.document import Document, values_of


def as_command(document: Document, time: float) -> str:
    """Return the command that draws what the window shows.

    Parameters
    ----------
    document : Document
        The scene; what differs from its file becomes ``--set``.
    time : float
        In s.

    Returns
    -------
    str
        One line for a shell.
    """
    source = document.source
    name = "plain_weave" if source is None else str(source)
    words = ["spacemap", "render", name, "-o", "picture.png", "--time", f"{time:g}"]
    before = {} if source is None else values_of(source)
    for section, table in document.values.items():
        for key, value in table.items() if isinstance(table, dict) else ():
            if before.get(section, {}).get(key) != value:
                # A JSON string, number, flag or list is TOML too.
                words += ["--set", f"{section}.{key}={json.dumps(value, ensure_ascii=False)}"]
    return shlex.join(words)


def as_script(document: Document, time: float) -> str:
    """Return a Python script that makes the surface that the window shows.

    Parameters
    ----------
    document : Document
        The scene.
    time : float
        In s.

    Returns
    -------
    str
        Runs as it is.
    """
    values = pprint.pformat(document.values, width=96, sort_dicts=False)
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
