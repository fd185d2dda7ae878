"""Very many runs are left out in groups of whole runs, which is told; the error is still told run by run."""

from types import SimpleNamespace

import numpy as np
import pytest

from selector.models.design import Columns, Datum, Design, Scaling, Term, datum_of, rows_of
from selector.models.moments import moments
from selector.selection import Options, choice, select
from selector.selection.candidates import candidates
from selector.selection.library import Bench
from selector.selection.options import question_of
from selector.selection.proving import MOST_FOLDS, Folds, fold_of_run, held_out
from tests.models.runs import recording
from tests.selection.machines import found_ids, one_finding


def short_runs(n, seed=0):
    """Two sensors that matter and a third; every run has its own heat."""
    rng = np.random.default_rng(seed)
    runs = {}
    for r in range(n):
        heat = rng.uniform(1, 6, size=2) * (1 - np.exp(-np.arange(25)[:, None] / [5.0, 15.0]))
        table = {"T1": 20 + heat[:, 0], "T2": 20 + heat[:, 1], "T3": 20 + heat.sum(axis=1)}
        table = {name: values + rng.normal(0, 0.05, 25) for name, values in table.items()}
        table["Z"] = heat @ [5.0, -3.0] + rng.normal(0, 0.2, 25)
        runs[f"r{r + 1:03d}"] = (60.0 * np.arange(25), table)
    return recording(runs)


class TestFolds:
    def test_each_run_is_its_own_up_to_the_number(self):
        assert fold_of_run([f"r{i}" for i in range(MOST_FOLDS)], {}) is None

    @pytest.mark.parametrize("n", [MOST_FOLDS + 1, 100, 1000])
    def test_beyond_it_folds_are_of_about_one_size_whatever_the_order(self, n):
        runs = [f"r{i:04d}" for i in range(n)]
        folds = fold_of_run(runs, {})
        assert folds == fold_of_run(runs[::-1], {})
        sizes = np.unique(list(folds.values()), return_counts=True, axis=0)[1]
        assert len(sizes) == MOST_FOLDS
        assert np.ptp(sizes) <= 1

    def test_no_fold_holds_two_conditions(self):
        runs = [f"r{i:02d}" for i in range(90)]
        conditions = {run: "winter" if i < 60 else "summer" for i, run in enumerate(runs[:80])}
        folds = fold_of_run(runs, conditions)
        assert {fold: {conditions.get(run) for run in runs if folds[run] == fold} for fold in folds.values()}.keys()
        assert all(len({conditions.get(run) for run in runs if folds[run] == fold}) == 1 for fold in folds.values())
        assert len({fold for run, fold in folds.items() if conditions.get(run) == "winter"}) == 20


def test_moments_of_a_fold_are_the_sums_of_its_runs():
    source = short_runs(9)
    design = Design(("T1", "T2"), ("Z",), Datum("absolute"))
    columns = Columns(Scaling(("T1", "T2"), (20.0, 20.0), (1.0, 1.0)), (Term((("T1", 1),)), Term((("T2", 1),))))
    alone = moments(source, design, columns)
    together = moments(source, design, columns, fold_of={run: i % 4 for i, run in enumerate(source.runs)})
    assert [fold.runs for fold in together.folds] == [source.runs[i::4] for i in range(4)]
    for i in range(4):
        assert np.array_equal(together.products[i], sum(alone.products[i + 4 :: 4], alone.products[i]))
    assert np.array_equal(together.whole, alone.whole)


@pytest.fixture(scope="module")
def many():
    """A selection from twice as many runs as there are folds, and some."""
    return select(short_runs(2 * MOST_FOLDS + 7), Options())


