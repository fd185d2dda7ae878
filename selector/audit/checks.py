"""What patent CN1868666 prints, and every printed number against ours."""

import math
import textwrap
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from selector.sensors.groups import LambdaStep, lambda_axis, lambda_cut, transitive_closure
from selector.types import Array, Matrix, Vector

#: Lower bearing, intermediate gear, upper bearing, hydraulic unit, gearbox, main motor, and others without a name.
SENSORS = tuple(f"T{k}" for k in range(1, 9))
ENTRY_HALF_UNIT = 0.5e-4  #: Correlations, R² and most coefficients are printed with four decimals.


def _matrix(file: str) -> Array:
    matrix = np.loadtxt(Path(__file__).with_name(file))
    matrix.setflags(write=False)
    return matrix


#: R, the similarity matrix.
SIMILARITY = _matrix("similarity.txt")
#: t(R), the transitive closure.
CLOSURE = _matrix("closure.txt")

LEVEL = 0.995
CUT_ROWS = ("11010001", "11010001", "00101110", "11010001", "00101110", "00101110", "00101110", "11010001")
GROUPS_CLAIMED = 3
REPRESENTATIVES = ("T1", "T3", "T5")


@dataclass(frozen=True)
class PrintedPair:
    """R² and adjusted R² of one combination of sensors, as printed."""

    sensors: tuple[str, ...]
    r2: float
    adjusted_r2: float


PAIRS = (PrintedPair(("T1", "T3"), 0.9989, 0.9988), PrintedPair(("T1", "T3", "T5"), 0.9990, 0.9989))


@dataclass(frozen=True)
class PrintedModel:
    """A printed formula."""

    direction: str  #: {"Z", "Y"}
    name: str  #: In words, for tables
    terms: tuple[tuple[str, ...], ...]  #: The variables that each term multiplies; () is the constant
    printed: tuple[str, ...]  #: The coefficients with all their printed decimals

    @property
    def coefficients(self) -> Array:
        """The coefficients as numbers [µm, µm/K, µm/K²], shape (n_terms,)."""
        return np.array([float(text) for text in self.printed])

    def columns(self, x1: Array, x3: Array, x5: Array) -> Array:
        """One column per term, shape (n_samples, n_terms), from the rises of sensors 1, 3, 5 [K]."""
        rise = {"T1": x1, "T3": x3, "T5": x5}
        columns = [math.prod((rise[name] for name in term), start=np.ones_like(x1)) for term in self.terms]
        return np.stack(columns, axis=1)


_LINEAR = ((), ("T1",), ("T3",))
Z_TWO_SENSORS = PrintedModel("Z", "Z, two sensors", _LINEAR, ("-1.871", "6.0476", "2.6667"))
Y_TWO_SENSORS = PrintedModel("Y", "Y, two sensors", _LINEAR, ("0.5703", "4.7292", "-0.5908"))
Z_THREE_SENSORS = PrintedModel(
    "Z",
    "Z, three sensors",
    ((), ("T1",), ("T3",), ("T1", "T3"), ("T5",)),
    ("1.0168", "11.5237", "4.4909", "-0.5527", "-3.6181"),
)
Y_THREE_SENSORS = PrintedModel(
    "Y",
    "Y, three sensors",
    ((), ("T1",), ("T3",), ("T1", "T3"), ("T3", "T5"), ("T1", "T5"), ("T5",)),
    ("-0.1298", "11.7861", "1.8778", "-0.8547", "1.0439", "-0.1995", "-10.4045"),
)

Verdict = Literal["agrees independently", "agrees by construction", "contradicts", "in tension", "cannot be checked"]


@dataclass(frozen=True)
class AuditLine:
    """One printed statement, checked."""

    section: str  #: Part of the patent, e.g. ``"similarity"``.
    item: str  #: What is checked
    printed: str  #: The printed value, with its printed decimals
    ours: str  #: What we get
    #: Whether the printed value stands. "agrees by construction": on the reconstruction, which was solved for to have
    #: it; "in tension": with another printed number, but a reading exists in which both hold; "cannot be checked": the
    #: patent prints nothing that would decide it
    verdict: Verdict
    why: str  #: How ours was obtained, and what a contradiction means

    def as_dict(self) -> dict[str, str]:
        """JSON form."""
        return dict(vars(self))


def judged(
    section: str,
    item: str,
    printed: str,
    ours: str,
    holds: bool,
    why: str,
    yes: Verdict = "agrees independently",
    no: Verdict = "contradicts",
) -> AuditLine:
    """A line whose verdict is one of two."""
    return AuditLine(section, item, printed, ours, yes if holds else no, why)


