"""Button that switches on the stage that an empty tab needs."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QPushButton

from spacemap_vtk.scenes.pipeline import section_classes, stage_title


class AddStageButton(QPushButton):
    """Offer the stage of a section; hidden until the tab shows it."""

    #: The section whose stage shall be switched on.
    requested = Signal(str)

    def __init__(self, section: str) -> None:
        cls = section_classes()[section]
        super().__init__(f"Add {stage_title(cls.__name__).lower()}")
        self.setToolTip((cls.__doc__ or "").strip().splitlines()[0])
        self.clicked.connect(lambda: self.requested.emit(section))
        self.hide()
