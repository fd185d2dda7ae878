"""What is told of an adaptation: how often to probe, what that leaves of the error, and what was learnt."""

from collections.abc import Iterator, Mapping
from typing import Any

from selector.adaptation.judged import KINDS, LEVEL, Accuracy, Judged
from selector.adaptation.result import Adaptation
from selector.number_text import number_text, span_text
from selector.telling import account, origin
from selector.telling.numbers import share_text
from selector.telling.origin import label_text

MOST_DRAWN = 6  #: Runs of a response that are drawn, the worst ones.
_WORDS = {"none": "nothing", "offset": "an offset", "offset+gain": "an offset and a gain"}


def adaptation_account(
    found: Adaptation,
    description: Mapping[str, Any] | None = None,
    provenance: Mapping[str, Any] | None = None,
    *,
    drawn: bool = False,
) -> account.Account:
    """All that is told of an adaptation; `description` and `provenance` as `selector describe` and reports have them.

    A page is `drawn`, with its drawings.
    """
    described, provenance = description or {}, provenance or {}
    verdict, sentences = _advice(found)
    overall = [(name, *_cells(of.overall)) for name, of in found.responses.items()]
    return account.Account(
        title=": ".join(filter(None, ["Touch-offs", str(provenance.get("machine") or "")])),
        label=label_text("the recordings", "", provenance, described),
        verdict=verdict,
        sentences=sentences,
        answer=account.table(["all runs", *_HEADINGS], overall, account.legend("adapted.errors")),
        sections=account.sections(
            account.warnings_section(found.findings),
            account.section("monday", "What to do", account.Items(_steps(found), are_steps=True), link="What to do"),
            account.section(
                "runs",
                "Run by run",
                account.Captioned("Errors", _runs_table(found)),
                *_drawings(found, drawn),
                link="Runs",
            ),
            account.section(
                "learnt", "What the runs teach", account.Captioned("What is followed", _learnt_table(found), False)
            ),
            account.findings_section(found.findings),
            account.section("origin", "Origin", *origin.origin_parts(described, provenance)),
        ),
        data=found.as_dict(),
        footer="The same recordings and options give the same bytes.",
    )


def _advice(found: Adaptation) -> tuple[account.Verdict, tuple[str, ...]]:
    told = [_of_response(name, of, found) for name, of in found.responses.items()]
    is_bad = found.policy is not None and not found.policy.is_reached
    is_nothing = found.kind == "none" and (found.policy is None or found.policy.every_s is not None)
    verdict: account.Verdict = "bad" if is_bad else "plain" if is_nothing else "good"
    return verdict, (*_of_policy(found), *told)


def _of_policy(found: Adaptation) -> Iterator[str]:
    policy = found.policy
    if policy is None:
        return
    share = share_text(min(policy.share_within, policy.share_within_unseen))
    if not policy.is_reached:
        how = "without probing" if policy.every_s is None else f"with a touch-off every {span_text(policy.every_s)}"
        yield (
            f"± {number_text(policy.within_um)} µm cannot be held in 95 % of the time, however often the machine is "
            f"probed; {share_text(policy.share_within)} was reached {how}."
        )
    elif policy.every_s is None:
        yield (
            f"No probing is needed: the model alone is within ± {number_text(policy.within_um)} µm in {share} of the "
            "time."
        )
    else:
        yield (
            f"Probe every {span_text(policy.every_s)}, {number_text(policy.touch_offs_per_day)} times a day: that "
            f"holds ± {number_text(policy.within_um)} µm in {share} of the time on runs that did not teach it."
        )


def _of_response(name: str, of: Judged, found: Adaptation) -> str:
    one = of.overall
    if one.rmse_um is None or one.without_rmse_um is None:
        return f"{name} was not recorded: nothing can be said of it."
    alone = f"{number_text(one.without_rmse_um)} µm (RMS) with the model alone"
    if of.kind == "none":
        return f"{name}: nothing is adapted; {alone}."
    often = "the touch-offs" if found.every_s is None else f"a touch-off every {span_text(found.every_s)}"
    return (
        f"{name}: {number_text(one.rmse_um)} µm are left with {often}, {alone}. Followed is {_WORDS[of.kind]}; on "
        f"unseen runs {share_text(one.interval_share or 0.0)} of the samples were in their {100 * LEVEL:.0f} % "
        "interval."
    )


def _steps(found: Adaptation) -> tuple[str, ...]:
    if found.kind == "none":
        return account.steps("adapted.as-it-is")
    often = "as in these runs" if found.every_s is None else f"every {span_text(found.every_s)}"
    return account.steps("adapted.steps", often=often)


_HEADINGS = [">with touch-offs", ">largest", ">model alone", ">before", ">touch-offs", ">in 90 % interval"]


def _runs_table(found: Adaptation) -> account.Table:
    rows = [
        (run, name, *_cells(accuracy)) for name, of in found.responses.items() for run, accuracy in of.accuracy.items()
    ]
    return account.table(["run", "response", *_HEADINGS], rows)


def _cells(one: Accuracy) -> tuple[str | float | None, ...]:
    share = None if one.interval_share is None else share_text(one.interval_share)
    errors = (one.rmse_um, one.max_um, one.without_rmse_um, one.before_rmse_um)
    return (*errors, str(one.touch_offs), share)


def _learnt_table(found: Adaptation) -> account.Table:
    rows = [(name, of.kind, *(of.rmse_um_of.get(kind) for kind in KINDS)) for name, of in found.responses.items()]
    headings = ["response", "kind", ">model alone [µm]", ">offset [µm]", ">offset and gain [µm]"]
    return account.table(
        headings, rows, "RMS errors on runs that did not teach; drift and noise are in the model card."
    )


def _drawings(found: Adaptation, drawn: bool) -> list[account.Drawing]:
    if not drawn:
        return []
    from selector.figures.panels import adapted_run

    drawings: list[account.Drawing] = []
    for name, of in found.responses.items():
        known = [(run, of.accuracy[run.course.run]) for run in of.runs]
        ranked = sorted(known, key=lambda one: -(one[1].rmse_um or 0.0))[:MOST_DRAWN]
        for run, one in ranked:
            if one.rmse_um is None or one.without_rmse_um is None:
                continue
            text = "" if drawings else account.legend("adapted.runs").format(most=MOST_DRAWN)
            drawings.append(account.Drawing(adapted_run(run, name, one.without_rmse_um, one.rmse_um), text))
    return drawings
