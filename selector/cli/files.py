"""How are files written: a folder whole or not at all, and nothing is overwritten by accident."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from selector.errors import OptionError


@contextmanager
def folder_written_whole(folder: Path) -> Iterator[Path]:
    """An empty folder to write into; it takes the place of `folder` when the block ends without an error.

    If `folder` exists, files of the same name are replaced and others stay. When the block fails, or is stopped,
    `folder` is left as it was.
    """
    folder = Path(os.path.abspath(folder))  # noqa: PTH100 (resolve() would follow a link and replace its target's name)
    folder.parent.mkdir(parents=True, exist_ok=True)
    if folder.exists() and not folder.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "not a folder", str(folder))
    # named before it is made, so that a Ctrl-C at any moment finds it again
    part = folder.parent / f".{folder.name[:60]}.{secrets.token_hex(8)}.part"
    try:
        part.mkdir()
        yield part
        if not folder.exists():
            part.rename(folder)
            return
        for source in sorted(part.rglob("*")):
            target = folder / source.relative_to(part)
            if source.is_dir():
                target.mkdir(exist_ok=True)
            else:
                source.replace(target)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def refuse_to_overwrite(path: Path, *, force: bool, option: str) -> None:
    """Ends with an error when the file exists and the user did not say ``--force``.

    Raises
    ------
    OptionError
        The file exists.
    """
    if path.exists() and not force:
        raise OptionError(
            "a file of this name exists already",
            expected="a name that is free, because the file may hold corrections made by hand",
            where=f"{option} {path}",
            advice="choose another name, or add --force to replace the file",
        )
