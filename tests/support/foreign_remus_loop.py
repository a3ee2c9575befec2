# SPDX-License-Identifier: Apache-2.0
"""The vehicle of `foreign_remus` as a law of one's own, its depth filter as a guidance, and the scene of its loop.

`python -m tests.support.foreign_remus_loop` prints what differs between its loop and the package's.
"""

import functools
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

import lgvi_warp as lw
from benchmarks import foreign_remus as remus
from lgvi_kernels.lanes.held import held_command
from lgvi_kernels.law import (  # noqa: F401
    absolute,
    add,
    add_outer,
    arctangent2,
    clamp,
    cross,
    div,
    dot,
    exponential,
    lane,
    lane3,
    mul,
    neg,
    ones,
    positive,
    remember,
    remembered,
    root,
    struct,
    sub,
    to_body,
    vec3,
)

# Numbers of the law, in the order of its struct; they are those of the NumPy loop.
NUMBERS = {
    **{f"linear{i}": remus.LINEAR[i] for i in range(6)}, "fading": remus.FADING,
    "pressure": 0.5 * remus.DENSITY * remus.AREA, "drag": remus.DRAG, "slope": remus.SLOPE, "induced": remus.INDUCED,
    "cross": remus.CROSS, "half": -remus.STRIPS[0], "strip": remus.STRIPS[1] - remus.STRIPS[0],
    "added_ahead": remus.ADDED[0, 0], "added_across": remus.ADDED[1, 1], "rudder": remus.RUDDER, "planes": remus.PLANES,
    "place": remus.FIN_PLACE, "limit": remus.FIN_LIMIT, "fin_rate": 1.0 / remus.FIN_LAG, "thrust": remus.THRUST,
    "thrust_loss": remus.THRUST_LOSS, "torque": remus.TORQUE, "torque_loss": remus.TORQUE_LOSS,
    "revolutions": remus.REVOLUTIONS, "revolutions_rate": 1.0 / remus.PROPELLER_LAG,
}  # fmt: skip
STRIPS = len(remus.STRIPS)


def params(width, real, commands):
    """Params: the numbers; the body's axes and origin; the current, inertial; the rows of rudder, planes, revolutions."""
    vectors = dict.fromkeys(("ahead", "side", "below", "origin", "current"), lane3(width, real))
    rows = {"memory": wp.int32, "commands": commands, "report": wp.int32}
    return struct("ForeignRemus", **dict.fromkeys(NUMBERS, lane(width, real)), **vectors, **rows)


@wp.func
def pairs(D: Any, p: Any, c: Any, force: Any, velocity: Any):
    """A force along one body axis at the body's origin for each unit of the velocity there along another: -c."""
    return add_outer(D, c * force, c * cross(p.origin, force), velocity, cross(p.origin, velocity))


@wp.func
def force_by_rate(D: Any, p: Any, c: Any, force: Any, rate: Any):
    zero = rate - rate
    return add_outer(D, c * force, c * cross(p.origin, force), zero, rate)


@wp.func
def torque_by_velocity(D: Any, p: Any, c: Any, torque: Any, velocity: Any):
    zero = torque - torque
    return add_outer(D, zero, c * torque, velocity, cross(p.origin, velocity))


@wp.func
def torque_by_rate(D: Any, c: Any, torque: Any, rate: Any):
    zero = torque - torque
    return add_outer(D, zero, c * torque, zero, rate)


@wp.func
def hull(D: Any, p: Any, u: Any, v: Any, w: Any, r: Any):
    """Linear damping, lift and drag of the hull, and cross flow."""
    tiny = u.dtype(1e-12) * ones(u)
    through = u * u + v * v + w * w
    fade = exponential(-(p.fading * root(through)))
    D = pairs(D, p, fade * p.linear0, p.ahead, p.ahead)
    D = pairs(D, p, fade * p.linear1, p.side, p.side)
    D = pairs(D, p, p.linear2, p.below, p.below)
    D = torque_by_rate(D, p.linear3, p.ahead, p.ahead)
    D = torque_by_rate(D, p.linear4, p.side, p.side)
    D = torque_by_rate(D, p.linear5, p.below, p.below)
    angle = arctangent2(w, u + tiny)
    size = p.pressure * (through / (root(u * u + w * w) + tiny))
    brake = size * (p.drag + p.induced * (angle * angle))
    lift = size * (p.slope * angle)
    D = pairs(D, p, brake, p.ahead, p.ahead)
    D = pairs(D, p, brake, p.below, p.below)
    D = pairs(D, p, -lift, p.ahead, p.below)
    D = pairs(D, p, lift, p.below, p.ahead)
    x = -p.half
    first = tiny - tiny
    second = first
    third = first
    for _ in range(wp.static(STRIPS)):
        flow = p.cross * absolute(v + x * r)
        first = first + flow
        second = second + x * flow
        third = third + x * (x * flow)
        x = x + p.strip
    D = pairs(D, p, first, p.side, p.side)
    D = force_by_rate(D, p, second, p.side, p.below)
    D = torque_by_velocity(D, p, second, p.below, p.side)
    return torque_by_rate(D, third, p.below, p.below)


