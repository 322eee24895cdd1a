"""A sweep: one scene with lists of values; each combination is a run."""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

from spacemap_vtk import __version__
from spacemap_vtk.errors import GeometryError, InputError, SizeError
from spacemap_vtk.parameters import Parameterised
from spacemap_vtk.scenes import library
from spacemap_vtk.scenes.assignments import ValueList, parse_value_list, require_part
from spacemap_vtk.scenes.flat_picture import picture_size
from spacemap_vtk.scenes.level_of_detail import choose_level
from spacemap_vtk.scenes.memory_estimates import PictureRequest
from spacemap_vtk.scenes.scene import Scene

#: Larger sweeps are mistakes in the lists.
MOST_RUNS = 10_000
#: Longest name of a file, without its ending.
_MAX_NAME = 120


@dataclass(frozen=True)
class Run:
    """A scene with one value from each list."""

    #: Name of its files, without their endings.
    name: str
    #: The value from each list with several values: in words, and as it was given.
    labels: tuple[str, ...]
    chosen: tuple[Any, ...]
    #: The scene's file and its values, with absolute paths.
    file: Path
    values: Mapping[str, Any]
    #: Section, key and value of everything that is set.
    assigned: tuple[tuple[str, str, Any], ...]
    #: Times of its pictures [s]; empty: as the scene says.
    times: tuple[float, ...] = ()

    def scene(self) -> Scene:
        """Return the scene, not yet updated."""
        scene = Scene(self.values, self.file)
        for section, key, value in self.assigned:
            scene.assign(section, key, value)
        return scene

    @property
    def scene_values(self) -> dict[str, Any]:
        """The values as in a scene file for this run alone."""
        found = {k: dict(v) if isinstance(v, Mapping) else v for k, v in self.values.items()}
        for section, key, value in self.assigned:
            found.setdefault(section, {})[key] = value
        if self.labels:
            found["title"] = f"{found.get('title', self.file.stem)}: {', '.join(self.labels)}"
        return found

    @property
    def digest(self) -> str:
        """Digest of the values, times, contents of the input files and the program's version."""
        values = [__version__, self.scene_values, self.times]
        digest = hashlib.sha256(json.dumps(values, default=str, sort_keys=True).encode())
        for path in sorted(set(paths_in(self.scene_values))):
            if os.path.isfile(path):
                digest.update(path.read_bytes())
        return digest.hexdigest()[:32]


@dataclass
class Sweep:
    """All runs and their lists of values."""

    #: The lists with several values: the axes of a grid, the last one varying fastest.
    axes: list[ValueList]
    runs: list[Run]
    #: Title of the scene.
    title: str = ""
    #: Whether the lists are paired: the first values of all lists together, and so on.
    paired: bool = False
    #: Runs that `check` found impossible, and why.
    impossible: dict[str, str] = field(default_factory=dict)
    #: Memory to draw the largest run, as found by `check` [bytes].
    memory: int = 0

    def check(self) -> None:
        """Refuse invalid values; yarns that do not fit, or too little memory, are results."""
        for run in self.runs:
            try:
                scene = run.scene()
                scene.check()
                self.memory = max(self.memory, _drawing_bytes(scene))
            except (GeometryError, SizeError) as error:
                self.impossible[run.name] = str(error)
                if len(self.impossible) == len(self.runs):
                    raise
            except InputError as error:
                if run.labels:
                    error.message = f"with {', '.join(run.labels)}: {error.message}"
                raise


def _drawing_bytes(scene: Scene) -> int:
    """Return the memory for drawing; for yarns drawn in pieces, a number above any memory."""
    level = choose_level(scene, PictureRequest(picture_size(scene)))
    return sys.maxsize if level.has_sheet else level.bytes


def read_sweep(
    scene: str | Path,
    assignments: Sequence[str],
    *,
    paired: bool = False,
    times: Sequence[float] = (),
    fixed: Sequence[tuple[str, str, Any]] = (),
) -> Sweep:
    """Return the runs of a scene for the arguments of ``--set``, each with a list of values."""
    file = library.find(scene).resolve()
    values = library.values_of(file, file.name)
    return make_sweep(
        Scene.read(file), values, assignments, file=file, paired=paired, times=times, fixed=fixed
    )


