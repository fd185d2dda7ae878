"""Where the files of a study are: one folder, safe names in it, and no way out of it."""

import os
import re
import secrets
import unicodedata
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from selector.errors import OptionError, ReadError

RECORDINGS, SIMULATION, MACHINE = "recordings", "simulation", "machine.toml"
MACHINE_BEFORE = "machine.before.toml"
PICTURES, MODELS, CIRCLES, TAP_TESTS = "pictures", "models", "circles", "tap-tests"
UPLOADS = (RECORDINGS, SIMULATION, PICTURES, MODELS, CIRCLES, TAP_TESTS)
CYCLE = "cycle.csv"  #: The duty cycle of a prediction
REMOVED = "removed"  #: Where files go that are removed on a page: they may be measured data
MOST_UPLOADED_BYTES = 200_000_000

#: File systems take 255 bytes, Windows 260 characters with all folders; a number may be added.
_LONGEST_NAME, _LONGEST_NAME_BYTES = 121, 200
_PIECE_BYTES = 1 << 20
_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)


def new_folder(place: Path) -> Path:
    """``selector-study`` in `place`, with a number where that exists: an earlier study is never written into."""
    folder, count = place / "selector-study", 1
    while folder.exists():
        count += 1
        folder = place / f"selector-study-{count}"
    return folder


def safe_name(said: str) -> str:
    r"""The name under which a file that a browser sent is stored: letters, digits, ``.``, ``-``, ``_``, blanks.

    A path loses its folders; what no file system takes becomes ``_``; a name that Windows reserves gets a ``_``; one
    that is too long is cut before its ending.

    >>> safe_name("..\\..\\etc/passwd"), safe_name("día 1 (warm).csv"), safe_name("con.csv"), safe_name("...")
    ('passwd', 'día 1 _warm_.csv', '_con.csv', 'recording')
    """
    last = re.split(r"[/\\]", unicodedata.normalize("NFC", said))[-1]
    kept = re.sub(r"[^\w.\- ]", "_", last).strip(" .")
    stem, dot, ending = kept.rpartition(".")
    if dot and len(ending) <= 10:
        kept = _cut(stem, dot + ending).rstrip(" .") + dot + ending
    kept = _cut(kept).strip(".-~ ") or "recording"
    return f"_{kept}" if _RESERVED.fullmatch(kept) else kept


def _cut(text: str, ending: str = "") -> str:
    """The beginning of a name that has room with this ending, in whole characters."""
    short = text[: _LONGEST_NAME - len(ending)].encode()[: _LONGEST_NAME_BYTES - len(ending.encode())]
    return short.decode(errors="ignore")


def free_name(folder: Path, name: str) -> str:
    """`name`, or with a number before its ending where a file of that name is in the folder, whatever its case."""
    taken = {entry.name.casefold() for entry in folder.iterdir()} if folder.is_dir() else set()
    stem, dot, ending = name.rpartition(".")
    free, count = name, 1
    while free.casefold() in taken:
        count += 1
        free = f"{stem}_{count}{dot}{ending}" if dot else f"{name}_{count}"
    return free


def put_away(folder: Path, path: Path) -> None:
    """Moves a file of a study folder to `REMOVED` in it, under a name that is free there.

    Raises OptionError: the file cannot be moved.
    """
    place = folder / REMOVED
    try:
        place.mkdir(exist_ok=True)
        path.rename(place / free_name(place, path.name))
    except OSError as error:
        raise OptionError(
            f"{path.name} cannot be moved ({error.strerror or error})", expected="a file that no program holds open",
            where=str(place), advice="close the programs that have it open, or remove it by hand",
        ) from error  # fmt: skip


def inside(folder: Path, relative: str) -> Path | None:
    """The file that `relative` names in `folder`, all links followed; None: it is not there, or not in it."""
    try:
        root, path = folder.resolve(), (folder / relative).resolve()
        return path if path.is_relative_to(root) and path.is_file() else None
    except (OSError, RuntimeError, ValueError):
        # links that lead to themselves, names that no file system takes
        return None


