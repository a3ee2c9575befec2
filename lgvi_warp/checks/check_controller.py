# SPDX-License-Identifier: Apache-2.0
"""`check_controller`: check of a controller part's device code at random ticks, alone, in packets, and against a twin."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from lgvi_warp.checks.bench import MOST_SAMPLES, of_scene
from lgvi_warp.checks.part_bench import (
    COLUMNS,
    EVERY,
    OUT_FIELDS,
    SPEED,
    TICKS,
    Answers,
    PartBench,
    RandomTicks,
    corner_ticks,
)
from lgvi_warp.checks.report import (
    LANES_APART,
    ROUND_OFF,
    VARIED_NUMBERS,
    Check,
    LawReport,
    attempt,
    finite,
    first_wrong,
    judged,
    packed_numbers,
    unpacked,
)
from lgvi_warp.common.arguments import whole_number
from lgvi_warp.common.errors import SceneError, refusal
from lgvi_warp.common.sentences import capital
from lgvi_warp.control.base import SECTIONS, Allocation, MeasuringPart, Part
from lgvi_warp.control.controller import Controller
from lgvi_warp.control.heading_pid import HeadingPID
from lgvi_warp.control.set_point import SetPoint
from lgvi_warp.physics.terms.base import word_of
from lgvi_warp.physics.terms.control_wrench import ControlWrench
from lgvi_warp.scene.scene import Scene

# The rows of an attitude.
AXES = ("north", "east", "down")
# By how much a part's numbers differ from one member to the next.
OTHER = 1.125
TWIN_ROLES = ("measure", "guide", "control", "allocate")
# A twin computes in another order: so many times the roundings of a sum.
TWIN = 100.0
# Time between two ticks of a part that is checked without a controller [s].
PERIOD = 0.1


@dataclass(frozen=True)
class TwinMeasurement:
    """Motion that a twin reads at a tick, as in lgvi_warp.reference.control.

    position (3,) [m] inertial; R (3, 3) body to inertial; velocity over ground, water_velocity through water (3,) [m/s] and
    angular_velocity (3,) [rad/s], body axes; t, period, h [s]; step and tick: index of the next step, and of the tick.
    """

    position: np.ndarray
    R: np.ndarray
    velocity: np.ndarray
    water_velocity: np.ndarray
    angular_velocity: np.ndarray
    t: float
    period: float
    h: float
    step: int
    tick: int
    member: int


@dataclass(frozen=True)
class TwinReference:
    """Reference motion of a twin: position (3,) [m] and velocity (3,) [m/s], inertial; R (3, 3); speed ahead [m/s].

    angular_velocity (3,) [rad/s] and angular_acceleration (3,) [rad/s^2] in the axes of R.
    """

    position: np.ndarray
    velocity: np.ndarray
    R: np.ndarray
    angular_velocity: np.ndarray
    angular_acceleration: np.ndarray
    speed: float


def check_controller(
    part: Part, *, scene: Scene | None = None, twin: Any = None, samples: int = 64, seed: int = 0
) -> LawReport:
    """Check the device code of a part of a controller at random states of the motion, over four ticks for each member.

    The first check of a part compiles two small kernels. These properties are checked:

    * `packed` fills the fields that `params` names, and gives the same result in all axes that a method may choose.
    * Numbers are finite at random states, without a control error, with an error of half a turn, at rest, and with each
      number of the part at its bounds.
    * Lanes are independent: the output of a lane does not depend on the others, and equals that of a packet of one vehicle.
    * Numbers that vary by member have the same effect as shared numbers.
    * The part writes only its own rows of the memory. Only allocation and faults write commands.
    * The part uses measurements alone: nothing depends on the true position.
    * With `twin`, the output equals that of the twin at every tick.

    The last line of the report is the processor time per vehicle and tick.

    Args:
        part: a sensor, a guidance, a law, an allocation or a fault, built-in or written by the user.
        scene: scene with the vehicle, the actuators and, if the part needs other parts, a controller. The part is added to
            this controller, or replaces its part of the same name. None (default) for a simple vehicle with a
            `lw.terms.ControlWrench`.
        twin: an object with the same role for one vehicle in NumPy, as the parts in `lgvi_warp/reference/control`: some
            of `begin()`, `measure(y)`, `guide(r, y)`, `control(w, r, y, unmet)`, `allocate(w, actuators)`. Default None.
        samples: number of members (default 64), of four ticks each: any attitudes, positions some metres around the
            scene's start, velocities, angular velocities and demands of order 1.
        seed: seed of the random states (default 0).

    Returns:
        A report of all checks; `ok` is True if all passed.

    Raises:
        SceneError: if `part` is not a part or does not fit the scene, or its device code is incomplete, has a wrong
            signature or does not compile.
    """
    if not isinstance(part, Part) or part.section not in SECTIONS:
        remedy = "give an object such as lw.control.HeadingPID(kp=1.0), not its class; lw.laws.check_law checks terms"
        raise SceneError([f"part = {part!r} is not a part of a controller. {capital(remedy)}"])
    if twin is not None:
        roles = [role for role in TWIN_ROLES if callable(getattr(twin, role, None))]
        if not roles or isinstance(twin, type):
            raise refusal("twin", twin, "has no role", f"give an object with {', '.join(TWIN_ROLES)}, or leave it out")
    completed = _with_part(part, of_scene(scene))
    (wired,) = (candidate for candidate in completed.controller.parts if candidate.key == part.key)
    numbers = {name: np.asarray(value)[None] for name, value in wired.parameters().items()}
    wired = wired.with_features(frozenset(f"{part.key}.{word}" for word in wired.features(numbers)))
    bench = PartBench(
        wired, completed, whole_number("samples", samples, 1, MOST_SAMPLES), whole_number("seed", seed, 0)
    )
    with np.errstate(all="ignore"):  # what is not finite is found by its check
        packed, checks = packed_numbers(wired, bench.Params, bench.packed)
        if packed is None or not all(check.ok for check in checks):
            return LawReport(part, tuple(checks))
        here = attempt(lambda: bench.answers(packed, bench.ticks), "with shared numbers")
        if isinstance(here, str):
            return LawReport(part, (*checks, unpacked(here)))
        for examine in (_finite, _lanes, _packing, _memory, functools.partial(_twin, twin=twin)):
            checks += examine(bench, packed, here)
    text = "note: nanoseconds for a vehicle and a tick"
    checks.append(Check(f"{_name(bench)}: time", bench.nanoseconds(packed), np.inf, True, text))
    return LawReport(part, tuple(checks))


def _with_part(part: Part, scene: Scene) -> Scene:
    """Add the part to the scene's controller, with guidance, a law and an actuator if the scene has none."""
    controller = scene.controller
    if controller is None:
        lists: dict[str, list[Part]] = {section: [] for section in SECTIONS}
        if part.section != "guidance":
            lists["guidance"] = [SetPoint(name="other_guidance", position=(0.0, 0.0, 0.0), heading=0.0, speed=0.0)]
        elif "heading" not in part.gives:
            lists["guidance"] = [SetPoint(name="other_guidance", heading=0.0)]
        if part.section != "laws":
            lists["laws"] = [HeadingPID(name="other_law", kp=1.0)]
    else:
        # An allocation that the controller chose by itself has no name of its own, and follows again.
        lists = {section: [listed for listed in getattr(controller, section) if listed.type] for section in SECTIONS}
    same = [listed.key for listed in lists[part.section]]
    if part.key in same:
        lists[part.section][same.index(part.key)] = part
    else:
        lists[part.section].append(part)
    if isinstance(part, Allocation):
        others = [listed for listed in lists["allocation"] if isinstance(listed, Allocation) and listed.to != part.to]
        lists["allocation"] = [*others, part]
    terms = list(scene.terms)
    if not any(term.channels for term in terms):
        to = getattr(part, "to", "") or (getattr(part, "of", "") if part.section == "faults" else "")
        terms.append(ControlWrench(name=to or ""))
    period, delay = (controller.period, controller.delay) if controller is not None else (PERIOD, 0.0)
    return replace(scene, terms=terms, controller=Controller(period=period, delay=delay, **lists))


