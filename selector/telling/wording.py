"""What kind of data a result rests on, where the data say of themselves that they are no measurement."""

import re
from collections.abc import Iterator, Mapping
from typing import Any, Literal

_TELLING_KEYS = ("machine", "name", "note", "origin", "source", "kind", "label", "comment", "title", "description")


def label_text(data: str, title: str, *told: Mapping[str, Any]) -> str:
    """The label that stands before anything else; empty for measurements. `data` is what a sentence calls them."""
    texts = {
        "simulated": f"Simulated data: {data} come from a computer model, not from a machine.",
        "reconstructed": f"Reconstructed data: {data} were made to agree with printed results; they are not "
        "measurements.",
    }
    label = label_of(title, *told)
    return "" if label is None else texts[label]


def label_of(title: str, *told: Mapping[str, Any]) -> Literal["simulated", "reconstructed"] | None:
    """Whether a title or what is told of data (machine name, notes) says that they are no measurement."""
    said = [title, *(text for one in told for text in _telling(one))]
    text = " ".join(said).lower()
    if re.search(r"\breconstruct", text):
        return "reconstructed"
    return "simulated" if re.search(r"\bsimulat|\bsynthetic", text) else None


def _telling(value: Any, key: str = "machine") -> Iterator[str]:
    if isinstance(value, str):
        if key in _TELLING_KEYS:
            yield value
    elif isinstance(value, Mapping):
        for inner, item in value.items():
            # statements of findings speak about anything
            if inner != "findings":
                yield from _telling(item, str(inner).lower())
