"""The C compiler of this machine, and the libraries that it makes of generated sources."""

import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from selector.errors import NotExecutableError

OPTIONS = ("-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared")

_Taken = TypeVar("_Taken")


def compiler() -> str | None:
    """The C compiler of this machine: $CC, cc, gcc or clang."""
    for name in (os.environ.get("CC"), "cc", "gcc", "clang"):
        if name and shutil.which(name):
            return name
    return None


def compiler_version(of: str | None) -> str:
    """The first line that the compiler says about itself."""
    if of is None:
        return "no compiler"
    try:
        said = subprocess.run([of, "--version"], capture_output=True, text=True, check=False).stdout  # noqa: S603
    except OSError:
        said = ""
    return (said.splitlines() or [of])[0].strip()


def compiled(cc: str | None, sources: tuple[tuple[str, str], ...], take: Callable[[Path], _Taken]) -> _Taken:
    """What `take` makes of the library of C sources, (file, text); the first is compiled, it includes the others.

    Raises NotExecutableError: there is no compiler, it does not run, or it refuses them.
    """
    if cc is None:
        raise NotExecutableError(
            "no C compiler",
            expected="cc, gcc or clang on the path, or its name in the environment variable CC",
            where="--replay",
            advice="install one (Debian: apt install gcc), or export without --replay",
        )
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as path:
        folder = Path(path)
        for file, text in sources:
            (folder / file).write_text(text, encoding="ascii")
        # with an ending: compilers and loaders of Windows would add one of their own
        library = folder / "library.so"
        # it runs in another folder
        command = [str(Path(shutil.which(cc) or cc).absolute()), *OPTIONS, "-o", library.name, sources[0][0]]
        try:
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)  # noqa: S603
            said = done.stderr.strip().splitlines() or ["no library, and no reason"]
        except OSError as error:
            said = [str(error)]
        if not library.exists():
            raise NotExecutableError(
                f"{cc} refuses {sources[-1][0]}: {next((line for line in said if 'error' in line), said[0])}",
                expected="a C99 compiler for this machine",
                where="--replay",
                advice="name another compiler in the environment variable CC",
            )
        return take(library)