def _name(bench: PartBench) -> str:
    """Roles of the part, for the names of checks."""
    return ", ".join(bench.roles)


def _finite(bench: PartBench, packed: Any, here: Answers) -> Iterator[Check]:
    """Check that all numbers are finite; report a part without any effect."""
    name = f"{_name(bench)}: finite"
    at_random = finite(name, here.all(), bench.ticks)
    asleep = not _does(bench, here)
    note = "note: changes nothing at any tick, so little was checked. Give a scene in which it acts"
    yield at_random._replace(text=note) if asleep and at_random.ok else at_random
    corners = f"{name} without error, half a turn away, at rest"
    yield first_wrong(finite(corners, bench.answers(packed, ticks).all(), ticks) for ticks in corner_ticks(bench.ticks))
    bounds = _numbers_at_bounds(bench)
    if bounds:
        name = f"{name} at bounds of numbers"
        answers = attempt(
            lambda: bench.answers(bench.packed(bounds), bench.ticks).all(), "with numbers at their bounds"
        )
        remedy = "guard divisions and roots, or declare lw.laws.number(..., above=0.0)"
        yield finite(name, answers, bench.ticks, remedy)


def _does(bench: PartBench, here: Answers) -> bool:
    """Whether the part changes any number."""
    before = bench.ticks.rows[..., :OUT_FIELDS].transpose(1, 0, 2).reshape(bench.count, -1)
    return not np.array_equal(here.ticks, before) or not np.array_equal(
        here.memory[:, : bench.bus.rows], bench.ticks.bus
    )


