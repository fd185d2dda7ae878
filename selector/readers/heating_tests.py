"""Heating and cooling tests: which displacements they hold, without faults, in units that somebody said."""

import re
from collections.abc import Sequence

from selector.errors import OptionError
from selector.findings import Finding
from selector.quality import inspect, without_faults
from selector.quality.finding_table import RUN_STARTS_WARM
from selector.readers.reading import Reading
from selector.recording import Recording

_SPEED_UNIT = re.compile(r"rpm|(1|r|u|rev|об)\s*/\s*min|min\s*(\^?-1|⁻¹)|об/мин", re.IGNORECASE)
"""Names of a spindle speed that say its unit, r/min."""


def heating_tests(
    reading: Reading, response: Sequence[str] = ()
) -> tuple[Recording, tuple[str, ...], tuple[Finding, ...]]:
    """The recording without the faults of speed and displacements, which these are, and what was found.

    `response` are the displacements or temperatures to be predicted; default: all displacements there are. Faults of
    temperatures around the machine are left out, too.

    Raises OptionError: There is no displacement, one is faulty in every run, or a unit was guessed.
    """
    recording = reading.recording
    responses = tuple(dict.fromkeys(response)) if response else recording.with_role("displacement")
    speeds = recording.with_role("spindle_speed")
    if not responses:
        raise OptionError(
            "no displacement in the recordings", expected="a channel with the role displacement",
            where="the recordings", advice="give the channel of the gauge that role in the machine file",
        )  # fmt: skip
    used = {name for name in (*responses, *speeds) if name in recording.names}
    _require_units(reading, used)
    # where a displacement starts is its zero here, and it may have moved on within the first samples
    halls = set(recording.with_role("ambient"))
    faults = [fault for fault in inspect(recording, used | halls) if fault.id != RUN_STARTS_WARM]
    clean = without_faults(recording, faults)
    gone = sorted(used - set(clean.names))
    if gone:
        why = next((fault.statement for fault in faults if fault.where.channel == gone[0]), "it is faulty in every run")
        raise OptionError(
            f"{gone[0]} is left out of every run: {why}", expected="readings without a fault",
            where="the recordings", advice="look at the findings of `selector describe`, and correct the files",
        )  # fmt: skip
    return clean, responses, (*reading.findings, *faults)


def _require_units(reading: Reading, used: set[str]) -> None:
    """A displacement in the wrong unit becomes a wrong correction, a time in the wrong unit a late one: no guessing."""
    if "unit" in reading.reading["time"]["guessed"]:
        raise OptionError(
            f"no unit of the time (column {', '.join(map(repr, reading.reading['time']['columns']))})",
            expected="a unit that the file or the machine file says", where="the recordings",
            advice='write unit = "s" (or "min", ...) under [time] in the machine file, or give --time-unit',
        )  # fmt: skip
    choices = {"spindle_speed": ("rpm", "1/s"), "displacement": ("um", "mm")}
    for channel in reading.channels:
        if channel.name not in used or channel.role not in choices or "unit" not in channel.guessed:
            continue
        named = any(_SPEED_UNIT.search(name) for name in (channel.name, str(channel.column)))
        if channel.role == "displacement" or not named:
            unit, other = choices[channel.role]
            raise OptionError(
                f"no unit of {channel.name} (taken for {channel.unit_in_file})",
                expected="a unit that the file or the machine file says", where="the recordings",
                advice=f'write unit = "{unit}" (or "{other}") under [channels.{channel.name}], or give --unit '
                f"{channel.name}={unit}",
            )  # fmt: skip
