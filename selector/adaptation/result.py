"""The result of `selector adapt`: kind, errors with and without touch-offs, when to probe, and what was found."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from selector.adaptation.drift import Course, Drift, Touches, tracked
from selector.adaptation.finding_table import FINDINGS
from selector.adaptation.judged import KINDS, LEVEL, WORTH, Judged, JudgedRun, Kind, Policy, judged, policy_within
from selector.findings import Finding, Where

SCHEMA = "selector.adaptation/1"
FEW_RUNS = 4
HELD = (0.85, 0.95)  #: Shares of unseen samples in 90 % intervals that are not worth a word.


@dataclass(frozen=True, eq=False)
class Adaptation:
    """What touch-offs make of a model."""

    kind: Kind  #: The richest of any response
    responses: Mapping[str, Judged]
    every_s: float | None  #: Period of the touch-offs; None: as they were measured, or none at all
    policy: Policy | None
    findings: tuple[Finding, ...]

    def as_dict(self) -> dict[str, Any]:
        """The object ``selector.adaptation/1``."""
        runs = dict.fromkeys(run for of in self.responses.values() for run in of.accuracy)
        return {
            "schema": SCHEMA,
            "kind": self.kind,
            "every_s": self.every_s,
            "per_run": {
                run: {name: of.accuracy[run].as_dict() for name, of in self.responses.items() if run in of.accuracy}
                for run in runs
            },
            "overall": {name: of.overall.as_dict() for name, of in self.responses.items()},
            "responses": {name: _learnt(of) for name, of in self.responses.items()},
            "policy": None if self.policy is None else self.policy.as_dict(),
            "findings": [finding.as_dict() for finding in self.findings],
        }


def _learnt(of: Judged) -> dict[str, Any]:
    """What was learnt of one response, in units of a shop: per square root of an hour."""
    unseen = {kind: of.rmse_um_of.get(kind) for kind in KINDS}
    last = of.last_reading_rmse_um
    if of.learnt is None:
        return {"kind": of.kind, "unseen_rmse_um": unseen, "last_reading_rmse_um": last, "drift": None}
    drift = of.learnt.drift
    hour = 3600.0**0.5
    return {
        "kind": of.kind,
        "unseen_rmse_um": unseen,
        "last_reading_rmse_um": last,
        "drift": {
            "offset_um_per_sqrt_h": drift.offset_um2_per_s**0.5 * hour,
            "offset_start_um": drift.offset_start_um2**0.5,
            "gain_per_sqrt_h": drift.gain_per_s**0.5 * hour,
            "gain_start": drift.gain_start**0.5,
            "noise_um": drift.noise_um2**0.5,
            "offset_limit_um": drift.offset_limit_um,
            "gain_limit": drift.gain_limit,
        },
    }


def adaptation(
    courses: Mapping[str, Sequence[Course]],
    *,
    every_s: float | None = None,
    within_um: float | None = None,
    told: Sequence[Finding] = (),
    say: Callable[[str], None] | None = None,
) -> Adaptation:
    """What touch-offs make of a model, response by response, each run judged with what the others taught.

    With `every_s` the recorded displacement is seen only in that period [s]; with `within_um` the period is looked
    for that holds the error within it; with neither the courses have touch-offs of their own. `told`: what is known
    of the recordings already; `say` hears what is being done.
    """
    policy = None
    if within_um is not None:
        policy, of = policy_within(within_um, courses, say)
        every_s = policy.every_s
    else:
        of = {}
        for name, several in courses.items():
            if say is not None:
                say(name)
            of[name] = judged(several, every_s)
    kind: Kind = max((one.kind for one in of.values()), key=KINDS.index, default="none")
    is_probed = within_um is None or every_s is not None
    found = [finding for name, one in of.items() for finding in _of_response(name, one, is_probed=is_probed)]
    return Adaptation(kind, of, every_s, policy, (*told, *found, *_of_policy(policy)))


def _of_response(name: str, of: Judged, *, is_probed: bool) -> Iterator[Finding]:
    n_runs, overall = len(of.runs), of.overall

    def told(id_: str, said: str, evidence: Mapping[str, Any], run: str | None = None) -> Finding:
        return FINDINGS.finding(id_, said, Where(channel=name, run=run), evidence)

    if not is_probed:
        if n_runs < FEW_RUNS:
            said = f"What the model of {name} alone holds is seen in {n_runs} run{'s' * (n_runs > 1)} only: "
            yield told("adaptation-few-runs", f"{said}another day may be worse.", {"runs": n_runs})
        return
    untouched = [run.course.run for run in of.runs if not len(run.course.touched_at)]
    if untouched:
        listed = ", ".join(untouched[:8]) + (f" and {len(untouched) - 8} more" if len(untouched) > 8 else "")
        said = f"No touch-off of {name} falls into {listed}: there the model works alone."
        yield told("no-touch-off", said, {"runs": untouched}, untouched[0] if len(untouched) == 1 else None)
    if n_runs < 2:
        said = f"{name} was compared in {n_runs} run{'s' * (n_runs != 1)}: what a run teaches has to be tried on "
        yield told("adaptation-not-judged", f"{said}another one, so nothing is adapted.", {"runs": n_runs})
        return
    if not of.rmse_um_of:
        return
    if n_runs < FEW_RUNS:
        said = f"Drift and noise of {name} are learnt from {n_runs - 1} of {n_runs} runs at a time."
        yield told("adaptation-few-runs", said, {"runs": n_runs})
    if of.kind == "none":
        best = min(of.rmse_um_of[kind] for kind in KINDS[1:])
        yield told(
            "adaptation-no-better",
            f"{name}: on runs that did not teach it, adaptation leaves {best:.3g} µm (RMS) and the model alone "
            f"{of.rmse_um_of['none']:.3g} µm; that is no gain that holds whichever run is left out. Nothing is "
            "adapted.",
            {str(kind): value for kind, value in of.rmse_um_of.items()},
        )
    last, left = of.last_reading_rmse_um, overall.rmse_um
    if last is not None and left is not None and last < WORTH * left:
        pairs = zip(of.runs, of.last_reading_um, strict=True)
        better = [run.course.run for run, um in pairs if um < (of.accuracy[run.course.run].rmse_um or 0.0)]
        yield told(
            "last-reading-better",
            f"{name}: with the last reading as offset, {last:.3g} µm (RMS) are left, adapted {left:.3g} µm; the last "
            f"reading is better in {len(better)} of {n_runs} runs. It follows wrong readings, too.",
            {"last_reading_um": last, "adapted_um": left, "runs": better},
        )
    share = overall.interval_share
    if of.learnt is not None and share is not None and not HELD[0] <= share <= HELD[1]:
        said = f"{name}: of the samples of unseen runs, {100 * share:.1f} % are in their {100 * LEVEL:.0f} % interval."
        yield told("interval-not-held", said, {"level": LEVEL, "share": share})
    if of.learnt is not None:
        for run in of.runs:
            yield from _of_run(name, run, of.learnt.drift)


def _of_run(name: str, run: JudgedRun, drift: Drift) -> Iterator[Finding]:
    touches = Touches.of([run.course])
    followed = tracked(drift, touches)
    refused = touches.time_s[0][~followed.is_believed[0, 1:] & np.isfinite(touches.error_um[0])]
    start_s = float(run.course.time_s[0])
    if len(refused):
        at = [float(t - start_s) for t in refused]
        shown = ", ".join(f"{t:.0f}" for t in at[:5]) + (" …" if len(at) > 5 else "")
        yield FINDINGS.finding(
            "touch-off-refused",
            f"{name} in run {run.course.run}: {len(at)} of {len(run.course.touched_at)} touch-offs were not believed "
            f"(at {shown} s).",
            Where(channel=name, run=run.course.run, from_s=at[0], to_s=at[-1]),
            {"times_s": at},
        )
    if np.max(np.abs(followed.offset)) >= drift.offset_limit_um:
        yield FINDINGS.finding(
            "offset-limit-reached",
            f"{name} in run {run.course.run}: the offset reaches its limit of ± {drift.offset_limit_um:g} µm.",
            Where(channel=name, run=run.course.run),
            {"offset_limit_um": drift.offset_limit_um},
        )


def _of_policy(policy: Policy | None) -> Iterator[Finding]:
    if policy is None:
        return
    evidence = policy.as_dict()
    if policy.is_reached and policy.every_s is None:
        yield FINDINGS.finding(
            "within-without-probing",
            f"The model alone is within ± {policy.within_um:g} µm in {100 * policy.share_within:.1f} % of the time.",
            None,
            evidence,
        )
    if not policy.is_reached:
        how = "without touch-offs" if policy.every_s is None else f"with one every {policy.every_s / 60.0:g} min"
        yield FINDINGS.finding(
            "within-not-reached",
            f"No rate of probing that was tried holds ± {policy.within_um:g} µm in 95 % of the time; "
            f"{100 * policy.share_within:.1f} % was the most, {how}.",
            None,
            evidence,
        )
