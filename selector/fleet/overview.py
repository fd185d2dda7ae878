"""What the answers of a fleet say together: errors run by run, the last watch, places that serve all machines."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import ValidationError

from selector.fleet.running import FleetAnswer
from selector.fleet.watching import WATCH_FILE, FleetWatch

Sets = Sequence[frozenset[str]]


@dataclass(frozen=True)
class Overview:
    """Beside the answers of a fleet; machines of which nothing is known are lacking."""

    #: Machine → response → error in every run when it was left out [µm], in the order of the proof
    by_run_um: Mapping[str, Mapping[str, tuple[float, ...]]] = field(default_factory=dict)
    serving: tuple[tuple[str, int], ...] = ()  #: See `serving`
    watch: FleetWatch | None = None  #: The last one that was kept
    single: tuple[str, ...] = ()  #: Machines with one run, whose error is that of its parts
    found: Mapping[str, str] = field(default_factory=dict)  #: Machine → the first of what its study found to be mended


def overview(results: Path, answer: FleetAnswer) -> Overview:
    """What lies in a results folder beside the answers; what cannot be read there is left out."""
    by_run: dict[str, dict[str, tuple[float, ...]]] = {}
    sets: dict[str, Sets] = {}
    single: list[str] = []
    found: dict[str, str] = {}
    for name, one in answer.machines.items():
        try:
            told = json.loads((results / str(one.key) / "selection.json").read_bytes())
            runs = {response: model["per_run"].values() for response, model in told["models"].items()}
            by_run[name] = {
                response: tuple(e for run in of if 0.0 < (e := float(run.get("heldout_rmse_um") or 0.0)) < math.inf)
                for response, of in runs.items()
            }
            findings = told.get("findings", ())
            single += [name] * any(finding["id"] == "one-run-only" for finding in findings)
            grave = [one for one in findings if one["level"] == "error" or one["id"] == "lost-readings-cost"]
            found |= {name: str(grave[0]["statement"])} if grave else {}
            equal = (told.get("equal_sets") or {}).get("sets", ())
            sets[name] = [frozenset(one.sensors), *(frozenset(of["sensors"]) for of in equal)]
        except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
            continue
    try:
        last = FleetWatch.model_validate_json((results / WATCH_FILE).read_bytes())
    except (OSError, ValidationError):
        return Overview(by_run, serving(sets), None, tuple(single), found)
    # what it said of a model that gave way to another one is no longer true
    used = {None, *(one.key for one in answer.machines.values())}
    watch = last.model_copy(update={"machines": {name: one for name, one in last.machines.items() if one.key in used}})
    return Overview(by_run, serving(sets), watch, tuple(single), found)


def serving(sets: Mapping[str, Sets]) -> tuple[tuple[str, int], ...]:
    """Sensor places to fit on every machine, one after the other, with how many machines are served by then.

    A machine is served when one of its sets, the chosen one or one about as good, is among the places. Next comes the
    sensor that brings the machines most of what they lack (a greedy cover): few places, not surely the fewest.
    """
    places: list[tuple[str, int]] = []
    have: set[str] = set()
    waiting = {name: of for name, of in sets.items() if any(of)}
    while waiting:
        # a set that lacks one sensor asks for it most, and the nearest set of a machine counts
        wanted: dict[str, float] = {}
        for of in waiting.values():
            for lacking in (one - have for one in of):
                for sensor in lacking:
                    wanted[sensor] = wanted.get(sensor, 0.0) + 1.0 / (len(of) * len(lacking) ** 2)
        best = max(sorted(wanted), key=lambda sensor: wanted[sensor])
        have.add(best)
        waiting = {name: of for name, of in waiting.items() if not any(one <= have for one in of)}
        places.append((best, len(sets) - len(waiting)))
    return tuple(places)
