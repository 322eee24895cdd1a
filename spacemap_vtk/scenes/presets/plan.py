"""The presets by name, and what one makes of a scene."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from spacemap_vtk.errors import InfoMessage


class Preset(NamedTuple):
    """A motion that a textile can be given."""

    label: str
    """Its name in menus."""
    help: str
    """One sentence on what it shows."""


#: The presets by name.
PRESETS = {
    "hang": Preset("Hang as curtain", "Hang the cloth as a curtain, drawn together on a rail."),
    "drape": Preset(
        "Drape over table", "Lay the cloth on a round table, over which it hangs in folds."
    ),
    "drop": Preset("Drop onto ball", "Let the cloth fall onto a ball; a film shows how it lands."),
    "swing": Preset("Swing from edge", "Let level cloth fall that is held by one edge."),
}


class Note(InfoMessage):
    """Sentence on what a preset assumed, with the option that replaces the assumption."""

    #: The same sentence for the window and the browser, which have fields instead of options.
    for_window: str

    def __new__(cls, text: str, cure: str = "", window_cure: str = "") -> Note:
        """Join a sentence and its cures."""
        note = super().__new__(cls, f"{text}; {cure}" if cure else text)
        note.for_window = f"{text}; {window_cure}" if window_cure else text
        return note


@dataclass
class Plan:
    """What a preset makes of a scene."""

    values: dict[str, Any]
    """The scene's values, as in a scene file in the scene's folder."""
    notes: list[Note] = field(default_factory=list)
    """What was assumed."""

    def note(self, text: str, cure: str = "", window_cure: str = "") -> None:
        """Add a note.

        Parameters
        ----------
        text : str
            What was assumed.
        cure : str
            What to type on the command line if the assumption is wrong.
        window_cure : str
            Which field to change instead in the window and the browser.
        """
        self.notes.append(Note(text, cure, window_cure))


def title_end(preset: str) -> str:
    """Return what a preset adds to the title of a textile.

    Parameters
    ----------
    preset : str
        One of `PRESETS`.

    Returns
    -------
    str
        The motion, after a colon.
    """
    return f": {PRESETS[preset].label.lower()}"


def preset_of(title: str) -> str:
    """Find the preset that has made a scene.

    Parameters
    ----------
    title : str
        Title of the scene.

    Returns
    -------
    str
        One of `PRESETS`; empty without a preset.
    """
    return next((name for name in PRESETS if title.endswith(title_end(name))), "")


def split_title(title: str) -> tuple[str, str]:
    """Split the motion that a preset has added off a title.

    Parameters
    ----------
    title : str
        Title of a scene.

    Returns
    -------
    tuple of str
        The title of the textile, and what the preset has added; empty without a preset.
    """
    preset = preset_of(title)
    motion = title_end(preset) if preset else ""
    return title.removesuffix(motion), motion
