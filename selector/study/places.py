"""Where the files of a study lie: paths as they stand in study.toml, and on this machine."""

from __future__ import annotations

import hashlib
import os
from contextlib import suppress
from pathlib import Path

from selector.errors import ReadError
from selector.study.study_file import InputFile, Kind

_PIECE_BYTES = 1 << 20


def reference_to(path: str | Path, folder: str | Path) -> str:
    """How a study file in `folder` names `path`: relative, with ``/``; absolute only between two drives.

    Links on the way are followed, because ``..`` behind a link leads elsewhere; a link at the end keeps its name.

    Raises
    ------
    UnicodeEncodeError
        The path has bytes that are no text, and TOML holds only text.
    """
    target = os.path.abspath(path)  # noqa: PTH100 (resolve() would follow a link at the end)
    parent, name = os.path.split(target)
    place = Path(os.path.realpath(parent)) / name if name else Path(target)
    # there is no way to another drive
    with suppress(ValueError):
        place = Path(os.path.relpath(place, os.path.realpath(folder)))
    reference = place.as_posix()
    reference.encode("utf-8")
    return reference


def path_at(reference: str, folder: str | Path) -> Path:
    """The path that a study file in `folder` means; ``~`` and variables are letters like all others."""
    return Path(os.path.normpath(Path(os.path.realpath(folder)) / reference))


def input_file(path: str | Path, folder: str | Path, kind: Kind = "recording", sha256: str | None = None) -> InputFile:
    """The entry of a file in a study of `folder`; `sha256` if it is known already.

    Raises
    ------
    ReadError
        The file cannot be read.
    """
    found = sha256_of(Path(path)) if sha256 is None else sha256
    return InputFile(path=reference_to(path, folder), sha256=found, kind=kind)


def sha256_of(path: Path) -> str:
    """SHA-256 of the bytes of a file, 64 hexadecimal digits.

    Raises
    ------
    ReadError
        The file cannot be read, or is none: reading a pipe would wait for ever.
    """
    try:
        if not path.is_file():
            raise ReadError(
                "no file",
                expected="a file that is read by a study",
                where=str(path),
                advice="correct the path",
            )
        digest = hashlib.sha256()
        with path.open("rb") as file:
            while piece := file.read(_PIECE_BYTES):
                digest.update(piece)
    except OSError as error:
        raise ReadError(
            f"a file that cannot be opened ({error.strerror or error})",
            expected="a file that is read by a study",
            where=str(path),
            advice="check the path and the rights to read it",
        ) from error
    return digest.hexdigest()
