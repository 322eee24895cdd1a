"""Half hours of five persons, as docs/walks tells them, played on the real window.

SPACEMAP_WALKS=pictures keeps a picture of every step there, and those that the texts show.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from window import require_display

require_display()

from PySide6.QtCore import QSettings, Qt  # noqa: E402
from walks import Walk  # noqa: E402

ROOT = Path(__file__).parents[1]
TEXTS = sorted((ROOT / "docs" / "walks").glob("*.md"))


@pytest.mark.parametrize("dark", [False, pytest.param(True, marks=pytest.mark.nightly)])
@pytest.mark.parametrize(
    "text",
    [
        pytest.param(text, marks=[pytest.mark.nightly] * (text.stem not in ("weaver", "engineer")))
        for text in TEXTS
    ],
    ids=lambda text: text.stem,
)
def test_the_window_does_what_the_walk_says(
    text: Path, dark: bool, open_window: Any, qapp: Any, tmp_path: Path, monkeypatch: Any
) -> None:
    folder = tmp_path / "work"
    (folder / "scenes").mkdir(parents=True)
    words = text.read_text("utf-8")
    for name in re.findall(r"`(scenes/\S+)` into", words):
        shutil.copy(ROOT / name, folder / name)
    monkeypatch.chdir(folder)
    # Other desktops have others, which nobody could follow here.
    qapp.setAttribute(Qt.ApplicationAttribute.AA_DontUseNativeDialogs)
    QSettings().setValue("dark", "true" if dark else "false")
    (scene,) = re.findall(r"Start `spacemap gui ?(\w*)`", words)
    window = open_window(scene or None, wait=False)
    window.resize(1440, 900)
    kept = os.environ.get("SPACEMAP_WALKS")
    look = f"{'dark' if dark else 'light'}-{window.devicePixelRatio():g}"
    pictures = Path(kept) / look if kept else tmp_path / "pictures"
    Walk(text, window, pictures, look, each=bool(kept)).play()


@pytest.mark.nightly
def test_on_a_fine_screen(tmp_path: Path) -> None:
    shown = {"QT_SCALE_FACTOR": "2"}
    if shutil.which("xvfb-run") is None or "QT_SCALE_FACTOR" in os.environ:
        pytest.skip("this is the fine screen, or there is none")
    tests = [sys.executable, "-m", "pytest", "-q", "-x", "-m", "", str(Path(__file__))]
    screen = ["xvfb-run", "-a", "-s", "-screen 0 3000x2000x24", *tests]
    environment = os.environ | shown
    environment.pop("PYTEST_XDIST_WORKER", None)  # whose screen is a small one
    done = subprocess.run(screen, env=environment, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stdout[-4000:]
