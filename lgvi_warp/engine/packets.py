"""A block's members packed into lanes as the kernel's arrays, and the launches that advance them."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import warp as wp

from lgvi_kernels import built_in
from lgvi_kernels.advance.events import FIRST
from lgvi_kernels.advance.monitor import ENERGY_FIELDS
from lgvi_kernels.advance.rows import PACE_FIELDS, STATE_FIELDS
from lgvi_kernels.lanes.arithmetic import int_lane
from lgvi_kernels.maps.collocation import SLOPE_FIELDS
from lgvi_warp.common.machine import DTYPES
from lgvi_warp.common.warp_setup import build_lock
from lgvi_warp.engine.outcome import Outcome
from lgvi_warp.engine.plan import Plan
from lgvi_warp.engine.step_warnings import at_start, munk_factor, row_limits
from lgvi_warp.engine.survey import frame_of
from lgvi_warp.methods import modified_inertia
from lgvi_warp.physics import inertia, notation, vehicle
from lgvi_warp.physics.terms.base import Packed, PackingContext
from lgvi_warp.physics.terms.drag import Drag
from lgvi_warp.physics.terms.events import Event
from lgvi_warp.sampling.members import Members
from lgvi_warp.scene.ensemble import Ensemble


def pack(values: np.ndarray, width: int) -> np.ndarray:
    """Pack members' rows into lanes; the last packet is filled up with copies of the last member.

    Args:
        values: (m, d), one row a member.
        width: members of a packet.

    Returns:
        (ceil(m / width), d, width), contiguous.
    """
    m, d = values.shape
    packets = -(-m // width)
    filled = np.concatenate([values, np.repeat(values[-1:], packets * width - m, axis=0)])
    return np.ascontiguousarray(filled.reshape(packets, width, d).transpose(0, 2, 1))


def _set_vector(target: np.ndarray, values: np.ndarray) -> None:
    """Fill a Lane3 field of a structured array from packed rows (packets, 3, width)."""
    for i, axis in enumerate("xyz"):
        target[axis] = values[:, i]


def _symmetric(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Diagonal and off-diagonal 23, 31, 12 of (n, 3, 3)."""
    off = np.stack([matrix[:, 1, 2], matrix[:, 2, 0], matrix[:, 0, 1]], axis=1)
    return np.einsum("nii->ni", matrix), off


