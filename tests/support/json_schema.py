# SPDX-License-Identifier: Apache-2.0
"""Part of JSON schema that the schema of scene files uses."""

KINDS = {"object": dict, "array": list, "string": str, "boolean": bool, "number": (int, float), "integer": int}

KNOWN = {"type", "properties", "required", "additionalProperties", "items", "anyOf", "enum", "const", "minItems", "maxItems",
         "minimum", "maximum", "exclusiveMinimum", "minProperties", "maxProperties", "description", "title",
         "$schema"}  # fmt: skip


def is_a(value, kind):
    return isinstance(value, KINDS[kind]) and (kind == "boolean" or not isinstance(value, bool))


def faults(value, schema, where=""):
    """Faults of a value: texts that begin with its place; none where it fits."""
    assert schema.keys() <= KNOWN, schema.keys() - KNOWN
    kinds = schema.get("type", [])
    if kinds and not any(is_a(value, kind) for kind in ([kinds] if isinstance(kinds, str) else kinds)):
        return [f"{where}: {value!r} is not a {kinds}"]
    found = []
    if ("const" in schema and value != schema["const"]) or ("enum" in schema and value not in schema["enum"]):
        found.append(f"{where}: {value!r} is not allowed")
    if "anyOf" in schema:
        # Of the forms that do not fit, that which fails latest says most.
        tried = [faults(value, one, where) for one in schema["anyOf"]]
        found += min(tried, key=lambda texts: (any("is not allowed" in text for text in texts), len(texts)))
    if isinstance(value, dict):
        properties, more = schema.get("properties", {}), schema.get("additionalProperties", True)
        found += [f"{where}.{key}: missing" for key in schema.get("required", ()) if key not in value]
        if not schema.get("minProperties", 0) <= len(value) <= schema.get("maxProperties", len(value)):
            found.append(f"{where}: {len(value)} keys")
        for key, item in value.items():
            if key in properties or isinstance(more, dict):
                found += faults(item, properties.get(key, more), f"{where}.{key}")
            elif not more:
                found.append(f"{where}.{key}: unknown")
    if isinstance(value, list):
        if not schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value)):
            found.append(f"{where}: {len(value)} entries")
        for i, item in enumerate(value):
            found += faults(item, schema.get("items", {}), f"{where}[{i}]")
    if is_a(value, "number"):
        low, above, high = (schema.get(name) for name in ("minimum", "exclusiveMinimum", "maximum"))
        wrong = (
            low is not None and value < low, above is not None and value <= above, high is not None and value > high,
        )  # fmt: skip
        found += [f"{where}: {value!r} is out of bounds"] * any(wrong)
    return found
