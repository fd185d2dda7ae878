"""How are results written and shown: files in a folder, JSON on stdout for programs, tables and findings for people."""

from __future__ import annotations

import codecs
import io
import os
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Annotated, Any, Literal

from selector.atomic_file import folder_written_whole, require_writable_folder
from selector.cli.shared.option_table import option
from selector.errors import OptionError
from selector.findings import Finding
from selector.json_text import json_text as json_text
from selector.number_text import number_text
from selector.telling.account import Account, Captioned, Heading, Note, Paragraph, grouped_remarks, remarks_of


def write_answer(out: Path, texts: Mapping[str, str], account: Account, earlier: Iterable[str] = ()) -> list[str]:
    """Texts by their names and the page of an account into a folder, all or none; the names written."""
    from selector.telling import write_account

    with folder_written_whole(out, earlier) as folder:
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8", newline="\n")
        write_account(account, folder / "report.html")
    return [*texts, "report.html"]


def require_folder(out: Path | None, inputs: Iterable[str | Path], results: Iterable[str] = ()) -> None:
    """What is written must replace no input, and must not be read as a run by the next command.

    Raises OptionError: an input lies in the folder, or `results` cannot be written there. Nothing if none is given.
    """
    from selector.readers.roles.names import printable_name

    if out is None:
        return
    require_writable_folder(out, "--out", results)
    for file in (Path(one) for one in inputs):
        held = file if file.is_dir() else file.absolute().parent
        if out.exists() and file.exists() and out.samefile(held):
            raise OptionError(
                f"this folder holds {printable_name(file.name)}, which is read", where=f"--out {out}",
                expected="a folder that holds no recording, duty cycle or machine file of this command",
                advice="choose another folder, e.g. one inside of it",
            )  # fmt: skip


if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

AsJson = Annotated[bool, option("answers --json")]

_WIDTH_WITHOUT_TERMINAL = 140
_STYLES = {"info": "cyan", "warning": "yellow", "error": "bold red"}
_SIGNS = ("−-", "–-", "→->", "·*", "Δd", "λlambda", "τtau", "µu", "²2", "³3", "≥>=", "≤<=", "….", "×x", "√sqrt", "≈~")
_SPELLINGS = {sign[0]: sign[1:] for sign in _SIGNS}


def _spelt_out(error: UnicodeError) -> tuple[str, int]:
    """Signs that a code page lacks, in letters that every one has."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(_SPELLINGS.get(sign, "?") for sign in error.object[error.start : error.end]), error.end


_SPELT_OUT = "selector.spelt-out"
codecs.register_error(_SPELT_OUT, _spelt_out)


def print_json(value: Any) -> None:
    """Writes JSON and a line end to stdout, in UTF-8 whatever the terminal's code page is."""
    text = json_text(value) + "\n"
    sys.stdout.flush()
    buffer = getattr(sys.stdout, "buffer", None)
    if buffer is None:
        sys.stdout.write(text)
    else:
        buffer.write(text.encode("utf-8", "backslashreplace"))
    sys.stdout.flush()


def screen(as_json: bool = False) -> Console:
    """Where people read: stdout, or stderr when stdout belongs to the JSON."""
    from rich.console import Console

    stream = sys.stderr if as_json else sys.stdout
    if isinstance(stream, io.TextIOWrapper):
        # a code page that lacks a letter must not end the program, nor swallow the sign of a number
        stream.reconfigure(errors=_SPELT_OUT)
    wide = None if stream.isatty() or "COLUMNS" in os.environ else _WIDTH_WITHOUT_TERMINAL
    return Console(file=stream, width=wide, soft_wrap=False, highlight=False, emoji=False)


def table(
    title: str, columns: Iterable[str], rows: Iterable[Iterable[object]], numeric: Iterable[str] = (),
    whole: Iterable[str] = (), *, is_brief: bool = False,
) -> Table:  # fmt: skip
    """A table of plain text; columns in `numeric` are aligned to the right, those and `whole` ones are never broken."""
    from rich.text import Text

    from selector.cli.shared.fitted_table import FittedTable

    right, unbroken = set(numeric), set(whole)
    shown = FittedTable(title, is_brief=is_brief)
    for column in columns:
        justify: Literal["left", "right"] = "right" if column in right else "left"
        shown.add_column(Text(column), justify=justify, overflow="fold", no_wrap=column in unbroken)
    shown.show_header = any(str(column.header) for column in shown.columns)
    for row in rows:
        shown.add_row(*(Text(cell_text(cell)) for cell in row))
    return shown


