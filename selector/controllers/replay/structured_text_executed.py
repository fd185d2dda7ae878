"""Generated Structured Text or SCL, executed row by row; what a control or a drive makes of a straight line.

A parser of IEC 61131-3 reads the text, and its syntax tree becomes a Python class once; nothing of the program that the
text was printed from is used.
"""

import importlib
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Literal, NoReturn

import numpy as np

from selector.controllers.evaluator import axes_of, first_finite
from selector.controllers.model_file import ModelFile
from selector.controllers.replay.parts import Answers, Rows, called, places_m
from selector.controllers.writers.beckhoff import ADS_TABLE, list_values, temp_comp_mm
from selector.controllers.writers.rexroth import FILE, drive_parameters, rexroth_export
from selector.controllers.writers.sinumerik import SETTING_DATA
from selector.controllers.writers.structured_text import st_text
from selector.errors import NotExecutableError
from selector.types import Array

Kind = Literal["real", "code", "flag"]
_KINDS: dict[str, Kind] = {"LREAL": "real", "REAL": "real", "INT": "code", "BOOL": "flag"}
_COMPARISONS = {"<": "<", "<=": "<=", ">": ">", ">=": ">=", "=": "==", "<>": "!="}
_LARGEST_INT = 32767
_PASSED_OVER = ("comment", "empty_statement")


def st_answers(model: ModelFile, rows: Rows, text: str | None = None) -> Answers:
    """What the function block of a text gives; default: the exported Structured Text.

    LREAL is calculated in binary64, REAL in binary32: every reading, literal and operation is rounded to it.
    """
    block = executable(st_text(model) if text is None else text)
    with np.errstate(all="ignore"):
        return called(block, block.call, model, rows, "v_", block.number)


def text_of_tcpou(text: str) -> str:
    """Declaration and implementation of a TwinCAT file as one function block."""
    parts = re.findall(r"<(?:Declaration|ST)><!\[CDATA\[(.*?)\]\]></", text, re.S)
    return "".join([*parts, "END_FUNCTION_BLOCK\n"])


_OPENINGS = {"inputVars": "VAR_INPUT", "outputVars": "VAR_OUTPUT", "localVars": "VAR", "tempVars": "VAR_TEMP"}


def text_of_plcopen(text: str) -> str:
    """Interface and body of the one block in a PLCopen XML file, as Structured Text."""
    # our own text, in which names of the model stand escaped
    (pou,) = ElementTree.fromstring(text).iterfind("{*}types/{*}pous/{*}pou")  # noqa: S314
    lines = [f"FUNCTION_BLOCK {pou.get('name')}"]
    for section in pou.iterfind("{*}interface/*"):
        is_retained = section.get("retain") == "true"
        lines.append(_OPENINGS[section.tag.rpartition("}")[2]] + (" RETAIN" if is_retained else ""))
        for one in section.iterfind("{*}variable"):
            (type_,) = one.iterfind("{*}type/*")
            initial = "".join(f" := {of.get('value')}" for of in one.iterfind("{*}initialValue/{*}simpleValue"))
            lines.append(f"{one.get('name')} : {type_.tag.rpartition('}')[2]}{initial};")
        lines.append("END_VAR")
    (body,) = pou.iterfind("{*}body/{*}ST")
    return "\n".join([*lines, *body.itertext(), "END_FUNCTION_BLOCK\n"])


def parser_name() -> str:
    """What reads the text, with its version."""
    try:
        return f"tree-sitter-iec61131-3-st {version('tree-sitter-iec61131-3-st')}"
    except PackageNotFoundError:
        return "no parser of Structured Text"


