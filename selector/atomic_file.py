"""Files and folders that are written whole or not at all, and nothing is overwritten that was read."""

import errno
import os
import secrets
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path

from selector.errors import OptionError


def write_whole(path: Path, content: bytes) -> None:
    """Write `content` to `path`; a reader sees the old file or the new one, never a part.

    The new file is made beside the old one and then takes its name, in one step. Folders that are missing are made. A
    path behind a URL (`selector.fleet.places.UrlPath`) has its own way, as a server of objects shows what is put whole.

    Raises OptionError: nothing can be written there; the old file is untouched.
    """
    if (put_whole := getattr(path, "put_whole", None)) is not None:
        put_whole(content)
        return
    draft = path.with_name(f".{path.name[:60]}.{secrets.token_hex(8)}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
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
            expected="a path in a folder where you may write",
            where=str(path),
            advice="free some space, or write to another disk"
            if is_full(error)
            else "give another output path, or close the program that has the file open",
        ) from error


def is_full(error: BaseException | None) -> bool:
    """Whether a disk without room is behind an error."""
    return error is not None and (
        getattr(error, "errno", None) in (errno.ENOSPC, errno.EDQUOT) or is_full(error.__cause__)
    )


@contextmanager
def folder_written_whole(folder: Path, earlier: Iterable[str] = ()) -> Iterator[Path]:
    """An empty folder to write into; it takes the place of `folder` when the block ends without an error.

    If `folder` exists, files of the same name are replaced and others stay, but those named `earlier`: they belong to
    an earlier answer and go with it. When the block fails, or is stopped, `folder` is left as it was.
    """
    folder = Path(os.path.abspath(folder))  # noqa: PTH100 (resolve() would follow a link and replace its target's name)
    folder.parent.mkdir(parents=True, exist_ok=True)
    if folder.exists() and not folder.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "not a folder", str(folder))
    # named before it is made: a Ctrl-C finds it again; inside of a folder that exists, which may be another disk
    part = (folder if folder.exists() else folder.parent) / f".{folder.name[:60]}.{secrets.token_hex(8)}.part"
    try:
        part.mkdir()
        yield part
        if not folder.exists():
            part.rename(folder)
            return
        _move_into(part, folder, earlier)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _move_into(part: Path, folder: Path, earlier: Iterable[str]) -> None:
    """All files of `part` take their places in `folder`, and those named `earlier` leave it, or none does."""
    sources = sorted(part.rglob("*"))
    moves = [(source, folder / source.relative_to(part)) for source in sources if not source.is_dir()]
    for source in sources:
        if source.is_dir():
            (folder / source.relative_to(part)).mkdir(exist_ok=True)
    taken = {place for _, place in moves}
    gone = [place for name in earlier if (place := folder / name).is_file() and place not in taken]
    _moved_together([*moves, *((None, place) for place in gone)], lambda _: part)


@contextmanager
def written_together(
    paths: Iterable[Path], last: Callable[[], AbstractContextManager[object]] = nullcontext
) -> Iterator[Mapping[Path, Path]]:
    """Path → draft to be written; when the block ends without an error, all drafts take their places, or none does.

    Folders that are missing are made. `last` is entered around the taking of places.
    """
    drafts: dict[Path, Path] = {}
    made: list[Path] = []
    stages: dict[Path, Path] = {}
    try:
        for path in paths:
            if (folder := path.parent) not in stages:
                for missing in [place for place in (*reversed(folder.parents), folder) if not place.exists()]:
                    made.append(missing)
                    missing.mkdir(exist_ok=True)
                stages[folder] = folder / f".{secrets.token_hex(8)}.part"
                stages[folder].mkdir()
            drafts[path] = stages[folder] / path.name
        yield drafts
        with last():
            _moved_together(((draft, path) for path, draft in drafts.items()), lambda path: stages[path.parent])
            made.clear()
    finally:
        for stage in stages.values():
            shutil.rmtree(stage, ignore_errors=True)
        for folder in reversed(made):
            if folder.exists() and not any(folder.iterdir()):
                folder.rmdir()


