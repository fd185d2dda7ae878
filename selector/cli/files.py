"""How are files written: a folder whole or not at all, and nothing is overwritten by accident."""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
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
    part = Path(tempfile.mkdtemp(prefix=f".{folder.name[:60]}.", suffix=".part", dir=folder.parent))
    try:
        yield part
        if not folder.exists():
            part.chmod(0o777 & ~_umask())
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


@contextmanager
def folder_removed_if_empty(folder: Path) -> Iterator[None]:
    """Takes away a folder that was made inside the block when the block fails and has left it empty."""
    there_before = folder.exists()
    try:
        yield
    except BaseException:
        if not there_before and folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
        raise


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


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