def files_in(folder: Path) -> tuple[Path, ...]:
    """The files in a folder that are there, by name; none if there is no such folder."""
    if not folder.is_dir():
        return ()
    return tuple(sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith(".")))


def stored(folder: Path, said: str, read: Callable[[int], bytes], length: int | None) -> Path:
    """Writes a file that a browser sends into `folder` under a safe, free name; whole or not at all.

    `read` gives the next bytes, at most so many, none at the end; `length` bytes were announced.

    Raises ReadError: there are more bytes than `MOST_UPLOADED_BYTES`, or fewer than were announced. Raises OptionError:
    the folder takes no file: the disk is full, it is gone, or nobody may write there.
    """
    name = safe_name(said)
    if length is not None and length > MOST_UPLOADED_BYTES:
        raise _too_large(name)
    part = folder / f".{secrets.token_hex(8)}.part"
    received = 0
    try:
        # a study folder that was removed is not made again behind the user's back
        folder.mkdir(exist_ok=True)
        with part.open("xb") as stream:
            while piece := read(_PIECE_BYTES):
                received += len(piece)
                if received > MOST_UPLOADED_BYTES:
                    raise _too_large(name)
                stream.write(piece)
        if length is not None and received != length:
            raise ReadError(
                f"only {received} of {length} bytes arrived",
                expected="the whole file",
                where=name,
                advice="send it again",
            )
        while True:
            path = folder / free_name(folder, name)
            try:
                # a link fails where the name was taken meanwhile, a move would replace that file
                os.link(part, path)
            except FileExistsError:
                continue
            except OSError:
                part.rename(path)
            return path
    except ConnectionError:
        raise
    except OSError as error:
        raise OptionError(
            f"{name} cannot be stored ({error.strerror or error})",
            expected="a study folder that is there, and that takes files of this size",
            where=str(folder),
            advice="make room on the disk, or let the folder be written to, and send the file again",
        ) from error
    finally:
        # where the folder is, or is none
        with suppress(OSError):
            part.unlink()


def _too_large(name: str) -> ReadError:
    return ReadError(
        f"a file of more than {MOST_UPLOADED_BYTES // 1_000_000} MB",
        expected="a smaller file, or one that is named on the command line",
        where=name,
        advice="start the workbench with it: selector workbench FILE; then it is read where it is",
    )


def trouble_with(folder: Path) -> OptionError | None:
    """Why a study folder that was in use can be used no more; None: it can."""
    if not folder.is_dir():
        return OptionError(
            "the study folder is gone: it was removed or renamed, or its drive is not there",
            expected="the folder in which the workbench was started",
            where=str(folder),
            advice="put it back under this name and start again; or end the workbench (Ctrl-C) and start it in another "
            "folder: selector workbench --folder NEW. Recordings that were dropped into the page were in it",
        )
    try:
        _probe(folder)
    except OSError as error:
        return OptionError(
            f"nothing can be written into the study folder ({error.strerror or error})",
            expected="a folder in which files can be made",
            where=str(folder),
            advice="let the folder be written to, or make room on the disk, and start again; what is there stays",
        )
    return None


def require_usable(folder: Path) -> Path:
    """The folder, made if it is missing. Raises OptionError: it is a file, or cannot be written to."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _probe(folder)
    except OSError as error:
        raise OptionError(
            f"{folder} cannot be used ({error.strerror})",
            expected="a folder in which files can be made, or a name that is free",
            where="--folder",
            advice="choose another folder",
        ) from error
    return folder.resolve()


def _probe(folder: Path) -> None:
    probe = folder / f".{secrets.token_hex(8)}.part"
    probe.touch()
    probe.unlink()


def no_recordings(where: str) -> OptionError:
    """That there is nothing to work on yet."""
    advice = "load some on the page Recordings, which also says what is wrong with those that are there"
    return OptionError("no recording was read", expected="recordings that can be read", where=where, advice=advice)
