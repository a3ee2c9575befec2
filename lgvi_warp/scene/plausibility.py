# SPDX-License-Identifier: Apache-2.0
"""Checks for values that are possible but implausible, most often due to a wrong unit; messages name them.

Nothing is refused. Every check reads the numbers of many members at once, counts odd values and names the first member.
"""

from __future__ import annotations

import functools
import itertools
import math
import operator
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from lgvi_warp.common.places import FAR_FROM_ORIGIN, too_long
from lgvi_warp.physics import vehicle as vehicles
from lgvi_warp.physics.terms.base import Term, own
from lgvi_warp.physics.terms.control_fins import ControlFins
from lgvi_warp.physics.terms.quadratic_form import QuadraticForm, drives
from lgvi_warp.physics.terms.strips import StripTerm
from lgvi_warp.physics.terms.surface_level import rise_at_start
from lgvi_warp.physics.terms.waves import WaveTerm
from lgvi_warp.sampling.members import Members
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.like import SceneLike
from lgvi_warp.scene.oddities import Oddities, OddityCheck, gathered
from lgvi_warp.scene.slices import over_members
from lgvi_warp.scene.term_limits import CURRENTS, doppler, hull_length, sizes, steepness, strips, thrusts

Numbers = Mapping[str, np.ndarray]


class Limit(NamedTuple):
    """A bound beyond which a value is odd."""

    value: float
    unit: str
    reason: str


ABOVE = "depth is positive down; above the surface there is no water, which this model does not know"
LIMITS = {
    "net weight": Limit(0.5, "of the weight", "vehicles are trimmed to some per cent; drop weights make some tens"),
    "light water": Limit(100.0, "kg/m3", "water has 1,000 or a little more; 1.025 would be in g/cm3"),
    "heavy water": Limit(3000.0, "kg/m3", "brine has 1,300, mud 2,000; 1,025,000 would be in g/m3"),
    "current": Limit(5.0, "m/s", "the strongest tides through straits; knots are half of m/s"),
    "fin angle": Limit(math.pi / 2.0, "rad", "a fin across the flow; 20 would be in degrees"),
    "speed": Limit(30.0, "m/s", "the fastest torpedoes without a cavity; km/h or mm/s would be more"),
    "depth": Limit(0.0, "m", ABOVE),
    "height": Limit(0.1, "m", "members that rise so far above the mean surface on the way are counted"),
}
# Most numbers of samples that are looked at after a run; where there are more, only the last time is.
MOST_SAMPLES = 30_000_000


# Texts of oddities, for the numbers of a member.
FAST = f"a current of {{:.4g}} m/s is beyond the {LIMITS['current'].value:g} m/s of the strongest tides: a unit?"
FAR = "an angle of {:.4g} rad is beyond 90 degrees: is it given in degrees?"
SHALLOW = ("a depth of {:.4g} m is within one hull length, {:.3g} m, of a surface with waves: where the hull leaves the water "
           "is known to the event surface and the term surface_buoyancy alone")  # fmt: skip
BEYOND = "the start is {:.4g} m beyond this event: the member stops before its first step. Start it before the event"
HIGH = "a depth of {:.4g} m is above the surface: depth is positive down"
FAR_AWAY = ("a place is {:.0f} km from environment.origin: lengths across the way to it are {:.2g} % too long there. Take an "
            "origin nearer to the mission")  # fmt: skip
LARGE = ("an inertia of {:.4g} kg m2 is beyond the {:.4g} kg m2 that the mass allows within the {:.4g} m of the hull's "
         "stations: a unit?")  # fmt: skip

DRIVES = "{} is {{:.4g}}, and pushes the vehicle on as it moves: drag and damping are below 0, a sign?"
TWICE = "brakes the hull across the flow where {} does: its drag counts twice"

UNREAD = "no law of the controller reads the wanted {0}. Add one that does, or it has no effect"
UNDRIVEN = "no allocation, schedule or command drives it. Name it in controller.allocation, or give it a command"
UNASKED = "no law asks for a force or a moment that it makes, so it stays at rest. Add a law that does"


