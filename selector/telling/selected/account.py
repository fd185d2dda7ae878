"""What is told of a selection: what to do, in plain words, then why, then everything."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from selector.atomic_file import write_whole
from selector.findings import Finding
from selector.models.design import Term
from selector.models.moments import WORTH_OF_A_SENSOR
from selector.number_text import SUPERSCRIPTS, listed, number_text, span_text
from selector.selection import Selection
from selector.selection.result import BEST_OF_SIZE, FIXED_SET, PROCEDURE, Combination, told_apart
from selector.telling import account, origin
from selector.telling.numbers import NONE, beside_text, p_text, share_text, uncertain_text
from selector.telling.origin import label_text
from selector.telling.selected.advice import advice, useless_responses

MOST_COMBINATIONS = 12


def gain_table(selection: Selection) -> account.Table:
    """What the model gains and what its faults cost, one row a displacement."""
    proof = selection.proof
    known, rows = selection.known, []
    for name, parts in proof.per_response.items():
        span = None if known is None else known.span_um(name, proof.rmse_um(name))
        faults = [one for one in selection.faults if one.response == name]
        worst = max(faults, key=lambda one: one.worst_um, default=None)
        single = [part.rmse_um for part in parts]
        rows.append(
            (
                name,
                proof.baselines_um[name]["none"],
                proof.rmse_um(name),
                *([" to ".join(number_text(end, 2) for end in span) if span else "cannot be told"] if known else []),
                f"{number_text(min(single))} to {number_text(max(single))}" if len(single) > 1 else None,
                proof.max_um(name),
                *((None, None) if worst is None else (worst.worst_um, worst.sensor)),
                max((one.per_kelvin_um for one in faults), default=None),
            )
        )
    headings = [
        "error of", ">without [µm]", f">unseen, {PROCEDURE} [µm]", *([">on further runs [µm]"] if known else []),
        f">single {proof.left_out}s [µm]", ">largest [µm]", ">worst fault [µm]", "of sensor", ">1 K too high [µm]",
    ]  # fmt: skip
    note = (
        f"Root mean square over all {proof.left_out}s that were left out in turn"
        + (", and what that of further ones is between, 19 times in 20" if known else "")
        + "; largest: of all their samples. The worst fault is a sensor that is stuck or open."
    )
    return account.table(headings, rows, note)


def curve_table(selection: Selection) -> account.Table:
    """Error on unseen data of each number of sensors."""
    rows = []
    for at, name in enumerate(selection.models):
        fixed = selection.fixed_set_errors_um(name)
        for point in selection.proof.curve:
            rows.append((name, str(point.n_sensors), float(point.rmse_um[at]), fixed.get(point.n_sensors)))
    headings = ["error of", ">sensors", f">unseen, {BEST_OF_SIZE} [µm]", f">unseen, {FIXED_SET} [µm]"]
    return account.table(headings, rows, f"Root mean squares. {told_apart(selection.proof.left_out)}")


def combinations_table(selection: Selection, response: str) -> account.Table:
    """The best sets by adjusted R², the chosen one and the best on unseen data among them."""
    compared = [one for one in selection.combinations if one.response == response]
    shown: dict[Combination, None] = dict.fromkeys(compared[:MOST_COMBINATIONS])
    finite = [one for one in compared if math.isfinite(one.heldout_rmse_um)]
    shown |= dict.fromkeys([min(finite, key=lambda one: one.heldout_rmse_um)] if finite else [])
    shown |= dict.fromkeys(one for one in compared if set(one.sensors) == set(selection.chosen))
    rows = [one for one in compared if one in shown]
    left = len(compared) - len(rows)
    return account.table(
        ["sensors", ">R²", ">adjusted R²", f">unseen, {FIXED_SET}: rms [µm]", "from"],
        [(", ".join(one.sensors), _r2(one.r2), _r2(one.adjusted_r2), one.heldout_rmse_um, one.origin) for one in rows],
        f"{left} more sets were compared." if left else "",
        [i for i, one in enumerate(rows) if set(one.sensors) == set(selection.chosen)],
    )


def equal_table(selection: Selection) -> account.Table | None:
    """Every set as large as the chosen one that is about as good as the best."""
    equal = selection.equal
    if equal is None:
        return None
    margin = f"{100 * WORTH_OF_A_SENSOR:.0f} %" if equal.within_um is None else f"{number_text(equal.within_um)} µm"
    left = equal.n_equal - len(equal.sets)
    return account.table(
        [
            "sensors",
            *(f">{name}: unseen, {FIXED_SET} [µm]" for name in selection.models),
            ">largest VIF",
            ">worst fault",
        ],
        [(", ".join(one.sensors), *one.heldout_rmse_um, one.largest_vif, one.worst_fault) for one in equal.sets],
        f"All {equal.n_compared} sets of this size were looked at: {equal.n_equal} have at most {margin} more error "
        "than the best of them, in every displacement. Worst fault: share of the displacement's spread that one sensor "
        "moves when it is wrong by its own spread." + (f" {left} more are not listed." if left else ""),
        [i for i, one in enumerate(equal.sets) if set(one.sensors) == set(selection.chosen)],
    )


def groups_table(selection: Selection) -> account.Table:
    """Groups of the first round, who represents them, and who was chosen."""
    rows = []
    representatives = set(selection.grouping.chosen.representatives)
    for i, group in enumerate(selection.grouping.chosen.rounds[0].groups):
        names = [selection.sensors[k] for k in group]
        kept = ([name for name in names if name in some] for some in (representatives, selection.chosen))
        rows.append((str(i + 1), ", ".join(names), *(", ".join(some) or NONE for some in kept)))
    marked = [i for i, row in enumerate(rows) if row[3] != NONE]
    return account.table([">group", "sensors", "representative", "chosen"], rows, marked=marked)


def memberships_table(selection: Selection) -> account.Table | None:
    """How far every sensor belongs to every fuzzy group; None if the groups are those of a cut."""
    fuzzy = selection.grouping.chosen.fuzzy
    if fuzzy is None:
        return None
    between = {i for i, _, _ in fuzzy.between}
    cut = selection.grouping.axis.at(fuzzy.partition.level).partition
    return account.table(
        ["sensor", *(f">group {k + 1}" for k in range(fuzzy.memberships.shape[1])), "between two groups"],
        [
            (name, *(f"{share:.2f}" for share in row), "yes" if i in between else NONE)
            for i, (name, row) in enumerate(zip(selection.sensors, fuzzy.memberships.tolist(), strict=True))
        ],
        f"Memberships of fuzzy c-means, partition coefficient {number_text(fuzzy.fpc)} (1: crisp). The cut at "
        f"λ = {fuzzy.partition.level:.6g} with {len(cut.members)} groups agrees on {share_text(fuzzy.agreement(cut))} "
        "of all pairs of sensors.",
        sorted(between),
    )


def sensors_table(selection: Selection) -> account.Table:
    """Every sensor: group, kept or dropped and why, and how stable that is."""
    group_of = {k: i for i, group in enumerate(selection.grouping.chosen.rounds[0].groups) for k in group}
    return account.table(
        ["sensor", ">group", "why", ">chosen in resamples"],
        [
            (
                name,
                str(group_of[k] + 1) if k in group_of else NONE,
                selection.reasons.get(name, NONE),
                share_text(selection.stability[name]) if name in selection.stability else None,
            )
            for k, name in enumerate(selection.sensors)
        ],
        account.legend("selected.resamples"),
        [k for k, name in enumerate(selection.sensors) if name in selection.chosen],
    )


def runs_table(selection: Selection, response: str) -> account.Table:
    """Errors of every left-out part, with the sensors that were chosen without it, and in sample."""
    fitted = selection.fit_per_run[response]
    proved = {part.name for part in selection.proof.per_response[response]}
    rows: list[tuple[str | float | None, ...]] = []
    for part in selection.proof.per_response[response]:
        errors = (part.before_rmse_um, part.before_max_um, part.rmse_um, part.max_um)
        in_sample = fitted[part.name][0] if part.name in fitted else None
        rows.append((part.name, *errors, beside_text(part.mean_um, part.rmse_um), in_sample, ", ".join(part.sensors)))
    rows += [(run, *[None] * 5, fit[0], "") for run, fit in fitted.items() if run not in proved]
    return account.table(
        [
            selection.proof.left_out, ">before: rms [µm]", ">before: largest [µm]", ">unseen: rms [µm]",
            ">unseen: largest [µm]", ">unseen: mean [µm]", ">in sample: rms [µm]", "sensors chosen without it",
        ],
        rows,
    )  # fmt: skip


def coefficients_table(selection: Selection, response: str) -> account.Table:
    """The model in physical units."""
    return account.table(
        ["term", ">coefficient ± standard error", "unit", ">VIF"],
        list(coefficient_rows(selection, response)),
        account.legend("selected.terms"),
    )


def quality_table(selection: Selection) -> account.Table:
    """Fit, proof and diagnostics of every model."""
    models, proof = selection.models, selection.proof
    columns: list[dict[str, str | float]] = [
        {
            "R²": _r2(model.r2),
            "adjusted R²": _r2(model.adjusted_r2),
            "error in sample, rms [µm]": model.rmse_um,
            f"error unseen, {PROCEDURE}, rms [µm]": proof.rmse_um(name),
            f"error unseen, {PROCEDURE}, largest [µm]": proof.max_um(name),
            "samples [–]": str(model.n_samples),
            "condition number [–]": model.diagnostics.condition_number,
            "Durbin–Watson [–]": model.diagnostics.durbin_watson,
            "Ljung–Box p [–]": p_text(model.diagnostics.ljung_box_p),
            "largest Cook's distance [–]": number_text(model.diagnostics.max_cooks_distance, 2),
            "ridge penalty [–]": number_text(model.ridge, 2),
        }
        for name, model in models.items()
    ]
    rows = [(line, *(column[line] for column in columns)) for line in columns[0]]
    return account.table(["", *(f">{name}" for name in models)], rows)


def faults_table(selection: Selection) -> account.Table:
    """What a fault of each sensor does."""
    return account.table(
        ["sensor", "response", ">1 K too high [µm]", ">stuck [µm]", ">open [µm]"],
        [(one.sensor, one.response, one.per_kelvin_um, one.stuck_um, one.open_um) for one in selection.faults],
        account.legend("selected.faults"),
    )


def _r2(value: float) -> str:
    return f"{value:.5f}".replace("-", "−") if math.isfinite(value) else NONE


Description = Mapping[str, Any]


def selection_account(
    selection: Selection,
    description: Description | None = None,
    *,
    title: str | None = None,
    date: str | None = None,
    drawn: bool = False,
) -> account.Account:
    """All that is told of a selection; `drawn`: for a page. Default of the title: the machine's name.

    The date is shown as it is; the clock is never read, so that equal results give equal bytes.
    """
    described = description or {}
    machine = str(selection.provenance.get("machine") or "")
    heading = title or ": ".join(filter(None, ["Sensor selection", machine]))
    unnamed = f"Machine: {machine}" if machine and machine not in heading else ""
    verdict, sentences = advice(selection)
    drawings: Mapping[str, Sequence[account.Block]] = {}
    if drawn:
        from selector.telling.selected.pictures import drawings as drawings_of

        drawings = drawings_of(selection, described)

    def concerning(part: str) -> list[account.Block]:
        remarks = account.grouped_remarks(_of_part(selection, part))
        return [account.Remarks(remarks)] if remarks else []

    return account.Account(
        title=heading,
        about=" · ".join(filter(None, [date, unnamed])),
        label=label_text("these recordings", title or "", selection.provenance, described),
        verdict=verdict,
        sentences=sentences,
        answer=gain_table(selection),
        front=_front(selection, drawings),
        sections=account.sections(
            account.section(
                "proof",
                "Why: what unseen data say",
                *concerning("proof"),
                account.Paragraph(selection.because, on_screen=True),
                *drawings.get("curve", ()),
                account.Captioned("Error against number of sensors", curve_table(selection)),
                *drawings.get("proof", ()),
                link="Proof",
            ),
            account.section(
                "groups",
                "Why: which sensors move together",
                *concerning("groups"),
                account.Paragraph(account.sentence(selection.grouping.because)),
                account.Captioned("", groups_table(selection)),
                account.captioned("Memberships", memberships_table(selection)),
                *drawings.get("groups", ()),
                link="Groups",
            ),
            account.section("model", "The model", *concerning("model"), *_model(selection), link="Model"),
            account.section(
                "recordings",
                "The recordings",
                *concerning("recordings"),
                account.captioned("", origin.drift_table(described), on_screen=False),
                link="Recordings",
                on_paper=any(one.level != "info" for one in _of_part(selection, "recordings")),
            ),
            account.section("sets", "Sets that were compared", *_sets(selection), link="Sets compared", on_paper=False),
            account.section(
                "faults",
                "Sensor faults",
                account.Captioned("", faults_table(selection), on_screen=False),
                on_paper=False,
            ),
            account.section("terms", "Term by term", *_terms(selection), on_paper=False),
            account.section(
                "sensors",
                "Every sensor",
                account.Captioned("", sensors_table(selection), on_screen=False),
                on_paper=False,
            ),
            account.findings_section(selection.findings, on_paper=False),
            account.section(
                "origin",
                "Origin",
                *origin.origin_parts(described, selection.provenance),
                account.Captioned("Options", origin.options_table(selection), on_screen=False),
                on_paper=False,
            ),
        ),
        data=selection.as_dict(),
        brief=(),
        footer="The same recordings and options give the same bytes.",
    )


#: Finding → the part of the page that it concerns; those of other rooms concern the recordings.
_CONCERNS = {
    id_: part
    for part, ids in {
        "proof": "regimes one-run-only few-runs runs-left-out-in-groups no-better-than-nothing runs-not-proved "
        "one-part-unlike-the-others choice-at-limit target-missed target-met-already runs-outside-the-others "
        "unstable-choice",
        "groups": "chaining round-without-effect constant-must constant-sensor duplicate-sensors "
        "anticorrelated-sensors between-groups",
        "model": "terms-that-help terms-not-used collinear-terms correlated-residuals influential-sample ridge "
        "dependent-columns constant-column samples-thinned",
        "recordings": "incomplete-rows memory-goes-on run-without-displacement samples-lost sensor-missing",
    }.items()
    for id_ in ids.split()
}


def _of_part(selection: Selection, part: str) -> list[Finding]:
    return [one for one in selection.findings if _CONCERNS.get(one.id, "recordings") == part]


def _front(selection: Selection, drawings: Mapping[str, Sequence[account.Block]]) -> tuple[account.Block, ...]:
    """How sure it is, what to do next, and one picture."""
    proof, worst = selection.proof, []
    for name, parts in proof.per_response.items():
        part = max(parts, key=lambda one: one.rmse_um)
        errors = f"{number_text(part.rmse_um, 2)} µm rms, {number_text(part.max_um, 2)} µm at most"
        worst.append(f"{name} is worst in {part.name} ({errors})")
    parts_of = next(iter(proof.per_response.values()))
    sure = (
        f"Each of the {len(parts_of)} {proof.left_out}s was predicted by sensors and a model that were chosen without "
        f"it; {listed(worst)}."
    )
    then = "Try the model on later runs with `selector apply`, then hand it to the control with `selector export`."
    steps = account.next_steps(selection.findings, *([] if useless_responses(selection) else [then]))
    return (
        account.Paragraph(sure, "How sure."),
        account.Heading("What to do next", 3),
        steps,
        *drawings.get("proof", ())[:1],
    )


def write_report(
    selections: Selection | Sequence[Selection],
    path: str | Path,
    *,
    title: str | None = None,
    description: Description | Sequence[Description | None] | None = None,
    date: str | None = None,
) -> Path:
    """Write the report of one or several selections as one HTML file that needs no network; whole or not at all.

    Several stand one after the other, each under the name of its machine. `description`: how the recordings were read,
    as `selector describe` says it, one per selection. The date is shown as it is; the clock is never read.

    Raises OptionError: the file cannot be written; an old file of that name is untouched.
    """
    from selector.telling.page import account_page, one_page

    several = (selections,) if isinstance(selections, Selection) else tuple(selections)
    described = [description] if description is None or isinstance(description, Mapping) else [*description]
    described += [None] * (len(several) - len(described))
    own_title = title if len(several) == 1 else None
    pages = [
        account_page(selection_account(one, of_one, title=own_title, date=date, drawn=True))
        for one, of_one in zip(several, described, strict=True)
    ]
    target = Path(path)
    # a lone surrogate in a name must not end the report
    write_whole(target, one_page(pages, title or "Sensor selection").encode("utf-8", "replace"))
    return target


def _sets(selection: Selection) -> list[account.Block | None]:
    shape = str(selection.recipe.shape)
    text = (
        f"All in the chosen shape ({shape}). The unseen error here is that of the {FIXED_SET}: its coefficients are "
        "refitted without each part, the sensors stay. The choice compares these errors; the whole procedure above, "
        "which chooses the sensors anew, is the error to expect."
    )
    compared = (
        account.Captioned(name, combinations_table(selection, name), on_screen=False) for name in selection.models
    )
    return [account.captioned("Sets to take instead", equal_table(selection)), account.Paragraph(text), *compared]


def _model(selection: Selection) -> list[account.Block]:
    legend = "; ".join(f"{symbol}: {meaning}" for symbol, meaning in legend_rows(selection))
    formulas: list[account.Block] = [account.Formula(formula_text(selection, name)) for name in selection.models]
    note = account.Note(f"Displacements in µm; ± one standard error. {legend}.")
    return [*formulas, note, account.Captioned("Quality", quality_table(selection))]


def _terms(selection: Selection) -> list[account.Block]:
    return [
        account.Captioned(text.format(name), of(selection, name), on_screen=not text.startswith("{}"))
        for name in selection.models
        for text, of in (("Coefficients of {}", coefficients_table), ("{}, part by part", runs_table))
    ]


def formula_text(selection: Selection, response: str) -> str:
    """One line, e.g. ``Z = (−1.871 ± 0.12) + (6.048 ± 0.031)·ΔT1``."""
    model = selection.models[response]
    terms, coefficients, errors = model.physical()
    parts = []
    if model.has_intercept:
        parts.append(f"({uncertain_text(float(coefficients[0]), float(errors[0]))})")
    for term, value, error in zip(terms, coefficients[1:], errors[1:], strict=True):
        parts.append(f"({uncertain_text(float(value), float(error))})·{term_text(selection, term)}")
    return f"{response} = {' + '.join(parts) or '0'}"


def legend_rows(selection: Selection) -> Iterator[tuple[str, str]]:
    """(symbol, meaning) of every variable in the formula."""
    for name in selection.recipe.design.variables:
        lag, source = selection.recipe.design.lag_and_source(name)
        if _is_rise(selection, source):
            meaning = f"rise of {source} since the start of the run [K]"
        else:
            meaning = f"reading of {source} [{unit_of(selection, name)}]"
        if lag:
            meaning += f", lagged with the time constant {lag.tau_s:.6g} s"
        yield variable_text(selection, name), meaning


def coefficient_rows(selection: Selection, response: str) -> Iterator[tuple[str, str, str, str]]:
    """(term, coefficient ± standard error, unit, VIF), the intercept first."""
    model = selection.models[response]
    terms, coefficients, errors = model.physical()
    vif = {tuple(sorted(term.powers)): float(value) for term, value in zip(model.terms, model.vif, strict=True)}
    if model.has_intercept:
        yield "intercept", uncertain_text(float(coefficients[0]), float(errors[0]), least=0), "µm", NONE
    for term, value, error in zip(terms, coefficients[1:], errors[1:], strict=True):
        inflation = vif.get(tuple(sorted(term.powers)))
        unit = _unit_of_term(selection, term)
        text = uncertain_text(float(value), float(error), least=0)
        yield term_text(selection, term), text, unit, number_text(inflation)


def term_text(selection: Selection, term: Term) -> str:
    """A term, e.g. ``ΔT1·ΔT3²``."""
    return "·".join(
        variable_text(selection, name) + (str(power).translate(SUPERSCRIPTS) if power > 1 else "")
        for name, power in term.powers
    )


def variable_text(selection: Selection, name: str) -> str:
    """The symbol of a variable: ``ΔT1`` for a rise, ``lag(ΔT1, 30 min)`` for its lag."""
    lag, source = selection.recipe.design.lag_and_source(name)
    # an operator or a blank inside a name would read as part of the formula
    plain = source if source.replace("_", "a").isalnum() else f"[{source}]"
    symbol = f"Δ{plain}" if _is_rise(selection, source) else plain
    return f"lag({symbol}, {span_text(lag.tau_s)})" if lag else symbol


def unit_of(selection: Selection, variable: str) -> str:
    """Unit of a variable: K for a rise, °C for a reading, rpm for a spindle speed."""
    _, source = selection.recipe.design.lag_and_source(variable)
    if source not in selection.recipe.sensors:
        return "rpm"
    return "K" if _is_rise(selection, source) else "°C"


def _unit_of_term(selection: Selection, term: Term) -> str:
    powers: dict[str, int] = {}
    for name, power in term.powers:
        # a coefficient is per difference, and a difference of °C is one of K
        unit = unit_of(selection, name).replace("°C", "K")
        powers[unit] = powers.get(unit, 0) + power
    below = "·".join(unit + (str(power).translate(SUPERSCRIPTS) if power > 1 else "") for unit, power in powers.items())
    return f"µm/{below}" if len(powers) < 2 else f"µm/({below})"


def _is_rise(selection: Selection, source: str) -> bool:
    return selection.options.reference == "rise" and source in selection.recipe.sensors
