# SPDX-License-Identifier: Apache-2.0
"""Members of a run as trajectories in a NetCDF file (CF conventions, chapter 9): arrays over members and times."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.control.signals import field_of
from lgvi_warp.results import member_fields
from lgvi_warp.results.result import END_TIME
from lgvi_warp.store.exporting.netcdf_files import new_netcdf
from lgvi_warp.store.exporting.tracks import Report, Tracks, derived_of, units_of

DIMENSIONS = ("trajectory", "obs")
# Quantities that follow from samples, and what the file calls them.
NAMES = {
    "latitude": "lat", "longitude": "lon", "heading_deg": "heading", "roll_deg": "roll", "pitch_deg": "pitch",
    "yaw_deg": "yaw", "speed": "speed", **{f"quaternion_{letter}": f"quaternion_{letter}" for letter in "wxyz"},
}  # fmt: skip
STANDARD = {
    "lat": "latitude", "lon": "longitude", "depth": "depth", "time": "time", "heading": "platform_orientation",
    "roll": "platform_roll_starboard_down", "pitch": "platform_pitch_fore_up", "yaw": "platform_yaw_fore_starboard",
    "speed": "platform_speed_wrt_ground", "north": "projection_y_coordinate", "east": "projection_x_coordinate",
}  # fmt: skip
# Most numbers in a chunk.
CHUNK = 100_000
# The samples of the position: north, east, down.
AXES = ("north", "east", "depth")
MEANINGS = {
    "north": "distance to the north of the origin of the axes", "east": "distance to the east of the origin of the axes",
    "depth": "depth below the surface",
}  # fmt: skip
# Of a run without a start date.
NO_DATE = "the run has no date: times count from its start, which is put at 1970-01-01"


def netcdf(tracks: Tracks, target: Path, report: Report) -> None:
    """Write a NetCDF-4 file: sampled numbers over trajectory and obs, and numbers of each member over trajectory."""
    tracks.needing(("position",), "a trajectory")
    with new_netcdf(target) as file:
        file.setncatts(_attributes(tracks))
        for name, size in zip(DIMENSIONS, (tracks.count, len(tracks.time)), strict=True):
            file.createDimension(name, size)
        _members(tracks, file)
        _ends(tracks, file)
        if tracks.plane is not None:
            _grid_mapping(tracks, file)
        width = len(_layout(tracks, file))
        for rows in tracks.pieces(width, _chunks(tracks.count, len(tracks.time))[0]):
            for name, values in _numbers(tracks, rows):
                file[name][rows] = values
            report(rows.stop / tracks.count)


def _attributes(tracks: Tracks) -> dict[str, str]:
    """Attributes of the file."""
    begin, end = (str(np.datetime_as_string(tracks.moments(at), unit="ms")) for at in tracks.time[[0, -1]])
    dated = {"time_coverage_start": begin + "Z", "time_coverage_end": end + "Z"}
    return {
        "Conventions": "CF-1.8",
        "featureType": "trajectory",
        "title": "Ensemble of underwater vehicles",
        "source": tracks.source,
        "history": "exported from a run of lgvi-warp",
        "comment": "one trajectory for each member; axes point north, east and down" + (
            "" if tracks.environment.start else f"; {NO_DATE}"),
        "provenance": json.dumps(tracks.provenance),
    } | (dated if tracks.environment.start else {})  # fmt: skip


def _create(file: Any, name: str, kind: Any, dimensions: tuple[str, ...], attributes: Mapping[str, Any]) -> Any:
    """Create a variable; missing real numbers are NaN."""
    kind = np.dtype(kind).newbyteorder("=")
    real = kind.kind == "f" and name != "time"
    chunks = None if len(dimensions) < 2 else _chunks(len(file.dimensions["trajectory"]), len(file.dimensions["obs"]))
    # Each chunk is written once: HDF5 needs to remember none.
    variable = file.createVariable(name, kind, dimensions, chunksizes=chunks, compression="zlib", complevel=1,
                                   fill_value=np.nan if real else False, chunk_cache=CHUNK * kind.itemsize)  # fmt: skip
    variable.setncatts(dict(attributes))
    return variable


def _chunks(members: int, times: int) -> tuple[int, int]:
    """Choose the members and times in a chunk: the samples of a member lie together."""
    length = min(times, CHUNK)
    return min(members, CHUNK // length), length


def _layout(tracks: Tracks, file: Any) -> list[str]:
    """Create the variables over members and times; return their names."""
    start = tracks.environment.start_time
    epoch = "1970-01-01T00:00:00" if start is None else np.datetime_as_string(start, unit="us").rstrip("0").rstrip(".")
    time = {"units": f"seconds since {str(epoch).replace('T', ' ')}", "calendar": "standard", "axis": "T",
            "long_name": "time", "standard_name": "time"} | ({} if start else {"comment": NO_DATE})  # fmt: skip
    _create(file, "time", "f8", DIMENSIONS, time)
    names = ["time"]
    for name in AXES:
        vertical = {"positive": "down", "axis": "Z"} if name == "depth" else {}
        on_plane = {} if tracks.plane is None or name == "depth" else {"grid_mapping": "plane"}
        attributes = {"units": "m", "long_name": MEANINGS[name]} | _standard(tracks, name) | vertical | on_plane
        names.append(_create(file, name, tracks.sample("position", slice(0, 1)).dtype, DIMENSIONS, attributes).name)
    for item in derived_of(tracks, tuple(NAMES)):
        name = NAMES[item.field.name]
        attributes = _described(item.field.meaning, item.field.unit, 0, 1) | _standard(tracks, name)
        attributes |= _about(tracks, name)
        names.append(_create(file, name, "f8", DIMENSIONS, attributes).name)
    for field in (field for field in tracks.fields if field not in ("position", "attitude")):
        values = tracks.sample(field, slice(0, 1), slice(0, 1))
        entries, meaning = _entries(field, values.shape[2:]), field_of(field).meaning
        for i, name in enumerate(entries):
            attributes = _described(meaning, field_of(field).unit, i, len(entries)) | _about(tracks, name)
            names.append(_create(file, name, values.dtype, DIMENSIONS, attributes).name)
    return names


def _described(meaning: str, unit: str, entry: int, entries: int) -> dict[str, str]:
    """Meaning and unit of an entry of a number, if known; for forces and moments the unit "N, N m" is divided."""
    units = [word.strip().replace("/s", " s-1") for word in unit.split(",")]
    known = len(units) == 1 or 3 * len(units) == entries
    return {"long_name": meaning} | ({"units": units[entry // 3 if len(units) > 1 else 0]} if known and unit else {})


def _standard(tracks: Tracks, name: str) -> dict[str, str]:
    """CF standard name of a number; map coordinates have one only if the projection is known."""
    known = name in STANDARD and not (name in ("north", "east") and tracks.plane is None)
    return {"standard_name": STANDARD[name]} if known else {}


def _about(tracks: Tracks, name: str) -> dict[str, str]:
    """Names of a number's coordinates."""
    if name in ("lat", "lon"):
        return {}
    if tracks.plane is None:
        return {"coordinates": "time depth east north"}
    return {"coordinates": "time depth lat lon"}


