"""MTConnect agents: the current values of data items, and what is still in the buffer of the agent."""

import asyncio
import math
from collections.abc import Iterable, Mapping
from datetime import datetime
from typing import Any
from urllib.parse import urlsplit
from urllib.request import ProxyHandler, Request, build_opener
from xml.etree import ElementTree

from selector.live.io_file import Connection
from selector.live.links import History, Link, Sample, number_in

LARGEST_ANSWER = 16_000_000
PAGE = 1000  #: Observations that are asked for at once


class MTConnectLink(Link):
    """An agent; an address is the id of a data item."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    async def open(self) -> None:
        """See `Link`."""
        await self._answer("current")

    async def read(self, addresses: Iterable[str]) -> dict[str, Sample]:
        """See `Link`."""
        header, observations = await self._answer("current")
        now_s, wanted = _seconds(header.get("creationTime")), set(addresses)
        found = {}
        for item, source_s, text in observations:
            if item in wanted:
                quality = "UNAVAILABLE" if text == "UNAVAILABLE" else "good"
                age_s = None if now_s is None or source_s is None else now_s - source_s
                found[item] = Sample(number_in(text), quality, source_s, age_s)
        return found

    async def write(self, values: Mapping[str, float]) -> None:
        """See `Link`; an agent takes nothing."""
        raise PermissionError("MTConnect is read only")

    async def history(self, addresses: Iterable[str], since_s: float, until_s: float) -> History:
        """See `Link`."""
        header, _ = await self._answer("current")
        first, last = int(header["firstSequence"]), int(header["lastSequence"])
        found: History = {item: [] for item in addresses}
        while first <= last:
            header, observations = await self._answer(f"sample?from={first}&count={PAGE}")
            for item, source_s, text in observations:
                if item in found and source_s is not None and since_s <= source_s <= until_s:
                    found[item].append((source_s, number_in(text)))
            # an agent that does not go on would be asked for ever
            if int(header["nextSequence"]) <= first:
                break
            first = int(header["nextSequence"])
        return {item: sorted(of, key=lambda one: one[0]) for item, of in found.items()}

    async def _answer(self, question: str) -> tuple[dict[str, str], list[tuple[str, float | None, str]]]:
        root = await asyncio.to_thread(self._document, question)
        header: dict[str, str] = {}
        observations: list[tuple[str, float | None, str]] = []
        for element in root.iter():
            if element.tag.rpartition("}")[2] == "Header":
                header = dict(element.attrib)
            elif (item := element.get("dataItemId")) is not None:
                observations.append((item, _seconds(element.get("timestamp")), (element.text or "").strip()))
        return header, observations

    def _document(self, question: str) -> Any:
        url = f"{self._connection.url.rstrip('/')}/{question}"
        if urlsplit(url).scheme not in ("http", "https"):
            raise ValueError("expected an address with http:// or https://")
        # an agent stands in the same hall, and no proxy between
        opener = build_opener(ProxyHandler({}))
        with opener.open(Request(url), timeout=self._connection.timeout_s) as answer:  # noqa: S310 (looked at above)
            content = answer.read(LARGEST_ANSWER + 1)
        if len(content) > LARGEST_ANSWER:
            raise ValueError(f"an answer of more than {LARGEST_ANSWER} bytes")
        root = ElementTree.fromstring(content, ElementTree.XMLParser(target=_Plain()))  # noqa: S314 (without entities)
        if root.tag.rpartition("}")[2] != "MTConnectStreams":
            raise ValueError(f"the agent answered {root.tag.rpartition('}')[2][:80]}")
        return root


class _Plain(ElementTree.TreeBuilder):
    def doctype(self, *_: object) -> None:
        """Ends the reading before any entity is declared, whatever the encoding."""
        raise ValueError("an answer with a document type, which MTConnect does not have")


def _seconds(text: str | None) -> float | None:
    try:
        moment = math.nan if text is None else datetime.fromisoformat(text).timestamp()
    except (ValueError, OverflowError):
        return None
    return moment if math.isfinite(moment) else None
