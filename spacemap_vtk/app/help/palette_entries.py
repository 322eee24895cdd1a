"""The entries of the command palette."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path

from PySide6.QtWidgets import QTabWidget

from spacemap_vtk.app.documents.document import Document
from spacemap_vtk.app.help.command_palette import Entry
from spacemap_vtk.app.help.menu_tree import MenuEntry
from spacemap_vtk.app.panels.properties import Properties
from spacemap_vtk.app.panels.stage_list import StageList
from spacemap_vtk.draw import thumbnails
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.scenes import library
from spacemap_vtk.scenes.pipeline import section_classes, stage_title


def action_entries(actions: Iterable[MenuEntry]) -> Iterator[Entry]:
    """Yield the actions that are possible now, except the list of scenes by name."""
    for entry in actions:
        action, path = entry.action, entry.path
        if action.isEnabled() and action.isVisible() and "Scenes" not in path:
            keys = action.shortcut().toString()
            place = " › ".join(path) + (f"   {keys}" if keys else "")
            on = " ✓" if action.isCheckable() and action.isChecked() else ""
            yield Entry(entry.title + on, place, action.trigger, action.toolTip())


def tab_entries(tabs: QTabWidget) -> Iterator[Entry]:
    """Yield the tabs."""
    for number in range(tabs.count()):
        if tabs.isTabVisible(number):
            yield Entry(
                f"Show {tabs.tabText(number)}", "Tab", partial(tabs.setCurrentIndex, number)
            )


def scene_entries(open_scene: Callable[[str], object]) -> Iterator[Entry]:
    """Yield the program's scenes."""
    for group, names in library.names_by_kind().items():
        for name in names:
            title = f"Open {thumbnails.title_of(name)}"
            yield Entry(title, f"Scene: {name}", partial(open_scene, name), group)


def recent_entries(files: Iterable[str], open_file: Callable[[str], object]) -> Iterator[Entry]:
    """Yield the recent files."""
    for name in files:
        yield Entry(f"Open {Path(name).name}", "Recent file", partial(open_file, name), name)


def stage_entries(
    document: Document,
    stages: StageList,
    properties: Properties,
    switch: Callable[[str, bool], object],
) -> Iterator[Entry]:
    """Yield the stages, to switch or to show, and all their parameters."""
    scene = document.scene
    for section, cls in section_classes().items():
        title, part = stage_title(cls.__name__), scene.parts[section]
        about = (cls.__doc__ or "").strip().splitlines()[0]
        if stages.can_switch(section):
            is_on = isinstance(part, Stage) and part in scene.stages
            word = "off" if is_on else "on"
            yield Entry(
                f"Switch {word} {title}", "Pipeline", partial(switch, section, not is_on), about
            )
        yield Entry(f"Show {title}", "Pipeline", partial(stages.select, section), about)
    for section, cls in section_classes().items():
        title = stage_title(cls.__name__)
        for name, parameter in cls.parameters.items():

            def show(section: str = section, name: str = name) -> None:
                stages.select(section)
                properties.show_parameter(name)

            words = f"{name} {parameter.group} {parameter.help}"
            yield Entry(parameter.label, f"Parameter of {title}", show, words)
