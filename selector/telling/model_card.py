"""What a model is, where it comes from and how far it may be trusted, under the headings of ISO/TR 16907, clause 12."""

from selector.controllers.closed_values import Adaptation
from selector.controllers.evaluator import formula_text, legend_text
from selector.controllers.model_file import Input, ModelFile, equations_sha256, model_sha256
from selector.controllers.self_check import model_findings
from selector.number_text import number_text, span_text
from selector.telling import account
from selector.telling.numbers import NONE, uncertain_text

STANDARD = "ISO/TR 16907:2015, clause 12"


def model_card_account(model: ModelFile) -> account.Account:
    """What is told of a model file: formulas, what `card_blocks` says, and the check of the file."""
    blocks = (*formula_blocks(model), *card_blocks(model, 2), account.Heading("Self-check"))
    remarks = account.remarks_of(model_findings(model))
    return account.Account(
        model.name,
        (),
        (account.Section("card", "", (*blocks, remarks)),),
        about=f"Model card, headings after {STANDARD}",
    )


def formula_blocks(model: ModelFile) -> tuple[account.Block, ...]:
    """The formulas in readings and rises, and what stands for what in them."""
    return account.Formula(formula_text(model)), *(account.Note(line) for line in legend_text(model).splitlines())


def card_blocks(model: ModelFile, level: int, *, has_guard: bool = True) -> tuple[account.Block, ...]:
    """Machine and data, method, sensors and ranges, coefficients with uncertainty, limits, validation, identity.

    Headings are of this level. Without limits where the control that it is for has no guard.
    """
    tables = {
        "Machine and data": _data(model),
        "Method": _method(model),
        "Sensors and ranges": sensors_table(model, has_guard=has_guard),
        "Coefficients": _coefficients(model),
        **({"Limits and faults": limits_table(model)} if has_guard else {}),
        **({} if model.adaptation is None else {"Touch-offs": _touch_offs(model.adaptation)}),
        "Validation": _validation(model),
        "Identity": _identity(model),
    }
    return tuple(
        block
        for title, content in tables.items()
        for block in (account.Heading(title, level), account.Captioned("", content, on_screen=False))
    )


def sensors_table(model: ModelFile, *, has_guard: bool = True) -> account.Table:
    """Inputs in the order of their numbers, with what the model has seen; faults only where there is a guard."""
    return account.table(
        [">input", "sensor", "where", "what the model takes", ">from", ">to", "unit", "a fault is"],
        [
            (
                str(k),
                item.name,
                item.place or None,
                "rise since the start" if item.reference == "rise" else "reading",
                item.valid_min,
                item.valid_max,
                _unit(item),
                _faults(item) if has_guard else "not looked for",
            )
            for k, item in enumerate(model.inputs, start=1)
        ],
        "From and to: what the model has seen. Beyond it "
        + (
            "this control goes on with the formula."
            if not has_guard
            else "an input is limited to it."
            if model.guard.outside_valid_range == "limit-input"
            else "an input is treated as a fault."
        ),
    )


def limits_table(model: ModelFile) -> account.Table:
    """Limits of the correction, and what happens on faults and restarts."""
    guard = model.guard
    rows = []
    given = {limits.output: limits for limits in guard.limits}
    for output in model.outputs:
        limits = given.get(output.name)
        clamp = None if limits is None else limits.clamp_um
        slew = None if limits is None else limits.slew_um_per_s
        dead = 0.0 if limits is None else limits.dead_band_um
        rows += [
            (f"largest correction of {output.name}", "not decided" if clamp is None else f"±{number_text(clamp)} µm"),
            (f"largest change of {output.name}", "not decided" if slew is None else f"{number_text(slew)} µm/s"),
            (f"dead band of {output.name}", f"{number_text(dead)} µm"),
        ]
    rows += [
        ("when a sensor breaks", _on_fault(model)),
        ("a fault ends after good readings for", span_text(guard.recover_after_s)),
        (
            "a sensor that stands still is a fault after",
            NONE if guard.stuck_after_s is None else span_text(guard.stuck_after_s),
        ),
        ("after a restart", _restart(model)),
    ]
    return account.table(["", ""], rows)


def _touch_offs(of: Adaptation) -> account.Table:
    rows = [
        (
            one.output,
            one.noise_um2**0.5,
            one.offset_start_um2**0.5,
            (3600.0 * one.offset_um2_per_s) ** 0.5,
            one.offset_limit_um,
            100.0 * one.gain_limit or None,
        )
        for one in of.outputs
    ]
    headings = ["output", ">noise [µm]", ">offset at the start [µm]", ">drift [µm/√h]", ">offset at most [µm]"]
    note = (
        "Standard deviations. The correction is of displacement + offset + gain · displacement; a touch-off farther "
        f"than {of.gate:g} standard deviations from what is expected is believed when a second one agrees."
    )
    return account.table([*headings, ">gain at most [%]"], rows, note)


