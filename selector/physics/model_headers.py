"""Which section of a model file has brackets of the wrong kind: [joints] twice where [[joints]] is meant."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable

_HEADER = re.compile(r"(\[\[?)([\w.\"' -]+)\]\]?")
_LONGEST = 200


def bracket_slip(text: str, is_array: Callable[[str], bool]) -> tuple[str, str, str, int] | None:
    """(found, expected, advice, line) of a section that TOML cannot put beside one of the same name, or None.

    Parameters
    ----------
    text : str
        A model file that TOML refuses.
    is_array : callable
        Name of a section, as in ``grinding.stages`` → whether there may be several of it.
    """
    seen: Counter[tuple[str, str]] = Counter()
    last: dict[str, int] = {}
    for number, line in enumerate(text.split("\n"), 1):
        bare = line[:_LONGEST].partition("#")[0].strip()
        header = _HEADER.fullmatch(bare) if bare.startswith("[") else None
        if header is not None:
            seen[header[1], header[2].strip()] += 1
            last[header[2].strip()] = number
    for (brackets, name), count in seen.items():
        several = seen["[[", name]
        if brackets == "[[" or count + several < 2:
            continue
        times = f"[{name}] {'twice' if count == 2 else f'{count} times'}" if not several else f"[{name}] and [[{name}]]"
        if is_array(name) or several:
            advice = "write double brackets around what comes several times"
            return times, f"[[{name}]] before each of them", advice, last[name]
        advice = "put the keys into one section, or give the other a name of its own"
        return times, "every section of a TOML file once", advice, last[name]
    return None
