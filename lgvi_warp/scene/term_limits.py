# SPDX-License-Identifier: Apache-2.0
"""Plausible ranges of the numbers of terms and events: a rule for each number, or the reason why it has none.

A rule depends on the unit of the number, or on its name if the unit is not enough. `plausibility` has further checks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from lgvi_warp.physics import vehicle as vehicles
from lgvi_warp.physics.terms.actuators import UNLIMITED
from lgvi_warp.physics.terms.base import own as own_numbers
from lgvi_warp.physics.terms.base import word_of
from lgvi_warp.physics.terms.strips import StripTerm
from lgvi_warp.physics.terms.thrusters import Thrusters
from lgvi_warp.physics.terms.waves import WaveTerm
from lgvi_warp.scene.like import SceneLike
from lgvi_warp.scene.oddities import OddityCheck

Numbers = Mapping[str, np.ndarray]


class Rule(NamedTuple):
    """The largest plausible size of a number for each member (1 or n,), in the number's unit, and the reason."""

    largest: Callable[[SceneLike, Numbers], Any]
    why: str


def _same(value: float, why: str) -> Rule:
    return Rule(lambda scene, p: np.array([value]), why)


def volume(scene: SceneLike, p: Numbers) -> np.ndarray:
    """The displaced volume [m3]; infinite if it does not follow from buoyancy and gravity."""
    found = vehicles.displaced_mass(p) / p["environment.water_density"]
    return np.where(np.isfinite(found) & (found > 0.0), found, np.inf)


def hull_length(scene: SceneLike, p: Numbers) -> np.ndarray:
    """The length of the hull (1 or n,) [m], from its strips or shape, or else from a spheroid of its mass and inertia."""
    stations = [p[f"{term.key}.stations"] for term in scene.terms if isinstance(term, StripTerm)]
    if stations:
        return np.asarray(np.max(np.broadcast_arrays(*(x[:, -1] - x[:, 0] for x in stations)), axis=0))
    shape = scene.vehicle.shape
    if shape is not None and not shape.mesh:
        return np.array([shape.length])
    both = "vehicle.inertia" in p
    rigid = p["vehicle.inertia"] if both else vehicles.about_center(p["vehicle.rigid_body_mass_matrix"])
    return np.asarray(np.sqrt(20.0 * np.einsum("nii->ni", rigid).max(axis=1) / vehicles.dry_mass(p)))


def _forces(scene: SceneLike, p: Numbers) -> np.ndarray:
    weight = vehicles.weight(p)
    return np.where(weight > 0.0, 100.0 * weight, np.inf)


ANY_TIME = "any time is possible"
ANY_ANGLE = "an angle is the same after a turn"
DIRECTION = "a direction: its length does not count, or is refused"
OF_THE_VEHICLE = "coefficients are as large as the vehicle and its reference lengths make them"
OF_THE_USER = "the unit of the command is the user's"
ELSEWHERE = "another check looks at it"
ANY_PLACE = "a place in the sea may be anywhere"
VOLUME = Rule(volume, "that is more than the vehicle displaces: are litres given for m3?")
ARM = Rule(lambda scene, p: 10.0 * hull_length(scene, p), "that is ten lengths of the hull away: are mm given for m?")
FORCE = Rule(_forces, "that is a hundred times the weight: a unit?")
MOMENT = Rule(
    lambda scene, p: _forces(scene, p) * hull_length(scene, p), "that is a hundred times weight and length: a unit?"
)
COEFFICIENT = _same(20.0, "bluff bodies have about 1, referred to their area")

