"""The document: a scene's text, what it says, and the way back."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import tomlkit
from PySide6.QtCore import QObject, Signal
from tomlkit.items import AoT, Array

from spacemap_vtk.app.edit import Edit, History, Version
from spacemap_vtk.app.kept_drafts import KeptDrafts
from spacemap_vtk.app.widgets import later
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.io import registry
from spacemap_vtk.io.output import check_output, whole_file, whole_folder, write
from spacemap_vtk.parameters import FilePath
from spacemap_vtk.scenes import library
from spacemap_vtk.scenes.chain import chain, fits, switched, words_of
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.scene import Scene

#: A longer list is written with a line for each value.
_LINE = 8
#: What of a weave a file of its draft holds: all that the draft tab edits.
DRAFTED = ("draft", "pattern", "ends", "picks", "warp_color", "weft_color")
#: Milliseconds that a change of a drag waits at most.
_LATEST = 50
_NOTHING: Mapping[str, Any] = MappingProxyType({})
#: Section, values, burst and name, as for `Document.set_many`.
_Change = tuple[str, dict[str, Any], int, str]


class Document(QObject):
    """A scene as its file has it, with comments, and its undo stack."""

    # Only accepted values are in it: a refused one raises and changes nothing.

    #: A value is another; undo and redo too.
    changed = Signal()
    #: Another scene is here.
    replaced = Signal()
    #: What else a change has changed, in words: other stages, or what colours show.
    told_beside = Signal(str)
    #: Undo or redo has led to a scene that is refused; all stays as it was.
    failed = Signal(object)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.undo = History(self)
        #: The file that "save" writes, a scene or a draft; None before the first "save as".
        self.file: Path | None = None
        #: The file that the scene was read from, a draft or a scene of the program's among them.
        self.source: Path | None = None
        #: Drafts that are edited and in no file of the user's yet.
        self.drafts = KeptDrafts()
        self._saved_draft: Path | None = None
        #: What the sections of stages that are off had in them, and whether each went with others.
        self._off: dict[str, tuple[Any, bool]] = {}
        # Drafts that were written over, and copies of what was in them.
        self._overwritten: list[tuple[Path, Path]] = []
        self._folder = Path.cwd()
        # Made when they are asked for, once for each change.
        self._text: str | None = None
        self._values: dict[str, Any] | None = None
        #: Whether more frames are asked for than are made: the changes of a drag then wait, and
        #: of those that come meanwhile the last one counts. Each would cost a tenth of a frame.
        self.crowded: Callable[[], bool] = lambda: False
        self._waiting: _Change | None = None
        self._latest = later(self, self.catch_up, _LATEST)
        self._parse("")
        self._scene = Scene({}, self.base)
        self._clean = self._settings()

    def open(self, name: str | Path) -> None:
        """Read a scene, a draft, or a scene that comes with the program."""
        path = library.find(name).resolve()
        read = Scene.read(path)
        scene = registry.kind_of(path) in ("scene", None)
        if scene:
            text = path.read_text(encoding="utf-8")
        else:
            # A new scene of the draft: what Scene.read makes of it is not yet a text.
            text = tomlkit.dumps({"title": read.title, **library.values_of(path)})
        own = registry.kind_of(path) != "mesh" and path.parent != library.folder().resolve()
        self.file, self.source = path if own else None, path
        self._replace(text, path.parent, read)

    def new(self) -> None:
        """Begin a scene: a plain weave that hangs by its top edge."""
        self.file = self.source = None
        self._replace('title = "New fabric"\n\n[weave]\n\n[cage]\n\n[modal]\n\n[response]\n')

    def save(self, path: Path | None = None, time: float | None = None) -> list[str]:
        """Write the scene, comments and all, or its draft; return what the file cannot hold."""
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
                self._put("view", "time", float(f"{time:.6g}"))
            self._move_from(self._folder, target.parent)
            with whole_folder(target) as folder:
                self._save_draft(target, folder)
                self._scene = Scene(self.values, target)
                write(folder / target.name, [self.text.encode()])
        except BaseException:
            self._parse(before.text)
            self._scene = Scene(self.values, self.base)
            raise
        self.file = self.source = target
        self._folder = target.parent
        self._saved_draft = self.scene.draft_file
        self._clean = self._settings()
        self.undo.setClean()
        if self.text != before.text:
            self.changed.emit()
        return []

    def save_draft(self, path: Path, adopt: bool = False) -> list[str]:
        """Write the draft, refer to its file if it had none; return what is lost or unsaved."""
        path = path.resolve()
        check_output(path, registry.written("draft"))
        draft, format_ = self.scene.draft, registry.writer(path, "draft")
        self.remember(path)
        with whole_file(path) as file:
            format_.write(file, draft)
        if adopt or self.drafts.holds(self.scene.draft_file):
            beside = self.file is not None and path.parent == self._folder
            self._put("weave", "draft", path.name if beside else str(path))
            self._scene = Scene(self.values, self.base)
            self.changed.emit()
        drafted = self.opened_draft is not None
        left = [
            f"{section}.{key}"
            for section, values in self._settings().items()
            for key, value in values.items()
            if value != self._clean[section][key] and not (drafted and _in_draft(section, key))
        ]
        if not left:
            self.undo.setClean()
        lost = format_.loses(draft) if format_.loses else []
        if left and drafted:
            lost.append(f'a draft holds no {", ".join(left)}: "Save as" keeps that in a scene')
        return lost

    @property
    def opened_draft(self) -> Path | None:
        """The draft that was opened, whose file has what the scene says of it; None: a scene."""
        drafted = self.source is not None and registry.kind_of(self.source) == "draft"
        return self.source if drafted else None

    @property
    def example(self) -> str | None:
        """The name of the program's own scene that was opened; None: another one was."""
        if self.source is None or self.source.parent != library.folder().resolve():
            return None
        return self.source.stem

    def told(self, file: Path) -> str:
        """Return what to call a file: one beside the scene as the scene may."""
        return file.name if file.parent == self._folder else self.drafts.told(file)

    def proposed(self, ending: str) -> str:
        """Return a name for a file of this scene, beside its own if that is the user's."""
        if self.source is None:
            return "_".join(re.findall(r"\w+", self.name.lower())) + ending
        own = self.source.parent != library.folder().resolve()
        return str(self.source.with_suffix(ending)) if own else self.source.stem + ending

    @property
    def scene(self) -> Scene:
        """The scene as the text describes it."""
        self.catch_up()
        return self._scene

    @property
    def text(self) -> str:
        """The scene as TOML."""
        self.catch_up()
        if self._text is None:
            self._text = tomlkit.dumps(self._toml)
        return self._text

    @property
    def version(self) -> Version:
        """The present text, and what its paths mean."""
        return Version(self.text, self._folder, len(self._overwritten))

    @property
    def values(self) -> dict[str, Any]:
        """The scene as plain dictionaries; others after each change, and not to be changed."""
        self.catch_up()
        if self._values is None:
            self._values = self._toml.unwrap()
        return self._values

    @property
    def base(self) -> Path:
        """A file in the folder that relative paths count from."""
        if self.file is None or self.opened_draft:
            return self._folder / "scene.toml"
        return self.file

    @property
    def name(self) -> str:
        """What to call the scene in a title bar."""
        return self.file.name if self.file else self.scene.title or "New fabric"

    def written(self, section: str, key: str) -> Any:
        """Return a value as the file has it."""
        return self.values.get(section, {}).get(key)

    def set(self, section: str, key: str, written: Any, burst: int = 0) -> None:
        """Change a value; can be undone."""
        self.set_many(section, {key: written}, burst)

    def set_many(
        self, section: str, written: Mapping[str, Any], burst: int = 0, name: str = ""
    ) -> None:
        """Change values that belong together; undone as one."""
        change = section, dict(written), burst, name
        if self._waiting is not None and not _replaces(change, self._waiting):
            self.catch_up()
        if burst and self.crowded() and self._accepts(section, written):
            self._waiting = change
            if not self._latest.isActive():
                self._latest.start()
            return
        waiting, self._waiting = self._waiting, None
        if all(self.written(section, k) == v for k, v in written.items()):
            return
        try:
            self._make(section, written, burst, name)
        except InputError:
            self._waiting = waiting  # it had been accepted
            raise

    def switch(self, section: str, on: bool = True, values: Mapping[str, Any] = _NOTHING) -> None:
        """Switch a stage on, as it was before it was switched off, or off; what it needs, too."""
        scene, given = self.scene, self.values.keys() - {"title"}
        if on == (scene.parts[section] in scene.stages) and not values:
            return
        wanted = switched(scene.parts, given, section, on)
        here, gone = chain(scene.parts, wanted), given - wanted
        if on:
            for name, (_, together) in self._off.items():
                if together and fits(scene.parts, name, wanted):
                    wanted.add(name)
            here = chain(scene.parts, wanted)
            wanted |= {stage.section for stage in here} & self._off.keys()
        elif len(gone) > 1:
            self._off = {name: (table, False) for name, (table, _) in self._off.items()}

        def change() -> None:
            self._text = self._values = None
            for name in gone:
                self._off[name] = self._toml.pop(name), not on or len(gone) > 1
            for name in scene.parts:  # in the order of the pipeline
                if name in wanted - given:
                    self._toml[name] = self._off.get(name, (tomlkit.table(), False))[0]
                    for former in gone:
                        self._take_over(name, former)
            for key, value in values.items():
                self._put(section, key, value)
            if on and not scene.moves and "show" not in self.values.get("view", {}):
                self._put("view", "show", "both")  # what has come in is seen

        self._change(
            change, f"{words_of(type(scene.parts[section]).__name__)} {'on' if on else 'off'}"
        )
        before, after = (
            [words_of(type(s).__name__) for s in stages if s.section != section]
            for stages in (scene.stages, self.scene.stages)
        )
        also = {"On": [n for n in after if n not in before]}
        also["Off"] = [n for n in before if n not in after]
        words = "; ".join(f"{state}, too: {', '.join(n)}" for state, n in also.items() if n)
        if words:
            self.told_beside.emit(words)

    def _take_over(self, section: str, former: str) -> None:
        """Give a stage the values of the one of its role whose place it takes, by their names."""
        new, old = (self._scene.parts[name] for name in (section, former))
        if isinstance(new, Stage) and isinstance(old, Stage) and new.role == old.role:
            table = self._off[former][0]
            for key in new.parameters.keys() & old.parameters.keys():
                self._put(section, key, table.get(key))

    def remembers(self, section: str) -> bool:
        """Return whether a stage is off that has been on."""
        return section in self._off

    def _make(self, section: str, written: Mapping[str, Any], burst: int, name: str) -> None:
        def put() -> None:
            for key, value in written.items():
                self._put(section, key, value)

        self._change(put, name or ", ".join(f"{section}.{key}" for key in written), burst)

    def _change(self, change: Callable[[], None], name: str, burst: int = 0) -> None:
        before, former = self.version, self.values
        change()
        colors = self._scene.colorings
        try:
            self._scene = Scene(self.values, self.base)
            if (lost := self._scene.view.color) in colors and lost not in self._scene.colorings:
                # What it showed has just gone: a run would be refused until it is reset.
                self._put("view", "color", None)
                self._scene = Scene(self.values, self.base)
                label = COLORINGS[lost].label
                self.told_beside.emit(f'Own colours again: "{label}" is there no more')
        except InputError:
            self._parse(before.text)
            self._values = former
            raise
        if self.text != before.text:
            self.undo.push(Edit(self.restore, name, before, self.version, burst))
            self.changed.emit()

    def catch_up(self) -> None:
        """Make the change that waits, if one does; whoever reads the document need not ask."""
        if self._waiting is None:
            return
        waiting, self._waiting = self._waiting, None
        try:
            self._make(*waiting)
        except InputError as error:  # it had been checked, but a file can go
            self.failed.emit(error)

    def restore(self, version: Version) -> None:
        """Take an earlier text; for undo and redo. Its paths lead to what they led to."""
        before = self.text
        self._parse(version.text)
        draft = self.values.get("weave", {}).get("draft")
        for file, kept in self._overwritten[version.overwritten :]:
            if draft is not None and os.path.normpath(version.folder / draft) == str(file):
                self._put("weave", "draft", str(kept))
                break
        self._move_from(version.folder, self._folder)
        try:
            self._scene = Scene(self.values, self.base)
        except InputError as error:  # a file that it names is gone
            self._parse(before)
            self.failed.emit(error)
        else:
            self.changed.emit()

    def remember(self, draft: Path) -> None:
        """Keep what a draft holds before it is written over: undo leads back to it."""
        if draft.exists():
            self._overwritten.append((draft, self.drafts.keep_file(draft)))

    def _accepts(self, section: str, written: Mapping[str, Any]) -> bool:
        """Whether a scene surely takes values that are not yet in it."""
        if section not in self._scene.parts or None in written.values():
            return False
        values = self._values if self._values is not None else self._toml.unwrap()
        if section not in values:
            return False  # it may exclude another one
        try:
            for key, value in written.items():
                parameter = self._scene.parts[section].parameter(key)
                parameter.check(parameter.within(value, self._folder))
        except InputError:
            return False
        return True

    def _replace(self, text: str, folder: Path | None = None, read: Scene | None = None) -> None:
        self._waiting = None
        self._folder = folder or Path.cwd()
        self._parse(text)
        self._scene = read or Scene(self.values, self.base)
        self._scene.file = self.base  # a draft's is not the scene's
        self._saved_draft = self.scene.draft_file if self.file else None
        self._clean = self._settings()
        self._overwritten.clear()
        self._off.clear()
        self.undo.clear()
        self.replaced.emit()

    def _settings(self) -> dict[str, dict[str, Any]]:
        """Return the values of every section, by which it is told whether anything is unsaved."""
        settings = self.scene.settings
        draft = settings["weave"]["draft"]
        settings["weave"]["draft"] = draft and draft.resolve()
        return settings

    def _parse(self, text: str) -> None:
        self._toml = tomlkit.parse(text)
        self._text, self._values = text, None

    def _put(self, section: str, key: str, written: Any) -> None:
        self._text = self._values = None
        there = self._toml.get(section, {})
        if written is None:
            if key in there:
                del there[key]
        elif isinstance(there.get(key), AoT) and len(there[key]) == len(written):
            # Key by key, so that the comments between them stay.
            declared: Any = self._scene.parts[section].parameters[key]
            for table, wanted in zip(there[key], written, strict=True):
                for name in [name for name in table if name not in wanted]:
                    del table[name]
                for name, value in wanted.items():
                    parameter = declared.record.parameters.get(name)
                    if name not in table or not self._same(table[name], value, parameter):
                        table[name] = value
        elif section in self._toml:
            self._toml[section][key] = written
        else:
            self._toml[section] = {key: written}
        if isinstance(written, list) and len(written) > _LINE:
            long = self._toml[section][key]
            if isinstance(long, Array):
                long.multiline(True)

    def _same(self, here: Any, wanted: Any, parameter: Any) -> bool:
        """Whether a value of a record, as "20 ms", is what an editor gives in SI, as 0.02."""
        # A path, too, is the same file where an editor gives the whole of it.
        one, other = (parameter.within(v, self._folder) for v in (_unwrapped(here), wanted))
        try:
            return bool(parameter.check(one) == parameter.check(other))
        except InputError:
            return False

    def _save_draft(self, target: Path, folder: Path) -> None:
        """Let an edited draft lie beside the scene that is being saved, by way of a folder."""
        draft = self.scene.draft_file
        if draft is None or not self.drafts.holds(draft):
            return
        # Only the scene's own draft is written over, never another file of that name.
        beside = free = target.with_suffix(".wif")
        number = 2
        while free.exists() and free != self._saved_draft:
            free, number = beside.with_stem(f"{beside.stem}-{number}"), number + 1
        self.remember(free)
        write(folder / free.name, [draft.read_bytes()])
        self._put("weave", "draft", free.name)

    def _move_from(self, old: Path, new: Path) -> None:
        """Let relative paths lead to the same files from another folder."""
        if old == new:
            return
        for section, table in self.values.items():
            for key, value in table.items() if isinstance(table, dict) else ():
                moved = _moved(value, self.scene.parts[section].parameters.get(key), old, new)
                if moved != value:
                    self._put(section, key, moved)


def _moved(value: Any, parameter: Any, old: Path, new: Path) -> Any:
    """Return a value whose paths, also those in its records, count from another folder."""
    if isinstance(parameter, FilePath) and isinstance(value, str):
        there = parameter.within(value, old)
        # The word for an automatic one is no path; a whole path needs no folder.
        return value if there == value or Path(value).is_absolute() else os.path.relpath(there, new)
    if isinstance(value, list) and hasattr(parameter, "record"):
        return [_moved(item, parameter, old, new) for item in value]
    if isinstance(value, dict) and hasattr(parameter, "record"):
        keys = parameter.record.parameters
        return {key: _moved(item, keys.get(key), old, new) for key, item in value.items()}
    return value


def _in_draft(section: str, key: str) -> bool:
    """Whether a draft's file holds a value; how it is looked at is no matter of a draft."""
    return section == "view" or (section == "weave" and key in DRAFTED)


def _replaces(change: _Change, former: _Change) -> bool:
    """Whether the newer of two changes of a drag makes the former needless."""
    section, written, *rest = change
    return section == former[0] and written.keys() == former[1].keys() and rest == [*former[2:]]


def _unwrapped(item: Any) -> Any:
    return item.unwrap() if hasattr(item, "unwrap") else item
