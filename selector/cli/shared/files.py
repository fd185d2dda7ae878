"""Where do files go: into a folder that is named, and that holds nothing which is read."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from selector.atomic_file import folder_written_whole
from selector.cli.shared.option_table import option
from selector.errors import OptionError
from selector.telling.account import Account


def write_answer(out: Path, texts: Mapping[str, str], account: Account, earlier: Iterable[str] = ()) -> list[str]:
    """Texts by their names and the page of an account into a folder, all or none; the names written."""
    from selector.telling import write_account

    with folder_written_whole(out, earlier) as folder:
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8", newline="\n")
        write_account(account, folder / "report.html")
    return [*texts, "report.html"]


def refuse_folder_of_inputs(out: Path, inputs: Iterable[str | Path]) -> None:
    """What is written must replace no input, and must not be read as a run by the next command.

    Raises OptionError: an input lies in the folder.
    """
    from selector.readers.roles.names import printable_name

    for file in (Path(one) for one in inputs):
        held = file if file.is_dir() else file.absolute().parent
        if out.exists() and file.exists() and out.samefile(held):
            raise OptionError(
                f"this folder holds {printable_name(file.name)}, which is read", where=f"--out {out}",
                expected="a folder that holds no recording, duty cycle or machine file of this command",
                advice="choose another folder, e.g. one inside of it",
            )  # fmt: skip


def written_folder(text: str | Path) -> Path:
    """The folder that an option names. Raises OptionError: it names none."""
    if not str(text).strip():
        raise OptionError(
            "an empty name",
            expected="the name of a folder to write into",
            where="--out",
            advice="e.g. --out results; a variable of your script may be empty",
        )
    return Path(text)


def out_folder(key: str) -> Any:
    """The option --out of a command that writes into a folder, as the table of options has it."""
    return option(key, parser=written_folder)