def test_it_is_told_and_every_run_has_its_error(many):
    finding = one_finding(many, "runs-left-out-in-groups")
    assert dict(finding.evidence) == {"runs": 67, "groups": MOST_FOLDS}
    assert [part.name for part in many.proof.per_response["Z"]] == [f"r{i + 1:03d}" for i in range(67)]
    assert [trace.run for trace in many.proof.traces] == [f"r{i + 1:03d}" for i in range(67)]
    assert set(many.as_dict()["models"]["Z"]["per_run"]) == {f"r{i + 1:03d}" for i in range(67)}
    assert many.proof.left_out == "run"
    assert set(many.chosen) == {"T1", "T2"}
    # noise of the gauge 0.2 µm, of the sensors 0.05 K times 5 and 3 µm/K, and the start of a run has at most as much
    sensors = 0.05 * np.hypot(5, 3)
    assert np.hypot(0.2, sensors) < many.proof.rmse_um("Z") < np.hypot(0.2, np.sqrt(2) * sensors)


def test_each_run_is_predicted_without_its_group(many):
    source = short_runs(2 * MOST_FOLDS + 7)
    group = [run for run, fold in fold_of_run(source.runs, {}).items() if fold == ("", 4)]
    assert len(group) == 3
    design = Design(("T1", "T2"), ("Z",), datum_of(source, ("T1", "T2"), ("Z",), "rise"))
    rows = rows_of(source, design, source.runs)
    columns = np.column_stack([np.ones(len(rows.run)), rows.variables])
    unseen = np.isin(rows.run, [source.runs.index(run) for run in group])
    beta = np.linalg.lstsq(columns[~unseen], rows.responses[~unseen], rcond=None)[0]
    error = (rows.responses - columns @ beta)[:, 0]
    told = {part.name: part for part in many.proof.per_response["Z"]}
    for run in group:
        assert set(told[run].sensors) == {"T1", "T2"}
        own = error[rows.run == source.runs.index(run)]
        # the same least squares on scaled columns
        assert told[run].rmse_um == pytest.approx(np.sqrt(np.mean(own**2)), rel=1e-9)


def test_few_runs_say_nothing_of_groups():
    assert "runs-left-out-in-groups" not in found_ids(select(short_runs(8), Options()))


def test_choices_that_are_kept_hold_no_cross_products_of_single_folds():
    source = short_runs(8)
    question = question_of(source, Options(memory=True))
    folds = Folds(question, source, datum_of(source, question.sensors, question.responses, "rise"), 1)
    found = candidates(question, folds.linear_bench(None))
    static, lagged = choice.shapes_on_offer(question, 60.0, 1500.0)
    library = folds.library([found], static, lagged)
    kept = [
        choice.tested(question, found, Bench.of(library, folds.without(group)), static, lagged) for group in folds.outer
    ]
    # four times the cross-products, as measured (docs/decisions/0014-fleets.md)
    told_gb = folds.memory_gb([found], static, lagged) - 0.05
    assert told_gb == pytest.approx(4e-9 * library.moments.products.nbytes, rel=0.2)
    size = library.moments.whole.nbytes
    for one in kept:
        assert one.bench.leave_one_out.products is library.moments.products
        one.choice(("memory", 3))
        held = [vars(one.bench), vars(one.bench.leave_one_out), *map(vars, one.agreements.values())]
        arrays = {id(of): of for fields in held for of in fields.values() if isinstance(of, np.ndarray)}
        roots = {id(of if of.base is None else of.base): of for of in arrays.values()}
        assert sum(of.nbytes for of in roots.values()) < library.moments.products.nbytes + 1.5 * size
    assert all(len(one.trials) > 3 and len(one.bench.samples) == 7 for one in kept)
    errors = held_out(library, folds.outer, [SimpleNamespace(trial=one.trials[0]) for one in kept])
    assert errors.n_samples.base is None  # a view would hold those of all folds, once for every plan


@pytest.mark.parametrize(("gb", "told"), [(0.99, ""), (2.34, ", which take about 2.3 GB of memory")])
def test_much_memory_is_told_before_it_is_taken(monkeypatch, gb, told):
    said = []
    monkeypatch.setattr(Folds, "memory_gb", lambda *_: gb)
    select(short_runs(8), progress=lambda what, _share: said.append(what))
    assert f"forming terms{told}" in said
