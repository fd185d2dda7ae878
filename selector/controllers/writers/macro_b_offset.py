"""How a macro writes the external work offset: in inches or millimetres, absolute, and on lathes of G-code system A.

What group of modal information has which code is from general knowledge of FANUC controls.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

from selector.controllers.writers.macro_b import remarks

ABSOLUTE_OR_NOT, INCH_OR_MM = 4003, 4006
"""Modal information: G90 or G91 of group 03, G20 or G21 of group 06."""

_INCH, _MM = (20, 70), (21, 71)
"""What group 06 has; 70 and 71 in G-code system C of lathes."""

_GROUP_3, _UNITS = 31, 32
"""Local variables."""

_WRITE, _NO_UNIT, _NO_UVW = 20, 890, 891


def offset_asked(axes: Collection[str]) -> Iterator[str]:
    """Jumps to an alarm where the control cannot be told what is meant, before anything is changed."""
    yield from remarks("inch or mm, absolute or incremental")
    yield f"#{_UNITS}=0."
    yield from (f"IF[#{INCH_OR_MM}EQ{code}.]THEN#{_UNITS}=1000." for code in _MM)
    yield from (f"IF[#{INCH_OR_MM}EQ{code}.]THEN#{_UNITS}=25400." for code in _INCH)
    yield f"IF[#{_UNITS}EQ0.]GOTO{_NO_UNIT}"
    yield f"#{_GROUP_3}=#{ABSOLUTE_OR_NOT}"
    if set(axes) & set("UVW"):
        # in G-code system A of lathes U, V and W are increments of X, Y and Z
        yield f"IF[[#{_GROUP_3}-90.]*[#{_GROUP_3}-91.]NE0.]GOTO{_NO_UVW}"


def offset_written(corrections: Mapping[str, int], end: int) -> Iterator[str]:
    """Per axis the correction [µm] of a variable, in absolute values; G90 and G91 are as before afterwards."""
    yield from remarks("external work offset")
    yield f"IF[#{_GROUP_3}NE91.]GOTO{_WRITE}"
    yield "G90"
    yield f"N{_WRITE}"
    yield from (f"G10L2P0{axis}[#{variable}/#{_UNITS}]" for axis, variable in corrections.items())
    yield f"IF[#{_GROUP_3}NE91.]GOTO{end}"
    yield "G91"
    yield f"GOTO{end}"
    yield f"N{_NO_UNIT}"
    yield "#3000=101(NEITHER INCH NOR MM)"
    if set(corrections) & set("UVW"):
        yield f"N{_NO_UVW}"
        yield "#3000=102(U V W IN G-CODE SYSTEM A)"
