"""The document of the window: a scene's text, the scene itself and the undo history."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import tomlkit
from PySide6.QtCore import QObject, Signal
from tomlkit.items import AoT, Array, Whitespace

from spacemap_vtk.app.documents.draft_versions import DraftVersions
from spacemap_vtk.app.documents.edit import Edit, History, Version
from spacemap_vtk.app.widgets import single_shot
from spacemap_vtk.errors import InputError, SpacemapError
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.io import registry
from spacemap_vtk.io.output import atomic_file, atomic_files, check_output, write_parts
from spacemap_vtk.parameters import FilePath
from spacemap_vtk.scenes import library, presets
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.pipeline import choose_stages, is_compatible, stage_title, switch_section
from spacemap_vtk.scenes.presets import PRESETS, Note
from spacemap_vtk.scenes.scene import Scene

#: Lists with more values are written one value per line.
_MAX_VALUES_PER_LINE = 8
#: Weave parameters that a draft file stores; the draft tab edits exactly these.
DRAFT_KEYS = ("draft", "pattern", "ends", "picks", "warp_color", "weft_color")
#: Most names of values in the description of a change.
_MOST_NAMES = 3
#: Longest time that a change made by a drag waits, in ms.
_MAX_DELAY = 50
_NO_VALUES: Mapping[str, Any] = MappingProxyType({})
#: Section, values, burst and name, as in `Document.set_many`.
_Change = tuple[str, dict[str, Any], int, str]


class Document(QObject):
    """A scene as the text of a scene file, comments included, with its undo stack."""

    # The document contains only valid values: an invalid one raises an error and changes nothing.

    #: A value has changed, also by undo or redo.
    changed = Signal()
    #: Another scene has been opened.
    replaced = Signal()
    #: A message about side effects of a change: other stages, or another colouring.
    side_effects = Signal(str)
    #: Undo or redo would lead to an invalid scene; nothing was changed.
    failed = Signal(object)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.history = History(self)
        #: Scene or draft file that "Save" writes; None before the first "Save as".
        self.file: Path | None = None
        #: File that was opened; it can also be a draft or one of the program's own scenes.
        self.source: Path | None = None
        #: Edited drafts, and states before a drop, that the user has not saved yet.
        self.drafts = DraftVersions()
        self._saved_draft: Path | None = None
        #: Former content of each section that was switched off, and whether that happened together
        #: with other sections.
        self._off: dict[str, tuple[Any, bool]] = {}
        # Draft files that were overwritten, each with a copy of its former content.
        self._overwritten: list[tuple[Path, Path]] = []
        self._folder = Path.cwd()
        # Caches, filled on demand after each change.
        self._text: str | None = None
        self._values: dict[str, Any] | None = None
        #: Whether frames are requested faster than they are computed. The changes of a drag then
        #: wait, and a newer one replaces the waiting one. Each change costs a tenth of a frame.
        self.congested: Callable[[], bool] = lambda: False
        self._waiting: _Change | None = None
        self._delay_timer = single_shot(self, self.apply_waiting_change, _MAX_DELAY)
        self._parse("")
        self._scene = Scene({}, self.base)
        self._saved_settings = self._settings()

    def open(self, name: str | Path) -> None:
        """Open a scene, a draft, or one of the program's own scenes."""
        path = library.find(name).resolve()
        read = Scene.read(path)
        scene = registry.kind_of(path) in ("scene", None)
        if scene:
            text = path.read_text(encoding="utf-8")
        else:
            # A draft or knit has no scene text yet: write the scene that Scene.read made of it.
            text = tomlkit.dumps({"title": read.title, **library.values_of(path)})
        is_own = registry.kind_of(path) in ("scene", "draft", None)
        is_editable = is_own and path.parent != library.folder().resolve()
        self.file, self.source = path if is_editable else None, path
        self._replace(text, path.parent, read)

    def new(self) -> None:
        """Start a new scene: a plain weave that hangs from its top edge."""
        self.file = self.source = None
        # A sheet bends like cloth; a thin cage of tetrahedra would be too stiff, and be warned of.
        sections = "[weave]", "[cage]", '[modal]\nelements = "sheet"', "[response]"
        self._replace("\n\n".join(['title = "New fabric"', *sections]) + "\n")

    def save(self, path: Path | None = None, time: float | None = None) -> list[str]:
        """Save the scene with its comments, or its draft; return what the file cannot store."""
        target = path or self.file
        if target is None:
            raise InputError("this scene has no file yet", cure='Use "Save as".')
        target = target.resolve()
        if registry.kind_of(target) == "draft":
            lost = self.save_draft(target, adopt=True)
            self.file = self.source = target
            return lost
        before = self.version
        try:
            if time is not None and time != self.scene.view.time:
                self._write_value("view", "time", float(f"{time:.6g}"))
            self._relocate_paths(self._folder, target.parent)
            with atomic_files(target) as folder:
                self._save_draft(target, folder)
                self._save_state(target, folder)
                self._scene = Scene(self.values, target)
                write_parts(folder / target.name, [self.text.encode()])
        except BaseException:
            self._parse(before.text)
            self._scene = Scene(self.values, self.base)
            raise
        self.file = self.source = target
        self._folder = target.parent
        self._saved_draft = self.scene.draft_file
        self._saved_settings = self._settings()
        self.history.setClean()
        if self.text != before.text:
            self.changed.emit()
        return []

    def save_draft(self, path: Path, adopt: bool = False) -> list[str]:
        """Save the draft; return what the file cannot store and what remains unsaved."""
        # If the draft had no file of the user's yet, the scene refers to this file from now on.
        path = path.resolve()
        check_output(path, registry.writer_endings("draft"))
        draft, format_ = self.scene.draft, registry.writer(path, "draft")
        self.back_up_draft(path)
        with atomic_file(path) as file:
            format_.write(file, draft)
        if adopt or self.drafts.contains(self.scene.draft_file):
            in_scene_folder = self.file is not None and path.parent == self._folder
            self._write_value("weave", "draft", path.name if in_scene_folder else str(path))
            self._scene = Scene(self.values, self.base)
            self.changed.emit()
        is_draft = self.opened_draft is not None
        unsaved = [
            f"{section}.{key}"
            for section, values in self._settings().items()
            for key, value in values.items()
            if value != self._saved_settings[section][key]
            and not (is_draft and _is_in_draft(section, key))
        ]
        if not unsaved:
            self.history.setClean()
        lost = format_.loses(draft) if format_.loses else []
        if unsaved and is_draft:
            lost.append(
                f'a draft file cannot store {", ".join(unsaved)}: use "Save as" to save a scene'
            )
        return lost

    @property
    def opened_draft(self) -> Path | None:
        """The draft file that was opened; None if a scene was opened."""
        drafted = self.source is not None and registry.kind_of(self.source) == "draft"
        return self.source if drafted else None

    @property
    def unsaved_file(self) -> str:
        """What exists only in a temporary file, in words; empty if nothing does."""
        if self.drafts.contains(self.scene.draft_file):
            return "the edited draft"
        if self.drafts.contains(self.scene.modal.start):
            return "the state from which the cloth was dropped"
        return ""

    @property
    def example_name(self) -> str | None:
        """Name of the opened scene if it is one of the program's own; otherwise None."""
        if self.source is None or self.source.parent != library.folder().resolve():
            return None
        return self.source.stem

    def display_name(self, file: Path) -> str:
        """Return the name to show for a file; without a folder if it lies in the scene's folder."""
        return file.name if file.parent == self._folder else self.drafts.replace_paths(file)

    def describe_error(self, error: SpacemapError) -> str:
        """Describe an error in the window's scene, which need not be in a file."""
        if error.file is not None and not Path(error.file).exists():
            error.file = None
        return self.drafts.replace_paths(error)

    def propose_name(self, ending: str) -> str:
        """Propose a file name for this scene; in its folder, unless it is the program's own."""
        if self.source is None:
            return "_".join(re.findall(r"\w+", self.name.lower())) + ending
        is_own_file = self.source.parent != library.folder().resolve()
        return str(self.source.with_suffix(ending)) if is_own_file else self.source.stem + ending

    @property
    def scene(self) -> Scene:
        """The scene as the text describes it."""
        self.apply_waiting_change()
        return self._scene

    @property
    def text(self) -> str:
        """The scene as TOML."""
        self.apply_waiting_change()
        if self._text is None:
            self._text = tomlkit.dumps(self._toml)
        return self._text

    @property
    def version(self) -> Version:
        """The present text, with the data that give its relative paths their meaning."""
        return Version(self.text, self._folder, len(self._overwritten))

    @property
    def values(self) -> dict[str, Any]:
        """The scene as plain dictionaries. Do not modify them; each change makes new ones."""
        self.apply_waiting_change()
        if self._values is None:
            self._values = self._toml.unwrap()
        return self._values

    @property
    def base(self) -> Path:
        """A file in the folder that is the base of relative paths."""
        if self.file is None or self.opened_draft:
            return self._folder / "scene.toml"
        return self.file

    @property
    def name(self) -> str:
        """Name of the scene in the title bar."""
        return self.file.name if self.file else self.scene.title or "New fabric"

    def value_in_file(self, section: str, key: str) -> Any:
        """Return a value as it is written in the scene file; None if it is not written."""
        return self.values.get(section, {}).get(key)

    def set(self, section: str, key: str, written: Any, burst: int = 0) -> None:
        """Change a value, undoably."""
        self.set_many(section, {key: written}, burst)

    def set_many(
        self, section: str, written: Mapping[str, Any], burst: int = 0, name: str = ""
    ) -> None:
        """Change several values of a section in one undo step."""
        change = section, dict(written), burst, name
        if self._waiting is not None and not _supersedes(change, self._waiting):
            self.apply_waiting_change()
        if burst and self.congested() and self._is_valid(section, written):
            self._waiting = change
            if not self._delay_timer.isActive():
                self._delay_timer.start()
            return
        waiting, self._waiting = self._waiting, None
        if all(self.value_in_file(section, k) == v for k, v in written.items()):
            return
        try:
            self._apply(section, written, burst, name)
        except InputError:
            # The waiting change is valid; the new one does not replace it.
            self._waiting = waiting
            raise

    def switch(self, section: str, on: bool = True, values: Mapping[str, Any] = _NO_VALUES) -> None:
        """Switch a stage on, with its former values, or off; switch the stages it needs as well."""
        scene, sections_before = self.scene, self.values.keys() - {"title"}
        if on == (scene.parts[section] in scene.stages) and not values:
            return
        sections_on = switch_section(scene.parts, sections_before, section, on)
        stages_on, removed_sections = (
            choose_stages(scene.parts, sections_on),
            sections_before - sections_on,
        )
        if on:
            for name, (_, together) in self._off.items():
                if together and is_compatible(scene.parts, name, sections_on):
                    sections_on.add(name)
            stages_on = choose_stages(scene.parts, sections_on)
            sections_on |= {stage.section for stage in stages_on} & self._off.keys()
        elif len(removed_sections) > 1:
            self._off = {name: (table, False) for name, (table, _) in self._off.items()}

        def change() -> None:
            self._text = self._values = None
            for name in removed_sections:
                self._off[name] = self._toml.pop(name), not on or len(removed_sections) > 1
            for name in scene.parts:  # in the order of the pipeline
                if name in sections_on - sections_before:
                    self._toml[name] = self._off.get(name, (tomlkit.table(), False))[0]
                    for former in removed_sections:
                        self._copy_common_values(name, former)
            for key, value in values.items():
                self._write_value(section, key, value)
            if on and not scene.moves and "show" not in self.values.get("view", {}):
                self._write_value("view", "show", "both")  # show what the change adds

        self._change(
            change,
            f"switch {'on' if on else 'off'} {stage_title(type(scene.parts[section]).__name__)}",
        )
        before, after = (
            [stage_title(type(s).__name__) for s in stages if s.section != section]
            for stages in (scene.stages, self.scene.stages)
        )
        added, removed = (
            [n for n in a if n not in b] for a, b in ((after, before), (before, after))
        )
        effects = [f"Also switched on: {', '.join(added)}"] if added else []
        effects += [f"Also switched off: {', '.join(removed)}"] if removed else []
        if effects:
            self.side_effects.emit(". ".join(effects))

    def _copy_common_values(self, section: str, former: str) -> None:
        """Copy values of the same name from a stage to the stage that replaces it in its role."""
        new, old = (self._scene.parts[name] for name in (section, former))
        if isinstance(new, Stage) and isinstance(old, Stage) and new.role == old.role:
            table = self._off[former][0]
            for key in new.parameters.keys() & old.parameters.keys():
                self._write_value(section, key, table.get(key))

    def apply_preset(self, preset: str, **options: Any) -> list[Note]:
        """Make cloth in motion of the scene's textile, in one undo step; return the assumptions."""
        plan = presets.make_plan(self.scene, preset, **options)
        values, draft = plan.values, self.scene.draft_file
        if self.drafts.contains(draft):
            # By its whole path, by which the edited draft is recognised when the scene is saved.
            values = {**values, "weave": {**values["weave"], "draft": str(draft)}}

        def change() -> None:
            self._parse(presets.format_preset(values))

        self._change(change, PRESETS[preset].label.lower())
        return plan.notes

    def was_switched_off(self, section: str) -> bool:
        """Return whether a stage was on before and is now off."""
        return section in self._off

    def _apply(self, section: str, written: Mapping[str, Any], burst: int, name: str) -> None:
        def put() -> None:
            for key, value in written.items():
                self._write_value(section, key, value)

        self._change(put, name or self._describe(section, written), burst)

    def _describe(self, section: str, written: Mapping[str, Any]) -> str:
        """Return the names of changed values, for the list of changes."""
        part = self._scene.parts[section]
        labels = [part.parameter(key).label for key in written]
        more = ", …" if len(labels) > _MOST_NAMES else ""
        return f"{stage_title(type(part).__name__)}: {', '.join(labels[:_MOST_NAMES])}{more}"

    def _change(self, change: Callable[[], None], name: str, burst: int = 0) -> None:
        before, former = self.version, self.values
        change()
        colors = self._scene.colorings
        try:
            self._scene = Scene(self.values, self.base)
            if (lost := self._scene.view.color) in colors and lost not in self._scene.colorings:
                # The quantity shown by colour has just gone; a run would fail until it is reset.
                self._write_value("view", "color", None)
                self._scene = Scene(self.values, self.base)
                label = COLORINGS[lost].label
                self.side_effects.emit(f'Colouring reset: "{label}" is no longer available')
        except InputError:
            self._parse(before.text)
            self._values = former
            raise
        if self.text != before.text:
            self.history.push(Edit(self.restore, name, before, self.version, burst))
            self.changed.emit()

    def apply_waiting_change(self) -> None:
        """Apply the change that waits, if there is one; the properties of this class call this."""
        if self._waiting is None:
            return
        waiting, self._waiting = self._waiting, None
        try:
            self._apply(*waiting)
        except InputError as error:  # it was checked, but a file can be deleted meanwhile
            self.failed.emit(error)

    def restore(self, version: Version) -> None:
        """Restore an earlier text (undo, redo); its paths refer to the same content as then."""
        before = self.text
        self._parse(version.text)
        draft = self.values.get("weave", {}).get("draft")
        for file, backup in self._overwritten[version.overwritten :]:
            if draft is not None and os.path.normpath(version.folder / draft) == str(file):
                self._write_value("weave", "draft", str(backup))
                break
        self._relocate_paths(version.folder, self._folder)
        try:
            self._scene = Scene(self.values, self.base)
        except InputError as error:  # a file that it names does not exist any more
            self._parse(before)
            self.failed.emit(error)
        else:
            self.changed.emit()

    def back_up_draft(self, draft: Path) -> None:
        """Copy a draft file before it is overwritten, so that undo can restore it."""
        if draft.exists():
            self._overwritten.append((draft, self.drafts.add_file(draft)))

    def _is_valid(self, section: str, written: Mapping[str, Any]) -> bool:
        """Return whether the values are valid for certain."""
        if section not in self._scene.parts or None in written.values():
            return False
        values = self._values if self._values is not None else self._toml.unwrap()
        if section not in values:
            return False  # a new section may exclude another one
        try:
            for key, value in written.items():
                parameter = self._scene.parts[section].parameter(key)
                parameter.check(parameter.resolve_path(value, self._folder))
        except InputError:
            return False
        return True

    def _replace(self, text: str, folder: Path | None = None, read: Scene | None = None) -> None:
        self._waiting = None
        self._folder = folder or Path.cwd()
        self._parse(text)
        self._scene = read or Scene(self.values, self.base)
        self._scene.file = self.base  # if a draft was opened, Scene.read has set the draft's file
        self._saved_draft = self.scene.draft_file if self.file else None
        self._saved_settings = self._settings()
        self._overwritten.clear()
        self._off.clear()
        self.history.clear()
        self.replaced.emit()

    def _settings(self) -> dict[str, dict[str, Any]]:
        """Return the values of every section, to find unsaved changes by comparison."""
        settings = self.scene.settings
        draft = settings["weave"]["draft"]
        settings["weave"]["draft"] = draft and draft.resolve()
        return settings

    def _parse(self, text: str) -> None:
        self._toml = tomlkit.parse(text)
        self._text, self._values = text, None

    def _write_value(self, section: str, key: str, written: Any) -> None:
        self._text = self._values = None
        there = self._toml.get(section, {})
        if written is None:
            if key in there:
                del there[key]
        elif isinstance(there.get(key), AoT) and len(there[key]) <= len(written):
            # Key by key, to keep the comments between the keys.
            declared: Any = self._scene.parts[section].parameters[key]
            count = len(there[key])
            for table, wanted in zip(there[key], written[:count], strict=True):
                self._write_record(table, wanted, declared.record.parameters)
            if written[count:]:
                self._append_records(section, there[key], written[count:])
        elif section in self._toml:
            if written and isinstance(there.get(key), AoT):
                del there[key]  # tomlkit puts a blank line only before a new key
            self._toml[section][key] = written
            tables = self._toml[section][key]
            if isinstance(tables, AoT) and section != [*self._toml][-1]:
                tables[-1].add(tomlkit.nl())  # a blank line before the next section
        else:
            self._toml[section] = {key: written}
        if isinstance(written, list) and len(written) > _MAX_VALUES_PER_LINE:
            long = self._toml[section][key]
            if isinstance(long, Array):
                long.multiline(True)

    def _append_records(self, section: str, tables: AoT, written: Sequence[Any]) -> None:
        """Append tables, with one blank line before each and before the next section."""
        body = tables[-1].value.body
        while body and isinstance(body[-1][1], Whitespace):
            body.pop()
        for record in written:
            table = tomlkit.item(record)
            table.trivia.indent = "\n"
            tables.append(table)
        if section != [*self._toml][-1]:
            tables[-1].add(tomlkit.nl())

    def _write_record(self, table: Any, wanted: Mapping[str, Any], parameters: Any) -> None:
        """Change a table to the values of a record; a default that it states stays."""
        for name in [name for name in table if name not in wanted]:
            parameter = parameters.get(name)
            default = None if parameter is None else parameter.default
            if default is None or not self._is_same_value(table[name], default, parameter):
                del table[name]
        for name, value in wanted.items():
            parameter = parameters.get(name)
            if name not in table or not self._is_same_value(table[name], value, parameter):
                table[name] = value

    def _is_same_value(self, old: Any, new: Any, parameter: Any) -> bool:
        """Return whether a written value ("20 ms") equals an editor's value in SI units (0.02)."""
        # Likewise for paths: an editor gives the absolute path.
        old_value, new_value = (
            parameter.resolve_path(v, self._folder) for v in (_unwrap(old), new)
        )
        try:
            return bool(parameter.check(old_value) == parameter.check(new_value))
        except InputError:
            return False

    def _save_draft(self, target: Path, folder: Path) -> None:
        """Write an edited draft into the folder of files that are saved with the scene."""
        draft = self.scene.draft_file
        if draft is None or not self.drafts.contains(draft):
            return
        # Overwrite only the draft that this scene has saved, never another file of that name.
        proposal = path = target.with_suffix(".wif")
        number = 2
        while path.exists() and path != self._saved_draft:
            path, number = proposal.with_stem(f"{proposal.stem}-{number}"), number + 1
        self.back_up_draft(path)
        write_parts(folder / path.name, [draft.read_bytes()])
        self._write_value("weave", "draft", path.name)

    def _save_state(self, target: Path, folder: Path) -> None:
        """Write the state from which cloth was dropped into the folder of files to save."""
        state = self.scene.modal.start
        if state is None or not self.drafts.contains(state):
            return
        # The name contains a part of the content's digest: no other file is overwritten.
        name = f"{target.stem}_start_{state.stem[:8]}{state.suffix}"
        write_parts(folder / name, [state.read_bytes()])
        self._write_value("modal", "start", name)

    def _relocate_paths(self, old: Path, new: Path) -> None:
        """Change relative paths so that they refer to the same files from another folder."""
        if old == new:
            return
        for section, table in self.values.items():
            for key, value in table.items() if isinstance(table, dict) else ():
                moved = _relocate(value, self.scene.parts[section].parameters.get(key), old, new)
                if moved != value:
                    self._write_value(section, key, moved)


