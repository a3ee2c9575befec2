# SPDX-License-Identifier: Apache-2.0
"""CTD casts: columns of depth and density, or of temperature and salinity, from arrays, CSV or NetCDF."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, MissingExtra, SceneError, refusal
from lgvi_warp.common.reading import file_text

# Columns, by the words with which their names may begin.
WORDS = {
    "depth": ("depth", "dep", "z"),
    "pressure": ("pressure", "pres", "prdm", "prsm", "sea_water_pressure"),
    "density": ("density", "rho", "sea_water_density"),
    "temperature": ("temperature", "temp", "t090", "sea_water_temperature"),
    "salinity": ("salinity", "sal", "psal", "sea_water_practical_salinity", "sea_water_salinity"),
}
PLACE = ("latitude", "longitude")
# Numbers that such a column may have in the sea, and its unit: beyond them it has another unit, or marks what is missing.
BOUNDS = {
    "depth": (-10.0, 12_000.0, "m, down"),
    "pressure": (-10.0, 12_500.0, "dbar"),
    "density": (900.0, 1500.0, "kg/m3; to an anomaly add 1,000"),
    "temperature": (-3.0, 45.0, "deg C"),
    "salinity": (0.0, 60.0, "practical salinity"),
}
# Below this a number is a mark of Sea-Bird's files for none (-9.99e-29), but for 0.
MARK = 1e-20
# Words with which names of what is no measurement end.
NOT_MEASURED = ("qc", "flag", "flags", "std", "sd", "error", "err", "anomaly")


def profile_of(file: Any, columns: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Rising depths (k,) [m] and densities (k,) [kg/m3] of a cast, from a file or columns; columns override the file's."""
    faults = Faults()
    faults.keys("", columns, (*WORDS, *PLACE))
    faults.raise_if_any()
    found = {} if file is None else _of_file(Path(file))
    found |= {name: value for name, value in columns.items() if name in WORDS}
    place = {name: float(columns.get(name, 0.0)) for name in PLACE}
    arrays = {name: faults.real(name, value) for name, value in found.items()}
    faults.raise_if_any()
    numbers = {name: _measured(name, array, faults) for name, array in arrays.items() if array is not None}
    faults.raise_if_any()
    lengths = {array.shape for array in numbers.values()}
    if len(lengths) > 1 or any(len(shape) != 1 for shape in lengths):
        shapes = ", ".join(f"{name} {array.shape}" for name, array in numbers.items())
        raise SceneError([f"cast: columns differ in length ({shapes}). Give one number of each for each depth."])
    if "depth" not in numbers and "pressure" not in numbers:
        raise SceneError(["cast has no depth. Give a column depth [m] or pressure [dbar]."])
    if "density" not in numbers and not {"temperature", "salinity"} <= numbers.keys():
        raise SceneError(["cast has no density. Give a column density [kg/m3], or temperature and salinity."])
    return _sorted(*_computed(numbers, **place))


def _measured(name: str, array: np.ndarray, faults: Faults) -> np.ndarray:
    """The numbers of a column, with nan for missing values. Adds a fault for a value that sea water cannot have."""
    array = np.where((np.abs(array) < MARK) & (array != 0.0), np.nan, array)
    least, most, unit = BOUNDS[name]
    odd = array[np.isfinite(array) & ((array < least) | (array > most))]
    if odd.size:
        problem = f"is beyond {least:g} to {most:g}, between which the sea is"
        faults.add(name, float(odd[0]), problem, f"give {unit}, and nan or nothing where a number is missing")
    elif name in ("depth", "pressure") and np.any(array < 0.0) and not np.any(array > 0.0):
        faults.add(name, float(np.nanmin(array)), "is above the surface, as all are", f"give {unit}, positive downward")
    return array


