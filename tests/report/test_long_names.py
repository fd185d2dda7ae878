"""Names of channels that are longer than a column."""

from selector.findings import Finding, Where
from selector.telling.account import Account, captioned, next_steps, section, sections, table
from selector.telling.page import write_account


def test_long_names_in_tables_may_be_broken_behind_an_underscore_and_stay_texts(tmp_path):
    long = "Spindelstock_<b>_Hauptlager_Aussenring_Messstelle_A1"
    told = table(["sensor", ">value"], [("T_1", 1.0), (long, 2.0)])
    write_account(
        Account("A result", (), sections(section("s", "Sensors", captioned("", told)))), tmp_path / "page.html"
    )
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert ">Spindelstock_<wbr>&lt;b&gt;_<wbr>Hauptlager_<wbr>Aussenring_<wbr>Messstelle_<wbr>A1<" in page
    assert ">T_1<" in page


def test_a_name_without_a_place_to_break_it_leaves_the_other_columns_their_room(tmp_path, tab):
    told = table(["machine", "status", "reason"], [("m" * 80, "failed", "/" + "p" * 90), ("m1", "done", "")])
    write_account(
        Account("A fleet", (), sections(section("s", "Machines", captioned("", told)))), tmp_path / "page.html"
    )
    page = tab()
    page.set_viewport_size({"width": 800, "height": 900})
    page.goto((tmp_path / "page.html").as_uri())
    assert page.evaluate("(t => t.scrollWidth <= t.clientWidth)(document.querySelector('.scroll'))")
    page.close()


def test_what_to_do_next_keeps_the_names_of_runs_and_sensors():
    said = next_steps(
        [
            Finding("stuck", "error", "t3 is frozen.", Where(run="tag1", channel="t3"), suggestion="check the cable"),
            Finding("gap", "warning", "t4 has gaps.", suggestion="repair it"),
        ]
    )
    assert [str(one) for one in said.items] == ["tag1, t3: Check the cable.", "t4 has gaps. Repair it."]