@wp.func
def without_munk(D: Any, p: Any, u: Any, v: Any, w: Any):
    """Damping without the part of the added mass's Coriolis force that the other simulator lacks."""
    a = p.added_ahead * u
    b = p.added_across * v
    c = p.added_across * w
    D = force_by_rate(D, p, -c, p.ahead, p.side)
    D = force_by_rate(D, p, b, p.ahead, p.below)
    D = force_by_rate(D, p, -a, p.side, p.below)
    D = force_by_rate(D, p, a, p.below, p.side)
    D = torque_by_velocity(D, p, c, p.side, p.ahead)
    D = torque_by_velocity(D, p, -a, p.side, p.below)
    D = torque_by_velocity(D, p, -b, p.below, p.ahead)
    return torque_by_velocity(D, p, a, p.below, p.side)


@wp.func
def fins(D: Any, p: Any, u: Any, v: Any, w: Any, rudder: Any, planes: Any):
    """Lift by the angle alone, and drag by its square, where the flow is that in the plane of the fin's turning."""
    side = p.rudder * rudder
    rise = p.planes * planes
    D = pairs(D, p, side * rudder * u, p.ahead, p.ahead)
    D = pairs(D, p, side * rudder * v, p.ahead, p.side)
    D = pairs(D, p, rise * planes * u, p.ahead, p.ahead)
    D = pairs(D, p, rise * planes * w, p.ahead, p.below)
    D = pairs(D, p, side * u, p.side, p.ahead)
    D = pairs(D, p, side * v, p.side, p.side)
    D = torque_by_velocity(D, p, p.place * (side * u), p.below, p.ahead)
    D = torque_by_velocity(D, p, p.place * (side * v), p.below, p.side)
    D = pairs(D, p, rise * u, p.below, p.ahead)
    D = pairs(D, p, rise * w, p.below, p.below)
    D = torque_by_velocity(D, p, -(p.place * (rise * u)), p.side, p.ahead)
    return torque_by_velocity(D, p, -(p.place * (rise * w)), p.side, p.below)


@wp.func
def remus_damping(D: Any, view: Any, p: Any):
    """D (nu; Om): all that depends on velocities."""
    nu = view.nu + cross(view.Om, p.origin)
    u = dot(p.ahead, nu)
    v = dot(p.side, nu)
    w = dot(p.below, nu)
    D = hull(D, p, u, v, w, dot(p.below, view.Om))
    D = without_munk(D, p, u, v, w)
    D = fins(D, p, u, v, w, remembered(view, p.memory), remembered(view, p.memory + 1))
    # What the propeller loses goes with the speed over ground, whatever its direction: a matrix of the velocity along nu.
    ground = nu + to_body(view, p.current)
    over = root(dot(ground, ground)) / (dot(nu, nu) + view.h.dtype(1e-24) * ones(u))
    n = over * remembered(view, p.memory + 2)
    D = pairs(D, p, p.thrust_loss * n, p.ahead, nu)
    return torque_by_velocity(D, p, p.torque_loss * n, p.ahead, nu)


@wp.func
def remus_law(w: Any, view: Any, p: Any):
    """Thrust and torque of the propeller without advance."""
    n = remembered(view, p.memory + 2)
    force = (p.thrust * (n * n)) * p.ahead
    w.force = w.force + force
    w.torque = w.torque + cross(p.origin, force) + (p.torque * (n * n)) * p.ahead
    return w


