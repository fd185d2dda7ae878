"""Nobody but this computer's browser, with the token, from the workbench's own page."""

from __future__ import annotations

import errno
import io
import os
import re
from pathlib import Path

import pytest
from flask.testing import FlaskClient

from selector.workbench import access as refusals
from selector.workbench import page as page_module
from selector.workbench import study_folder
from selector.workbench.access import TOKEN, Access
from selector.workbench.bench import Bench
from selector.workbench.page import page
from selector.workbench.parts import REVISION

PORT = 8123
OWN = f"http://127.0.0.1:{PORT}"


class Client(FlaskClient):
    """Reads answers to their end, so that files that are sent are closed."""

    def open(self, *arguments, **options):
        return super().open(*arguments, **{"buffered": True, **options})


@pytest.fixture(scope="module")
def access():
    return Access(PORT)


@pytest.fixture(scope="module")
def empty(tmp_path_factory, access):
    """A page without a study, for all whose requests change nothing."""
    server = page(Bench(tmp_path_factory.mktemp("empty").resolve()), access).server
    server.test_client_class = Client
    return server


@pytest.fixture
def guest(empty, access):
    """A client that opened the printed address of the page without a study."""
    opened = empty.test_client()
    assert opened.get(f"/?{TOKEN}={access.token}", base_url=OWN).status_code == 303
    return opened


@pytest.fixture
def study(tmp_path):
    folder = tmp_path / "study"
    folder.mkdir()
    return folder.resolve()


@pytest.fixture
def stranger(study, access):
    """A client without the cookie."""
    server = page(Bench(study), access).server
    server.test_client_class = Client
    return server.test_client()


@pytest.fixture
def client(stranger, access):
    """A client that opened the printed address."""
    answer = stranger.get(f"/?{TOKEN}={access.token}", base_url=OWN)
    assert answer.status_code == 303
    return stranger


def test_the_printed_address_opens_the_page_and_leaves_the_token_out_of_it(stranger, access):
    answer = stranger.get(access.address.removeprefix(OWN), base_url=OWN)
    assert answer.location == "/"
    cookie = answer.headers["Set-Cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    opened = stranger.get("/", base_url=OWN)
    assert opened.status_code == 200
    assert access.token not in opened.text


def test_a_file_opens_the_page_once_and_holds_no_token(stranger, access):
    opener = access.opener()
    assert access.token not in opener
    place = opener.partition("url=")[2].partition("'")[0].removeprefix(OWN)
    # as a browser comes from a file
    first = stranger.get(place, base_url=OWN, headers={"Sec-Fetch-Site": "cross-site"})
    assert first.status_code == 200
    assert "SameSite=Strict" in first.headers["Set-Cookie"]
    assert access.token not in first.text
    assert stranger.get("/", base_url=OWN).status_code == 200
    stranger.delete_cookie(access.cookie, domain="127.0.0.1")
    assert stranger.get(place, base_url=OWN).status_code == 403
    assert stranger.get("/?ticket=", base_url=OWN).status_code == 403


def test_tokens_are_long_and_never_the_same():
    tokens = {Access(PORT).token for _ in range(50)}
    assert len(tokens) == 50
    assert min(map(len, tokens)) >= 40


@pytest.mark.parametrize(
    "path",
    [
        "/",
        "/_dash-layout",
        "/_dash-dependencies",
        "/assets/workbench.js",
        "/results/selection/report.html",
        "/beat",
        "/command/sensors",
    ],
)
@pytest.mark.parametrize("token", [None, "", "wrong", "é", "a" * 43])
def test_without_the_token_nothing_is_told(empty, path, token):
    answer = empty.test_client().get(path, base_url=OWN, query_string={} if token is None else {TOKEN: token})
    assert answer.status_code == 403
    assert answer.mimetype == "text/plain"
    assert "token" in answer.text


def test_without_the_token_no_job_is_cancelled(empty):
    answer = empty.test_client().post("/cancel/1", base_url=OWN, json={})
    assert (answer.status_code, answer.mimetype) == (403, "text/plain")


def test_a_cookie_with_another_token_is_none(stranger, access):
    stranger.set_cookie(access.cookie, "x" * 43, domain="127.0.0.1")
    assert stranger.get("/", base_url=OWN).status_code == 403


def test_nothing_is_stored_without_the_token(stranger, study):
    answer = stranger.post("/upload/recordings?name=a.csv", base_url=OWN, data=b"t,T1\n0,20\n")
    assert answer.status_code == 403
    assert list(study.iterdir()) == []


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": f"evil.example:{PORT}"},
        {"Host": "127.0.0.1:1"},
        {"Host": "127.0.0.1"},
        {"Origin": "http://evil.example"},
        {"Origin": f"http://127.0.0.1:{PORT + 1}"},
        {"Origin": f"https://127.0.0.1:{PORT}"},
        {"Origin": f"http://127.0.0.1:{PORT}.evil.example"},
        {"Origin": "null"},
        {"Origin": "http://[::1"},
        {"Origin": ""},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
    ],
    ids=lambda headers: str(next(iter(headers.items()))),
)
@pytest.mark.parametrize("method", ["get", "post"])
def test_other_pages_are_refused_even_with_the_cookie(guest, access, headers, method):
    answer = getattr(guest, method)("/", base_url=OWN, headers=headers)
    assert answer.status_code == 403
    with_token = getattr(guest, method)("/", base_url=OWN, headers=headers, query_string={TOKEN: access.token})
    assert with_token.status_code == 403