# Rules, or reasons, by unit; what is not here has a name below.
BY_UNIT: dict[str, Rule | str] = {
    "s": ANY_TIME, "deg": ANY_ANGLE, "m3": VOLUME, "m3/s": VOLUME, "m": ARM, "N": FORCE, "N m": MOMENT, "1": COEFFICIENT,
    "unit": OF_THE_USER, "unit/s": OF_THE_USER, "N per unit^2": OF_THE_USER, "N m per unit^2": OF_THE_USER,
    "N per unit and m/s": OF_THE_USER, "N m per unit and m/s": OF_THE_USER, "1 per unit, 1 per unit^2 ...": OF_THE_USER,
    "rad/s per unit": OF_THE_USER, "N/m": "cables have any stiffness",
    "kg": Rule(lambda scene, p: vehicles.dry_mass(p), "that is more than the vehicle, which includes it"),
    "m2": Rule(lambda scene, p: 10.0 * volume(scene, p) ** (2.0 / 3.0), "that is ten times the hull: are cm2 given for m2?"),
    "1/rad": _same(20.0, "thin wings have 2 pi at most; per degree it would be a hundredth"),
    "W": _same(1e6, "that is a ship's engine: are mW given for W?"),
    "1/m": _same(0.05, "the sharpest haloclines change the density by some per cent in a metre"),
    "rad/s": _same(100.0, "no fin turns so fast: are degrees given for radians?"),
    "N s^1/2": FORCE, "N m s^1/2": MOMENT,
}  # fmt: skip
BY_NAME: dict[str, Rule | str] = {
    "current_profile.depths": ELSEWHERE, "floor.depth": ELSEWHERE,
    "hull_loads.stations": ELSEWHERE, "hull_loads.diameters": ELSEWHERE, "hull_loads.added_mass": ELSEWHERE,
    "cross_flow.stations": ELSEWHERE, "cross_flow.diameters": ELSEWHERE, "waves.amplitudes": ELSEWHERE,
    "current.velocity": ELSEWHERE, "current_profile.velocities": ELSEWHERE, "current_harmonics.amplitudes": ELSEWHERE,
    "gauss_markov_current.standard_deviation": ELSEWHERE, "control_fins.limit": ELSEWHERE, "quadratic_form.values": ELSEWHERE,
    "control_fins.command": ELSEWHERE, "control_fins.command_schedule": ELSEWHERE,
    "current_field.velocities": "its data set tells its own unit, which is converted", "current_field.origin": ANY_PLACE,
    "current_field.spacing": ANY_PLACE, "current_field.scenario": "the number of one", "control_fins.lift_angles": ANY_ANGLE,
    "waves.phases": ANY_ANGLE, "current_harmonics.phases": ANY_ANGLE, "tether.anchor": ANY_PLACE,
    "tether.rest_length": ANY_PLACE,
    "control_wrench.limit": OF_THE_VEHICLE, "control_wrench.rate_limit": OF_THE_VEHICLE, "drag.linear": OF_THE_VEHICLE,
    "drag.quadratic": OF_THE_VEHICLE, "drag_matrix.linear": OF_THE_VEHICLE, "drag_matrix.quadratic": OF_THE_VEHICLE,
    "body_lift.matrix": OF_THE_VEHICLE,
    "fins.chord": DIRECTION, "fins.normal": DIRECTION, "control_fins.chord": DIRECTION, "control_fins.normal": DIRECTION,
    "thrusters.direction": DIRECTION,
    "surface.depth": ANY_PLACE, "box.lower": ANY_PLACE, "box.upper": ANY_PLACE, "floor.origin": ANY_PLACE,
    "floor.spacing": ANY_PLACE, "floor.clearance": ANY_PLACE, "battery.capacity": "batteries have any size",
}  # fmt: skip


def rule_of(kind: Any, item: Any) -> Rule | str | None:
    """The rule of a number of a term's class, or the reason why it has none; None if neither is defined."""
    said = kind.usual.get(word_of(item), kind.usual.get(""))
    if said is not None:
        return said if isinstance(said, str) else _same(*said)
    return BY_NAME.get(f"{kind.type}.{word_of(item)}", BY_UNIT.get(item.metadata["unit"]))


# Of an actuator the schedule is read where it holds no command, and neither where a controller drives it.
COMMANDS = ("command", "command_schedule")


def sizes(scene: SceneLike, p: Numbers) -> Iterator[OddityCheck]:
    """Look for numbers of terms that are larger than their rule allows."""
    for term in scene.terms:
        if type(term).__module__.startswith("lgvi_warp."):
            unread = COMMANDS if term.driver else COMMANDS[getattr(term, "holds", False) :][:1]
            for item in term.number_fields():
                rule, name = rule_of(type(term), item), f"{term.key}.{word_of(item)}"
                if isinstance(rule, Rule) and name in p and word_of(item) not in unread:
                    values, most, unit = p[name], rule.largest(scene, p), item.metadata["unit"]
                    # Limits that actuators need not have are this large where there are none.
                    beyond = UNLIMITED if "limit" in item.name else np.inf
                    size = np.abs(values).reshape(len(values), -1).max(axis=1, initial=0.0)
                    size, most = np.broadcast_arrays(np.where(size < beyond, size, 0.0), most)
                    yield name, size > most * (1.0 + 1e-9), _text(size, unit, most, rule.why)


def _text(size: np.ndarray, unit: str, most: np.ndarray, why: str) -> Callable[[int], str]:
    return lambda i: f"{size[i]:.4g} {unit} is beyond {most[i]:.3g}: {why}"


PUSH = "a thruster that makes {:.3g} N is beyond {:.3g} N, a hundred times the weight: a unit?"


def thrusts(scene: SceneLike, p: Numbers) -> Iterator[OddityCheck]:
    """Look for thrusters whose thrust at the limit or at constant commands exceeds a hundred times the weight."""
    for term in scene.terms:
        if not isinstance(term, Thrusters):
            continue
        numbers = own_numbers(term, p)
        most = _forces(scene, p)
        command = np.where(numbers["limit"] < UNLIMITED, numbers["limit"], 0.0)
        if term.driver is None:
            held = numbers["command"] if term.holds else np.abs(numbers["command_schedule"]).max(axis=1)
            command = np.maximum(command, np.abs(held))
        size, most = np.broadcast_arrays(term.largest_thrust(numbers, command), most)

        def text(i: int, size: Any = size, most: Any = most) -> str:
            return PUSH.format(size[i], most[i])

        yield f"{term.key}.coefficient", size > most * (1.0 + 1e-9), text