def _moved_together(moves: Iterable[tuple[Path | None, Path]], aside: Callable[[Path], Path]) -> None:
    """Of (draft, place) all drafts take their places, or none does; without a draft a place gets empty.

    What stood in a place waits in the folder `aside` of it until the last is in.
    """
    done: list[tuple[Path | None, Path, Path]] = []
    try:
        for draft, place in moves:
            if place.is_dir():
                raise IsADirectoryError(errno.EISDIR, "a folder in the place of a file", str(place))
            old = aside(place) / f"{secrets.token_hex(8)}.old"
            done.append((draft, place, old))
            if place.exists():
                place.replace(old)
            if draft is not None:
                draft.replace(place)
    except BaseException:
        for draft, place, old in done:
            if old.exists():
                old.replace(place)
            elif draft is not None and not draft.exists():
                place.unlink(missing_ok=True)
        raise


def refuse_to_overwrite(path: Path, *, force: bool, option: str) -> None:
    """Raises OptionError: the file exists, and the user did not say ``--force``."""
    if path.is_dir() or (path.exists() and not force):
        what = "folder" if path.is_dir() else "file"
        raise OptionError(
            f"a {what} of this name exists already",
            expected="a name that is free, because a file may hold corrections made by hand",
            where=f"{option} {path}",
            advice="choose another name" + (", or add --force to replace the file" if what == "file" else ""),
        )


def refuse_to_replace_input(path: Path, inputs: Iterable[str | Path], option: str) -> None:
    """Raises OptionError: the file to be written is one of those that were read, whatever its name there was."""
    if path.exists() and any(Path(file).exists() and path.samefile(file) for file in inputs):
        found = "this file is one of the inputs, and would be lost"
        expected = "a file that is not read by the same command"
        raise OptionError(found, expected=expected, where=f"{option} {path}", advice="choose another name")


#: Ending → what the beginning of a file holds that this program wrote.
_OURS = {".json": '"schema": "selector.', ".html": 'name="generator" content="selector '}
_BEGINNING_BYTES = 4000


def begins_with(path: Path, mark: str) -> bool:
    """Whether there is a file that has these words near its beginning."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return mark in file.read(_BEGINNING_BYTES).decode("utf-8", errors="replace")


def require_replaceable(folder: Path, marks: Mapping[str, str], option: str = "--out") -> None:
    """Raises OptionError: in the place of a result stands something that does not begin as results do.

    `marks`: name of the file → what it has near its beginning if an earlier run of the same command wrote it.
    """
    # an empty one is what a computer that goes down may leave of a result, and holds nothing of anybody's
    foreign = [
        name
        for name, mark in marks.items()
        if (at := folder / name).exists() and not begins_with(at, mark) and (at.is_dir() or at.stat().st_size > 0)
    ]
    for name in foreign:
        if (folder / name).is_dir():
            expected, advice = "a file, or a name that is free", "name a file in it, or another one"
            raise OptionError(f"{folder / name} is a folder", expected=expected, where=option, advice=advice)
    if foreign:
        raise OptionError(
            f"{', '.join(foreign)} in {folder}, which this command did not write",
            expected="names that are free, or an earlier answer of this command",
            where=option,
            advice="choose another folder or name, or move these files away",
        )


def require_writable_folder(folder: Path, option: str, results: Iterable[str] = ()) -> None:
    """Finds out before long work whether `folder` can be made or written to; leaves nothing behind.

    Raises OptionError: it is a file, or its place cannot be written to; or a file that is not of this program stands in
    the place of one of the `results`: what ends in ``.html`` is a page, anything else JSON.
    """
    if (require_writable := getattr(folder, "require_writable", None)) is not None:  # behind a URL
        require_writable()
        return
    is_lost = folder.is_symlink() and not folder.exists()
    if is_lost or (folder.exists() and not folder.is_dir()):
        found = "a link that leads nowhere, or to itself" if is_lost else "a file of this name exists"
        advice = "choose another name, or remove the link" if is_lost else "choose another name"
        raise OptionError(found, expected="a folder, or a name that is free", where=f"{option} {folder}", advice=advice)
    require_replaceable(folder, {name: _OURS.get(Path(name).suffix, _OURS[".json"]) for name in results}, option)
    place = next(parent for parent in (folder.absolute(), *folder.absolute().parents) if parent.exists())
    try:
        with tempfile.TemporaryDirectory(dir=place):
            pass
    except OSError as error:
        raise OptionError(
            f"{place} cannot be written to ({error.strerror})",
            expected="a folder in which files can be made",
            where=f"{option} {folder}",
            advice="choose another folder, or change its rights",
        ) from error