_STATEMENTS = tomllib.loads(Path(__file__).with_name("statements.toml").read_text(encoding="utf-8"))


def checked(statement: str, ours: str, holds: bool = True, **values: object) -> AuditLine:
    """The line of a table of ``statements.toml``; `values` are what its braces stand for."""
    said: dict[str, Any] = {key: text.format(**values) for key, text in _STATEMENTS[statement].items()}
    return judged(ours=ours, holds=holds, **said)


def audit_table_text(lines: Iterable[AuditLine], *, width: int = 118) -> str:
    """The lines as a plain table, one block per section, with the count of each verdict at the end."""
    lines = tuple(lines)
    out: list[str] = []
    for section in dict.fromkeys(line.section for line in lines):
        out += ["", section.upper()]
        for line in (line for line in lines if line.section == section):
            out.append(f"  {line.verdict:<22}  {line.item}: printed {line.printed}; ours {line.ours}")
            out += textwrap.wrap(line.why, width, initial_indent=" " * 26, subsequent_indent=" " * 26)
    counts = {verdict: sum(line.verdict == verdict for line in lines) for verdict in Verdict.__args__}  # type: ignore[attr-defined]
    out += ["", ", ".join(f"{count} {verdict}" for verdict, count in counts.items())]
    return "\n".join(out[1:]) + "\n"


def r2_lines(rises: Mapping[str, Vector], responses: Mapping[str, Vector]) -> Iterator[AuditLine]:
    """Printed pairs of R² on the reconstruction; contradictions (b) and (d). Rises [K], responses [µm]."""
    for pair in PAIRS:
        sensors = " & ".join("Δ" + name for name in pair.sensors)
        found = {name: r2_pair([rises[s] for s in pair.sensors], values) for name, values in responses.items()}
        for position, (label, printed) in enumerate((("R²", pair.r2), ("adjusted R²", pair.adjusted_r2))):
            values = {name: both[position] for name, both in found.items()}
            yield judged(
                "R² and adjusted R²",
                f"{label} of {sensors}",
                f"{printed:.4f}",
                ", ".join(f"{value:.4f} ({name})" for name, value in values.items()),
                all(abs(value - printed) <= ENTRY_HALF_UNIT for value in values.values()),
                "linear regression on the reconstruction, built to have it for both displacements because the "
                "patent does not say for which one its table is",
                yes="agrees by construction",
            )
    two, three = PAIRS
    smallest = [fewest_samples(pair, len(pair.sensors)) for pair in PAIRS]
    with_products = [fewest_samples(three, len(m.terms) - 1) for m in (Z_THREE_SENSORS, Y_THREE_SENSORS)]
    yield checked(
        "adding T5",
        f"it rises from {two.adjusted_r2} to {three.adjusted_r2}",
        three.adjusted_r2 < two.adjusted_r2,
        falls_to=three.adjusted_r2,
    )
    yield checked(
        "observations",
        f"m ≥ {max(smallest)}",
        two=smallest[0],
        three=smallest[1],
        z=with_products[0],
        y=with_products[1],
        samples=len(next(iter(responses.values()))),
    )
    yield _m_is_observations(two)


def model_lines(rises: Mapping[str, Vector], z: Vector, y: Vector, z_second: Vector) -> Iterator[AuditLine]:
    """Every printed coefficient against a regression on the reconstruction, and the four models against each other.

    Raises KeyError: `rises` lacks T1, T3 or T5.
    """
    key = (rises["T1"], rises["T3"], rises["T5"])
    for model, values, column in (
        (Z_TWO_SENSORS, z, "Z"),
        (Y_TWO_SENSORS, y, "Y"),
        (Z_THREE_SENSORS, z_second, "Z_embodiment2"),
        (Y_THREE_SENSORS, y, "Y"),
    ):
        found = _coefficients(model.columns(*key), values)
        for term, text, ours in zip(model.terms, model.printed, found, strict=True):
            decimals = len(text.split(".")[1])
            yield judged(
                "models",
                f"{model.name}: {'·'.join(f'Δ{name}' for name in term) or 'constant'}",
                text.replace("-", "−"),
                f"{ours:.{decimals}f}".replace("-", "−"),
                abs(float(text) - ours) <= 0.5 * 10.0**-decimals,
                f"least squares on the reconstruction, response {column}, which was solved for to have it",
                yes="agrees by construction",
            )
    joint = _coefficients(Z_THREE_SENSORS.columns(*key), z)
    gap = (Z_THREE_SENSORS.columns(*key) @ Z_THREE_SENSORS.coefficients) - (
        Z_TWO_SENSORS.columns(*key) @ Z_TWO_SENSORS.coefficients
    )
    yield checked(
        "models of Z",
        ", ".join(f"{value:.4f}".replace("-", "−") for value in joint),
        bool(np.abs(joint - Z_THREE_SENSORS.coefficients).max() <= ENTRY_HALF_UNIT),
        coefficients=", ".join(text.replace("-", "−") for text in Z_THREE_SENSORS.printed),
        gap_um=gap.std(),
    )
    models = (Z_TWO_SENSORS, Y_TWO_SENSORS, Z_THREE_SENSORS, Y_THREE_SENSORS)
    yield checked("at rest", ", ".join(f"{m.name} {m.printed[0].replace('-', '−')} µm" for m in models), False)


