# SPDX-License-Identifier: Apache-2.0
"""Evaluation of a single part of a controller at random ticks, with numbers packed as for a run, for check_controller."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from lgvi_kernels import built_in
from lgvi_kernels.advance import examine_part
from lgvi_kernels.advance.examine_part import OUT_FIELDS, TICK_FIELDS, make_examine_part
from lgvi_kernels.maps.in_turn import ROLES
from lgvi_warp.checks.bench import Device, TermBench, packing_context, short, sizes
from lgvi_warp.common.machine import register_width
from lgvi_warp.control.base import Part
from lgvi_warp.control.gain_tables import packed_with_tables
from lgvi_warp.engine import kernel_choice
from lgvi_warp.engine.arrays import Lanes, memory_rows, put_rows
from lgvi_warp.physics import notation
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene

# Steps between two ticks, and how many ticks follow one another.
EVERY, TICKS = 10, 4
# Rows behind those of the part, which it must not touch.
GUARD = 16
# Times that all packets are evaluated for a timing, and timings of which the least counts.
REPEATS, ROUNDS = 400, 7
REMEDY = (
    "return what the role was given; name fields as Measurement, Reference, Wrench and params() do; import the operators of "
    "lanes that are used; no `if` on a lane, no plain number times a lane: docs/develop/add_a_controller.md"
)
# Column of the wanted speed.
SPEED = examine_part.SPEED
# First columns of the vectors of a tick, by group and name.
COLUMNS = {
    (group, name): 3 * i
    for i, (group, name) in enumerate(
        (group, name)
        for group, names in (
            ("measured", examine_part.MEASURED), ("wanted", examine_part.WANTED), ("demanded", examine_part.DEMANDED)
        )
        for name in names
    )
}  # fmt: skip


@dataclass(frozen=True)
class RandomTicks:
    """Measurements, references and demands before a part acts, at consecutive ticks.

    rows: (TICKS, k, TICK_FIELDS), the columns of `lgvi_kernels.advance.examine_part` for k members.
    bus: (k, rows), outputs of other parts in the first rows of the memory.
    """

    rows: np.ndarray
    bus: np.ndarray

    def vector(self, group: str, name: str) -> np.ndarray:
        """A vector of all ticks (TICKS, k, 3), as a view of the rows."""
        first = COLUMNS[group, name]
        return self.rows[..., first : first + 3]

    def attitude(self, group: str) -> np.ndarray:
        """The measured or reference attitude (TICKS, k, 3, 3), body to inertial axes."""
        return np.stack([self.vector(group, name) for name in ("north", "east", "down")], axis=-2)

    def elsewhere(self) -> RandomTicks:
        """The same ticks at another true position, which only sensors before the part may use."""
        rows = self.rows.copy()
        rows[..., examine_part.TRUE_POSITION :] += 17.0
        return replace(self, rows=rows)

    def but_lane(self, lane: int, width: int) -> RandomTicks:
        """Ticks in which all lanes of a packet change except one."""
        others = np.arange(self.rows.shape[1]) % width != lane
        rows, bus = self.rows.copy(), self.bus.copy()
        rows[:, others], bus[others] = np.roll(rows, 1, axis=1)[:, others] + 0.5, bus[others] + 0.5
        return replace(self, rows=rows, bus=bus)

    def description(self, i: int) -> str:
        """Describe the first tick of a member in words, for a message."""
        place, wanted, velocity, rate = (
            self.vector(*name)[0, i]
            for name in (("measured", "position"), ("wanted", "position"), ("measured", "velocity"),
                         ("measured", "angular_velocity"))
        )  # fmt: skip
        turn = notation.quaternion_from_matrix(self.attitude("measured")[0, i])
        where = f"at position {short(place)} m, quaternion {short(turn)}, velocity {sizes(velocity)} m/s"
        return f"{where}, rate {sizes(rate)} rad/s, wanted position {short(wanted)} m"


class Answers(NamedTuple):
    """Output of a part over ticks.

    ticks: (k, TICKS * OUT_FIELDS), measurements, references and demands after the part has acted.
    memory: (k, rows), the bus, the part's rows and the guard rows after them, after the last tick.
    own: index of the part's first row, and of the row after its last.
    """

    ticks: np.ndarray
    memory: np.ndarray
    own: tuple[int, int]

    def all(self) -> np.ndarray:
        """Numbers that must not depend on the place of the part: (k, numbers)."""
        return np.concatenate([self.ticks, self.memory[:, : self.own[1]]], axis=1)


class PartBench(TermBench):
    """A part that is evaluated at random ticks, one `period` [s] apart, in packets of one register and of one vehicle."""

    def __init__(self, part: Part, scene: Scene, samples: int, seed: int):
        code = kernel_choice.device_module(part, part.device_in(False), built_in)
        module, width = kernel_choice.with_tables(part, code), register_width("float64")
        self.part, self.bus, self.period = part, part.bus, float(scene.controller.period)
        count = -(-samples // width) * width
        self.ticks = random_ticks(count, self.bus.rows, seed, scene.start.given()["position"])
        super().__init__(part, module, scene, count, seed, ROLES, (width, 1), make_examine_part, REMEDY)

    def packed(self, parameters: Mapping[str, np.ndarray] | None = None, elsewhere: bool = False) -> Any:
        """Packed numbers of the part; parameters: of the scene by name, each (1, ...) or (n, ...), default the part's."""
        numbers = self.parameters if parameters is None else parameters
        context = packing_context(numbers, self.count, self.seed, self.period / EVERY, elsewhere)
        return packed_with_tables(self.part, Ensemble.own(self.part, numbers), context)

    def answers(self, packed: Any, ticks: RandomTicks, width: int | None = None) -> Answers:
        """Let the part act at each tick, starting from its initial memory."""
        device = _PartDevice(self, packed, ticks, width or self.width)
        out = np.stack([device.tick(k) for k in range(TICKS)], axis=1)
        return Answers(out.reshape(self.count, -1), device.memory(), (self.bus.rows, device.end))

    def nanoseconds(self, packed: Any) -> float:
        """Processor time [ns] of the part for a member and a tick, minus that of a copying kernel; the smallest seen."""
        device, spent = _PartDevice(self, packed, self.ticks, self.width), []
        for acts in (1, 0):
            rounds = []
            for _ in range(ROUNDS):
                begin = time.process_time_ns()
                device.act(0, acts, REPEATS)
                rounds.append(time.process_time_ns() - begin)
            spent.append(min(rounds) / (REPEATS * self.count))
        return max(0.0, spent[0] - spent[1])


