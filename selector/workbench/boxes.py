"""Fields of a page that decide options of the same names: what stands in them, and what is read from them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import dash
from dash import Input, Output, State, dcc
from dash.development.base_component import Component
from pydantic import ConfigDict, TypeAdapter, ValidationError

from selector.workbench import parts
from selector.workbench.access import not_sent, of_another_kind
from selector.workbench.bench import Bench


@dataclass(frozen=True)
class Box:
    """A field and the option that it decides."""

    name: str  #: Of the option; the field is ``{page}-{name}``
    title: str
    note: str = ""
    #: What the field holds → the option. Raises OptionError: it cannot be.
    read: Callable[[Any], Any] = lambda text: (text or "").strip()
    shown: Callable[[Any], Any] = str  #: The option → what the field holds
    kind: Any = str | None  #: What a browser may send of it
    control: Callable[[str, Any], Component] = parts.typed_text
    offered: Callable[[], list[Any]] | None = None  #: What can be chosen now, where that is not always the same


def several(name: str, title: str, note: str, offered: Callable[[], list[Any]]) -> Box:
    """A field for some of several names."""
    return Box(name, title, note, lambda names: tuple(names or ()), list, list[str] | None, _many, offered)


def one_of(name: str, title: str, words: Sequence[str], read: Callable[[str], Any] = str) -> Box:
    """A field for one of a few words."""

    def chosen(word: str) -> Any:
        if word not in words:
            raise not_sent(word, f"one of {', '.join(words)}", title)
        return read(word)

    return Box(name, title, "", chosen, str, str, partial(parts.choice, words))


def one_path(name: str, title: str, note: str, paths: Callable[[], Mapping[str, str]]) -> Box:
    """A field for one of these paths, or none; they are offered by their names."""

    def chosen(path: str | None) -> str:
        return path if path is not None and path in paths() else ""

    def offered() -> list[Any]:
        return [{"label": label, "value": path} for path, label in paths().items()]

    def menu(box: str, value: str | None) -> Component:
        return dcc.Dropdown(id=box, options=offered(), value=value)

    return Box(name, title, note, chosen, lambda path: path or None, str | None, menu, offered)


def tick(name: str, title: str) -> Box:
    """A field that is ticked or not; it says its title itself."""

    def ticked(box: str, value: list[str]) -> Component:
        return dcc.Checklist(id=box, options=[{"label": title, "value": "yes"}], value=value)

    return Box(name, title, "", bool, lambda is_so: ["yes"] * is_so, list[str], ticked)


def _many(box: str, value: list[str]) -> Component:
    return dcc.Dropdown(id=box, options=value, value=value, multi=True)


def _of_kind(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind, config=ConfigDict(strict=True))


def _require(kind: TypeAdapter[Any], value: Any, where: str) -> None:
    try:
        kind.validate_python(value)
    except ValidationError as error:
        raise of_another_kind(error, where) from None


@dataclass(frozen=True)
class Boxes:
    """The fields of a page, what they decide, and who hears of it."""

    page: str
    boxes: tuple[Box, ...]
    asked: Callable[[], Any]  #: The options as they are
    choose: Callable[..., bool]  #: Takes options by their names; whether any is different. Raises OptionError.

    def fields(self, of: Sequence[str] = ()) -> list[Component]:
        """The controls of these options, or of all, with their titles and notes."""
        chosen = [(box, f"{self.page}-{box.name}") for box in self.boxes if not of or box.name in of]
        made = [(box, box.control(place, box.shown(getattr(self.asked(), box.name)))) for box, place in chosen]
        return [
            made if isinstance(made, dcc.Checklist) else parts.field(box.title, made, box.note) for box, made in made
        ]

    def followed(self) -> Component:
        """Where the page keeps what the fields showed last."""
        return dcc.Store(id=f"{self.page}-followed", data=self.counting())

    def counting(self) -> list[Any]:
        """What stands in the fields when they say what counts."""
        asked = self.asked()
        return [box.shown(getattr(asked, box.name)) for box in self.boxes]

    def register(self, app: dash.Dash, bench: Bench) -> parts.Form:
        """What is changed goes to the bench at once, and what other pages change comes into the fields; the form."""
        places = [f"{self.page}-{box.name}" for box in self.boxes]
        kinds = [_of_kind(box.kind) for box in self.boxes]

        def take(*sent: Any) -> None:
            for box, kind, value in zip(self.boxes, kinds, sent, strict=True):
                _require(kind, value, box.title)
            with parts.typed_over(places, sent, self.counting) as read:
                now = self.asked()
                pairs = zip(self.boxes, sent, strict=True)
                values = {box.name: read(partial(box.read, of), getattr(now, box.name)) for box, of in pairs}
                if self.choose(**values):
                    parts.tell(bench)

        @app.callback(
            Output(f"{self.page}-followed", "data"),
            Input(parts.REVISION, "data"),
            State(f"{self.page}-followed", "data"),
            *(State(place, "value") for place in places),
        )
        def _follow(_: int, before: list[Any], *shown: Any) -> list[Any]:
            now = self.counting()
            # in one answer with the values: a menu takes back a value that it does not offer yet
            for box, place in zip(self.boxes, places, strict=True):
                if box.offered is not None:
                    dash.set_props(place, {"options": box.offered()})
            parts.follow(places, shown, before, now)
            return now

        form = parts.Form(tuple((place, "value") for place in places), take)
        form.register(app)
        return form


@dataclass(frozen=True)
class Column:
    """A field in every row of a table whose rows have names."""

    kind: str  #: The field is ``{"type": f"{page}-{kind}", "name": name}``
    #: What a field holds, and the name of its row → the value. Raises OptionError: it cannot be.
    read: Callable[[Any, str], Any]
    now: Callable[[str], Any]  #: Name → the value that counts
    shown: Callable[[Any], Any] = str  #: Value → what the field holds
    sent: Any = str | None  #: What a browser may send of it


@dataclass(frozen=True)
class Rows:
    """The fields of a table, and what takes them over."""

    page: str
    columns: tuple[Column, ...]
    names: Callable[[], Sequence[str]]
    choose: Callable[[dict[str, dict[str, Any]]], bool]  #: Kind → name → value; whether any is different

    def boxes(self, name: str) -> list[dict[str, str]]:
        """Ids of the fields of a row."""
        return [{"type": f"{self.page}-{column.kind}", "name": name} for column in self.columns]

    def counting(self) -> dict[str, list[Any]]:
        """Name → what stands in its fields when they say what counts."""
        return {name: [column.shown(column.now(name)) for column in self.columns] for name in self.names()}

    def followed(self) -> Component:
        """Where the page keeps what the fields showed last."""
        return dcc.Store(id=f"{self.page}-{self.columns[0].kind}-followed", data={})

    def register(self, app: dash.Dash, bench: Bench) -> parts.Form:
        """As `Boxes.register`."""
        fields: list[parts.Place] = [(one | {"name": dash.ALL}, "value") for one in self.boxes("")]
        ids = (fields[0][0], "id")
        kinds = [_of_kind(list[column.sent]) for column in self.columns]  # type: ignore[name-defined]
        of_ids = _of_kind(list[dict[str, str]])

        def rows_of(columns: Sequence[Any], ids: list[dict[str, str]]) -> dict[str, list[Any]]:
            return {one["name"]: shown for one, *shown in zip(ids, *columns, strict=True)}

        def take(*sent: Any) -> None:
            *columns, named = sent
            for kind, value in zip([*kinds, of_ids], sent, strict=True):
                _require(kind, value, self.page)
            known = set(self.names())
            rows = {name: row for name, row in rows_of(columns, named).items() if name in known}
            boxes = [box for name in rows for box in self.boxes(name)]

            def counting() -> list[Any]:
                now = self.counting()
                return [text for name in rows for text in now[name]]

            with parts.typed_over(boxes, [text for row in rows.values() for text in row], counting) as read:
                values = {
                    column.kind: {
                        name: read(partial(column.read, row[k], name), column.now(name)) for name, row in rows.items()
                    }
                    for k, column in enumerate(self.columns)
                }
                if rows and self.choose(values):
                    parts.tell(bench)

        store = f"{self.page}-{self.columns[0].kind}-followed"

        @app.callback(
            Output(store, "data"), Input(parts.REVISION, "data"), State(store, "data"), State(*ids),
            *(State(*field) for field in fields),
        )  # fmt: skip
        def _follow(_: int, before: dict[str, Any], ids: list[dict[str, str]], *columns: Any) -> dict[str, list[Any]]:
            now = self.counting()
            for name, shown in rows_of(columns, ids).items():
                # a row that is new is about to be shown
                if name in now and name in before:
                    parts.follow(self.boxes(name), shown, before[name], now[name])
            return now

        form = parts.Form(tuple(fields), take, (ids,))
        form.register(app)
        return form
