# SPDX-License-Identifier: Apache-2.0
"""JSON schema of the scene file, built from the loader's own tables, for editors and other programs."""

from __future__ import annotations

import dataclasses
import inspect
import math
import re
from collections.abc import Iterable, Mapping
from typing import Any

from lgvi_warp.control.base import SECTIONS as LISTS
from lgvi_warp.control.base import ControlLaw, Part
from lgvi_warp.control.controller import Controller
from lgvi_warp.control.gain_tables import OVER
from lgvi_warp.physics import terms
from lgvi_warp.physics.fields import TABLE
from lgvi_warp.physics.terms import events
from lgvi_warp.physics.terms.base import Term, word_of
from lgvi_warp.physics.vehicle import Vehicle
from lgvi_warp.sampling.designs import KINDS as SAMPLINGS
from lgvi_warp.sampling.distributions.named import KINDS as DISTRIBUTIONS
from lgvi_warp.sampling.distributions.named import SCIPY, ScipyDistribution, UserDistribution
from lgvi_warp.scene.scene import SECTIONS
from lgvi_warp.scene.settings import EnsembleSettings, RunSettings
from lgvi_warp.scene.start import NAMES, Environment, Start
from lgvi_warp.statistics.base import TYPES as STATISTICS
from lgvi_warp.statistics.until import Until
from lgvi_warp.vehicles.fossen import vehicle_names

Schema = dict[str, Any]

# Annotation of a field -> type in JSON. Any other annotation allows everything.
WORDS = {"float": "number", "int": "integer", "str": "string", "bool": "boolean"}


def schema() -> Schema:
    """The JSON schema of scene files."""
    own_terms = {word: kind for word, kind in terms.TYPES.items() if word not in {term.type for term in terms.IMPLIED}}
    vary = {word: _table(kind) for word, kind in DISTRIBUTIONS.items() if word != UserDistribution.kind}
    vary |= {word: {"type": "object"} for word in (*SCIPY, ScipyDistribution.kind)}
    samplings = {word: _table(kind) if word != "grid" else {"type": "object"} for word, kind in SAMPLINGS.items()}
    run = {"statistics": _list(STATISTICS), "until": _table(Until)}
    ensemble: dict[str, Schema] = {
        "vary": {"type": "object", "additionalProperties": _alone(vary)},
        "sampling": {"anyOf": [{"enum": sorted(samplings)}, _alone(samplings)]},
        "indices": _numbers(("k",), {"type": "integer", "minimum": 0}),
    }
    start = {name: _numbers(TABLE[name].shape if name in TABLE else (3,)) for name in NAMES}
    lists = {section: _list(base.kinds, {"faults": "fault"}.get(section)) for section, base in LISTS.items()}
    sections = {
        "vehicle": _table(Vehicle, {"name": {"enum": vehicle_names()}}),
        "environment": _table(Environment, {"origin": _numbers((2,)), "start": {"type": "string"}}),
        "start": _table(Start, start),
        "ensemble": _table(EnsembleSettings, ensemble),
        "run": _table(RunSettings, run),
        "terms": _list(own_terms),
        "events": _list(events.TYPES),
        "controller": _table(Controller, {"delay": {"type": "number", "minimum": 0}} | lists),
        "source": {"type": "object"},
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Scene file of lgvi-warp",
        "type": "object",
        "required": ["vehicle"],
        "additionalProperties": False,
        "properties": {name: sections[name] for name in SECTIONS},
    }


def _alone(kinds: Mapping[str, Schema]) -> Schema:
    """A table with a single key, the kind."""
    return {"type": "object", "properties": dict(kinds), "additionalProperties": False, "minProperties": 1,
            "maxProperties": 1}  # fmt: skip


