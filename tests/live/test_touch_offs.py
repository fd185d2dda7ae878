"""Touch-offs beside the control: taken once and only when they can mean something, told, and kept."""

from __future__ import annotations

import asyncio
import json

import pytest
from asyncua import ua

from selector.controllers.closed_values import Adaptation, OutputAdaptation
from selector.controllers.guard.guarded_model import GuardedModel
from selector.errors import StudyError
from selector.live.compensating import Compensation
from selector.live.io_file import read_io
from selector.live.journal import status_words
from selector.live.links import FastClock
from tests.live.plants import MemoryLink, beyond_the_guard, io_text, model, run
from tests.live.test_servers import NODES, OPEN_S, OpcUa, end, free_port, go

FILE = 'kind = "file"\nurl = "nowhere.csv"'
PROBE = """
[channels.probe]
at = "plc"
address = "probe"
role = "displacement"
unit = "mm"
[channels.probed]
at = "plc"
address = "probed"
role = "state"
[channels.ready]
at = "plc"
address = "ready"
role = "state"
[control]
touch_valid = "probed"
ready = "ready"
"""
TOUCH = 'touch = "probe"\ntouch_code = "code"'


def adapted():
    block = OutputAdaptation(
        output="Z", offset_um2_per_s=1e-3, offset_start_um2=25.0, noise_um2=0.25, offset_limit_um=8.0
    )
    plain = model()
    output = plain.outputs[0].model_copy(update={"reference": "rise"})
    return plain.model_copy(update={"adaptation": Adaptation(outputs=(block,)), "outputs": (output,)})


def plant(folder, output=TOUCH, control=PROBE):
    path = folder / "io.toml"
    path.write_text(io_text(FILE, output=output, control=control), "utf-8")
    clock = FastClock(1_700_000_000.0)
    process = Compensation(adapted(), read_io(path, adapted()), clock, folder / "out")
    process.links["plc"].link = link = MemoryLink(clock)
    link.values |= {"ready": True, "probed": False, "probe": 0.0}
    return process, link, clock


def warmed(folder):
    """Corrects by -8 um, for 4 K."""
    process, link, clock = plant(folder)
    run(process, clock, 10)
    link.values["T1"] = 24.0
    run(process, clock, 40)
    assert link.arrived[-1][1] == pytest.approx(-8.0)
    return process, link, clock


def probed(process, link, clock, shown_um, seconds=3):
    """The control puts down what its probe shows, and says so for some seconds."""
    link.values |= {"probe": 1e-3 * shown_um, "probed": True}
    run(process, clock, seconds)
    link.values["probed"] = False
    run(process, clock, 20)


def events(folder, event):
    lines = (folder / "out" / "journal.jsonl").read_text("ascii").splitlines()
    return [line for line in map(json.loads, lines) if line["event"] == event]


def test_a_touch_off_moves_the_correction_and_is_told_everywhere(tmp_path):
    process, link, clock = warmed(tmp_path)
    assert process.status()["touch_offs"] == {"Z": {"last": "NONE", "offset_um": 0.0}}
    probed(process, link, clock, 2.0)
    # 25 um^2 known of the offset, 0.25 of the probe: 99 % of 2 um is believed
    assert link.arrived[-1][1] == pytest.approx(-8.0 - 2.0 * 25.0 / 25.25, abs=0.01)
    assert link.values["code"] == 1.0
    told = process.status()["touch_offs"]["Z"]
    assert told["last"] == "BELIEVED"
    assert told["offset_um"] == pytest.approx(1.98, abs=0.01)
    assert ("last touch-offs", "Z: believed, offset 1.98 µm") in status_words(process.status(), adapted())
    assert [line["shown_um"] for line in events(tmp_path, "touch-off")] == [{"Z": pytest.approx(2.0)}]
    assert [line["now"]["Z"]["last"] for line in events(tmp_path, "touch-offs")] == ["NONE", "BELIEVED"]
    assert beyond_the_guard(link.arrived) == []


