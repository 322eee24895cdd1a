"""The manual in a window: the pages of the documentation that come with the program."""

from __future__ import annotations

import importlib.metadata
import re
from pathlib import Path
from typing import Any, NamedTuple

from PySide6.QtCore import QByteArray, Qt, QUrl
from PySide6.QtGui import QDesktopServices, QImage, QShowEvent, QTextDocument
from PySide6.QtWidgets import (
    QDialog,
    QFrame,
    QLineEdit,
    QPushButton,
    QSplitter,
    QTextBrowser,
    QTreeWidget,
    QTreeWidgetItem,
    QWidget,
)

from spacemap_vtk.app.widgets import column, row

#: Folders of pages, and their headings.
_FOLDERS = {
    "tutorials": "Tutorials",
    "how-to": "How-to guides",
    "reference": "Reference",
    "explanation": "Explanation",
}
#: The page that is shown first.
FIRST = "use_the_window"
_SIZE = 960, 680
#: Free margin around a page, in pixels.
_MARGIN = 16
_PAGE = Qt.ItemDataRole.UserRole
#: Links, with their words and addresses; pictures begin with an exclamation mark.
_LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)")
_BLOCK_FORMULA = re.compile(r"\$\$(.+?)\$\$", re.S)
_FORMULA = re.compile(r"(?<![$\\])\$([^$\n]+)\$")


class Page(NamedTuple):
    """A page of the manual."""

    file: Path
    title: str
    folder: str
    words: str
    """Its text in lower case, for the search."""


def manual_folder() -> Path:
    """Return the folder of the pages: in the package, or in a checkout."""
    package = Path(__file__).resolve().parents[2]
    installed = package / "manual"
    return installed if installed.is_dir() else package.parent / "docs"


def read_pages() -> list[Page]:
    """Return all pages, in the order of their folders and titles."""
    pages = []
    for folder in _FOLDERS:
        found = []
        for file in (manual_folder() / folder).glob("*.md"):
            text = file.read_text(encoding="utf-8")
            found.append(Page(file, _title_of(text), folder, text.lower()))
        pages += sorted(found, key=lambda page: page.title)
    return pages


def online_address() -> str:
    """Return the address of the documentation of a published package; empty without one."""
    try:
        urls = importlib.metadata.metadata("spacemap_vtk").get_all("Project-URL") or []
    except importlib.metadata.PackageNotFoundError:
        return ""
    found = [url.partition(",")[2].strip() for url in urls if url.startswith("Documentation,")]
    return found[0] if found else ""


def as_qt_markdown(page: Page) -> str:
    """Return the text of a page without what Qt cannot show."""

    def convert(link: re.Match[str]) -> str:
        mark, words, address = link.groups()
        target = page.file.parent / address.partition("#")[0]
        if mark:
            return link[0] if target.is_file() else ""
        if not words and target.is_file():
            words = _title_of(target.read_text(encoding="utf-8"))
        return f"[{words or address}]({address})"

    text = _LINK.sub(convert, page.file.read_text(encoding="utf-8"))
    text = _BLOCK_FORMULA.sub(lambda formula: f"\n```\n{formula[1].strip()}\n```\n", text)
    return _FORMULA.sub(r"`\1`", text)


class _PageView(QTextBrowser):
    """Show pages; pictures are at most as wide as the page."""

    def loadResource(self, kind: int, name: QUrl) -> Any:
        """Load a picture, smaller if it is too wide."""
        found = super().loadResource(kind, name)
        if kind != QTextDocument.ResourceType.ImageResource.value:
            return found
        image = QImage.fromData(found) if isinstance(found, QByteArray) else QImage(found)
        room = self.viewport().width() - 2 * _MARGIN
        smooth = Qt.TransformationMode.SmoothTransformation
        return image.scaledToWidth(room, smooth) if image.width() > room > 0 else image


class Manual(QDialog):
    """Contents and search on the left, the page on the right."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent, Qt.WindowType.Window)
        self.setWindowTitle("Manual – spacemap")
        self.pages = read_pages()
        self.search = QLineEdit(placeholderText="Search the manual", clearButtonEnabled=True)
        self.search.textChanged.connect(self._filter)
        self.contents = QTreeWidget()
        self.contents.setHeaderHidden(True)
        self.contents.setFrameShape(QFrame.Shape.NoFrame)
        self.contents.currentItemChanged.connect(self._show_chosen)
        self.text = _PageView(openLinks=False)
        self.text.setFrameShape(QFrame.Shape.NoFrame)
        # A bar that appears with a long page would cover its pictures.
        self.text.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOn)
        self.text.document().setDocumentMargin(_MARGIN)
        self.text.anchorClicked.connect(self._follow)
        self.online_button = QPushButton("Open the documentation in the browser")
        self.online_button.setVisible(bool(online_address()))
        self.online_button.clicked.connect(lambda: QDesktopServices.openUrl(QUrl(online_address())))
        for folder, heading in _FOLDERS.items():
            group = QTreeWidgetItem(self.contents, [heading])
            group.setFlags(Qt.ItemFlag.ItemIsEnabled)
            for page in self.pages:
                if page.folder == folder:
                    QTreeWidgetItem(group, [page.title]).setData(0, _PAGE, page)
            group.setExpanded(True)
            group.setHidden(not group.childCount())
        left = QWidget()
        column(left, self.search, (self.contents, 1), self.online_button, margins=(8, 8, 0, 8))
        parts = QSplitter(Qt.Orientation.Horizontal, childrenCollapsible=False)
        parts.addWidget(left)
        parts.addWidget(self.text)
        parts.setSizes([270, _SIZE[0] - 270])
        row(self, parts)
        room = self.screen().availableSize()
        self.resize(min(_SIZE[0], room.width()), min(_SIZE[1], room.height() - 60))

    def showEvent(self, event: QShowEvent) -> None:
        """Show the first page, as pictures need the width."""
        super().showEvent(event)
        if self.contents.currentItem() is None:
            self.show_page(FIRST)

    def show_page(self, name: str) -> bool:
        """Show a page by the name of its file; return whether there is one."""
        for item in self._items():
            if item.data(0, _PAGE).file.stem == name:
                self.contents.setCurrentItem(item)
                return True
        return False

    def _items(self) -> list[QTreeWidgetItem]:
        groups = [self.contents.topLevelItem(n) for n in range(self.contents.topLevelItemCount())]
        return [group.child(n) for group in groups for n in range(group.childCount())]

    def _show_chosen(self, item: QTreeWidgetItem | None, _before: QTreeWidgetItem | None) -> None:
        page = None if item is None else item.data(0, _PAGE)
        if page is not None:
            self.text.setSearchPaths([str(page.file.parent)])
            self.text.setMarkdown(as_qt_markdown(page))

    def _follow(self, link: QUrl) -> None:
        """Show the page of a link, or open an address in the browser."""
        if link.scheme() in ("http", "https", "mailto"):
            QDesktopServices.openUrl(link)
        elif not self.show_page(Path(link.path()).stem) and online_address():
            QDesktopServices.openUrl(QUrl(online_address()))

    def _filter(self, text: str) -> None:
        words = text.lower().split()
        for item in self._items():
            item.setHidden(not all(word in item.data(0, _PAGE).words for word in words))


def _title_of(text: str) -> str:
    first = next((line for line in text.splitlines() if line.startswith("# ")), "# Page")
    return first.removeprefix("# ").replace("`", "")