def cell_text(value: object) -> str:
    """A value as a person reads it in a table: numbers as everywhere, a dash for "none"."""
    return number_text(value) if value is None or isinstance(value, float) else _harmless(str(value))


def _harmless(text: str) -> str:
    """Text without the control characters with which a file's name could steer the terminal."""
    return "".join(sign if sign.isprintable() or sign in "\n\t" else "?" for sign in text)


#: Rows of a table, and findings, that are shown; a page and the JSON have all. In brief a table alone may have more.
MOST_ROWS, MOST_ROWS_IN_BRIEF, MOST_ALONE, MOST_FINDINGS, MOST_INFO = 20, 6, 12, 5, 2
#: Lines of an answer, which leave two of 40 for files; of sentences and tables; rows from which on a table is begun;
#: findings that are shown however long they are.
MOST_SCREEN, MOST_LINES, LEAST_ROWS, LEAST_FINDINGS = 38, 28, 3, 2

Everything = Annotated[bool, option("answers --all")]


def show_account(
    console: Console, account: Account, *, everything: bool = False, most_lines: int = 10**6, rest: str = "--json"
) -> bool:
    """What an account says, in sentences and in the tables that answer the question; what several note is said once.

    Of `most_lines` those tables are shown, the first ones, that there is room for; returned is whether some were not.
    `rest` is the option that shows the rows which are left out.
    """
    console.print(_harmless(account.title), style="bold", markup=False, soft_wrap=True)
    for sentence in account.sentences:
        console.print(_harmless(sentence), markup=False)
    console.print()
    is_brief = not everything and account.brief is not None
    chosen = [one for one in account.sections if not is_brief or one.id in (account.brief or ())]
    tables = [one for of in chosen for one in of.blocks if isinstance(one, Captioned) and one.on_screen]
    most = None if everything else MOST_ROWS
    if is_brief:
        most = MOST_ROWS_IN_BRIEF if account.answer is not None or len(tables) > 1 else MOST_ALONE
    room = max(most_lines - _height(console, *account.sentences), MOST_ROWS_IN_BRIEF)
    # what notes explain is looked up
    known = [block.table for section in account.sections for block in section.blocks if isinstance(block, Captioned)]
    noted = {one.note for one in (account.answer, *known) if one is not None and is_brief}
    if account.answer is not None:
        numbers = Captioned("In numbers", account.answer)
        show_captioned(console, numbers, "", most=most, noted=noted, rest=rest)
        room -= len(console.render_lines(_table_of(numbers, "In numbers", most), pad=False))
    is_whole, is_begun = True, False
    for section in chosen:
        for block in section.blocks:
            if isinstance(block, Captioned) and block.on_screen and block.table.rows:
                note = "" if block.table.note in noted else block.table.note
                fit, room = (None, room) if most is None else _within(console, block, room, most, note)
                # what answers first is begun in any case
                fit, is_begun = (fit if is_begun or fit != 0 else LEAST_ROWS), True
                is_whole &= is_brief or fit is None or fit >= len(block.table.rows)
                if fit != 0:
                    show_captioned(console, block, section.title, most=fit, noted=noted, rest=rest)
            elif isinstance(block, Heading) and block.on_screen:
                console.print(_harmless(block.text), style="bold", markup=False)
            elif isinstance(block, Note | Paragraph) and block.on_screen:
                # the sentences of the answer may have it already
                if any(block.text.rstrip(".") in sentence for sentence in account.sentences):
                    continue
                lead = f"{block.lead} " if isinstance(block, Paragraph) and block.lead else ""
                console.print(_harmless(lead + block.text), "", sep="\n", markup=False)
    return is_whole


def _within(console: Console, told: Captioned, room: int, most: int, note: str) -> tuple[int, int]:
    """How many rows of a table there is room for, and how many lines are left then."""
    n = len(told.table.rows)
    for rows in range(min(n, most, room), min(n, LEAST_ROWS) - 1, -1):
        lines = len(console.render_lines(_table_of(told, told.caption, rows), pad=False))
        left = room - lines - (_height(console, note, "") if note or rows < n else 0)
        if left >= 0:
            return rows, left
    return 0, room


def _height(console: Console, *texts: str) -> int:
    from rich.text import Text

    return sum(len(console.render_lines(Text(text), pad=False)) for text in texts)


