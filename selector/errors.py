"""What can go wrong, as a tree of exceptions."""

from collections.abc import Iterable
from functools import partial
from typing import Any


class SelectorError(Exception):
    """Root of every error that this package raises on purpose."""


class InputError(SelectorError):
    """The input is unusable; the command line ends with exit code 2.

    Built from its parts so that no message can forget one of them: what was found, what was expected instead, where
    (file, line, column, channel, option or JSON path), and what the user should do next.
    """

    def __init__(self, found: str, *, expected: str, where: str, advice: str) -> None:
        super().__init__(found, expected, where, advice)
        self.found = found
        self.expected = expected
        self.where = where
        self.advice = advice

    def __reduce__(self) -> tuple[Any, ...]:
        """How a process sends it to another: an error that cannot be read there would end the pool."""
        parts = {"expected": self.expected, "where": self.where, "advice": self.advice}
        return partial(type(self), **parts), (self.found,), self.__dict__

    def at(self, where: str, kind: type["InputError"] | None = None, *, advice: str = "") -> "InputError":
        """The same about another place: as an error of this `kind`, and with other advice, if these are given."""
        return (kind or type(self))(self.found, expected=self.expected, where=where, advice=advice or self.advice)

    def __str__(self) -> str:
        return f"{self.where}: {self.found}. Expected: {self.expected}. What to do: {self.advice}"


Misfit = tuple[str, str, str, str]  #: (found, expected, where, advice)


def refuse(misfits: Iterable[Misfit], kind: type[InputError] = InputError) -> None:
    """Raises the first misfit, if there is any, as an error of this `kind`."""
    for found, expected, where, advice in misfits:
        raise kind(found, expected=expected, where=where, advice=advice)


class ReadError(InputError):
    """A file cannot be read as a recording."""


class RecordingError(InputError):
    """The tables are readable, but they do not make a recording."""


class UnitError(InputError):
    """A unit is unknown, or has the wrong dimension for its role."""


class OptionError(InputError):
    """An option has a value that cannot be used with this recording."""


class NotExecutableError(OptionError):
    """What runs a generated program (a compiler, a control) is not on this machine, or refuses it."""


class ModelFileError(InputError):
    """A model file does not follow its schema."""


class ResultError(InputError):
    """A result on disk, such as selection.json, does not follow its contract."""


class StorageError(InputError):
    """Where results are kept cannot be reached, or refuses them."""


class StudyError(InputError):
    """A study file does not follow its schema, or its recordings are no longer those it names."""


class CancelledError(SelectorError):
    """The user stopped long work; its text says what was written, if anything was."""
