"""Small pictures of the scenes that come with the program, for the galleries.

The pictures are stored with the scenes, so that a gallery appears at once. After a scene has
changed, ``python -m spacemap_vtk.draw.thumbnails`` draws the outdated pictures again.
"""

from __future__ import annotations

import hashlib
import json
import tomllib
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from spacemap_vtk.io.output import atomic_file
from spacemap_vtk.io.registry import writer
from spacemap_vtk.scenes import library

#: Width and height in pixels: twice the displayed size, for high-resolution screens.
SIZE = (480, 320)
_QUALITY = 84


class Entry(NamedTuple):
    """A scene in a gallery."""

    name: str
    """Name by which it is opened."""
    title: str
    """The scene's title."""
    group: str
    """Heading of its group."""

    @property
    def words(self) -> str:
        """The words, in lower case, in which a search looks for each of its own."""
        return f"{self.title} {self.name} {self.group}".lower()


def entries() -> list[Entry]:
    """Return the scenes that come with the program, group by group."""
    return [
        Entry(name, title_of(name), group)
        for group, names in library.names_by_kind().items()
        for name in names
    ]


def file_of(name: str) -> Path:
    """Return the path of a scene's picture."""
    return library.folder() / "thumbnails" / f"{name}.jpg"


def title_of(name: str) -> str:
    """Return a scene's title."""
    text = (library.folder() / f"{name}.toml").read_text(encoding="utf-8")
    return str(_parse_toml(text).get("title", name))


@lru_cache(64)
def _parse_toml(text: str) -> dict[str, Any]:
    return tomllib.loads(text)


def digest_of(name: str) -> str:
    """Compute a digest of a scene's values and of the files that it names, without comments."""
    path = library.folder() / f"{name}.toml"
    tables = _parse_toml(path.read_text(encoding="utf-8"))
    digest = hashlib.sha256(json.dumps(tables, sort_keys=True).encode())
    records = [table for table in tables.values() if isinstance(table, dict)]
    for table in [*records, *tables.get("modal", {}).get("obstacles", [])]:
        for key in ("draft", "file", "start"):
            if key in table:
                digest.update((path.parent / table[key]).read_bytes())
    return digest.hexdigest()[:32]


def stored_digest(name: str) -> str:
    """Return the digest stored in a scene's picture; empty if there is no picture."""
    from PIL import Image

    file = file_of(name)
    if not file.is_file():
        return ""
    with Image.open(file) as picture:
        return bytes(picture.info.get("comment", b"")).decode()


def draw(name: str) -> None:
    """Draw and save the picture of a scene."""
    from spacemap_vtk.draw.picture import Picture
    from spacemap_vtk.scenes.scene import Scene

    scene = Scene.read(name)
    picture = Picture(scene, [scene.view.time], SIZE, ["fabric"])
    pixels = picture.draw(scene.view.time)
    picture.close()
    file_of(name).parent.mkdir(exist_ok=True)
    with atomic_file(file_of(name)) as file:
        write = writer(file, "picture").write
        write(file, pixels, quality=_QUALITY, comment=digest_of(name).encode())


def main() -> None:
    """Draw outdated pictures, and remove pictures of scenes that no longer exist."""
    names = library.names()
    for name in names:
        if stored_digest(name) != digest_of(name):
            draw(name)
            print(f"{name}: drawn")
    for file in file_of("").parent.glob("*.jpg"):
        if file.stem not in names:
            file.unlink()
            print(f"{file.stem}: removed")


if __name__ == "__main__":
    main()
