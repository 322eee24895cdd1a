"""The properties of the chosen stage."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QFrame, QLabel, QScrollArea, QVBoxLayout, QWidget

from spacemap_vtk.app.document import Document
from spacemap_vtk.app.feasible import intervals, settled
from spacemap_vtk.app.fields.row import ParameterRow
from spacemap_vtk.errors import InputError, SpacemapError
from spacemap_vtk.scenes.scene import SECTIONS


class Properties(QScrollArea):
    """A row for each declared parameter of one section.

    Parameters
    ----------
    document : Document
        What the rows show and edit.
    """

    #: A value was refused: the error.
    refused = Signal(object)
    #: A value was accepted: the burst that it belongs to.
    accepted = Signal(int)
    #: Whether a drag goes on.
    held = Signal(bool)

    def __init__(self, document: Document) -> None:
        super().__init__()
        self._document = document
        self.section = ""
        self.rows: dict[str, ParameterRow] = {}
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        document.changed.connect(self.refresh)
        document.replaced.connect(self.refresh)

    def choose(self, section: str) -> None:
        """Show another section.

        Parameters
        ----------
        section : str
            A key of ``SECTIONS``.
        """
        self.section = section
        self.rows = {}
        page = QWidget()
        layout = QVBoxLayout(page)
        layout.setContentsMargins(10, 6, 10, 10)
        cls = SECTIONS[section]
        about = QLabel((cls.__doc__ or "").strip().splitlines()[0])
        about.setWordWrap(True)
        about.setObjectName("about")
        layout.addWidget(about)
        for name, parameter in cls.parameters.items():
            row = ParameterRow(parameter)
            row.edited.connect(self._edited)
            row.held.connect(self.held)
            layout.addWidget(row)
            self.rows[name] = row
        layout.addStretch(1)
        self.setWidget(page)
        self.refresh()

    def refresh(self) -> None:
        """Show what the document says."""
        if not self.section:
            return
        part = getattr(self._document.scene, self.section)
        feasible, known = intervals(part), settled(part)
        for name, row in self.rows.items():
            value = getattr(part, name)
            row.show_value(value, self._document.written(self.section, name) is None)
            row.settled = known.get(name)
            row.show_feasible(feasible.get(name))

    def mark(self, error: SpacemapError) -> None:
        """Mark the field that an error names, if it is here.

        Parameters
        ----------
        error : SpacemapError
            With `section` and `key`.
        """
        row = self.rows.get(error.key or "")
        if row is not None and error.section in (None, self.section):
            row.mark(error.message + (f": {error.cure}" if error.cure else ""))
            self.ensureWidgetVisible(row)

    def _edited(self, name: str, written: object, burst: int) -> None:
        try:
            self._document.set(self.section, name, written, burst)
        except InputError as error:
            error.section = error.section or self.section
            self.mark(error)
            self.refused.emit(error)
        else:
            self.accepted.emit(burst)
            # Refused before, and the value it had is typed again: nothing has changed.
            self.rows[name].mark(None)
