"""The documentation builds without a warning, and the tests that it names exist."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def test_tests_named_by_the_verification_page_exist() -> None:
    text = (ROOT / "docs" / "explanation" / "verification.md").read_text("utf-8")
    named = re.findall(r"`(test_\w+\.py)::(test_\w+)`", text)
    assert len(named) >= 35
    for file, name in named:
        assert f"\ndef {name}(" in (ROOT / "tests" / file).read_text("utf-8"), name
    # Each row of the tables names a test.
    tables = text.partition("## Reliability")[0]
    lines = [line for line in tables.splitlines() if line.startswith("|")]
    assert all("::" in line or line.startswith(("|--", "| what")) for line in lines)


def build_site(folder: Path) -> Path:
    """Run Sphinx, which fails at its first warning, and return the folder of the pages."""
    pytest.importorskip("furo")
    words = [sys.executable, "-m", "sphinx", "-qW", "--keep-going", "-b", "html"]
    words += ["-d", str(folder / "kept"), str(ROOT / "docs"), str(folder / "site")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "site"


def anchors(page: Path) -> set[str]:
    """Return the names by which links refer to the headings of a page."""
    headings = re.findall(r"^#+ (.+)$", page.read_text("utf-8"), re.M)
    return {re.sub(r"[^\w -]", "", text.lower()).replace(" ", "-") for text in headings}


def test_pages_and_headings_that_are_linked_exist() -> None:
    """The nightly run builds the site, which fails at any warning."""
    docs, tried = ROOT / "docs", 0
    written = {"applicability", "commands", "formats", "gallery", "kernels", "parameters", "stages"}
    for page in docs.rglob("*.md"):
        if page.parent.name == "made":
            continue
        for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text("utf-8")):
            place, _, heading = link.partition("#")
            target = page if not place else page.parent / place
            if ":" in place or target.with_suffix("").name in written:
                continue  # elsewhere, or a page that the build writes
            assert target.exists(), f"{page.name}: {link}"
            assert not heading or heading in anchors(target), f"{page.name}: {link}"
            tried += 1
    assert tried > 50


@pytest.mark.nightly
def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    site = build_site(tmp_path)
    parameters = (site / "made" / "parameters.html").read_text("utf-8")
    assert "youngs_modulus" in parameters
    assert "<math" in (site / "explanation" / "theory.html").read_text("utf-8")
    assert "crimp" in (site / "searchindex.js").read_text("utf-8")
    # The target of every internal link exists.
    for page in site.rglob("*.html"):
        for link in re.findall(r'href="([^"#:?]+)["#?]', page.read_text("utf-8")):
            assert (page.parent / link).exists(), f"{page.name}: {link}"