def _relocate(value: Any, parameter: Any, old: Path, new: Path) -> Any:
    """Return a value with its paths, also those in records, relative to another folder."""
    if isinstance(parameter, FilePath) and isinstance(value, str):
        there = parameter.resolve_path(value, old)
        # The word for an automatic path is not a path, and an absolute path stays.
        return value if there == value or Path(value).is_absolute() else os.path.relpath(there, new)
    if isinstance(value, list) and hasattr(parameter, "record"):
        return [_relocate(item, parameter, old, new) for item in value]
    if isinstance(value, dict) and hasattr(parameter, "record"):
        keys = parameter.record.parameters
        return {key: _relocate(item, keys.get(key), old, new) for key, item in value.items()}
    return value


def _is_in_draft(section: str, key: str) -> bool:
    """Return whether a value needs no scene file: a draft stores it, or it belongs to the view."""
    return section == "view" or (section == "weave" and key in DRAFT_KEYS)


def _supersedes(change: _Change, former: _Change) -> bool:
    """Return whether a newer change of a drag makes the former one unnecessary."""
    section, written, *others = change
    return section == former[0] and written.keys() == former[1].keys() and others == [*former[2:]]


def _unwrap(item: Any) -> Any:
    return item.unwrap() if hasattr(item, "unwrap") else item
