"""Light and dark theme."""

from __future__ import annotations

from PySide6.QtGui import QColor, QPalette
from PySide6.QtWidgets import QApplication, QLabel

_Role = QPalette.ColorRole
#: Colour of each role in the light and in the dark theme.
_COLORS = {
    _Role.Window: ("#f4f6f8", "#1d232b"),
    _Role.WindowText: ("#1f2730", "#e6eaf0"),
    _Role.Base: ("#ffffff", "#28303b"),
    _Role.AlternateBase: ("#eef1f5", "#2e3743"),
    _Role.Text: ("#1f2730", "#e6eaf0"),
    _Role.Button: ("#ffffff", "#2a333f"),
    _Role.ButtonText: ("#1f2730", "#e6eaf0"),
    _Role.Highlight: ("#2d6a8e", "#4d9cc7"),
    _Role.HighlightedText: ("#ffffff", "#0d1116"),
    _Role.ToolTipBase: ("#1f2730", "#e6eaf0"),
    _Role.ToolTipText: ("#ffffff", "#1d232b"),
    _Role.PlaceholderText: ("#6b7583", "#93a0ae"),
    _Role.Mid: ("#cfd6de", "#3a4553"),
    _Role.Link: ("#2d6a8e", "#6db3dc"),
    _Role.LinkVisited: ("#2d6a8e", "#6db3dc"),
}
#: Colour of each placeholder of the style sheet in the light and in the dark theme.
_SHEET_COLORS = {
    "faint": ("#66717e", "#93a0ae"),
    "bad": ("#c0394b", "#ff7a85"),
    "bad_back": ("#fdecee", "#4a2229"),
    "line": ("#d5dbe2", "#333d49"),
    "accent": ("#2d6a8e", "#4d9cc7"),
    "checked": ("#2d6a8e", "#a9d3ea"),
    "card": ("#ffffff", "#1a2028"),
    "text": ("#1f2730", "#e6eaf0"),
    "check": ("#cfe3ef", "#35546a"),
}
_SHEET = """
QToolTip {{ padding: 4px; }}
QLabel#about, QLabel#note {{ color: {faint}; }}
QLabel#note[bad="true"] {{ color: {bad}; }}
QToolButton#group {{ font-weight: 600; border: none; padding: 4px 0; }}
QToolButton#group:checked {{ background: transparent; }}
QToolButton#auto {{ color: {faint}; font-size: 11px; padding: 1px 0; }}
QToolButton#auto:checked {{ color: {checked}; }}
QLabel#heading {{ font-size: 20px; font-weight: 600; }}
ParameterRow[bad="true"] QLineEdit, Editor[bad="true"] QLineEdit,
Editor[bad="true"] QComboBox, QLineEdit[bad="true"] {{
    border: 2px solid {bad}; border-radius: 4px;
}}
QWidget#error {{ background: {bad_back}; border-bottom: 1px solid {bad}; }}
QTreeWidget#stages {{ border: none; border-bottom: 1px solid {line}; }}
QToolButton:checked {{ background: {check}; border-radius: 4px; }}
QListWidget#gallery::item {{ padding: 2px; border-radius: 6px; }}
QListWidget#gallery::item:disabled {{ background: transparent; color: {text}; }}
QListWidget#gallery::item:hover {{ background: {check}; }}
QListWidget#gallery::item:selected {{ background: {check}; color: {text}; }}
QPushButton#side {{ padding: 3px 2px; }}
QPushButton#side:checked {{ background: {check}; border: 1px solid {accent}; border-radius: 4px; }}
QFrame#guide {{ border: 1px solid {accent}; background: {card}; }}
QFrame#guide QLabel {{ color: {text}; }}
QDialog#commands {{ border: 1px solid {accent}; }}
QFrame#card {{ border: 1px solid {line}; border-radius: 6px; background: {card}; }}
QFrame#card[selected="true"] {{ border: 2px solid {accent}; }}
QTabBar::tab {{ padding: 5px 2px 4px 3px; border: none; border-bottom: 2px solid transparent; }}
QTabBar::tab:hover {{ border-bottom-color: {line}; }}
QTabBar::tab:selected {{ border-bottom-color: {accent}; }}
QToolButton::menu-indicator {{ image: none; }}
QSplitter::handle {{ background: {line}; }}
QSplitter::handle:horizontal {{ width: 1px; }}
QHeaderView::section {{ background: transparent; border: none; padding: 4px; color: {faint}; }}
QTableWidget#modes QHeaderView::section {{ padding: 4px 2px; }}
"""
#: In the dark theme, Fusion draws an empty check box almost invisibly dark.
_DARK_SHEET = """
QCheckBox::indicator:unchecked:enabled, QTreeView::indicator:unchecked {
    border: 1px solid #7d8998; border-radius: 2px; width: 12px; height: 12px; }
"""


def apply_theme(app: QApplication, dark: bool) -> None:
    """Apply the light or the dark theme to all windows."""
    # Only once: PySide leaks the former style whenever a style is set.
    if app.property("styled") is None:
        app.setStyle("Fusion")
        app.setProperty("styled", True)
    names = {name: colors[dark] for name, colors in _SHEET_COLORS.items()}
    sheet = _SHEET.format(**names) + (_DARK_SHEET if dark else "")
    if app.styleSheet() == sheet:
        return  # setting it again would lay out and paint all widgets again
    palette = QPalette()
    for role, colors in _COLORS.items():
        palette.setColor(role, QColor(colors[dark]))
    group = QPalette.ColorGroup.Disabled
    for role in (_Role.Text, _Role.WindowText, _Role.ButtonText):
        palette.setColor(group, role, QColor("#7d8998" if dark else "#8a94a3"))
    app.setPalette(palette)
    app.setStyleSheet(sheet)
    for label in app.allWidgets():
        # A link keeps the colour from when its text was set, so set the text again.
        if isinstance(label, QLabel) and "<a " in label.text():
            text = label.text()
            label.clear()
            label.setText(text)