def show_answer(console: Console, account: Account, findings: Iterable[Finding], *, everything: bool) -> None:
    """What an account says, the findings of the answer, and where the rest is."""
    told = tuple(findings)

    def show(room: int, most: int) -> None:
        is_whole = show_account(console, account, everything=everything, most_lines=room, rest="--all")
        show_findings(console, told, everything=everything, more=account.brief is not None or not is_whole, most=most)

    # tables are cut first, then the findings that weigh least
    room, most = MOST_LINES if account.brief is None else MOST_SCREEN, MOST_FINDINGS
    while not everything:
        with console.capture() as whole:
            show(room, most)
        if whole.get().count("\n") <= MOST_SCREEN or most == LEAST_FINDINGS:
            break
        room, most = (max(room - 1, MOST_ROWS_IN_BRIEF), most) if room > MOST_ROWS_IN_BRIEF else (room, most - 1)
    show(room, most)


def give_answer(
    account: Account, findings: Iterable[Finding], out: Path | None, json_file: str, *, everything: bool, as_json: bool,
    beside: Mapping[str, str] | None = None, earlier: Iterable[str] = (),
) -> None:  # fmt: skip
    """Writes JSON, page and the files `beside` them to `out`, then shows the answer, or its JSON.

    `beside` is name → text; files named `earlier` are of an earlier answer and go.
    """
    texts = {json_file: json_text(account.data) + "\n", **(beside or {})}
    written = [] if out is None else write_answer(out, texts, account, earlier)
    if as_json:
        print_json(account.data)
    else:
        show_answer(screen(), account, findings, everything=everything)
    if out is not None:
        show_written(screen(as_json), out, written)


def show_written(console: Console, place: PurePath, names: Iterable[str] = ()) -> None:
    """Which file was written, or which ones to a folder."""
    console.print(f"wrote {place}: {', '.join(names)}" if names else f"wrote {place}", markup=False)


def show_captioned(
    console: Console, told: Captioned, otherwise: str, *, most: int | None = None, noted: set[str] | None = None,
    rest: str = "",
) -> None:  # fmt: skip
    """A table under its caption, or `otherwise`, with at most so many rows; and its note, unless that was `noted`."""
    rows, said = told.table.rows, set() if noted is None else noted
    console.print(_table_of(told, told.caption or otherwise, most))
    left = 0 if most is None else max(0, len(rows) - most)
    more = f"{left} more rows are not shown; {rest} has them. " if left else ""
    note = more + ("" if told.table.note in said else told.table.note)
    if note:
        console.print(_harmless(note), "", sep="\n", style="dim", markup=False)
    said.add(told.table.note)


def _table_of(told: Captioned, title: str, most: int | None) -> Table:
    columns = told.table.columns
    numeric = [column.name for column in columns if column.numeric]
    return table(title, [column.name for column in columns], told.table.rows[:most], numeric, is_brief=most is not None)


def show_findings(
    console: Console, findings: Iterable[Finding], *, everything: bool = False, more: bool = False,
    most: int = MOST_FINDINGS,
) -> None:  # fmt: skip
    """The worst findings, those of one kind as one, or everything; last where the rest is, if there is `more`."""
    from rich.text import Text

    findings = tuple(findings)
    remarks = remarks_of(findings).remarks if everything else grouped_remarks(findings)
    # what is only good to know fills up what little there is
    urgent = sum(remark.level != "info" for remark in remarks)
    shown = remarks if everything else remarks[: min(max(urgent, MOST_INFO), most)]
    for remark in shown:
        line = Text()
        line.append(f"{remark.level}", style=_STYLES[remark.level])
        place = "" if all(part in remark.statement for part in remark.place.split(", ")) else f" ({remark.place})"
        line.append(_harmless(f"{place}: {remark.statement}"))
        # many suggestions say themselves what is left out
        action = "" if "left out" in remark.suggestion else remark.action
        for told in (action, remark.suggestion):
            if told and (everything or remark.level != "info"):
                line.append(f"\n    → {told}")
        console.print(line)
    left = len(remarks) - len(shown)
    if not everything and (left or more or len(findings) > len(remarks)):
        others = f"{left} more kinds of finding and " if left > 1 else "one more kind of finding and " if left else ""
        console.print(f"--all shows {others}everything else that is known.", style="dim", markup=False)