@wp.func
def approach(view: Any, row: int, u: Any, rate: Any, limit: Any, length: Any):
    """x' = rate (u - x), stopped at its limit: exactly, where u is held."""
    x = u + exponential(-(length * rate)) * (remembered(view, row) - u)
    remember(view, row, clamp(x, -limit, limit))


@wp.func
def move(state: Any, view: Any, p: Any, length: Any):
    approach(view, p.memory, held_command(view, p.commands, 0), p.fin_rate, p.limit, length)
    approach(view, p.memory + 1, held_command(view, p.commands, 1), p.fin_rate, p.limit, length)
    approach(view, p.memory + 2, p.revolutions, p.revolutions_rate, p.revolutions, length)
    return state


@wp.func
def remus_evolve(state: Any, view: Any, p: Any):
    return move(state, view, p, view.h.dtype(0.5) * view.h)


@wp.func
def remus_follow(state: Any, view: Any, p: Any):
    return move(state, view, p, view.h)


@wp.func
def remus_report(state: Any, view: Any, p: Any):
    remember(view, p.report, remembered(view, p.memory))
    remember(view, p.report + 1, remembered(view, p.memory + 1))
    return state


class OnDevice:
    """Device code as a module of lgvi_kernels.laws would hold it."""

    params = staticmethod(functools.cache(params))
    law, damping = remus_law, remus_damping
    evolve, follow, report = remus_evolve, remus_follow, remus_report


@dataclass(frozen=True, eq=False, kw_only=True)
class ForeignRemus(lw.laws.Term):
    """The other simulator's hull, fins and propeller; it takes the commands of rudder and planes [rad]."""

    type: ClassVar[str] = "foreign_remus"
    device: ClassVar[Any] = OnDevice
    dissipative: ClassVar[bool] = False

    current: Any = lw.laws.number((3,), "m/s", (0.0, 0.0, 0.0))
    # Of the commands, as an allocation asks; what stops is the fin.
    limit: Any = lw.laws.number((2,), "rad", (1e6, 1e6))

    @property
    def channels(self) -> int:
        return 2

    @property
    def memory(self) -> bool:
        return True

    def packed(self, numbers, context):
        axes = {name: np.eye(3)[None, i] for i, name in enumerate(("ahead", "side", "below"))}
        vectors = {name: context.frame.vector(axis) for name, axis in axes.items()}
        vectors |= {"origin": context.frame.point(np.zeros((1, 3))), "current": numbers["current"]}
        values = {name: np.array([value]) for name, value in NUMBERS.items()}
        return lw.laws.Packed(values | vectors | self.driver.values_of(self.key), memory=np.zeros((1, 3)))


@wp.func
def filter_guide(r: Any, y: Any, p: Any):
    """x goes on before it is wanted, as the other simulator has it."""
    zero = p.depth - p.depth
    x = p.depth + exponential(-(y.period * p.rate)) * (remembered(y, p.memory) - p.depth)
    remember(y, p.memory, x)
    r.position = vec3(r.position.x, r.position.y, x)
    r.velocity = vec3(r.velocity.x, r.velocity.y, zero)
    return r


class FilterOnDevice:
    """A guidance."""

    guide = filter_guide

    @staticmethod
    @functools.cache
    def params(width, real):
        """Params: the numbers, and the row of x."""
        return struct("DepthFilter", depth=lane(width, real), rate=lane(width, real), memory=wp.int32)


@dataclass(frozen=True, eq=False, kw_only=True)
class DepthFilter(lw.laws.Guidance):
    """A wanted depth behind a first-order lag, from 0."""

    type: ClassVar[str] = "depth_filter"
    device: ClassVar[Any] = FilterOnDevice

    depth: Any = lw.laws.number((), "m")
    rate: Any = lw.laws.number((), "1/s", above=0.0)

    @property
    def gives(self):
        return ("depth",)

    def packed(self, numbers, context):
        return lw.laws.Packed(dict(numbers), memory=np.zeros((1, 1)))


