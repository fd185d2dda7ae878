"""MQTT by aiomqtt: the last message of a topic in, confirmed messages out, what was retained is not believed."""

import asyncio
import contextlib
import json
from collections.abc import Iterable, Mapping
from typing import Any
from urllib.parse import urlsplit

import aiomqtt

from selector.live.io_file import Connection
from selector.live.links import Clock, Link, Sample, number_in

LARGEST_PAYLOAD = 65_536


class MqttLink(Link):
    """A broker; an address is a topic, or ``topic#key.key`` for a number inside of JSON."""

    def __init__(self, connection: Connection, reads: Iterable[str], writes: Iterable[str], clock: Clock) -> None:
        self._connection, self._clock, self._writes = connection, clock, frozenset(writes)
        self._topics = {address.partition("#")[0] for address in (*reads, *self._writes)}
        self._client: aiomqtt.Client | None = None
        self._listening: asyncio.Task[None] | None = None
        self._last: dict[str, tuple[bytes, float]] = {}
        self._news = asyncio.Event()
        self._awaited: set[str] = set()

    async def open(self) -> None:
        """See `Link`."""
        said = self._connection
        url = urlsplit(said.url)
        is_safe = url.scheme == "mqtts"
        client = aiomqtt.Client(
            url.hostname or "localhost",
            url.port or (8883 if is_safe else 1883),
            username=said.user,
            password=said.password(),
            timeout=said.timeout_s,
            tls_params=aiomqtt.TLSParameters() if is_safe else None,
        )
        await client.__aenter__()
        self._client = client
        self._last.clear()
        await client.subscribe([(topic, 1) for topic in sorted(self._topics)])
        self._listening = asyncio.create_task(self._listen(client))

    async def _listen(self, client: aiomqtt.Client) -> None:
        async for message in client.messages:
            # nobody knows how old a retained message is
            if message.retain or not isinstance(message.payload, bytes) or len(message.payload) > LARGEST_PAYLOAD:
                continue
            topic = str(message.topic)
            self._last[topic] = message.payload, self._clock.monotonic()
            self._awaited.discard(topic)
            self._news.set()

    async def read(self, addresses: Iterable[str]) -> dict[str, Sample]:
        """See `Link`; for what was just written, waits until the broker has handed it out."""
        names = list(addresses)
        topics = {name.partition("#")[0] for name in names}
        while True:
            if self._listening is None or self._listening.done():
                raise ConnectionError("the broker is gone")
            if not topics & self._awaited:
                break
            self._news.clear()
            news = asyncio.create_task(self._news.wait())
            await asyncio.wait({self._listening, news}, return_when="FIRST_COMPLETED")
            news.cancel()
        now_s = self._clock.monotonic()
        found = {}
        for name in names:
            topic, _, key = name.partition("#")
            if topic in self._last:
                payload, moment_s = self._last[topic]
                found[name] = Sample(_number(payload, key), age_s=now_s - moment_s)
        return found

    async def write(self, values: Mapping[str, float]) -> None:
        """See `Link`."""
        if self._client is None:
            raise ConnectionError("not connected")
        for topic, value in values.items():
            self._awaited.add(topic)
            await self._client.publish(topic, repr(value), qos=1)

    async def close(self) -> None:
        """See `Link`."""
        self._awaited.clear()
        if self._listening is not None:
            self._listening.cancel()
            with contextlib.suppress(asyncio.CancelledError, Exception):
                await self._listening
            self._listening = None
        if self._client is not None:
            client, self._client = self._client, None
            with contextlib.suppress(Exception):
                await client.__aexit__(None, None, None)


def _number(payload: bytes, key: str) -> float:
    value: Any = payload.decode("utf-8", "replace")
    if key:
        try:
            value = json.loads(value)
            for part in key.split("."):
                value = value[part]
        except (ValueError, LookupError, TypeError, RecursionError):
            value = None
    return number_in(value)