def fewest_samples(pair: PrintedPair, n_terms: int) -> int:
    """Smallest m for which some R² and its adjusted R² round to the printed pair, P eq. 2."""
    low, high = 1 - pair.r2 - ENTRY_HALF_UNIT, 1 - pair.r2 + ENTRY_HALF_UNIT
    low_adjusted, high_adjusted = 1 - pair.adjusted_r2 - ENTRY_HALF_UNIT, 1 - pair.adjusted_r2 + ENTRY_HALF_UNIT
    m = n_terms + 2
    while True:
        factor = (m - 1) / (m - n_terms - 1)
        if factor * low < high_adjusted and factor * high > low_adjusted:
            return m
        m += 1


def r2_pair(regressors: list[Vector], response: Vector) -> tuple[float, float]:
    """(R², adjusted R²) of a linear regression with intercept, P eq. 2."""
    columns = np.column_stack([np.ones(len(response)), *regressors])
    residual = response - columns @ _coefficients(columns, response)
    share = float(residual @ residual / ((response - response.mean()) ** 2).sum())
    m, p = len(response), len(regressors)
    return 1 - share, 1 - (m - 1) / (m - p - 1) * share


def _coefficients(columns: Matrix, response: Vector) -> Vector:
    scale = np.linalg.norm(columns, axis=0)
    return np.asarray(np.linalg.lstsq(columns / scale, response, rcond=None)[0] / scale, dtype=np.float64)


def _m_is_observations(pair: PrintedPair) -> AuditLine:
    p = len(pair.sensors)
    with_sensors = 1 - (8 - 1) / (8 - p - 1) * (1 - pair.r2)
    holds = math.isclose(with_sensors, pair.adjusted_r2, abs_tol=ENTRY_HALF_UNIT)
    return checked("m variables", f"{with_sensors:.4f} with m = 8", holds, adjusted_r2=pair.adjusted_r2)


def similarity_lines(rises: Matrix) -> list[AuditLine]:
    """R against the correlations of the reconstructed recording, `rises` of shape (n_samples, 8) [K]; P eq. 1."""
    found = np.asarray(np.corrcoef(rises, rowvar=False), dtype=np.float64)
    lines = [
        judged(
            "similarity matrix R",
            f"r({a + 1},{b + 1}) and r({b + 1},{a + 1})",
            _twice(SIMILARITY, a, b),
            f"{found[a, b]:.4f}",
            _same(SIMILARITY[a, b], found[a, b]) and _same(SIMILARITY[b, a], found[a, b]),
            "correlation of the reconstructed recording, which was solved for to have it",
            yes="agrees by construction",
        )
        for a, b in _pairs()
    ]
    smallest = float(np.linalg.eigvalsh(SIMILARITY)[0])
    return [
        *lines,
        checked("diagonal of R", "1", bool((np.diag(SIMILARITY) == 1).all())),
        checked(
            "symmetry",
            f"{int((SIMILARITY != SIMILARITY.T).sum() // 2)} pairs differ",
            bool((SIMILARITY == SIMILARITY.T).all()),
        ),
        checked("definite", f"smallest eigenvalue {smallest:.1e}", smallest > 0),
    ]


def closure_lines() -> list[AuditLine]:
    """t(R) and its cut at 0.995, P steps 2 and 3."""
    closure = transitive_closure(SIMILARITY)
    lines = [
        judged(
            "closure t(R)",
            f"t({a + 1},{b + 1}) and t({b + 1},{a + 1})",
            _twice(CLOSURE, a, b),
            f"{closure[a, b]:.4f}",
            # max and min copy entries, so nothing but equality will do
            bool(CLOSURE[a, b] == closure[a, b] == CLOSURE[b, a]),
            "max–min transitive closure of the printed R",
        )
        for a, b in _pairs()
    ]
    lines.append(checked("diagonal of t(R)", "1", bool((np.diag(CLOSURE) == np.diag(closure)).all())))
    cut = ["".join("1" if entry >= LEVEL else "0" for entry in row) for row in closure]
    lines += [
        judged("cut at λ = 0.995", f"row {i + 1}", row, cut[i], row == cut[i], "t(i,j) ≥ 0.995")
        for i, row in enumerate(CUT_ROWS)
    ]
    return lines


