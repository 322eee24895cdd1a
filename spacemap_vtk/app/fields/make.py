"""Which editor a parameter gets."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from spacemap_vtk.app.fields.choice import ChoiceEditor
from spacemap_vtk.app.fields.color import ColorEditor
from spacemap_vtk.app.fields.colors_editor import ColorsEditor
from spacemap_vtk.app.fields.editor import Editor
from spacemap_vtk.app.fields.file import FileEditor
from spacemap_vtk.app.fields.flag import FlagEditor
from spacemap_vtk.app.fields.loads_editor import LoadsEditor
from spacemap_vtk.app.fields.number import NumberEditor
from spacemap_vtk.app.fields.pattern import PatternEditor
from spacemap_vtk.app.fields.supports_editor import SupportsEditor
from spacemap_vtk.app.fields.text import TextEditor
from spacemap_vtk.app.fields.vector import VectorEditor
from spacemap_vtk.parameters import Parameter

_EDITORS: dict[str, Callable[[Any], Editor]] = {
    "real": NumberEditor,
    "integer": NumberEditor,
    "flag": FlagEditor,
    "choice": ChoiceEditor,
    "vector": VectorEditor,
    "color": ColorEditor,
    "file": FileEditor,
    "supports": SupportsEditor,
    "pattern": PatternEditor,
    "loads": LoadsEditor,
}


def make(parameter: Parameter[Any]) -> Editor:
    """Return a new editor."""
    component: Any = getattr(parameter, "component", None)
    if parameter.kind == "series" and component.kind in ("real", "integer"):
        return NumberEditor(parameter)
    if parameter.kind == "series" and component.kind == "color":
        return ColorsEditor(parameter)
    return _EDITORS.get(parameter.kind, TextEditor)(parameter)