def _entries(name: str, shape: tuple[int, ...]) -> list[str]:
    """Names of the entries of a field: velocity_x and so on for three axes, otherwise by number."""
    if shape == (3,):
        return [f"{name}_{axis}" for axis in "xyz"]
    return [f"{name}_{'_'.join(map(str, at))}" for at in itertools.product(*map(range, shape))] if shape else [name]


def _numbers(tracks: Tracks, rows: slice) -> Iterable[tuple[str, np.ndarray]]:
    """Numbers of some members over the times, (m, k), with their names in the file."""
    samples = {name: tracks.sample(name, rows) for name in tracks.fields}
    yield "time", np.broadcast_to(tracks.time, (len(tracks.members[rows]), len(tracks.time)))
    for axis, name in enumerate(AXES):
        yield name, samples["position"][..., axis].T
    for item in derived_of(tracks, tuple(NAMES)):
        yield NAMES[item.field.name], item.function(tracks, samples).T
    for field in (field for field in tracks.fields if field not in ("position", "attitude")):
        flat = samples[field].reshape(*samples[field].shape[:2], -1)
        for i, name in enumerate(_entries(field, samples[field].shape[2:])):
            yield name, flat[..., i].T


def _members(tracks: Tracks, file: Any) -> None:
    """Write the member of each trajectory, and its varied numbers."""
    about = {"cf_role": "trajectory_id", "long_name": "index of the member in its ensemble"}
    _create(file, "trajectory", "i4", DIMENSIONS[:1], about)[:] = tracks.members
    units = units_of(tracks)
    for name, values in tracks.numbers().items():
        entries = _entries(name, values.shape[1:])
        for i, (entry, column) in enumerate(zip(entries, values.reshape(len(values), -1).T, strict=True)):
            attributes = _described(f"{name} of the member", units.get(name, ""), i, len(entries))
            _create(file, entry.replace(".", "_"), "f8", DIMENSIONS[:1], attributes)[:] = column


def _ends(tracks: Tracks, file: Any) -> None:
    """Write the outcome and the end time of each member."""
    of_status = member_fields.STATUS | {"flag_values": np.array(member_fields.STATUS["flag_values"], "i1")}
    _create(file, "status", "i1", DIMENSIONS[:1], of_status)[:] = tracks.of_members("status").astype("i1")
    about = {item.name: item.attributes for item in member_fields.FIELDS}
    for name, attributes in (("failure_time", about["failure_time"]), ("end_time", END_TIME)):
        _create(file, name, "f8", DIMENSIONS[:1], attributes)[:] = tracks.of_members(name)
    if tracks.result.event is not None:
        _create(file, "event", "i2", DIMENSIONS[:1], about["event"])[:] = tracks.of_members("event")
    if tracks.result.weights is not None:
        weight = {"long_name": "what the member counts for in statistics", "units": "1"}
        _create(file, "weight", "f8", DIMENSIONS[:1], weight)[:] = tracks.of_members("weights")


def _grid_mapping(tracks: Tracks, file: Any) -> None:
    """Write the local plane of north and east (the grid mapping)."""
    plane = tracks.plane
    assert plane is not None
    variable = file.createVariable("plane", "i4", ())
    variable.setncatts({
        "grid_mapping_name": "azimuthal_equidistant", "latitude_of_projection_origin": plane.latitude,
        "longitude_of_projection_origin": plane.longitude, "false_easting": 0.0, "false_northing": 0.0,
        "semi_major_axis": 6378137.0, "inverse_flattening": 298.257223563,
        "long_name": "plane of north and east, on the ellipsoid of WGS 84",
    })  # fmt: skip
    variable[...] = 0