def group_lines() -> list[AuditLine]:
    """The groups, and every other level at which they could have been cut; contradiction (a)."""
    partition = lambda_cut(SIMILARITY, LEVEL, SENSORS)
    steps = list(lambda_axis(SIMILARITY, SENSORS))
    here = next(step for step in steps if step.low < LEVEL <= step.high)
    threes = [step for step in steps if len(step.partition.groups) == GROUPS_CLAIMED]
    apart = [step for step in steps if _keeps_apart(step)]
    coarsest = apart[-1]
    return [
        checked(
            "number of groups",
            f"{len(partition.groups)} groups: {_listed(partition.groups)}",
            len(partition.groups) == GROUPS_CLAIMED,
            claimed=GROUPS_CLAIMED,
            patterns=len(set(CUT_ROWS)),
            low=here.low,
            high=here.high,
        ),
        checked(
            "three groups",
            "; ".join(f"({s.low:.4f}, {s.high:.4f}]: {_listed(s.partition.groups)}" for s in threes) or "no such λ",
            any(_keeps_apart(step) for step in threes),
        ),
        checked(
            "apart",
            f"λ > {coarsest.low:.4f}; first in ({coarsest.low:.4f}, {coarsest.high:.4f}] with "
            f"{len(coarsest.partition.groups)} groups {_listed(coarsest.partition.groups)}",
            _keeps_apart(here),
            level=LEVEL,
            r35=SIMILARITY[2, 4],
        ),
        checked(
            "combinations",
            f"{2 ** len(REPRESENTATIVES) - 1} instead of {2 ** len(SENSORS) - 1} (of 37 sensors: {2**37 - 1:,})",
        ),
    ]


def representative_lines(rises: Matrix, z: Vector, y: Vector) -> Iterator[AuditLine]:
    """Which sensor of each group of the cut correlates best with each displacement [µm], P step 4."""
    for response, values in (("Z", z), ("Y", y)):
        r = np.array([np.corrcoef(column, values)[0, 1] for column in rises.T])
        best = [max(group, key=lambda k: abs(r[k])) for group in lambda_cut(SIMILARITY, LEVEL).members]
        ours = tuple(SENSORS[k] for k in best)
        yield judged(
            "groups",
            f"representatives by correlation with {response}",
            ", ".join(REPRESENTATIVES),
            ", ".join(f"{SENSORS[k]} (r = {r[k]:.4f})" for k in best),
            ours == REPRESENTATIVES,
            f"best of each of the {len(best)} groups; on the reconstruction r = "
            + ", ".join(f"{r[k]:.4f} ({name})" for k, name in enumerate(SENSORS))
            + ". Two groups give two representatives, never three"
            + (
                ". Sensor 4, near both bearings, follows Z = 6.05 X1 + 2.67 X2 more closely than sensor 1 unless "
                "sensor 1 spreads at least 1.87 times as much as sensor 3 (R and the formula; residual neglected)"
                if response == "Z"
                else ""
            ),
        )


def _pairs() -> list[tuple[int, int]]:
    return [(a, b) for a in range(len(SENSORS)) for b in range(a + 1, len(SENSORS))]


def _twice(matrix: Matrix, a: int, b: int) -> str:
    first, second = f"{matrix[a, b]:.4f}", f"{matrix[b, a]:.4f}"
    return first if first == second else f"{first} and {second}"


def _same(printed: float, ours: float) -> bool:
    return abs(printed - ours) <= ENTRY_HALF_UNIT


def _keeps_apart(step: LambdaStep) -> bool:
    group = {name: i for i, names in enumerate(step.partition.groups) for name in names}
    return len({group[name] for name in REPRESENTATIVES}) == len(REPRESENTATIVES)


def _listed(groups: tuple[tuple[str, ...], ...]) -> str:
    return " ".join("{" + ",".join(name[1:] for name in group) + "}" for group in groups)


BEARING_RISE_K = (6.0, 10.0)

CLAIMED_PERCENT = (80.0, 90.0)


