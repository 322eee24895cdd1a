"""The scenes that come with the program."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.io import registry


def folder() -> Path:
    """Return the folder of the scenes."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "library"
    return installed if installed.is_dir() else package.parent / "scenes"


def names() -> list[str]:
    """Return the names of the included scenes."""
    return sorted(path.stem for path in folder().glob("*.toml"))


def names_by_kind() -> dict[str, list[str]]:
    """Return the names of the included scenes, grouped by what they show."""
    found: dict[str, list[str]] = {
        kind: []
        for kind in (
            "Weaves",
            "Moving cloth",
            "Hanging cloth",
            "Cloth on obstacles",
            "Knits",
            "Other textiles",
            "Other objects",
        )
    }
    for name in names():
        scene = tomllib.loads(find(name).read_text(encoding="utf-8"))
        moves = scene.keys() & {"modal", "response", "transient", "motion"}
        kind = "Moving cloth" if moves else "Weaves"
        if "gravity" in scene.get("modal", {}):
            kind = "Hanging cloth"
        if "obstacles" in scene.get("modal", {}):
            kind = "Cloth on obstacles"
        if "textile" in scene:
            knit = "knit" in scene["textile"].get("kind", "knit")
            kind = "Knits" if knit else "Other textiles"
        elif "weave" not in scene:
            kind = "Other objects"
        found[kind].append(name)
    return found


def find(scene: str | Path) -> Path:
    """Return the file for a path, or for the name of an included scene or draft."""
    path = Path(scene)
    if not (why := registry.unreadable_reason(path)):
        return path
    if str(scene) == path.name and os.path.isfile(named := folder() / f"{scene}.toml"):
        return named
    if path.parent == Path("drafts") and (folder() / path).is_file():
        return folder() / path
    if why not in (registry.NO_SUCH_FILE, registry.IS_FOLDER):  # suggesting names would not help
        raise InputError(f"{path}: {why}", cure="Check its permissions, or choose another file.")
    # Imported here, because only the message needs it, and it imports numpy.
    from spacemap_vtk.parameters import suggestion

    beside = [file.name for file in path.parent.glob("*") if registry.kind_of(file) is not None]
    cures = [suggestion(str(scene), names()) or suggestion(path.name, beside)]
    if why == registry.IS_FOLDER:
        cures = ["Choose a file in it."]
    elif not path.suffix:
        why += ", and no scene has this name"
        cures.append('List the scenes with "spacemap scenes".')
    elif registry.kind_of(path) is None:
        cures.append(f"It can be {registry.describe_scene_files()}.")
    raise InputError(f"{path}: {why}", cure=" ".join(filter(None, cures)) or None)


def values_of(path: Path, name: str = "") -> dict[str, Any]:
    """Return the values of a scene, draft, knit, yarns or mesh as a scene that calls it `name`."""
    kind = registry.kind_of(path)
    if kind == "draft":
        # A weaver expects the face, flat.
        return {
            "weave": {"draft": name or str(path)},
            "view": {"camera": "face"},
        }
    if kind == "knit":
        read = registry.read(path, "knit")
        return {"textile": read.values, "view": {"camera": "front"}}
    if kind == "yarns":
        return {"textile": {"kind": "file", "file": name or str(path)}, "view": {"camera": "front"}}
    if kind == "mesh":
        return {"object": {"file": name or str(path)}}
    return registry.read(path, "scene")


def notes_of(path: Path) -> list[str]:
    """Return sentences on what `values_of` leaves out of a file."""
    return registry.read(path, "knit").notes if registry.kind_of(path) == "knit" else []
