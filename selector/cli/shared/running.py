"""How does a command end: exit codes (docs/reference/contracts.md), and what a person reads when it was not done."""

import errno
import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

import typer

from selector.errors import CancelledError, InputError, OptionError, ReadError

DONE, DEFECT, UNUSABLE, STOPPED, PIPE_CLOSED = 0, 1, 2, 130, 141

_stopped = ["stopped. Nothing was written."]  #: What is said after a Ctrl-C: the last of these.


def exit_status(app: typer.Typer, arguments: Sequence[str] | None = None) -> int:
    """The exit code of one command line (default: ``sys.argv``); messages about errors are written to stderr."""
    del _stopped[1:]
    try:
        result = _command(app)(args=arguments, standalone_mode=False, prog_name="selector")
        # click hands back the code of `Exit` as a number; commands themselves return nothing
        if not isinstance(result, int):
            result = DONE
        if result == STOPPED:
            _say(_stopped[-1])
        sys.stdout.flush()
        return result
    except (KeyboardInterrupt, typer.Abort, CancelledError) as stop:
        _say(str(stop) or _stopped[-1])
        return STOPPED
    except BrokenPipeError:
        # a later flush at interpreter exit must not fail again
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return PIPE_CLOSED
    except Exception as error:
        if _is_behind(KeyboardInterrupt, error):
            _say(_stopped[-1])
            return STOPPED
        unusable = _as_input_error(error)
        if unusable is None:
            _say_defect(error)
            return DEFECT
        where, expected, advice = unusable.where, unusable.expected, unusable.advice
        _say(f"{unusable.found}\n  Where:      {where}\n  Expected:   {expected}\n  What to do: {advice}")
        if _debugging():
            traceback.print_exception(error, file=sys.stderr)
        return UNUSABLE


def _is_behind(kind: type[BaseException], error: BaseException) -> bool:
    """Whether an error is or comes of one of this kind: what compiled code makes of a Ctrl-C has other names."""
    before = error.__cause__ or error.__context__
    return isinstance(error, kind) or (before is not None and _is_behind(kind, before))


@cache
def _command(app: typer.Typer) -> Any:
    """The tree of commands, made once for all command lines of a process."""
    return typer.main.get_command(app)


@contextmanager
def last_step(said: str) -> Iterator[None]:
    """A short step that a Ctrl-C waits for; `said` is what a Ctrl-C ends with once it is done."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    asked: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: asked.append(number))
    try:
        yield
        _stopped.append(said)
    finally:
        signal.signal(signal.SIGINT, before)
    if asked:
        raise CancelledError(said)


def _as_input_error(error: Exception) -> InputError | None:
    """The error as the user's to solve, or None when it is a defect of ours."""
    if isinstance(error, InputError):
        return error
    # typer brings its own click, so that the type of a wrong command line has no stable name
    if hasattr(error, "format_message") and hasattr(error, "exit_code"):
        return _usage_error(error)
    if isinstance(error, UnicodeEncodeError):
        return OptionError(
            "a name with bytes that are no text",
            expected="names of files that can be written as text",
            where=ascii(error.object[:200]),
            advice="choose another name",
        )
    if isinstance(error, UnicodeError):
        return ReadError(
            "text that cannot be read in the encoding that was chosen",
            expected="text in one encoding from its first to its last byte",
            where=str(error),
            advice="save the file as UTF-8; where the command has it, --encoding names another one",
        )
    if isinstance(error, MemoryError):
        return ReadError(
            "more data than the memory of this machine holds",
            expected="recordings that fit into memory, or Parquet files, which are read in pieces",
            where=str(error) or "memory",
            advice="give fewer runs at a time, or `selector convert … --format parquet` them one by one",
        )
    if isinstance(error, OSError):
        return _file_error(error)
    if isinstance(error, ModuleNotFoundError):
        name = (error.name or "").partition(".")[0]
        extra = next((extra for extra, modules in EXTRAS.items() if name in modules.split()), None)
        if extra is not None:
            return OptionError(
                f"this needs the package {name}, which is not installed",
                expected=f"an installation with the extra `{extra}`",
                where="installation",
                advice=f'in the folder of selector: pip install ".[{extra}]"; `all` has every extra',
            )
    return None


#: Extra of `pyproject.toml` → the modules that come with it.
EXTRAS = {
    "workbench": "dash flask werkzeug",
    "formats": "nptdms asammdf h5py pyuff",
    "field": "skfem pyamg meshio",
    "drive": "control",
    "fmu": "fmpy",
    "live": "asyncua aiomqtt",
    "fleet": "fsspec distributed psutil",
    "prove": "joblib sklearn",
}

_REFUSED = "Input should be "  #: How pydantic begins to say what a value has to be.


def _usage_error(error: Any) -> OptionError:
    context = getattr(error, "ctx", None)
    path = context.command_path if context is not None else "selector"
    usage = context.get_usage().removeprefix("Usage:").strip() if context is not None else "selector COMMAND"
    found = " ".join(str(error.format_message()).replace("Value error, ", "").split())
    expected, where = " ".join(usage.split()), "command line"
    wrong = error.__cause__.errors()[0] if hasattr(error.__cause__, "errors") else {"msg": ""}
    if wrong["msg"].startswith(_REFUSED):
        said = wrong["msg"].removeprefix(_REFUSED).partition(", unable")[0]
        expected = said.replace("valid number", "number with a decimal point").replace("valid integer", "whole number")
        found, where = repr(wrong["input"]), error.param.opts[0]
    advice = f"correct the command; `{path} --help` lists its options"
    word = found.split("'")[1] if found.startswith("No such command") else None
    groups = getattr(getattr(context, "command", None), "commands", {})
    for name, group in groups.items():
        if word in getattr(group, "commands", ()):
            advice = f"say `{path} {name} {word}`"
    return OptionError(found, expected=expected, where=where, advice=advice)


def _file_error(error: OSError) -> ReadError:
    where = str(error.filename2 or error.filename or "file system")
    found, advice = {
        errno.ENOENT: ("no such file or folder", "correct the path"),
        errno.EACCES: ("no permission", "check the rights, and close the program that holds the file open"),
        errno.EPERM: ("no permission", "check the rights, and close the program that holds the file open"),
        errno.EISDIR: ("a folder in the place of a file", "name a file"),
        errno.ENOTDIR: ("a file in the place of a folder", "name a folder"),
        errno.EEXIST: ("it exists already", "choose another name, or remove it first"),
        errno.ENOSPC: ("the disk is full", "free some space, or write to another disk"),
        errno.ENAMETOOLONG: ("a name that is too long", "choose a shorter name"),
    }.get(error.errno or 0, (str(error.strerror or error), "check that the file can be opened by another program"))
    return ReadError(found, expected="a path that can be read or written", where=where, advice=advice)


def _say_defect(error: Exception) -> None:
    _say(
        f"this is a defect of the program, not of your data: {type(error).__name__}: {error}\n"
        "  What to do: report it, with the command and what it prints when the environment has SELECTOR_DEBUG=1"
    )
    if _debugging():
        traceback.print_exception(error, file=sys.stderr)


def _debugging() -> bool:
    return os.environ.get("SELECTOR_DEBUG", "") not in ("", "0")


def _say(text: str) -> None:
    encoding = getattr(sys.stderr, "encoding", None) or "utf-8"
    sys.stderr.write(f"selector: {text}\n".encode(encoding, "backslashreplace").decode(encoding))
    sys.stderr.flush()