def effect_lines(rises: Mapping[str, Vector]) -> Iterator[AuditLine]:
    """The claim "80–90 % less" against the printed micrometres, and the other printed effects; rises [K]."""
    told = partial(judged, "effects")
    low, high = CLAIMED_PERCENT
    for item, before, after in (
        ("Z, largest, compensated", 100.0, (10.0,)),
        ("Z, mean of the warm phase, compensated", 80.0, (6.0, 8.0)),
        ("Y, mean, compensated", 41.0, (8.0,)),
        ("Z, largest, oil cooler alone", 100.0, (70.0,)),
        ("Z, mean of the warm phase, oil cooler alone", 80.0, (65.0,)),
        ("Y, mean, oil cooler alone", 41.0, (19.0,)),
        ("Y, largest, oil cooler alone", 56.0, (25.0,)),
    ):
        less = sorted(100 * (1 - value / before) for value in after)
        ours = "–".join(f"{value:.1f}" for value in less) + " % less"
        micrometres = f"{before:g} → {'–'.join(f'{value:g}' for value in after)} µm"
        if "oil" in item:
            worse = less[-1] < low
            yield told(item, micrometres, ours, worse, "less than compensation reaches, as the patent says")
            continue
        holds = low <= less[0] and less[-1] <= high + 1e-9
        yield told(
            item,
            f"{micrometres}, {low:g}–{high:g} % less",
            ours,
            holds,
            "within the claimed range" if holds else "the printed micrometres give more than the claim",
            no="in tension",
        )
    residual = 50.0 * (1 - PAIRS[0].r2) ** 0.5
    yield from _reach_lines()
    yield checked("largest Y", f"at most {_reach(Y_TWO_SENSORS):.1f} µm for the mean of both gauges")
    yield checked("error after", f"R² 0.9989 leaves at most {residual:.1f} µm rms", residual >= 6.0)
    yield checked("mean Y", "at most 40.5 µm for the mean of gauges that reach 25 and 56 µm", False)
    yield checked(
        "protocol", f"bearings of the reconstruction rise {rises['T1'].max():.1f} and {rises['T3'].max():.1f} K"
    )


def symbol_lines(rises: Mapping[str, Vector], z: Vector) -> list[AuditLine]:
    """Symbols that are used for other things than they are defined as, contradiction (c); rises [K], z [µm]."""
    columns = np.column_stack([np.ones(len(z)), rises["T1"], rises["T3"]])
    fitted = columns @ np.linalg.lstsq(columns, z, rcond=None)[0]
    sst, ssr, sse = (float(v @ v) for v in (z - z.mean(), fitted - z.mean(), z - fitted))
    penalty = (len(z) - 1) / (len(z) - columns.shape[1])
    about = columns[:, 1:] - columns[:, 1:].mean(axis=0)
    solved = np.linalg.solve(about.T @ about, about.T @ z)
    gradient = float(np.abs(columns.T @ (z - fitted)).max())
    two_ways = 1 - penalty * sse / sst, 1 - penalty * (1 - ssr / sst)
    return [
        checked("sums", f"{sse:.4f} = {sst:.4f} − {ssr:.4f}", bool(np.isclose(sse, sst - ssr, rtol=1e-8))),
        checked("eq. 2", f"{two_ways[0]:.10f} and {two_ways[1]:.10f}", bool(np.isclose(*two_ways, rtol=0, atol=1e-10))),
        checked(
            "eq. 7",
            f"∂Q/∂b_j = −2 Σ over t of (y_t − b0 − …)·x_tj, {'0' if gradient < 1e-6 else f'{gradient:.0e}'} at the fit",
            False,
        ),
        checked("eq. 10", f"l_ij = Σ over t of (x_ti − x̄_i)(x_tj − x̄_j); b = {solved[0]:.4f}, {solved[1]:.4f}", False),
    ]


def _reach_lines() -> Iterator[AuditLine]:
    told = partial(judged, "effects")
    for item, printed_um, model in (
        ("Z, largest", 100.0, Z_TWO_SENSORS),
        ("Z, mean of the warm phase", 80.0, Z_TWO_SENSORS),
        ("Y, mean of the warm phase", 41.0, Y_TWO_SENSORS),
    ):
        reach = _reach(model)
        yield told(
            f"{item}, with bearings that rise 6–10 K",
            f"{printed_um:g} µm",
            f"at most {reach:.1f} µm",
            reach >= printed_um,
            f"the printed two-sensor model of {model.direction} at its best corner of 6–10 K"
            + ("" if reach >= printed_um else "; that run was warmer, or the model does not hold for it"),
            no="in tension",
        )


def _reach(model: PrintedModel) -> float:
    """Largest displacement [µm] that a two-sensor model gives while both bearings rise 6–10 K."""
    corners = np.array([[1.0, a, b] for a in BEARING_RISE_K for b in BEARING_RISE_K])
    return float((corners @ model.coefficients).max())