def executable(text: str) -> Any:
    """An instance of the function block: ``v_<name>`` for every variable, ``call()``, and its real type ``number``."""
    # what is not ASCII becomes a question mark, which only a comment may have
    tree = _parser().parse(_standard(text).encode("ascii", "replace"))
    node = tree.root_node
    while node.has_error:
        if node.type == "ERROR" or node.is_missing:
            _refuse(node, "what is no Structured Text")
        node = next(child for child in node.children if child.has_error)
    blocks = [node for node in tree.root_node.children if node.type != "comment"]
    if len(blocks) != 1 or blocks[0].type != "function_block_declaration":
        _refuse(tree.root_node, "more or less than one function block")
    return _Translated(blocks[0]).instance()


def _standard(text: str) -> str:
    """The text as the grammar knows it: in SCL a block name has quotes and BEGIN a line, in TwinCAT RETAIN a rival."""
    for own, standard in (
        (r'^FUNCTION_BLOCK "(\w+)"$', r"FUNCTION_BLOCK \1"),
        (r"^BEGIN$", ""),
        (r"^VAR PERSISTENT$", "VAR RETAIN"),
    ):
        text = re.sub(own, standard, text, count=1, flags=re.M)
    return text


def _parser() -> Any:
    try:
        tree_sitter = importlib.import_module("tree_sitter")
        grammar = importlib.import_module("tree_sitter_iec61131_3_st")
    except ImportError as error:
        raise NotExecutableError(
            f"the package {error.name} is not installed",
            expected="tree-sitter and tree-sitter-iec61131-3-st, which read the exported Structured Text",
            where="--replay",
            advice='in the folder of selector: pip install ".[controls]"; or export without --replay',
        ) from error
    return tree_sitter.Parser(tree_sitter.Language(grammar.language()))


def _refuse(node: Any, what: str) -> NoReturn:
    raise NotExecutableError(
        f"{what}: {_text(node)[:60]!r}",
        expected="REAL or LREAL, INT and BOOL; assignments and IF, as in an exported program",
        where=f"Structured Text, line {node.start_point[0] + 1}",
        advice="replay the file as it was exported",
    )


def _text(node: Any) -> str:
    return str(node.text.decode("ascii"))