def _list(kinds: Mapping[str, Any], default: str | None = None) -> Schema:
    """A list of tables, each with its type; default: The type of a table that names none."""
    able = {
        word: kind for word, kind in kinds.items() if not any("Callable" in str(item.type) for item in _fields(kind))
    }
    entries = [
        _table(kind, {"type": {"const": word}}, () if word == default else ("type",)) for word, kind in able.items()
    ]
    # Terms whose numbers a file may hold.
    for word, kind in able.items():
        if hasattr(kind, "of_file") and (request := kind.of_file()) is not None:
            known = {"type": {"const": word}} | {key: {} for key in kind.of_file_besides}
            entries.append(_table(request, known, ("type", "file")))
    return {"type": "array", "items": {"anyOf": entries}}


def _fields(kind: Any) -> list[dataclasses.Field[Any]]:
    """The fields of a class that a file may give."""
    return [item for item in dataclasses.fields(kind) if item.init]


def _table(kind: Any, known: Mapping[str, Schema] | None = None, required: Iterable[str] = ()) -> Schema:
    """A table with the fields of a class; `known` gives the schemas of some fields."""
    texts, known = meanings(kind), known or {}
    content: dict[str, Schema] = {name: dict(item) for name, item in known.items()}
    for item in _fields(kind):
        name = word_of(item)
        described = known.get(name) or _value(kind, item)
        content[name] = described | ({"description": texts[item.name]} if item.name in texts else {})
    missing = (dataclasses.MISSING, dataclasses.MISSING)
    needed = [word_of(item) for item in _fields(kind) if (item.default, item.default_factory) == missing]
    return {"type": "object", "properties": content, "required": [*required, *needed], "additionalProperties": False}


def _value(kind: Any, item: dataclasses.Field[Any]) -> Schema:
    """The value of a field."""
    if "shape" in item.metadata:
        bounds = {"minimum": item.metadata["least"], "maximum": item.metadata["most"],
                  "exclusiveMinimum": item.metadata["above"]}  # fmt: skip
        number = {"type": "number"} | {name: bound for name, bound in bounds.items() if math.isfinite(bound)}
        # Where an object has shapes of its own, one number may stand for several.
        fixed = kind.shape_of in (Term.shape_of, ControlLaw.shape_of)
        value = _numbers(tuple(size if fixed else "k" for size in item.metadata["shape"]), number)
        return _in_other_forms(kind, word_of(item), value)
    words = str(item.type).replace(" | None", "").split(" | ")
    if all(word in WORDS for word in words):
        return {"type": [WORDS[word] for word in words] if len(words) > 1 else WORDS[words[0]]}
    return {"type": "array"} if words[0].startswith("Sequence") else {}


def _in_other_forms(kind: Any, name: str, value: Schema) -> Schema:
    """A number of a part, which may also be a word or a gain table over a measured quantity."""
    forms: list[Schema] = []
    if issubclass(kind, Part) and name in kind.words_for:
        forms.append({"const": kind.words_for[name]})
    if issubclass(kind, ControlLaw) and kind.device_fields(name):
        values = {"type": "array", "items": value, "minItems": 2}
        content: dict[str, Schema] = {
            "over": {"enum": list(OVER)},
            "at": _numbers(("k",))["anyOf"][1],
            "values": values,
        }
        forms.append({"type": "object", "properties": content, "required": [*content], "additionalProperties": False})
    return {"anyOf": [value, *forms]} if forms else value


def _numbers(shape: tuple[Any, ...], number: Schema | None = None) -> Schema:
    """Nested lists of this shape; if a size is a word, a list or one number for all entries."""
    number = number or {"type": "number"}
    if not shape:
        return number
    items = {"type": "array", "items": _numbers(shape[1:], number)}
    if isinstance(shape[0], int):
        return items | {"minItems": shape[0], "maxItems": shape[0]}
    return {"anyOf": [number, items | {"minItems": 1}]}


def meanings(kind: Any) -> dict[str, str]:
    """Meanings of a class's fields by name, from its docstring."""
    # Python 3.13 takes the indentation away itself.
    _, _, arguments = inspect.cleandoc(kind.__doc__ or "").partition("Args:\n")
    documented = re.findall(r"^    (\w+): (.*(?:\n {8}.*)*)", arguments.partition("\n\n")[0], re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in documented}
