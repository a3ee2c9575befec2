# SPDX-License-Identifier: Apache-2.0
"""Vehicles from a YAML file of coefficients, as used by robotics packages."""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from lgvi_warp.common import yaml_text
from lgvi_warp.common.arguments import name_set, names_of
from lgvi_warp.common.errors import Faults, SceneError, closest, refusal
from lgvi_warp.extensions.importers.plugins import by_diagonal
from lgvi_warp.vehicles import fossen

# YAML ---------------------------------------------------------------------------------------------------------------

_ALIASES = {
    "mass": ("mass", "m"),
    "inertia": ("inertia", "inertial", "inertia_matrix", "moments_of_inertia"),
    "added_mass": ("added_mass", "Ma", "added_mass_matrix"),
    "linear": ("linear_damping", "linear_drag", "damping_linear"),
    "forward": ("linear_damping_forward_speed",),
    "quadratic": ("quadratic_damping", "quad_damping", "quadratic_drag", "damping_quadratic"),
    "mass_matrix": ("mass_matrix", "mass_inertia_matrix", "rigid_body_mass_matrix", "M_RB"),
    "volume": ("volume",),
    "buoyancy": ("buoyancy",),
    "weight": ("weight",),
    "center_of_buoyancy": ("center_of_buoyancy", "cob", "centre_of_buoyancy"),
    "center_of_gravity": ("center_of_gravity", "center_of_mass", "cog", "com", "centre_of_gravity"),
    "density": ("density", "water_density", "fluid_density", "rho"),
    "gravity": ("gravity", "g"),
    "neutrally_buoyant": ("neutrally_buoyant",),
    "coefficients": ("coefficients", "hydrodynamics", "hydrodynamic_coefficients", "derivatives"),
}
# Keys of uuv_simulator's files that are not needed: names, and sizes that matter only near the surface.
_NOT_NEEDED = ("model", "name", "type", "base_link", "body_frame", "tf_prefix", "length", "width", "height", "radius")


def from_yaml(
    source: str | os.PathLike[str],
    *,
    position_axes: str = "flu",
    matrix_axes: str = "frd",
    quadratic: str = "diagonal",
    ignore: Iterable[str] = (),
    table: str | Iterable[str] | None = None,
    **given: Any,
) -> dict[str, Any]:
    """Build a vehicle, its drag and its water from a YAML file of a robotics package (uuv_simulator, Plankton).

    The file has these keys, at its top level or in one of its tables:

    * mass, inertia about the centre of gravity (3, 3x3 or ixx ...), centres of gravity (cog) and buoyancy (cob); or
      mass_matrix (6x6 or 6), the matrix of the rigid body about the origin of the axes;
    * volume (with density), buoyancy or neutrally_buoyant;
    * added_mass (6x6 or 6); linear_damping, linear_damping_forward_speed and quadratic_damping (6 or 6x6), as
      derivatives or magnitudes; or a map `coefficients` of Fossen's names.

    Damping that is proportional to the forward speed u, force_i = -u d_ij v_j, becomes a term body_lift.

    Args:
        source: Path of the file, or its text.
        position_axes: Axes of the centres and of the inertia: "flu" (x ahead, y to port, z up, as in uuv_simulator;
            default) or "frd" (x ahead, y to starboard, z down).
        matrix_axes: Axes of added mass and damping: "frd" (as in uuv_simulator; default) or "flu".
        quadratic: Entries used of a 6x6 matrix of quadratic damping: "diagonal" (as in uuv_simulator; default), or "full"
            for the whole matrix.
        ignore: Keys to leave out, none by default; other unknown keys are refused.
        table: Path in the file to the table to read, such as "vehicle.dynamics", or a list of keys; by default the whole
            file.
        **given: Values by key (mass=..., density=...), which are added to the values of the file or replace these.

    Returns:
        The tables "vehicle", "environment" and "terms" of a scene file.

    Raises:
        SceneError: If the file is invalid; the message lists every fault.
        ImportError: If PyYAML is not installed.

    Examples:
        >>> import lgvi_warp as lw
        >>> text = "{mass: 30.0, inertia: [0.2, 3.5, 3.5], linear_damping: [-4, -20, -20, -1, -10, -10]}"
        >>> lw.vehicles.from_yaml(text)["terms"][0]["linear"]
        [4.0, 20.0, 20.0, 1.0, 10.0, 10.0]
    """
    faults = Faults()
    faults.choice("quadratic", quadratic, ("diagonal", "full"))
    for key, value in (("position_axes", position_axes), ("matrix_axes", matrix_axes)):
        faults.choice(key, value, ("flu", "frd"))
    ignore = name_set("ignore", ignore)
    content = table_of(parse_yaml(source), table)
    told: list[Any] = []
    read = by_meaning(faults, content, ignore, told) | by_meaning(faults, given, set(), told)
    positions = fossen.HALF_TURN if position_axes == "flu" else np.ones(3)
    matrices = fossen.HALF_TURN_6 if matrix_axes == "flu" else np.ones(6)
    if "mass_matrix" in read:
        add_rigid_body(faults, read, matrices, positions)
    body = yaml_body(faults, read, positions)
    for name in ("added_mass", "linear", "forward", "quadratic"):
        value = matrices[:, None] * matrix_6(faults, name, read.get(name)) * matrices
        setattr(body, name, fossen.symmetric(faults, name, value) if name == "added_mass" else value)
    if quadratic == "diagonal":
        body.quadratic = by_diagonal(body.warnings, body.quadratic)
    if "coefficients" in read:
        for name in {"added_mass", "linear", "forward", "quadratic"} & set(read):
            faults.add(name, read[name], "is given besides coefficients by name", "keep one of them")
        if matrix_axes == "flu":
            faults.add("matrix_axes", "flu", "does not go with coefficients by name", "Fossen's names are for frd")
        fossen.add_derivatives(faults, body, read["coefficients"], ignore)
    return body.to_dict(faults)


