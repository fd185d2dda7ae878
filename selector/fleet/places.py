"""Where recordings and results lie: folders, patterns, and URLs of anything that fsspec reaches."""

import errno
import glob
import io
import re
import secrets
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock
from typing import Any

from selector.errors import InputError, OptionError, ReadError, SelectorError, StorageError
from selector.number_text import natural_key
from selector.readers.files import MACHINE_FILE, has_name_of_recording
from selector.study.inputs import path_at
from selector.study.study_file import Recordings

_PUTTING = Lock()  #: What a transaction of fsspec puts is that of all threads.


def is_url(reference: str) -> bool:
    """Whether fsspec has to reach it."""
    return reference.find("://") > 0


def is_pattern(reference: str) -> bool:
    """Whether it stands for all that fits; a path that exists with such signs in its name is a path."""
    return any(sign in reference for sign in "*?[") and (is_url(reference) or not Path(reference).exists())


def last_part(reference: str) -> str:
    """Name of a folder or file, as a machine is called by it: without the ending of a recording; of a lake, its own."""
    path = Path(reference.rstrip("/").rpartition("://")[2])
    return (path.stem if has_name_of_recording(path) else path.name).removeprefix("machine=") or reference


def may_hold_recordings(reference: str) -> bool:
    """Whether it is a folder, but that of an answer, or a recording by its ending; of a URL, by its name alone.

    A link that leads nowhere is a machine, too, which is then told: its disk may be away.
    """
    path = Path(reference)
    is_folder = not path.suffix if is_url(reference) else path.is_dir() or not path.exists()
    return has_name_of_recording(path) or (is_folder and not re.fullmatch("[0-9a-f]{64}", path.name))


def found_by(pattern: str) -> list[str]:
    """What a pattern fits, in natural order; hidden files and those of unfinished writing are none of it."""
    if is_url(pattern):
        with _answering(pattern := pattern.rstrip("/")):
            system, path = _reached(pattern)
            # fsspec forgets the server of a path, which some kinds have elsewhere in the URL, ...
            server = pattern.removesuffix(path.strip("/"))
            url_of = system.unstrip_protocol if server == pattern else lambda one: server + one.lstrip("/")
            # ... and names folders of SMB with a slash at their end, which fits no pattern without one
            found = list({url_of(one).rstrip("/") for end in ("", "/") for one in system.glob(path.rstrip("/") + end)})
    else:
        found = glob.glob(pattern)  # noqa: PTH207 (a pattern may be absolute)
    return sorted(found, key=natural_key)


def local_paths(references: Sequence[str], folder: Path) -> dict[Path, str]:
    """Files and folders on this computer → what they are named by; what URLs name is brought into `folder`.

    Raises ReadError: a pattern fits nothing, or a URL cannot be reached.
    """
    paths: dict[Path, str] = {}
    for number, reference in enumerate(references):
        found = found_by(reference) if is_pattern(reference) else [reference]
        if not found:
            raise ReadError(
                "nothing that this pattern fits",
                expected="a recording",
                where=without_password(reference),
                advice="correct the pattern",
            )
        for inner, one in enumerate(found):
            paths[_brought(one, folder / f"{number}-{inner}") if is_url(one) else Path(one)] = one
    return paths


@contextmanager
def local_recordings(recordings: Recordings) -> Iterator[tuple[dict[Path, str], Path | None]]:
    """What is named of recordings, and their machine file if one is named, here as long as the block lasts."""
    named = [recordings.machine] if recordings.machine else []
    with TemporaryDirectory() as folder:
        machine = next(iter(local_paths(named, Path(folder) / "machine")), None)
        yield local_paths(recordings.runs, Path(folder) / "runs"), machine


def reference_of(file: Path, named: Mapping[Path, str]) -> str:
    """How another process finds a file of what `local_paths` gave: one that was brought from a URL, by its URL."""
    folder = named.get(file.parent, "")
    return f"{folder.rstrip('/')}/{file.name}" if is_url(folder) else named.get(file, str(file))