def test_what_arrives_is_the_guard_with_the_same_touch_offs(tmp_path):
    process, link, clock = plant(tmp_path)
    guard, given = GuardedModel(adapted()), []
    for second in range(400):
        link.values["T1"] = 20.0 + min(0.05 * second, 3.0)
        is_probed = second % 60 in (30, 31, 32)
        link.values |= {"probed": is_probed, "probe": 1e-3 * (second % 7 - 3.0)}
        run(process, clock, 1)
        given.append(
            guard.step(
                float(second > 0),
                {"T1": link.values["T1"], "T2": 20.0},
                is_touch_valid=second % 60 == 30,
                touch_um={"Z": 1e3 * link.values["probe"]},
                # nothing is trusted until the first zero was read back
                is_ready=second > 0,
            ).correction_um["Z"]
        )
    assert len(events(tmp_path, "touch-off")) == 7
    assert [value for _, value in link.arrived] == given
    assert abs(process.status()["touch_offs"]["Z"]["offset_um"]) > 0.3


def test_one_false_reading_is_not_believed_and_the_control_is_told(tmp_path):
    process, link, clock = warmed(tmp_path)
    probed(process, link, clock, 60.0)
    assert link.values["code"] == 2.0
    assert link.arrived[-1][1] == pytest.approx(-8.0)


def test_a_flag_that_stays_up_is_one_touch_off(tmp_path):
    process, link, clock = warmed(tmp_path)
    probed(process, link, clock, 2.0, seconds=200)
    assert len(events(tmp_path, "touch-off")) == 1


@pytest.mark.parametrize("cut_s", [2, 30])
def test_a_connection_that_comes_back_is_no_second_touch_off(tmp_path, cut_s):
    process, link, clock = warmed(tmp_path)
    link.values |= {"probe": 0.002, "probed": True}
    run(process, clock, 5)
    link.is_cut = True
    run(process, clock, cut_s)
    link.is_cut = False
    run(process, clock, 60)
    assert len(events(tmp_path, "touch-off")) == 1


def test_a_flag_that_is_up_at_the_start_is_none_of_this_process(tmp_path):
    process, link, clock = plant(tmp_path)
    link.values |= {"probe": 0.002, "probed": True}
    run(process, clock, 30)
    assert events(tmp_path, "touch-off") == []
    link.values["probed"] = False
    run(process, clock, 2)
    probed(process, link, clock, 2.0)
    assert len(events(tmp_path, "touch-off")) == 1


def test_what_was_probed_while_the_control_was_not_ready_teaches_nothing_also_later(tmp_path):
    process, link, clock = warmed(tmp_path)
    link.values["ready"] = False
    run(process, clock, 2)
    link.values |= {"probe": 0.002, "probed": True}
    run(process, clock, 3)
    link.values["ready"] = True
    run(process, clock, 60)
    assert [line["taken"] for line in events(tmp_path, "touch-off")] == [False]
    assert process.status()["touch_offs"]["Z"] == {"last": "NONE", "offset_um": 0.0}
    assert link.arrived[-1][1] == pytest.approx(-8.0)


@pytest.mark.parametrize("value", [float("nan"), "broken", None, 1e300])
def test_a_flag_waits_for_a_number(tmp_path, value):
    process, link, clock = warmed(tmp_path)
    link.values |= {"probe": value, "probed": True}
    run(process, clock, 5)
    assert events(tmp_path, "touch-off") == []
    link.values["probe"] = 0.002
    run(process, clock, 20)
    assert link.values["code"] == 1.0


def test_what_was_taught_outlives_a_restart(tmp_path):
    process, link, clock = warmed(tmp_path)
    probed(process, link, clock, 2.0)
    process._keep()
    again, other, later = plant(tmp_path)
    other.values["T1"] = 24.0
    run(again, later, 60)
    assert other.arrived[-1][1] == pytest.approx(link.arrived[-1][1])