def parse_yaml(source: str | os.PathLike[str]) -> Mapping[str, Any]:
    """Parse the map in a YAML text or file."""
    text = fossen.read_text(source, isinstance(source, str) and ("\n" in source or ": " in source), "YAML file")
    content = yaml_text.parsed(text)
    if not isinstance(content, Mapping):
        raise SceneError(["YAML is not a map. Write mass: ..., added_mass: ..."])
    return content


def table_of(content: Mapping[str, Any], path: Any) -> Mapping[str, Any]:
    """The table at a path in a file, or the whole file."""
    if path is None:
        return content
    keys = [path] if isinstance(path, str) and path in content else path.split(".") if isinstance(path, str) else path
    for key in names_of("table", keys):
        inner = content.get(key)
        if not isinstance(inner, Mapping):
            tables = [str(name) for name, value in content.items() if isinstance(value, Mapping)]
            raise refusal(
                "table", key, "is not a table of the file", closest(key, tables) if tables else "leave it out"
            )
        content = inner
    return content


def add_rigid_body(faults: Faults, read: dict[str, Any], matrices: np.ndarray, positions: np.ndarray) -> None:
    """Add the mass, inertia and centre of gravity of a mass matrix about the origin to the values read from a file.

    matrices (6,), positions (3,): Signs that convert the axes of the matrix, and those of positions, to x ahead, y to
    starboard, z down.
    """
    value = read["mass_matrix"]
    for key in {"mass", "inertia", "center_of_gravity"} & set(read):
        faults.add(key, read[key], "is given besides mass_matrix", "keep one of them")
    M = matrices[:, None] * matrix_6(faults, "mass_matrix", value) * matrices
    mass = float(M[0, 0])
    offset = M[3:, :3] / (mass or 1.0)
    center = np.array([offset[2, 1], offset[0, 2], offset[1, 0]])
    cross = np.cross(np.eye(3), center)
    rigid = np.block([[mass * np.eye(3), -mass * cross], [mass * cross, M[3:, 3:]]])
    if not np.allclose(M, rigid, rtol=0.0, atol=1e-9 * np.abs(M).max(initial=1e-300)):
        remedy = "give mass, inertia, cog and added_mass: with added mass in it, it cannot be taken apart"
        faults.add("mass_matrix", value, "is not that of a rigid body, m on its diagonal", remedy)
    inertia = positions[:, None] * (M[3:, 3:] + mass * cross @ cross) * positions
    read |= {"mass": mass, "inertia": inertia.tolist(), "center_of_gravity": (positions * center).tolist()}


