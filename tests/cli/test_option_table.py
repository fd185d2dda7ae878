"""The table of options says what the commands have, and nothing else."""

from collections import Counter
from pathlib import Path

from docs.make_command_line import commands
from selector.cli.shared import option_table


def heads() -> list[tuple[str, list[str]]]:
    """(head, lines of the text) of every entry, read without the reader of the program."""
    found: list[tuple[str, list[str]]] = []
    for line in Path(option_table.__file__).with_suffix(".txt").read_text(encoding="utf-8").splitlines():
        if line.startswith(" " * 8):
            found[-1][1].append(line.strip())
        elif line.startswith(" " * 4):
            found.append((line.strip(), []))
    return found


def test_every_entry_is_an_option_of_a_command():
    said = {
        (" ".join([*(one.opts if one.param_type_name == "option" else ()), *filter(None, [one.metavar])]), one.help)
        for _, command in commands()
        for one in command.params
    }
    # that of the program itself belongs to no command
    unused = [head for head, text in heads() if (head, " ".join(text)) not in said and head != "--version"]
    assert not unused


def test_no_entry_stands_twice_below_a_command():
    table = Path(option_table.__file__).with_suffix(".txt").read_text(encoding="utf-8")
    command, seen = "", Counter()
    for line in table.splitlines():
        if line.startswith(" " * 4) and not line.startswith(" " * 8):
            seen[command, line.split()[0]] += 1
        elif line and not line.startswith(" "):
            command = line.partition(":")[0]
    assert max(seen.values()) == 1


def names(made) -> tuple[str, ...]:
    """Of an option; typer keeps the first one of an annotated option in the place of its default."""
    return (made.default, *made.param_decls)


def test_entries_with_panel_names_and_limits():
    warm_up = option_table.option("predict --warm-up", min=5.0)
    assert (names(warm_up), warm_up.metavar, warm_up.min) == (("--warm-up",), "MIN", 5.0)
    assert warm_up.rich_help_panel == "Correction program"
    page = option_table.option("fleet watch --out")
    assert (names(page), page.metavar, page.rich_help_panel) == (("--out", "-o"), "FILE.html", None)
    band = option_table.option("taps --band")
    assert (names(band), band.metavar) == (("--band",), "HZ HZ")
    assert band.help == "Frequencies that count; default: up to twice the highest mode."
    assert option_table.argument("effects [ID]").metavar == "[ID]"
