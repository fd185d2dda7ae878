"""What is told of a selection: what to do, in plain words, then why, then everything."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from selector.atomic_file import write_whole
from selector.findings import Finding
from selector.number_text import number_text
from selector.selection import Selection
from selector.selection.result import FIXED_SET
from selector.telling import origin
from selector.telling.account import (
    Account,
    Block,
    Captioned,
    Formula,
    Heading,
    Note,
    Paragraph,
    Remarks,
    grouped_remarks,
    next_steps,
    remarks_of,
    section,
    sections,
)
from selector.telling.numbers import listed
from selector.telling.selected.advice import advice, useless_responses
from selector.telling.selected.formula import formula_text, legend_rows
from selector.telling.selected.tables import (
    coefficients_table,
    combinations_table,
    curve_table,
    equal_table,
    faults_table,
    gain_table,
    groups_table,
    quality_table,
    range_table,
    runs_table,
    sensors_table,
)
from selector.telling.wording import label_text

Description = Mapping[str, Any]

NO_READINGS = (
    "Not drawn: loops of the displacement over each temperature, and the range of the inputs. An earlier version of "
    "selector wrote this result, without readings; `selector select` on the same recordings writes it with them."
)


def selection_account(
    selection: Selection,
    description: Description | None = None,
    *,
    title: str | None = None,
    date: str | None = None,
    drawn: bool = False,
) -> Account:
    """All that is told of a selection; `drawn`: for a page. Default of the title: the machine's name.

    The date is shown as it is; the clock is never read, so that equal results give equal bytes.
    """
    described = description or {}
    machine = str(selection.provenance.get("machine") or "")
    heading = title or ": ".join(filter(None, ["Sensor selection", machine]))
    unnamed = f"Machine: {machine}" if machine and machine not in heading else ""
    verdict, sentences = advice(selection)
    drift = [Captioned("", one, on_screen=False) for one in [origin.drift_table(described)] if one is not None]
    drawings: Mapping[str, Sequence[Block]] = {}
    if drawn:
        from selector.telling.selected.pictures import drawings as drawings_of

        drawings = drawings_of(selection, described)

    def concerning(part: str) -> list[Block]:
        remarks = grouped_remarks(_of_part(selection, part))
        return [Remarks(remarks)] if remarks else []

    return Account(
        title=heading,
        about=" · ".join(filter(None, [date, unnamed])),
        label=label_text("these recordings", title or "", selection.provenance, described),
        verdict=verdict,
        sentences=sentences,
        answer=gain_table(selection),
        front=_front(selection, drawings),
        sections=sections(
            section(
                "proof",
                "Why: what unseen data say",
                *concerning("proof"),
                Paragraph(selection.because, on_screen=True),
                *drawings.get("curve", ()),
                Captioned("Error against number of sensors", curve_table(selection)),
                *drawings.get("proof", ()),
                None if selection.readings else Note(NO_READINGS),
                link="Proof",
            ),
            section(
                "groups",
                "Why: which sensors move together",
                *concerning("groups"),
                Paragraph(_sentence(selection.grouping.because)),
                Captioned("", groups_table(selection)),
                *drawings.get("groups", ()),
                link="Groups",
            ),
            section("model", "The model", *concerning("model"), *_model(selection), link="Model"),
            section(
                "recordings",
                "The recordings",
                *concerning("recordings"),
                *drift,
                link="Recordings",
                on_paper=any(one.level != "info" for one in _of_part(selection, "recordings")),
            ),
            section("sets", "Sets that were compared", *_sets(selection), link="Sets compared", on_paper=False),
            section(
                "faults",
                "Sensor faults",
                *drawings.get("faults", ()),
                Captioned("", faults_table(selection), on_screen=False),
                on_paper=False,
            ),
            section("terms", "Term by term", *_terms(selection, drawings), on_paper=False),
            section(
                "sensors",
                "Every sensor",
                Captioned("", sensors_table(selection), on_screen=False),
                on_paper=False,
            ),
            section(
                "findings",
                "All findings",
                Remarks(remarks_of(selection.findings)),
                link="Findings",
                on_paper=False,
            ),
            section(
                "origin",
                "Origin",
                *origin.origin_parts(described, selection.provenance),
                Captioned("Options", origin.options_table(selection), on_screen=False),
                on_paper=False,
            ),
        ),
        data=selection.as_dict(),
        brief=(),
        footer="The same recordings and options give the same bytes.",
    )


_CONCERNS = {
    id_: part
    for part, ids in {
        "proof": "regimes one-run-only few-runs runs-left-out-in-groups no-better-than-nothing runs-not-proved "
        "one-part-unlike-the-others choice-at-limit target-missed runs-outside-the-others unstable-choice",
        "groups": "chaining round-without-effect constant-must constant-sensor duplicate-sensors "
        "anticorrelated-sensors",
        "model": "terms-that-help terms-not-used collinear-terms correlated-residuals influential-sample ridge "
        "dependent-columns constant-column samples-thinned",
    }.items()
    for id_ in ids.split()
}
"""Finding → the part of the page that it concerns; others concern the recordings."""


def _of_part(selection: Selection, part: str) -> list[Finding]:
    return [one for one in selection.findings if _CONCERNS.get(one.id, "recordings") == part]


def _front(selection: Selection, drawings: Mapping[str, Sequence[Block]]) -> tuple[Block, ...]:
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
    steps = next_steps(selection.findings, *([] if useless_responses(selection) else [then]))
    return Paragraph(sure, "How sure."), Heading("What to do next", 3), steps, *drawings.get("proof", ())[:1]


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


def _sets(selection: Selection) -> list[Block]:
    shape = str(selection.recipe.shape)
    text = (
        f"All in the chosen shape ({shape}). The unseen error here is that of the {FIXED_SET}: its coefficients are "
        "refitted without each part, the sensors stay. The choice compares these errors; the whole procedure above, "
        "which chooses the sensors anew, is the error to expect."
    )
    compared = (Captioned(name, combinations_table(selection, name), on_screen=False) for name in selection.models)
    every = equal_table(selection)
    equal = [] if every is None else [Captioned("Sets to take instead", every)]
    return [*equal, Paragraph(text), *compared]


def _model(selection: Selection) -> list[Block]:
    legend = "; ".join(f"{symbol}: {meaning}" for symbol, meaning in legend_rows(selection))
    formulas: list[Block] = [Formula(formula_text(selection, name)) for name in selection.models]
    note = Note(f"Displacements in µm; ± one standard error. {legend}.")
    return [*formulas, note, Captioned("Quality", quality_table(selection))]


def _terms(selection: Selection, drawings: Mapping[str, Sequence[Block]]) -> list[Block]:
    blocks: list[Block] = []
    for name in selection.models:
        blocks.append(Captioned(f"Coefficients of {name}", coefficients_table(selection, name)))
        blocks += drawings.get(f"model {name}", ())
        blocks.append(Captioned(f"{name}, part by part", runs_table(selection, name), on_screen=False))
    return [*blocks, Captioned("Valid range", range_table(selection), on_screen=False), *drawings.get("range", ())]


def _sentence(text: str) -> str:
    """The text with a capital and a full stop; λ stays as it is."""
    first = text[:1] if text[:1] == "λ" else text[:1].upper()
    return f"{first}{text[1:].rstrip('.')}."