def by_meaning(faults: Faults, content: Mapping[str, Any], ignore: set[str], reported: list[Any]) -> dict[str, Any]:
    """Values by the meaning of their keys: aliases are resolved, tables are opened, Fossen's names are collected.

    reported: Unknown keys so far.
    """
    meanings = {alias: name for name, aliases in _ALIASES.items() for alias in aliases}
    read: dict[str, Any] = {}
    for key, value in content.items():
        name = meanings.get(key)
        if key in ignore or (key in _NOT_NEEDED and not isinstance(value, Mapping)):
            continue
        if name in read and name != "coefficients":
            faults.add(key, value, f"is given twice, as another name of {name}", "keep one of them")
        elif name == "coefficients" and isinstance(value, Mapping):
            read[name] = read.get(name, {}) | dict(value)
        elif name is not None:
            read[name] = value
        elif isinstance(key, str) and fossen.read_name(key):
            read.setdefault("coefficients", {})[key] = value
        elif isinstance(value, Mapping):
            read |= by_meaning(faults, value, ignore, reported)
        else:
            near = difflib.get_close_matches(str(key), meanings, 1)
            remedy = f"did you mean {near[0]!r}?; or name it in ignore=" if near else "name it in ignore="
            # All that is known, once.
            every = f"known: {', '.join(meanings)}; or name it in ignore=, or the table that is meant in table="
            faults.add(str(key), value, "is an unknown key", remedy if reported else every)
            reported.append(key)
    return read


def yaml_body(faults: Faults, read: Mapping[str, Any], positions: np.ndarray) -> fossen.Coefficients:
    """Build mass, inertia, centres and forces of a body from a YAML map.

    positions: Sign of each axis (3,), to convert positions and inertia to x ahead, y to starboard, z down.
    """
    inertia = read.get("inertia")
    if isinstance(inertia, Mapping):
        faults.keys("inertia", inertia, [f"i{pair}" for pair in fossen.PAIRS])
        inertia = fossen.inertia_from_names(inertia)
    gravity = read.get("gravity", fossen.STANDARD_GRAVITY)
    gravity = abs(gravity) if isinstance(gravity, int | float) else gravity
    for key in ("mass", "inertia"):
        if read.get(key) is None:
            faults.add(key, "", "is missing", f"add {key} to the file, or pass {key}=")
    square = Faults().symmetric("inertia", inertia, "") if inertia is not None else None
    if square is not None:
        inertia = positions[:, None] * square * positions
    density = read.get("density")
    density = None if density is None else faults.positive("density", density, "kg/m3")
    buoyancy = read.get("buoyancy")
    if buoyancy is None and "volume" in read and not is_neutral(faults, read):
        buoyancy = displaced_weight(faults, read["volume"], density, gravity, "density" in read)
    zero = (0.0, 0.0, 0.0)
    gravity_at = fossen.turned(read.get("center_of_gravity", zero), positions)
    buoyancy_at = fossen.turned(read.get("center_of_buoyancy", zero), positions)
    mass = 1.0 if read.get("mass") is None else read["mass"]
    inertia = np.eye(3) if inertia is None else inertia
    body = fossen.rigid_body(faults, mass, inertia, gravity_at, buoyancy_at, read.get("weight"), buoyancy, gravity)
    body.water_density = density
    return body


def is_neutral(faults: Faults, read: Mapping[str, Any]) -> bool:
    """Return whether the file declares the vehicle neutrally buoyant."""
    value = read.get("neutrally_buoyant", False)
    faults.choice("neutrally_buoyant", bool(value) if value in (0, 1) else value, (True, False))
    return bool(value)


def displaced_weight(faults: Faults, volume: Any, density: Any, gravity: Any, is_given: bool) -> float | None:
    """Return the weight [N] of the water that a volume [m3] displaces; None after adding a fault."""
    if not is_given:
        faults.positive("density", "not given", "kg/m3 (with volume)")
    values = [faults.positive("volume", volume, "m3"), density, Faults().number("gravity", gravity, least=0.0)]
    return None if None in values else float(np.prod(np.array(values, dtype=float)))


def matrix_6(faults: Faults, key: str, value: Any) -> np.ndarray:
    """Matrix (6, 6) of added mass or damping from either sign convention, with a positive diagonal; zeros for None."""
    array = None if value is None else faults.finite(key, value)
    if array is None:
        return np.zeros((6, 6))
    if array.shape not in ((6,), (36,), (6, 6)):
        faults.add(key, value, f"has shape {array.shape}", "give 6 numbers or a 6x6 matrix")
        return np.zeros((6, 6))
    return fossen.as_positive(faults, key, np.diag(array) if array.shape == (6,) else array.reshape(6, 6))
