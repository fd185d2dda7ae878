"""Where recordings lie: folders, patterns, and URLs of anything that fsspec reaches."""

import glob
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from selector.errors import OptionError, ReadError, SelectorError
from selector.number_text import natural_key
from selector.readers.files import MACHINE_FILE, has_name_of_recording
from selector.study.study_file import Recordings


def is_url(reference: str) -> bool:
    """Whether fsspec has to reach it."""
    return "://" in reference


def is_pattern(reference: str) -> bool:
    """Whether it stands for all that fits; a path that exists with such signs in its name is a path."""
    return any(sign in reference for sign in "*?[") and (is_url(reference) or not Path(reference).exists())


def last_part(reference: str) -> str:
    """Name of a folder or file, as a machine is called by it: without the ending of a recording."""
    path = Path(reference.rstrip("/").rpartition("://")[2])
    return path.stem if has_name_of_recording(path) else path.name


def may_hold_recordings(reference: str) -> bool:
    """Whether it is a folder, or a recording by its ending; of a URL, by its name alone."""
    path = Path(reference)
    return has_name_of_recording(path) or (not path.suffix if is_url(reference) else path.is_dir())


def found_by(pattern: str) -> list[str]:
    """What a pattern fits, in natural order; hidden files and those of unfinished writing are none of it."""
    if is_url(pattern):
        with _readable(pattern):
            system, path = _reached(pattern)
            found = [system.unstrip_protocol(one) for one in system.glob(path)]
    else:
        found = glob.glob(pattern)  # noqa: PTH207 (a pattern may be absolute)
    return sorted(found, key=natural_key)


def local_paths(references: Sequence[str], folder: Path) -> list[Path]:
    """Files and folders on this computer; what URLs name is brought into `folder`.

    Raises ReadError: a pattern fits nothing, or a URL cannot be reached.
    """
    paths: list[Path] = []
    for number, reference in enumerate(references):
        found = found_by(reference) if is_pattern(reference) else [reference]
        if not found:
            raise ReadError(
                "nothing that this pattern fits", expected="a recording", where=reference, advice="correct the pattern"
            )
        for inner, one in enumerate(found):
            paths.append(_brought(one, folder / f"{number}-{inner}") if is_url(one) else Path(one))
    return paths


def local_recordings(recordings: Recordings, folder: Path) -> tuple[list[Path], Path | None]:
    """What is named of recordings, and their machine file if one is named, here; errors as `local_paths`."""
    named = [recordings.machine] if recordings.machine else []
    return local_paths(recordings.runs, folder / "runs"), next(iter(local_paths(named, folder / "machine")), None)


def _brought(url: str, folder: Path) -> Path:
    """The file of a URL, or the folder with its recordings and its machine file."""
    with _readable(url):
        system, path = _reached(url)
        # the folder keeps its name, by which runs of one name are told apart
        target = folder / path.rstrip("/").rpartition("/")[2]
        if not system.isdir(path):
            folder.mkdir(parents=True)
            system.get_file(path, str(target))
            return target
        target.mkdir(parents=True)
        for one in system.ls(path, detail=False):
            name = Path(one).name
            if (name == MACHINE_FILE or has_name_of_recording(Path(name))) and not system.isdir(one):
                system.get_file(one, str(target / name))
        return target


@contextmanager
def _readable(url: str) -> Iterator[None]:
    try:
        yield
    except SelectorError:
        raise
    except Exception as error:  # each kind of server has errors of its own
        raise ReadError(
            f"a URL that cannot be read ({type(error).__name__}: {error})",
            expected="a recording, or a folder of recordings",
            where=url,
            advice="check the URL and the rights; fsspec takes accounts from its configuration and the environment",
        ) from error


def _reached(url: str) -> tuple[Any, str]:
    """The file system of a URL, and the path there. Raises OptionError: fsspec or a package for it is not installed."""
    try:
        from fsspec.core import url_to_fs
    except ImportError as error:
        raise OptionError(
            "recordings behind a URL, and the package fsspec is not installed",
            expected="an installation with the extra `fleet`",
            where=url,
            advice='run `pip install ".[fleet]"` in the folder of selector, or name folders',
        ) from error
    try:
        system, path = url_to_fs(url)
    except ImportError as error:
        raise OptionError(
            f"a URL whose kind needs another package ({error})",
            expected="a kind of URL that fsspec knows on this computer",
            where=url,
            advice="install that package, for s3:// it is s3fs",
        ) from error
    return system, path