def _text(template: str, *numbers: np.ndarray) -> Callable[[int], str]:
    """A function that returns the text for a member, from its numbers."""
    return lambda i: template.format(*(values[i] for values in numbers))


def net_weight(scene: SceneLike, p: Numbers) -> Iterator[OddityCheck]:
    """Look for an implausible net weight; a vehicle that loses buoyancy above the surface may have any positive buoyancy."""
    weight, buoyancy = np.broadcast_arrays(vehicles.weight(p), p["vehicle.buoyancy"])
    net = weight - buoyancy

    def text(i: int) -> str:
        way = "down" if net[i] > 0.0 else "up"
        question = "is the mass in kg, and are weight and buoyancy in N" if buoyancy[i] else "is buoyancy [N] left out"
        return f"the net weight, {abs(net[i]):.4g} N {way}, is beyond half the weight, {weight[i]:.4g} N: {question}?"

    size = np.maximum(net, 0.0) if floats(scene) else np.abs(net)
    yield "vehicle.buoyancy", size > LIMITS["net weight"].value * weight, text


def density(scene: SceneLike, p: Numbers) -> Iterator[OddityCheck]:
    """Look for a density that water cannot have."""
    rho = p["environment.water_density"]
    odd = (rho < LIMITS["light water"].value) | (rho > LIMITS["heavy water"].value)
    yield "environment.water_density", odd, _text("{:.6g} kg/m3 is not water, which has 1,000 or more: a unit?", rho)


def currents(scene: SceneLike, p: Numbers) -> Iterator[OddityCheck]:
    """Look for currents that are faster than any tide."""
    for term in scene.terms:
        field = CURRENTS.get(term.type)
        if field is None:
            continue
        values = p[f"{term.key}.{field}"]
        speed = np.sqrt(np.square(values).sum(axis=-1)).reshape(len(values), -1).max(axis=1)
        yield f"{term.key}.{field}", speed > LIMITS["current"].value, _text(FAST, speed)


def fin_angles(scene: SceneLike, p: Numbers) -> Iterator[OddityCheck]:
    """Look for fins that turn beyond 90 degrees, by their limit or by their command."""
    for term in scene.terms:
        if not isinstance(term, ControlFins):
            continue
        angles = {"limit": p[f"{term.key}.limit"]}
        if not term.driver:
            field = "command" if term.holds else "command_schedule"
            angles[field] = p[f"{term.key}.{field}"]
        for field, values in angles.items():
            angle = np.abs(values).reshape(len(values), -1).max(axis=1)
            yield f"{term.key}.{field}", angle > LIMITS["fin angle"].value * (1.0 + 1e-9), _text(FAR, angle)


def depths(scene: SceneLike, p: Numbers) -> Iterator[OddityCheck]:
    """Look for depths above the surface: most likely they are heights.

    A table of depths is odd if it begins above the surface and holds no depth below it.
    """
    for term in scene.parts:
        if field := term.depth_field:
            values, surface = p[f"{term.key}.{field}"], LIMITS["depth"].value
            values = values.reshape(len(values), -1)
            odd = (values.min(axis=1) < surface) & (values.max(axis=1) <= surface)
            yield f"{term.key}.{field}", odd, _text(HIGH, values.min(axis=1))


def inertia(scene: SceneLike, p: Numbers) -> Iterator[OddityCheck]:
    """Look for inertia that a body of this mass and length cannot have.

    The length is that of the hull's stations. Within a length L along x and a breadth D, the variance of a coordinate is
    at most a quarter of its range squared (Popoviciu 1935). The rigid body's inertia is therefore at most m (L^2 + D^2)/4.
    Added inertia is that of strips: at most the added mass times the largest distance squared.
    """
    for term in scene.terms:
        if isinstance(term, StripTerm):
            x, breadth = p[f"{term.key}.stations"], p[f"{term.key}.diameters"].max(axis=1)
            rigid = vehicles.dry_mass(p) * ((x[:, -1] - x[:, 0]) ** 2 + breadth**2) / 4.0
            arm = np.abs(x).max(axis=1) ** 2 + breadth**2 / 4.0
            yield from _inertia(p, rigid, arm, x[:, -1] - x[:, 0])