def _numbers_at_bounds(bench: PartBench) -> dict[str, np.ndarray]:
    """Parameters with each number of the part at its lower bound, upper bound and own value; empty without bounds."""
    part, moved = bench.part, {}
    rng = np.random.default_rng(bench.seed)
    for item in part.number_fields():
        word, meta = word_of(item), item.metadata
        least, most = meta["least"], meta["most"]
        if word not in part.parameters() or meta["rising"] or not (np.isfinite(least) or np.isfinite(most)):
            continue
        value = np.repeat(bench.parameters[f"{part.key}.{word}"], bench.count, axis=0)
        chosen = rng.integers(3, size=bench.count)
        for i, bound in enumerate((least, most)):
            if np.isfinite(bound):
                value[chosen == i] = bound
        moved[f"{part.key}.{word}"] = value
    return {**bench.parameters, **moved} if moved else {}


def _lanes(bench: PartBench, packed: Any, here: Answers) -> Iterator[Check]:
    """Check that a lane's output does not depend on other lanes, nor on the true position, and is the same alone."""
    name, width = _name(bench), bench.width
    mixed = np.zeros_like(here.all())
    for stays in (0, width - 1):
        lane_that_stays = np.arange(bench.count) % width == stays
        mixed[lane_that_stays] += (bench.answers(packed, bench.ticks.but_lane(stays, width)).all() - here.all())[
            lane_that_stays
        ]
    yield judged(f"{name}: lanes apart", mixed, 0.0, bench.ticks, LANES_APART)
    alone = bench.answers(packed, bench.ticks, 1).all() - here.all()
    limit = ROUND_OFF * np.abs(here.all()).max()
    yield judged(f"{name}: packets of one", alone, limit, bench.ticks, LANES_APART)
    blind = bench.answers(packed, bench.ticks.elsewhere()).all() - here.all()
    yield judged(f"{name}: blind to the truth", blind, 0.0, bench.ticks, "read y.position, which is measured, not y.b")


def _packing(bench: PartBench, packed: Any, here: Answers) -> Iterator[Check]:
    """Check that the part is the same for shared and varied numbers, and in all axes."""
    names = [f"{bench.part.key}.{name}" for name in bench.part.parameters()]
    others = bench.parameters | {name: OTHER * bench.parameters[name] for name in names}
    odd = np.arange(bench.count) % 2 == 1
    varied = dict(bench.parameters)
    for name in names:
        value, changed = (np.repeat(numbers[name], bench.count, axis=0) for numbers in (bench.parameters, others))
        varied[name] = np.where(odd.reshape(-1, *(1,) * (value.ndim - 1)), changed, value)

    def by_member() -> np.ndarray:
        shared = np.where(odd[:, None], bench.answers(bench.packed(others), bench.ticks).ticks, here.ticks)
        return bench.answers(bench.packed(varied), bench.ticks).ticks - shared

    def in_other_axes() -> np.ndarray:
        return bench.answers(bench.packed(elsewhere=True), bench.ticks).ticks - here.ticks

    for words, compare, where, remedy in (
        ("varied numbers", by_member, "where numbers have one entry a member",
         VARIED_NUMBERS),
        ("any axes", in_other_axes, "in other axes of the body",
         "leave numbers as they are: a controller works in the user's axes"),
    ):  # fmt: skip
        name, difference = f"{_name(bench)}: {words}", attempt(compare, where)
        yield judged(name, difference, ROUND_OFF * np.abs(here.ticks).max(), bench.ticks, remedy)


