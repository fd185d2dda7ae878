"""Settings of the documentation site; `make docs` builds it (docs/make_site.py lays the pages out first)."""

from __future__ import annotations

import inspect
import re

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx

import selector

project = "selector"
author = "The selector developers"
copyright = "The selector developers, MIT licence"  # noqa: A001 (Sphinx wants this name)
release = version = selector.__version__

default_role = "code"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon", "sphinx_copybutton"]
exclude_patterns = ["project/**/*.py"]

# Pages are Markdown that a code host shows too: no extension of the syntax, headings get the anchors of a code host.
myst_heading_anchors = 4
# a page of the project's root may begin below its title; shapes beside fields are read as types, which lead nowhere
suppress_warnings = ["myst.header", "ref.python"]

napoleon_google_docstring = False
napoleon_numpy_docstring = True
napoleon_use_rtype = False
napoleon_custom_sections = [("Attributes", "returns_style")]  # its names are no links
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autodoc_use_type_comments = False  # there are none, and every source would be parsed once more for them
autodoc_default_options = {
    "members": True,
    "exclude-members": "set_fit_request, set_predict_request, set_score_request",
}
autosummary_generate = False
toc_object_entries = False
python_maximum_signature_line_length = 100

nitpicky = True
# Annotations name types of other packages, of which nothing is fetched, and private ones: those lead nowhere.
nitpick_ignore_regex = [("py:.*", ".*")]

copybutton_prompt_text = r"\$ |>>> |\.\.\. "
copybutton_prompt_is_regexp = True
copybutton_line_continuation_character = "\\"

_FOREIGN = {
    "None", "annotated_types", "bool", "bytes", "collections", "complex", "dict", "float", "int", "list", "numpy",
    "pathlib", "plotly", "pydantic", "scipy", "str", "tuple", "typing",
}  # fmt: skip

html_theme = "furo"
html_title = f"selector {release}"
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#0072B2", "color-brand-content": "#0072B2"},
    "dark_css_variables": {"color-brand-primary": "#56B4E9", "color-brand-content": "#56B4E9"},
}


def _plain_docstring(_app: Sphinx, _what: str, _name: str, _obj: object, _options: object, lines: list[str]) -> None:
    """Docstrings are plain text: bars and stars mean themselves, and the words of a type are no links."""
    for number, line in enumerate(lines):
        parts = re.split(r"(`+[^`]*`+)", line)
        parts[::2] = [re.sub(r"(?<!\\)(\||\*+(?=\w))", _escaped, part) for part in parts[::2]]
        lines[number] = re.sub(r"^(\s*:(?:var)?type [^:]*: )(?=[^`*])(.*)$", r"\1*\2*", "".join(parts))


def _short_signature(
    _app: Sphinx, _what: str, _name: str, _obj: object, _options: object, arguments: str | None, result: str | None
) -> tuple[str | None, str | None]:
    """Arrays as they are written in the source."""
    return _arrays(arguments), _arrays(result)


def _arrays(text: str | None) -> str | None:
    return text and re.sub(r"ndarray\[tuple\[Any, \.\.\.\], dtype\[(\w+)\]\]", r"NDArray[\1]", text)


def _without_note(_app: Sphinx, obj: object, _bound_method: bool) -> None:
    """A bound method that several modules offer: Sphinx notes its signature at the function, shorter each time."""
    if inspect.ismethod(obj):
        obj.__func__.__dict__.pop("__signature__", None)


def _without_dead_links(_app: Sphinx, page: nodes.document) -> None:
    """Types of Python and of other packages lead nowhere; Sphinx would compare each with every name of this one."""
    for link in list(page.findall(addnodes.pending_xref)):
        is_foreign = link.get("refdomain") == "py" and link["reftarget"].partition(".")[0] in _FOREIGN
        if is_foreign and len(link) == 1 and not isinstance(link[0], addnodes.pending_xref_condition):
            link.replace_self(link[0])


def _escaped(found: re.Match[str]) -> str:
    return "".join(f"\\{letter}" for letter in found[0])


def setup(app: Sphinx) -> None:
    """Called by Sphinx. After napoleon, which has priority 500."""
    app.connect("autodoc-process-docstring", _plain_docstring, priority=600)
    app.connect("autodoc-process-signature", _short_signature)
    app.connect("autodoc-before-process-signature", _without_note, priority=900)
    app.connect("doctree-read", _without_dead_links)
