"""A simulation beside the recordings that drove it: its channels under their names, and how far they are apart."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from selector.errors import OptionError
from selector.findings import Finding, Level, Where
from selector.physics.finding_table import FINDINGS
from selector.recording import Channel, Recording
from selector.types import Vector

#: Spread below which a recorded course is level, as a share of its size: nothing that a difference is a share of.
_LEVEL = 1e-9


@dataclass(frozen=True, eq=False)
class ChannelDifference:
    """One channel in one run, simulated minus recorded, at the samples at which it was recorded."""

    run: str
    channel: str
    unit: str  #: Of the channel, canonical; of a position of an axis "um" or "urad"
    time_s: Vector  #: (n_samples,): From the start of the run [s]
    #: recorded and simulated: (n_samples,): Both courses [unit]
    recorded: Vector
    simulated: Vector
    axis: str = ""  #: That the channel is of, if its model has axes
    kind: str = ""  #: What it is of the axis, of `drive_channels.KINDS`

    @property
    def rms(self) -> float:
        """Root mean square of the difference [unit]."""
        return float(np.sqrt(np.mean((self.simulated - self.recorded) ** 2)))

    @property
    def largest(self) -> float:
        """Largest amount of the difference [unit]."""
        return float(np.abs(self.simulated - self.recorded).max())

    @property
    def largest_at_s(self) -> float:
        """When it is the largest, from the start of the run [s]."""
        return float(self.time_s[np.argmax(np.abs(self.simulated - self.recorded))])

    @property
    def relative(self) -> float | None:
        """‖difference‖ / ‖recorded about its mean‖; None of a level course. It does not depend on where zero is."""
        spread = float(np.std(self.recorded))
        return self.rms / spread if spread > _LEVEL * float(np.abs(self.recorded).max()) else None


def as_recorded(simulated: Recording, recording: Recording, names: Mapping[str, str]) -> Recording:
    """The simulation with the names, places and axes of the recorded channels; others keep theirs.

    `names` is simulated channel → the recorded one that it belongs to.
    """
    taken, channels = {*recording.names}, []
    for own in simulated.channels:
        if own.name in names:
            there = recording.channel(names[own.name])
            place, axis = there.place or own.place, own.axis or there.axis
            channels.append(Channel(there.name, own.role, own.unit, place, axis, there.xyz_m))
            continue
        called = own.name
        while called in taken:  # a name that the recording uses for something else
            called += " (simulated)"
        taken.add(called)
        channels.append(replace(own, name=called))
    renamed = dict(zip(simulated.names, (channel.name for channel in channels), strict=True))
    return Recording(simulated.frame.rename(columns=renamed), tuple(channels), simulated.provenance)


def channel_differences(
    simulated: Recording, recorded: Recording, inputs: Collection[str] = ()
) -> tuple[ChannelDifference, ...]:
    """Every channel of the same name in both, run by run; those in `inputs` act on the model and are left out.

    Where the simulation has other times than the recording it is read between its samples, and only within its run.
    """
    found = []
    for run in (run for run in recorded.runs if run in simulated.runs):
        time_s, there_s = recorded.time_s(run), simulated.time_s(run)
        for channel in simulated.channels:
            name = channel.name
            if name in inputs or name not in recorded.names or recorded.channel(name).unit != channel.unit:
                continue
            courses = recorded.values(run, [name])[:, 0], simulated.values(run, [name])[:, 0]
            model = courses[1]
            if not np.array_equal(time_s, there_s):
                model = np.interp(time_s, there_s, model, left=np.nan, right=np.nan)
            seen = np.isfinite(courses[0]) & np.isfinite(model)
            if seen.any():
                found.append(
                    ChannelDifference(run, name, channel.unit, time_s[seen] - time_s[0], courses[0][seen], model[seen])
                )
    return tuple(found)


def require_named(said: str, recorded: Collection[str], taken: Collection[str], where: str) -> None:
    """Raises OptionError if a model file names a channel that is not recorded, or one for two things."""
    if said not in recorded:
        raise OptionError(
            f"no channel {said!r} in the recording",
            expected="one of " + ", ".join(list(recorded)[:20]),
            where=where,
            advice="correct the name, or leave it out",
        )
    if said in taken:
        raise OptionError(
            f"{said!r} twice", expected="a channel for one thing", where=where, advice="leave one of the two out"
        )


EVEN = 1e-3  #: Share of a period by which the stamps of an even clock may stray untold.
_FAR = 0.1  #: Share from which on it is a warning.


def clock_jitter(stray: float, done: str, where: Where | None = None) -> tuple[Finding, ...]:
    """What was `done` where stamps stray by this share of a period from an even clock; nothing where they do not."""
    if stray <= EVEN:
        return ()
    said = f"Stamps stray by up to {100 * stray:.1f} % of a period from an even clock: {done}."
    level: Level = "info" if stray < _FAR else "warning"
    return (FINDINGS.finding("recorded-clock-jitter", said, where, {"stray": stray}, level=level),)
