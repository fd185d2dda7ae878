"""How commands end."""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import subprocess
import sys
import warnings

import pytest
import typer

from selector import cli
from selector.cli.shared.running import exit_status, last_step
from selector.errors import CancelledError, OptionError


def program(error: BaseException | None = None) -> typer.Typer:
    app = typer.Typer(pretty_exceptions_enable=False)

    @app.command()
    def work(number: int = 0) -> None:
        if error is not None:
            raise error

    @app.command()
    def rest() -> None:
        pass

    return app


def test_done():
    assert exit_status(program(), ["work"]) == 0


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["work", "--nonsense"], "--nonsense"),
        (["nonsense"], "nonsense"),
        (["work", "--number", "many"], "--number"),
        (["work", "--number"], "--number"),
        (["work", "extra"], "extra"),
    ],
)
def test_a_wrong_command_line_says_what_to_do(arguments, named, capfd):
    assert exit_status(program(), arguments) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert "What to do" in err
    assert named in err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OptionError("λ = 2", expected="0 to 1", where="--lambda", advice="choose 0.995"), "choose 0.995"),
        (FileNotFoundError(errno.ENOENT, "No such file", "r1.csv"), "r1.csv"),
        (PermissionError(errno.EACCES, "Permission denied", "r1.csv"), "close the program"),
        (IsADirectoryError(errno.EISDIR, "Is a directory", "runs"), "name a file"),
        (OSError(errno.ENOSPC, "No space left on device", "out.csv"), "free some space"),
        (OSError("something of the system"), "something of the system"),
        (UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid start byte"), "--encoding"),
        (MemoryError(), "fewer runs"),
        (ModuleNotFoundError("No module named 'nptdms'", name="nptdms"), ".[formats]"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, Exception) else None,
)
def test_what_the_user_can_solve_ends_with_2(error, said, capfd):
    assert exit_status(program(error), ["work"]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert said in err
    for part in ("Where:", "Expected:", "What to do:"):
        assert part in err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("select runs --within 0,5", ("'0,5'", "--within", "a number with a decimal point")),
        ("select runs --max-sensors x", ("'x'", "--max-sensors", "a whole number")),
        ("predict runs --cycle c --warm-up 1", ("'1'", "--warm-up", "greater than or equal to 5")),
    ],
)
def test_a_value_that_is_no_number_is_told_with_its_option(words, said, capfd):
    assert cli.exit_status(words.split()) == 2
    err = capfd.readouterr().err
    for part in said:
        assert part in err
    assert "Input should be" not in err


@pytest.mark.parametrize(
    "error", [ValueError("no"), KeyError("T1"), ZeroDivisionError(), ModuleNotFoundError("x", name="x")]
)
def test_a_defect_of_ours_ends_with_1(error, capfd, monkeypatch):
    monkeypatch.delenv("SELECTOR_DEBUG", raising=False)
    assert exit_status(program(error), ["work"]) == 1
    err = capfd.readouterr().err
    assert "defect" in err
    assert type(error).__name__ in err
    assert "Traceback" not in err

    monkeypatch.setenv("SELECTOR_DEBUG", "1")
    assert exit_status(program(error), ["work"]) == 1
    assert "Traceback" in capfd.readouterr().err


@pytest.mark.parametrize(
    "error", [KeyboardInterrupt(), CancelledError("stopped after 3 of 10 folds. Nothing was written.")]
)
def test_stopped_by_the_user(error, capfd):
    assert exit_status(program(error), ["work"]) == 130
    err = capfd.readouterr().err
    assert err.count("\n") == 1
    assert "Nothing" in err


def test_a_ctrl_c_while_a_library_loads_is_no_defect(capfd):
    error = ImportError("initialization failed")  # what pybind11 makes of a Ctrl-C in the middle of a module
    error.__cause__ = KeyboardInterrupt()
    assert exit_status(program(error), ["work"]) == 130
    assert capfd.readouterr().err == "selector: stopped. Nothing was written.\n"
    assert exit_status(program(ImportError("initialization failed")), ["work"]) == 1


