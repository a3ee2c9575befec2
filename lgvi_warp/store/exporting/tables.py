# SPDX-License-Identifier: Apache-2.0
"""A run as a CSV or Parquet table: one row per member and sample time, or one row per member without samples."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.control.signals import field_of
from lgvi_warp.store.exporting.tracks import Report, Tracks, derived_of, units_of
from lgvi_warp.store.layout import MEMBER, WEIGHT

# By name of a column, its unit ("" for none) and its numbers, one for each row.
Columns = dict[str, tuple[str, np.ndarray]]
# Numbers beside the samples that a table of them has.
BESIDE = ("latitude", "longitude", "heading_deg", "roll_deg", "pitch_deg", "yaw_deg")
TIMES = ("failure_time", "end_time")


def parquet(tracks: Tracks, target: Path, report: Report) -> None:
    """Write a Parquet file. Units are in the metadata of the columns, and for pandas in its `attrs`."""
    import pyarrow.parquet as pq

    _write(tracks, report, lambda schema: pq.ParquetWriter(target, schema))


def csv(tracks: Tracks, target: Path, report: Report) -> None:
    """Write a CSV file whose first line names the columns. Each number has the digits that identify its value."""
    import pyarrow.csv as pc

    options = pc.WriteOptions(quoting_style="needed")
    _write(tracks, report, lambda schema: pc.CSVWriter(target, schema, write_options=options))


def _write(tracks: Tracks, report: Report, writer_of: Callable[[Any], Any]) -> None:
    """Write the table, some members at a time."""
    writer = None
    try:
        for rows in tracks.pieces(_width(tracks)):
            table = _table(tracks, rows)
            writer = writer or writer_of(table.schema)
            writer.write_table(table)
            report(rows.stop / tracks.count)
    finally:
        if writer is not None:
            writer.close()


def _width(tracks: Tracks) -> int:
    """Number of values in a row."""
    return len(_columns(tracks, slice(0, 1)))


def _table(tracks: Tracks, rows: slice) -> Any:
    """Make the rows of some members, with units and origin of the numbers in the metadata."""
    import pyarrow as pa

    columns = _columns(tracks, rows)
    units = {name: unit for name, (unit, _) in columns.items() if unit}
    table = pa.table({name: values for name, (_, values) in columns.items()})
    fields = [field.with_metadata({"units": units[field.name]}) if field.name in units else field
              for field in table.schema]  # fmt: skip
    about = {"Conventions": "CF-1.11", "source": tracks.source, "provenance": json.dumps(tracks.provenance)}
    return table.cast(pa.schema(fields, about | {"PANDAS_ATTRS": json.dumps({"units": units})}))


def _columns(tracks: Tracks, rows: slice) -> Columns:
    """Columns of some members; the rows of one member follow one another."""
    fields, count = tracks.fields, len(tracks.members[rows])
    k = len(tracks.time) if fields else 1
    columns: Columns = {MEMBER: ("", np.repeat(tracks.members[rows], k))}
    samples = {name: tracks.sample(name, rows) for name in fields}
    if fields:
        columns["time"] = ("s", np.tile(tracks.time, count))
        if tracks.environment.start is not None:
            columns["utc"] = ("", _in_utc(np.tile(tracks.moments(tracks.time), count)))
    for name, values in samples.items():
        unit = field_of(name).attributes["units"]
        columns |= _components(name, unit, np.swapaxes(values, 0, 1).reshape(-1, *values.shape[2:]))
    for item in derived_of(tracks, BESIDE):
        columns[item.field.name] = (item.field.unit, item.function(tracks, samples).T.reshape(-1))
    units = units_of(tracks)
    for name, values in tracks.numbers(rows).items():
        unit = units.get(name, "").replace("/s", " s-1")
        columns |= _components(name, unit, np.repeat(values, k, axis=0))
    return columns | {name: (unit, np.repeat(values, k)) for name, (unit, values) in _ends(tracks, rows).items()}


def _ends(tracks: Tracks, rows: slice) -> Columns:
    """Outcomes, end times and weights of some members."""
    result = tracks.result
    names = ["status", *(["event"] if result.event is not None else []), "failure_time"]
    ends: Columns = {name: ("s" if name in TIMES else "", tracks.of_members(name, rows)) for name in names}
    if result.weights is not None:
        ends[WEIGHT] = ("1", tracks.of_members("weights", rows))
    return ends | {"end_time": ("s", tracks.of_members("end_time", rows))}


def _in_utc(moments: np.ndarray) -> Any:
    """Convert dates and times to a type that says that they are in UTC."""
    import pyarrow as pa

    return pa.array(moments, pa.timestamp("us")).cast(pa.timestamp("us", "UTC"))


def _components(name: str, unit: str, values: np.ndarray) -> Columns:
    """Split an array of rows (n, ...) into a column for each component: position_0, attitude_12, vehicle.mass."""
    if values.ndim == 1:
        return {name: (unit, values)}
    places = itertools.product(*map(range, values.shape[1:]))
    flat = values.reshape(len(values), -1).T
    return {f"{name}_{''.join(map(str, at))}": (unit, column.copy()) for at, column in zip(places, flat, strict=True)}