def _inertia(p: Numbers, rigid: np.ndarray, arm: np.ndarray, length: np.ndarray) -> Iterator[OddityCheck]:
    """Compare the largest moment of inertia about a body axis with its limit; the largest principal moment is not less."""
    both = "vehicle.inertia" in p
    name = "vehicle.inertia" if both else "vehicle.rigid_body_mass_matrix"
    added = p["vehicle.added_mass" if both else "vehicle.added_mass_matrix"]
    strips = _diagonal(added)[:, :3].max(axis=1) * arm
    rigid_inertia = p[name] if both else vehicles.about_center(p[name])
    limits = {name: (_diagonal(rigid_inertia).max(axis=1), rigid + strips if both else rigid)}
    if not both:
        limits["vehicle.added_mass_matrix"] = _diagonal(added)[:, 3:].max(axis=1), strips
    for key, pair in limits.items():
        size, most, long = np.broadcast_arrays(*pair, length)
        yield key, size > most, _text(LARGE, size, most, long)


def _diagonal(matrices: np.ndarray) -> np.ndarray:
    return np.diagonal(matrices, axis1=1, axis2=2)


def actuators(scene: SceneLike, p: Numbers) -> Iterator[OddityCheck]:
    """Look for components that actuators cannot produce, wanted quantities that no law reads, and idle actuators."""
    controller = scene.controller
    if controller is None:
        return
    for part, wish in controller.unread(scene.terms):
        yield f"{part.key}.{wish}", np.array([True]), lambda i, wish=wish: UNREAD.format(wish)  # type: ignore[misc]
    for keys, text in ((controller.idle, UNASKED), (controller.undriven(scene.terms), UNDRIVEN)):
        for key in keys:
            yield key, np.array([True]), lambda i, text=text: text  # type: ignore[misc]
    missing = controller.unspanned
    text = f"actuators cannot make {', '.join(missing)} as the laws ask: the rest is reported to them as not delivered"
    yield "controller.allocation", np.array([bool(missing)]), lambda i: text


def hulls(scene: SceneLike, p: Numbers) -> Iterator[OddityCheck]:
    """Look for two terms with drag of the same part of a hull: `hull_loads` includes the drag of `cross_flow`."""
    terms = [term for term in scene.terms if isinstance(term, StripTerm)]
    for first, second in itertools.combinations(terms, 2):
        both = np.array(True)
        for term in (first, second):
            both = both & np.any(p[f"{term.key}.drag_coefficient"] * p[f"{term.key}.diameters"] > 0.0, axis=1)
        ends = [p[f"{term.key}.stations"] for term in (first, second)]
        common = np.minimum(ends[0][:, -1], ends[1][:, -1]) - np.maximum(ends[0][:, 0], ends[1][:, 0])
        yield f"{second.key}.drag_coefficient", both & (common > 0.0), _text(TWICE.format(first.key))


def driving(scene: SceneLike, p: Numbers) -> Iterator[OddityCheck]:
    """Look for products of velocities that accelerate a vehicle; published drag and damping coefficients are negative."""
    for term in scene.terms:
        if isinstance(term, QuadraticForm):
            for along, places in drives(term.forms).items():
                sums = p[f"{term.key}.values"][:, places].sum(axis=1)
                yield f"{term.key}.values", sums > 0.0, _text(DRIVES.format(along), sums)


def remarks(scene: SceneLike, p: Numbers) -> Iterator[OddityCheck]:
    """Collect the remarks of terms on their own numbers."""
    for term in (*scene.terms, *scene.events):
        for text in term.remarks:
            yield term.key, np.array([True]), lambda i, text=text: text  # type: ignore[misc]


