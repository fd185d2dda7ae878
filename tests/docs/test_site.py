"""The documentation builds as a site without a warning, holds every page, and needs no network."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MISSING = [
    name for name in ("sphinx", "myst_parser", "furo", "sphinx_copybutton") if importlib.util.find_spec(name) is None
]
FETCHED = re.compile(
    r"""<(?:script|img|iframe|source)\b[^>]*\bsrc=["'](?:https?:)?//"""
    r"""|<link\b[^>]*\bhref=["'](?:https?:)?//|@import|url\(["']?(?:https?:)?//|!\[[^\]]*\]\((?:https?:)?//"""
)
WRITTEN = ("index", "reference/python-sensors", "how-to/simulate-a-machine", "notebooks/01-patent")
"""One page of each kind: the theme is the same for all."""


@pytest.mark.skipif(bool(MISSING), reason=f"the extra `docs` is not installed: {', '.join(MISSING)}")
def test_the_site_builds_without_a_warning(tmp_path):
    """Every page is read and its links are followed; the pages that are written look as all of them do."""
    site = tmp_path / "site"
    run = subprocess.run(
        [sys.executable, "-m", "docs.make_site", str(site), "--check", *WRITTEN],
        cwd=ROOT, capture_output=True, text=True, encoding="utf-8", timeout=3600, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stdout + run.stderr

    read = tmp_path / "site-doctrees"
    pages = {path.relative_to(read).with_suffix("").as_posix() for path in read.rglob("*.doctree")}
    sources = {path.relative_to(ROOT / "docs").with_suffix("").as_posix() for path in (ROOT / "docs").rglob("*.md")}
    notebooks = {f"notebooks/{path.stem}" for path in (ROOT / "notebooks").glob("*.ipynb")}
    assert sources | notebooks | {"project/README", "reference/python-sensors", "reference/schemas-model-1"} <= pages

    shown = [*site.rglob("*.html"), *site.rglob("*.css")]
    assert {f"{name}.html" for name in WRITTEN} <= {path.relative_to(site).as_posix() for path in shown}
    shown += (tmp_path / "site-pages").rglob("*.md")
    assert [path.name for path in shown if FETCHED.search(path.read_text(encoding="utf-8"))] == []

    # the contents are those of the index, in its order
    index = (site / "index.html").read_text(encoding="utf-8")
    captions = re.findall(r'class="caption-text">([^<]*)<', index)
    headings = re.findall(r"^## (.*)$", (ROOT / "docs" / "index.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert captions[: len(headings)] == headings

    # public names are there with their signatures, and code fences of the index of contents are not shown as text
    sensors = (site / "reference" / "python-sensors.html").read_text(encoding="utf-8")
    assert 'id="selector.sensors.transitive_closure"' in sensors
    assert "toctree}" not in index


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ('<script src="https://cdn.example/x.js">', True),
        ('<link rel="stylesheet" href="//fonts.example/a.css">', True),
        ("@font-face{src:url(https://fonts.example/a.woff2)}", True),
        ("![a picture](https://example.org/a.png)", True),
        ('<a href="https://example.org">a link that is followed by hand</a>', False),
        ('<script src="_static/doctools.js">', False),
    ],
)
def test_what_is_fetched_is_found(text, found):
    assert bool(FETCHED.search(text)) is found