class _Translated:
    """A function block as the source of a Python class.

    Temporaries become local variables of its method, so that one which is read before it is set is found out.
    """

    def __init__(self, block: Any) -> None:
        self._kinds: dict[str, Kind] = {}
        self._temporary: set[str] = set()
        self._constants: dict[str, Any] = {}
        self._real_types: set[str] = set()
        self._block = block
        self._initial: list[str] = []
        statements = []
        for node in block.named_children[1:]:
            if node.type in ("var_input", "var_output", "var_block", "var_temp"):
                for one in node.named_children:
                    if one.type == "variable_declaration":
                        self._declare(one, is_temporary=node.type == "var_temp")
                    elif one.type not in ("comment", "var_qualifier_list"):
                        _refuse(one, f"a {one.type}")
            else:
                statements.append(node)
        if len(self._real_types) != 1:
            _refuse(block, f"{len(self._real_types)} types of real numbers in one block")
        self._is_single = self._real_types == {"REAL"}
        self._number: Any = np.float32 if self._is_single else float
        self._lines = [line for node in statements for line in self._statement(node, 2)]

    def instance(self) -> Any:
        source = [
            "class Block:",
            "    number = number",
            "    def __init__(self):",
            *self._initial,
            "        pass",
            "    def call(self):",
            *self._lines,
            "        pass",
        ]
        names = {name: self._number(value) for name, value in self._constants.items()} | {"number": self._number}
        # nothing of the text gets here but names of letters, digits and underscores, and literals as numbers
        exec(compile("\n".join(source), "structured text", "exec"), names)  # noqa: S102
        return names["Block"]()

    def _declare(self, node: Any, *, is_temporary: bool) -> None:
        name, type_, *initial = [child for child in node.named_children if child.type != "comment"]
        kind = _KINDS.get(_text(type_))
        if kind is None or name.type != "identifier" or len(initial) > 1:
            _refuse(node, "a declaration")
        own = self._own(name)
        if own in self._kinds:
            _refuse(node, "a second declaration")
        self._kinds[own] = kind
        if kind == "real":
            self._real_types.add(_text(type_))
        if is_temporary:
            self._temporary.add(own)
            if initial:
                _refuse(node, "a temporary variable with an initial value")
            return
        value = (
            self._of_kind(initial[0], kind) if initial else {"real": "number(0.0)", "code": "0", "flag": "False"}[kind]
        )
        self._initial.append(f"        self.{own} = {value}")

    @staticmethod
    def _own(identifier: Any) -> str:
        name = _text(identifier).lower()
        if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", name):
            _refuse(identifier, "a name")
        return f"v_{name}"

    def _statement(self, node: Any, depth: int) -> Iterator[str]:
        before = "    " * depth
        if node.type in _PASSED_OVER:
            return
        if node.type == "assignment_statement":
            to, value = _operands(node)
            name, kind = self._variable(to)
            text = self._of_kind(value, kind)
            yield f"{before}{name} = " + (f"number({text})" if kind == "real" and self._is_single else text)
        elif node.type == "if_statement":
            condition, *rest = _operands(node)
            yield f"{before}if {self._of_kind(condition, 'flag')}:"
            yield f"{before}    pass"
            for one in rest:
                if one.type != "else_clause":
                    yield from self._statement(one, depth + 1)
            for one in rest:
                if one.type == "else_clause":
                    yield f"{before}else:"
                    yield f"{before}    pass"
                    for inner in one.named_children:
                        yield from self._statement(inner, depth + 1)
        else:
            _refuse(node, f"a {node.type}")

    def _variable(self, node: Any) -> tuple[str, Kind]:
        if node.type != "identifier":
            _refuse(node, f"a {node.type}")
        name = self._own(node)
        if name not in self._kinds:
            _refuse(node, "a variable that is not declared")
        return name if name in self._temporary else f"self.{name}", self._kinds[name]

    def _of_kind(self, node: Any, kind: Kind) -> str:
        text, found = self._expression(node)
        if found != kind:
            _refuse(node, f"a {found} where a {kind} belongs")
        return text

    def _expression(self, node: Any) -> tuple[str, Kind]:
        if node.type == "identifier":
            return self._variable(node)
        if node.type == "real_literal":
            name = f"c_{len(self._constants)}"
            self._constants[name] = float(_text(node))
            return name, "real"
        if node.type == "integer_literal":
            value = int(_text(node))
            if abs(value) > _LARGEST_INT:
                _refuse(node, "an INT of more than 16 bits")
            return f"({value})", "code"
        if node.type == "boolean_literal":
            return str(_text(node).upper() == "TRUE"), "flag"
        if node.type == "parenthesized_expression":
            (inner,) = _operands(node)
            text, kind = self._expression(inner)
            return f"({text})", kind
        if node.type == "unary_expression":
            return self._signed(node)
        if node.type == "binary_expression":
            return self._combined(node)
        _refuse(node, f"a {node.type}")

    def _signed(self, node: Any) -> tuple[str, Kind]:
        (inner,) = _operands(node)
        sign = _text(node.children[0]).upper()
        if sign == "NOT":
            return f"(not {self._of_kind(inner, 'flag')})", "flag"
        if sign == "-":
            return f"(-{self._of_kind(inner, 'real')})", "real"
        _refuse(node, f"the sign {sign}")

    def _combined(self, node: Any) -> tuple[str, Kind]:
        left, right = _operands(node)
        sign = _sign(node)
        if sign in ("+", "-", "*", "/"):
            return f"({self._of_kind(left, 'real')} {sign} {self._of_kind(right, 'real')})", "real"
        if sign in ("AND", "OR"):
            return self._chain(node, sign), "flag"
        if sign in _COMPARISONS:
            first, kind = self._expression(left)
            return f"({first} {_COMPARISONS[sign]} {self._of_kind(right, kind)})", "flag"
        _refuse(node, f"the operation {sign}")

    def _chain(self, node: Any, sign: str) -> str:
        """All conditions of a AND b AND c …: of hundreds of sensors, too deep a tree to descend."""
        parts = []
        while node.type == "binary_expression" and _sign(node) == sign:
            node, right = _operands(node)
            parts.append(self._of_kind(right, "flag"))
        parts.append(self._of_kind(node, "flag"))
        return "(" + f" {sign.lower()} ".join(reversed(parts)) + ")"


