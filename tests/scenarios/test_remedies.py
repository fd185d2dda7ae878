"""What a finding advises is done, through the command line, and the finding is gone."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from selector.cli import exit_status
from selector.shipped import shipped

ROWS = 120
MACHINE = """
[time]
column = "t"
unit = "min"
[channels.T1]
role = "temperature"
unit = "degC"
[channels.T2]
role = "temperature"
unit = "degC"
[channels.Z]
role = "displacement"
unit = "um"
"""


def table(seed: int = 0) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    duty = np.interp(np.arange(ROWS), np.linspace(0, ROWS, 7), rng.uniform(0, 1, 7))
    first = 20 + 12 * duty + rng.normal(0, 0.05, ROWS)
    second = 20 + 9 * np.cumsum(duty) / ROWS + rng.normal(0, 0.05, ROWS)
    z = 2 * (first - first[0]) + 3 * (second - second[0]) + rng.normal(0, 0.1, ROWS)
    return pd.DataFrame({"t": np.arange(ROWS, dtype=float), "T1": first, "T2": second, "Z": z}).round(3)


def written(frame: pd.DataFrame, header: Sequence[str], **how: str) -> str:
    return frame.to_csv(index=False, header=list(header), **how)  # type: ignore[call-overload]


UNITS = ["t [min]", "T1 [degC]", "T2 [degC]", "Z [um]"]
Files = dict[str, str]


@dataclass(frozen=True)
class Case:
    """A finding, the files that have it, and what is done: options are added, or files written anew."""

    id: str
    files: Callable[[], Files]
    said: str  #: What the advice names
    options: tuple[str, ...] = ()
    anew: Callable[[], Files] | None = None
    before: tuple[str, ...] = ()
    recordings: tuple[str, ...] = ("r1.csv",)
    instead: tuple[str, ...] | None = None  #: Recordings that are named afterwards


def plain(**changes: object) -> Files:
    return {"r1.csv": written(table().assign(**changes), UNITS)}  # type: ignore[arg-type]


def three(header: Sequence[str] = UNITS) -> Files:
    return {f"r{k}.csv": written(table(k), header) for k in range(1, 4)}


def headed(*header: str) -> Callable[[], Files]:
    return lambda: {"r1.csv": written(table(), header)}


def with_machine(text: str = MACHINE, *header: str) -> Callable[[], Files]:
    return lambda: {"r1.csv": written(table(), header or UNITS), "machine.toml": text}


def only_machine(text: str) -> Callable[[], Files]:
    return lambda: {"machine.toml": text}


def without_time() -> Files:
    return {"r1.csv": written(table().drop(columns="t"), UNITS[1:])}


def dated(order: str) -> Files:
    stamps = pd.date_range("2026-02-03 08:00", periods=ROWS, freq="min").strftime(order)
    return {"r1.csv": written(table().assign(t=stamps), ["time", *UNITS[1:]])}


def minutes_and_seconds() -> Files:
    stamps = [f"{k // 60:02d}:{k % 60:02d}" for k in range(ROWS)]
    return {"r1.csv": written(table().assign(t=stamps), ["time", *UNITS[1:]])}


def in_degrees_f(header: Sequence[str]) -> Files:
    return {**three(header), "r3.csv": written(table(3).assign(T1=lambda f: 1.8 * f.T1 + 32), header)}


def nameless() -> Files:
    return {"r1.csv": written(table(), "abcd").split("\n", 1)[1]}


def swapped() -> Files:
    files = {f"r{k}.csv": pd.read_csv(shipped("vmc37") / f"r{k}.csv") for k in range(1, 5)}
    files["r3.csv"][["T14", "T30"]] = files["r3.csv"][["T30", "T14"]].to_numpy()
    machine_file = (shipped("vmc37") / "machine.toml").read_text(encoding="utf-8")
    return {name: frame.to_csv(index=False) for name, frame in files.items()} | {"machine.toml": machine_file}


DEGREES = ["t [min]", "T1", "T2", "Z [um]"]
TYPED = ("--machine", "machine.toml")
CASES = (
    Case("no-clock", without_time, "--period-s 60", ("--period-s", "60")),
    Case("no-clock", without_time, "period_s = 60", TYPED, only_machine("[time]\nperiod_s = 60\n")),
    Case("time-unit-guessed", headed("t", *UNITS[1:]), "--time-unit", ("--time-unit", "min")),
    Case("time-unit-guessed", headed("t", *UNITS[1:]), 'unit = "min"', TYPED, only_machine('[time]\nunit = "min"\n')),
    Case("time-column-guessed", nameless, "--time-column", ("--time-column", "col1", "--time-unit", "s")),
    Case("no-header", nameless, "--header-row", ("--header-row", "1"), lambda: plain()),
    Case("ambiguous-time", minutes_and_seconds, "--time-unit min", ("--time-unit", "min")),
    Case("ambiguous-date", lambda: dated("%d/%m/%Y %H:%M"), "--date-order", ("--date-order", "dmy")),
    Case(
        "time-unit-conflict",
        with_machine(MACHINE.replace("min", "h"), "t [s]", *UNITS[1:]),
        "correct [time] unit",
        TYPED,
        only_machine(MACHINE.replace('"min"', '"s"').replace('"t"', '"t [s]"')),
        TYPED,
    ),
    Case("ambiguous-role", headed("t [min]", "T1 [degC]", "T2 [degC]", "Z"), "machine file", TYPED, with_machine()),
    Case("roles-guessed", plain, "--write machine.toml", TYPED, with_machine()),
    Case("columns-without-role", headed("t [min]", "T1 [degC]", "foo", "Z [um]"), "a role", ("--role", "foo=flow")),
    Case(
        "unknown-unit",
        lambda: {"r1.csv": "t,T1,T2,Z\ns,digits,degC,um\n" + written(table(), "abcd").split("\n", 1)[1]},
        "name the unit in the machine file",
        TYPED,
        only_machine(MACHINE.replace("min", "s")),
    ),
    Case(
        "unit-guessed",
        with_machine(MACHINE.replace('unit = "um"\n', ""), "t", "T1", "T2", "Z"),
        "unit = ",
        TYPED,
        with_machine(MACHINE, "t", "T1", "T2", "Z"),
        TYPED,
    ),
    Case(
        "unit-conflict",
        with_machine(MACHINE.replace('"um"', '"mm"')),
        "the machine file",
        TYPED,
        only_machine(MACHINE),
        TYPED,
    ),
    Case(
        "columns-ignored",
        with_machine(MACHINE[: MACHINE.index("[channels.T2]")] + MACHINE[MACHINE.index("[channels.Z]") :]),
        "declare them",
        TYPED,
        only_machine(MACHINE),
        TYPED,
    ),
    Case(
        "channel-missing-in-run",
        lambda: {**three(), "r2.csv": written(table().drop(columns="T2"), [UNITS[0], UNITS[1], UNITS[3]])},
        "leave the channel or these runs out",
        TYPED,
        only_machine(MACHINE + "[runs.r2]\nuse = false\n"),
        recordings=("r1.csv", "r2.csv", "r3.csv"),
    ),
    Case(
        "repair-of-no-run",
        with_machine(MACHINE + "[runs.r9]\nuse = false\n"),
        "[runs.NAME]",
        TYPED,
        only_machine(MACHINE),
        TYPED,
    ),
    Case(
        "files-skipped",
        lambda: {**plain(), "SOURCE.txt": "t [min],T1 [degC]\n0,20\n1,21\n2,22\n"},
        "name a file itself",
        recordings=(".",),
        instead=("r1.csv", "SOURCE.txt"),
    ),
    Case("machine-file-found", with_machine(), "--machine", TYPED, recordings=(".",)),
    Case(
        "same-file-twice",
        lambda: {"r1.csv": written(table(), UNITS), "r2.csv": written(table(), UNITS)},
        "once",
        recordings=("r1.csv", "r2.csv"),
        instead=("r1.csv",),
    ),
    Case(
        "wrong-unit",
        lambda: in_degrees_f(UNITS),
        '[runs."r3".channels."T1"] with unit = "degF"',
        TYPED,
        only_machine(MACHINE + '[runs."r3".channels."T1"]\nunit = "degF"\n'),
        recordings=("r1.csv", "r2.csv", "r3.csv"),
    ),
    Case(
        "swapped-channels",
        swapped,
        '[runs."r3"] with swap = [["T30", "T14"]]',
        TYPED,
        lambda: {"machine.toml": swapped()["machine.toml"] + '\n[runs."r3"]\nswap = [["T30", "T14"]]\n'},
        TYPED,
        ("r1.csv", "r2.csv", "r3.csv", "r4.csv"),
    ),
)


def found(folder: Path, capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, str]:
    """Ids and advice of the findings of a command, run in the folder."""
    capsys.readouterr()
    assert exit_status([*arguments, "--json"]) == 0, capsys.readouterr().err
    findings = json.loads(capsys.readouterr().out)["findings"]
    return {one["id"]: f"{one['statement']} {one['suggestion']}" for one in findings}


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.id}-{case.said}")
def test_the_advice_of_describe_does_what_it_says(case: Case, tmp_path, monkeypatch, capsys):
    files, anew = case.files(), (case.anew or dict)()
    monkeypatch.chdir(tmp_path)
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    before = found(tmp_path, capsys, "describe", *case.recordings, *case.before)
    assert case.said in before[case.id]
    for name, text in anew.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    recordings = case.recordings if case.instead is None else case.instead
    assert case.id not in found(tmp_path, capsys, "describe", *recordings, *case.options)


def runs_of(n: int, change: Callable[[int, pd.DataFrame], pd.DataFrame] = lambda k, frame: frame) -> Files:
    files = {}
    for k in range(1, n + 1):
        frame = change(k, table(k))
        files[f"r{k}.csv"] = written(frame, [*UNITS[:3], *(f"{name} [degC]" for name in frame.columns[3:-1]), UNITS[3]])
    return files


def with_third(k: int, frame: pd.DataFrame) -> pd.DataFrame:
    """A third place, without which the displacement is not known, and a fourth that is the third plus noise."""
    rng = np.random.default_rng(100 + k)
    third = np.round(20 + np.cumsum(rng.normal(0, 0.2, ROWS)), 3)
    frame.insert(3, "T3", third)
    frame.insert(4, "T4", np.round(third + rng.normal(0, 0.3, ROWS), 3))
    return frame.assign(Z=frame.Z + 5 * (third - third[0]))


def alike(k: int, frame: pd.DataFrame) -> pd.DataFrame:
    """Only the difference of two sensors that are alike counts besides what they share."""
    second = frame.T1 + 0.02 * (frame.T2 - 20)
    return frame.assign(T2=second.round(4), Z=(2 * frame.T1 + 200 * (second - frame.T1)).round(3))


def twins(k: int, frame: pd.DataFrame) -> pd.DataFrame:
    frame.insert(3, "T3", frame.T1)
    return frame


def off_zero(k: int, frame: pd.DataFrame) -> pd.DataFrame:
    return frame.assign(Z=frame.Z + 40.0 * k)


def often_gone(k: int, frame: pd.DataFrame) -> pd.DataFrame:
    return frame.assign(T2=frame.T2.where(np.arange(ROWS) % 10 < 7))


def lacking(k: int, frame: pd.DataFrame) -> pd.DataFrame:
    return frame.assign(T2=np.nan) if k == 2 else frame


SELECTED = (
    ("choice-at-limit", with_third, ("--max-sensors", "2"), "--max-sensors 4", ("--max-sensors", "4")),
    ("collinear-terms", alike, (), "--max-sensors", ("--max-sensors", "1")),
    ("duplicate-channel", twins, (), "--never", ("--never", "T3")),
    ("gauge-not-zeroed", off_zero, (), "--reference absolute", ("--reference", "absolute")),
    ("samples-lost", often_gone, (), "--never T2", ("--never", "T2")),
    ("runs-not-proved", lacking, (), "--never", ("--never", "T2")),
    ("target-missed", with_third, ("--target", "0.01"), "ask for less", ("--target", "20")),
    ("target-met-already", with_third, ("--target", "1000"), "ask for less", ("--target", "1")),
)


@pytest.mark.parametrize(("id_", "change", "before", "said", "after"), SELECTED, ids=[one[0] for one in SELECTED])
def test_the_advice_of_select_does_what_it_says(id_, change, before, said, after, tmp_path, monkeypatch, capsys):
    for name, text in runs_of(5, change).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert said in found(tmp_path, capsys, "select", ".", *before)[id_]
    assert id_ not in found(tmp_path, capsys, "select", ".", *after)