def _brought(url: str, folder: Path) -> Path:
    """The file of a URL, or the folder with its recordings and its machine file."""
    with _answering(url):
        system, path = _reached(url)
        # the folder keeps its name, by which runs of one name are told apart
        target = folder.joinpath(*[part for part in path.split("/") if part and not part.endswith(":")][-2:])
        if not system.isdir(path):
            target.parent.mkdir(parents=True)
            system.get_file(path, str(target))
            return target
        target.mkdir(parents=True)
        for one in system.ls(path, detail=False):
            name = Path(one).name
            if (name == MACHINE_FILE or has_name_of_recording(Path(name))) and not system.isdir(one):
                system.get_file(one, str(target / name))
        return target


class UrlPath:
    """A file or folder behind a URL: as much of a Path as results need of one.

    Raises FileNotFoundError: there is no such file. Raises StorageError: anything else that a server says.
    """

    def __init__(self, url: str) -> None:
        self._url = url

    def __truediv__(self, name: str) -> "UrlPath":
        return UrlPath(f"{self._url.rstrip('/')}/{name}")

    def __str__(self) -> str:
        return without_password(self._url)

    def is_file(self) -> bool:
        """Whether there is such a file; fsspec's own answer is no where a server does not answer."""
        with suppress(FileNotFoundError):
            return bool(self._asked("info")["type"] == "file")
        return False

    exists = is_file

    def read_bytes(self) -> bytes:
        """All of the file."""
        return bytes(self._asked("cat_file"))

    def open(self, mode: str) -> io.BytesIO:
        """The file to be read, all of it at once: results are small."""
        return io.BytesIO(self.read_bytes())

    def put_whole(self, content: bytes) -> None:
        """Put a file there, of which others see all or nothing; missing folders are made, a bucket is not."""
        with _PUTTING, _answering(self._url, StorageError):
            system, path = _reached(self._url)
            # a server of objects has no folders, and would make a bucket of a mistyped name
            if path.startswith("/") or getattr(system, "local_file", False):
                system.makedirs(path.rpartition("/")[0], exist_ok=True)
            # a server of folders writes elsewhere and renames; one of objects has nothing to add
            with system.transaction:
                system.pipe_file(path, content)

    def require_writable(self) -> None:
        """Finds out before long work whether files can be put here and removed."""
        trial = self / f".{secrets.token_hex(8)}.part"
        trial.put_whole(b"trial")
        trial._asked("rm_file")

    def _asked(self, what: str) -> Any:
        try:
            with _answering(self._url, StorageError):
                system, path = _reached(self._url)
                return getattr(system, what)(path)
        except StorageError as error:
            cause = error.__cause__  # of some servers it is no FileNotFoundError
            if isinstance(cause, FileNotFoundError) or getattr(cause, "errno", None) == errno.ENOENT:
                raise FileNotFoundError(errno.ENOENT, "no such file", str(self)) from error
            raise


def results_at(reference: str, folder: Path) -> Path:
    """The place of results: a folder of this computer, relative to `folder`, or what does as one behind a URL."""
    behind: Any = UrlPath(reference)
    return behind if is_url(reference) else path_at(reference, folder)


def without_password(url: str) -> str:
    """The URL as it may be shown: without account, password and signature."""
    return re.sub(r"\?[^/]*=.*", "?…", re.sub(r"(?<=://).*@", "…@", url))


@contextmanager
def _answering(url: str, kind: type[InputError] = ReadError) -> Iterator[None]:
    """What a server says instead of an answer, as an error of this kind."""
    try:
        yield
    except SelectorError:
        raise
    except Exception as error:  # each kind of server has errors of its own
        raise kind(
            without_password(f"a URL that cannot be used ({type(error).__name__}: {error})"),
            expected="recordings" if kind is ReadError else "a place where results can be kept",
            where=without_password(url),
            advice="check URL, rights and bucket; fsspec takes accounts from its configuration and the environment",
        ) from error


def _reached(url: str) -> tuple[Any, str]:
    """The file system of a URL, and the path there. Raises OptionError: fsspec or a package for it is not installed."""
    try:
        from fsspec.core import url_to_fs

        system, path = url_to_fs(url)
    except ImportError as error:
        raise OptionError(
            f"a URL that needs another package ({error})",
            expected="the extra `fleet`, and what fsspec needs for this kind of URL: s3fs for s3://, smbprotocol for smb://",
            where=without_password(url),
            advice='run `pip install ".[fleet]"` in the folder of selector, and install that package; or name folders',
        ) from error
    system.invalidate_cache()  # a worker may live for weeks, and others write there, too
    return system, path