def _sign(node: Any) -> str:
    (sign,) = [_text(child).upper() for child in node.children if not child.is_named]
    return sign


def _operands(node: Any) -> list[Any]:
    return [child for child in node.named_children if child.type != "comment"]


_UM_PER_MM, _MM_PER_M = 1000.0, 1000.0
_OFFSET = re.compile(r"^  offset_0_(\d+) := LREAL_TO_DINT\((\d+\.\d+) \* fb\.k0_\1\);", re.MULTILINE)
_COEFFICIENT = re.compile(r"^  coefficient_(\d+) := (?:(0\.0)|fb\.slope_\1);", re.MULTILINE)


def setting_data_answers(model: ModelFile, rows: Rows, files: Mapping[str, str], main: Answers) -> Answers:
    """What the NC adds with the setting data that ``thermal_to_sd.scl`` makes, in REAL, of the answers of the model."""
    block = executable(files[SETTING_DATA])
    line, places = np.zeros_like(main.correction_um), places_m(model, rows)
    axes = axes_of(model)
    for k in range(len(rows)):
        for i in range(len(model.outputs)):
            for name, of in (("correction", main.correction_um), ("k0", main.k0_um), ("slope", main.slope_um_per_m)):
                setattr(block, f"v_{name}_{i + 1}", block.number(of[k, i]))
        block.call()
        for i, output in enumerate(model.outputs):
            k0, slope, zero = (float(getattr(block, f"v_sd{number}_{i + 1}")) for number in (43900, 43910, 43920))
            place_mm = 0.0
            if output.position is not None:
                place_mm = _MM_PER_M * places[k, axes.index(output.position.axis)]
            line[k, i] = _UM_PER_MM * (k0 + slope * (place_mm - zero))
    return Answers(line, main.k0_um, main.slope_um_per_m, main.mode, main.sensors, main.axes)


def temp_comp_answers(model: ModelFile, rows: Rows, files: Mapping[str, str], main: Answers) -> Answers:
    """What the CNC adds with the axis lists and what ``temp_comp_ads.txt`` writes of the answers of the block."""
    tenths = {int(k): float(factor) for k, factor in _OFFSET.findall(files[ADS_TABLE])}
    is_flat = {int(k): bool(zero) for k, zero in _COEFFICIENT.findall(files[ADS_TABLE])}
    expected = set(range(1, len(model.outputs) + 1))
    if set(tenths) != expected or set(is_flat) != expected:
        raise NotExecutableError(
            f"statements for {len(tenths)} offsets and {len(is_flat)} coefficients",
            expected=f"one of each for {len(expected)} outputs",
            where=ADS_TABLE,
            advice="replay the file as it was exported",
        )
    line, places, axes = np.zeros_like(main.correction_um), places_m(model, rows), axes_of(model)
    for i, output in enumerate(model.outputs):
        position_0 = list_values(files[f"temp_comp_{i + 1}.lis"])["_position_0"]
        offsets = np.rint(tenths[i + 1] * main.k0_um[:, i]).astype(np.int64)
        slopes = np.zeros(len(rows)) if is_flat[i + 1] else main.slope_um_per_m[:, i]
        at_mm: Array = np.zeros(len(rows))
        if output.position is not None:
            at_mm = _MM_PER_M * places[:, axes.index(output.position.axis)]
        for k, (place, offset, slope) in enumerate(zip(at_mm.tolist(), offsets.tolist(), slopes.tolist(), strict=True)):
            added = temp_comp_mm(place, position_0=position_0, offset_0=offset, coefficient_um_per_m=slope)
            line[k, i] = _UM_PER_MM * added
    return Answers(line, main.k0_um, main.slope_um_per_m, main.mode, main.sensors, main.axes)


