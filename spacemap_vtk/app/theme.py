"""Light and dark."""

from __future__ import annotations

from PySide6.QtGui import QColor, QPalette
from PySide6.QtWidgets import QApplication

_Role = QPalette.ColorRole
_LIGHT = {
    _Role.Window: "#f4f6f8",
    _Role.WindowText: "#1f2730",
    _Role.Base: "#ffffff",
    _Role.AlternateBase: "#eef1f5",
    _Role.Text: "#1f2730",
    _Role.Button: "#ffffff",
    _Role.ButtonText: "#1f2730",
    _Role.Highlight: "#2d6a8e",
    _Role.HighlightedText: "#ffffff",
    _Role.ToolTipBase: "#1f2730",
    _Role.ToolTipText: "#ffffff",
    _Role.PlaceholderText: "#8a94a3",
    _Role.Mid: "#cfd6de",
}
_DARK = {
    _Role.Window: "#1d232b",
    _Role.WindowText: "#e6eaf0",
    _Role.Base: "#28303b",
    _Role.AlternateBase: "#2e3743",
    _Role.Text: "#e6eaf0",
    _Role.Button: "#2a333f",
    _Role.ButtonText: "#e6eaf0",
    _Role.Highlight: "#4d9cc7",
    _Role.HighlightedText: "#0d1116",
    _Role.ToolTipBase: "#e6eaf0",
    _Role.ToolTipText: "#1d232b",
    _Role.PlaceholderText: "#7d8998",
    _Role.Mid: "#3a4553",
}
_SHEET = """
QToolTip {{ padding: 4px; }}
QLabel#about, QLabel#note {{ color: {faint}; }}
QLabel#note[bad="true"] {{ color: {bad}; }}
QLabel#heading {{ font-size: 20px; font-weight: 600; }}
ParameterRow[bad="true"] QLineEdit, Editor[bad="true"] QLineEdit,
Editor[bad="true"] QComboBox, QLineEdit[bad="true"] {{
    border: 2px solid {bad}; border-radius: 4px;
}}
QWidget#error {{ background: {bad_back}; border-bottom: 1px solid {bad}; }}
QTreeWidget#stages {{ border: none; border-bottom: 1px solid {line}; }}
QToolButton:checked {{ background: {check}; border-radius: 4px; }}
QListWidget#gallery::item {{ padding: 4px; border-radius: 6px; }}
QListWidget#gallery::item:hover, QListWidget#recent::item:hover {{ background: {check}; }}
QListWidget#gallery::item:selected {{ background: {check}; color: {text}; }}
QPushButton#side {{ padding: 3px 2px; }}
QPushButton#side:checked {{ background: {check}; border: 1px solid {accent}; border-radius: 4px; }}
QFrame#card {{ border: 1px solid {line}; border-radius: 6px; background: {card}; }}
QToolButton::menu-indicator {{ image: none; }}
QSplitter::handle {{ background: {line}; }}
QSplitter::handle:horizontal {{ width: 1px; }}
QHeaderView::section {{ background: transparent; border: none; padding: 4px; color: {faint}; }}
QTableWidget#modes QHeaderView::section {{ padding: 4px 2px; }}
"""
#: Fusion draws an empty box darker than the window, where nobody sees it.
_DARK_SHEET = """
QCheckBox::indicator:unchecked:enabled { border: 1px solid #7d8998; border-radius: 2px;
    width: 12px; height: 12px; }
"""


def apply_theme(app: QApplication, dark: bool) -> None:
    """Give every window a light or dark look."""
    # Once: each style that is set leaves the one before behind in PySide.
    if app.property("styled") is None:
        app.setStyle("Fusion")
        app.setProperty("styled", True)
    palette = QPalette()
    for role, color in (_DARK if dark else _LIGHT).items():
        palette.setColor(role, QColor(color))
    group = QPalette.ColorGroup.Disabled
    for role in (_Role.Text, _Role.WindowText, _Role.ButtonText):
        palette.setColor(group, role, QColor("#5d6875" if dark else "#a4adb8"))
    app.setPalette(palette)
    app.setStyleSheet(
        _SHEET.format(
            faint="#93a0ae" if dark else "#66717e",
            bad="#ff7a85" if dark else "#c0394b",
            bad_back="#4a2229" if dark else "#fdecee",
            line="#333d49" if dark else "#d5dbe2",
            accent="#4d9cc7" if dark else "#2d6a8e",
            card="#1a2028" if dark else "#ffffff",
            text="#e6eaf0" if dark else "#1f2730",
            check="#35546a" if dark else "#cfe3ef",
        )
        + (_DARK_SHEET if dark else "")
    )
