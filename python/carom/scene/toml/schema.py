"""The published JSON Schema of the format: editors complete and check scenario files with it."""

from __future__ import annotations

from typing import Any

from carom.scene.tables.joints import KEYS, TYPES
from carom.scene.tables.model import FORMAT, Scenario
from carom.units import SCHEMA_PATTERN


def json_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a scenario file; the content of `carom schema`."""
    schema: dict[str, Any] = _without_null(Scenario.model_json_schema(mode="validation"))
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = f"Carom scenario, format {FORMAT}"
    # `until` may be left to the caller of carom.simulate, not so in a file that is run as it stands
    schema["required"] = [*schema["required"], "run"]
    schema["$defs"]["Run"]["required"] = ["until"]
    for name, keys in (
        ("Sphere", ("mass", "density")),
        ("Lattice", ("mass", "density")),
        ("Rack", ("mass", "density")),
        ("Clump", ("mass", "density")),
    ):
        schema["$defs"][name]["oneOf"] = [{"required": [key]} for key in keys]
    schema["$defs"]["Packing"]["oneOf"] = [{"required": ["count"]}, {"required": ["fraction"]}]
    for name, pair in (
        ("Load", ("force", "torque")),
        ("Spring", ("stiffness", "damping")),
        ("Drag", ("translation", "rotation")),
    ):
        schema["$defs"][name]["anyOf"] = [{"required": [key]} for key in pair]
    schema["$defs"]["Joint"]["allOf"] = [_joint(kind) for kind in TYPES]
    schema["$defs"]["Rack"]["allOf"] = [{"oneOf": [{"required": ["balls"]}, {"required": ["rows"]}]}]
    schema["$defs"] = {name: _with_formulas(table) for name, table in schema["$defs"].items()}
    schema["$defs"] |= {"Formula": FORMULA, "Case": _case()}
    schema["properties"] |= {
        "parameters": {
            "description": "names for numbers; an expression may use those above it",
            "type": "object",
            "propertyNames": {"pattern": "^[A-Za-z_][A-Za-z0-9_]*$"},
            "additionalProperties": NUMBER,
        },
        "case": {
            "description": "variants of the file",
            "type": "array",
            "items": {"$ref": "#/$defs/Case"},
        },
    }
    return schema


FORMULA = {
    "description": "an expression of the parameters, which gives a number in SI units",
    "type": "string",
    "pattern": r"^\s*=",
}
QUANTITY = {"type": "string", "pattern": SCHEMA_PATTERN}
NUMBER = {"anyOf": [{"type": "number"}, QUANTITY, {"$ref": "#/$defs/Formula"}]}


def _case() -> dict[str, Any]:
    return {
        "description": "a variant: other values of parameters",
        "type": "object",
        "properties": {"name": {"type": "string", "minLength": 1}},
        "required": ["name"],
        "additionalProperties": NUMBER,
    }


def _with_formulas(node: Any) -> Any:
    """An expression may stand wherever a number is expected."""
    if isinstance(node, list):
        return [_with_formulas(item) for item in node]
    if not isinstance(node, dict):
        return node
    if node.get("type") not in ("number", "integer"):
        return {key: _with_formulas(value) for key, value in node.items()}
    # what is said of the key stays outside, where editors look for it
    about = {key: node[key] for key in ("title", "description", "default", "examples", "unit") if key in node}
    number = {key: value for key, value in node.items() if key not in about}
    return {**about, "anyOf": [number, {"$ref": "#/$defs/Formula"}]}


def _joint(kind: str) -> dict[str, Any]:
    """Which keys a joint of this type has."""
    keys = TYPES[kind]
    admitted = {*keys.needs, *keys.may, *(key for group in keys.either for key in group)}
    then: dict[str, Any] = {
        "required": list(keys.needs),
        "properties": {key: False for key in KEYS if key not in admitted},
    }
    if keys.either:
        then["oneOf"] = [{"required": list(group)} for group in keys.either]
    return {"if": {"properties": {"type": {"const": kind}}}, "then": then}


def _without_null(node: Any) -> Any:
    """TOML has no null: a key without a value is left out. pydantic writes optional keys as "or null"."""
    if isinstance(node, list):
        return [_without_null(item) for item in node]
    if not isinstance(node, dict):
        return node
    node = {
        key: _without_null(value) for key, value in node.items() if not (key == "default" and value is None)
    }
    options = node.get("anyOf")
    if isinstance(options, list) and {"type": "null"} in options:
        rest = [option for option in options if option != {"type": "null"}]
        del node["anyOf"]
        node = {**rest[0], **node} if len(rest) == 1 else {**node, "anyOf": rest}
    return node
