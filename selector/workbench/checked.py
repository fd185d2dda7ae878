"""Callbacks get what they say they take: the browser's page sends nothing else, another program may."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import dash
from pydantic import ConfigDict, ValidationError, validate_call

from selector.errors import OptionError


class CheckedDash(dash.Dash):
    """Dash whose callbacks are called only with arguments of the kinds that their annotations name."""

    def callback(self, *of: Any, **options: Any) -> Callable[..., Any]:
        """As `dash.Dash.callback`."""
        register = super().callback(*of, **options)
        return lambda function: register(checked(function))


def checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function that is called only with arguments of the kinds that its annotations name."""
    judged = validate_call(config=ConfigDict(strict=True))(function)

    @functools.wraps(function)
    def called(*sent: Any) -> Any:
        try:
            return judged(*sent)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            raise OptionError(
                f"{repr(first['input'])[:80]} came from the browser",
                expected=first["msg"].removeprefix("Input should be "),
                where=function.__name__.strip("_"),
                advice="load the page again; nothing was changed",
            ) from None

    return called
