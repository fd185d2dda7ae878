"""Where the result comes from: files and their hashes, how they were read, what was asked, whether it was measured."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Literal

from selector import __version__
from selector.number_text import number_text, span_text
from selector.selection import Selection
from selector.telling.account import Account, Captioned, Section, Table, legend, named, table
from selector.telling.numbers import NONE, file_name, given_text, span_range

_UNIT_TEXT = {"degC": "°C", "degF": "°F", "um": "µm", "kelvin": "K", "1": NONE}


def files_table(provenance: Mapping[str, Any]) -> Table | None:
    """One row per run: what is known of its file, SHA-256 last; None if nothing was said about runs."""
    runs = provenance.get("runs")
    if not isinstance(runs, Mapping) or not runs:
        return None
    entries = {str(run): entry if isinstance(entry, Mapping) else {"file": entry} for run, entry in runs.items()}
    keys = list(
        dict.fromkeys(str(key) for entry in entries.values() for key in entry if not isinstance(entry[key], Mapping))
    )
    keys = [key for key in keys if key != "sha256"] + ["sha256"] * ("sha256" in keys)
    names = {"sha256": "SHA-256"}
    return table(
        ["run", *(names.get(key, _words(key)) for key in keys)],
        [
            [run, *(_file(entry[key]) if key == "file" and key in entry else _cell(entry.get(key)) for key in keys)]
            for run, entry in entries.items()
        ],
    )


def remaining_table(provenance: Mapping[str, Any]) -> Table | None:
    """Everything else that the provenance says, one row a fact."""
    rows = [(_words(key), value) for key, value in _facts({k: v for k, v in provenance.items() if k != "runs"})]
    return table(["", ""], rows) if rows else None


def origin_parts(description: Mapping[str, Any], provenance: Mapping[str, Any]) -> list[Captioned]:
    """All that is known of where the data come from and how they were read, none of it for the screen."""
    told = [
        *reading_tables(description),
        ("Files", files_table(provenance)),
        ("Also known", remaining_table(provenance)),
    ]
    return [Captioned(caption, one, on_screen=False) for caption, one in told if one is not None]


def options_table(selection: Selection) -> Table:
    """What was asked, and the version that answered."""
    rows = [(_words(key), _cell(value)) for key, value in selection.options.as_dict().items()]
    return table(["option", "value"], [("selector version", __version__), *rows])


def description_account(description: Mapping[str, Any]) -> Account:
    """What `selector describe` says of recordings."""
    runs, channels = _entries(description.get("runs")), _entries(description.get("channels"))
    roles: dict[str, list[str]] = {}
    for channel in channels:
        roles.setdefault(_words(str(channel["role"])), []).append(str(channel["name"]))
    guessed: dict[str, list[str]] = {}
    for channel in channels:
        for what in channel.get("guessed") or ():
            guessed.setdefault(str(what), []).append(str(channel["name"]))
    lasting, steps = ([run[key] for run in runs if run.get(key)] for key in ("duration_s", "period_s"))
    what = f"{len(runs)} run{'s' * (len(runs) > 1)} of {span_range(lasting)}, a sample every {span_range(steps)}"
    sentences = [
        f"{what}: {named([str(run['run']) for run in runs])}.",
        *(f"{len(names)} × {role}: {named(names)}." for role, names in roles.items()),
        *(
            f"The {_words(what)} of {named(names)} was guessed: if it is wrong, correct it in a machine file."
            for what, names in guessed.items()
        ),
    ]
    tables = [Captioned(caption, one) for caption, one in reading_tables(description, places=False)]
    drift = drift_table(description)
    told = [] if drift is None else [Captioned("Drift after ISO 230-3", drift)]
    return Account(
        "What is in the recordings",
        tuple(sentences),
        (Section("reading", "Reading", tuple(tables)), Section("drift", "Drift", tuple(told))),
        data=description,
        brief=("drift",),
    )


def reading_tables(description: Mapping[str, Any], *, places: bool = True) -> Iterator[tuple[str, Table]]:
    """(caption, table) of the runs, the channels and the way of reading; a screen has no room for places."""
    for caption, key, columns in (("Runs", "runs", _OF_RUNS), ("Channels", "channels", _OF_CHANNELS)):
        shown = {field: of for field, of in columns.items() if places or field != "place"}
        rows = [[cell(one.get(field)) for field, (_, cell) in shown.items()] for one in _entries(description.get(key))]
        if rows:
            yield caption, table([heading for heading, _ in shown.values()], rows)
    reading = description.get("reading")
    if isinstance(reading, Mapping) and reading:
        yield "Way of reading", table(["", ""], list(_facts(reading)))


def drift_table(description: Mapping[str, Any]) -> Table | None:
    """Drift and tilt of every run after ISO 230-3; None if nothing was said of it."""
    runs = _entries(description.get("drift"))
    if not runs:
        return None
    names = list(dict.fromkeys(str(one["name"]) for run in runs for one in run["drifts"]))
    rows = []
    for run in runs:
        told = {str(one["name"]): one for one in run["drifts"]}
        cells = [
            f"{number_text(told[name]['first_hour'])} / {number_text(told[name]['whole'])}" if name in told else NONE
            for name in names
        ]
        rows.append((_cell(run["run"]), _MOVED[run["test"]], _span(run["duration_s"]), *cells))
    units = {str(one["name"]): one["unit"] for run in runs for one in run["drifts"]}
    headings = [f">{name} [{'µm/m' if units[name] == 'um/m' else 'µm'}]" for name in names]
    return table(["run", "moved", ">test of", *headings], rows, legend("origin.drift"))


_MOVED = {"environment": "nothing (ETVE)", "spindle": "spindle", "axes": "axes", "unknown": NONE}


def _entries(value: Any) -> list[Mapping[str, Any]]:
    return [item for item in value if isinstance(item, Mapping)] if isinstance(value, Sequence) else []


def _facts(values: Mapping[str, Any], prefix: str = "", *, of_runs: bool = False) -> Iterator[tuple[str, str]]:
    for key, value in values.items():
        said = f"{prefix}{key if of_runs else _words(key)}"
        if isinstance(value, Mapping) and value:
            yield from _facts(value, f"{said}: ", of_runs=key == "per_run")
        else:
            yield said, _cell(value)


def _cell(value: Any) -> str:
    if value is None or value == "":
        return NONE
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return given_text(value)
    if isinstance(value, Mapping):
        return ", ".join(f"{key}: {_cell(item)}" for key, item in value.items()) or NONE
    if isinstance(value, list | tuple | set | frozenset):
        items = sorted(value, key=str) if isinstance(value, set | frozenset) else value
        return ", ".join(_cell(item) for item in items) or NONE
    return str(value)


def _file(value: Any) -> str:
    return file_name(value) if isinstance(value, str) and value else _cell(value)


def _span(value: Any) -> str:
    return span_text(float(value)) if isinstance(value, int | float) else _cell(value)


def _unit(value: Any) -> str:
    return _UNIT_TEXT.get(str(value), _cell(value))


def _words(key: str) -> str:
    return key.replace("_", " ")


#: Field of a run or a channel → heading of its column, and how its cells are written.
_OF_RUNS: Mapping[str, tuple[str, Callable[[Any], str]]] = {
    "run": ("run", _cell), "file": ("file", _file), "rows": (">rows", _cell), "duration_s": (">duration", _span),
    "period_s": (">step", _span), "start": ("start", _cell),
}  # fmt: skip
_OF_CHANNELS: Mapping[str, tuple[str, Callable[[Any], str]]] = {
    "name": ("channel", _cell), "column": ("column", _cell), "role": ("role", _cell), "unit": ("unit", _unit),
    "unit_in_file": ("unit in file", _unit), "place": ("place", _cell),
    "guessed": ("guessed", lambda value: _cell(value) if value else "nothing"),
}  # fmt: skip

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
