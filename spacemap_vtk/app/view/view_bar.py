"""The tool bar above the view: visible parts, colours and camera."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QSettings, QSize, Qt, Signal
from PySide6.QtGui import QAction, QActionGroup, QIcon, QResizeEvent
from PySide6.QtWidgets import QLabel, QMenu, QSizePolicy, QToolBar, QToolButton, QWidget

from spacemap_vtk.app.view.camera_menu import SavedCameraMenu
from spacemap_vtk.app.view.view3d import View3D
from spacemap_vtk.app.view.view_keys import ViewKeys
from spacemap_vtk.app.widgets import NarrowComboBox, action, row
from spacemap_vtk.scenes.colorings import COLORINGS, GROUPS
from spacemap_vtk.scenes.presets import PRESETS
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.settings import BACKGROUNDS
from spacemap_vtk.scenes.styles import LIGHTS, STYLES

#: Help of the button *Hang* for a scene that moves.
_HANG = "Start the motion from the equilibrium under gravity and dead loads (H)"
#: Parts that can be shown: name, label, key, and role of the stage that has an eye for it in the
#: list of stages.
_PARTS = (
    ("fabric", "Fabric", "F", "surface"),
    ("cage", "Cage", "C", "cage"),
    ("supports", "Supports", "S", "solver"),
    ("loads", "Loads", "L", "mover"),
    ("ghost", "Ghost", "G", "warp"),
    ("obstacles", "Obstacles", "B", ""),
    ("triad", "Axes", "", ""),
    ("scale_bar", "Scale bar", "", ""),
)
#: Those of them that the window can show on its own, and that a scene can require.
_WINDOW_PARTS = ("triad", "scale_bar")
#: Keys of camera presets. Ctrl+number is the side opposite to the number's; V is PyVista's key.
_CAMERA_KEYS = {
    "three-quarter": "1",
    "isometric": "V",
    "front": "2",
    "back": "Ctrl+2",
    "right": "3",
    "left": "Ctrl+3",
    "top": "4",
    "bottom": "Ctrl+4",
    "lying": "5",
    "face": "6",
}
#: Largest width of the colour choice in pixels.
_MAX_COLORING_WIDTH = 220
#: Letters of the colour choice that fit into the narrowest bar: those of "Own colours".
_COLORING_LETTERS = 7
#: Mark of a menu, shown if there is room.
_MENU_MARK = " ▾"
#: Whether the label of the colour choice, the marks of menus and a button for each part are shown;
#: the first line that fits is used. Without buttons for parts there is a menu of them.
_LAYOUTS = (
    (True, True, True),
    (False, True, True),
    (False, True, False),
    (False, False, False),
)
#: Normal of the first clip plane.
_ACROSS = (-1.0, 0.0, 0.0)


class ViewBar(QToolBar):
    """Tool bar for visible parts, colours, camera, clip plane and style."""

    #: A parameter of a scene's view, or "cage" or "fabric", and its new value.
    setting_changed = Signal(str, object)
    #: Background colours at the bottom and at the top, as in a scene file.
    background_chosen = Signal(object, object)
    #: Whether the motion shall start from the equilibrium under the loads.
    hang_toggled = Signal(bool)
    let_go_asked = Signal()
    #: Normal and origin of the clip plane; None for no plane, or for an automatic origin.
    clip_changed = Signal(object, object)

    def __init__(self, view: View3D) -> None:
        super().__init__("View", objectName="view bar", iconSize=QSize(16, 16))
        self.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
        # Qt's own arrow is black and invisible in the dark theme.
        more = self.findChild(QToolButton, "qt_toolbar_ext_button")
        more.setIcon(QIcon())
        more.setText("»")
        more.setToolTip("More tools")
        self._view = view
        #: Actions that open menus.
        self._menus: list[QAction] = []
        self._shown = _LAYOUTS[0]
        self._possible: list[str] = []
        #: Those of `_WINDOW_PARTS` that the scene requires.
        self._required: list[str] = []
        self.part_actions: dict[str, QAction] = {}
        #: The same actions by the role of a stage, for the eyes in the list of stages.
        self.eye_actions: dict[str, QAction] = {}
        for name, label, key, role in _PARTS:
            tip = f"Show the {label.lower()}" + (f" ({key})" if key else "")
            shown = action(self, label, self._toggle_part, key, tip, name, checkable=True)
            if name in _WINDOW_PARTS:  # only in the menu, as the bar has no room
                setattr(view.options, name, QSettings().value(name) != "false")
                shown.setChecked(getattr(view.options, name))
            elif role:
                self.eye_actions[role] = shown
            self.part_actions[name] = shown
        self._parts = QToolBar()
        self._parts.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self._parts.addActions([a for n, a in self.part_actions.items() if n not in _WINDOW_PARTS])
        self._parts_action = self.addWidget(self._parts)
        self._add_menu("Show", "Parts that are shown").addActions([*self.part_actions.values()])
        self._menus[0].setVisible(False)
        self.hang = action(self, "Hang", self.hang_toggled, "H", _HANG, checkable=True)
        self.addAction(self.hang)
        #: Only in the menu, as the bar has no room.
        self.let_go = action(
            self, "Let go of the supports", lambda _: self.let_go_asked.emit(), "Shift+H"
        )
        # The box starts narrow, and grows if there is room.
        self.coloring = NarrowComboBox(_COLORING_LETTERS, toolTip="Colour by")
        self.coloring.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        #: The same choices as menu actions, for windows too narrow for the box.
        self.colorings: dict[str, QAction] = {}
        group = QActionGroup(self)
        #: Actions and separators of the menu, in groups; those the scene lacks are hidden.
        self.coloring_actions: list[QAction] = []
        for colorings in GROUPS:
            for name, coloring in colorings.items():
                self.colorings[name] = action(
                    group,
                    coloring.label,
                    self._choose_setting,
                    data=("color", name),
                    checkable=True,
                )
                self.coloring_actions.append(self.colorings[name])
            self.coloring_actions.append(QAction(self))
            self.coloring_actions[-1].setSeparator(True)
        self.coloring.currentIndexChanged.connect(
            lambda index: self.setting_changed.emit("color", self.coloring.itemData(index))
        )
        # One widget, so that label and box disappear together if there is no room.
        named = QWidget()
        named.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self._label = QLabel("Colour by")
        self._label.setBuddy(self.coloring)
        row(named, self._label, (self.coloring, 1), margins=(4, 0, 4, 0))
        named.setMaximumWidth(self._label.sizeHint().width() + _MAX_COLORING_WIDTH)
        self.addWidget(named)
        self.cameras: dict[str, QAction] = {}
        cameras = self._add_menu("Camera", "Direction to look from")
        for name, key in _CAMERA_KEYS.items():
            tip = f"Look from: {name} ({key})"
            aim = action(self, name.capitalize(), self._aim_camera, key, tip, name)
            cameras.addAction(aim)
            self.cameras[name] = aim
        self.saved_cameras = SavedCameraMenu(view, self)
        cameras.addSeparator()
        self.add_saved_cameras(cameras)
        self.keys = ViewKeys(view, self)
        cameras.addSeparator()
        cameras.addActions(self.keys.camera_actions)
        cameras.addSeparator()
        tip = "Parallel projection (O)"
        self.orthographic = action(
            self, "Orthographic", view.set_orthographic, "O", tip, checkable=True
        )
        view.orthographic_changed.connect(self.orthographic.setChecked)
        tip = "Keep the up axis upright while the mouse rotates the view (T)"
        self.turntable = action(self, "Turntable", None, "T", tip, checkable=True)
        self.turntable.toggled.connect(self._set_turntable)
        self.turntable.setChecked(QSettings().value("turntable") == "true")
        cameras.addActions([self.orthographic, self.turntable])
        tip = "Cut the scene open with a plane that the mouse moves (X)"
        self.clip = action(self, "Clip", self._toggle_clip, "X", tip, checkable=True)
        self.addAction(self.clip)
        self.clip_sides = [
            action(self, f"Clip across {axis}", self._clip_across, data=tuple(normal.tolist()))
            for axis, normal in zip("xyz", -np.eye(3), strict=True)
        ]
        group = QActionGroup(self)
        self.styles = {
            name: action(
                group, style.label, self._choose_setting, data=("style", name), checkable=True
            )
            for name, style in STYLES.items()
        }
        group = QActionGroup(self)
        #: The light of the style, and the lights in place of it.
        self.lights = {
            name: action(
                group,
                label,
                self._choose_setting,
                tip=tip,
                data=("light", name),
                checkable=True,
            )
            for name, label, tip in (
                (None, "Of the style", "The light of the style"),
                *((name, each.label, each.help.capitalize()) for name, each in LIGHTS.items()),
            )
        }
        self.backgrounds = {
            name: action(self, name, self._choose_background, data=colors)
            for name, colors in BACKGROUNDS.items()
        }
        looks = self._add_menu("Style", "Style of the picture, its light and its background")
        looks.addActions([*self.styles.values()])
        looks.addSeparator()
        light = looks.addMenu("Light")
        light.addActions([*self.lights.values()])
        light.setToolTipsVisible(True)
        looks.addMenu("Background").addActions([*self.backgrounds.values()])

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Leave out what does not fit."""
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        """Show as many reading aids and buttons as there is room for."""
        for layout in (self._parts.layout(), self.layout()):
            layout.invalidate()  # a button may just have been shown or hidden
        label = self._label.sizeHint().width() + self._label.parentWidget().layout().spacing()
        mark = self.fontMetrics().horizontalAdvance(_MENU_MARK)
        menu = self.widgetForAction(self._menus[0]).sizeHint().width() - mark * self._shown[1]
        parts = self._parts.sizeHint().width()

        def width(has_label: bool, has_marks: bool, has_parts: bool) -> int:
            marks = len(self._menus) - has_parts if has_marks else 0
            return label * has_label + mark * marks + (parts if has_parts else menu)

        rest = self.sizeHint().width() - width(*self._shown)
        fitting = (shown for shown in _LAYOUTS if rest + width(*shown) <= self.width())
        shown = next(fitting, _LAYOUTS[-1])
        if shown != self._shown:
            self._shown = shown
            self._label.setVisible(shown[0])
            for opening in self._menus:
                opening.setIconText(opening.text() + _MENU_MARK * shown[1])
            self._parts_action.setVisible(shown[2])
            self._menus[0].setVisible(not shown[2])
            # Otherwise tools that fit now would stay behind the bar's arrow.
            self.layout().invalidate()
            self.layout().activate()

    def show_scene(self, scene: Scene) -> None:
        """Show the view settings of a scene and the choices that it offers."""
        possible = scene.colorings
        self.coloring.blockSignals(True)
        if possible != self._possible:
            self._possible = possible
            self.coloring.clear()
            for name, chosen in self.colorings.items():
                chosen.setVisible(name in possible)
            for names in filter(None, ([n for n in group if n in possible] for group in GROUPS)):
                if self.coloring.count():
                    self.coloring.insertSeparator(self.coloring.count())
                for name in names:
                    self.coloring.addItem(COLORINGS[name].label, name)
            self.coloring.view().setMinimumWidth(self.coloring.view().sizeHintForColumn(0) + 12)
        self.coloring.setCurrentIndex(self.coloring.findData(scene.view.color))
        self.coloring.blockSignals(False)
        self.colorings[scene.view.color].setChecked(True)
        self.styles[scene.view.style].setChecked(True)
        self.lights[scene.view.light].setChecked(True)
        self.saved_cameras.show_scene(scene)
        show = scene.view.show
        parts = {"fabric": show != "cage" or not scene.moves, "cage": show != "fabric"}
        for name, shown in self.part_actions.items():
            is_shown = parts[name] if name in parts else getattr(scene.view, name)
            shown.setChecked(
                is_shown or (name in _WINDOW_PARTS and getattr(self._view.options, name))
            )
        solved = scene.modal in scene.stages
        has_supports = solved and scene.modal.fixed != ()
        supports = self.part_actions["supports"]
        supports.setEnabled(has_supports)
        supports.setChecked(has_supports and supports.isChecked())
        supports.setToolTip("Show the supports (S)" if has_supports else "There are no supports")
        # Only with obstacles: the bar has little room.
        self.part_actions["obstacles"].setVisible(solved and bool(scene.modal.obstacles))
        self._fit()
        self._required = [name for name in _WINDOW_PARTS if getattr(scene.view, name)]
        self.clip.setChecked(scene.view.clip_normal is not None)
        self.hang.setChecked(solved and scene.modal.is_hung)
        self.hang.setEnabled(solved or not scene.moves)
        still = not scene.moves and scene.textile is not None
        self.hang.setToolTip(f"{PRESETS['hang'].help[:-1]} (H)" if still else _HANG)
        can_fall = solved and bool(scene.modal.obstacles)
        self.let_go.setEnabled(can_fall)
        self.let_go.setToolTip(
            "The cloth falls as it is shown and settles on the obstacles of the scene"
            if can_fall
            else "Add an obstacle to fall on first: Modal solver > Add obstacle"
        )

    @property
    def all_actions(self) -> list[QAction]:
        """All actions, for the help."""
        return [
            *self.part_actions.values(),
            self.hang,
            self.let_go,
            *self.camera_actions,
            *self.keys.camera_actions,
            *self.keys.appearance_actions,
            self.keys.ruler,
            self.clip,
            *self.clip_sides,
            *self.styles.values(),
            *self.lights.values(),
            *self.backgrounds.values(),
        ]

    @property
    def camera_actions(self) -> list[QAction]:
        """Actions of the camera."""
        return [*self.cameras.values(), self.orthographic, self.turntable, self.saved_cameras.save]

    def add_saved_cameras(self, menu: QMenu) -> None:
        """Add the saved cameras to a menu."""
        menu.addAction(self.saved_cameras.save)
        menu.addMenu(self.saved_cameras.saved)
        menu.addMenu(self.saved_cameras.deleted)

    def _toggle_part(self, on: bool) -> None:
        name = self.sender().data()
        if name in _WINDOW_PARTS:
            QSettings().setValue(name, "true" if on else "false")
            setattr(self._view.options, name, on)
            self._view.refresh()
        if name not in _WINDOW_PARTS or (name in self._required and not on):
            self.setting_changed.emit(name, on)

    def _choose_setting(self) -> None:
        self.setting_changed.emit(*self.sender().data())

    def _aim_camera(self) -> None:
        self._view.reset_camera(self.sender().data())

    def _set_turntable(self, on: bool) -> None:
        self._view.turntable = on
        QSettings().setValue("turntable", "true" if on else "false")

    def _toggle_clip(self, on: bool) -> None:
        normal, origin = self._view.last_cut or (_ACROSS, None)
        self.clip_changed.emit(normal if on else None, origin if on else None)

    def _clip_across(self) -> None:
        self.clip_changed.emit(tuple(self.sender().data()), None)

    def _choose_background(self) -> None:
        self.background_chosen.emit(*self.sender().data())

    def _add_menu(self, name: str, tip: str) -> QMenu:
        # An action, not a button: the menu behind the bar's arrow can contain only actions.
        menu = QMenu(self)
        opening = action(self, name, tip=tip)
        opening.setIconText(name + _MENU_MARK)
        self._menus.append(opening)
        opening.setMenu(menu)
        self.addAction(opening)
        self.widgetForAction(opening).setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        return menu
