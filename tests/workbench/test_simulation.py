"""Simulate: the fields of a machine while another one is chosen."""

from __future__ import annotations

from selector.workbench.bench import Bench
from selector.workbench.pages import simulation
from selector.workbench.study_folder import MODELS


def test_the_fields_of_a_machine_whose_file_is_still_read_when_another_is_chosen(tmp_path, monkeypatch):
    bench = Bench(tmp_path)
    at = {name: path for path, name in bench.models("thermal").items()}
    bench.choose_simulation(kind="thermal", model=at["headstock"])
    rows, read, reads = simulation._rows(bench), simulation._parameters, []

    def slow(asked):
        found = read(asked)
        reads.append(asked.model)
        bench.choose_simulation(kind="thermal", model=at["three-modes"])
        return found

    monkeypatch.setattr(simulation, "_parameters", slow)
    assert rows.counting()
    assert reads[:2] == [at["headstock"], at["three-modes"]]
    # what was typed for the machine before changes nothing of the one that is there
    (column,) = rows.columns
    assert column.read("3,5", "films.air.still_w_per_m2_k") == 3.5
    assert rows.choose({"value": {"films.air.still_w_per_m2_k": 3.5}}) is False
    assert bench.simulation.values == {}


def test_a_model_file_is_offered_for_its_own_kind_and_what_says_no_kind_for_every_one(tmp_path):
    bench = Bench(tmp_path)
    own = bench.folder / MODELS
    own.mkdir(exist_ok=True)
    texts = {"axis": '[model]\nkind = "drive"\nname = "a"\n', "torn": "[model\n", "new": '[model]\nkind = "laser"\n'}
    for name, text in texts.items():
        (own / f"{name}.toml").write_text(text, encoding="utf-8")
    offered = {kind: set(bench.models(kind).values()) & set(texts) for kind in ("thermal", "drive")}
    assert offered == {"thermal": {"torn", "new"}, "drive": {"axis", "torn", "new"}}