def make_sweep(
    read: Scene,
    values: Mapping[str, Any],
    assignments: Sequence[str],
    *,
    file: Path,
    paired: bool = False,
    times: Sequence[float] = (),
    fixed: Sequence[tuple[str, str, Any]] = (),
) -> Sweep:
    """Return the runs of a scene that has been read, with the values of its file."""
    lists = [parse_value_list(assignment, read.parts) for assignment in assignments]
    names = [each.name for each in lists]
    for name in names:
        if names.count(name) > 1:
            raise InputError(
                "is set twice", key=name, cure=f"Give all values in one list: {name}=1,2,3."
            )
    axes = [each for each in lists if len(each.values) > 1]
    if paired and len({len(each.values) for each in axes}) > 1:
        lengths = ", ".join(f"{each.name} has {len(each.values)}" for each in axes)
        raise InputError(
            f"paired lists must have the same length: {lengths}",
            cure="Leave out --zip to run all combinations.",
        )
    many = len(axes[0].values) if paired and axes else prod(len(each.values) for each in axes)
    if many > MOST_RUNS:
        raise InputError(f"too many runs: {many}", allowed=f"up to {MOST_RUNS}")
    ranges = [range(len(each.values)) for each in axes]
    places = list(zip(*ranges, strict=True)) if paired and axes else list(product(*ranges))
    base, here = resolve_paths(values, read.parts, file.parent), Path.cwd()
    always = [
        *((each.section, each.key, each.values[0]) for each in lists if len(each.values) == 1),
        *fixed,
    ]
    keys = [each.key if sum(e.key == each.key for e in axes) == 1 else each.name for each in axes]
    runs: list[Run] = []
    for place in places:
        chosen = [each.values[k] for each, k in zip(axes, place, strict=True)]
        varied = [(e.section, e.key, value) for e, value in zip(axes, chosen, strict=True)]
        assigned = tuple(
            (
                section,
                key,
                require_part(read.parts, section).parameter(key).resolve_path(value, here),
            )
            for section, key, value in [*always, *varied]
        )
        labels = [each.label(value) for each, value in zip(axes, chosen, strict=True)]
        name = _file_name(keys, labels)
        words = [f"{key} = {label}" for key, label in zip(keys, labels, strict=True)]
        runs.append(Run(name, tuple(words), tuple(chosen), file, base, assigned, tuple(times)))
    return Sweep(axes, _make_names_unique(runs), read.title, paired)


def resolve_paths(
    values: Mapping[str, Any],
    parts: Mapping[str, Parameterised | type[Parameterised]],
    folder: Path,
) -> dict[str, Any]:
    """Return a scene's values with absolute paths."""
    found: dict[str, Any] = {}
    for section, given in values.items():
        found[section] = given
        if isinstance(given, Mapping) and section in parts:
            part = parts[section]
            found[section] = {
                k: part.parameter(k).resolve_path(v, folder) for k, v in given.items()
            }
    return found


def _file_name(keys: Sequence[str], labels: Sequence[str]) -> str:
    """Return a file name that contains the values, in characters that all disks accept."""
    pairs = [
        f"{key}={label}".replace("/", "-").replace("µ", "u").replace(" ", "")
        for key, label in zip(keys, labels, strict=True)
    ]
    return re.sub(r"[^A-Za-z0-9_.+=-]+", "", "_".join(pairs)) or "run"


def _make_names_unique(runs: list[Run]) -> list[Run]:
    """Return the runs with unique names; refuse the same run twice."""
    names = [run.name.casefold() for run in runs]
    found, seen = [], {}
    for run, name in zip(runs, names, strict=True):
        if len(name) > _MAX_NAME or names.count(name) > 1:
            digest = run.digest
            if digest in seen:
                raise InputError(
                    f"the same run twice: {', '.join(run.labels)}", cure="Give each value once."
                )
            seen[digest] = run
            run = replace(run, name=f"{run.name[:_MAX_NAME]}-{digest[:8]}")
        found.append(run)
    return found


def paths_in(value: Any) -> Iterator[Path]:
    """Yield all paths in values."""
    if isinstance(value, Path):
        yield value
    elif isinstance(value, Parameterised):
        yield from paths_in(value.settings)
    elif isinstance(value, (Mapping, list, tuple)):
        for item in value.values() if isinstance(value, Mapping) else value:
            yield from paths_in(item)
