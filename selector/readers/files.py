"""Which files are recordings, and in which format each of them is."""

import contextlib
import hashlib
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from selector.errors import InputError, ReadError
from selector.findings import Finding, Where
from selector.number_text import natural_key
from selector.readers.binary.mat import read_mat
from selector.readers.binary.parquet import read_parquet
from selector.readers.binary.tdms import read_mdf, read_tdms
from selector.readers.finding_table import FINDINGS
from selector.readers.roles.names import closest
from selector.readers.tables import Overrides, Table, listed
from selector.readers.text.delimited import read_delimited
from selector.readers.text.klippy import is_klippy_log, read_klippy
from selector.readers.workbook import read_excel

MACHINE_FILE = "machine.toml"
MAX_TEXT_BYTES = 2_000_000_000

_READERS: dict[str, Callable[[Path, bytes, Overrides], list[Table]]] = {
    "delimited": read_delimited,
    "excel": read_excel,
    "parquet": read_parquet,
    "mat": read_mat,
    "tdms": read_tdms,
    "mdf": read_mdf,
    "klippy": read_klippy,
}
_ENDINGS = (
    ".csv .tsv .txt .dat .asc .log .lvm .prn .tab .xlsx .xlsm .xlsb .xls .ods .parquet .pq .feather .arrow .mat "
    ".h5 .hdf5 .hdf .tdms .mdf .mf4 .mf3"
)
_EXTENSIONS = frozenset(_ENDINGS.split())
#: Names of text that lies beside recordings and is none.
_DOCUMENT = re.compile(
    r"((read[ _-]?me|licen[cs]e|lies[ _-]?mich|notes?|notizen?|anmerkung(en)?|bemerkung(en)?|hinweise?|comments?|"
    r"remarks?|commentaires?|说明|备注|メモ|заметки)([ _.-].*)?|"
    r"copying|notice|source|origin|citation|authors|changelog)\.(txt|dat|asc)",
    re.IGNORECASE,
)
_FOREIGN = (
    (b"\x1f\x8b", "a gzip archive", "unpack it first"),
    (b"BZh", "a bzip2 archive", "unpack it first"),
    (b"\xfd7zXZ", "an xz archive", "unpack it first"),
    (b"7z\xbc\xaf", "a 7-Zip archive", "unpack it first"),
    (b"Rar!", "a RAR archive", "unpack it first"),
    (b"%PDF", "a PDF document", "export the recording as CSV or xlsx from the program that made it"),
    (b"\x89PNG", "a picture", "export the recording as CSV or xlsx"),
    (b"\xff\xd8\xff", "a picture", "export the recording as CSV or xlsx"),
    (b"TDSh", "the index of a TDMS file", "give the .tdms file beside it"),
    (b"SQLite format 3", "a database", "export the recording as CSV"),
)


@dataclass(frozen=True)
class Found:
    """Files to read, the machine file beside them if there is one, and what was skipped."""

    files: tuple[Path, ...]
    machine: Path | None
    findings: tuple[Finding, ...]


def recording_files(paths: Sequence[Path]) -> Found:
    """The files that `paths` mean; a folder means the recordings in it, in natural order (r2 before r10)."""
    if not paths:
        raise ReadError(
            "no recording", expected="one file or folder per run", where="arguments", advice="name the files"
        )
    files: list[Path] = []
    findings: list[Finding] = []
    machine: Path | None = None
    for path in paths:
        try:
            if path.is_dir():
                path = _machine_of_lake(path)
                inside, skipped = _inside(path)
                files += inside
                findings += skipped
                if machine is None and (path / MACHINE_FILE).is_file():
                    machine = path / MACHINE_FILE
            elif path.is_file():
                files.append(path)
            else:
                raise _nothing_there(path)
        except (OSError, ValueError) as error:
            raise ReadError(
                f"a path that cannot be opened ({error})", expected="a readable file or folder", where=str(path)[:300],
                advice="check the path and the rights to read it",
            ) from error  # fmt: skip
    unique: dict[Path, Path] = {}
    for path in files:
        unique.setdefault(path.resolve(), path)
    return Found(tuple(unique.values()), machine, tuple(findings))


def _nothing_there(path: Path) -> ReadError:
    if path.exists():
        found = "not a regular file but a device, a pipe or a socket"
        expected = "a recording in a file, or a folder of recordings"
        advice = "write the recording into a file and name that"
    elif path.is_symlink():
        found = f"a link to {str(path.readlink())[:200]}, which leads to no file"
        expected = "a recording, or a link to one"
        advice = "name the recording itself, or mend the link"
    else:
        near = None
        with contextlib.suppress(OSError):
            near = closest(path.name, [p.name for p in path.parent.iterdir()]) if path.parent.is_dir() else None
        found, advice = "no such file or folder", "correct the path"
        expected = "a recording" + (f" (nearest name there: {near!r})" if near else "")
    return ReadError(found, expected=expected, where=str(path)[:300], advice=advice)


