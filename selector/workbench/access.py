"""Who may talk to the workbench, in which form, and what is answered to a request that may not be."""

import functools
import hmac
import logging
import secrets
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from typing import Any

import dash
from flask import Flask, Request, Response, redirect, request
from pydantic import BaseModel, ConfigDict, Field, ValidationError, validate_call
from werkzeug.exceptions import HTTPException

from selector.errors import InputError, OptionError

TOKEN, TICKET = "token", "ticket"  # (the names of the parameters)
_OWN = ("same-origin", "none")
_HEADERS = {
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}

#: For pages that a command wrote: they run in an origin of their own, whoever opens them, and load nothing.
RESULT_POLICY = (
    "sandbox allow-scripts allow-downloads; default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)


@dataclass(frozen=True)
class Access:
    """The door of one server."""

    port: int  #: Port at 127.0.0.1
    token: str = field(default_factory=lambda: secrets.token_urlsafe(32))  #: What a request must know
    _tickets: set[str] = field(default_factory=set)

    def opener(self) -> str:
        """A page that leads a browser to the workbench, once: for a file that only its owner can read.

        So the command line of a browser, which everybody on this computer can read, names the file and no token.
        """
        ticket = secrets.token_urlsafe(32)
        self._tickets.add(ticket)
        return _leading_to(f"http://127.0.0.1:{self.port}/?{TICKET}={ticket}")

    def admits(self, ticket: str | None) -> bool:
        """Whether this is the ticket of an opener; it is none from now on."""
        if ticket not in self._tickets:
            return False
        self._tickets.remove(ticket)
        return True

    @property
    def address(self) -> str:
        """The address with the token, for the browser."""
        return f"http://127.0.0.1:{self.port}/?{TOKEN}={self.token}"

    @property
    def cookie(self) -> str:
        """Name of the cookie: browsers do not tell ports apart, so two workbenches need two names."""
        return f"selector_{self.port}"

    def refusal(self, asked: Request) -> str | None:
        """Why a request is refused, in plain words; None: it is not."""
        own = {f"127.0.0.1:{self.port}", f"localhost:{self.port}"}
        if asked.headers.get("Host", "") not in own:
            return "This address is not the workbench's own. Open the address that `selector workbench` printed."
        origin = asked.headers.get("Origin")
        if origin is not None and origin not in {f"http://{one}" for one in own}:
            return "Another page tried to use the workbench. It was not let in."
        if asked.headers.get("Sec-Fetch-Site", "none") not in _OWN:
            return (
                "Another page pointed to the workbench. Copy the address that `selector workbench` printed into the "
                "address bar of the browser."
            )
        if not self._knows(asked.cookies.get(self.cookie)) and not self._knows(asked.args.get(TOKEN)):
            return (
                "The token is missing or wrong. Open the whole address that `selector workbench` printed, with all "
                "that follows the question mark."
            )
        return None

    def let_in(self, answer: Any) -> Any:
        """The answer with the cookie that the next requests must have."""
        answer.set_cookie(self.cookie, self.token, httponly=True, samesite="Strict", path="/")
        return answer

    def _knows(self, said: str | None) -> bool:
        return said is not None and hmac.compare_digest(said.encode("utf-8", "replace"), self.token.encode("ascii"))


def _leading_to(address: str) -> str:
    refresh = f"<meta http-equiv=refresh content='0;url={address}'>"
    return f"<!doctype html><meta charset=utf-8><title>selector</title>{refresh}"


def guard(server: Flask, access: Access, scripts: Sequence[str] = ()) -> None:
    """Lets only requests in that `access` does not refuse, and sends every answer with strict headers.

    `scripts` are hashes of the scripts in the page itself, as a Content-Security-Policy names them.
    """
    policy = (
        f"default-src 'none'; script-src 'self' {' '.join(scripts)}; style-src 'self' 'unsafe-inline'; "
        "img-src 'self' data: blob:; font-src 'self'; connect-src 'self'; frame-src 'self'; base-uri 'none'; "
        "form-action 'none'; frame-ancestors 'none'"
    )

    @server.before_request
    def _refused() -> Response | None:
        is_opening = request.method == "GET" and request.path == "/"
        if is_opening and access.admits(request.args.get(TICKET)):
            # a page of our own goes on: what follows a link from elsewhere is refused
            admitted: Response = access.let_in(Response(_leading_to("/"), mimetype="text/html"))
            return admitted
        why = access.refusal(request)
        if why is not None:
            return _line(why, 403)
        if TOKEN in request.args and is_opening:
            # the token leaves the address, so that it is in no history and on no screenshot
            opened: Response = access.let_in(redirect("/", code=303))
            return opened
        return None

    @server.after_request
    def _strict(answer: Response) -> Response:
        for name, value in _HEADERS.items():
            answer.headers[name] = value
        answer.headers.setdefault("Content-Security-Policy", policy)
        answer.headers.setdefault("X-Frame-Options", "DENY")
        return answer


MOST_REQUEST_BYTES = 10_000_000  #: Of requests that carry no file; what a page sends is far less.

UPLOAD = "/upload/"  #: Where files are sent to; they are not held in memory, and have a limit of their own.

_CALLBACKS = "/_dash-update-component"

_LOG = logging.getLogger("selector.workbench")


def tell(doing: str, error: Exception) -> None:
    """A defect, for the person at the terminal: what was being done, and where it went wrong."""
    _LOG.error("%s: %s: %s", doing, type(error).__name__, error, exc_info=error)


class _Sent(BaseModel):
    """What a page sends of a property of a component."""

    model_config = ConfigDict(strict=True)

    id: str | dict[str, str | int | float]
    property: str
    value: Any = None


class _Envelope(BaseModel):
    """What a page sends to have a callback run."""

    model_config = ConfigDict(strict=True)

    output: str
    outputs: Any = None
    inputs: list[_Sent | list[_Sent]]
    state: list[_Sent | list[_Sent]] = []
    changed: list[str] = Field(default=[], alias="changedPropIds")


def _is_of(app: dash.Dash, said: Any) -> bool:
    """Whether one of the callbacks is asked to run, with all that it is to be given."""
    try:
        sent = _Envelope.model_validate(said)
    except ValidationError:
        return False
    known = app.callback_map.get(sent.output)
    return known is not None and all(
        asked is not None
        and given is not None
        and isinstance(given, list) == str(asked["id"]).startswith("{")
        and {one.property for one in (given if isinstance(given, list) else [given])} <= {asked["property"]}
        for kind, places in (("inputs", sent.inputs), ("state", sent.state))
        for asked, given in zip_longest(known[kind], places)
    )


def defect(doing: str, error: Exception) -> InputError:
    """A defect of ours, told at the terminal, as the page shows it."""
    tell(doing, error)
    return InputError(
        f"this is a defect of the workbench, not of your data: {type(error).__name__}: {error}",
        expected="",
        where=doing,
        advice="report it, with what you did; the files of the study are as they were",
    )


def answer_refusals(server: Flask, app: dash.Dash) -> None:
    """Requests that the page does not send are refused; what is refused, and a defect, is answered with one line.

    Those beyond `MOST_REQUEST_BYTES` are not read; those to run a callback must be as `app` has it.
    """

    @server.before_request
    def _too_large() -> Response | None:
        if request.path.startswith(UPLOAD):
            return None
        if "Transfer-Encoding" in request.headers:
            return _line("A request of unknown length. Send its length.", 411)
        if (request.content_length or 0) > MOST_REQUEST_BYTES:
            return _line(f"A request of more than {MOST_REQUEST_BYTES // 1_000_000} MB. The page sends less.", 413)
        if request.method == "POST":
            try:
                said = request.get_json(silent=True)
            except RecursionError:
                said = None
            if said is None or (request.path == _CALLBACKS and not _is_of(app, said)):
                return _line("This is not what a page of the workbench sends. Load the page again.", 400)
        return None

    @server.errorhandler(Exception)
    def _defect(error: Exception) -> Response:
        if isinstance(error, HTTPException):
            return _line(f"{error.code} {error.name}: {error.description}", error.code or 500)
        tell(f"{request.method} {request.path}", error)
        return _line(
            f"This is a defect of the workbench ({type(error).__name__}). Load the page again; if it comes back, "
            "report it with what the terminal says.",
            500,
        )


def _line(text: str, status: int) -> Response:
    return Response(text + "\n", status=status, mimetype="text/plain")


def not_sent(value: object, expected: str, where: str) -> OptionError:
    """That a value came from the browser that no page sends."""
    found = f"{repr(value)[:80]} came from the browser"
    return OptionError(found, expected=expected, where=where, advice="load the page again; nothing was changed")


class CheckedDash(dash.Dash):
    """Dash whose callbacks are called only with arguments of the kinds that their annotations name."""

    def callback(self, *of: Any, **options: Any) -> Callable[..., Any]:
        """As `dash.Dash.callback`."""
        register = super().callback(*of, **options)
        return lambda function: register(checked(function))


def of_another_kind(error: ValidationError, where: str) -> OptionError:
    """What a browser sent, and which kind was expected."""
    first = error.errors(include_url=False)[0]
    return not_sent(first["input"], first["msg"].removeprefix("Input should be "), where)


def checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function that is called only with arguments of the kinds that its annotations name."""
    judged = validate_call(config=ConfigDict(strict=True))(function)

    @functools.wraps(function)
    def called(*sent: Any) -> Any:
        try:
            return judged(*sent)
        except ValidationError as error:
            raise of_another_kind(error, function.__name__.strip("_")) from None

    return called