@pytest.mark.parametrize("ctrl_c", ["raise KeyboardInterrupt", "exec('raise KeyboardInterrupt')"])
def test_a_ctrl_c_while_the_program_loads_shows_no_traceback(ctrl_c, tmp_path):
    """Also within a text that is executed, as dataclasses do: the interpreter would end by SIGINT in place of 130."""
    while_it_loads = f"""\
import runpy, sys
class Interrupted:
    def find_spec(self, name, *_):
        if name == "selector.cli":
            {ctrl_c}
sys.meta_path.insert(0, Interrupted())
runpy.run_module("selector", run_name="__main__")
"""
    (tmp_path / "loading.py").write_text(while_it_loads, encoding="utf-8")
    sought = os.pathsep.join([str(tmp_path), *sys.path])
    ended = subprocess.run(
        [sys.executable, "-m", "loading"],
        env=os.environ | {"PYTHONPATH": sought},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (ended.returncode, ended.stdout) == (130, "")
    assert ended.stderr == "selector: stopped. Nothing was written.\n"


@pytest.mark.parametrize(
    "words",
    [
        ["select", "a.csv", "--seed", "1", "--seed=2"],
        ["select", "a.csv", "--formula", "Z ~ T1", "--formula", "Z ~ T3"],
        ["simulate", "thermal", "a.toml", "--out", "a", "--out", "b"],
        ["report", "a.json", "-o", "a.html", "--out", "b.html"],
    ],
)
def test_one_value_given_twice_is_refused_and_not_forgotten(words, capfd):
    assert cli.exit_status(words) == 2
    err = capfd.readouterr().err
    assert "2 times" in err
    assert next(word for word in words if word.startswith("--")).partition("=")[0] in err


@pytest.mark.parametrize("words", [["convert", "a.csv"], ["select", "a.csv"], ["demo"], ["prove"]])
def test_an_empty_name_of_a_folder_is_not_the_folder_where_one_stands(words, capfd):
    assert cli.exit_status([*words, "--out", ""]) == 2
    assert "--out" in capfd.readouterr().err


def test_flags_and_lists_may_be_repeated(capfd):
    assert cli.exit_status(["effects", "--json", "--json"]) == 0
    assert cli.exit_status(["select", "absent.csv", "--must", "T1", "--must", "T2"]) == 2
    assert "absent.csv" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("word", "said"), [("watch", "fleet watch"), ("show", "model show"), ("drive", "simulate drive")]
)
def test_a_command_of_a_group_is_found_without_its_group(word, said, capfd):
    assert cli.exit_status([word, "x"]) == 2
    assert f"What to do: say `selector {said}`\n" in capfd.readouterr().err
    assert cli.exit_status(["wach"]) == 2
    assert "selector --help" in capfd.readouterr().err


def test_messages_survive_a_code_page_that_lacks_letters(monkeypatch, tmp_path):
    error = OptionError("通道 T1 и µ", expected="x", where="温度.csv", advice="y")
    path = tmp_path / "stderr.txt"
    with path.open("w", encoding="cp1252") as stream:
        monkeypatch.setattr("sys.stderr", stream)
        assert exit_status(program(error), ["work"]) == 2
    assert "What to do: y" in path.read_text(encoding="cp1252")


def test_a_name_that_is_no_text_is_told_without_an_encoding(capfd):
    error = UnicodeEncodeError("utf-8", "run\udcff.csv", 3, 4, "surrogates not allowed")
    assert exit_status(program(error), ["work"]) == 2
    err = capfd.readouterr().err
    assert "name" in err
    assert "--encoding" not in err


def test_ctrl_c_while_the_interpreter_ends_changes_nothing(monkeypatch):
    monkeypatch.setattr(cli, "exit_status", lambda: 0)
    # a thread that another test left would end this process at once, as it has to
    monkeypatch.setattr(cli.threading, "active_count", lambda: 1)
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        with warnings.catch_warnings(), pytest.raises(SystemExit) as ended:
            cli.main()
        assert ended.value.code == 0
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def test_a_process_that_is_ended_from_outside_leaves_nothing_half_written(tmp_path):
    ended_while_it_writes = f"""\
import os, signal
from pathlib import Path
from selector import atomic_file, cli
signal.signal(signal.SIGINT, signal.default_int_handler)
app = cli.typer.Typer(pretty_exceptions_enable=False)
@app.command()
def work():
    with atomic_file.folder_written_whole(Path({str(tmp_path / "answer")!r})) as part:
        (part / "half").touch()
        os.kill(os.getpid(), signal.SIGTERM)
cli.exit_status = lambda: cli.running.exit_status(app, [])
cli.main()
"""
    ended = subprocess.run([sys.executable, "-c", ended_while_it_writes], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (130, "selector: stopped. Nothing was written.\n")
    assert not list(tmp_path.iterdir())


@pytest.fixture
def _hears_ctrl_c():
    """Also where the tests run as a background job, which must not hear it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("_hears_ctrl_c")
def test_a_last_step_is_done_before_a_ctrl_c_is_heard():
    done = []

    def interrupted() -> None:
        with last_step("stopped; the files were written"):
            signal.raise_signal(signal.SIGINT)
            done.append("all")

    with pytest.raises(CancelledError, match="files were written"):
        interrupted()
    assert done == ["all"]
    # and from then on that is what is true
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


@pytest.mark.parametrize("fails", [True, False])
def test_what_is_said_after_ctrl_c_is_true(fails, capfd):
    app = typer.Typer(pretty_exceptions_enable=False)

    @app.command()
    def work() -> None:
        with contextlib.suppress(ValueError), last_step("stopped; the files were written"):
            if fails:
                raise ValueError
        raise KeyboardInterrupt

    assert exit_status(app, []) == 130
    assert ("Nothing was written" if fails else "files were written") in capfd.readouterr().err
    assert exit_status(program(KeyboardInterrupt()), ["work"]) == 130
    assert "Nothing was written" in capfd.readouterr().err
