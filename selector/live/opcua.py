"""OPC UA by asyncua: numbers with status codes in, numbers of the declared type out, history where it is kept."""

import asyncio
import contextlib
import logging
import math
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from difflib import get_close_matches
from typing import Any

from asyncua import Client, ua
from asyncua.ua.uaerrors import UaStatusCodeError

from selector.live.io_file import Connection
from selector.live.links import History, Sample, Tell, number_in

# what it says of a lost server stands in the journal
logging.getLogger("asyncua").setLevel(logging.CRITICAL)

_REALS = {ua.VariantType.Float, ua.VariantType.Double}
_COUNTS = {
    ua.VariantType.SByte, ua.VariantType.Byte, ua.VariantType.Int16, ua.VariantType.UInt16, ua.VariantType.Int32,
    ua.VariantType.UInt32, ua.VariantType.Int64, ua.VariantType.UInt64,
}  # fmt: skip
LONGEST_LOOK_S = 3.0  #: For what is like a NodeId that is not there


class OpcUaLink:
    """A server and its nodes, called by their NodeId, such as ``ns=2;s=Spindle.T1``."""

    def __init__(
        self, connection: Connection, reads: Iterable[str], writes: Iterable[str], integers: Iterable[str], tell: Tell
    ) -> None:
        self._connection, self._writes, self._integers = connection, tuple(writes), tuple(integers)
        self._reads, self._tell = tuple(reads), tell
        self._client: Client | None = None
        self._types: dict[str, ua.VariantType] = {}
        self._near: dict[str, str] = {}  #: Address that was not there → NodeIds like it, told once

    async def open(self) -> None:
        """See `Link`. Raises TypeError: the declared type of an output is no number, or not that of its value."""
        said = self._connection
        client = self._client = Client(said.url, timeout=max(said.timeout_s, 4.0))
        if said.security is not None:
            await client.set_security_string(said.security)
        if said.user is not None:
            client.set_user(said.user)
            client.set_password(said.password() or "")
        await client.connect()
        await self._look_for((*self._reads, *self._writes))
        self._types = {address: await self._type(address) for address in self._writes}

    async def _look_for(self, addresses: Iterable[str]) -> None:
        """Tells which of them the server does not have, and what it offers like them."""
        names = list(dict.fromkeys(addresses))
        ids = [ua.NodeId.from_string(name) for name in names]
        answers = await self._connected().uaclient.read_attributes(ids, ua.AttributeIds.NodeClass)
        codes = [None if one.StatusCode is None else one.StatusCode.value for one in answers]
        unknown = [n for n, code in zip(names, codes, strict=True) if code == ua.StatusCodes.BadNodeIdUnknown]
        if new := [name for name in unknown if name not in self._near]:
            offered: list[str] = []
            # what was found until then is enough; an odd server is no reason not to read it
            with contextlib.suppress(Exception):
                await asyncio.wait_for(self._browse(offered), LONGEST_LOOK_S)
            for name in new:
                self._near[name] = ", ".join(get_close_matches(name, offered, 3)) or "nothing like it"
                self._tell("node-unknown", asked=name, offered=self._near[name], advice="correct its address")

    async def _browse(self, offered: list[str]) -> None:
        """Adds the variables below the server's objects, those nearest to the root first."""
        folders, seen = [self._connected().nodes.objects.nodeid], set[ua.NodeId]()
        while folders:
            for one in await self._connected().get_node(folders.pop(0)).get_children_descriptions():
                # the server's account of itself is no sensor
                if one.NodeId.NamespaceIndex and one.NodeId not in seen:
                    seen.add(one.NodeId)
                    folders.append(one.NodeId)
                    if one.NodeClass is ua.NodeClass.Variable:
                        offered.append(one.NodeId.to_string())

    async def _type(self, address: str) -> ua.VariantType:
        node = self._connected().get_node(address)
        declared, value = await node.read_data_type(), await node.read_data_value(raise_on_bad_status=False)
        held = None if value.Value is None or value.Value.Value is None else value.Value.VariantType
        number = declared.Identifier
        if declared.NamespaceIndex == 0 and isinstance(number, int) and 0 < number <= 25:
            kind = ua.VariantType(number)
        elif held is not None:
            kind = held
        else:
            raise TypeError(f"{address} has the type {declared.to_string()}, expected Float or Double")
        if held is not None and held is not kind:
            raise TypeError(f"{address} is declared as {kind.name} and holds {held.name}: correct it in the control")
        if kind not in (_REALS | _COUNTS if address in self._integers else _REALS) or (
            value.Value is not None and value.Value.is_array
        ):
            raise TypeError(f"{address} has the type {kind.name}, expected one number, Float or Double")
        return kind

    async def read(self, addresses: Iterable[str]) -> dict[str, Sample]:
        """See `Link`."""
        names = list(addresses)
        ids = [ua.NodeId.from_string(name) for name in names]
        answers = await self._connected().uaclient.read_attributes(ids, ua.AttributeIds.Value)
        return {name: _sample(answer) for name, answer in zip(names, answers, strict=True)}

    async def write(self, values: Mapping[str, float]) -> None:
        """See `Link`."""
        given = []
        for name, value in values.items():
            kind = self._types[name]
            given.append(ua.DataValue(ua.Variant(value if kind in _REALS else int(value), kind)))
        ids = [ua.NodeId.from_string(name) for name in values]
        codes = await self._connected().uaclient.write_attributes(ids, given, ua.AttributeIds.Value)
        for name, code in zip(values, codes, strict=True):
            if not code.is_good():
                raise PermissionError(f"{name} was refused: {code.name}")

    async def history(self, addresses: Iterable[str], since_s: float, until_s: float) -> History:
        """See `Link`."""
        found: History = {}
        for name in addresses:
            node = self._connected().get_node(name)
            # servers without history refuse
            with contextlib.suppress(UaStatusCodeError):
                kept = await node.read_raw_history(_moment(since_s), _moment(until_s))
                samples = [_sample(one) for one in kept]
                found[name] = sorted(
                    (one.source_s, one.value if one.quality == "good" else math.nan)
                    for one in samples
                    if one.source_s is not None
                )
        return found

    async def close(self) -> None:
        """See `Link`."""
        if self._client is not None:
            client, self._client = self._client, None
            with contextlib.suppress(Exception):
                await client.disconnect()

    def _connected(self) -> Client:
        if self._client is None:
            raise ConnectionError("not connected")
        return self._client


def _sample(answer: ua.DataValue) -> Sample:
    source_s, server_s = _seconds(answer.SourceTimestamp), _seconds(answer.ServerTimestamp)
    age_s = None if source_s is None or server_s is None else server_s - source_s
    code = answer.StatusCode
    value = math.nan if answer.Value is None else number_in(answer.Value.Value)
    return Sample(value, "good" if code is None or code.is_good() else code.name, source_s, age_s)


def _seconds(moment: Any) -> float | None:
    return moment.replace(tzinfo=UTC).timestamp() if isinstance(moment, datetime) and moment.year > 1970 else None


def _moment(moment_s: float) -> datetime:
    return datetime.fromtimestamp(moment_s, UTC).replace(tzinfo=None)