def _on_fault(model: ModelFile) -> str:
    guard = model.guard
    held = "" if guard.hold_at_most_s is None else f" for at most {span_text(guard.hold_at_most_s)}, then ramp to zero"
    words = {"hold": f"hold the last correction{held}", "ramp-to-zero": "ramp to zero"}
    if guard.on_fault != "fallback":
        return words[guard.on_fault]
    without = "; ".join(", ".join(one.without) for one in model.fallbacks)
    return (
        f"the model without it ({len(model.fallbacks)} models: without {without}); else {words[guard.without_fallback]}"
    )


def _restart(model: ModelFile) -> str:
    guard = model.guard
    if all(item.reference == "absolute" for item in model.inputs):
        return "nothing to take anew: the model has no rises"
    if guard.restart == "new-start":
        return "the next readings are the start readings"
    if guard.new_start_after_s is None:
        return "the stored start readings are kept"
    return (
        f"the stored start readings are kept; after more than {span_text(guard.new_start_after_s)} new ones are taken"
    )


def _data(model: ModelFile) -> account.Table:
    origin = model.provenance
    rows = [("machine", origin.machine or NONE), ("date", origin.date or NONE)]
    rows.append(("one sample every", NONE if origin.period_s is None else span_text(origin.period_s)))
    rows += [(f"run {run}, SHA-256", sha256) for run, sha256 in origin.data_sha256.items()]
    return account.table(["", ""], rows)


def _identity(model: ModelFile) -> account.Table:
    rows = [
        ("model file SHA-256", model_sha256(model)),
        ("equations SHA-256, as the programs have it", equations_sha256(model)),
        ("schema", model.schema_),
    ]
    return account.table(["", ""], rows)


def _method(model: ModelFile) -> account.Table:
    origin = model.provenance
    memory = ", ".join(f"{state.source} over {span_text(state.tau_s)}" for state in model.states)
    rows = [
        ("model", model.name),
        ("method", origin.method or None),
        ("why", origin.note or None),
        ("memory", memory or "none"),
        ("made by", None if origin.version is None else f"selector {origin.version}"),
        ("seed", None if origin.seed is None else str(origin.seed)),
    ]
    return account.table(["", ""], rows)


def _coefficients(model: ModelFile) -> account.Table:
    rows: list[tuple[str | float, ...]] = []
    for output in model.outputs:
        rows.append((output.name, "intercept", _uncertain(output.intercept, output.intercept_standard_error)))
        for term in output.terms:
            factors = " · ".join(name if power == 1 else f"{name}^{power}" for name, power in term.powers.items())
            rows.append((output.name, factors, _uncertain(term.coefficient, term.standard_error)))
        if output.position is not None:
            rows.append((output.name, f"slope over {output.position.axis} [µm/m]", output.position.intercept))
    return account.table(
        ["output", "term", ">coefficient ± standard error [µm]"], rows, account.legend("card.coefficients")
    )


def _validation(model: ModelFile) -> account.Table:
    return account.table(
        [
            "output",
            ">unseen: rms [µm]",
            ">unseen: largest [µm]",
            ">in sample: rms [µm]",
            ">adjusted R²",
            ">runs",
            "how",
        ],
        [
            (
                name,
                proof.heldout_rmse_um,
                proof.heldout_max_um,
                proof.rmse_um,
                number_text(proof.adjusted_r2, 5),
                None if proof.n_runs is None else str(proof.n_runs),
                proof.method or None,
            )
            for name, proof in model.validation.items()
        ],
        "" if model.validation else "This model has not been tried on data that it had not seen.",
    )


def _uncertain(value: float, error: float | None) -> str:
    return number_text(value, 5) if error is None else uncertain_text(value, error)


def _unit(item: Input) -> str:
    if item.unit == "degC":
        return "K" if item.reference == "rise" else "°C"
    return item.unit


def _faults(item: Input) -> str:
    unit = item.unit.replace("degC", "°C")
    told = []
    if item.reading_min is not None:
        told.append(f"below {number_text(item.reading_min)} {unit}")
    if item.reading_max is not None:
        told.append(f"above {number_text(item.reading_max)} {unit}")
    if item.rate_limit_per_min is not None:
        told.append(f"faster than {number_text(item.rate_limit_per_min)} {unit.replace('°C', 'K')}/min")
    return ", ".join(told) or NONE