def _machine_of_lake(folder: Path) -> Path:
    """Of a lake, as `selector collect` makes it, the folder of its one machine; any other folder is itself."""
    machines = [path for path in folder.glob("machine=*") if path.is_dir()]
    if len(machines) > 1:
        raise ReadError(
            f"a lake of {len(machines)} machines ({listed(sorted(path.name for path in machines), 6)})",
            expected="the recordings of one machine", where=str(folder), advice=f"name one, such as {machines[0]}",
        )  # fmt: skip
    return machines[0] if machines else folder


def _inside(folder: Path) -> tuple[list[Path], list[Finding]]:
    files: list[Path] = []
    skipped: list[str] = []
    months = [inner for month in folder.glob("month=*") for inner in month.iterdir()]
    for path in sorted((*folder.iterdir(), *months), key=lambda p: natural_key(p.name)):
        if path.name.startswith((".", "~$")) or path.name == MACHINE_FILE or path.is_dir():
            continue
        if has_name_of_recording(path) and path.is_file():
            files.append(path)
        else:
            skipped.append(path.name)
    if not files:
        folders = [p.name for p in folder.iterdir() if p.is_dir()]
        raise ReadError(
            "a folder without recordings"
            + (f" (files: {', '.join(skipped[:6])})" if skipped else "")
            + (f" (folders inside: {', '.join(sorted(folders)[:6])})" if folders else ""),
            expected="files that end in " + ", ".join(sorted(_EXTENSIONS)),
            where=str(folder),
            advice="name the folder that holds the recordings, or the files themselves",
        )
    if not skipped:
        return files, []
    told = f"In {folder.resolve().name}/ {len(skipped)} file(s) are no recordings by their names and were skipped: "
    told += f"{listed(skipped, 6)}."
    return files, [FINDINGS.finding("files-skipped", told, Where(file=str(folder)), {"files": skipped[:50]})]


def has_name_of_recording(path: Path) -> bool:
    """Whether a file in a folder is a recording by its name: an ending of recordings, and no README."""
    return path.suffix.lower() in _EXTENSIONS and not _DOCUMENT.fullmatch(path.name)


def tables_of(path: Path, overrides: Overrides) -> tuple[list[Table], str]:
    """The tables of a file, and its SHA-256."""
    try:
        with path.open("rb") as stream:
            head = stream.read(4096)
            form = file_format(path, head)
            size = path.stat().st_size
            if form in ("delimited", "klippy") and size > MAX_TEXT_BYTES:
                raise ReadError(
                    f"{size / 1e9:.1f} GB of text", expected=f"at most {MAX_TEXT_BYTES / 1e9:.0f} GB", where=path.name,
                    advice="store the recording as Parquet (it is then read piece by piece), or split it into runs",
                )  # fmt: skip
            stream.seek(0)
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
            stream.seek(0)
            data = head if form == "parquet" else stream.read()
        tables = _READERS[form](path, data, overrides)
    except InputError:
        raise
    except OSError as error:
        raise ReadError(
            f"a file that cannot be read ({error.strerror or error})", expected="a readable file", where=str(path),
            advice="check the path, the rights to read it, and that no other program has it open",
        ) from error  # fmt: skip
    except MemoryError as error:
        raise ReadError(
            "a file that does not fit into memory", expected="less data at once", where=str(path),
            advice="store it as Parquet, which is read piece by piece, or split it into runs",
        ) from error  # fmt: skip
    return tables, digest


def file_format(path: Path, head: bytes) -> str:
    """The key of `_READERS` for a file, by its first bytes, not by its ending."""
    if not head.strip(b"\0 \t\r\n\xef\xbb\xbf\xff\xfe"):
        raise ReadError(
            "an empty file" if not head else "a file of blanks", expected="a header and at least two rows of numbers",
            where=path.name, advice="check whether the logger wrote the file, or leave it out",
        )  # fmt: skip
    for magic, what, advice in _FOREIGN:
        if head.startswith(magic):
            raise ReadError(what, expected="a recording", where=path.name, advice=advice)
    if head.startswith((b"PAR1", b"ARROW1", b"FEA1")):
        return "parquet"
    if head.startswith((b"PK\x03\x04", b"PK\x05\x06", b"\xd0\xcf\x11\xe0")):
        return "excel"
    if head.startswith(b"TDSm"):
        return "tdms"
    if head.startswith((b"MDF     ", b"UnFinMF ")):
        return "mdf"
    if head.startswith(b"MATLAB 5.0 MAT-file") or b"\x89HDF\r\n\x1a\n" in head[:2048]:
        return "mat"
    if path.suffix.lower() == ".mat" and b"\0" in head[:20]:
        return "mat"
    return "klippy" if is_klippy_log(head) else "delimited"
