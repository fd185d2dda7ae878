"""`selector workbench`: what it prints, what it refuses, and how it ends."""

from __future__ import annotations

import re
import signal
import socket
import stat
import subprocess
import sys
import urllib.error
import urllib.parse
import urllib.request
import webbrowser
from pathlib import Path

import pytest

from selector.cli import exit_status
from selector.shipped import shipped
from tests.interruptible import INTERRUPTIBLE

ADDRESS = re.compile(r"http://127\.0\.0\.1:(\d+)/\?token=[\w-]+")


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C cannot be sent to one process there")
@pytest.mark.parametrize("stop", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_ctrl_c_ends_it_and_an_empty_study_leaves_nothing(tmp_path, stop):
    # recordings that are still being read when it is stopped
    words = [*INTERRUPTIBLE, "workbench", str(shipped("vmc37")), "--no-browser"]
    with subprocess.Popen(words, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        printed = child.stdout.readline()
        try:
            assert ADDRESS.search(printed), printed
            assert (tmp_path / "selector-study").is_dir()
            without_cookie = urllib.request.Request(ADDRESS.search(printed)[0].partition("?")[0])
            with pytest.raises(urllib.error.HTTPError) as refused:
                urllib.request.urlopen(without_cookie, timeout=300)
            assert refused.value.code == 403
            refused.value.close()
        finally:
            child.send_signal(getattr(signal, stop))
        _, err = child.communicate(timeout=300)
    assert child.returncode == 0, err
    assert err == ""
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="files have no modes there")
def test_the_browser_is_given_a_file_of_its_owner_and_no_token(tmp_path, monkeypatch):
    shown = []

    def look(address):
        path = Path(urllib.parse.urlparse(address).path)
        shown.append((path, stat.S_IMODE(path.stat().st_mode), path.read_text()))
        raise KeyboardInterrupt

    monkeypatch.setattr(webbrowser, "open", look)
    monkeypatch.chdir(tmp_path)
    assert exit_status(["workbench"]) == 0
    ((path, mode, text),) = shown
    assert mode == 0o600
    assert "token" not in text
    assert not path.exists()


def test_a_port_that_is_taken_is_refused(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert exit_status(["workbench", "--no-browser", "--port", str(port)]) == 2
    assert list(tmp_path.iterdir()) == []
    err = capfd.readouterr().err
    assert str(port) in err
    assert "--port" in err


@pytest.mark.parametrize(
    "words", [["nothing.csv"], ["--machine", "nothing.toml"], ["--folder", "file"], ["--port", "70000"]], ids=" ".join
)
def test_what_cannot_be_used_is_said_before_anything_is_opened(tmp_path, monkeypatch, capfd, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("x")
    assert exit_status(["workbench", "--no-browser", *words]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert "What to do" in err
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