class Packets:
    """The members of one block packed into lanes, ready to launch.

    Args:
        plan: the plan of the run.
        members: the m members of the block.

    Attributes:
        count: number of packets.
        frame: axes and origins that the kernel works in.
        scale: (1 or m,) [kg m^2], number that momenta are divided by in the kernel; 1 for methods that need none.
    """

    def __init__(self, plan: Plan, members: Members):
        self.plan, self.members = plan, members
        self.frame, self.U, _ = frame_of(plan.method, members.parameters)
        self.scale = self.frame.J.max(axis=1)
        if not plan.spec.scaled:
            self.scale = np.ones_like(self.scale)
        width, Lane = plan.spec.width, plan.advance.types.Lane
        self.count = -(-members.count // width)
        Inertia, Params, Events = plan.advance.types.Inertia, plan.advance.types.Params, plan.advance.types.Events
        context = PackingContext(
            members.parameters, self.frame, members.indices, members.seed, plan.grid.h, plan.kernel_choice.aligned
        )
        params, table, memory = self.packed_laws(context)
        self.inertia = _structs(self._inertia(), Inertia)
        self.params = _structs(params, Params)
        self.events = _structs(self._events(context), Events)
        self.table = _rows(table, Lane)
        self.memory = _rows(memory, Lane)
        state = self._state()
        self.state = _rows(self._lanes_each(state), Lane)
        self.warned = np.zeros(members.count, np.uint16), np.zeros(0)
        if plan.checks != "none":
            momentum = state[:, 12:15] * self.scale[:, None]
            self.warned = at_start(plan, members, self.frame, momentum)
        self.status = wp.zeros(self.count, dtype=int_lane(width), device="cpu")
        self.failed_step = wp.zeros(self.count, dtype=int_lane(width), device="cpu")
        self.failed_size = wp.zeros(self.count, dtype=Lane, device="cpu")
        self.out: wp.array | None = None
        self.monitor = self._monitor()

    def _monitor(self) -> Any:
        """The limits that the kernel compares with at intervals, and the arrays where it notes what it saw."""
        plan, monitor = self.plan, self.plan.advance.types.Monitor()
        Lane, Ints = plan.advance.types.Lane, int_lane(plan.spec.width)
        if plan.spec.looks:
            monitor.limits = _structs(self._limits(), plan.advance.types.Limits)
            for name, kind in (("warned", Ints), ("warned_step", Ints), ("warned_size", Lane)):
                setattr(monitor, name, wp.zeros(self.count, dtype=kind, device="cpu"))
        if plan.spec.energy:
            monitor.energy = wp.zeros((self.count, ENERGY_FIELDS), dtype=Lane, device="cpu")
        if plan.spec.backward:
            monitor.backward = -plan.grid.h * min(0.0, *plan.method.stages)
        if plan.spec.substep:
            monitor.substeps = wp.zeros(self.count, dtype=Ints, device="cpu")
        if plan.spec.still:
            monitor.still = wp.zeros((self.count, 3), dtype=Lane, device="cpu")
        return monitor

    def _limits(self) -> np.ndarray:
        """Limits of the watched rows, squared, in the block's scaled numbers."""
        rows, h = self.plan.spec.looks, self.plan.grid.h
        fields: dict[str, Any] = {f"{row}_limit": limit**2 for row, limit in row_limits(self.plan).items()}
        if "munk_coarse" in rows:
            fields["munk"] = (h * self.scale) ** 2 * munk_factor(self.frame)
        if "step" in (self.plan.dtypes[3].names or ()):
            fields["step"] = h
        return self._filled(self.plan.dtypes[3], fields)

    def _lanes(self, values: np.ndarray) -> np.ndarray:
        """Rows (1 or m, d) as (1 or packets, d, width) of the kernel's numbers."""
        width = self.plan.spec.width
        packed = np.repeat(values[:, :, None], width, axis=2) if len(values) == 1 else pack(values, width)
        return packed.astype(DTYPES[self.plan.dtype])

    def _inertia(self) -> np.ndarray:
        frame, parts = self.frame, self.plan.spec.parts
        n = max(len(frame.M), len(frame.J))
        M, J = np.broadcast_to(frame.M, (n, 3, 3)), np.broadcast_to(frame.J, (n, 3))
        scale = np.broadcast_to(self.scale, n)
        inverse = np.linalg.inv(M) * scale[:, None, None]
        mean = np.einsum("nii->n", inverse) / 3.0
        deviation = inverse - mean[:, None, None] * np.eye(3)
        fields: dict[str, Any] = {"J": J / scale[:, None], "inverse_scale": 1.0 / scale, "mean": mean}
        if self.plan.spec.mass == "diagonal":
            fields["anisotropy"] = np.einsum("nii->ni", deviation)
        elif self.plan.spec.mass == "full":
            fields["anisotropy"] = _symmetric(deviation)
        if "rates" in parts:
            fields["inverse_J"] = scale[:, None] / J
        if "turns" in parts:
            fields["half_over_J"] = 0.5 * scale[:, None] / J
        if "x" in parts:
            fields["pitch"] = np.einsum("nii->ni", self.U)
            fields |= {f"U{i + 1}{j + 1}": self.U[:, i, j] for i, j in ((0, 1), (0, 2), (1, 2))}
        if "w" in parts:
            fields["S"] = _symmetric(frame.E)
        if "coupled" in parts:
            fields |= {"E": frame.E, "E_forces": frame.E_forces}
        if "dense" in parts:
            Md, C, Jd = (block / scale[:, None, None] for block in inertia.blocks(frame.inertia_at(frame.E_forces)))
            fields |= {"M": _symmetric(Md), "C": C, "J_forces": _symmetric(Jd)}
        if "modified" in parts:
            fields |= modified_inertia.fields(J / scale[:, None])
        if "water" in parts:
            fields |= self._water()
        if "origin" in parts:
            fields["user_origin"] = -frame.vector(frame.origin)
            fields["user_origin_forces"] = -frame.vector(frame.forces)
        return self._filled(self.plan.dtypes[0], fields)

    def _water(self) -> dict[str, np.ndarray]:
        """What accelerating water acts on: displaced mass minus dry mass, and its lever."""
        p = self.members.parameters
        displaced, dry = vehicle.displaced_mass(p), vehicle.dry_mass(p)
        lever = displaced[:, None] * p["vehicle.center_of_buoyancy"] - (dry[:, None] * vehicle.center_of_mass(p))
        excess = displaced - dry
        about = self.frame.vector(lever - excess[:, None] * self.frame.forces)
        return {"excess": excess, "excess_lever": about}

    def _filled(self, dtype: np.dtype, fields: dict[str, Any]) -> np.ndarray:
        """A structured array with one entry, or one a packet where some field varies."""
        varied = any(len(leaf) > 1 for leaf in _leaves(fields))
        data = np.zeros(self.count if varied else 1, dtype)
        for key, value in fields.items():
            self._fill(data[key], value)
        return data

    def _fill(self, target: np.ndarray, value: Any) -> None:
        names = target.dtype.names or ()
        if isinstance(value, dict):
            for name, entry in value.items():
                self._fill(target[name], entry)
        elif isinstance(value, tuple):
            for name, entry in zip(("diagonal", "off_diagonal"), value, strict=True):
                _set_vector(target[name], self._lanes(entry))
        elif names == ("x", "y", "z"):
            _set_vector(target, self._lanes(value))
        elif names:
            for i, name in enumerate(("row0", "row1", "row2")):
                _set_vector(target[name], self._lanes(value[:, i]))
        elif np.ndim(value) == 0:
            target[...] = value
        elif value.dtype.kind in "iu":
            target[...] = pack(value[:, None], self.plan.spec.width)[:, 0]
        else:
            target[...] = self._lanes(value[:, None])[:, 0]

    def packed_laws(self, context: PackingContext) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pack each term's numbers, one after the other.

        Args:
            context: What the terms may look at.

        Returns:
            (params, table, memory) of the laws, as the kernel takes them.
        """
        packed: list[Packed] = []
        for i, (term, module) in enumerate(self.plan.kernel_choice.laws):
            parameters = Ensemble.own(term, context.parameters)
            if i == 0 and self.plan.spec.drag:
                assert isinstance(term, Drag)
                by_axes = module is built_in("laws", "drag")
                exact = (
                    term.packed_exact(parameters, self.frame, self.scale)
                    if by_axes
                    else term.packed_directions(parameters, context)
                )
                packed.append(exact)
            else:
                packed.append(term.packed(parameters, context))
        dtype = self.plan.dtypes[1]
        varied = any(len(leaf) > 1 for numbers in packed for leaf in _leaves(numbers.values))
        data = np.zeros(self.count if varied else 1, dtype)
        rows, memory = [np.zeros((1, 1))], [np.zeros((1, 0))]
        node: Any = data
        for numbers in packed:
            values = dict(numbers.values)
            if numbers.rows is not None:
                values["first"] = sum(part.shape[1] for part in rows)
                rows.append(numbers.rows)
            if numbers.memory is not None:
                values["memory"] = sum(part.shape[1] for part in memory)
                memory.append(numbers.memory)
            if numbers.work:
                values["work"] = sum(part.shape[1] for part in memory)
                memory.append(np.zeros((1, numbers.work)))
            for key, value in values.items():
                self._fill(node["own"][key], value)
            node = node["rest"]
        if self.plan.spec.gauss:
            # The slopes of the last step, and room for their extrapolation.
            memory.append(np.zeros((1, 2 * len(self.plan.spec.gauss[1]) * SLOPE_FIELDS)))
        table = self._lanes(_side_by_side(rows))
        start = np.broadcast_to(_side_by_side(memory), (self.members.count, sum(m.shape[1] for m in memory)))
        # The second half is a backup, from which a chunk of steps is repeated.
        return data, table, np.concatenate([self._lanes_each(start)] * 2, axis=1)

    def _lanes_each(self, values: np.ndarray) -> np.ndarray:
        """Rows (m, d) as (packets, d, width), one entry a packet even for one member."""
        return pack(values, self.plan.spec.width).astype(DTYPES[self.plan.dtype])

    def _events(self, context: PackingContext) -> np.ndarray:
        packed = [
            event.packed(Ensemble.own(event, context.parameters), context)
            for event, _ in self.plan.kernel_choice.events
        ]
        varied = any(len(leaf) > 1 for numbers in packed for leaf in _leaves(numbers.values))
        data = np.zeros(self.count if varied else 1, self.plan.dtypes[2])
        node: Any = data
        for numbers in packed:
            for key, value in numbers.values.items():
                self._fill(node["own"][key], value)
            node = node["rest"]
        return data

    def _state(self) -> np.ndarray:
        m, frame = self.members, self.frame
        n = m.count
        R = m.attitude @ frame.Q
        nu = m.velocity + np.cross(m.angular_velocity, np.broadcast_to(frame.origin, (n, 3)))
        nu = nu - self._water_at_start()
        twist = np.concatenate(
            [notation.rotate_into(frame.Q, nu), notation.rotate_into(frame.Q, m.angular_velocity)], 1
        )
        momenta = np.einsum("nij,nj->ni", np.broadcast_to(frame.inertia_at(frame.E), (n, 6, 6)), twist)
        rows = np.zeros((n, self.plan.spec.state_fields))
        rows[:, :9] = R.reshape(-1, 9)
        rows[:, 9:12] = m.position + notation.rotate_out(m.attitude, np.broadcast_to(frame.origin, (n, 3)))
        if self.plan.spec.inertial:
            momenta[:, :3] = notation.rotate_out(R, momenta[:, :3])
        rows[:, 12:STATE_FIELDS] = momenta / self.scale[:, None]
        if self.plan.spec.compensated:
            low = rows[:, :STATE_FIELDS] - rows[:, :STATE_FIELDS].astype(np.float32)
            rows[:, STATE_FIELDS:] = np.where(np.isfinite(low), low, 0.0)
        return rows

    def _water_at_start(self) -> np.ndarray:
        """R^T u (m, 3) [m/s]: velocity of the water in the user's body axes where each member starts."""
        m = self.members
        context = PackingContext(m.parameters, self.frame, m.indices, m.seed, self.plan.grid.h)
        total = np.zeros_like(m.position)
        for term, _ in self.plan.kernel_choice.laws:
            parameters = Ensemble.own(term, m.parameters)
            total = total + term.water_at_start(parameters, m.position, context)
        return notation.rotate_into(m.attitude, total)

    def advance(self, k0: int, k1: int) -> np.ndarray:
        """Make the steps from k0 to k1, and return the samples by member.

        Args:
            k0: number of steps made before.
            k1: number of steps made after.

        Returns:
            Samples due after step k0 and no later than step k1: (samples, count * width, numbers of a sample), a copy.
        """
        packed = self.launch(k0, k1)
        packets, samples, numbers, width = packed.shape
        return packed.transpose(1, 0, 3, 2).copy().reshape(samples, packets * width, numbers)

    def launch(self, k0: int, k1: int) -> np.ndarray:
        """Make the steps from k0 to k1, and return the samples as the kernel wrote them.

        Args:
            k0: number of steps made before.
            k1: number of steps made after.

        Returns:
            Samples due after step k0 and no later than step k1: (count, samples, numbers of a sample, width), in memory
            that the next launch overwrites.
        """
        plan = self.plan
        s0, s1 = plan.due(k0, k1)
        numbers = sum(plan.spec.sample_fields.values())
        width = plan.spec.width
        shape = (self.count, max(1, (s1 - s0) * numbers))
        if self.out is None or self.out.shape != shape:
            self.out = wp.empty(shape, dtype=plan.advance.types.Lane, device="cpu")
        real, dtype = plan.spec.real, plan.dtype
        stage_h, lead_h, sample_step = plan.times
        inputs = [self.inertia, self.params, self.events, self.table]
        inputs += [real(tolerance) for tolerance in plan.method.tolerances(dtype)]
        inputs += [wp.float64(plan.grid.h), stage_h, lead_h, k0, k1, s0, sample_step]
        inputs += [self.state, self.memory, self.status, self.failed_step, self.failed_size, self.monitor, self.out]
        with build_lock:
            command: Any = wp.launch(plan.advance.kernel, dim=self.count, inputs=inputs, device="cpu", record_cmd=True)
        command.launch()
        return self.out.numpy()[:, : (s1 - s0) * numbers].reshape(self.count, s1 - s0, numbers, width)

    def outcome(self) -> Outcome:
        """The outcome of each member so far.

        Returns:
            Status, steps before the failure, value that crossed its limit, warnings and event of the m members.
        """
        m = self.members.count
        kept = PACE_FIELDS if self.plan.method.adaptive else 0
        pace = self.state.numpy()[:, STATE_FIELDS + 2 : STATE_FIELDS + kept]
        code = self._of_members(self.status, np.uint8)
        status, stopped_by = code.copy(), np.zeros(m, np.uint8)
        for number, (event, _) in enumerate(self.plan.kernel_choice.events):
            assert isinstance(event, Event)
            stopped = code == FIRST + number
            status[stopped], stopped_by[stopped] = event.status, 1 + number
        return Outcome(
            status,
            self.failed_step.numpy().reshape(-1)[:m].astype(np.int64),
            np.sqrt(self.failed_size.numpy().reshape(-1)[:m].astype(np.float64)),
            pace.transpose(0, 2, 1).reshape(self.count * self.plan.spec.width, pace.shape[1])[:m].astype(np.int64),
            *self._warnings(),
            self._of_members(self.monitor.substeps, np.int64) if self.plan.spec.substep else np.zeros(m, np.int64),
            stopped_by,
        )

    def ended(self) -> tuple[np.ndarray, np.ndarray]:
        """Status of each member, and the last step of those it made itself.

        Returns:
            (status, step): both (m,); after that step a member that ended keeps its state.
        """
        outcome = self.outcome()
        return outcome.status, outcome.failed_step

    def _of_members(self, lanes: Any, kind: Any) -> np.ndarray:
        """One number of each member, from an array of lanes."""
        return np.asarray(lanes.numpy().reshape(-1)[: self.members.count].astype(kind))

    def _warnings(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(bits, step, value) of the warnings at the start and of those the kernel noted.

        Step and value are those of the more serious of the two; of two equals, those of the start.
        """
        bits, value = self.warned
        step = np.zeros(len(bits), np.int64)
        if not self.plan.spec.looks:
            return bits, step, value if len(value) else np.full(len(bits), np.nan)
        monitor = self.monitor
        noted = self._of_members(monitor.warned, np.uint16)
        # The kernel's warning is more serious if its highest bit is above all bits of the start.
        later = (noted & ~bits) > bits
        step = np.where(later, self._of_members(monitor.warned_step, np.int64), 0)
        value = np.where(later, np.sqrt(self._of_members(monitor.warned_size, np.float64)), value)
        return bits | noted, step, value


def _leaves(fields: dict[str, Any]) -> list[np.ndarray]:
    """The arrays among a term's numbers, nested dicts and tuples flattened."""
    flat: list[np.ndarray] = []
    for value in fields.values():
        if isinstance(value, dict):
            flat += _leaves(value)
        else:
            flat += value if isinstance(value, tuple) else (value,)
    return [array for array in flat if np.ndim(array) > 0]


def _rows(values: np.ndarray, Lane: Any) -> Any:
    """A Warp array of lanes, two-dimensional, from (entries, rows, width)."""
    return wp.array(values, dtype=Lane, shape=values.shape[:2], device="cpu")


def _structs(values: np.ndarray, struct: Any) -> Any:
    """A Warp array of structs from a structured array (n,) of the plan's type.

    Copied byte by byte: wp.array(values) lets NumPy parse the struct's type from text, which in several threads
    occasionally fails (Python before 3.11.8 and 3.12.2, python/cpython#106905) and would end the run.
    """
    array = wp.empty(len(values), dtype=struct, device="cpu")
    assert values.flags.c_contiguous and values.itemsize == ctypes.sizeof(struct.ctype)
    ctypes.memmove(array.ptr, values.ctypes.data, values.nbytes)
    return array


def _side_by_side(parts: list[np.ndarray]) -> np.ndarray:
    """Rows (1 or n, d) joined along d, those of one entry repeated n times."""
    n = max(len(part) for part in parts)
    return np.concatenate([np.broadcast_to(part, (n, part.shape[1])) for part in parts], axis=1)