def scene(depth: float, heading: float, sea: remus.Sea) -> lw.Scene:
    """The loop of the package: its depth law, sliding mode and reference model with the other simulator's numbers."""
    guidance = [
        lw.control.SetPoint(depth=depth, heading=heading),
        lw.control.ReferenceModel(natural_frequency=(1.0, 0.1), rate_limit=(1e3, np.radians(5.0))),
        DepthFilter(depth=depth, rate=0.02),
    ]
    depths = dict(kp=0.1, ki=0.001, pitch_limit=1e3, kp_pitch=5.0, ki_pitch=0.3, kd_pitch=2.0, k_heave=5.0)
    headings = dict(lambda_=0.1, boundary=0.1, k_sigma=0.05, k_d=0.5, nomoto_gain=0.25, nomoto_time=1.0)
    laws = [lw.control.DepthPID(**depths, anti_windup="none"), lw.control.HeadingSMC(**headings, anti_windup="none")]
    matrix = [[0, 0, 0, 0, 0, 1], [0, 0, 0, 0, -1, 0]]
    allocation = [lw.control.AllocationMatrix(to="foreign_remus", matrix=matrix)]
    controller = lw.Controller(period=remus.SAMPLE, guidance=guidance, laws=laws, allocation=allocation)
    vehicle = lw.Vehicle(
        rigid_body_mass_matrix=remus.RIGID, added_mass_matrix=remus.ADDED, weight=remus.WEIGHT, buoyancy=remus.WEIGHT
    )
    terms = [ForeignRemus(current=sea.velocity), lw.terms.Current(velocity=sea.velocity)]
    environment = lw.Environment(gravity=remus.GRAVITY, water_density=remus.DENSITY)
    return lw.Scene(vehicle, environment, terms, controller=controller)


WANTED = dict(depth=30.0, heading=np.radians(50.0))
TIME = 200.0
CALM, CURRENT = remus.Sea(), remus.Sea(0.5, np.radians(170.0))


def ours(sea: remus.Sea, method: str = "rk8", parts: int = 1, time: float = TIME) -> tuple[np.ndarray, np.ndarray]:
    """Positions (k, 3) [m] and headings (k,) [rad] of the package's loop at the ticks and at the end; parts: of a period."""
    save = lw.SaveAt(every=remus.SAMPLE)
    result = lw.solve(scene(**WANTED, sea=sea), method, h=remus.SAMPLE / parts, t1=time, save=save)
    assert result.status.counts() == {"ok": 1}
    ahead = result.attitude[:, 0, :, 0]
    return result.position[:, 0], np.arctan2(ahead[:, 1], ahead[:, 0])


def theirs(sea: remus.Sea, choices: remus.Choices, time: float = TIME) -> tuple[np.ndarray, np.ndarray]:
    """The same of the other simulator's loop."""
    position, angles = remus.simulate(**WANTED, time=time, sea=sea, choices=choices)
    return position, angles[:, 2]


def apart(single: tuple[np.ndarray, np.ndarray], compared: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """The largest differences of depth [m], of the place on the map [m] and of the heading [rad], (3,)."""
    step = single[0] - compared[0]
    turn = np.remainder(single[1] - compared[1] + np.pi, 2.0 * np.pi) - np.pi
    return np.array([np.abs(step[:, 2]).max(), np.linalg.norm(step[:, :2], axis=1).max(), np.abs(turn).max()])


# What is compared with the package's loop: words, the sea, how the other loop is run.
LINES = (
    ("as it is", CALM, remus.Choices()),
    ("its reference model exact", CALM, remus.Choices(model="exact")),
    *((f"and {parts} steps a period", CALM, remus.Choices(parts, model="exact")) for parts in (2, 4, 8)),
    ("rk4, its own reference model", CALM, remus.Choices(2, "rk4")),
    ("rk4, reference model exact", CALM, remus.Choices(2, "rk4", "exact")),
    ("as it is, in its current", CURRENT, remus.Choices()),
    ("rk4 and exact, in its current", CURRENT, remus.Choices(2, "rk4", "exact")),
    ("and the current with its part along z", CURRENT, remus.Choices(2, "rk4", "exact", level=False)),
)


def main() -> None:
    """Print the differences line by line."""
    loops = {sea: ours(sea) for sea in (CALM, CURRENT)}
    print(f"{'':40}  depth [m]    map [m]  heading [rad]")
    for words, sea, choices in LINES:
        depth, place, heading = apart(theirs(sea, choices), loops[sea])
        print(f"{words:40} {depth:10.2g} {place:10.2g} {heading:10.2g}")
    for parts in (1, 2, 4):
        depth, place, heading = apart(ours(CALM, "psi_x", parts), loops[CALM])
        print(f"{f'the package, psi_x, {parts} a period':40} {depth:10.2g} {place:10.2g} {heading:10.2g}")


if __name__ == "__main__":
    main()
