"""The JSON schemas that are shipped in the package, field by field, as pages."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from selector.physics.simulation_kind import simulation_kinds


def schema_pages(root: Path) -> dict[str, str]:
    """Name → Markdown of a page, one for every `selector/**/schema/*.json`."""
    return {
        path.stem.removeprefix("selector.").replace(".", "-"): _page(
            schema,
            f"From `{path.relative_to(root).as_posix()}`, which is shipped in the package.",
            schema.get("$id", schema.get("title", path.name)),
        )
        for path in sorted((root / "selector").rglob("schema/*.json"))
        for schema in [json.loads(path.read_text(encoding="utf-8"))]
    }


def model_pages() -> dict[str, str]:
    """Name → Markdown of a page, one for every kind of model file that `selector simulate` reads."""
    return {
        f"model-{word}": _page(
            schema.model_json_schema(), f"Model files that `selector simulate {kind.name}` reads.", f'kind = "{word}"'
        )
        for kind in simulation_kinds().values()
        for word, schema in kind.family().kinds.items()
    }


def _page(schema: dict[str, Any], said_of: str, heading: str) -> str:
    title = schema.get("title", heading)
    lines = [f"# Fields of `{heading}`\n", f"{said_of}\n"]
    for name, part in [(title, schema), *schema.get("$defs", {}).items()]:
        lines += [f"## {name}\n", part.get("description", "") + "\n"]
        if not part.get("properties"):
            continue
        lines += ["| field | type | default | meaning |", "|---|---|---|---|"]
        for field, said in part["properties"].items():
            default = "required" if field in part.get("required", ()) else _default(said.get("default"))
            lines.append(f"| `{field}` | {_cell(_type(said))} | {_cell(default)} | {_cell(_meaning(said))} |")
        lines.append("")
    return "\n".join(lines)


def _type(said: dict[str, Any]) -> str:
    if "$ref" in said:
        name = said["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.lower()})"
    if "const" in said:
        return f"`{json.dumps(said['const'])}`"
    if "enum" in said:
        return ", ".join(f"`{json.dumps(value)}`" for value in said["enum"])
    if "anyOf" in said or "oneOf" in said:
        return " or ".join(_type(one) for one in said.get("anyOf") or said["oneOf"])
    kind = str(said.get("type", "any")) + (f" [{said['unit']}]" if "unit" in said else "")
    if kind == "array" and isinstance(said.get("items"), dict):
        return f"list of {_type(said['items'])}"
    if kind == "object":
        inner = [*said.get("patternProperties", {}).values(), said.get("additionalProperties")]
        return next((f"names to {_type(one)}" for one in inner if isinstance(one, dict)), "object")
    return kind


def _default(value: Any) -> str:
    return "all of its defaults" if isinstance(value, dict) and value else f"`{json.dumps(value)}`"


def _meaning(said: dict[str, Any]) -> str:
    words = {
        "exclusiveMinimum": "above {:g}",
        "minimum": "at least {:g}",
        "exclusiveMaximum": "below {:g}",
        "maximum": "at most {:g}",
        "minItems": "at least {:g} of them",
        "maxItems": "at most {:g} of them",
    }
    bounds = [text.format(said[key]) for key, text in words.items() if key in said]
    return "; ".join([part for part in (said.get("description", ""), ", ".join(bounds)) if part])


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")