#: Half of the last digit: of the reference temperature [K], of x0 [m], of a factor, as a share of it.
HALF_K, HALF_M, HALF_DIGIT = 0.5e-4, 0.5e-7, 5e-6
_NUMBER = r"([+-]? ?[0-9.]+(?:e[+-]?[0-9]+)?)"
_BLOCK = re.compile(
    rf"P-0-0402 .*?{_NUMBER} (?:degC|K)$\s+P-0-0406 .*?factor +{_NUMBER} um/.*?$\s+"
    rf"P-0-0407 .*?factor +{_NUMBER} um/K.*?$"
    rf"(?:\s+x0 .*?zero +{_NUMBER} mm)?",
    re.MULTILINE,
)


def drive_answers(model: ModelFile, rows: Rows, files: Mapping[str, str] | None = None) -> Answers:
    """What a drive with these parameters adds; it has no guard, so that mode and sensor codes are 0.

    The numbers are read from the exported text. A reading that is missing is passed on as the reference temperature.
    """
    found = Answers.empty(len(rows), len(model.outputs), len(model.inputs), len(axes_of(model)))
    blocks = _BLOCK.findall((files or rexroth_export(model).files)[FILE])
    names, axes = [item.name for item in model.inputs], axes_of(model)
    for k, (output, block) in enumerate(zip(model.outputs, blocks, strict=True)):
        reference, steep, own, zero_mm = (float(text.replace(" ", "") or "0") for text in block)
        at = names.index(drive_parameters(model, output).source)
        readings: Array = rows.readings[:, at]
        if model.inputs[at].reference == "rise":
            reference += first_finite(readings)
        warmer = np.where(np.isfinite(readings), readings - reference, 0.0)
        found.k0_um[:, k] = found.correction_um[:, k] = -own * warmer
        if output.position is not None:
            found.slope_um_per_m[:, k] = -steep * warmer
            away_m = places_m(model, rows)[:, axes.index(output.position.axis)] - zero_mm / 1000.0
            found.correction_um[:, k] += found.slope_um_per_m[:, k] * away_m
    return found


def printed_parameters_um(model: ModelFile, rows: Rows) -> dict[str, float]:
    """Per output, what the printed digits of the parameters, and what they cannot say of the model, cost at most [µm].

    The reference temperature is printed in steps of 0.0001 K, factors in six digits, x0 in steps of 0.0001 mm.
    """
    found = {}
    for output in model.outputs:
        of, part = drive_parameters(model, output), output.position
        at = [item.name for item in model.inputs].index(of.source)
        readings: Array = rows.readings[:, at]
        start = first_finite(readings) if model.inputs[at].reference == "rise" else 0.0
        warmer = np.abs(readings - start - of.shift_k)
        warmest = float(np.max(warmer[np.isfinite(warmer)], initial=0.0)) + HALF_K
        reach, within, steep = 0.0, 0.0, abs(of.um_per_m_k)
        if part is not None:
            places = places_m(model, rows)[:, axes_of(model).index(part.axis)]
            reach = float(np.max(np.abs(places - of.zero_m), initial=0.0)) + HALF_M
            within = max(abs(part.valid_min_m - of.zero_m), abs(part.valid_max_m - of.zero_m))
        size = abs(of.um_per_k) + steep * reach
        loss = of.loss_um * max(1.0, reach / within if within > 0.0 else 1.0)
        # and float64 itself
        found[output.name] = loss + size * (HALF_K + HALF_DIGIT * warmest) + steep * HALF_M * warmest + 1e-9
    return found