@pytest.mark.parametrize("origin", [OWN, f"http://localhost:{PORT}"])
def test_its_own_page_may_send(client, study, origin):
    headers = {"Origin": origin, "Sec-Fetch-Site": "same-origin"}
    answer = client.post("/upload/simulation?name=r1.csv", base_url=OWN, headers=headers, data=b"t,T1\n0,20\n")
    assert answer.status_code == 201
    assert (study / "simulation" / "r1.csv").read_bytes() == b"t,T1\n0,20\n"


def test_every_answer_has_strict_headers(client, stranger):
    for path in ("/", "/assets/workbench.js", "/nonsense"):
        headers = client.get(path, base_url=OWN).headers
        assert headers["Cache-Control"] == "no-store"
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["X-Frame-Options"] == "DENY"
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "frame-ancestors 'none'" in policy
        scripts = next(part for part in policy.split(";") if "script-src" in part)
        assert "unsafe" not in scripts


@pytest.mark.parametrize(
    "path",
    [
        "../secret.txt",
        "..%2Fsecret.txt",
        "%2e%2e/secret.txt",
        "selection/../../secret.txt",
        "/etc/passwd",
        "selection/%00",
        "recordings/r1.csv",
        "selection",
        "nothing.json",
    ],
)
def test_only_results_of_the_study_are_given(client, study, path):
    (study.parent / "secret.txt").write_text("secret")
    (study / "recordings").mkdir()
    (study / "recordings" / "r1.csv").write_text("t,T1\n")
    (study / "selection").mkdir()
    answer = client.get(f"/results/{path}", base_url=OWN)
    # an address with two slashes is none of a result: the page itself answers
    assert answer.status_code == 404 or '<script id="_dash-config"' in answer.text
    assert "secret" not in answer.text


def test_links_do_not_lead_out_of_the_study(client, study):
    (study.parent / "secret.txt").write_text("secret")
    try:
        (study / "link.txt").symlink_to(study.parent / "secret.txt")
    except OSError:
        pytest.skip("links cannot be made here")
    assert client.get("/results/link.txt", base_url=OWN).status_code == 404


def test_a_report_runs_in_an_origin_of_its_own(client, study):
    (study / "selection").mkdir()
    (study / "selection" / "report.html").write_text("<script>1</script>")
    (study / "selection" / "model.json").write_text("{}")
    answer = client.get("/results/selection/report.html", base_url=OWN)
    assert answer.mimetype == "text/html"
    assert answer.headers["X-Frame-Options"] == "SAMEORIGIN"
    policy = answer.headers["Content-Security-Policy"]
    assert policy.startswith("sandbox allow-scripts")
    assert "allow-same-origin" not in policy
    saved = client.get("/results/selection/report.html?download=1", base_url=OWN)
    assert saved.headers["Content-Disposition"] == "attachment; filename=report.html"
    assert client.get("/results/selection/model.json", base_url=OWN).mimetype == "text/plain"


def test_too_large_is_refused_before_and_while_it_is_read(client, study, monkeypatch):
    monkeypatch.setattr(study_folder, "MOST_UPLOADED_BYTES", 1000)
    address = "/upload/recordings?name=r1.csv"
    announced = client.post(address, base_url=OWN, data=b"x" * 2000)
    assert announced.status_code == 413
    assert "larger" not in announced.text
    assert "What to do" in announced.text
    assert list(study.rglob("*.csv")) == []


