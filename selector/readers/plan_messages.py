"""What there is to say, or to refuse, while the channels of a recording are settled."""

from __future__ import annotations

from collections.abc import Sequence

from selector.errors import OptionError, RecordingError
from selector.findings import Finding, Where
from selector.readers.machine_file import Machine
from selector.readers.names import closest, name_and_unit
from selector.readers.roles import RoleGuess
from selector.readers.runs import TimedRun
from selector.readers.tables import Overrides
from selector.units import ROLES


def doubtful_role(name: str, guess: RoleGuess) -> Finding:
    """A role that something speaks against."""
    return Finding(
        "ambiguous-role",
        "warning",
        f"Channel {name!r} was taken for {guess.role} in {guess.unit}, but this is uncertain: {guess.doubt}.",
        Where(channel=name),
        {"role": guess.role, "unit": guess.unit},
        "say what it is in a machine file: role and unit of this channel",
    )


def missing_everywhere(runs: Sequence[TimedRun], name: str, wanted: str) -> RecordingError:
    """A channel of the machine file that no run has."""
    columns = list(dict.fromkeys(c.header for run in runs for c in run.columns))
    texts = {t for run in runs for t in run.texts}
    stripped = {name_and_unit(h)[0]: h for h in columns}
    near = closest(wanted, [*columns, *stripped])
    found = f"no column {wanted!r} in any of the {len(runs)} run(s); the columns are {', '.join(columns[:30])}"
    if wanted in texts:
        found = f"column {wanted!r} holds text, not numbers"
    elif any(wanted in run.clock.columns for run in runs):
        found = f"column {wanted!r} is the time column"
    return RecordingError(
        found + (" …" if len(columns) > 30 else ""),
        expected=f"the column of channel {name!r}" + (f" (nearest: {stripped.get(near, near)!r})" if near else ""),
        where=f"machine file, channels.{name}",
        advice="correct `column` of this channel in the machine file, or remove the channel",
    )


def check_overrides(runs: Sequence[TimedRun], machine: Machine | None, overrides: Overrides) -> None:
    """Raise if an override names a channel or role that does not exist."""
    headers = [c.header for run in runs for c in run.columns]
    known = {*headers, *(name_and_unit(h)[0] for h in headers), *(machine.channels if machine is not None else ())}
    for option, mapping in (("--unit", overrides.units), ("--role", overrides.roles)):
        for name in mapping:
            if name not in known:
                near = closest(name, known)
                raise OptionError(
                    f"no channel or column {name!r}",
                    expected="one of " + ", ".join(sorted(known)[:20]) + (f" (nearest: {near!r})" if near else ""),
                    where=option,
                    advice="correct the name",
                )
    for name, role in overrides.roles.items():
        if role not in ROLES:
            raise OptionError(
                f"role {role!r} for {name!r}",
                expected="one of " + ", ".join(ROLES),
                where="--role",
                advice="correct the role",
            )
