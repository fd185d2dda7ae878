"""A file that is written whole or not at all."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

from selector.errors import OptionError


def write_whole(path: Path, content: bytes) -> None:
    """Write `content` to `path`; a reader sees the old file or the new one, never a part.

    The new file is made beside the old one and then takes its name, in one step.

    Raises
    ------
    OptionError
        The folder does not exist, or nothing can be written there; the old file is untouched.
    """
    draft = path.with_name(f".{path.name[:60]}.{secrets.token_hex(8)}.part")
    try:
        try:
            with draft.open("xb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            draft.replace(path)
        finally:
            draft.unlink(missing_ok=True)
    except OSError as error:
        raise OptionError(
            f"the file cannot be written: {error.strerror or error}",
            expected="a path in an existing folder where you may write",
            where=str(path),
            advice="give another output path, or close the program that has the file open",
        ) from error
