"""Find the files that a mesh or motion file names, because they are read together with it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from xml.parsers import expat

from spacemap_vtk.errors import InputError, SpacemapError
from spacemap_vtk.io import registry

#: Depth to which references are followed: a file names a file, which names another, and so on.
_DEEPEST = 8
#: Attributes that hold file names in VTK's XML files and in XDMF, in lower case.
_ATTRIBUTES = ("file", "source", "filename", "href")


def pattern_names(pattern: bytes) -> Callable[[Path], list[str]]:
    """Return a function that finds file names in a file by a pattern with one group."""

    def find(path: Path) -> list[str]:
        raw = re.findall(pattern, path.read_bytes())
        return [word.decode("utf-8", "replace").strip(" \t\r\"'") for word in raw]

    return find


def names_in_xml(path: Path) -> list[str]:
    """Return the file names in XML attributes, and in text such as "mesh.h5:/points"."""
    found: list[str] = []

    def read_attributes(_tag: str, given: dict[str, str]) -> None:
        attributes = {key.lower(): value for key, value in given.items()}
        found.extend(attributes[key] for key in _ATTRIBUTES if key in attributes)

    def read_text(text: str) -> None:
        found.extend(word.rpartition(":")[0] for word in re.findall(r"\S+:/\S*", text))

    def refuse_entity(name: str, *_: object) -> None:
        raise InputError(
            f"{path}: the file declares the XML entity {name}; meshes have no entities", key="file"
        )

    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.EntityDeclHandler = refuse_entity
    parser.StartElementHandler, parser.CharacterDataHandler = read_attributes, read_text
    # Faults in the XML are left to the format's reader, which stops at the same place.
    with path.open("rb") as file, suppress(expat.ExpatError):
        parser.ParseFile(file)
    return found


def names_in_hdf(path: Path) -> list[str]:
    """Return the files that an HDF5 file links to or stores its data in; none without h5py."""
    with path.open("rb") as file:
        if file.read(8) != b"\x89HDF\r\n\x1a\n":
            return []
    try:
        import h5py
    except ImportError:
        return []
    found: list[str] = []

    def read_link(place: str, link: object) -> None:
        if isinstance(link, h5py.ExternalLink):
            found.append(link.filename)
        elif isinstance(link, h5py.HardLink) and isinstance(table := made[place], h5py.Dataset):
            found.extend(str(each[0]) for each in table.external or ())
            if table.is_virtual:
                found.extend(each.file_name for each in table.virtual_sources())

    faults = OSError, RuntimeError, ValueError, KeyError, SystemError
    with suppress(*faults), h5py.File(path) as made:
        made.visititems_links(read_link)
    return found


def file_references(path: Path) -> Iterator[tuple[Path, Path]]:
    """Yield pairs (file, file that it names), recursively, beginning with a mesh or motion."""
    # A file that cannot be read counts as naming none; its reader reports the reason.
    seen, level = {path}, [path]
    for _ in range(_DEEPEST):
        files, level = level, []
        for file in files:
            for other in _referenced_files(file):
                if other not in seen:
                    seen.add(other)
                    level.append(other)
                    yield file, other


def _referenced_files(path: Path) -> tuple[Path, ...]:
    with suppress(OSError, SpacemapError):
        state = path.stat()
        return _read_references(path, state.st_mtime_ns, state.st_size)
    return ()


@lru_cache(10_000)
def _read_references(path: Path, _changed: int, _size: int) -> tuple[Path, ...]:
    found = {kind: registry.reader(path, kind) for kind in ("motion", "mesh")}
    names = (word for each in found.values() if each for word in each.referenced_names(path))
    return tuple(dict.fromkeys(path.parent / word for word in names))