def _memory(bench: PartBench, packed: Any, here: Answers) -> Iterator[Check]:
    """Check that only the part's rows and the commands change, and the commands only by allocation and faults."""
    bus, first, last = bench.bus, *here.own
    before = here.memory.copy()
    before[:, : bus.rows], before[:, last:] = bench.ticks.bus, np.nan
    may = np.zeros(before.shape[1], bool)
    may[first:last] = True
    if isinstance(bench.part, Allocation):
        row, count = bus.commands[bench.part.to]
        may[row : row + count] = True
    if bench.part.key in bus.ranges:
        may[bus.ranges[bench.part.key]] = True
    if "send" in bench.roles:
        may[: bus.channels] = may[bus.acting : bus.answer] = True
    sensor = getattr(bench.part, "sensor", None)
    if sensor is not None:
        for first_rows, many in ((bus.ranges, 1), (bus.handed, sensor.handed_rows)):
            may[first_rows.get(sensor.key, 0) :][: many if sensor.key in first_rows else 0] = True
    if isinstance(bench.part, MeasuringPart):
        row = bus.handed.get(bench.part.key, 0)
        may[row : row + bench.part.handed_rows * bench.part.is_handed] = True
        may[bus.belief : bus.belief + bench.part.belief_rows] = True
    if bench.part.iterates:
        may[bus.unconverged : bus.unconverged + 2] = True
    changed = (here.memory != before) & ~(np.isnan(here.memory) & np.isnan(before)) & ~may
    rows = sorted(set(np.flatnonzero(changed.any(axis=0)).tolist()))
    written = ", ".join(f"p.memory + {row - first}" for row in rows[:3])
    remedy = f"its rows are the {last - first} from p.memory on; it writes {written}"
    yield judged(f"{_name(bench)}: memory in its rows", changed.any(axis=1).astype(float), 0.0, bench.ticks, remedy)


def _twin(bench: PartBench, packed: Any, here: Answers, twin: Any) -> Iterator[Check]:
    """Compare with the twin's output at every tick of every member."""
    if twin is None:
        return
    wanted, commands = (
        np.stack(each) for each in zip(*(_of_twin(bench, twin, i) for i in range(bench.count)), strict=True)
    )
    row, count = bench.bus.commands[bench.part.to] if isinstance(bench.part, Allocation) else (0, 0)
    pairs = [("as the twin", here.ticks, wanted), ("commands of the twin", here.memory[:, row : row + count], commands)]
    for words, got, right in pairs[: 1 + bool(count)]:
        limit = TWIN * ROUND_OFF * max(np.abs(right).max(), np.abs(got).max())
        yield judged(f"{_name(bench)}: {words}", got - right, limit, bench.ticks, "the twin says otherwise")


def _of_twin(bench: PartBench, twin: Any, i: int) -> tuple[np.ndarray, np.ndarray]:
    """Output of the twin for the ticks of a member (TICKS * OUT_FIELDS,), and its last commands."""
    ticks, unmet, to = bench.ticks, bench.ticks.bus[i, bench.bus.unmet :][:6], getattr(bench.part, "to", "")
    actuator, out = SimpleNamespace(command=np.zeros(0)), ticks.rows[:, i, :OUT_FIELDS].copy()
    if isinstance(bench.part, Allocation):
        actuator.limit = bench.parameters[f"{to}.limit"][0]
    if hasattr(twin, "begin"):
        twin.begin()
    for k in range(TICKS):
        step = k * EVERY
        h = bench.period / EVERY
        y = TwinMeasurement(
            **_motion(ticks, "measured", k, i), t=step * h, period=bench.period, h=h, step=step, tick=k, member=i
        )
        r = TwinReference(**_motion(ticks, "wanted", k, i), speed=float(ticks.rows[k, i, SPEED]))
        w = np.concatenate([ticks.vector("demanded", name)[k, i] for name in ("force", "torque")])
        if "measure" in bench.roles:
            y = twin.measure(y)
        if "guide" in bench.roles:
            r = twin.guide(r, y)
        if "control" in bench.roles:
            w = twin.control(w, r, y, unmet)
        if "allocate" in bench.roles:
            w = twin.allocate(w, {to: actuator})
        for (group, name), first in COLUMNS.items():
            if group == "demanded":
                value = w[:3] if name == "force" else w[3:]
            else:
                motion: Any = y if group == "measured" else r
                value = motion.R[AXES.index(name)] if name in AXES else getattr(motion, name)
            out[k, first : first + 3] = value
        out[k, SPEED] = r.speed
    return out.reshape(-1), np.asarray(actuator.command)


def _motion(ticks: RandomTicks, group: str, k: int, i: int) -> dict[str, np.ndarray]:
    """Vectors of a tick of a member by name, with the attitude as R."""
    names = [name for of, name in COLUMNS if of == group and name not in AXES]
    return {name: ticks.vector(group, name)[k, i].copy() for name in names} | {"R": ticks.attitude(group)[k, i].copy()}
