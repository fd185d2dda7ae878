"""What a column measures, judged by its name, its unit and its numbers."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.units import CANONICAL_UNITS, parse_unit, same_dimension

ROLE_WORDS: tuple[tuple[str, tuple[str, ...]], ...] = (
    (
        "state",
        (
            r"(coolant|k[üu]hlmittel|kss|mist|air|pump|pumpe)[ _-]?(on|off|state|status|open|ein|an|aktiv|active)\b",
            r"(door|t[üu]r|valve|ventil|fan|l[üu]fter|chiller|heater)[ _-]?(on|off|state|status|open|ein|an|active)\b",
        ),
    ),
    (
        "state",
        (
            r"(^|[ _-])(on|off|state|status|flag|mode|enable[d]?|alarm|program|prog|m0?[789])$",
            r"状态",
            r"狀態",
            r"状態",
            r"開關",
            r"开关",
            r"冷却液开",
            r"состояние",
        ),
    ),
    (
        "ambient",
        (
            r"amb(ient)?(?![a-z])",
            r"ambient",
            r"hall",
            r"umgeb",
            r"raum",
            r"room",
            r"workshop",
            r"environ",
            r"surround",
            r"shop",
            r"outdoor",
            r"luft",
            r"^t_?(inf|env|air|room|u)\b",
            r"\bair\b",
            r"环境",
            r"環境",
            r"室温",
            r"周囲",
            r"外気",
            r"车间",
            r"车間",
            r"气温",
            r"окруж",
            r"цех",
            r"воздух",
            r"помещен",
            r"okol",
            r"prost[řr]ed",
            r"otoczen",
            r"ambi(ante|ente)",
            r"környezet",
        ),
    ),
    (
        "position_command",
        (
            r"(cmd|command|soll|setpoint|set_?pos|target|reference|demand|指令|目标|目標|задан).*",
            r".*(?:^|[ _-])(cmd|soll|ref|set)$",
        ),
    ),
    (
        "temperature",
        (
            r"temp",
            r"^(t|pt|tc|rtd|th|tk|ntc|ni|pt100|pt1000|tmp|ts|theta|θ|ϑ)[ _.#-]?\d+[a-z]?$",
            r"^(t|tc|pt|temp|tmp)[ _.-][a-z].*",
            r"^t$",
            r"^[Δδd]t[ _]?\d*$",
            r"thermo",
            r"温",
            r"темп",
            r"teplot",
            r"hőm",
            r"^°c$",
            r"^ch(annel)?[ _]?\d+[ _]?°c",
        ),
    ),
    (
        "spindle_speed",
        (
            r"rpm",
            r"spindle[ _-]*(speed|rev|n\b)",
            r"speed",
            r"drehzahl",
            r"spindeldreh",
            r"^n([ _-]?(ist|soll|act|sp|spindle|s))?$",
            r"^s$",
            r"^s[ _-]?(act|ist|cmd|actual|speed)$",
            r"转速",
            r"轉速",
            r"回転",
            r"оборот",
            r"част.*вращ",
            r"^об",
            r"ot[áa][čc]k",
            r"obrot",
            r"vitesse.*(broche|rotation)",
            r"velocidad.*husillo",
            r"r/min",
            r"^u/min$",
        ),
    ),
    (
        "feed_rate",
        (
            r"feed",
            r"vorschub",
            r"进给",
            r"進給",
            r"送り",
            r"подач",
            r"avance",
            r"posuv",
        ),
    ),
    (
        "velocity",
        (
            r"^v$",
            r"veloc",
            r"geschw",
            r"скорост",
            r"速度",
            r"^v[ _]?[xyz]$",
            r"vel[ _.]?[xyz]?$",
        ),
    ),
    (
        "displacement",
        (
            r"disp",
            r"drift",
            r"err(or)?(?![a-z])",
            r"error",
            r"verlag",
            r"verschieb",
            r"abweich",
            r"deform",
            r"growth",
            r"dehnung",
            r"ausdehn",
            r"expansion",
            r"deviation",
            r"gap",
            r"probe",
            r"gauge",
            r"dial",
            r"tool[ _-]?(point|centre|center|tip)",
            r"tcp",
            r"位移",
            r"变形",
            r"變形",
            r"変位",
            r"误差",
            r"誤差",
            r"热伸长",
            r"смещ",
            r"перемещ",
            r"деформ",
            r"погреш",
            r"удлин",
            r"d[ée]placement",
            r"posun",
            r"przemieszcz",
            r"elmozd",
            r"^(d|delta|Δ|δ|Δ ?l|e|eps|u)[ _]?[xyz]\d?$",
            r"^[xyz]\d?$",
            r"^l?vdt",
            r"^eddy",
            r"^cap(acitive)?[ _]?\d",
            r"^laser",
        ),
    ),
    (
        "acceleration",
        (
            r"^acc",
            r"accel",
            r"beschl",
            r"ускор",
            r"加速度",
            r"vibration",
            r"振动",
        ),
    ),
    (
        "force",
        (
            r"force",
            r"kraft",
            r"сила",
            r"усили",
            r"^f[ _]?[xyz]?$",
            r"切削力",
            r"力$",
        ),
    ),
    (
        "current",
        (
            r"current",
            r"strom",
            r"^i([ _]?[quvwdxyz0-9]?)$",
            r"ток",
            r"电流",
            r"電流",
            r"^amp(ere)?s?$",
        ),
    ),
    (
        "voltage",
        (
            r"volt",
            r"spannung",
            r"^u[ _]?\d*$",
            r"^v[ _]?\d+$",
            r"напряж",
            r"电压",
            r"電圧",
        ),
    ),
    (
        "flow",
        (
            r"flow",
            r"durchfluss",
            r"volumenstrom",
            r"расход",
            r"流量",
        ),
    ),
    (
        "frequency",
        (
            r"freq",
            r"частота",
            r"频率",
            r"周波数",
            r"^f[ _]?hz",
        ),
    ),
    (
        "position",
        (
            r"pos(ition)?(?![a-z])",
            r"position",
            r"actual",
            r"^ist",
            r"位置",
            r"координ",
            r"coord",
            r"stroke",
            r"travel",
            r"行程",
        ),
    ),
    (
        "amplitude",
        (
            r"ampl",
            r"振幅",
            r"амплит",
        ),
    ),
    (
        "size",
        (r"^(size|ma[ßs]s?|diameter|durchmesser|dia|直径|尺寸|размер|диаметр)",),
    ),
)
"""Role and regular expressions, any of which found in the name speaks for it."""


_PATTERNS = tuple((role, re.compile("|".join(words), re.IGNORECASE)) for role, words in ROLE_WORDS)
_PLACES = re.compile(
    r"spindle|spindel|bearing|lager|column|st[äa]nder|s[äa]ule|bed|bett|table|tisch|motor|coolant|k[üu]hl|oil|[öo]l\b|nut|mutter|"
    r"screw|housing|geh[äa]use|head(stock)?|nose|front|rear|vorn|hinten|wall|gear|getriebe|tank|hydraul|chiller|guide|"
    r"saddle|carriage|ram|turret|transf|cabinet|ref|主轴|轴承|床身|立柱|电机|丝杠|螺母|前|后|油|冷却|主軸|軸受|шпинд|подшип|станин|"
    r"стойк|двигат|масл|vřeten|ložis|wrzec|łożys|palier|broche|b[âa]ti|arri[èe]re|avant|moteur|huile|cojinete|husillo|mandrino|cuscinetto",
    re.IGNORECASE,
)
_UNIT_ROLES: tuple[tuple[str, str], ...] = (
    ("degC", "temperature"), ("rpm", "spindle_speed"), ("mm/min", "feed_rate"), ("N", "force"), ("A", "current"),
    ("V", "voltage"), ("m/s^2", "acceleration"), ("liter/min", "flow"), ("Hz", "frequency"),
)  # fmt: skip
_AXIS = re.compile(
    r"(?<![A-Za-z])(?:[dDeEuU]|delta|Delta|Δ|δ|disp|err|pos)?[ _.-]?(?P<axis>[XYZABCUVWxyz])(?:[ _-]?\d)?(?![A-Za-z])"
)


@dataclass(frozen=True)
class RoleGuess:
    """A role and where it came from."""

    role: str | None  #: None when nothing speaks for any role
    unit: str  #: pint name of the unit of the values in the file
    axis: str | None  #: Machine axis in the name
    guessed: tuple[str, ...]  #: Which of "role", "unit", "axis" are not written in so many words
    doubt: str | None  #: What else it could be, in words, when the guess is uncertain


def role_guess(name: str, unit: str | None, values: NDArray[np.float64], role: str | None = None) -> RoleGuess:
    """The role of a column; with `role` given, only its unit and axis are judged.

    Parameters
    ----------
    name : str
        Header without its unit.
    unit : str or None
        Unit as a pint name, None if the file names none.
    values : ndarray
        Its numbers, to tell a position in mm from an error in mm.
    """
    # "T1.2" is the second column called T1
    folded = re.sub(r"(?<=\w)\.\d{1,3}$", "", unicodedata.normalize("NFKC", name).strip())
    if role is not None:
        return _with_unit(role, folded, unit, None, ())
    named = [r for r, pattern in _PATTERNS if pattern.search(folded)]
    if unit is not None and unit != "1":
        return _by_unit(named, folded, unit, values)
    if not named:
        if _PLACES.search(folded) and _like_temperature(values):
            place = "the name says where, not what; the numbers look like temperatures"
            return _with_unit("temperature", folded, unit, place, ("role",))
        if _two_valued(values):
            only = None if unit == "1" else "nothing but its two values 0 and 1 says so"
            return _with_unit("state", folded, "1", only, ("role",))
        return RoleGuess(None, unit or "1", None, ("role",), None)
    first = named[0]
    doubt: str | None = None
    if unit == "1" and not same_dimension("1", CANONICAL_UNITS[first]):
        return _with_unit("state", folded, "1", f"its name could also mean {first}", ("role",))
    if first in ("temperature", "ambient") and not _like_temperature(values):
        rest = [r for r in named if r not in ("temperature", "ambient")]
        doubt = "its numbers are no usual temperatures"
        first = rest[0] if rest else first
    if len(folded) <= 2 and first in ("displacement", "spindle_speed", "velocity", "current", "voltage", "force"):
        doubt = f"a name of {len(folded)} letter(s) and no unit say little"
    if first == "spindle_speed" and _like_temperature(values) and _PLACES.search(folded) and not _is_speed_word(folded):
        return _with_unit("temperature", folded, unit, "the name says where, not what", ("role",))
    return _with_unit(first, folded, None, doubt, ("role",))


def role_of_numbers(values: NDArray[np.float64]) -> str:
    """The role that numbers alone speak for; to be told as a guess."""
    known = values[np.isfinite(values)]
    if _two_valued(values):
        return "state"
    return "temperature" if len(known) and known.min() >= 5 and known.max() <= 150 else "displacement"


def _is_speed_word(name: str) -> bool:
    return re.search(r"speed|rpm|dreh|速|оборот|^[ns]$", name, re.IGNORECASE) is not None


def _by_unit(named: list[str], name: str, unit: str, values: NDArray[np.float64]) -> RoleGuess:
    fitting = [role for role in named if _fits(unit, role)]
    if fitting:
        role = fitting[0]
        if role == "displacement" and unit != "um":
            return _length(name, unit, values, named)
        return _with_unit(role, name, unit, None, ("role",))
    if same_dimension(unit, "m"):
        return _length(name, unit, values, named)
    for typical, role in _UNIT_ROLES:
        if same_dimension(unit, typical):
            if role == "feed_rate" and unit in ("m/s", "mm/s"):
                role = "velocity"
            return _with_unit(role, name, unit, None, ("role",))
    if unit == "percent":
        return RoleGuess(None, unit, None, ("role",), None)
    return RoleGuess(None, unit, None, ("role",), None)


def _fits(unit: str, role: str) -> bool:
    if role == "state":
        return unit == "1"
    return same_dimension(unit, CANONICAL_UNITS[role])


def _length(name: str, unit: str, values: NDArray[np.float64], named: list[str]) -> RoleGuess:
    """A length is an error when it is in µm or small, a position when it is large."""
    per_mm = {"um": 1e-3, "mm": 1.0, "nm": 1e-6, "m": 1e3, "cm": 10.0, "inch": 25.4, "thou": 0.0254, "decimicron": 1e-4}
    known = values[np.isfinite(values)]
    span_mm = float(np.ptp(known)) * per_mm.get(unit, 1.0) if len(known) else 0.0
    small = unit in ("um", "nm", "thou", "decimicron") or span_mm < 1.5
    spoken = [r for r in named if r in ("displacement", "position", "position_command", "size", "amplitude")]
    if small and (not spoken or spoken[0] == "displacement"):
        plain = re.fullmatch(r"[XYZxyz]\d?", name) is not None and unit not in ("um", "nm", "thou", "decimicron")
        doubt = f"an axis letter in {unit} could also be a position; its span is {span_mm:.3g} mm" if plain else None
        return _with_unit("displacement", name, unit, doubt, ("role",))
    if spoken and spoken[0] != "displacement":
        return _with_unit(spoken[0], name, unit, None, ("role",))
    doubt = f"its span of {span_mm:.3g} mm is that of a position, its name could mean an error" if spoken else None
    return _with_unit("position", name, unit, doubt, ("role",))


def _with_unit(role: str, name: str, unit: str | None, doubt: str | None, guessed: tuple[str, ...]) -> RoleGuess:
    if unit is None or (unit == "1" and CANONICAL_UNITS[role] != "1"):
        unit = CANONICAL_UNITS[role]
        if role not in ("state",):
            guessed = (*guessed, "unit")
    axis = (
        _axis(name)
        if role in ("displacement", "position", "position_command", "velocity", "acceleration", "force")
        else None
    )
    return RoleGuess(role, unit, axis, (*guessed, *(("axis",) if axis else ())), doubt)


def _axis(name: str) -> str | None:
    match = _AXIS.search(name)
    return match["axis"].upper() if match else None


def _like_temperature(values: NDArray[np.float64]) -> bool:
    known = values[np.isfinite(values) & (np.abs(values) < 800)]
    return len(known) == 0 or (-40 <= float(np.median(known)) <= 250)


def _two_valued(values: NDArray[np.float64]) -> bool:
    known = values[np.isfinite(values)]
    return bool(len(known)) and bool(np.isin(known, (0.0, 1.0)).all())


def known_unit(text: str | None) -> str | None:
    """The pint name of a unit written in a file; ``-`` and the like mean dimensionless."""
    return parse_unit(text) if text is not None and text.strip() else None