def test_a_disk_that_takes_nothing_is_told(client, study, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "link", full)
    monkeypatch.setattr(Path, "rename", full)
    answer = client.post("/upload/recordings?name=r1.csv", base_url=OWN, data=b"x")
    assert answer.status_code == 507
    assert "No space left" in answer.text
    assert "What to do" in answer.text


def test_a_study_folder_that_is_gone_is_told_to_who_sends_a_file(client, study):
    study.rmdir()
    answer = client.post("/upload/recordings?name=r1.csv", base_url=OWN, data=b"x")
    assert answer.status_code == 507
    assert "folder is gone" in answer.text
    assert not study.exists()


@pytest.mark.parametrize("path", ["/_dash-update-component", "/sensors/move", "/nonsense"])
def test_requests_without_a_file_are_small(guest, monkeypatch, path):
    monkeypatch.setattr(refusals, "MOST_REQUEST_BYTES", 1000)
    assert guest.post(path, base_url=OWN, data=b"x" * 1001).status_code == 413
    pieces = guest.post(path, base_url=OWN, input_stream=io.BytesIO(b"x"), headers={"Transfer-Encoding": "chunked"})
    assert pieces.status_code == 411


def test_a_defect_is_one_line_for_the_page_and_told_at_the_terminal(client, monkeypatch, caplog):
    def broken(*_):
        raise ZeroDivisionError("secret words")

    monkeypatch.setattr(page_module, "inside", broken)
    answer = client.get("/results/selection/report.html", base_url=OWN)
    assert answer.status_code == 500
    assert answer.mimetype == "text/plain"
    assert answer.text.count("\n") == 1
    assert "ZeroDivisionError" in answer.text
    assert "Traceback" not in answer.text
    assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
    assert "GET /results/selection/report.html: ZeroDivisionError: secret words" in caplog.text


def test_an_unknown_folder_receives_nothing(client, study):
    assert client.post("/upload/selection?name=a.csv", base_url=OWN, data=b"x").status_code == 404
    assert client.post("/upload/..?name=a.csv", base_url=OWN, data=b"x").status_code in (404, 405)
    assert list(study.iterdir()) == []


ENVELOPES = [
    b"", b"{", b"null", b"[]", b"7", b'"x"', b"{}", b'{"output": 7}', b'{"output": "notice.children"}',
    b'{"output": "saved.children", "inputs": []}', b'{"output": "saved.children", "inputs": {"id": "save"}}',
    b'{"output": "saved.children", "inputs": [[]]}',
    b'{"output": "saved.children", "inputs": [7], "changedPropIds": []}',
    b'{"output": "saved.children", "inputs": [{"id": "save", "property": "x"}]}',
    b'{"output": "saved.children", "inputs": [{"id": "save", "property": "n_clicks"}], "changedPropIds": {}}',
    b'{"output": "saved.children", "inputs": [{"id": "save", "property": "n_clicks"}], "state": 7}',
    b"\xff\xfe", b"[" * 5000,
]  # fmt: skip


@pytest.mark.parametrize("path", ["/_dash-update-component", "/sensors/move"])
@pytest.mark.parametrize("body", ENVELOPES, ids=range(len(ENVELOPES)))
@pytest.mark.parametrize("kind", ["application/json", "text/plain"])
def test_a_malformed_request_is_answered_in_one_line_and_nothing_is_told_as_a_defect(guest, caplog, path, body, kind):
    answer = guest.post(path, base_url=OWN, data=body, content_type=kind)
    # a move is an object; which of its words it has is judged by the page
    if path == "/sensors/move" and kind == "application/json" and answer.status_code == 200:
        assert "refused" in answer.get_json()
    else:
        assert answer.status_code in (400, 415)
        assert answer.mimetype == "text/plain"
        assert answer.text.count("\n") == 1
    assert caplog.text == ""


def test_what_hears_of_the_revision_waits_for_no_callback(tmp_path, access):
    """Dash would drop the call where the other one changes nothing, and the page would show what was."""
    callbacks = page(Bench(tmp_path.resolve()), access).callback_map
    writers = [key for key in callbacks if re.search(rf"\b{REVISION}\.data\b", key)]
    assert any(one["id"] == REVISION for entry in callbacks.values() for one in entry["inputs"])
    assert writers == []
