"""Records of provenance in a scene's output files, and the scenes that they describe."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from spacemap_vtk import __version__
from spacemap_vtk.errors import InputError, SpacemapError
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.cage_fittings import Places
from spacemap_vtk.io.file_references import file_references
from spacemap_vtk.io.formats.toml import format_scene, parse_toml
from spacemap_vtk.io.provenance import Record
from spacemap_vtk.io.series import is_pattern, matching_files, open_series
from spacemap_vtk.parameters import Parameter, Parameterised, Real
from spacemap_vtk.scenes import library
from spacemap_vtk.scenes.pipeline import section_classes
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.sweep import paths_in, resolve_paths
from spacemap_vtk.units import GRAVITY

#: Keys that are written also if they have the usual value, as they say what a record is.
_ALWAYS = ("shape",)


def make_record(scene: Scene, order: Mapping[str, Any], times: Sequence[float]) -> Record:
    """Return the record of a job and its scene, as the scene is now."""
    folder, values = scene.file.parent if scene.file else Path(), scene_values(scene)
    files: dict[Path, None] = {}
    for name, part in scene.parts.items():
        if name in values:
            files |= dict.fromkeys(_input_files(part.settings, name == scene.motion.section))
    file = scene.file.name if scene.file else ""
    text = format_scene(values, f"{file or 'a scene'}, as it was run")
    inputs = {
        _relative_name(path, folder): _digest(path, path.stat().st_mtime_ns) for path in files
    }
    return Record(__version__, order, text, file, tuple(times), inputs)


def scene_values(scene: Scene, folder: Path | None = None) -> dict[str, Any]:
    """Return the values of a scene file, by default in the scene's folder, that gives the scene."""
    if folder is None:
        folder = scene.file.parent if scene.file else Path()
    values: dict[str, Any] = {"title": scene.title}
    for name, part in scene.parts.items():
        # Skip stages that are neither given nor connected. All else counts, given or not.
        if (
            name not in scene.given_sections
            and isinstance(part, Stage)
            and part not in scene.stages
        ):
            continue
        changed = _changed_values(part, folder, scene.object.section in scene.given_sections)
        if changed or name in scene.given_sections:
            values[name] = changed
    return values


def describe_outside_files(scene: Scene) -> Iterator[str]:
    """Yield a sentence for each file that a scene reads outside the folders it may refer to."""
    # A scene may refer to files in its folder and below, and so may each of these files. Files
    # that the user has named are not reported.
    for stage in scene.stages:
        for key, value in stage.settings.items():
            from_file = scene.file is not None and (stage.section, key) not in scene.assigned
            for path in (one for word in paths_in(value) for one in _matching_files(word)):
                scenes = [scene.file] if from_file and scene.file else []
                for by, other in [*((each, path) for each in scenes), *file_references(path)]:
                    place = os.path.realpath(other)
                    if not any(_is_inside(place, each.parent) for each in (by, *scenes)):
                        yield f"{by} refers to {place}, outside its folder; the file is read"


def _is_inside(place: str, folder: Path) -> bool:
    return Path(place).is_relative_to(os.path.realpath(folder))


def _matching_files(path: Path) -> list[Path]:
    """Return the files that match a pattern."""
    return matching_files(path) if is_pattern(path) else [path]


def restore_scene(record: Record, folders: Iterable[Path]) -> tuple[Scene, list[Path]]:
    """Return a record's scene, and its inputs in the first folder that has them unchanged."""
    # A scene that refers to other files is refused, because the record may be a stranger's.
    folders = list(folders)
    faults = [_find_fault(record, folder) for folder in folders]
    if all(faults):
        raise InputError(
            faults[0] or "",
            cure="Restore it, or give the scene's folder with --folder.",
        )
    folder = folders[faults.index(None)]
    try:
        values = parse_toml(record.scene)
    except ValueError as error:
        raise InputError(f"the recorded scene is damaged: {error}") from None
    inputs = [folder / name for name in record.inputs]
    allowed = {os.path.abspath(path) for path in inputs}
    for path in paths_in(resolve_paths(values, section_classes(), folder)):
        beside = (other for each in _matching_files(path) for _, other in file_references(each))
        for other in [*_matching_files(path), *filter(os.path.isfile, beside)]:
            if os.path.abspath(other) not in allowed:
                raise InputError(
                    f"the recorded scene refers to {other}, which is not among its input files",
                    cure="This program did not write the record. Inspect the file with "
                    '"spacemap info".',
                )
    return Scene(values, folder / (Path(record.file).name or "scene.toml")), inputs


def _find_fault(record: Record, folder: Path) -> str | None:
    """Return what is wrong with a record's inputs in a folder; None if they are unchanged."""
    for name, was in record.inputs.items():
        path = folder / name
        if not os.path.isfile(path):
            return f"the input file {path} is missing"
        if _digest(path, path.stat().st_mtime_ns) != was:
            return f"the input file {path} has changed"
    return None


@lru_cache(100)
def _digest(path: Path, _changed: int) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _input_files(value: Any, motion: bool) -> Iterator[Path]:
    """Yield the files that are read for values, and the files that those refer to."""
    for path in paths_in(value):
        try:
            found = open_series(path).files if motion else [path]
        except SpacemapError:
            continue  # the stage that needs it raises this error
        found += [other for each in found for _, other in file_references(each)]
        yield from filter(os.path.isfile, found)


def _changed_values(part: Parameterised, folder: Path, of_object: bool = False) -> dict[str, Any]:
    """Return the values that differ from the usual ones, as in a scene file."""
    return {
        key: _format(value, part.parameter(key), folder)
        for key, value in part.settings.items()
        if value != part.parameter(key).default_for(of_object) or key in _ALWAYS
    }


def _format(value: Any, parameter: Parameter[Any], folder: Path) -> Any:
    if isinstance(value, Parameterised):
        return _changed_values(value, folder)
    if isinstance(value, Path):
        return _relative_name(value, folder)
    if isinstance(parameter, Places):
        return [place.with_units() for place in parameter.read(" ".join(value))]
    if isinstance(value, (tuple, list)):
        return [_format(item, parameter, folder) for item in value]
    number = getattr(parameter, "component", parameter)
    if isinstance(value, float) and isinstance(number, Real) and number.unit:
        if value == 0.0 and number is not parameter:
            return value  # a component of a vector
        # With its unit, if the text gives the same value.
        text = number.text(value)
        if number.unit == "m/s2":
            text = f"{float(f'{value / GRAVITY:.12g}'):g} g"
        return text if number.check(text) == value else f"{value!r} {number.unit}"
    return "auto" if value is None and parameter.automatic else value


def _relative_name(path: Path, folder: Path) -> str:
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # on another drive of Windows
        return path.as_posix()


def input_folders(record_file: Path, folder: Path | None) -> list[Path]:
    """Return the folders in which a file's inputs may be."""
    return [folder] if folder else [Path(), record_file.parent, library.folder()]
