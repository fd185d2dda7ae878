"""One HTML file: text, tables, figures and the program that draws them, with nothing to load from anywhere."""

import base64
import functools
import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import plotly.graph_objects as go
from markupsafe import Markup

from selector import __version__
from selector.atomic_file import write_whole
from selector.figures import style
from selector.telling.account import Account, Drawing

TEMPLATES = Path(__file__).with_name("templates")


@dataclass(frozen=True)
class Picture:
    """A figure in the page: its title as a caption, how to read it, and the figure as JSON."""

    id: str
    title: str
    text: str
    height: int
    json: Markup


class Pictures:
    """Figures of one page, numbered in order of appearance, so that equal results give equal bytes."""

    def __init__(self) -> None:
        self._count = 0

    def add(self, drawn: go.Figure, text: str = "", *, title: str = "") -> Picture:
        """The figure with its title lifted out of the drawing: text wraps, can be found, and can be copied."""
        self._count += 1
        own_title = style.title_text(drawn)
        content = json.loads(drawn.to_json())
        layout = content["layout"]
        layout.pop("title", None)
        layout.pop("width", None)
        lifted = max(0, int(layout["margin"].get("t", 0)) - style.TITLE_MARGIN)
        layout["margin"] = {**layout["margin"], "t": int(layout["margin"].get("t", 0)) - lifted}
        layout["height"] -= lifted
        # no "<" survives, so that no name can end the script element it stands in
        text_json = json.dumps(content, ensure_ascii=False, separators=(",", ":"), sort_keys=True)
        for sign in "<>&\u2028\u2029":
            text_json = text_json.replace(sign, f"\\u{ord(sign):04x}")
        return Picture(f"figure-{self._count}", title or own_title, text, layout["height"], Markup(text_json))  # noqa: S704


def rendered(template: str, values: Mapping[str, Any]) -> str:
    """The page of a template. Everything that is not a template is escaped.

    The page forbids itself to load anything, and to run any program but the two that are in it.
    """
    plotly, drawing = _plotly_program(), (TEMPLATES / "page.js").read_text(encoding="utf-8")
    policy = (
        "default-src 'none'; base-uri 'none'; form-action 'none'; img-src data: blob:; style-src 'unsafe-inline'; "
        f"script-src {_hashed(plotly)} {_hashed(drawing)}"
    )
    programs = {
        "policy": Markup(policy),  # noqa: S704
        "style": Markup((TEMPLATES / "page.css").read_text(encoding="utf-8")),  # noqa: S704
        "plotly": Markup(plotly),  # noqa: S704
        "drawing": Markup(drawing),  # noqa: S704
    }
    return _environment().get_template(template).render(**values, **programs)


@functools.cache
def _environment() -> jinja2.Environment:
    """The templates, compiled once for all pages of a process."""
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES, encoding="utf-8"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        finalize=_printable,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def _printable(value: Any) -> Any:
    """Without the control characters that names may hold; templates and programs are what they are."""
    if not isinstance(value, str) or isinstance(value, Markup):
        return value
    return "".join(sign if sign.isprintable() or sign in "\n\t" else " " for sign in value)


def account_page(account: Account) -> str:
    """The page of an account: its figures are numbered in the order of reading."""
    pictures = Pictures()
    blocks: dict[str, list[tuple[str, Any]]] = {}
    for place, told in (("front", account.front), *((section.id, section.blocks) for section in account.sections)):
        kept = [
            pictures.add(one.figure, one.text, title=one.title) if isinstance(one, Drawing) else one for one in told
        ]
        blocks[place] = [(type(one).__name__, one) for one in kept]
    return rendered(
        "account.html",
        {
            "title": account.title,
            "version": __version__,
            "account": account,
            "blocks": blocks,
            "has_pictures": any(kind == "Picture" for kept in blocks.values() for kind, _ in kept),
        },
    )


def write_account(account: Account, path: str | Path) -> Path:
    """Write an account as one HTML file that needs no network; whole or not at all.

    Raises OptionError: the file cannot be written; an old file of that name is untouched.
    """
    target = Path(path) if isinstance(path, str) else path
    # a lone surrogate in a name must not end the report
    write_whole(target, account_page(account).encode("utf-8", "replace"))
    return target


def one_page(pages: Sequence[str], title: str) -> str:
    """Several pages of `rendered`, one after the other, as one; a single page is itself.

    Places inside of each keep their own links: their ids are told apart by the page's number.
    """
    if len(pages) == 1:
        return pages[0]
    parts = []
    for number, page in enumerate(pages, start=1):
        # what is between these is the content: names cannot hold a "<", and data have scripts with a type
        body = page.partition("<body>\n")[2].partition("\n<script>")[0]
        parts.append(Markup(_PLACE.sub(rf"\g<1>result-{number}-", body)))  # noqa: S704
    return rendered("several.html", {"title": title, "version": __version__, "parts": parts})


#: Where a place has its name, and what leads there.
_PLACE = re.compile(r'(<[^<>]*?(?: id="| href="#))')


@functools.cache
def _plotly_program() -> str:
    from plotly.offline import get_plotlyjs

    program: str = get_plotlyjs()
    return program.replace("\r\n", "\n").replace("</script", "<\\/script").replace("<!--", "<\\!--")


@functools.cache
def _hashed(program: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(program.encode('utf-8')).digest()).decode('ascii')}'"
