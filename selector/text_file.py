"""A text file that somebody names: opened only if it is one, and read only as far as it may be long."""

from collections.abc import Callable
from pathlib import Path

from selector.errors import InputError


def text_of(path: Path, most_bytes: int, refused: Callable[[str], InputError]) -> str:
    """The text in a file: UTF-8, with or without a byte order mark, lines ended by LF; `refused` makes the error.

    Raises
    ------
    InputError
        There is no such file, it cannot be opened, is none (a folder, a pipe), is too long, or no UTF-8.
    """
    if path.exists() and not path.is_file():
        # opening a pipe would wait for ever
        what = "a folder" if path.is_dir() else "not a regular file but a device, a pipe or a socket"
        raise refused(what)
    try:
        with path.open("rb") as file:
            content = file.read(most_bytes + 1)
    except (OSError, ValueError) as error:
        raise refused(f"a file that cannot be opened ({getattr(error, 'strerror', None) or error})") from error
    if len(content) > most_bytes:
        raise refused(f"a file of more than {most_bytes // 1_000_000} MB")
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise refused(f"text that is not UTF-8 at byte {error.start} ({content[error.start]:#04x})") from None