def _computed(numbers: Mapping[str, np.ndarray], latitude: float, longitude: float) -> tuple[np.ndarray, np.ndarray]:
    """Depths and densities, by TEOS-10 if either of them is not given."""
    if {"depth", "density"} <= numbers.keys():
        return numbers["depth"], numbers["density"]
    try:
        import gsw
    except ImportError:
        raise MissingExtra("densities of temperatures and salinities", "gsw", "ocean") from None
    pressure = numbers.get("pressure")
    pressure = gsw.p_from_z(-numbers["depth"], latitude) if pressure is None else pressure
    depth = numbers.get("depth")
    depth = -gsw.z_from_p(pressure, latitude) if depth is None else depth
    if "density" in numbers:
        return depth, numbers["density"]
    absolute = gsw.SA_from_SP(numbers["salinity"], pressure, longitude, latitude)
    conservative = gsw.CT_from_t(absolute, numbers["temperature"], pressure)
    return np.asarray(depth), np.asarray(gsw.rho(absolute, conservative, pressure))


def _sorted(depth: np.ndarray, density: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rising depths and their densities, without incomplete rows. Densities at the same depth, down and up, are averaged."""
    good = np.isfinite(depth) & np.isfinite(density)
    if not good.any():
        raise SceneError(["cast has no line with both a depth and a density. Look at its columns."])
    at, place, count = np.unique(depth[good], return_inverse=True, return_counts=True)
    return at, np.bincount(place, density[good]) / count


def _of_file(path: Path) -> dict[str, Any]:
    """The columns of a file whose names are known."""
    if not path.is_file():
        raise refusal("file", str(path), "is no file", "give the path of a CSV or NetCDF file")
    return _of_netcdf(path) if path.suffix.lower() in (".nc", ".nc4", ".cdf") else _of_csv(path)


def _of_csv(path: Path) -> dict[str, Any]:
    lines = file_text(path, "cast").lstrip("\ufeff").splitlines()
    lines = [line for line in lines if line.strip() and not line.lstrip().startswith(("#", "*"))]
    rows = [[cell.strip() for cell in row] for row in csv.reader(lines, _dialect(lines[:1]))]
    if len(rows) < 2:
        raise refusal(
            "file", str(path), "has no lines below its names", "give a line of names, then one for each depth"
        )
    names, table = rows[0], [row for row in rows[1:] if any(map(_real, row))]
    columns = {}
    for name, word in _named(names).items():
        i = names.index(word)
        columns[name] = np.array([_value(row[i]) if i < len(row) else np.nan for row in table])
    return columns


def _dialect(head: list[str]) -> type[csv.Dialect]:
    """CSV dialect with the separator of the line of names: semicolon, tab, comma or space."""
    text = head[0] if head else ""

    class Dialect(csv.excel):
        delimiter = next((mark for mark in (";", "\t", ",") if mark in text), " ")
        skipinitialspace = True

    return Dialect


def _of_netcdf(path: Path) -> dict[str, Any]:
    try:
        import xarray as xr
    except ImportError:
        raise MissingExtra("casts in NetCDF files", "xarray", "ocean") from None
    try:
        with xr.open_dataset(path, decode_times=False) as data:
            # By their own names, or else by their standard names.
            names = {str(data[key].attrs.get("standard_name", key)): key for key in data.variables}
            found = {name: names[word] for name, word in _named(names).items()} | _named(data.variables)
            return {name: np.asarray(data[key].values, np.float64).ravel() for name, key in found.items()}
    except (OSError, ValueError) as error:
        raise refusal("file", str(path), f"cannot be read ({error})", "give a NetCDF file of one cast") from None


def _named(names: Any) -> dict[str, str]:
    """{known column: name in the file}. A name without its unit must be a known word, or else begin with one."""
    heads = {}
    for name in names:
        bare = str(name).lower().replace("-", "_").strip()
        head = bare.split("[")[0].split("(")[0].split(" ")[0].strip("_ ")
        if head.split("_")[-1] not in NOT_MEASURED:
            heads[name] = head
    found: dict[str, str] = {}
    for column, words in WORDS.items():
        same = [name for name, head in heads.items() if head in words]
        alike = [name for name, head in heads.items() if any(len(w) > 2 and head.startswith(w) for w in words)]
        if same or alike:
            found[column] = (same + alike)[0]
    return found


def _real(cell: str) -> bool:
    return bool(np.isfinite(_value(cell)))


def _value(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float("nan")
