"""The 3D view: visible parts, colours, shadows, picking and tool bar."""

from __future__ import annotations

import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import binary_erosion
from window import WIDE, require_display, scene_of, settled, type_into, wait_until

require_display()

from PySide6.QtCore import QPoint, QPointF, Qt  # noqa: E402
from PySide6.QtGui import QImage  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from PySide6.QtWidgets import QLabel, QToolButton  # noqa: E402
from vtkmodules.vtkFiltersSources import vtkConeSource  # noqa: E402
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper  # noqa: E402

from spacemap_vtk.app.view import canvas, view3d  # noqa: E402
from spacemap_vtk.draw.actors.lighting import FINE_SAMPLES  # noqa: E402
from spacemap_vtk.scenes.colorings import COLORINGS  # noqa: E402


def image(window: Any) -> np.ndarray:
    return window.view.image().astype(int)


def test_each_part_can_be_shown_and_hidden(open_scene: Any) -> None:
    window = open_scene()
    before = image(window)
    for name in ("fabric", "cage", "supports", "loads", "ghost"):
        window.tools.part_actions[name].trigger()
        assert np.abs(image(window) - before).max() > 30, name
        window.tools.part_actions[name].trigger()
        assert np.abs(image(window) - before).max() < 8, name


def test_patched_fxaa_shader_draws_the_same_pixels(
    qtbot: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Plain(canvas.Canvas):
        def _patch_fxaa(self) -> None:
            self._fxaa_patched = True

    # Kept until they are closed: otherwise the collector frees them, perhaps in another thread.
    widgets = []

    def drawn(kind: type[canvas.Canvas], smooth: bool = True) -> np.ndarray:
        widget = kind(None)
        widgets.append(widget)
        qtbot.addWidget(widget)
        widget.resize(160, 120)
        edges, mapper, actor = vtkConeSource(), vtkPolyDataMapper(), vtkActor()
        mapper.SetInputConnection(edges.GetOutputPort())
        actor.SetMapper(mapper)
        widget.renderer.AddActor(actor)
        widget.renderer.SetUseFXAA(smooth)
        widget.show()
        return widget.image().astype(int)

    usual = drawn(Plain)
    assert np.abs(usual - drawn(Plain, smooth=False)).max() > 30
    np.testing.assert_array_equal(drawn(canvas.Canvas), usual)
    monkeypatch.setattr(canvas, "_TEXEL", "what no driver compiles;\n")
    np.testing.assert_array_equal(drawn(canvas.Canvas), usual)
    for widget in widgets:
        widget.close()


@pytest.mark.nightly
def test_shown_load_arrows_are_inside_the_view(open_scene: Any) -> None:
    window = open_scene()
    window.document.set("response", "gravity", (0.0, -9.81, 0.0))
    # Wide, so that the height limits the view.
    window.resize(1500, 600)
    wait_until(lambda: settled(window))
    renderer = window.view.canvas.renderer

    def farthest() -> float:
        """Return the largest distance of an arrow's end from the centre; 1 is the edge."""
        ends = []
        for point in window.view.frame.arrows.reach:
            renderer.SetWorldPoint(*point, 1.0)
            renderer.WorldToView()
            ends.append(np.abs(renderer.GetViewPoint()[:2]).max())
        return max(ends)

    assert farthest() > 1.0
    window.tools.part_actions["loads"].trigger()
    wait_until(lambda: settled(window))
    assert 0.7 < farthest() < 1.0
    window.tools.cameras["right"].trigger()
    assert farthest() < 1.0
    # A camera that the user has moved is kept.
    window.tools.part_actions["loads"].trigger()
    window.view.canvas.camera.Azimuth(10.0)
    before = window.view.canvas.camera.GetPosition()
    window.tools.part_actions["loads"].trigger()
    assert window.view.canvas.camera.GetPosition() == before


@pytest.mark.nightly
def test_python_threads_run_while_opengl_draws(open_window: Any) -> None:
    window = open_window("tube_bundle")  # an object: its shadows are drawn apart
    canvas, wait, done, ticks = window.view.canvas, window.view.canvas._gl_finish, [], []
    interactor, drawing, ended = canvas.interactor, [], threading.Event()

    def tick() -> None:
        while not ended.wait(0.0005):
            done.append(1)

    def watched() -> None:
        before = len(done)
        wait()
        ticks.append(len(done) - before)

    class Watched:
        def __getattr__(self, name: str) -> Any:
            return getattr(interactor, name)

        def Render(self) -> None:
            before = len(done)
            interactor.Render()
            drawing.append(len(done) - before)

    canvas._gl_finish, canvas.interactor = watched, Watched()
    thread = threading.Thread(target=tick)
    usual = sys.getswitchinterval()
    # Count ticks of a Python thread while OpenGL draws.
    sys.setswitchinterval(60.0)
    try:
        thread.start()
        for _ in range(10):
            image(window)
    finally:
        sys.setswitchinterval(usual)
        ended.set()
        thread.join()
        canvas.interactor = interactor
    assert len(ticks) == len(drawing) == 20  # once for the scene, once for its shadows
    assert sum(ticks) > 10
    # But not inside VTK, whose collector holds a lock and would wait for the GIL.
    assert sum(drawing) <= 10


@pytest.mark.nightly
def test_every_colouring_gives_another_picture(open_scene: Any) -> None:
    window = open_scene()
    of_yarns = ["crimp", "yarn_strain", "yarn_tension", "contact_force", "jammed"]
    assert not set(of_yarns) & set(window.document.scene.colorings)
    window.document.set_many("yarns", {"inextensible": False, "tension": "20 N"})
    pictures = []
    names = window.document.scene.colorings  # all except the equilibrium
    absent = {"equilibrium", "linear_displacement", "stiffness_factor", "density_factor"}
    assert names == [name for name in COLORINGS if name not in absent]
    offered = [window.tools.coloring.itemData(k) for k in range(window.tools.coloring.count())]
    assert [name for name in offered if name] == names  # the others separate groups
    for name in names:
        window.tools.coloring.setCurrentText(COLORINGS[name].label)
        wait_until(lambda name=name: settled(window) and window.view.frame.color == name)
        pictures.append(image(window))
        # Each numeric colouring has a scale with its unit.
        bar = window.view.scene_view.surface.color_bar
        assert bool(bar.GetVisibility()) == (name not in ("own", "family", "yarn", "jammed"))
        assert not bar.GetVisibility() or "[" in bar.GetTitle()
    for k, one in enumerate(pictures):
        for other in pictures[:k]:
            assert np.abs(one - other).max() > 60
    # Each change can be undone.
    assert window.document.history.count() == 1 + len(names) - 1
    assert window.document.values["view"]["color"] == names[-1]


@pytest.mark.nightly
def test_back_faces_of_yarns_are_not_drawn(open_scene: Any) -> None:
    window = open_scene()
    look = window.view.scene_view.surface.GetProperty()
    for azimuth in (0, 70, 110):
        window.view.canvas.camera.Azimuth(azimuth)
        window.view.render()
        assert look.GetBackfaceCulling()
        near = image(window)
        look.BackfaceCullingOff()
        differing = (np.abs(image(window) - near).max(axis=2) > 8).mean()
        look.BackfaceCullingOn()
        assert differing < 2e-4
    window.document.set("weave", "caps", False)
    wait_until(lambda: settled(window))
    assert not look.GetBackfaceCulling()


@pytest.mark.parametrize("color", ["own", pytest.param("displacement", marks=pytest.mark.nightly)])
def test_cut_yarn_is_solid(open_scene: Any, color: str) -> None:
    window = open_scene()
    view, look = window.view, window.view.scene_view.surface.GetProperty()
    window.document.set("surface", "subdivisions", 6)
    window.document.set("view", "color", color)
    window.tools.clip.trigger()
    wait_until(lambda: settled(window) and view.scene_view.cut)
    # Hide the plane, which covers the cut.
    view.handle.show(False)
    window.tools.cameras["right"].trigger()
    for azimuth in (0, 25, -50):
        view.canvas.camera.Azimuth(azimuth)
        solid = image(window)
        # The inside is not visible: without back faces, the picture is the same ...
        look.BackfaceCullingOff()
        assert (np.abs(image(window) - solid).max(axis=2) > 8).mean() < 5e-4
        # ... but not without the cut face
        view.scene_view.cut_face.VisibilityOff()
        # (in a numeric colouring, the inside has the same colour except where it turns away).
        least = 2e-2 if color == "own" else 1e-2
        assert (np.abs(image(window) - solid).max(axis=2) > 8).mean() > least
        view.scene_view.cut_face.VisibilityOn()
        look.BackfaceCullingOn()


@pytest.mark.nightly
def test_cut_face_follows_the_mouse(open_scene: Any) -> None:
    window = open_scene()
    view = window.view
    window.tools.clip.trigger()
    wait_until(lambda: settled(window) and view.scene_view.cut)
    handle = view.handle
    x = view.scene_view.cut[1][0] + 7e-4
    handle.shape.SetOrigin(x, 0.0, 0.0)
    handle.widget.InvokeEvent("InteractionEvent")
    bounds = view.scene_view.cut_face.GetMapper().GetInput().GetBounds()
    np.testing.assert_allclose(bounds[:2], x, atol=1e-7)
    window.tools.clip.trigger()
    wait_until(lambda: settled(window) and not view.scene_view.cut)
    assert not view.scene_view.cut_face.GetVisibility()


def test_click_picks_the_yarn_under_the_mouse(open_scene: Any) -> None:
    window = open_scene()
    window.tools.cameras["front"].trigger()
    QTest.qWait(100)
    picks: list[Any] = []
    window.view.picked.connect(picks.append)
    middle = QPoint(window.view.canvas.width() // 2, window.view.canvas.height() // 2)
    for x in range(-40, 60, 20):
        QTest.mouseClick(window.view.canvas, Qt.MouseButton.LeftButton, pos=middle + QPoint(x, 0))
    assert picks
    pick = picks[-1]
    assert 0 <= pick.yarn < 14
    assert (pick.yarn >= 7) == (pick.family == 1)
    moved = np.array(pick.rest) + pick.displacement
    np.testing.assert_allclose(moved, pick.position, atol=1e-9)
    # As weavers count, and as "spacemap info" and the draft do.
    yarn_name = f"pick {pick.yarn - 6}" if pick.family else f"end {pick.yarn + 1}"
    assert window.status_text.full_text.startswith(yarn_name + " ")
    # A label shows the pick and the shown value while playing, until Escape.
    labels = window.view.scene_view.annotations
    place, text = labels.labels[0]
    np.testing.assert_allclose(place, pick.position, atol=1e-9)
    assert text.splitlines()[0] == pick.name
    end, over = sorted(pick.name.replace("pick", "q").split(" × "))  # by the crossing at rest
    spacing = 0.5e-3
    np.testing.assert_allclose(pick.rest[0] / spacing + 4, int(end[4:]), atol=0.5)
    np.testing.assert_allclose(pick.rest[1] / spacing + 4, int(over[2:]), atol=0.5)
    window.document.set("view", "color", "displacement")
    wait_until(lambda: settled(window) and window.view.frame.color == "displacement")
    moved = 1e3 * np.linalg.norm(pick.displacement)
    assert labels.labels[0][1].splitlines()[1] == f"Displacement {moved:.3g} mm"
    # Nothing moves at t = 0.
    type_into(window.times.line, "0")
    wait_until(lambda: settled(window) and window.view.frame.time == 0.0)
    # Colours with a scale show regular yarns, which lie slightly aside.
    np.testing.assert_allclose(labels.labels[0][0], pick.rest, atol=2e-5)
    forget = window.tools.keys.appearance_actions[-1]
    assert forget.shortcut().toString() == "Esc"
    forget.trigger()
    assert not labels.labels
    assert not forget.isEnabled()
    still = window.view.pick(middle.x(), middle.y()) or window.view.pick(
        middle.x() + 20, middle.y()
    )
    assert np.abs(still.displacement).max() == 0.0


def screenshot(window: Any) -> np.ndarray:
    """Return a screenshot of the view without drawing it again."""
    view = window.view.canvas
    place = view.mapToGlobal(QPoint(0, 0))
    grabbed = window.screen().grabWindow(0, place.x(), place.y(), view.width(), view.height())
    drawn = grabbed.toImage().convertToFormat(QImage.Format.Format_RGB888)
    rows = np.frombuffer(drawn.constBits(), np.uint8).reshape(drawn.height(), -1)
    return rows[:, : 3 * drawn.width()].astype(int)


def test_screen_follows_rotating_and_zooming(open_scene: Any) -> None:
    window = open_scene()
    widget, at = window.view.canvas, QPoint(300, 300)
    QTest.qWait(300)
    pictures = [screenshot(window)]
    QTest.mousePress(widget, Qt.MouseButton.LeftButton, pos=at)
    for _ in range(3):
        at += QPoint(30, 12)
        QTest.mouseMove(widget, at)
        wait_until(lambda: np.abs(screenshot(window) - pictures[-1]).max() > 30, 10.0)
        pictures.append(screenshot(window))
    QTest.mouseRelease(widget, Qt.MouseButton.LeftButton, pos=at)
    QTest.wheelEvent(window.windowHandle(), widget.mapTo(window, at), QPoint(0, 120))
    wait_until(lambda: np.abs(screenshot(window) - pictures[-1]).max() > 30, 10.0)


@pytest.mark.nightly
def test_objects_at_rest_have_the_shadows_of_exported_pictures(open_scene: Any) -> None:
    window = open_scene("tube_bundle")
    view = window.view
    view.steer(True)
    assert not view.canvas.shade.is_on
    moving = view.canvas.image().astype(int)
    view.steer(False)
    wait_until(lambda: view.canvas.shade.is_on)
    rest = view.canvas.image().astype(int)
    # Deep places are darker, lit places unchanged, and nothing is lighter.
    assert (moving - rest).max() > 40
    assert (rest - moving).max() <= 1
    assert (np.abs(moving - rest).max(axis=2) <= 1).mean() > 0.7
    window.document.set("view", "color", "displacement")
    wait_until(lambda: settled(window) and not view._shadow_timer.isActive())
    assert not view.canvas.shade.is_on


def test_woven_yarns_have_their_shadows_also_in_motion(open_scene: Any) -> None:
    window = open_scene()
    view = window.view
    assert view.scene_view.has_exposure
    rest = view.canvas.image().astype(int)
    view.steer(True)
    moving = view.canvas.image().astype(int)
    view.steer(False)
    assert not view.canvas.shade.is_on
    # Facets are coarser in motion, but light and shade are the same.
    assert abs(moving.mean() - rest.mean()) < 1.0
    window.document.set("view", "shadows", False)
    wait_until(lambda: settled(window))
    bare = view.canvas.image().astype(int)
    assert (bare - rest).max() > 40
    assert bare.mean() - rest.mean() > 1.0


@pytest.mark.nightly
def test_labels_cast_no_shadows(open_scene: Any) -> None:
    window = open_scene("tube_bundle")
    view = window.view
    view.zoom(14.0)  # the tubes fill the view
    window.tools.part_actions["scale_bar"].trigger()  # it would cover the other label
    pictures = []
    for _ in range(2):
        wait_until(lambda: settled(window) and not view.steering)
        pictures.append(view.image().astype(int))
        if len(pictures) == 1:
            _, low, right, high = (round(end) for end in view.canvas.shade.unshaded_areas[0])
            window.tools.part_actions["triad"].trigger()
    beside = slice(-high, -low or None), slice(right + 3, right + 20)
    with_, without = (picture[beside] for picture in pictures)
    assert with_.std() > 20
    # A shadow of the label would darken by 70; hidden parts below may lighten a little.
    assert np.median(without - with_) == 0.0
    assert abs((without - with_).mean()) < 15.0


@pytest.mark.nightly
def test_several_mouse_moves_are_drawn_once(open_scene: Any) -> None:
    window = open_scene()
    widget, at, drawn = window.view.canvas, QPoint(300, 300), []
    widget.render_window.AddObserver("EndEvent", lambda *_: drawn.append(1))
    QTest.mousePress(widget, Qt.MouseButton.LeftButton, pos=at)
    QTest.qWait(100)
    drawn.clear()
    for _ in range(20):
        at += QPoint(5, 2)
        QTest.mouseMove(widget, at, 0)
    QTest.qWait(300)
    QTest.mouseRelease(widget, Qt.MouseButton.LeftButton, pos=at)
    assert 1 <= len(drawn) < 20


def test_drag_rotates_the_camera_and_picks_nothing(open_scene: Any) -> None:
    window = open_scene()
    picks: list[Any] = []
    window.view.picked.connect(picks.append)
    before = np.array(window.view.canvas.camera.GetPosition())
    widget, at = window.view.canvas, QPoint(300, 300)
    QTest.mousePress(widget, Qt.MouseButton.LeftButton, pos=at)
    for _ in range(10):
        at += QPoint(10, 4)
        QTest.mouseMove(widget, at)
        QTest.qWait(10)
    QTest.mouseRelease(widget, Qt.MouseButton.LeftButton, pos=at)
    assert np.linalg.norm(window.view.canvas.camera.GetPosition() - before) > 1e-4
    assert not picks


@pytest.mark.nightly
def test_tools_of_a_narrow_window_stay_together(open_scene: Any) -> None:
    window = open_scene()
    window.resize(1024, 700)
    QTest.qWait(200)
    box = window.tools.coloring
    label = next(k for k in window.tools.findChildren(QLabel) if k.text() == "Colour by")
    # The label disappears first; the box then shows it as its tooltip.
    assert box.isVisible() or not label.isVisible()
    assert box.toolTip() == label.text()
    wait_until(lambda: window.times.slider.width() >= 100, 5)


def test_stage_list_shows_time_and_runs_beside_the_name(open_scene: Any) -> None:
    window = open_scene()
    for item in window.stages.items.values():
        for column in (1, 2):
            assert item.textAlignment(column) & int(Qt.AlignmentFlag.AlignVCenter)


@pytest.mark.nightly
def test_narrow_tool_bar_keeps_all_tools_reachable(open_scene: Any) -> None:
    window = open_scene()
    window.resize(1000, 700)
    QTest.qWait(100)
    menus = {action.text(): action.menu() for action in window.tools.actions() if action.menu()}
    assert {*window.tools.part_actions.values()} <= {*menus["Show"].actions()}
    before = image(window)
    backgrounds = next(a.menu() for a in menus["Style"].actions() if a.text() == "Background")
    next(a for a in backgrounds.actions() if a.text() == "Black").trigger()
    assert np.abs(image(window) - before).max() > 200
    # The colourings are also in the menu "View".
    stress = window.tools.colorings["stress"]
    assert not stress.isChecked()
    stress.trigger()
    assert window.tools.coloring.currentData() == window.document.scene.view.color == "stress"
    assert stress.isChecked()
    window.document.history.undo()
    assert not stress.isChecked()


def test_all_tabs_and_tools_are_visible(open_window: Any) -> None:
    """A screen of 1280 x 720 pixels, or one of twice that at scale 2; its windows are smaller."""
    window = open_window()
    bar, tools = window.tabs.tabBar(), window.tools
    parts = tools.part_actions["fabric"], tools.part_actions["obstacles"]
    ball = [{"shape": "sphere", "radius": "1 mm", "center": [0, 0, "-9 mm"]}]
    for width, height in ((1000, 700), (1280, 720), (1260, 660), (1372, 800), (1600, 900)):
        if width == 1600:
            window.document.set("modal", "obstacles", ball)
        window.resize(width, height)
        wait_until(lambda: window.width() == width)  # noqa: B023
        QTest.qWait(50)
        for number in range(bar.count()):
            place = bar.tabRect(number)
            text = bar.fontMetrics().horizontalAdvance(bar.tabText(number))
            assert bar.rect().contains(place), (width, bar.tabText(number))
            assert text <= place.width(), (width, bar.tabText(number))
        # The switch for obstacles is there only where there are any; narrow windows have a menu.
        shown = [action for action in tools.actions() if action.isVisible()]
        buttons = [button for button in tools.findChildren(QToolButton) if button.isVisible()]
        switches = [part in [b.defaultAction() for b in buttons] for part in parts]
        assert switches == [width > 1000, width == 1600]
        for action in shown:
            assert tools.widgetForAction(action).isVisible(), (width, action.text())
        # The whole words of the usual colours.
        assert tools.coloring.fontMetrics().horizontalAdvance("Own colours") < (
            tools.coloring.width() - 24
        )
        assert not tools.findChild(QToolButton, "qt_toolbar_ext_button").isVisible()
    # On a small laptop, the titles of tabs are smaller, but whole.
    window.resize(980, 640)
    wait_until(lambda: bar.font().pointSizeF() < window.font().pointSizeF())
    for number in range(bar.count()):
        place, text = bar.tabRect(number), bar.tabText(number)
        assert bar.rect().contains(place), text
        assert bar.fontMetrics().horizontalAdvance(text) <= place.width(), text


@pytest.mark.nightly
def test_facets_are_refined_when_the_camera_rests(open_scene: Any) -> None:
    window = open_scene("twill_2_2")
    window.resize(*WIDE)
    view, stage = window.view, scene_of(window).surface
    view.zoom(0.3)
    wait_until(
        lambda: (
            settled(window)
            and view.frame.camera_view == view.camera_view
            and not view.frame.has_finer_yarns
        )
    )
    facets, runs = view.frame.surface.GetNumberOfCells(), stage.executions
    view.canvas.camera.Azimuth(2.0)
    view.render()
    wait_until(lambda: settled(window) and not view.steering)
    assert stage.executions == runs  # more would not be visible
    view.zoom(60.0)
    wait_until(
        lambda: (
            settled(window)
            and view.frame.has_finer_yarns
            and view.frame.camera_view == view.camera_view
        )
    )
    near, runs = view.frame, stage.executions
    sides = np.unique(np.asarray(stage._kept.subdivisions))
    assert sides.max() >= 16
    assert sides.min() <= 4
    assert near.surface.GetNumberOfCells() < 3 * facets
    # The margin is enough for a small turn.
    view.canvas.camera.Azimuth(0.01)
    view.render()
    wait_until(lambda: settled(window) and view.frame.camera_view == view.camera_view)
    assert stage.executions == runs
    view.zoom(0.016)
    wait_until(lambda: settled(window) and not view.frame.has_finer_yarns)
    assert view.frame.surface.GetNumberOfCells() == facets


@pytest.mark.nightly
def test_text_about_a_picked_point_stays_when_the_camera_moves(open_scene: Any) -> None:
    window = open_scene("twill_2_2")
    view = window.view
    window.tools.cameras["front"].trigger()
    view.click(QPointF(view.canvas.width() / 2, view.canvas.height() / 2))  # still in motion
    (picked,) = view.picks
    assert window.status_text.full_text == picked.text
    view.zoom(20.0)
    wait_until(lambda: settled(window) and view.frame.has_finer_yarns)
    assert window.status_text.full_text == picked.text
    window.document.set("weave", "warp_color", "#00ff00")
    wait_until(lambda: settled(window) and "facets" in window.status_text.full_text)


@pytest.mark.nightly
def test_view_and_exported_picture_have_the_same_fibres(
    open_scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(view3d, "FINE_SAMPLES", FINE_SAMPLES)
    window = open_scene("twill_2_2")
    window.resize(*WIDE)
    view = window.view
    for name in ("triad", "scale_bar"):
        window.tools.part_actions[name].trigger()
    window.tools.cameras["front"].trigger()
    view.zoom(2.4)
    wait_until(lambda: settled(window) and not view.steering)
    drawn = view.image()
    done, file = [], tmp_path / "cloth.png"
    window.exports.written.connect(done.append)
    panels = view.panels(window.document.scene)
    window.exports.start(
        "picture", file, size=view.camera_view.size, panels=panels, place=view.viewpoint
    )
    wait_until(lambda: done or window.errors.text)
    with Image.open(file) as image:
        written = np.asarray(image)
    rough = [roughness(each) for each in (drawn, written)]
    assert rough[0] == pytest.approx(rough[1], rel=0.15)
    monkeypatch.setattr(view3d, "FINE_SAMPLES", 1)
    assert roughness(view.image()) < 0.8 * rough[1]


def roughness(image: np.ndarray) -> float:
    """Return how much pixels of blue yarns differ from their vertical neighbours."""
    red, _, blue = image.astype(float).transpose(2, 0, 1)
    bent = np.abs(np.diff(blue, 2, axis=0))
    inside = binary_erosion(blue - red > 40.0, iterations=4)[1:-1]
    assert inside.mean() > 0.05
    return float(bent[inside].mean())
