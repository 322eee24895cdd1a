"""The main window: its layout, and the connections between its parts."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from PySide6.QtCore import QEvent, QPoint, QSettings, QSize, Qt, QTimer
from PySide6.QtGui import (
    QAction,
    QCloseEvent,
    QDragEnterEvent,
    QDropEvent,
    QFont,
    QFontMetrics,
    QResizeEvent,
)
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
from spacemap_vtk.app.documents.file_thumbnails import save_thumbnail, thumbnail_of
from spacemap_vtk.app.documents.files import FileCommands
from spacemap_vtk.app.draft.chart_tab import ChartTab, is_knit
from spacemap_vtk.app.draft.draft_tab import DraftTab
from spacemap_vtk.app.help.command_palette import Entry
from spacemap_vtk.app.help.help_menu import HelpMenu
from spacemap_vtk.app.help.palette_entries import (
    recent_entries,
    scene_entries,
    stage_entries,
    tab_entries,
)
from spacemap_vtk.app.help.walks import Parts, make_walks
from spacemap_vtk.app.menus import Menus
from spacemap_vtk.app.panels.composite_tab import CompositeTab
from spacemap_vtk.app.panels.error_bar import ErrorBar
from spacemap_vtk.app.panels.figures_tab import FiguresTab
from spacemap_vtk.app.panels.gallery import Gallery
from spacemap_vtk.app.panels.measure_tab import MeasureTab
from spacemap_vtk.app.panels.modes_tab import ModesTab
from spacemap_vtk.app.panels.plan_tab import PlanTab
from spacemap_vtk.app.panels.properties import Properties
from spacemap_vtk.app.panels.pull_tab import PullTab
from spacemap_vtk.app.panels.stage_list import StageList
from spacemap_vtk.app.panels.time_bar import TimeBar
from spacemap_vtk.app.plots.plots_tab import PlotsTab
from spacemap_vtk.app.view.pick import Pick
from spacemap_vtk.app.view.view3d import View3D
from spacemap_vtk.app.view.view_bar import ViewBar
from spacemap_vtk.app.widgets import ElidedLabel, StatusBar, action, column, show_share, tool_button
from spacemap_vtk.app.work.director import Director
from spacemap_vtk.app.work.engine import Engine
from spacemap_vtk.app.work.exports import Exports
from spacemap_vtk.app.work.frame_request import Pull
from spacemap_vtk.datasets.modal_model import solver_results
from spacemap_vtk.draw import thumbnails
from spacemap_vtk.draw.frame import Frame
from spacemap_vtk.draw.scene_view import ViewOptions
from spacemap_vtk.errors import InputError, SpacemapError
from spacemap_vtk.filters.cage_state import copy_state
from spacemap_vtk.filters.load_parameters import DOWN
from spacemap_vtk.scenes.laboratory import COTTON
from spacemap_vtk.scenes.pipeline import section_classes, stage_title
from spacemap_vtk.scenes.presets import PRESETS, Note
from spacemap_vtk.scenes.report import describe_motion, is_refused, summarise_motion
from spacemap_vtk.scenes.scene_record import describe_outside_files
from spacemap_vtk.scenes.settings import View

#: How long a status message stays, in ms.
_MESSAGE_TIME = 10_000
#: Smallest width of the window in pixels, less than all its panels need together.
_MIN_WIDTH = 690
#: Usual free width beside the title of a tab, in pixels.
_TAB_GAP = 9
#: Least free width beside the title of a tab, in pixels.
_TAB_MARGINS = 6
#: Smallest font of the titles of tabs, in a narrow panel, over the usual one.
_SMALLEST_TITLE = 0.78
#: Step by which the font of these titles becomes smaller, in points.
_TITLE_STEP = 0.25
#: Share of the window's width for the gallery at the first start.
_GALLERY = 0.36
#: Factor by which one key press makes lines and points thicker.
_THICKNESS_STEP = 1.25
#: Text of the link that switches the stage on; it uses the name from the list of stages.
_SWITCH_ON_ROTATION = "switch on Rotation strain"
#: Text of the link that hangs the cloth.
_HANG = "hang the cloth as a curtain"
#: End of a warning's first statement, which the status line shows; not the colon after a line's
#: number.
_STATEMENT_END = re.compile(r";|(?<!\d):|\. |, so that|, but ")
#: Most words of that statement in the status line.
_MAX_WORDS = 16


class _Tabs(QTabWidget):
    """Tabs whose titles are written smaller, then shortened, where the panel is narrow."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        # Qt draws the base line of the tab bar white, also in the dark theme.
        self.tabBar().setDrawBase(False)
        # In a narrow window, shorten the titles first: users do not find tabs behind buttons that
        # scroll. Without such buttons, many tabs would need so much width that the panel hides.
        self.setUsesScrollButtons(True)
        self.setElideMode(Qt.TextElideMode.ElideRight)

    def widths(self, font: QFont | None = None) -> list[int]:
        """Return the widths of the visible tabs in a font, the usual one at first, in pixels."""
        metrics, gap = (
            (self.fontMetrics(), _TAB_GAP) if font is None else (QFontMetrics(font), _TAB_MARGINS)
        )
        titles = (self.tabText(n) for n in range(self.count()) if self.isTabVisible(n))
        return [metrics.horizontalAdvance(title) + gap for title in titles]

    @property
    def least_width(self) -> int:
        """Width in which all titles are whole in the smallest font, in pixels."""
        font = self.font()
        font.setPointSizeF(_SMALLEST_TITLE * font.pointSizeF())
        return sum(self.widths(font))

    def resizeEvent(self, event: QResizeEvent) -> None:
        self._fit_titles()
        super().resizeEvent(event)

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.StyleChange:
            QTimer.singleShot(0, self._fit_titles)  # another theme resets the font of the tab bar

    def tabInserted(self, index: int) -> None:
        super().tabInserted(index)
        self._fit_titles()

    def tabRemoved(self, index: int) -> None:
        super().tabRemoved(index)
        self._fit_titles()

    def _fit_titles(self) -> None:
        font = self.font()
        smallest = _SMALLEST_TITLE * font.pointSizeF()
        # In steps, because letters are whole pixels wide: their widths do not follow the size.
        while sum(self.widths(font)) > self.width() and font.pointSizeF() > smallest:
            font.setPointSizeF(font.pointSizeF() - _TITLE_STEP)
        if font != self.tabBar().font():
            self.tabBar().setFont(font)


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
        self.view_options = ViewOptions(axes_clickable=True)
        #: The last value of ``view.show`` that showed both fabric and cage.
        self._shown_together = "both"
        #: The scene whose thumbnail was saved last.
        self._thumbnail_generation = 0
        self.view = View3D(self.view_options)
        self.times = TimeBar()
        self.stages = StageList()
        self.properties = Properties(self.document)
        self.errors = ErrorBar()
        self.errors.replace_paths = self.document.drafts.replace_paths
        self.director = Director(self.document, self.engine, self.view, self.times, self.stages)
        self.modes = ModesTab(self.document, self.engine)
        self.tabs = _Tabs(documentMode=True)
        self.draft = DraftTab(self.document)
        self.chart = ChartTab(self.document)
        # Without an owner it would outlive the window while no knit is shown.
        self.chart.setParent(self.tabs)
        self.chart.hide()
        self.gallery = Gallery()
        self.plots = PlotsTab(self.document, self.engine)
        self.pull = PullTab(self.document)
        self.figures = FiguresTab(self.document, self.engine)
        self.plan = PlanTab(self.document, self.engine)
        self.measure = MeasureTab(self.document, self.engine)
        self.composite = CompositeTab(self.document, self.engine)
        self.composite.setParent(self.tabs)
        self.composite.hide()
        self.tabs.addTab(self.gallery, "Scenes")
        self.tabs.addTab(self.modes, "Modes")
        self.tabs.addTab(self.plots, "Plots")
        self.tabs.addTab(self.draft, "Draft")
        self.tabs.addTab(self.pull, "Pull")
        self.tabs.addTab(self.figures, "Figures")
        self.tabs.addTab(self.measure, "Measure")
        self.tabs.addTab(self.plan, "Plan")
        self.files = FileCommands(self, self.document, self.errors, self.times)
        self.exports = Exports(self, self.document, self.times, self.view)
        self.presets = {
            name: action(
                self,
                preset.label,
                lambda _=False, name=name: self.apply_preset(name),
                tip=preset.help,
            )
            for name, preset in PRESETS.items()
        }
        self.show_composite = action(
            self,
            "Composite",
            self._show_composite,
            tip="Put the textile into a matrix: show its unit cell and compute elastic constants",
        )
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
            (*self.presets.values(), self.show_composite),
        )
        self.draft.commands.add_to(self.menuBar(), self.menus.time.menuAction())
        parts = Parts(
            self.document,
            self.tabs,
            self.gallery,
            self.draft,
            self.modes,
            self.plots,
            self.figures,
            self.plan,
            self.view,
            self.tools,
            self.times,
        )
        self.help = HelpMenu(self, self.tools, self._palette_entries, make_walks(parts))
        self._connect()
        self.setAcceptDrops(True)
        self._restore_state()
        self.engine.start()

    def start(self, scene: str | None) -> None:
        """Open the first scene; without one, show the gallery."""
        self.gallery.show_recent(self.files.recent)
        self.tabs.setCurrentWidget(self.gallery if scene is None else self.modes)
        if scene is None and QSettings().value("columns") is None:
            # At first, room for several columns of thumbnails.
            room = sum(self.tabs.widths())
            left, tabs = self.splitter.widget(0).minimumWidth(), round(_GALLERY * self.width())
            tabs = max(tabs, room)
            self.splitter.setSizes([left, self.width() - left - tabs, tabs])
        self.document.open(scene or "plain_weave")

    def report(self, kind: str, error: BaseException) -> None:
        """Show an error, and mark the field that it names."""
        self.errors.show_error(error, kind)
        draft = self.document.scene.draft_file
        if isinstance(error, SpacemapError) and draft and error.file == str(draft):
            # For an error inside the draft file, mark the field with the file's name.
            error.section, error.key = "weave", "draft"
        if isinstance(error, SpacemapError) and error.key:
            # Not during a drag: another page would replace the slider that is being dragged.
            section = error.section or ""
            other = section in section_classes() and section != self.properties.section
            if other and not self.director.is_dragging:
                self.stages.select(section)
            self.properties.mark_error(error, kind)

    def closeEvent(self, event: QCloseEvent) -> None:
        """Stop the engine before Qt frees anything."""
        if not (self.exports.confirm_close() and self.files.confirm_close()):
            event.ignore()
            return
        self.save_state()
        self.modes.stop()
        self.plots.stop()
        self.exports.stop()
        self.director.stop()
        self.view.release_resources()
        super().closeEvent(event)

    def save_state(self) -> None:
        """Store position and layout of the window for the next start."""
        settings = QSettings()
        settings.setValue("geometry", self.saveGeometry())
        settings.setValue("columns", self.splitter.saveState())

    def discard(self) -> None:
        """Close without asking about unsaved changes or running exports."""
        self.exports.stop()
        self.document.history.setClean()
        self.close()

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if event.mimeData().hasUrls():
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Open the dropped file."""
        names = [url.toLocalFile() for url in event.mimeData().urls()]
        if names and self.files.confirm_close():
            event.acceptProposedAction()
            self.files.load(names[0])

    def _restore_state(self) -> None:
        settings = QSettings()
        geometry, columns = settings.value("geometry"), settings.value("columns")
        if geometry is not None:
            self.restoreGeometry(geometry)
        if columns is not None:
            self.splitter.restoreState(columns)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._show_fitting_panels()

    def _show_fitting_panels(self) -> None:
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
        self.splitter.setSizes([300, 790, 350])
        self.setCentralWidget(self.splitter)
        # A narrower window hides the tabs.
        self.setMinimumWidth(_MIN_WIDTH)
        for widget, name, key in ((left, "Properties", "F9"), (self.tabs, "Tabs", "F10")):
            self.panels[widget] = shown = action(
                self, name, self._show_fitting_panels, key, checkable=True
            )
            shown.setChecked(True)
        # The view is a native child window. Otherwise Qt would blend the whole main window at every
        # frame, which takes a sixth of the frame's time with software rendering. Set this only when
        # the view is in its place: moving it to another window would make a new OpenGL context.
        self.view.setAttribute(Qt.WidgetAttribute.WA_DontCreateNativeAncestors)
        self.view.setAttribute(Qt.WidgetAttribute.WA_NativeWindow)
        self.status_text = ElidedLabel()
        self.status_text.linkActivated.connect(self._follow_link)
        self.details_button = tool_button("Details", "Show all warnings")
        self.details_button.clicked.connect(self._show_details)
        self.details_button.hide()
        self.progress_bar, self.running_label = QProgressBar(), QLabel()
        self.progress_bar.setFixedWidth(160)
        self.cancel_button = QPushButton("Cancel")
        self.cancel_button.clicked.connect(self.director.cancel)
        status = StatusBar()
        self.setStatusBar(status)
        status.addWidget(self.status_text, 1)
        for widget in (
            self.details_button,
            self.running_label,
            self.progress_bar,
            self.cancel_button,
            self.exports.progress,
            self.exports.results,
        ):
            status.addPermanentWidget(widget)
        self._show_progress("", 0.0, "")

    def _connect(self) -> None:
        self.stages.chosen.connect(self.properties.show_section)
        self.stages.switched.connect(self.switch_stage)
        self.stages.set_eye_actions(self.tools.eye_actions)
        self.properties.switched_on.connect(self.switch_stage)
        for tab in (self.modes, self.plots, self.pull):
            tab.add_button.requested.connect(self.switch_stage)
        self.document.side_effects.connect(self._show_message)
        self.properties.dragging.connect(self.director.set_dragging)
        self._connect_errors()
        self.director.drawn.connect(self._show_frame_state)
        self.director.progress.connect(self._show_progress)
        # After an error, stop a shown mode or pull: it would fail again at every frame.
        self.director.swing_ended.connect(self.modes.stop)
        self.director.swing_ended.connect(self.pull.stop)
        self.director.run_cancelled.connect(self._warn_cancelled)
        for ended in (self.director.failed, self.director.run_cancelled):
            ended.connect(self.view.preview.end)
            ended.connect(self.modes.show_ended)
        self.document.changed.connect(self.modes.expect_modes)
        self.errors.run_button.clicked.connect(self._run)
        self.modes.swing_changed.connect(self.director.show_mode)
        self.pull.pulled.connect(self._show_pull)
        self.pull.dragging.connect(self.director.set_dragging)
        self.composite.cell_changed.connect(self.view.show_cell)
        for stop in (self.modes.stop, self.pull.stop, self.composite.stop):
            self.times.play.clicked.connect(stop)
            self.document.replaced.connect(stop)
        self.modes.table.cellClicked.connect(self.pull.release)
        self.modes.table.cellClicked.connect(self.composite.stop)
        #: State of the view when the status line began to show a picked point; None if it does not.
        self._pick_key: object = None
        self.view.picked.connect(self._show_pick)
        self.view.measured.connect(self._show_measured)
        self.plots.time_clicked.connect(self._go_to_time)
        self.view.picks_changed.connect(self.plots.show_points)
        self.plots.clear_button.clicked.connect(self.view.clear_picks)
        self.director.drawn.connect(self.plots.follow)
        self.director.drawn.connect(self.modes.response.follow)
        self.director.drawn.connect(self.figures.follow)
        self.director.drawn.connect(self.plan.follow)
        self.plan.export_requested.connect(self.exports.plan)
        self.measure.export_requested.connect(self.exports.measurement)
        self.measure.cotton_requested.connect(self._use_cotton)
        self.composite.export_requested.connect(self.exports.composite)
        self.draft.dragging.connect(self.director.set_dragging)
        self.draft.commands.show_requested.connect(partial(self.tabs.setCurrentWidget, self.draft))
        self.draft.save_button.clicked.connect(self.files.save_draft)
        self.draft.print_button.clicked.connect(self.exports.draft)
        self.draft.open_requested.connect(self.files.switch_to)
        self.document.changed.connect(self._set_title)
        self.document.replaced.connect(self._set_title)
        self.document.history.cleanChanged.connect(self._set_title)
        self.tools.setting_changed.connect(self._set_view)
        self.tools.background_chosen.connect(self._set_background)
        self.tools.hang_toggled.connect(self._set_hanging)
        self.tools.let_go_asked.connect(self._let_go)
        self.tools.saved_cameras.changed.connect(self._change_cameras)
        self.tools.clip_changed.connect(self._set_clip_plane)
        self.tools.keys.thickness_changed.connect(self._change_thickness)
        # Queued, because the mouse still holds the plane when the signal is emitted.
        self.view.clipped.connect(self._set_clip_plane, Qt.ConnectionType.QueuedConnection)
        self.properties.obstacle_selected.connect(self.view.obstacles.select)
        self.view.obstacles.moved.connect(self.properties.move_obstacle)
        self.view.obstacles.chosen.connect(self._choose_obstacle)
        for signal in (self.document.changed, self.document.replaced):
            signal.connect(self._show_view_settings)
            signal.connect(self._show_presets)
        self.document.replaced.connect(self._clear_status)
        self.files.recent_changed.connect(self.gallery.show_recent)
        self.files.recent_changed.connect(self._set_title)
        self.gallery.chosen.connect(self.files.switch_to)
        # As a temporary message: the next frame would replace the text about the view.
        self.exports.written.connect(lambda file: self._show_message(f"Saved: {file}"))
        self.exports.copied.connect(self._show_message)
        self.menus.copied.connect(self._show_message)
        self.gallery.show_presets((*self.presets.values(), self.show_composite))
        self.gallery.new_button.clicked.connect(self.files.new)
        self.gallery.open_button.clicked.connect(self.files.open)

    def _connect_errors(self) -> None:
        """Connect each kind of error to the signals that report it and that clear it."""
        document, draft, chart, plots = self.document, self.draft, self.chart, self.plots
        for kind, error_signals, clear_signals in (
            ("run", [self.director.failed], []),  # until a frame is drawn
            (
                "value",
                [
                    self.properties.refused,
                    document.failed,
                    draft.failed,
                    chart.failed,
                    self.menus.refused,
                ],
                [self.properties.accepted, document.changed, draft.accepted, chart.accepted],
            ),
            # A change shows that the user goes on without the file that could not be opened.
            ("open", [], [document.changed]),
            ("time", [self.times.refused], [self.times.time_chosen]),
            ("plot", [plots.failed], [plots.shown]),
            ("plot file", [plots.write_failed], [plots.written]),
            ("export", [self.exports.failed], [self.exports.written]),
        ):
            self.errors.connect_signals(kind, error_signals, clear_signals)
        self.exports.lost.connect(
            lambda what: self.errors.show_warning(f"Saved, but {what}.", "export")
        )
        self.errors.reported.connect(self.report)
        document.replaced.connect(self.errors.clear)
        document.replaced.connect(self._warn_about_origin)

    def _warn_about_origin(self) -> None:
        first, *more = [*describe_outside_files(self.document.scene), ""]
        if first:
            and_more = f", and {len(more) - 1} more" if more[1:] else ""
            self.errors.show_warning(f"{first}{and_more}.", "elsewhere")

    def _set_background(self, bottom: str | None, top: str | None) -> None:
        written = {"background": bottom, "background_top": top}
        self._try_change(self.document.set_many, "view", written)

    def _change_cameras(self, written: dict[str, Any], name: str) -> None:
        self._try_change(partial(self.document.set_many, name=name), "view", written)

    def _set_view(self, name: str, value: object) -> None:
        if name in ("fabric", "cage"):
            self._show_part(name, bool(value))
            return
        is_default = value == View.parameters[name].default
        self._try_change(self.document.set, "view", name, None if is_default else value)

    def _show_part(self, name: str, on: bool) -> None:
        # Fabric or cage is always visible: hiding one shows the other.
        scene, other = self.document.scene, "cage" if name == "fabric" else "fabric"
        show = scene.view.show
        if show not in (name, other):
            self._shown_together = show
        seen = self._shown_together if on and show != name else name if on else other
        if not scene.moves:  # without motion there is only the fabric
            self.tools.show_scene(scene)
            return
        self._set_view("show", seen)

    def switch_stage(self, section: str, on: bool = True) -> None:
        """Switch a stage on or off, and report why that is refused."""
        values = {}
        if on and section == "motion" and not self.document.was_switched_off(section):
            # Unlike all other stages, this one has no useful default: it needs a file.
            file, _ = QFileDialog.getOpenFileName(self, "Open motion file")
            values = {"file": file} if file else {}
            on = bool(file)
        self._try_change(self.document.switch, section, on, values)
        self.stages.show_boxes(self.document.scene)  # the switch may have been refused

    def _follow_link(self, target: str) -> None:
        """Apply the cure that was clicked in the status line: a preset, or a stage."""
        if target in self.presets:
            self.apply_preset(target)
        else:
            self.switch_stage(target)

    def _use_cotton(self) -> None:
        """Give the yarns the stiffness of spun cotton."""
        if self.document.scene.stage("crimp") is None:
            self._try_change(self.document.switch, "yarns", True, COTTON)
        else:
            self._try_change(self.document.set_many, "yarns", COTTON)

    def _set_hanging(self, on: bool) -> None:
        scene = self.document.scene
        if on and not scene.moves and scene.textile is not None:
            self.apply_preset("hang")  # alone, gravity would move a cloth that is not held as one
            return
        written = self._hanging_values if on else {"hang": False}
        self._try_change(partial(self.document.set_many, name="hang"), "modal", written)

    def _choose_obstacle(self, number: int | None) -> None:
        """Select the card of an obstacle that was clicked in the view, or none."""
        if number is not None:
            self.stages.select("modal")
        self.properties.select_obstacle(number)

    def _let_go(self) -> None:
        """Let go of the supports, so that the cage falls from its shown state onto obstacles."""
        frame = self.view.frame
        if frame is None or frame.cage is None or frame.generation != self.director.generation:
            return
        # A shown mode or pull is no state of the scene.
        array = "equilibrium" if frame.mode is not None else "displacement"
        moved = frame.cage.GetPointData().GetArray(array)
        state = None
        if moved is not None and max(np.abs(moved.GetRange(k)).max() for k in range(3)) > 0.0:
            state = str(self.document.drafts.add_state(copy_state(frame.cage, array)))
        self.modes.stop()
        self.pull.stop()
        written = {**self._hanging_values, "fixed": "", "start": state}
        self.view.expect_change(aims=False)  # the cage may fall far
        self._try_change(
            partial(self.document.set_many, name="let go of the supports"), "modal", written
        )

    def apply_preset(self, preset: str, **options: Any) -> None:
        """Let the cloth hang, drape, drop or swing, and state what was assumed."""
        notes: list[Note] = []

        def change() -> None:
            notes.extend(self.document.apply_preset(preset, **options))

        self.modes.stop()
        self.pull.stop()
        before = self.document.text
        self.view.expect_change(aims=True)
        self._try_change(change)
        if self.document.text == before:  # the cloth has this motion, or cannot have it
            self.view.forget_change()
        else:
            self.modes.clear()
            self.modes.expect_modes()
            sentences = [note.for_window for note in notes]
            text = ". ".join(note[0].upper() + note[1:] for note in sentences)
            self._show_message(f"{text}.")

    def _show_presets(self) -> None:
        """Enable presets for a textile."""
        textile = self.document.scene.textile is not None
        for act in (*self.presets.values(), self.show_composite):
            act.setEnabled(textile)

    def _show_composite(self) -> None:
        """Switch the unit cell on, and show its tab."""
        self.switch_stage(self.composite.section)
        if self.tabs.indexOf(self.composite) >= 0:
            self.tabs.setCurrentWidget(self.composite)

    @property
    def _hanging_values(self) -> dict[str, Any]:
        """Values with which the cage hangs; gravity if there is no other load."""
        modal, response = self.document.scene.modal, self.document.scene.response
        written: dict[str, Any] = {"hang": None}
        if not (any(modal.gravity) or modal.dead_loads):
            values = self.view.frame.in_use if self.view.frame else {}
            gravity = response.gravity or values.get("response", {}).get("gravity", DOWN)
            written["gravity"] = list(gravity if any(gravity) else DOWN)
        return written

    def _set_clip_plane(
        self, normal: Sequence[float] | None, origin: Sequence[float] | None
    ) -> None:
        written = {
            "clip_normal": None if normal is None else list(normal),
            "clip_origin": None if origin is None else list(origin),
        }
        self._try_change(partial(self.document.set_many, name="clip plane"), "view", written)

    def _change_thickness(self, steps: int) -> None:
        # In whole steps, so that the same number of steps back restores the former thickness.
        now = round(math.log(self.document.scene.view.line_scale, _THICKNESS_STEP))
        self._set_view("line_scale", round(_THICKNESS_STEP ** (now + steps), 2))

    def _show_view_settings(self) -> None:
        moves = self.document.scene.moves
        self.tabs.setTabVisible(self.tabs.indexOf(self.plan), self.document.scene.woven is not None)
        self._show_tab(self.chart, "Chart", self.draft, is_knit(self.document.scene))
        has_cell = self.composite.section in self.document.scene.given_sections
        self._show_tab(self.composite, "Composite", self.measure, has_cell)
        if not has_cell:
            self.composite.stop()
        self.times.set_moves(moves)
        self.menus.time.setEnabled(moves)
        self.draft.commands.menu.setEnabled(self.document.scene.woven is not None)
        self.tools.show_scene(self.document.scene)
        self.view.set_view(self.document.scene.view)

    def _show_tab(self, tab: QWidget, title: str, after: QWidget, shown: bool) -> None:
        # Inserted and removed: a hidden tab would take room in the bar.
        present = self.tabs.indexOf(tab)
        if shown and present < 0:
            self.tabs.insertTab(self.tabs.indexOf(after) + 1, tab, title)
            self._widen_tabs()
        elif not shown and present >= 0:
            if self.tabs.currentWidget() is tab:  # Qt would select the tab behind it
                self.tabs.setCurrentWidget(after)
            self.tabs.removeTab(present)

    def _widen_tabs(self) -> None:
        """Give the tabs what their titles need, as far as the view can spare it."""
        left, middle, right = self.splitter.sizes()
        spare = middle - self.splitter.widget(1).minimumSizeHint().width()
        added = min(self.tabs.least_width - right, spare)
        if right and added > 0:
            self.splitter.setSizes([left, middle - added, right + added])

    def _palette_entries(self) -> Iterator[Entry]:
        yield from tab_entries(self.tabs)
        yield from recent_entries(self.files.recent, self.files.switch_to)
        yield from scene_entries(self.files.switch_to)
        yield from stage_entries(self.document, self.stages, self.properties, self.switch_stage)

    def _show_message(self, text: str) -> None:
        self.statusBar().showMessage(text, _MESSAGE_TIME)

    def _clear_status(self) -> None:
        self.modes.clear()
        self.figures.clear()
        example, source = self.document.example_name, self.document.source
        self.view.preview.begin(
            thumbnails.file_of(example) if example else source and thumbnail_of(source)
        )
        if self.document.opened_draft is not None:
            self.tabs.setCurrentWidget(self.draft)
        self.status_text.show_text("")  # clear the text about the former scene
        self.status_text.setToolTip("")
        self.details_button.hide()
        # Do not show the properties of a stage that the new scene does not use.
        if self.stages.states.get(self.properties.section, "off") == "off":
            self.stages.select(self.document.scene.source.section)

    def _try_change(self, change: Callable[..., None], *arguments: Any) -> None:
        try:
            change(*arguments)
        except InputError as error:
            self.report("value", error)

    def _set_title(self, *_: Any) -> None:
        self.setWindowTitle(f"{self.document.name}[*] – spacemap")
        self.setWindowModified(not self.document.history.isClean())

    def _warn_cancelled(self, reason: str) -> None:
        self.errors.show_warning(f"The run was cancelled: {reason}.", "cancel", can_run=True)

    def _run(self) -> None:
        self.errors.clear("cancel")
        self.director.request_frame()

    def _show_frame_state(self, frame: Frame) -> None:
        self.errors.clear("cancel")
        if frame.values == self.document.values:
            self.view.forget_change()
        elif self.view.aims_change:
            self.view.preview.announce(True)
        # A frame of a mode or pull does not prove that the motion works: its stages did not run.
        if frame.mode is None:
            self.errors.clear("run")
            self.properties.clear_errors("run")
        if not (frame.coarse and self.director.is_dragging):
            # Also while playing; only a drag can change the modes at every frame.
            self.modes.show_modes(frame.cage, self.document.scene.stage("mover"))
            self.modes.set_angles(self.document.scene.stage("rotation") is not None)
            gravity = self._hanging_values.get("gravity", self.document.scene.modal.gravity)
            self.properties.set_object(frame.surface.GetBounds(), gravity, frame.cage)
            self.properties.show_results("modal", solver_results(frame.cage), frame.in_use)
        if not frame.coarse and frame.generation != self._thumbnail_generation:
            self._save_thumbnail(frame)
        # If only the camera has moved, keep the text about a picked point.
        if not frame.coarse and _frame_key(frame) != self._pick_key:
            self._pick_key = None
            self._show_status(frame)

    def _save_thumbnail(self, frame: Frame) -> None:
        """Save the first picture of a file of the user's, for the list of recent files."""
        self._thumbnail_generation, file = frame.generation, self.document.source
        if file is None or self.document.example_name or not self.document.history.isClean():
            return
        if save_thumbnail(file, self.view.canvas.grabFramebuffer()):
            self.gallery.update_recent()

    def _show_pick(self, pick: Pick) -> None:
        """Describe a picked point in the status line."""
        frame = self.view.frame
        self._pick_key = None if frame is None else _frame_key(frame)
        self.status_text.show_text(pick.text)

    def _show_measured(self, text: str) -> None:
        """Show what the ruler measures in the status line, until the frame or the ruler changes."""
        frame = self.view.frame
        self._pick_key = _frame_key(frame) if frame is not None and text else None
        if text:
            self.status_text.show_text(text)
        elif frame is not None:
            self._show_status(frame)

    def _show_status(self, frame: Frame) -> None:
        """Show the number of facets and the first warning, shortened, in the status line."""
        warnings, headline, link, target = list(frame.warnings), "", "", ""
        if warnings:
            headline = _shorten_warning(warnings[0])
        if frame.motion and frame.motion["large"]:
            headline = f"The motion {summarise_motion(frame.motion)}"
            # A click on the cure applies it.
            if not frame.motion["rebuilt"]:
                link, target = _SWITCH_ON_ROTATION, "rotation"
            if is_refused(frame.motion):
                warnings.insert(0, headline)
                if self.presets["hang"].isEnabled():
                    link, target = _HANG, "hang"
            else:
                warnings.insert(0, f"The motion {describe_motion(frame.motion)}")
        details = self.document.drafts.replace_paths("\n".join(warnings))
        surfaces = [frame.surface] if frame.yarns is None else [frame.yarns, frame.surroundings]
        count = sum(surface.GetNumberOfCells() for surface in surfaces if surface is not None)
        # Warnings about an unchanged scene of the program's own are not the user's fault: they are
        # shown only after a click.
        is_warning_shown = headline and not (
            self.document.example_name and self.document.history.isClean()
        )
        note = (
            f"  ⚠ {self.document.drafts.replace_paths(headline)}{link and ': '}{link}"
            if is_warning_shown
            else ""
        )
        view = self.document.scene.view
        kept = ["depth of field"] * (view.aperture > 0.0) + ["close-ups"] * bool(view.insets)
        in_files = f"  Only exported files show {' and '.join(kept)}." if kept else ""
        self.status_text.show_text(f"{count:,} facets{in_files}{note}", link, target)
        # Qt shows a tooltip as plain text if it contains no tags. Text from a file must not be
        # interpreted as HTML.
        self.status_text.setToolTip(details.replace("<", "‹"))
        self.details_button.setText("Details" if is_warning_shown else "Notes")
        self.details_button.setVisible(bool(details))

    def _show_details(self) -> None:
        """Show all warnings until the next click."""
        paragraphs = (html.escape(line) for line in self.status_text.toolTip().splitlines())
        page = "".join(f"<p>{line}</p>" for line in paragraphs)
        QWhatsThis.showText(
            self.details_button.mapToGlobal(QPoint(0, 0)), page, self.details_button
        )

    def _show_pull(self, pull: Pull | None) -> None:
        if pull is not None:
            self.modes.release()
            self.composite.stop()
        self.director.show_pull(pull)

    def _go_to_time(self, time: float, continues: bool) -> None:
        self.modes.stop()
        self.pull.stop()
        self.times.pause()
        self.times.go_to(time, continues)

    def _show_progress(self, section: str, share: float, step: str) -> None:
        for widget in (self.progress_bar, self.cancel_button, self.running_label):
            widget.setVisible(bool(section))
        if section:
            stage = stage_title(section_classes()[section].__name__)
            self.running_label.setText(f"{stage}: {step}" if step else stage)
            show_share(self.progress_bar, share)


def _shorten_warning(warning: str) -> str:
    """Return the first statement of a warning, shortened to a few words."""
    words = _STATEMENT_END.split(warning, maxsplit=1)[0].split()
    return " ".join(words[:_MAX_WORDS]) + " …" * (len(words) > _MAX_WORDS)


def _frame_key(frame: Frame) -> object:
    """Return a key that identifies what a frame shows, regardless of the camera."""
    return frame.generation, frame.values, frame.time, frame.mode
