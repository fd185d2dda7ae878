"""Builds the documentation site from the pages of `docs/`, the README, the notebooks and the docstrings.

    python -m docs.make_site [FOLDER]             # default: build/docs; open FOLDER/index.html
    python -m docs.make_site FOLDER --check PAGE …  # reads every page, writes these alone

The pages are laid out in FOLDER-pages first, with what a code host cannot show: the list of contents, which is the
order of links in docs/index.md, the pages of the Python API, the fields of the JSON schemas, and notebooks as pages.
"""

from __future__ import annotations

import argparse
import gc
import os
import re
import shutil
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath

from sphinx.cmd.build import main as build

from docs.site_notebooks import notebook_page
from docs.site_python import python_pages
from docs.site_schemas import model_pages, schema_pages

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
FENCE = re.compile(r"(^(?:`{3,})[^`]*\n.*?^`{3,}$)", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s#]+)(#[^)\s]*)?\)")
OTHERS = "project"
"""Folder of the site for pages and files that do not lie in docs/."""


def main() -> int:
    """Lays the pages out and builds the site, warnings being errors; the exit code of Sphinx."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("site", type=Path, nargs="?", default=ROOT / "build" / "docs", metavar="FOLDER")
    parser.add_argument("--check", nargs="+", default=[], metavar="PAGE", help="pages that are written, without ending")
    asked = parser.parse_args()
    # nodes of pages live to the end: collecting garbage takes a fifth of the time and saves a third of 0.9 GB
    gc.disable()
    lay_out(_laid_out(asked.site))
    if not asked.check:
        return _sphinx(asked.site, "html")
    # links of all pages are followed by the builder that writes none of them
    return _sphinx(asked.site, "dummy") or _sphinx(asked.site, "html", asked.check)


def _laid_out(site: Path) -> Path:
    """Folder of the pages that a site is built from."""
    return site.with_name(f"{site.name}-pages")


def _sphinx(site: Path, builder: str, only: Sequence[str] = ()) -> int:
    """The exit code of Sphinx; without `only`, all pages are written that the builder writes."""
    pages = _laid_out(site)
    # that a site of some pages has no index for its search is a warning of Sphinx
    strict = [] if only else ["-W", "--keep-going"]
    # in pages that nobody reads quotes are left straight, and defaults are not looked up in the source: a sixth of it
    plain = ["-D", "smartquotes=0", "-D", "autodoc_preserve_defaults=0"] if only or builder == "dummy" else []
    options = [*strict, *plain, "-q", "-b", builder, "-c", DOCS, "-d", f"{site}-doctrees"]
    return build([str(word) for word in (*options, pages, site, *(pages / f"{name}.md" for name in only))])


def lay_out(pages: Path) -> None:
    """Writes every page of the site to this folder, which is emptied first."""
    shutil.rmtree(pages, ignore_errors=True)
    todo = [DOCS / "index.md", *sorted(DOCS.rglob("*.md")), *sorted((ROOT / "notebooks").glob("*.ipynb"))]
    done: set[Path] = set()
    while todo:
        source = todo.pop(0).resolve()
        if source in done or source.is_dir():
            continue
        done.add(source)
        target = pages / _place(source)
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.suffix not in (".md", ".ipynb"):
            shutil.copyfile(source, target)
            continue
        text = notebook_page(source) if source.suffix == ".ipynb" else source.read_text(encoding="utf-8")
        todo += [linked for linked in _links(text, source.parent) if linked.exists()]
        target.write_text(_moved(text, source), encoding="utf-8", newline="\n")
    generated = {"reference/python": python_pages(), "reference/schemas": schema_pages(ROOT) | model_pages()}
    for parent, made in generated.items():
        for name, text in made.items():
            (pages / f"{parent}-{name}.md").write_text(text, encoding="utf-8", newline="\n")
        _append(pages / f"{parent}.md", _contents("", [f"{PurePosixPath(parent).name}-{name}" for name in made]))
    _append(pages / "index.md", "".join(_contents(*part) for part in contents(done)))


def contents(known: set[Path]) -> Iterator[tuple[str, list[str]]]:
    """(heading, pages) as docs/index.md links to them; every page where it is named first."""
    index = DOCS / "index.md"
    taken = {index}
    for part in re.split(r"^## ", index.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
        heading, _, body = part.partition("\n")
        linked = [p for p in _links(body, DOCS) if p in known and p.suffix in (".md", ".ipynb")]
        new = [page for page in dict.fromkeys(linked) if page not in taken]
        taken.update(new)
        if new:
            yield heading.strip(), [_place(page).with_suffix("").as_posix() for page in new]
    rest = sorted(page for page in known - taken if page.suffix == ".md")
    yield "Also", [_place(page).with_suffix("").as_posix() for page in rest]


def _contents(caption: str, names: list[str]) -> str:
    hidden = [":hidden:", *([f":caption: {caption}"] if caption else []), ":titlesonly:", ":maxdepth: 1"]
    return "\n".join(["\n```{toctree}", *hidden, "", *names, "```\n"])


def _append(page: Path, text: str) -> None:
    page.write_text(page.read_text(encoding="utf-8") + text, encoding="utf-8", newline="\n")


def _place(source: Path) -> Path:
    """Where a page or file of the project lies in the site."""
    inside = source.relative_to(ROOT)
    if inside.parts[0] == "docs":
        return inside.relative_to("docs")
    if inside.parts[0] == "notebooks":
        return inside.with_suffix(".md")
    return OTHERS / inside


def _links(text: str, folder: Path) -> Iterator[Path]:
    """Files of the project that the text links to, outside of fenced blocks."""
    for part in FENCE.split(text)[::2]:
        for _, target, _ in LINK.findall(part):
            if "://" not in target:
                path = (folder / target).resolve()
                yield from sorted(path.glob("*.md")) if path.is_dir() else [path]


def _moved(text: str, source: Path) -> str:
    """The text of a page with its links changed to the places that pages have in the site."""
    here = _place(source).parent

    def moved(link: re.Match[str]) -> str:
        path = (source.parent / link[2]).resolve()
        if "://" in link[2] or not path.exists():
            return link[0]
        # the site has no page of a folder; what is in it stands in the list of contents
        return (
            f"[{link[1]}]({Path(os.path.relpath(_place(path), here)).as_posix()}{link[3] or ''})"
            if path.is_file()
            else link[1]
        )

    parts = FENCE.split(text)
    parts[::2] = [LINK.sub(moved, part) for part in parts[::2]]
    return "".join(parts)


if __name__ == "__main__":
    sys.exit(main())
