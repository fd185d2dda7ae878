"""LinuxCNC's HAL through ``halcmd``: pins and parameters (with a dot in the name) and signals (without)."""

import asyncio
import re
from collections.abc import Iterable, Mapping

from selector.live.links import Link, Sample, number_in

_TRUTHS = {"TRUE": 1.0, "FALSE": 0.0}


class HalLink(Link):
    """The HAL of this computer. A pin that is linked to a signal is written through its signal."""

    async def read(self, addresses: Iterable[str]) -> dict[str, Sample]:
        """See `Link`."""
        names = list(addresses)
        lines = (await self._said([f"get{_kind(name)} {name}" for name in names])).splitlines()
        if len(lines) != len(names):
            raise LookupError(f"halcmd gave {len(lines)} values for {', '.join(names)}")
        return {
            name: Sample(_TRUTHS.get(line.strip(), number_in(line.strip())))
            for name, line in zip(names, lines, strict=True)
        }

    async def write(self, values: Mapping[str, float]) -> None:
        """See `Link`."""
        # a count of 3.0 is no s32 for halcmd
        await self._said([f"set{_kind(name)} {name} {value:.17g}" for name, value in values.items()])

    async def _said(self, commands: list[str]) -> str:
        run = await asyncio.create_subprocess_exec(
            "halcmd", "-s", "-f",
            stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE,
        )  # fmt: skip
        try:
            out, err = await run.communicate("\n".join([*commands, ""]).encode())
        except asyncio.CancelledError:
            run.kill()
            await run.wait()
            raise
        if run.returncode != 0:
            raise PermissionError(err.decode(errors="replace").strip()[:200] or f"halcmd ended with {run.returncode}")
        return out.decode(errors="replace")


def _kind(name: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9_.:-]{1,47}", name):
        raise ValueError(f"{name!r} is no name of HAL")
    return "p" if "." in name else "s"