def waypoints(scene: SceneLike, p: Numbers) -> Iterator[OddityCheck]:
    """Look for waypoints so far from the origin that the flat map distorts distances."""
    if scene.environment.origin is not None:
        for term in (term for term in scene.parts if term.type == "waypoints"):
            points = p[f"{term.key}.points"]
            yield _far_away(f"{term.key}.points", np.hypot(points[..., 0], points[..., 1]).max(axis=1))


def _far_away(key: str, distance: np.ndarray) -> OddityCheck:
    """Check distances (n,) [m] from the origin of the map for large values."""
    return key, distance > FAR_FROM_ORIGIN, _text(FAR_AWAY, distance / 1e3, 100.0 * too_long(distance))


# Checks of every member before a run.
OF_NUMBERS = (
    waypoints, net_weight, density, currents, fin_angles, depths, inertia, hulls, actuators, driving, remarks,
    steepness, doppler, strips, thrusts, sizes,
)  # fmt: skip


def of_numbers(
    scene: SceneLike,
    p: Numbers,
    first: int,
    stop: int,
    once: Callable[[Any, Any, Callable[[Any], Any]], Any] = lambda key, numbers, compute: compute(numbers),
) -> Oddities:
    """Return the odd parameters of some members; `once` may cache computations of numbers that all members share."""
    with np.errstate(all="ignore"):
        checked = [once(check, p, functools.partial(_checked, check, scene)) for check in OF_NUMBERS]
        return gathered(itertools.chain(*checked), first, stop)


def _checked(
    check: Callable[[SceneLike, Numbers], Iterator[OddityCheck]], scene: SceneLike, p: Numbers
) -> list[OddityCheck]:
    return list(check(scene, p))


def of_ensemble(ensemble: Ensemble) -> Oddities:
    """Return the odd parameters and starts of all members."""

    def look(first: int, stop: int) -> Oddities:
        members = ensemble.select(first, stop)
        with np.errstate(all="ignore"):
            begun = gathered(beyond(ensemble.scene, members), first, stop)
        return (
            of_numbers(ensemble.scene, members.parameters, first, stop)
            | of_start(ensemble.scene, members, first)
            | begun
        )

    return functools.reduce(operator.or_, over_members(look, ensemble.members))


def of_start(scene: SceneLike, members: Members, first: int = 0) -> Oddities:
    """Return the odd starts of some members, and odd water velocities of user-defined terms at these starts."""
    with np.errstate(all="ignore"):
        return gathered(_of_start(scene, members), first, first + members.count)


def _of_start(scene: SceneLike, members: Members) -> Iterator[OddityCheck]:
    speed = _speed(members.velocity)
    depth = members.position[:, 2] + rise_at_start(scene.terms, members.parameters)
    limit = LIMITS["speed"].value
    yield "start.velocity", speed > limit, lambda i: f"a speed of {speed[i]:.4g} m/s is beyond {limit:g} m/s: a unit?"
    if not ends_at_the_surface(scene) and not floats(scene):
        yield "start.position", depth < LIMITS["depth"].value, _text(HIGH, depth)
        if wave_periods(scene):
            length = hull_length(scene, members.parameters)
            yield "start.position", depth < length, _text(SHALLOW, *np.broadcast_arrays(depth, length))
    for term in scene.terms:
        for field, (odd, text) in term.odd_at(own(term, members.parameters), members.position).items():
            yield f"{term.key}.{field}", odd, _text(text, depth)
    if scene.environment.origin is not None:
        yield _far_away("environment.origin", np.hypot(members.position[:, 0], members.position[:, 1]))
    for term in own_flows(scene):
        numbers = own(term, members.parameters)
        water = term.water(numbers, members.position[None], np.zeros(1), members.parameters)
        if water is not None:
            flow = _speed(water[0])
            yield term.key, flow > LIMITS["current"].value, _text(FAST, flow)


