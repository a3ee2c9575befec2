# SPDX-License-Identifier: Apache-2.0
"""Gain tables: numbers of a law as functions of a measured quantity, linear between nodes and constant beyond the ends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, knots, own, word_of

# Measured quantities that a table may be over: the speed ahead through the water, the depth, and the altitude by an altimeter.
OVER = {"speed": "m/s", "depth": "m", "altitude": "m"}
KEYS = ("over", "at", "values")
EXAMPLE = 'give a number, or a table such as { over = "speed", at = [0.5, 2.0], values = [20.0, 5.0] }'


class GainTable(NamedTuple):
    """Nodes of the table of a number; the number itself holds the values at the nodes, in an added first dimension.

    over: Measured quantity, a word of OVER. at: Values of this quantity at the nodes (k,), rising.
    """

    over: str
    at: np.ndarray


def taken_tables(law: Any) -> dict[str, GainTable]:
    """Replace each table of a law by its values; return the nodes by the number's name."""
    faults, tables = Faults(f"{law.key}."), dict[str, GainTable]()
    for item in law.number_fields():
        table, name = getattr(law, item.name), word_of(item)
        if not isinstance(table, Mapping):
            continue
        if not law.device_fields(name):
            faults.add(name, table, "cannot be a table", f"give numbers [{item.metadata['unit']}]")
            continue
        with faults.including():
            tables[name] = _read(f"{law.key}.{name}", table)
            object.__setattr__(law, item.name, table["values"])
    faults.raise_if_any()
    return tables


def _read(name: str, table: Mapping[str, Any]) -> GainTable:
    """Check a table of a gain and return its nodes."""
    faults, at = Faults(), None
    faults.keys(name, table, KEYS)
    for key in (key for key in KEYS if key not in table):
        faults.add(f"{name}.{key}", "", "is missing", EXAMPLE)
    over = table.get("over", "speed")
    if faults.choice(f"{name}.over", over, OVER) and "at" in table:
        at = faults.finite(f"{name}.at", table["at"], None, OVER[over])
        if at is not None and (at.ndim != 1 or len(at) < 2 or np.any(np.diff(at) <= 0.0)):
            problem = "are not two or more rising numbers"
            faults.add(f"{name}.at", table["at"], problem, f"sort them and drop repetitions [{OVER[over]}]")
    faults.raise_if_any()
    assert at is not None
    return GainTable(over, at)


def as_given(law: Any) -> dict[str, Any]:
    """The tables of a law in the form that a user writes, by the number's name."""
    numbers = law.parameters()
    return {
        name: {"over": table.over, "at": table.at.tolist(), "values": numbers[name].tolist()}
        for name, table in law.gain_tables.items()
    }


def sounder_of(law: Any, faults: Faults, sensors: Sequence[Any]) -> Any:
    """The altimeter that tables over altitude read; None if there is no such table, or after adding a fault."""
    names = [name for name, table in law.gain_tables.items() if table.over == "altitude"]
    able = [sensor for sensor in sensors if sensor.type == "altimeter"]
    if names and len(able) != 1:
        problem = f"needs one altimeter, and the controller has {len(able)}"
        faults.add(
            f"{law.key}.{names[0]}.over", "altitude", problem, 'give one [[controller.sensors]] type = "altimeter"'
        )
    return able[0] if names and len(able) == 1 else None


def packed_with_tables(law: Any, numbers: Numbers, context: PackingContext) -> Packed:
    """Packed numbers of a term. For a law with gain tables, the rows of the tables follow the law's own rows."""
    if not getattr(law, "gain_tables", None):
        plain: Packed = law.packed(numbers, context)
        return plain
    first = {name: numbers[name][:, 0] for name in law.gain_tables}
    packed = law.packed({**numbers, **first}, context)
    values = dict(packed.values)
    rows = list(packed.rows if isinstance(packed.rows, tuple) else () if packed.rows is None else (packed.rows,))
    for name, table in law.gain_tables.items():
        nodes = [
            law.packed({**numbers, **first, name: numbers[name][:, j]}, context).values for j in range(len(table.at))
        ]
        for field in law.device_fields(name):
            columns = np.stack([node[field] for node in nodes], axis=1)
            values |= {f"{field}_row": sum(part.shape[1] for part in rows), f"{field}_pieces": len(table.at) - 1}
            rows.append(knots(table.at[None], columns.reshape(*columns.shape[:2], -1)))
    if law.sounder is not None:
        beam = own(law.sounder, context.parameters)
        direction = beam["direction"] / np.linalg.norm(beam["direction"], axis=-1, keepdims=True)
        values |= {"beam": direction, "beam_point": beam["point"], "range_row": law.bus.ranges[law.sounder.key]}
    return packed._replace(values=values, rows=tuple(rows))