BLOCKED = "{:g} of the waves cannot travel against the current, and are left out: a period, a heading or a current?"
# Times the volume or the added mass of the vehicle that strips may have.
MANY = 3.0
STRIPS = "its strips have {:.3g} times {}, {:.3g} {}: a unit, or another vehicle?"


def steepness(scene: SceneLike, p: Numbers) -> Iterator[OddityCheck]:
    """Look for waves that would break, and for waves that a current blocks."""
    for term in _waves(scene, p):
        steep, blocked = term.steepness(own_numbers(term, p), p), term.wave_table(own_numbers(term, p), p).blocked
        yield f"{term.key}.{term.height_field}", steep > term.breaks, _worded(term.too_steep.format, steep, term.breaks)
        count = blocked.sum(axis=1)
        yield f"{term.key}.{term.periods_field}", count > 0, _worded(BLOCKED.format, count)


def _worded(say: Callable[..., str], values: np.ndarray, *more: float) -> Callable[[int], str]:
    """A function that returns the text for a member's value."""
    return lambda i: say(float(values[i]), *more)


def _waves(scene: SceneLike, p: Numbers) -> list[WaveTerm]:
    """The waves of a scene that has gravity."""
    return [term for term in scene.terms if isinstance(term, WaveTerm) and np.all(p["environment.gravity"] > 0.0)]


# Fields of terms that hold velocities of water [m/s].
CURRENTS = {
    "current": "velocity", "current_profile": "velocities", "current_harmonics": "amplitudes",
    "gauss_markov_current": "standard_deviation",
}  # fmt: skip
# Part of the orbit from which on it is said.
SHIFTED = 1e-3
DOPPLER = (
    "periods and lengths are not shifted (Doppler) by a current that varies: k U / omega is up to {:.2g}, "
    "so orbits in the moving water are off by {}"
)


def doppler(scene: SceneLike, p: Numbers) -> Iterator[OddityCheck]:
    """Look for waves in a varying current, whose orbits change by the factor 1 / (1 - k U / omega)."""
    fields = CURRENTS | {"current_field": "velocities"}
    varying = (term for term in scene.terms if term.type in fields and not term.carries)
    flows = [p[f"{term.key}.{fields[term.type]}"] for term in varying]
    for term in _waves(scene, p) if flows else ():
        c = term.wave_table(own_numbers(term, p), p)
        ratio = np.zeros(1)
        for flow in flows:
            rows = flow.reshape(len(flow), -1, 3)
            u, v = (rows[..., i, None] for i in (0, 1))
            if rows.shape[1] > MOST_ROWS:  # of a field its corners bound it
                u, v = (np.stack([each.min(axis=1), each.max(axis=1)], axis=1) for each in (u, v))
            ratio = ratio + _largest(c.north[:, None] * u + c.east[:, None] * v) / c.omega
        ratio = _largest((ratio * (c.amplitude > 0.0))[:, :, None])[:, 0]
        yield f"{term.key}.{term.periods_field}", np.abs(ratio) > SHIFTED, _worded(_shift, ratio)


MOST_ROWS = 10_000


def _largest(values: np.ndarray) -> np.ndarray:
    """Values (n, k) of the largest size along the middle axis of (n, r, k)."""
    return np.take_along_axis(values, np.abs(values).argmax(axis=1)[:, None], axis=1)[:, 0]


def _shift(ratio: float) -> str:
    return DOPPLER.format(ratio, f"{100.0 * (1.0 / (1.0 - ratio) - 1.0):+.2g} %" if ratio < 1.0 else "any amount")


def strips(scene: SceneLike, p: Numbers) -> Iterator[OddityCheck]:
    """Look for strips whose total volume or added mass is much larger than that of the vehicle."""
    both = "vehicle.added_mass" in p
    added = np.einsum("nii->ni", p["vehicle.added_mass" if both else "vehicle.added_mass_matrix"])[:, 1:3].max(axis=1)
    for term in scene.terms:
        if not isinstance(term, StripTerm):
            continue
        x, D = p[f"{term.key}.stations"], p[f"{term.key}.diameters"]
        a = p.get(f"{term.key}.added_mass")
        area = 0.25 * np.pi * (D[:, 1:] ** 2 + D[:, 1:] * D[:, :-1] + D[:, :-1] ** 2) / 3.0
        hull = (area * np.diff(x)).sum(axis=1)
        water = (
            p["environment.water_density"] * hull
            if a is None
            else (0.5 * (a[:, 1:] + a[:, :-1]) * np.diff(x)).sum(axis=1)
        )
        pairs = {"diameters": (hull, volume(scene, p), "the vehicle's volume", "m3")}
        if term.type == "hull_loads":
            pairs["added_mass"] = water, np.where(added > 0.0, added, np.inf), "its added mass across", "kg"
        for field, (size, own, whose, unit) in pairs.items():
            size, own = np.broadcast_arrays(size, own)

            def text(i: int, size: Any = size, own: Any = own, whose: str = whose, unit: str = unit) -> str:
                return STRIPS.format(size[i] / own[i], whose, own[i], unit)

            yield f"{term.key}.{field}", size > MANY * own, text
