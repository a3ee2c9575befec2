# SPDX-License-Identifier: Apache-2.0
"""Advance members by some steps from any motion and any memory; linear models and margins are built on this."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lgvi_warp.common.errors import refusal
from lgvi_warp.control.controller import Controller
from lgvi_warp.control.matrix import AllocationMatrix
from lgvi_warp.control.over_floor import seen_floors
from lgvi_warp.control.set_point import SetPoint
from lgvi_warp.control.state_feedback import StateFeedback
from lgvi_warp.engine.packets import Packets
from lgvi_warp.engine.work import unpacked
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.physics import notation
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.physics.terms.events import StopTime
from lgvi_warp.physics.terms.noisy import NoisyTerm
from lgvi_warp.physics.terms.waves import WaveTerm
from lgvi_warp.runs.request import Request
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene

# A time that no run reaches [s].
NEVER = 1e9
# Members that run together: their packets take some 100 MB.
AT_ONCE = 16_384
# Names of the motion's twelve coordinates about a given one.
COORDINATES = tuple(
    f"{name}[{i}]" for name in ("position", "rotation", "velocity", "angular_velocity") for i in range(3)
)

Watch = Callable[[int, Mapping[str, np.ndarray]], None]


@dataclass(frozen=True)
class Motion:
    """Motions of m members, shaped as in `lw.Start`, and their memory.

    memory: key of a term or a part -> (m, rows); the key "" is the controller's bus.
    """

    position: np.ndarray
    attitude: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    memory: Mapping[str, np.ndarray]

    def of(self, places: np.ndarray) -> Motion:
        """The motions of some members (k,)."""
        states: Any = {name: getattr(self, name)[places] for name in FIELDS}
        return Motion(**states, memory={key: rows[places] for key, rows in self.memory.items()})

    def copied_memory(self) -> dict[str, np.ndarray]:
        """Copy of the members' memory, which may be changed."""
        return {key: rows.copy() for key, rows in self.memory.items()}

    def moved(self, by: np.ndarray) -> Motion:
        """The motions, changed by small amounts.

        by: (m, 12): position [m], inertial axes; rotation vector [rad], body axes; velocity and angular velocity.
        """
        place, turn, velocity, rate = np.split(by, 4, axis=1)
        attitude = self.attitude @ notation.matrix_from_rotation_vector(turn)
        return replace(
            self, position=self.position + place, attitude=attitude, velocity=self.velocity + velocity,
            angular_velocity=self.angular_velocity + rate)  # fmt: skip

    def apart(self, others: Motion) -> np.ndarray:
        """Difference from other motions (m, 12), in the coordinates of `moved`."""
        R = np.swapaxes(others.attitude, 1, 2) @ self.attitude
        skew = 0.5 * np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1)
        sine = np.linalg.norm(skew, axis=1, keepdims=True)
        turn = skew * np.where(sine > 0.0, np.arcsin(np.minimum(sine, 1.0)) / np.where(sine > 0.0, sine, 1.0), 1.0)
        straight = ("position", "velocity", "angular_velocity")
        place, velocity, rate = (getattr(self, name) - getattr(others, name) for name in straight)
        return np.concatenate([place, turn, velocity, rate], axis=1)


