"""The main window: its layout, and the connections between its parts."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from PySide6.QtCore import QPoint, QSettings, QSize, Qt
from PySide6.QtGui import QAction, QCloseEvent, QDragEnterEvent, QDropEvent, QResizeEvent
from PySide6.QtWidgets import (
    QFileDialog,
    QLabel,
    QMainWindow,
    QProgressBar,
    QPushButton,
    QSplitter,
    QTabWidget,
    QWhatsThis,
    QWidget,
)

from spacemap_vtk.app.documents.document import Document
from spacemap_vtk.app.documents.files import Files
from spacemap_vtk.app.draft.draft_tab import DraftTab
from spacemap_vtk.app.menus import Menus
from spacemap_vtk.app.panels.error_bar import ErrorBar
from spacemap_vtk.app.panels.figures_tab import FiguresTab
from spacemap_vtk.app.panels.gallery import Gallery
from spacemap_vtk.app.panels.modes_tab import ModesTab
from spacemap_vtk.app.panels.properties import Properties
from spacemap_vtk.app.panels.pull_tab import PullTab
from spacemap_vtk.app.panels.stage_list import StageList
from spacemap_vtk.app.panels.time_bar import TimeBar
from spacemap_vtk.app.plots.plots_tab import PlotsTab
from spacemap_vtk.app.view.pick import Pick
from spacemap_vtk.app.view.view3d import View3D
from spacemap_vtk.app.view.view_bar import ViewBar
from spacemap_vtk.app.widgets import OneLine, action, column, tool_button
from spacemap_vtk.app.work.director import Director
from spacemap_vtk.app.work.engine import Engine
from spacemap_vtk.app.work.exports import Exports
from spacemap_vtk.app.work.job import Pull
from spacemap_vtk.datasets.modal_model import measures_in
from spacemap_vtk.draw import thumbnails
from spacemap_vtk.draw.frame import Frame
from spacemap_vtk.draw.scene_view import ViewOptions
from spacemap_vtk.errors import InputError, SpacemapError
from spacemap_vtk.filters.load_parameters import DOWN
from spacemap_vtk.scenes.chain import sections, words_of
from spacemap_vtk.scenes.origin import elsewhere
from spacemap_vtk.scenes.report import motion_in_short, motion_told
from spacemap_vtk.scenes.settings import View

#: Highest shown progress of a running stage, in percent: after its last step it may still need
#: time to join the results.
_NOT_YET = 99
#: How long a status message stays, in ms.
_TOLD = 10_000
#: Smallest width of the window in pixels, less than all its panels need together.
_LEAST = 690
#: Factor by which one key press makes lines and dots thicker.
_THICKER = 1.25


#: Text of the link that switches the stage on; it uses the name from the list of stages.
_SWITCH_ON_ROTATION = "switch on Rotation strain"
#: End of a warning's first statement, and number of its words that the status line shows.
_ENDS, _FEW = re.compile(r"[;:]|, so that|, of which"), 16


class MainWindow(QMainWindow):
    """Pipeline and properties on the left, view and time bar in the middle, tabs on the right."""

    def __init__(self) -> None:
        super().__init__()
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        # On a small screen, leave room for the window's frame and a desktop panel.
        self.resize(QSize(1440, 900).boundedTo(self.screen().availableSize() - QSize(20, 60)))
        #: Action that shows and hides each panel.
        self.panels: dict[QWidget, QAction] = {}
        self.document = Document(self)
        self.engine = Engine(self)
        self.look = ViewOptions(handled=True)
        #: The last value of ``view.show`` that showed both fabric and cage.
        self._both = "both"
        self.view = View3D(self.look)
        self.times = TimeBar()
        self.stages = StageList()
        self.properties = Properties(self.document)
        self.errors = ErrorBar()
        self.errors.told = self.document.drafts.told
        self.director = Director(self.document, self.engine, self.view, self.times, self.stages)
        self.modes = ModesTab(self.document, self.engine)
        self.tabs = QTabWidget(documentMode=True)
        # Qt draws the base line of the tab bar white, also in the dark theme.
        self.tabs.tabBar().setDrawBase(False)
        # In a narrow window, shorten the titles: users do not find tabs behind scroll buttons.
        self.tabs.setUsesScrollButtons(False)
        self.tabs.setElideMode(Qt.TextElideMode.ElideRight)
        self.draft = DraftTab(self.document)
        self.gallery = Gallery()
        self.plots = PlotsTab(self.document, self.engine)
        self.pull = PullTab(self.document)
        self.figures = FiguresTab(self.document, self.engine)
        self.tabs.addTab(self.gallery, "Scenes")
        self.tabs.addTab(self.modes, "Modes")
        self.tabs.addTab(self.plots, "Plots")
        self.tabs.addTab(self.draft, "Draft")
        self.tabs.addTab(self.pull, "Pull")
        self.tabs.addTab(self.figures, "Figures")
        self.files = Files(self, self.document, self.errors, self.times)
        self.exports = Exports(self, self.document, self.times, self.view)
        self._lay_out()
        self.menus = Menus(
            self,
            self.document,
            self.files,
            self.exports,
            self.times,
            self.tools,
            self.view,
            self.properties,
            self.panels.values(),
        )
        self._connect()
        self.setAcceptDrops(True)
        self._restore()
        self.engine.start()

    def start(self, scene: str | None) -> None:
        """Open the first scene."""
        self.gallery.show_recent(self.files.recent)
        self.tabs.setCurrentWidget(self.gallery if scene is None else self.modes)
        self.document.open(scene or "plain_weave")

    def report(self, about: str, error: BaseException) -> None:
        """Show an error, and mark the field that it names."""
        self.errors.say(error, about)
        draft = self.document.scene.draft_file
        if isinstance(error, SpacemapError) and draft and error.file == str(draft):
            # For an error inside the draft file, mark the field with the file's name.
            error.section, error.key = "weave", "draft"
        if isinstance(error, SpacemapError) and error.key:
            # Not during a drag: another page would replace the slider that is being dragged.
            section = error.section or ""
            other = section in sections() and section != self.properties.section
            if other and not self.director.held:
                self.stages.choose(section)
            self.properties.mark(error, about)

    def closeEvent(self, event: QCloseEvent) -> None:
        """Stop the engine before Qt frees anything."""
        if not (self.exports.may_leave() and self.files.may_leave()):
            event.ignore()
            return
        self.keep_state()
        self.modes.stop()
        self.plots.stop()
        self.exports.stop()
        self.director.stop()
        self.view.shut()
        super().closeEvent(event)

    def keep_state(self) -> None:
        """Store position and layout of the window for the next start."""
        settings = QSettings()
        settings.setValue("geometry", self.saveGeometry())
        settings.setValue("columns", self.splitter.saveState())

    def discard(self) -> None:
        """Close without asking about unsaved changes or running exports."""
        self.exports.stop()
        self.document.undo.setClean()
        self.close()

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if event.mimeData().hasUrls():
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Open the dropped file."""
        names = [url.toLocalFile() for url in event.mimeData().urls()]
        if names and self.files.may_leave():
            event.acceptProposedAction()
            self.files.load(names[0])

    def _restore(self) -> None:
        settings = QSettings()
        geometry, columns = settings.value("geometry"), settings.value("columns")
        if geometry is not None:
            self.restoreGeometry(geometry)
        if columns is not None:
            self.splitter.restoreState(columns)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        """Show the panels that are switched on, as far as there is room."""
        room = self.width() - self.splitter.widget(1).minimumSizeHint().width()
        for widget, shown in self.panels.items():
            needed = max(widget.minimumWidth(), widget.minimumSizeHint().width())
            widget.setVisible(shown.isChecked() and room >= needed)
            room -= needed * shown.isChecked()

    def _lay_out(self) -> None:
        left, middle = QWidget(), QWidget()
        column(left, self.stages, (self.properties, 1), spacing=0)
        # The width of the widest page of fields with its scroll bar. A width computed for each page
        # or value would resize the view during a drag.
        left.setMinimumWidth(298)
        self.tools = ViewBar(self.view)
        column(middle, self.tools, self.errors, (self.view, 1), self.times, spacing=0)
        self.splitter = QSplitter(Qt.Orientation.Horizontal, childrenCollapsible=False)
        # When the window is resized, the view gets the largest part of the difference.
        for place, (part, share) in enumerate(((left, 1), (middle, 3), (self.tabs, 1))):
            self.splitter.addWidget(part)
            self.splitter.setStretchFactor(place, share)
        self.splitter.setSizes([320, 780, 340])
        self.setCentralWidget(self.splitter)
        # A narrower window hides the tabs.
        self.setMinimumWidth(_LEAST)
        for widget, name, key in ((left, "Properties", "F9"), (self.tabs, "Tabs", "F10")):
            self.panels[widget] = shown = action(self, name, self._fit, key, checkable=True)
            shown.setChecked(True)
        # The view is a native child window. Otherwise Qt would blend the whole main window at every
        # frame, which takes a sixth of the frame's time with software rendering. Set this only when
        # the view is in its place: moving it to another window would make a new OpenGL context.
        self.view.setAttribute(Qt.WidgetAttribute.WA_DontCreateNativeAncestors)
        self.view.setAttribute(Qt.WidgetAttribute.WA_NativeWindow)
        self.told = OneLine()
        self.told.linkActivated.connect(self._switch_stage)
        self.details = tool_button("Details", "Show all warnings")
        self.details.clicked.connect(self._show_details)
        self.details.hide()
        self.bar, self.running = QProgressBar(), QLabel()
        self.bar.setFixedWidth(160)
        self.cancel = QPushButton("Cancel")
        self.cancel.clicked.connect(self.director.cancel)
        status = self.statusBar()
        status.addWidget(self.told, 1)
        for widget in (self.details, self.running, self.bar, self.cancel, self.exports.progress):
            status.addPermanentWidget(widget)
        self._show_progress("", 0.0, "")

    def _connect(self) -> None:
        self.stages.chosen.connect(self.properties.choose)
        self.stages.switched.connect(self._switch_stage)
        self.stages.look(self.tools.eyes)
        self.properties.added.connect(self._switch_stage)
        self.document.told_beside.connect(self._tell_done)
        self.properties.held.connect(self.director.hold)
        self._connect_errors()
        self.director.drawn.connect(self._drawn)
        self.director.progress.connect(self._show_progress)
        # After an error, stop a shown mode or pull: it would fail again at every frame.
        self.director.swing_ended.connect(self.modes.stop)
        self.director.swing_ended.connect(self.pull.stop)
        self.director.given_up.connect(self._given_up)
        for ended in (self.director.failed, self.director.given_up):
            ended.connect(self.view.preview.end)
        self.errors.run.clicked.connect(self._run)
        self.modes.swung.connect(self.director.swing_mode)
        self.pull.pulled.connect(self._pull)
        self.pull.held.connect(self.director.hold)
        for stop in (self.modes.stop, self.pull.stop):
            self.times.play.clicked.connect(stop)
            self.document.replaced.connect(stop)
        self.modes.table.cellClicked.connect(self.pull.release)
        #: State of the view when the status line began to show a picked point; None if it does not.
        self._picked_in: object = None
        self.view.picked.connect(self._describe)
        self.plots.asked.connect(self._asked)
        self.view.picks_changed.connect(self.plots.show_points)
        self.plots.clear.clicked.connect(self.view.forget_picks)
        self.director.drawn.connect(self.plots.follow)
        self.director.drawn.connect(self.modes.response.follow)
        self.director.drawn.connect(self.figures.follow)
        self.draft.held.connect(self.director.hold)
        self.draft.saved.clicked.connect(self.files.save_draft)
        self.draft.left.connect(self.files.leave_for)
        self.document.changed.connect(self._name)
        self.document.replaced.connect(self._name)
        self.document.undo.cleanChanged.connect(self._name)
        self.tools.looked.connect(self._look)
        self.tools.backed.connect(self._back)
        self.tools.hung.connect(self._hang)
        self.tools.clipped.connect(self._clip)
        self.tools.keys.thickened.connect(self._thicken)
        # Queued, because the mouse still holds the plane when the signal is emitted.
        self.view.clipped.connect(self._clip, Qt.ConnectionType.QueuedConnection)
        for told in (self.document.changed, self.document.replaced):
            told.connect(self._show_view)
        self.document.replaced.connect(self._begin)
        self.files.remembered.connect(self.gallery.show_recent)
        self.files.remembered.connect(self._name)
        self.gallery.chosen.connect(self.files.leave_for)
        # As a temporary message: the next frame would replace the text about the view.
        self.exports.written.connect(lambda file: self._tell_done(f"Written: {file}"))
        self.gallery.new_button.clicked.connect(self.files.new)
        self.gallery.open_button.clicked.connect(self.files.open)

    def _connect_errors(self) -> None:
        """Connect each kind of error to the signals that report it and that clear it."""
        document, draft, plots = self.document, self.draft, self.plots
        for about, failing, righting in (
            ("run", [self.director.failed], []),  # until a frame is drawn
            (
                "value",
                [self.properties.refused, document.failed, draft.failed, self.menus.refused],
                [self.properties.accepted, document.changed, draft.accepted],
            ),
            # A change shows that the user goes on without the file that could not be opened.
            ("open", [], [document.changed]),
            ("time", [self.times.refused], [self.times.chosen]),
            ("plot", [plots.failed], [plots.shown]),
            ("plot file", [plots.unwritten], [plots.written]),
            ("export", [self.exports.failed], [self.exports.written]),
        ):
            self.errors.watch(about, failing, righting)
        self.exports.lost.connect(lambda what: self.errors.warn(f"Written, but {what}.", "export"))
        self.errors.reported.connect(self.report)
        document.replaced.connect(self.errors.clear)
        document.replaced.connect(self._tell_elsewhere)

    def _tell_elsewhere(self) -> None:
        first, *more = [*elsewhere(self.document.scene), ""]
        if first:
            and_more = f", and {len(more) - 1} more" if more[1:] else ""
            self.errors.warn(f"{first}{and_more}.", "elsewhere")

    def _back(self, bottom: str | None, top: str | None) -> None:
        written = {"background": bottom, "background_top": top}
        self._try(self.document.set_many, "view", written)

    def _look(self, name: str, value: object) -> None:
        if name in ("fabric", "cage"):
            self._show(name, bool(value))
            return
        usual = value == View.parameters[name].default
        self._try(self.document.set, "view", name, None if usual else value)

    def _show(self, name: str, on: bool) -> None:
        # Fabric or cage is always visible: hiding one shows the other.
        scene, other = self.document.scene, "cage" if name == "fabric" else "fabric"
        show = scene.view.show
        if show not in (name, other):
            self._both = show
        seen = self._both if on and show != name else name if on else other
        if not scene.moves:  # without motion there is only the fabric
            self.tools.show_scene(scene)
            return
        self._look("show", seen)

    def _switch_stage(self, section: str, on: bool = True) -> None:
        values = {}
        if on and section == "motion" and not self.document.remembers(section):
            # Unlike all other stages, this one has no useful default: it needs a file.
            file, _ = QFileDialog.getOpenFileName(self, "The motion to read")
            values = {"file": file} if file else {}
            on = bool(file)
        self._try(self.document.switch, section, on, values)
        self.stages.show_boxes(self.document.scene)  # the switch may have been refused

    def _hang(self, on: bool) -> None:
        modal, response = self.document.scene.modal, self.document.scene.response
        written: dict[str, Any] = {"hang": None if on else False}
        if on and not (any(modal.gravity) or modal.dead_loads):
            used = self.view.frame.in_use if self.view.frame else {}
            now = response.gravity or used.get("response", {}).get("gravity", DOWN)
            written["gravity"] = list(now if any(now) else DOWN)
        self._try(partial(self.document.set_many, name="hang"), "modal", written)

    def _clip(self, normal: Sequence[float] | None, origin: Sequence[float] | None) -> None:
        written = {
            "clip_normal": None if normal is None else list(normal),
            "clip_origin": None if origin is None else list(origin),
        }
        self._try(partial(self.document.set_many, name="clip plane"), "view", written)

    def _thicken(self, steps: int) -> None:
        # In whole steps, so that the same number of steps back restores the former thickness.
        now = round(math.log(self.document.scene.view.line_scale, _THICKER))
        self._look("line_scale", round(_THICKER ** (now + steps), 2))

    def _show_view(self) -> None:
        moves = self.document.scene.moves
        self.times.allow(moves)
        self.menus.time.setEnabled(moves)
        self.tools.show_scene(self.document.scene)
        self.view.adopt(self.document.scene.view)

    def _tell_done(self, what: str) -> None:
        self.statusBar().showMessage(what, _TOLD)

    def _begin(self) -> None:
        self.modes.forget()
        self.figures.forget()
        example = self.document.example
        self.view.preview.begin(thumbnails.file_of(example) if example else None)
        self.told.tell("")  # clear the text about the former scene
        self.told.setToolTip("")
        self.details.hide()
        # Do not show the properties of a stage that the new scene does not use.
        if self.stages.states.get(self.properties.section, "off") == "off":
            self.stages.choose(self.document.scene.source.section)

    def _try(self, change: Callable[..., None], *arguments: Any) -> None:
        try:
            change(*arguments)
        except InputError as error:
            self.report("value", error)

    def _name(self, *_: Any) -> None:
        self.setWindowTitle(f"{self.document.name}[*] – spacemap")
        self.setWindowModified(not self.document.undo.isClean())

    def _given_up(self, what: str) -> None:
        self.errors.warn(f"The run was cancelled: {what}.", "cancel", can_run=True)

    def _run(self) -> None:
        self.errors.clear("cancel")
        self.director.ask()

    def _drawn(self, frame: Frame) -> None:
        self.errors.clear("cancel")
        # A frame of a mode or pull does not prove that the motion works: its stages did not run.
        if frame.swing is None:
            self.errors.clear("run")
            self.properties.clear("run")
        if not (frame.coarse and self.director.held):
            # Also while playing; only a drag can change the modes at every frame.
            self.modes.show_modes(frame.cage, self.document.scene.stage("mover"))
            self.modes.show_turns(self.document.scene.stage("rotation") is not None)
            self.properties.show_found("modal", measures_in(frame.cage), frame.in_use)
        # If only the camera has moved, keep the text about a picked point.
        if not frame.coarse and _shown_in(frame) != self._picked_in:
            self._picked_in = None
            self._tell(frame)

    def _describe(self, pick: Pick) -> None:
        """Describe a picked point in the status line."""
        frame = self.view.frame
        self._picked_in = None if frame is None else _shown_in(frame)
        self.told.tell(pick.text)

    def _tell(self, frame: Frame) -> None:
        """Show the number of facets and the first warning, shortened, in the status line."""
        doubts, few, link = list(frame.warnings), "", ""
        if doubts:
            few = _headline(doubts[0])
        if frame.motion and frame.motion["large"]:
            doubts.insert(0, f"The motion {motion_told(frame.motion)}")
            few = f"The motion {motion_in_short(frame.motion)}"
            # A click on the cure applies it.
            link = "" if frame.motion["rebuilt"] else _SWITCH_ON_ROTATION
        warnings = self.document.drafts.told("\n".join(doubts))
        drawn = [frame.surface] if frame.yarns is None else [frame.yarns, frame.around]
        count = sum(surface.GetNumberOfCells() for surface in drawn if surface is not None)
        # Warnings about an unchanged scene of the program's own are not the user's fault: they are
        # shown only after a click.
        shown = few and not (self.document.example and self.document.undo.isClean())
        note = f"  ⚠ {self.document.drafts.told(few)}{link and ': '}{link}" if shown else ""
        self.told.tell(f"{count:,} facets{note}", link, "rotation")
        # Qt shows a tooltip as plain text if it contains no tags. Text from a file must not be
        # interpreted as HTML.
        self.told.setToolTip(warnings.replace("<", "‹"))
        self.details.setText("Details" if shown else "Notes")
        self.details.setVisible(bool(warnings))

    def _show_details(self) -> None:
        """Show all warnings until the next click."""
        paragraphs = (html.escape(line) for line in self.told.toolTip().splitlines())
        page = "".join(f"<p>{line}</p>" for line in paragraphs)
        QWhatsThis.showText(self.details.mapToGlobal(QPoint(0, 0)), page, self.details)

    def _pull(self, pull: Pull | None) -> None:
        if pull is not None:
            self.modes.release()
        self.director.pull(pull)

    def _asked(self, at: float, going_on: bool) -> None:
        self.modes.stop()
        self.pull.stop()
        self.times.pause()
        self.times.go(at, going_on)

    def _show_progress(self, section: str, share: float, step: str) -> None:
        for widget in (self.bar, self.cancel, self.running):
            widget.setVisible(bool(section))
        if section:
            stage = words_of(sections()[section].__name__)
            self.running.setText(f"{stage}: {step}" if step else stage)
            # A stage that reports no progress gets a busy indicator.
            self.bar.setRange(0, 100 if share > 0.0 else 0)
            self.bar.setValue(min(int(share * 100), _NOT_YET))


def _headline(warning: str) -> str:
    """Return the first statement of a warning, shortened to a few words."""
    words = _ENDS.split(warning, maxsplit=1)[0].split()
    return " ".join(words[:_FEW]) + " …" * (len(words) > _FEW)


def _shown_in(frame: Frame) -> object:
    """Return a key that identifies what a frame shows, regardless of the camera."""
    return frame.generation, frame.values, frame.time, frame.swing
