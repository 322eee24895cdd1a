"""The guided walks of the help menu."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from PySide6.QtWidgets import QTabWidget, QWidget

from spacemap_vtk.app.documents.document import Document
from spacemap_vtk.app.draft.draft_tab import DraftTab
from spacemap_vtk.app.help.guide import Step, Target, Walk
from spacemap_vtk.app.panels.figures_tab import FiguresTab
from spacemap_vtk.app.panels.gallery import Gallery
from spacemap_vtk.app.panels.modes_tab import ModesTab
from spacemap_vtk.app.panels.plan_tab import PlanTab
from spacemap_vtk.app.panels.time_bar import TimeBar
from spacemap_vtk.app.plots.plots_tab import PlotsTab
from spacemap_vtk.app.view.view3d import View3D
from spacemap_vtk.app.view.view_bar import ViewBar


@dataclass(frozen=True)
class Parts:
    """The parts of the window to which the walks point."""

    document: Document
    tabs: QTabWidget
    gallery: Gallery
    draft: DraftTab
    modes: ModesTab
    plots: PlotsTab
    figures: FiguresTab
    plan: PlanTab
    view: View3D
    tools: ViewBar
    times: TimeBar


def make_walks(parts: Parts) -> list[Walk]:
    """Return all walks, in the order of the menu."""
    return [
        Walk("Draw a draft and hang it", lambda: _draw_and_hang(parts)),
        Walk("See how cloth swings", lambda: _swing(parts)),
        Walk("From a weave to the loom", lambda: _to_the_loom(parts)),
    ]


def _in_tab(parts: Parts, tab: QWidget, widget: QWidget) -> Callable[[], Target]:
    """Point to a widget of a tab; while another tab is shown, to the tab."""
    return lambda: widget if tab.isVisible() else (parts.tabs, tab)


def _open_tab(parts: Parts, tab: QWidget, text: str) -> Step:
    return Step(text, lambda: (parts.tabs, tab), lambda: parts.tabs.currentWidget() is tab)


def _draw_and_hang(parts: Parts) -> Sequence[Step]:
    document, draft, gallery = parts.document, parts.draft, parts.gallery

    def colors() -> object:
        weave = document.scene.parts["weave"].settings
        return weave["warp_color"], weave["weft_color"], weave["draft"]

    def is_edited() -> bool:
        return document.scene.draft_file is not None or document.history.canUndo()

    begin: list[object] = []

    def is_colored() -> bool:
        if draft.palette_row.isVisible() and not begin:
            begin.append(colors())
        return bool(begin) and colors() != begin[0]

    return (
        Step(
            "Click New fabric: a plain weave that you can change as you like.",
            _in_tab(parts, gallery, gallery.new_button),
            lambda: document.source is None,
        ),
        _open_tab(parts, draft, "Click the tab Draft. It shows threading, tie-up and treadling."),
        Step(
            "Drag across the squares of the threading or the treadling. The cloth in the view "
            "follows; each change can be undone with Ctrl+Z.",
            _in_tab(parts, draft, draft.grid),
            is_edited,
        ),
        Step(
            "Choose a colour above the draft, then drag along the coloured bar above the threading "
            "to paint the warp, or along the one beside the treadling to paint the weft.",
            # Not to the colours: the note would cover the bars.
            _in_tab(parts, draft, draft.grid),
            is_colored,
        ),
        Step(
            "Click Hang as curtain, in the tab Scenes: the cloth gets the stiffness of its yarns "
            "and hangs under its own weight. This takes some seconds.",
            lambda: gallery.presets[0] if gallery.isVisible() else (parts.tabs, gallery),
            lambda: any(document.scene.modal.gravity),
        ),
        Step(
            "Click ▶, or press the space bar, to let it move.",
            lambda: parts.times.play,
            lambda: parts.times.playing,
        ),
        Step(
            "Ctrl+S saves the scene and its draft, Ctrl+P a picture of the view. That is all: "
            "everything else is a variation of this.",
            lambda: parts.view,
        ),
    )


def _swing(parts: Parts) -> Sequence[Step]:
    document, modes, plots = parts.document, parts.modes, parts.plots
    return (
        Step(
            "Click Plain weave in a gust, in the group Moving cloth.",
            _in_tab(parts, parts.gallery, parts.gallery.list),
            # A motion that another solver computed has no modes.
            lambda: document.scene.modal in document.scene.stages and document.source is not None,
        ),
        _open_tab(
            parts, modes, "Click the tab Modes: the shapes in which the cloth swings by itself."
        ),
        Step(
            "Click a line of the table. The view shows this mode, slowed down; try other lines.",
            _in_tab(parts, modes, modes.table),
            lambda: modes.mode is not None,
        ),
        Step(
            "Click Return to motion to see the whole motion again.",
            _in_tab(parts, modes, modes.back_button),
            lambda: modes.mode is None,
        ),
        _open_tab(parts, plots, "Click the tab Plots."),
        Step(
            "Click the cloth: the plot shows how that point moves. Click the plot to go to a time.",
            lambda: parts.view,
            lambda: bool(parts.view.picks),
        ),
        Step(
            "Choose Displacement: colours show how far each point has moved.",
            lambda: parts.tools.coloring,
            lambda: document.scene.view.color != "own",
        ),
    )


def _to_the_loom(parts: Parts) -> Sequence[Step]:
    document, draft, plan = parts.document, parts.draft, parts.plan
    return (
        Step(
            "Click a scene of the group Weaves, or drop a draft on the window.",
            _in_tab(parts, parts.gallery, parts.gallery.list),
            lambda: document.scene.woven is not None and document.source is not None,
        ),
        _open_tab(
            parts,
            parts.figures,
            "Click the tab Figures: crimp, cover, thickness and mass of the cloth.",
        ),
        _open_tab(parts, draft, "Click the tab Draft. Change what you like."),
        _open_tab(parts, plan, "Click the tab Plan: what you need to weave a piece of some size."),
        Step(
            "Type the width and length of the piece. Ends, reed, warp length and yarn follow.",
            _in_tab(parts, plan, plan.fields["width"]),
            lambda: bool(plan.settings.given_values),
        ),
        Step(
            "PDF… saves the plan as a page. The draft for the loom is printed in the tab Draft.",
            _in_tab(parts, plan, plan.buttons[".pdf"]),
        ),
    )