class MotionBench:
    """A plan whose members start from any motion, with any memory, after any step but the first.

    Its kernel does not merge parts of successive steps, so its state between two launches is the motion itself.

    h: step [s]; None for the scene's step. t1: the longest run [s]. spacing: time between two samples [s]. The
    attribute `every` is the number of steps between two ticks, 1 without a controller.
    """

    def __init__(
        self, fleet: Ensemble, method: str | Method | None, h: float | None, t1: float, spacing: float,
        fields: Sequence[str] = FIELDS,
    ):  # fmt: skip
        request = Request(fleet, method, h, t1, SaveAt(every=spacing, fields=tuple(fields)), "float64")
        plan = request.plan()
        if plan.launches.has_callback:
            key = plan.kernel_choice.controller.callback.key  # type: ignore[union-attr]
            raise refusal("laws", key, "is a Python function, of which no lane knows", "give a law with device code")
        if plan.kernel_choice.lead is not None:
            scene: Any = fleet.scene
            # Kernels that look for events have no lead, and else the same method.
            fleet = fleet.in_scene(
                replace(scene, events=[*seen_floors(scene.controller, scene.events), StopTime(at=NEVER)])
            )
            plan = replace(request, fleet=fleet, method=plan.method).plan()
        plan.compile()
        self.fleet, self.plan = fleet, plan
        controller = plan.kernel_choice.controller
        self.bus = controller.bus if controller else None
        self.every = controller.every(plan.grid.h) if controller else 1

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the terms and the parts that act, and of the events, in the order of their rows."""
        choice = self.plan.kernel_choice
        return tuple(term.key for term, _ in (*choice.laws, *choice.parts_of_control, *choice.events))

    def start(self, places: np.ndarray) -> Motion:
        """The motions of members (m,) at t = 0, and their memory before the first tick."""
        packets = self._filled(places, None, {})
        start = packets.members
        states: Any = {name: getattr(start, name) for name in FIELDS}
        memory = self._memory(packets)
        packets.leave()
        return Motion(**states, memory=memory)

    def commanded(self, motion: Motion, commands: Mapping[str, np.ndarray]) -> Motion:
        """The motions with the actuators at given commands, key -> (m, channels)."""
        memory = motion.copied_memory()
        for key, (begin, count) in (self.bus.commands if self.bus else {}).items():
            if key in commands:
                memory[""][:, begin : begin + count] = commands[key]
                if key in memory:
                    memory[key][:, :count] = commands[key]
        return replace(motion, memory=memory)

    def run(
        self, places: np.ndarray, motion: Motion | None, k0: int, k1: int,
        numbers: Mapping[str, np.ndarray] | None = None, watch: Watch | None = None,
    ) -> Motion:  # fmt: skip
        """Advance members (m,) from step k0 to step k1; numbers: name -> (m, ...) that replace the members' own.

        motion: motions after the tick at step k0; None starts from the members' own motions at t = 0, with k0 = 0.
        watch: called for each block of samples, with the number of its first sample and the samples.
        Returns: The motions after step k1 and its tick; NaN for members that failed.
        """
        plan, m = self.plan, len(places)
        packets = self._filled(places, motion, numbers or {})
        values: Mapping[str, np.ndarray] = {}
        # Samples are due at each tick: as many at once as take some 10 MB.
        most = max(1, AT_ONCE // m) * 16 * self.every
        for first in range(k0, k1, most):
            stop = min(first + most, k1)
            raw = packets.advance(first, stop)[:, :m]
            values = unpacked(plan.layout.sizes, raw, packets.frame, plan.layout.table)
            if watch:
                watch(plan.launches.samples_due(first, stop)[0], values)
        failed = packets.ended()[0] != 0
        last = {name: values[name][-1] for name in FIELDS}
        states: Any = {name: np.where(failed.reshape(-1, *(1,) * (v.ndim - 1)), np.nan, v) for name, v in last.items()}
        memory = self._memory(packets)
        packets.leave()
        return Motion(**states, memory=memory)

    def _filled(self, places: np.ndarray, motion: Motion | None, numbers: Mapping[str, np.ndarray]) -> Packets:
        """Build packets of members in these motions."""
        subset, m = self.fleet.subset(places), len(places)
        members = subset.select(0, m)
        members = replace(members, parameters={**members.parameters, **numbers})
        if motion is not None:
            members = replace(members, **{name: getattr(motion, name) for name in FIELDS})
        subset.check_block(0, m, members.parameters)
        packets = Packets.of(self.plan, members)
        if motion is not None:
            self._remember(packets, motion.memory)
        return packets

    def _rows(self, packets: Packets) -> dict[str, slice]:
        """Rows of the memory by key, as in `Motion`."""
        each = zip(self.keys, packets.laws.remembered, strict=True)
        rows = {key: rows for key, rows in each if rows.stop > rows.start}
        return rows | ({"": slice(0, self.bus.rows)} if self.bus else {})

    def _memory(self, packets: Packets) -> dict[str, np.ndarray]:
        """Memory of the members, as in `Motion`."""
        view, m = packets.laws.memory.view, packets.members.count
        return {
            key: view[:, rows].transpose(0, 2, 1).reshape(-1, rows.stop - rows.start)[:m].copy()
            for key, rows in self._rows(packets).items()
        }

    def _remember(self, packets: Packets, memory: Mapping[str, np.ndarray]) -> None:
        view = packets.laws.memory.view
        for key, rows in self._rows(packets).items():
            values = memory[key]
            padded = np.concatenate([values, np.repeat(values[-1:], len(view) * view.shape[2] - len(values), axis=0)])
            view[:, rows] = padded.reshape(len(view), view.shape[2], -1).transpose(0, 2, 1)


def calm(scene: Any, purpose: str) -> None:
    """Refuse a scene with noise or waves: it has no steady motion."""
    for term in scene.terms:
        if isinstance(term, NoisyTerm | WaveTerm):
            problem = f"lets no motion be steady, as {purpose} need it"
            raise refusal("terms", term.key, problem, "leave it out of this scene")


def plant(scene: Scene, period: float, extra: Sequence[Any] = ()) -> Scene:
    """A scene without control laws, whose actuators hold their commands for a period [s]."""
    terms = [*scene.terms, *extra]
    able = [term for term in terms if term.channels and not term.own_commands]
    if not able:
        return replace(scene, controller=None, terms=terms)
    names = {term.key for term in (*terms, *scene.events)}

    def free(name: str) -> str:
        while name in names:
            name += "_"
        names.add(name)
        return name

    # Commands are rows of the memory, which a bench writes; laws speak after the last step.
    allocation = [AllocationMatrix(to=t.key, matrix=np.eye(t.channels, 6), name=free("allocation")) for t in able]
    guidance = [SetPoint(position=np.zeros(3), heading=0.0, name=free("set_point"))]
    law = StateFeedback(K=np.zeros((6, 12)), name=free("state_feedback"))
    controller = Controller(period=period, guidance=guidance, laws=[law], allocation=allocation)
    return replace(scene, controller=controller, terms=terms)