def test_an_adapted_model_without_a_probe_says_that_nothing_comes(tmp_path):
    process, _, clock = plant(tmp_path, output="", control="")
    run(process, clock, 5)
    assert [line["outputs"] for line in events(tmp_path, "no-touch-offs")] == [["Z"]]


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('touch = "probe"', 'touch = "T9"', "'T9'"),
        ('touch = "probe"', 'touch = "T1"', 'role = "displacement"'),
        ('touch = "probe"\n', "", 'role = "displacement"'),
        ('touch_valid = "probed"\n', "", "touch_valid"),
        ('touch = "probe"\ntouch_code = "code"', "", "touch_valid without"),
        ('touch_code = "code"', 'touch_code = "Z"', "two outputs"),
        ('touch_valid = "probed"', 'touch_valid = "nobody"', "nobody"),
    ],
)
def test_what_says_half_of_it_is_refused(tmp_path, old, new, told):
    text = io_text(FILE, output=TOUCH, control=PROBE)
    assert old in text
    (tmp_path / "io.toml").write_text(text.replace(old, new), "utf-8")
    with pytest.raises(StudyError, match=told):
        read_io(tmp_path / "io.toml", adapted())


def test_a_model_that_is_not_adapted_takes_none(tmp_path):
    (tmp_path / "io.toml").write_text(io_text(FILE, output=TOUCH, control=PROBE), "utf-8")
    with pytest.raises(StudyError, match="touch-offs adapt"):
        read_io(tmp_path / "io.toml", model())


def test_codes_are_whole_numbers_at_the_control(tmp_path):
    (tmp_path / "io.toml").write_text(
        io_text(FILE, output=TOUCH, control=PROBE + 'heartbeat = { at = "plc", address = "ours" }'), "utf-8"
    )
    io = read_io(tmp_path / "io.toml", adapted())
    assert io.writes("plc") == ("Z", "code", "ours")
    assert io.counts("plc") == ("code", "ours")


def test_through_opc_ua_with_an_int_for_the_code(tmp_path):
    async def work():
        plc = await OpcUa(free_port()).start()
        flag = (False, ua.VariantType.Boolean)
        nodes = {"probe": (0.0, ua.VariantType.Float), "probed": flag, "ready": flag, "code": (0, ua.VariantType.Int16)}
        for name, (value, kind) in nodes.items():
            plc.nodes[name] = await plc.server.nodes.objects.add_variable(
                ua.NodeId(name, 2), ua.QualifiedName(name, 2), value, kind
            )
        await plc.nodes["code"].set_writable()
        control = PROBE.replace('ready = "ready"\n', "").replace('address = "', 'address = "ns=2;s=')
        connection = f'kind = "opcua"\nurl = "opc.tcp://127.0.0.1:{plc.port}"\n{OPEN_S}'
        output = TOUCH.replace('"code"', '"ns=2;s=code"')
        (tmp_path / "io.toml").write_text(
            io_text(connection, output=output, control=control, addresses=NODES), encoding="utf-8"
        )
        clock = FastClock(1_700_000_000.0)
        process = Compensation(adapted(), read_io(tmp_path / "io.toml", adapted()), clock, tmp_path / "out")
        try:
            await go(process, clock, 10)
            await plc.nodes["T1"].write_value(24.0)
            await go(process, clock, 30)
            await plc.nodes["probe"].write_value(ua.DataValue(ua.Variant(0.002, ua.VariantType.Float)))
            await plc.nodes["probed"].write_value(True)
            await go(process, clock, 20)
            assert await plc.nodes["code"].read_value() == 1
            assert await plc.nodes["Z"].read_value() == pytest.approx(-9.98, abs=0.01)
        finally:
            await end(process)
            await plc.stop()

    asyncio.run(work())
