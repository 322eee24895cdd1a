"""The command ``again``, which repeats the command that made a file."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from spacemap_vtk import __version__
from spacemap_vtk.cli.options import Quiet, Set, flag, output_option, print_warnings, progress
from spacemap_vtk.errors import InputError, SpacemapError, escape_unprintable
from spacemap_vtk.io import provenance, registry
from spacemap_vtk.io.provenance import Record
from spacemap_vtk.jobs import JOBS, DataJob, job_from_json
from spacemap_vtk.temporary_files import temporary_folder

#: Fields of picture and film jobs that only the window sets; there are no options for them.
_WINDOW_FIELDS = {"place": "the camera", "panels": "the panels", "framed": "the view of the film"}


def remake(
    file: Annotated[
        Path,
        Parameter(
            help="Picture, film or data file made by this program; not .stl, .dtx and .txt, which "
            "cannot store how they were made."
        ),
    ],
    /,
    *,
    output: Annotated[
        Path | None,
        output_option(
            "Output file. Default: next to the file, for example cloth-again.png for cloth.png."
        ),
    ] = None,
    set_: Set = (),
    check: Annotated[
        bool,
        flag(
            "Write nothing, but compare the new result with the file; exit status 1 if they differ."
        ),
    ] = False,
    folder: Annotated[
        Path | None,
        Parameter(
            help="Folder of the scene file, from which its input files are found. Default: this "
            "folder, or that of the file."
        ),
    ] = None,
    force: Annotated[bool, flag("Without --output: overwrite an existing file.")] = False,
    quiet: Quiet = False,
) -> None:
    """Repeat the command that made a file.

    Pictures, films and data files store the scene, as it was run, and the command;
    "spacemap info FILE" prints them. Of the scene's input files (a draft, a mesh) they store only
    the digests: a missing or changed input file is an error. No other file is read. With --set,
    the command is repeated for a changed scene.

    For example:

        spacemap again cloth.png --check
        spacemap again cloth.glb -o more.glb --set weave.ends=20
    """
    from spacemap_vtk.scenes.scene_record import input_folders, restore_scene

    record = provenance.read_record(registry.require_file(file))
    if record is None:
        raise InputError(
            f"{file} does not state how it was made",
            allowed=f"a file made by this program: {', '.join(provenance.record_endings())}",
        )
    target = output or file.with_name(f"{file.stem}-again{file.suffix}")
    if output is None and not check and not force and (existing := _existing_output(target)):
        raise InputError(f"{existing} exists", cure="Choose another --output, or use --force.")
    scene, inputs = restore_scene(record, input_folders(file, folder))
    if not quiet:
        for line in (*describe_record(record, file), *(f"reads {path}" for path in inputs)):
            print(escape_unprintable(line, "\n"))
        print("writes nothing" if check else f"writes {target}", flush=True)
    if target.resolve() in [path.resolve() for path in inputs]:
        raise InputError(
            f"{target} is an input of the scene", key="--output", cure="Choose another name."
        )
    for assignment in set_:
        scene.set(assignment)
    with temporary_folder() as scratch:
        made = scratch / file.name if check else target
        with progress(scene, "Repeating", quiet) as report_progress:
            job_from_json(record.order, made).run(scene, report_progress)
        print_warnings(scene, quiet)
        if check and (found := list(compare_files(file, made))):
            raise SpacemapError(f"{file}: the new result differs: {'; '.join(found)}")
    if check and not quiet:
        print(f"{file}: the new result is the same")


def describe_record(record: Record, file: Path) -> list[str]:
    """Return the lines that describe a record to the user."""
    here = "" if record.version == __version__ else f" (this is version {__version__})"
    what = str(record.order.get("what"))
    words = f"spacemap {JOBS.get(what, DataJob).command} {shlex.quote(record.file or 'SCENE')}"
    words += f" {'--plot' if what == 'shapes' else '-o'} {shlex.quote(file.name)}"
    once = {"time": record.times[0]} if len(record.times) == 1 else {}
    asked = {**once, **record.order, **record.order.get("page", {})}
    words += "".join(f" --set {shlex.quote(str(each))}" for each in asked.pop("lists", ()))
    asked.pop("page", None)
    pictured = what in ("picture", "film")
    window_only = [
        name for key, name in _WINDOW_FIELDS.items() if pictured and asked.pop(key, None)
    ]
    words += " --raytrace" if "samples" in asked else ""
    if "width" in asked:
        asked["width"] = f"{asked['width']:g}mm"
    for key, value in asked.items():
        if isinstance(value, list):
            value = ("x" if key == "size" else ",").join(map(str, value))
        if key == "times" and once:
            continue
        if value is True:
            words += f" --{'zip' if key == 'paired' else key}"
        elif key != "what" or words.startswith("spacemap export"):
            words += f" --{key} {shlex.quote(str(value))}"
    lines = [f"{file}: made by spacemap_vtk {record.version}{here}", f"command: {words}"]
    if record.times:
        lines.append(f"time: {' to '.join(f'{time:g}' for time in record.times)} s")
    if window_only:
        lines.append(f"stored too, without an option: {', '.join(window_only)}")
    return [
        *lines,
        *(f"input: {name}, sha256 {digest[:16]}…" for name, digest in record.inputs.items()),
    ]


def _existing_output(target: Path) -> Path | None:
    """Return the first path that would be overwritten: the file, or one that belongs to it."""
    metadata = target.with_name(f"{target.name}-metadata.json")
    outputs = target, target.with_suffix(".mtl"), target.with_suffix(""), metadata
    return next((path for path in outputs if path.exists()), None)


def compare_files(first: Path, second: Path) -> Iterator[str]:
    """Yield how the contents of two files differ, in words; their records are ignored."""
    if first.read_bytes() == second.read_bytes() and not first.with_suffix("").is_dir():
        return  # no other file belongs to them that could differ
    ending = first.suffix.lower()
    if ending in registry.writer_endings("picture"):
        yield from _compare_pixels(first, second)
        return
    # An analysis is more than its mesh, and a moving surface more than its motion: compare lines.
    kinds = {kind for each in registry.writers() if ending in each.endings for kind in each.holds}
    read = [kind for kind in ("motion", "mesh") if ending in registry.reader_endings(kind)]
    found = []
    if read and "analysis" not in kinds:
        found = list((_compare_steps if read[0] == "motion" else _compare_arrays)(first, second))
    yield from found
    if not found and (not read or kinds & {"analysis", "moving"}):
        lines = [_content_lines(path) for path in (first, second)]
        count = sum(a != b for a, b in zip(*lines, strict=False))
        count += abs(len(lines[0]) - len(lines[1]))
        if count:
            yield f"{count} of {len(lines[0])} lines differ"


def _content_lines(path: Path) -> list[bytes]:
    name = provenance.NAME.encode()
    content = path.read_bytes()
    if content.startswith(b"glTF"):  # its JSON is a single line, which includes the record
        end = 20 + int.from_bytes(content[12:16], "little")
        shown = {**json.loads(content[20:end]), "asset": None}
        content = json.dumps(shown, indent=0).encode() + content[end:]
    return [line for line in content.splitlines() if name not in line]


def _compare_pixels(first: Path, second: Path) -> Iterator[str]:
    import numpy as np
    from PIL import Image

    pixels = []
    for path in (first, second):
        with Image.open(path) as image:
            pixels.append(np.asarray(image.convert("RGBA"), np.int16))
    if pixels[0].shape != pixels[1].shape:
        sizes = *pixels[1].shape[:2], *pixels[0].shape[:2]
        yield "{1} x {0} pixels instead of {3} x {2}".format(*sizes)
        return
    off = np.abs(pixels[0] - pixels[1]).max(axis=2)
    if off.any():
        share = np.count_nonzero(off) / off.size
        yield f"{share:.2%} of the pixels differ, by up to {off.max()} of 255"


def _compare_steps(first: Path, second: Path) -> Iterator[str]:
    from spacemap_vtk.io.series import open_series

    series = open_series(first), open_series(second)
    if series[0].times != series[1].times:
        yield "the times differ"
        return
    for number, time in enumerate(series[0].times):
        for text in _compare_meshes(*(each.read(number) for each in series)):
            yield f"at {time:g} s: {text}"


def _compare_arrays(first: Path, second: Path) -> Iterator[str]:
    from spacemap_vtk.io.reading import merge_blocks, read_blocks

    yield from _compare_meshes(*(merge_blocks(read_blocks(path), path) for path in (first, second)))


def _compare_meshes(before: Any, after: Any) -> Iterator[str]:
    import numpy as np
    from vtkmodules.util.numpy_support import vtk_to_numpy

    from spacemap_vtk.datasets.arrays import points_of

    if before.GetNumberOfCells() != after.GetNumberOfCells():
        yield f"{after.GetNumberOfCells()} cells instead of {before.GetNumberOfCells()}"
    tables = {"points": (points_of(before), points_of(after))}
    for kind in ("GetPointData", "GetCellData"):
        here, there = getattr(before, kind)(), getattr(after, kind)()
        for k in range(here.GetNumberOfArrays()):
            name = here.GetArrayName(k)
            pair = here.GetArray(k), there.GetArray(name)
            if any(array is None for array in pair):
                yield f"{name} is missing"
            else:
                tables[name] = tuple(map(vtk_to_numpy, pair))
    for name, (first, second) in tables.items():
        if first.shape != second.shape:
            yield f"{name}: {len(second)} rows instead of {len(first)}"
        elif not np.array_equal(first, second, equal_nan=first.dtype.kind == "f"):
            off = np.nanmax(np.abs(first.astype(float) - second.astype(float)))
            yield f"{name} differ by up to {off:.3g}"
