"""Where do files go: into a folder that is named, and that holds nothing which is read."""

from collections.abc import Iterable, Mapping
from pathlib import Path

from selector.atomic_file import folder_written_whole, require_writable_folder
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
