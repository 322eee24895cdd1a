"""The published package contains the program and its scenes, with complete metadata."""

from __future__ import annotations

import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

import spacemap_vtk

ROOT = Path(__file__).parents[1]
#: Folders of the package in the checkout and installed.
_LIBRARY, _MANUAL = Path("spacemap_vtk/library"), Path("spacemap_vtk/manual")
_PAGES = ("explanation", "how-to", "reference", "tutorials")
_FOLDERS = {
    "spacemap_vtk": Path("spacemap_vtk"),
    "scenes": _LIBRARY,
    **{f"docs/{name}": _MANUAL / name for name in _PAGES},
}
#: Files of the package besides its folders.
_FILES = ("pyproject.toml", "setup.cfg", "MANIFEST.in", "LICENSE", "README.md", "CITATION.cff")

PUBLIC = "https://forge.example/weavers/cloth"


@pytest.fixture(scope="module")
def published(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with an sdist and the wheel that was built from it."""
    work = tmp_path_factory.mktemp("published")
    checkout = work / "checkout"
    for folder in _FOLDERS:
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / folder, checkout / folder, ignore=ignored)
    for file in _FILES:
        shutil.copy(ROOT / file, checkout)
    shutil.copytree(ROOT / ".ci", checkout / ".ci")
    subprocess.run([checkout / ".ci/addresses", PUBLIC, "v1.2"], check=True)

    def build(kind: str, source: Path) -> None:
        code = f"import setuptools.build_meta as b; b.build_{kind}({str(work)!r})"
        words = [sys.executable, "-W", "ignore", "-c", code]
        done = subprocess.run(words, cwd=source, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr

    build("sdist", checkout)
    with tarfile.open(next(work.glob("*.tar.gz"))) as archive:
        archive.extractall(work / "unpacked", filter="data")
    (unpacked,) = (work / "unpacked").iterdir()
    build("wheel", unpacked)
    return work


# The gate also installs the package with "pip install .", as in the README.
@pytest.mark.nightly
def test_a_wheel_from_the_sdist_has_all_files_and_runs(published: Path) -> None:
    (wheel,) = published.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        (about,) = (name for name in archive.namelist() if name.endswith("/METADATA"))
        reported = archive.read(about).decode()
        inside = {name for name in archive.namelist() if ".dist-info/" not in name}
        archive.extractall(published / "installed")
    files = (
        (path, at / path.relative_to(ROOT / folder))
        for folder, at in _FOLDERS.items()
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    )
    assert inside == {str(name) for _, name in files}
    for what in ("Source", "Documentation", "Changelog", "Issues"):
        assert f"\nProject-URL: {what}, {PUBLIC}/" in reported
    assert f"]({PUBLIC}/raw/v1.2/docs/tablecloth.jpg)" in reported
    assert not re.search(r"\]\((?!https?:|#)", reported.partition("\n\n")[2])
    citation = (published / "checkout/CITATION.cff").read_text("utf-8")
    assert f'\nrepository-code: "{PUBLIC}"\nversion: "1.2"\n' in citation
    # Run the wheel, not the checkout that is installed here.
    code = (
        "import spacemap_vtk, pathlib; from spacemap_vtk.cli.main import main;"
        f"assert pathlib.Path(spacemap_vtk.__file__).is_relative_to({str(published)!r});"
        "main(['info', 'handweaving'])"
    )
    environment = {**os.environ, "PYTHONPATH": str(published / "installed")}
    words = [sys.executable, "-c", code]
    done = subprocess.run(
        words, cwd=published, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "crimp" in done.stdout


def test_every_folder_with_modules_is_packaged() -> None:
    listed = re.findall(r"^    (spacemap_vtk[\w.-]*)$", (ROOT / "setup.cfg").read_text(), re.M)
    folders = {file.parent for file in (ROOT / "spacemap_vtk").rglob("__init__.py")}
    found = {".".join(folder.relative_to(ROOT).parts) for folder in folders}
    assert set(listed) == found | {
        "spacemap_vtk.library",
        *(f"spacemap_vtk.manual.{name}" for name in _PAGES),
    }


def test_the_version_has_one_source_and_metadata_is_complete() -> None:
    reported = importlib.metadata.metadata("spacemap_vtk")
    version = spacemap_vtk.__version__
    assert reported["Version"] == version
    assert reported["Author"]
    assert "License :: OSI Approved :: MIT License" in reported.get_all("Classifier")
    assert reported["License-File"] == "LICENSE"
    assert f"## {version}" in (ROOT / "CHANGELOG.md").read_text("utf-8")
    for file in ("setup.cfg", "pyproject.toml", "CITATION.cff"):
        assert not re.search(rf"(?<![\d.]){re.escape(version)}(?![\d.])", (ROOT / file).read_text())


def test_the_citation_names_existing_files_and_the_author() -> None:
    text = (ROOT / "CITATION.cff").read_text("utf-8")
    references = text.split("  - type: ")[1:]
    named = 0
    for reference in references:
        author = re.search(r"family-names: \"?([\w']+)", reference)
        files = re.findall(r"[\w/]+/\w+\.py", reference)
        assert author is not None
        sources = [(ROOT / "spacemap_vtk" / file).read_text("utf-8") for file in files]
        assert not files or any(author[1] in source for source in sources), author[1]
        named += bool(files)
    assert named >= 10