class _PartDevice(Device):
    """The arrays of a kernel for a part and its ticks."""

    def __init__(self, bench: PartBench, packed: Any, ticks: RandomTicks, width: int):
        super().__init__(bench, packed, width, OUT_FIELDS, GUARD, bench.bus.rows)
        self.ticks, self.period, self.end = ticks, bench.period, bench.bus.rows + memory_rows(packed)
        # Behind the part's rows are no numbers, so that what it reads or writes there shows.
        rows = self.laws.memory.view
        rows[:, self.end :] = np.nan
        put_rows(rows[:, : bench.bus.rows], ticks.bus)
        self.rows = Lanes(self.packets, TICK_FIELDS, self.kernel.Lane)

    def tick(self, k: int) -> np.ndarray:
        """Let the part act once, and return its output (count, OUT_FIELDS)."""
        put_rows(self.rows.view, self.ticks.rows[k])
        self.act(k, 1, 1)
        return self.written()

    def act(self, k: int, acts: int, repeats: int) -> None:
        """Let the part act `acts` times at tick k, in each of `repeats` repetitions."""
        self.launch(self.rows.array, k, k * EVERY, self.period / EVERY, self.period, acts, repeats=repeats)

    def memory(self) -> np.ndarray:
        """The memory without its backup: (count, rows)."""
        rows = self.laws.memory.view[:, : self.end + GUARD]
        return np.array(rows.transpose(0, 2, 1).reshape(-1, rows.shape[1]))


def random_ticks(count: int, bus: int, seed: int, around: np.ndarray) -> RandomTicks:
    """Random ticks around a position.

    around: (3,) [m], mean of the positions, whose standard deviation is 4 m.
    Returns: Any attitude; velocities [m/s], angular velocities [rad/s], demands [N, N m] and outputs of other parts of
        order 1.
    """
    rng = np.random.default_rng(seed)
    ticks = RandomTicks(rng.normal(size=(TICKS, count, TICK_FIELDS)), rng.normal(size=(count, bus)))
    for group in ("measured", "wanted"):
        place = ticks.vector(group, "position")
        place[...] = around + 4.0 * place
        turn(ticks, group, notation.matrix_from_quaternion(rng.normal(size=(TICKS, count, 4))))
    ticks.rows[..., examine_part.TRUE_POSITION :] = ticks.vector("measured", "position")
    return ticks


def turn(ticks: RandomTicks, group: str, attitude: np.ndarray) -> None:
    """Write an attitude (..., 3, 3), body to inertial axes, into ticks."""
    for i, name in enumerate(("north", "east", "down")):
        ticks.vector(group, name)[...] = attitude[..., i, :]


def corner_ticks(ticks: RandomTicks) -> list[RandomTicks]:
    """Ticks at which careless device code divides by zero.

    Returns: Three cases: the reference equals the measurement; the reference attitude is half a turn away; all is at
        rest, level, at the origin, without a demand.
    """
    same, turned, rest = (replace(ticks, rows=ticks.rows.copy(), bus=np.zeros_like(ticks.bus)) for _ in range(3))
    for name in ("position", "velocity", "angular_velocity"):
        same.vector("wanted", name)[...] = same.vector("measured", name)
    turn(same, "wanted", same.attitude("measured"))
    turn(turned, "wanted", turned.attitude("measured") @ np.diag([-1.0, -1.0, 1.0]))
    rest.rows[...] = 0.0
    for group in ("measured", "wanted"):
        turn(rest, group, np.eye(3))
    return [same, turned, rest]
