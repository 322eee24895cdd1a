"""Words for a shell's completion that only the running program knows.

cyclopts generates the shell's script from the declarations of the commands. For an argument with
one of these functions the script runs ``spacemap __complete``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from glob import escape, glob
from os.path import isdir
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cyclopts.completion import CompletionContext


def scene_names(context: CompletionContext) -> Iterable[str]:
    """List the scenes that come with the program."""
    from spacemap_vtk.scenes import library

    return library.names()


def scenes_and_files(context: CompletionContext) -> Iterator[str]:
    """List the scenes that come with the program, and files whose names begin as typed."""
    yield from scene_names(context)
    for path in sorted(glob(f"{escape(context.incomplete)}*")):
        yield f"{path}/" if isdir(path) else path


def yarn_names(context: CompletionContext) -> Iterable[str]:
    """List the yarns of the library."""
    from spacemap_vtk.textile.weave.yarn_library import YARNS

    return list(YARNS)


def sections(context: CompletionContext) -> Iterable[str]:
    """List the sections of a scene file."""
    from spacemap_vtk.scenes.pipeline import section_classes

    return list(section_classes())


def assignments(context: CompletionContext) -> Iterator[str]:
    """List the keys of a scene file as ``section.key=``, or once with each choice."""
    from spacemap_vtk.scenes.pipeline import section_classes

    for section, kind in section_classes().items():
        for name, parameter in kind.parameters.items():
            for choice in getattr(parameter, "choices", None) or [""]:
                yield f"{section}.{name}={choice}"


def data_kinds(context: CompletionContext) -> Iterable[str]:
    """List the kinds of data that ``export --what`` writes."""
    from spacemap_vtk.io import registry

    return list(registry.DATA)


def color_names(context: CompletionContext) -> Iterable[str]:
    """List the quantities that can colour a picture."""
    from spacemap_vtk.scenes.colorings import COLORINGS

    return list(COLORINGS)


def style_names(context: CompletionContext) -> Iterable[tuple[str, str]]:
    """List the styles of pictures."""
    from spacemap_vtk.scenes.styles import STYLES

    return [(name, style.label) for name, style in STYLES.items()]


def light_names(context: CompletionContext) -> Iterable[tuple[str, str]]:
    """List the lights of pictures."""
    from spacemap_vtk.scenes.styles import LIGHTS

    return [(name, light.label) for name, light in LIGHTS.items()]


def camera_names(context: CompletionContext) -> Iterable[str]:
    """List the cameras that come with the program."""
    from spacemap_vtk.scenes.cameras import CAMERAS

    return list(CAMERAS)
