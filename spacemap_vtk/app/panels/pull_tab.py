"""The biaxial pad: a tab to stretch the cloth along warp and weft."""

from __future__ import annotations

import html
from typing import Any

import numpy as np
from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QPushButton, QWidget

from spacemap_vtk.app.documents.document import Document
from spacemap_vtk.app.panels.add_stage import AddStageButton
from spacemap_vtk.app.panels.pull_map import PullMap
from spacemap_vtk.app.widgets import column, note, single_shot
from spacemap_vtk.app.work.frame_request import Pull
from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.filters.yarn_parameters import YarnParameters
from spacemap_vtk.textile.crimp.biaxial import compute_stretch_map
from spacemap_vtk.textile.crimp.interchange import Interchange
from spacemap_vtk.textile.weave.cloth import FAMILIES

#: Time without changes until the map is computed, in ms.
_REST_TIME = 150
#: Lines of the description. The number is fixed, because a change would resize and repaint the
#: map.
_LINES = 5
_HINT = "Drag the point to stretch the cloth. Yarns are jammed in the hatched region. "
_LINE_HINTS = (
    "Lines of equal force: <b>—</b> warp, <b>--</b> weft.",
    "Along the thick line, warp and weft exchange crimp; beyond it, yarns are pressed together, "
    "then stretched. Lines of equal strain: <b>—</b> warp, <b>--</b> weft; of equal force if the "
    "yarns are extensible and have a tension.",
)
_NO_MAP_HINTS = (
    "With crimp interchange, warp and weft exchange crimp, and yarns keep their length. A map then "
    "shows how far the cloth stretches.",
    "Only woven scenes can be stretched here.",
)


class PullTab(QWidget):
    """Stretch the cloth along warp and weft, and describe its state."""

    #: A `Pull` to show, or None for the motion.
    pulled = Signal(object)
    #: Whether a drag is in progress.
    dragging = Signal(bool)

    def __init__(self, document: Document) -> None:
        super().__init__()
        self._document = document
        self.map = PullMap()
        rich = Qt.TextFormat.RichText  # safe: these texts contain nothing from files
        self.hint = note(_NO_MAP_HINTS[0], textFormat=rich)
        self.add_button = AddStageButton("yarns")
        top = Qt.AlignmentFlag.AlignTop | Qt.AlignmentFlag.AlignLeft
        self.state_text = note(name="state", textFormat=rich, alignment=top)
        self.state_text.setFixedHeight(_LINES * self.state_text.fontMetrics().lineSpacing() + 2)
        self.back_button = QPushButton("Return to motion", enabled=False)
        self.back_button.clicked.connect(self.stop)
        parts = self.hint, self.add_button, (self.map, 1), self.state_text, self.back_button
        column(self, *parts, margins=(6, 6, 6, 6))
        self._crossings: Interchange | None = None
        self._cloth_key: Any = None
        self.rest_timer = single_shot(self, self._update_map, _REST_TIME)
        self.map.dragged.connect(self._show_stretch)
        self.map.dragging.connect(self.dragging)
        self.map.reset_requested.connect(self.stop)
        for signal in (document.changed, document.replaced):
            signal.connect(self.rest_timer.start)

    def stop(self) -> None:
        """Show the motion again."""
        if self.release():
            self.pulled.emit(None)

    def release(self) -> bool:
        """Return the point to rest; return whether the cloth was stretched."""
        was_stretched = self.back_button.isEnabled()
        self.back_button.setEnabled(False)
        self.map.move_to(1.0, 1.0)
        self.state_text.clear()
        return was_stretched

    def showEvent(self, event: QShowEvent) -> None:
        """Compute the map if the cloth has changed while the tab was hidden."""
        super().showEvent(event)
        self._update_map()

    def _update_map(self) -> None:
        """Compute the map of the present cloth if the tab is visible."""
        scene = self._document.scene
        stage = scene.stage("crimp")
        key = (
            scene.woven is not None,
            scene.source.settings,
            None if stage is None else stage.settings,
        )
        if not self.isVisible() or key == self._cloth_key:
            return
        self._cloth_key, self._crossings, result = key, None, None
        hint = _NO_MAP_HINTS[scene.woven is None]
        if scene.woven is not None and isinstance(stage, YarnParameters):
            try:
                cloth = scene.woven.cloth
                self._crossings = Interchange(cloth, stage.yarns(cloth))
                result = compute_stretch_map(self._crossings)
                hint = _HINT + _LINE_HINTS[stage.inextensible]
            except SpacemapError as error:
                hint = f"The map cannot be computed: {html.escape(str(error))}"
        self.hint.setText(hint)
        self.add_button.setVisible(scene.woven is not None and stage is None)
        self.back_button.setVisible(result is not None)
        self.map.show_map(result)
        if result is None:
            self.stop()
        elif self.back_button.isEnabled():
            self.state_text.setText(self._describe_state(*self.map.stretch))

    def _show_stretch(self, warp: float, weft: float) -> None:
        self.state_text.setText(self._describe_state(warp, weft))
        self.back_button.setEnabled(True)
        self.pulled.emit(Pull(warp, weft))

    def _describe_state(self, warp: float, weft: float) -> str:
        """Describe the state of the cloth at a stretch; crimp heights are means over crossings."""
        crossings = self._crossings
        assert crossings is not None
        stretch = np.array([[warp], [weft]])
        state = crossings.solve(np.broadcast_to(stretch[..., None], (2, *crossings.shape)))
        forces = crossings.resultants(stretch)
        sentences = [f"Warp {100 * (warp - 1):+.2f} %, weft {100 * (weft - 1):+.2f} %"]
        if forces.force.any():
            sentences[0] += ": {:.4g} and {:.4g} N/m".format(*forces.force[:, 0])
        crimp, height = (values.mean(axis=(1, 2)) for values in (state.crimp, state.height))
        sentences.append("Crimp {:.2f} and {:.2f} %".format(*100.0 * crimp))
        # Peirce's crimp height: of the yarn's axis, from crest to trough.
        sentences[-1] += ", heights {:.3g} and {:.3g} mm".format(*2e3 * height)
        sentences.append("Yarn strain {:.2f} and {:.2f} %".format(*100.0 * forces.strain[:, 0]))
        if (pressing := 1.0 - forces.distance[0]) > 1e-6:
            sentences.append(
                f"Crossings are pressed to {100 * (1 - pressing):.3g} % of their height"
            )
        jams = state.stretch.max(axis=(1, 2)) > stretch[:, 0] + 1e-9
        for state_text, families in (
            ("jams", jams),
            ("is slack", state.slack.any(axis=(1, 2)) & ~jams),
        ):
            names = [name for name, is_so in zip(FAMILIES, families, strict=True) if is_so]
            sentences += [f"The {name} {state_text}" for name in names]
        return ". ".join(sentences) + "."
