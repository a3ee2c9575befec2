# SPDX-License-Identifier: Apache-2.0
"""Scene files drawn at random from their JSON schema: values that fit it, near its bounds, and some that no scene can hold."""

import math

# What a file, or a caller from Python, may write in the place of anything.
ODD = (
    None, True, "", "a", "drag", [], [[1]], [["a"]], {}, {"a": 1}, [{}], 0, -1, 2**63, 2**70, -(2**63), 1e308, 5e-324,
    math.nan, math.inf, [1.0, [2.0]], [None], [1e308] * 3, "1.0", [[[]]], {"type": {"a": 1}}, 10**400,
)  # fmt: skip
NUMBERS = (0.0, 1.0, -1.0, 0.5, 2.0, 10.0, 1e-3, 1e3, 1e-300, 1e300)
SCALES = (0.01, 0.1, 1.0, 10.0, 100.0)


def drawn(schema, rng, oddness):
    """A value of a schema; oddness: the part of the values that are drawn from ODD instead."""
    if rng.random() < oddness:
        return ODD[rng.integers(len(ODD))]
    if "const" in schema:
        return schema["const"]
    if "enum" in schema:
        return schema["enum"][rng.integers(len(schema["enum"]))]
    if "anyOf" in schema:
        return drawn(schema["anyOf"][rng.integers(len(schema["anyOf"]))], rng, oddness)
    kinds = schema.get("type", "number")
    kind = kinds if isinstance(kinds, str) else kinds[rng.integers(len(kinds))]
    return {"object": _table, "array": _list}.get(kind, _leaf)(schema | {"type": kind}, rng, oddness)


def _table(schema, rng, oddness):
    properties = schema.get("properties", {})
    if schema.get("maxProperties") == 1:
        names = [list(properties)[rng.integers(len(properties))]]
    else:
        share = rng.uniform(0.0, 0.7)
        wanted = schema.get("required", ())
        names = [name for name in properties if name in wanted or rng.random() < share]
    table = {name: drawn(properties[name], rng, oddness) for name in names}
    if isinstance(schema.get("additionalProperties"), dict):
        known = ("vehicle.mass", "start.position", "vehicle.inertia[0]", "drag.linear", "nothing", "start.attitude")
        for name in rng.choice(known, rng.integers(0, 3), replace=False):
            table[str(name)] = drawn(schema["additionalProperties"], rng, oddness)
    return table


def _list(schema, rng, oddness):
    low = schema.get("minItems", 0)
    count = int(rng.integers(low, min(schema.get("maxItems", low + 3), low + 3) + 1))
    return [drawn(schema.get("items", {}), rng, oddness) for _ in range(count)]


def _leaf(schema, rng, oddness):
    kind = schema["type"]
    if kind == "string":
        return str(rng.choice(["linear", "steps", "psi_s", "rk4", "north", "x", "depth", "drag", "mean depth", "tanh"]))
    if kind == "boolean":
        return bool(rng.random() < 0.5)
    if kind == "integer":
        return int(rng.integers(0, 6))
    low, above, high = (schema.get(name) for name in ("minimum", "exclusiveMinimum", "maximum"))
    value = float(rng.choice(NUMBERS)) if rng.random() < 0.3 else float(rng.normal() * rng.choice(SCALES))
    if low is not None or above is not None:
        value = abs(value) + (low or above or 0.0)
    return value if high is None else min(value, high)


def drawn_scene(schema, rng):
    """The tables of a scene file, of which about one in three fits the schema in all."""
    oddness = float(rng.choice([0.0, 0.01, 0.05, 0.2]))
    content = drawn(schema, rng, 0.3 * oddness)
    if isinstance(content, dict) and rng.random() < 0.7:
        body = {"mass": 20.0, "inertia": [1.5, 4.0, 4.5], "added_mass": [5.0, 22.0, 25.0]}
        given = content.get("vehicle", {})
        content["vehicle"] = rng.choice(
            [body, {"name": "remus_100"}, body | (given if isinstance(given, dict) else {})]
        )
    return content