def beyond(scene: SceneLike, members: Members) -> Iterator[OddityCheck]:
    """Look for members that start at or beyond a floor, the surface or a side of a box."""
    for event in scene.events:
        numbers, b = own(event, members.parameters), members.position
        if event.type == "floor":
            left = event.height(b, np.zeros(3), numbers)[0]
            left = np.where(
                b[:, 2] + left <= LIMITS["depth"].value, np.inf, left
            )  # `depths` tells of a floor above the sea
        elif event.type == "surface":
            left = b[:, 2] + rise_at_start(scene.terms, members.parameters) - numbers["depth"]
        elif event.type == "box":
            left = np.minimum(b - numbers["lower"], numbers["upper"] - b).min(axis=1)
        else:
            continue
        yield event.key, left <= 0.0, _text(BEYOND, np.abs(left))


def own_flows(scene: SceneLike) -> list[Term]:
    """The user-defined terms that move the water, without waves, in which water may be faster than in any current."""
    known = [term for term in scene.terms if term.type not in CURRENTS and not isinstance(term, WaveTerm)]
    return [term for term in known if type(term).water is not Term.water]


def wave_periods(scene: SceneLike) -> list[float]:
    """Return the period of the highest wave of each term that makes waves [s]."""
    periods = (term.period for term in scene.terms if isinstance(term, WaveTerm))
    return [period for period in periods if period is not None]


def ends_at_the_surface(scene: SceneLike) -> bool:
    """Return whether an event stops a member that rises through the surface."""
    boxes = (event.lower[2] for event in scene.events if event.type == "box")
    return any(event.type == "surface" for event in scene.events) or any(top >= 0.0 for top in boxes)


def floats(scene: SceneLike) -> bool:
    """Return whether the vehicle loses buoyancy above the surface."""
    return any(term.floats for term in scene.terms)


def on_the_way(samples: Mapping[str, np.ndarray]) -> Oddities:
    """Oddities that arose during the run in members with a plausible start, from samples in memory.

    samples: "velocity", (k, n, 3) [m/s]; the first sample is the start.
    """
    limit = LIMITS["speed"].value
    with np.errstate(all="ignore"):
        fast, speed = _later(samples.get("velocity"), limit)
    text: OddityCheck = (
        "velocity", fast, lambda i: f"{speed[i]:.4g} m/s on the way is beyond {limit:g} m/s: a unit, or the step?"
    )  # fmt: skip
    return gathered([text], 0, len(fast))


def at_the_end(start: np.ndarray, speed: np.ndarray, first: int) -> Oddities:
    """Members that begin below the limit of speed and end beyond it.

    start: velocities (n, 3) [m/s] at the start. speed: (n,) [m/s] at the end, at least. first: index of the first member.
    """
    limit = LIMITS["speed"].value
    with np.errstate(all="ignore"):
        fast = (speed > limit) & (_speed(start) < limit)
    text: OddityCheck = (
        "velocity", fast, lambda i: f"{speed[i]:.4g} m/s or more at the end is beyond {limit:g} m/s: a unit, or the step?"
    )  # fmt: skip
    return gathered([text], first, first + len(fast))


def _later(samples: np.ndarray | None, limit: float) -> tuple[np.ndarray, np.ndarray]:
    """Return for each member (n,) whether its speed exceeded the limit only after the start, and its largest speed."""
    if not isinstance(samples, np.ndarray) or len(samples) < 2:
        return np.zeros(0, dtype=bool), np.zeros(0)
    times = range(1, len(samples)) if samples.size <= MOST_SAMPLES else range(len(samples) - 1, len(samples))
    if all(_no_speed_above(samples[time]) < limit for time in times):
        return np.zeros(samples.shape[1], dtype=bool), np.zeros(0)
    largest = np.full(samples.shape[1], -np.inf)
    for time in times:
        np.fmax(largest, _speed(samples[time]), out=largest)
    return (_speed(samples[0]) < limit) & (largest > limit), largest


def _speed(velocity: np.ndarray) -> np.ndarray:
    return np.sqrt(np.einsum("ni,ni->n", velocity, velocity, dtype=np.float64))


def _no_speed_above(velocity: np.ndarray) -> float:
    return 2.0 * max(float(velocity.max()), -float(velocity.min()))
