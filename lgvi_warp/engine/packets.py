# SPDX-License-Identifier: Apache-2.0
"""A block's members packed into lanes as the kernel's arrays, and the launches that advance them."""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import Any

import numpy as np
import warp as wp

from lgvi_kernels.advance.events import FIRST
from lgvi_kernels.advance.monitor import ENERGY_FIELDS
from lgvi_kernels.advance.noting import NOTED, SEEN_NOTES
from lgvi_kernels.advance.rows import PACE_FIELDS, SAMPLE_FIELDS, STATE_FIELDS, WASTE
from lgvi_kernels.lanes.arithmetic import int_lane
from lgvi_warp.common.status import Warnings
from lgvi_warp.common.warp_setup import build_lock
from lgvi_warp.engine import going_on
from lgvi_warp.engine import heights as of_surface
from lgvi_warp.engine.arrays import PLAIN, Group, LawArrays, Structs, memory_rows
from lgvi_warp.engine.outcome import MemberStatus
from lgvi_warp.engine.packing import Packing
from lgvi_warp.engine.plan import Plan
from lgvi_warp.engine.sample_layout import ACCOUNT_ROW
from lgvi_warp.engine.state_lanes import StateLanes, kernel_for
from lgvi_warp.engine.step_warnings import (
    AT_START,
    at_start,
    departure,
    leaves_rotations,
    munk_factor,
    orthogonality_limit,
    possible,
    row_limits,
)
from lgvi_warp.engine.tangents import CopiesPacking, Slopes, slopes_of_frame
from lgvi_warp.physics.terms.base import Packed
from lgvi_warp.sampling.members import Members
from lgvi_warp.scene.draws import KEPT

# What the kernel notes of members that end.
ENDS = ("status", "failed_step", "failed_size")


class Packets:
    """The members of one block packed into lanes, ready to launch.

    count: number of packets. frame: axes and origins of the kernel.
    scale: (1 or m,) [kg m^2], divisor of momenta in the kernel; 1 for methods without scaling.
    state_lanes: states, (packets, fields of a state). laws: numbers of laws, of a controller's parts and of events.
    """

    def __init__(self, plan: Plan, members: Members):
        self.plan = plan
        width, types = plan.spec.width, plan.kernel.advance.types
        self.count = -(-members.count // width)
        structs = (types.Inertia, types.Params, types.Events, types.Limits, *([types.Loop] if types.Loop else []))
        inertia, params, events, limits, *loop = zip(structs, plan.kernel.dtypes, strict=True)
        self._controlled = bool(loop)
        self.slopes = Slopes(plan) if plan.spec.tangents else None
        writing = PLAIN if self.slopes is None else self.slopes.writing
        self.inertia, self._limits = (Structs(*kind, writing) for kind in (inertia, limits))
        self.laws = LawArrays(self.count, (params, *loop, events), types.Lane, types.Number, writing)
        self.state_lanes = StateLanes(plan.spec, self.count, kernel_for(plan.spec, plan.ensemble.members), writing)
        self.status = wp.zeros(self.count, dtype=int_lane(plan.spec.lanes), device="cpu")
        self.failed_step = wp.zeros(self.count, dtype=int_lane(plan.spec.lanes), device="cpu")
        self.failed_size = wp.zeros(self.count, dtype=types.Lane, device="cpu")
        self.out: wp.array | None = None
        self.monitor = self._monitor()
        self._place_ticks(plan)
        self.noted = {name: array.numpy() for name, array in self._written_by_the_kernel().items()}
        self._launch: Any = None
        self._launched, self._packed_before = (0, 0, 0), list[Any]()
        self.refill(members)

    @classmethod
    def of(cls, plan: Plan, members: Members) -> Packets:
        """Packets of these members: reused from a finished block of this size, or new."""
        for _ in range(len(plan.free_packets)):
            try:
                packets = plan.free_packets.pop()
            except IndexError:  # another thread took the last
                break
            if packets.count == -(-members.count // plan.spec.width) and packets.plan.shared is plan.shared:
                packets.serve(plan)
                packets.refill(members)
                return packets
        return cls(plan, members)

    def _values(self, lanes: np.ndarray) -> np.ndarray:
        """Numbers of members in lanes (..., numbers of a lane), without slopes; of plain lanes, all numbers."""
        return lanes if self.slopes is None else lanes[..., : self.plan.spec.width]

    # The same memory as NumPy has it, by member: asking an array for it takes longer than what is done with it.
    @property
    def _status(self) -> np.ndarray:
        return self._values(self.noted["status"]).reshape(-1)

    @property
    def _failed_step(self) -> np.ndarray:
        return self._values(self.noted["failed_step"]).reshape(-1)

    @property
    def _failed_size(self) -> np.ndarray:
        return self._values(self.noted["failed_size"]).reshape(-1)

    def serve(self, plan: Plan) -> None:
        """Take another plan with the same kernel, which may start at another step."""
        if plan.launches is not self.plan.launches:
            self._launch = None
            self._place_ticks(plan)
        self.plan = plan

    def _place_ticks(self, plan: Plan) -> None:
        """Set the step at which members start, and the first tick that the kernel gathers."""
        if self._controlled:
            self.monitor.start = -1 if plan.launches.goes_on else plan.grid.first
            self.monitor.first_tick = plan.launches.first_tick

    def _place_account(self) -> None:
        """Set the memory row of the energy used, and the rows that the kernel saves with a sample."""
        if self.laws.account >= 0 and self.plan.spec.accounted and self.monitor.account != self.laws.account:
            self.monitor.account = self.laws.account
            self.monitor.signals = self._signal_rows(self.laws.account)
            self._launch = None

    def _signal_rows(self, account: int = 0) -> Any:
        """Rows of the memory that are saved with each sample, a Warp array; account: row of the energy used."""
        rows = [account if row == ACCOUNT_ROW else row for row in self.plan.layout.signal_rows]
        return wp.array(np.array(rows, np.int32), dtype=wp.int32, device="cpu")

    def leave(self) -> None:
        """Leave these packets to the next block; they must not be used afterwards."""
        self.plan.free_packets.append(self)

    def refill(self, members: Members) -> None:
        """Replace the members by other members at their starts."""
        plan, self.members = self.plan, members
        packing = self._packed(members)
        each = {"law": packing.laws(), "part": packing.control(), "event": packing.events()}
        if not self._controlled:
            del each["part"]
        packed = [packing.numbers, packing.inertia(), *(law for laws in each.values() for law in laws)]
        # What a run keeps, or knows to follow from the same numbers, it gives as the same object.
        if self._packed_before and all(map(operator.is_, packed, self._packed_before)):
            self.laws.write_memory()
        else:
            self._write_packed(packing, each)
        self._packed_before = packed if members.count <= KEPT and self.slopes is None else []
        self.state_lanes.write(packing.starts(), packing.members.count)
        if self.slopes is not None:
            self.slopes.check_moved()
        self._warned: tuple[np.ndarray, np.ndarray] | None = None
        self._heights: of_surface.Heights | None = None
        for view in self.noted.values():
            view.fill(0)
        if members.final is not None:
            going_on.take(self, members.final)
            if plan.launches.goes_on_exactly:
                self._warned = going_on.start_warnings(members.final, members.count)
                self.heights.take(members.final.lanes.get(going_on.HEIGHTS))

    def _write_packed(self, packing: Packing, by_kind: Mapping[str, list[Packed]]) -> None:
        """Write the numbers of laws, parts and events, by kind, the inertia and the limits for warnings."""
        plan, shared, before = self.plan, self.plan.shared.keeps, [] if self._launch is None else self._arrays()
        self.inertia.write(self.count, [((), packing.inertia(), shared("inertia"))])
        groups = [Group(packed, [shared((kind, i)) for i in range(len(packed))]) for kind, packed in by_kind.items()]
        bus, _ = self._bus()
        spare = (
            sum(map(memory_rows, by_kind["part"])) if self._controlled and plan.layout.noted_bits & SEEN_NOTES else 0
        )
        scratch = packing.scratch([law for group in groups for law in group.packed], bus + spare)
        self.laws.write(groups, scratch, bus + spare, plan.kernel_choice.account)
        self._place_account()
        if self._controlled:
            self.monitor.loop = self.laws.structs[1].array
            of_parts = self.laws.places[len(by_kind["law"]) :]
            self.monitor.spare, self.monitor.part_rows = bus, spare
            self.monitor.parts = of_parts[0][1][2] if of_parts else 0
        if plan.spec.warning_rows:
            self._limits.write(self.count, [((), self._watched_limits(), False)])
            self.monitor.limits = self._limits.array
        if not all(map(operator.is_, self._arrays(), before)):
            self._launch = None

    def _packed(self, members: Members) -> Packing:
        """Packing of members, and of their copies if numbers carry slopes; frame, scale and water are the members'."""
        if self.slopes is None or members.shifted is None:
            packing = Packing(self.plan, members)
            self.frame, self.scale, self._packing = packing.frame, packing.scale, packing
            return packing
        self.slopes.begin(members.shifted)
        copies = CopiesPacking(self.plan, members.shifted.members)
        self.frame, self.scale = copies.frame_of_members(), copies.of_members(copies.scale)
        self._packing = copies
        return copies

    @property
    def state(self) -> Any:
        """The states, a Warp array (packets, fields of a state) of lanes."""
        return self.state_lanes.array

    @property
    def memory(self) -> Any:
        """Memory of laws and method, a Warp array (packets, rows) of lanes; the second half is a backup."""
        return self.laws.memory.array

    def _arrays(self) -> list[Any]:
        """The kernel's arrays that `refill` may replace, its first arguments first."""
        laws, limits = self.laws, self._limits.array
        params, *loop, events = (structs.array for structs in laws.structs)
        return [self.inertia.array, params, events, laws.table.array, self.memory, limits, *loop]

    def _written_by_the_kernel(self) -> dict[str, Any]:
        monitor, spec = self.monitor, self.plan.spec
        arrays = dict(zip(ENDS, (self.status, self.failed_step, self.failed_size), strict=True))
        parts = [(name, bool(spec.warning_rows)) for name in ("warned", "warned_step", "warned_size")]
        parts += [("energy", spec.energy), ("substeps", spec.substep), ("still", spec.still)]
        return arrays | {name: getattr(monitor, name) for name, present in parts if present}

    @property
    def bus_rows(self) -> int:
        """Number of the controller's rows, the first ones of the memory: commands and saved signals of ticks."""
        return self._bus()[0]

    @property
    def warned_at_start(self) -> tuple[np.ndarray, np.ndarray]:
        """(bits, value) of the warnings at the start; NaN as the value without a warning."""
        if self._warned is None:
            self._warned = self._warned_at_start()
        return self._warned

    @property
    def heights(self) -> of_surface.Heights:
        """The heights of the members above the surface so far."""
        if self._heights is None:
            self._heights = of_surface.Heights(
                self.plan.ensemble.scene, self.members.position[:, 2], self.members.parameters
            )
        return self._heights

    def look_at_depth(self, k: int, when: slice, position: np.ndarray | None) -> None:
        """Check the depth in samples (samples, m, 3) [m] of the launch up to step k, and at its end if a check is due."""
        if position is not None:
            self.heights.look(position[..., 2], self.plan.grid.sample_steps[when])
        if self.plan.launches.looks_at(k):
            self.heights.look(of_surface.of_states(self), np.array([k]))

    def _bus(self) -> tuple[int, int]:
        """Number of rows of the controller's bus, and the first row in which frozen lanes keep their signals."""
        controller = self.plan.kernel_choice.controller
        if controller is None:
            return len(self.plan.layout.signal_rows), 0
        kept = controller.bus.rows + bool(self.plan.layout.noted_bits) * sum(NOTED.values())
        return kept + len(self.plan.layout.signal_rows), kept

    def _monitor(self) -> Any:
        """The arrays in which the kernel records its checks at intervals."""
        plan, monitor = self.plan, self.plan.kernel.advance.types.Monitor()
        Lane, Ints = plan.kernel.advance.types.Lane, int_lane(plan.spec.lanes)
        if plan.spec.warning_rows:
            for name, kind in (("warned", Ints), ("warned_step", Ints), ("warned_size", Lane)):
                setattr(monitor, name, wp.zeros(self.count, dtype=kind, device="cpu"))
        if plan.spec.energy:
            monitor.energy = wp.zeros((self.count, ENERGY_FIELDS), dtype=Lane, device="cpu")
        if plan.spec.backward:
            monitor.backward = -plan.grid.h * min(0.0, *plan.method.stages)
        if plan.spec.substep:
            monitor.substeps = wp.zeros(self.count, dtype=Ints, device="cpu")
        controller = plan.kernel_choice.controller
        if plan.spec.signalled:
            monitor.kept, monitor.signals = self._bus()[1], self._signal_rows()
            rows = max(1, len(plan.layout.signal_rows))
            monitor.first_signals = wp.zeros((self.count, rows), dtype=Lane, device="cpu")
        if plan.spec.accounted:
            monitor.account = -1
        if controller is not None:
            monitor.every, monitor.commands = controller.every(plan.grid.h), controller.bus.channels
            monitor.bus, monitor.noting = controller.bus.rows, self.plan.layout.noted_bits
            monitor.slots = plan.launches.ticks_held(self.count * plan.spec.width)
            monitor.numbers, columns = sum(plan.layout.tick_fields.values()), columns_at_ticks(plan)
            monitor.columns = wp.array(columns, dtype=wp.int32, device="cpu")
            if monitor.slots:
                # An odd number of lanes from row to row: else the rows of a tick crowd into a few lines of the cache.
                shape = (max(1, monitor.slots * monitor.numbers), self.count | 1)
                monitor.ticks = wp.zeros(shape, dtype=Lane, device="cpu")
        if plan.spec.still:
            monitor.still = wp.zeros((self.count, 3), dtype=Lane, device="cpu")
        return monitor

    def _watched_limits(self) -> dict[str, Any]:
        """Limits of the watched rows, squared, in the block's scaled numbers."""
        rows, h = self.plan.spec.warning_rows, self.plan.grid.h
        fields: dict[str, Any] = {f"{row}_limit": limit**2 for row, limit in row_limits(self.plan).items()}
        if "munk_coarse" in rows:
            fields["munk"] = (h * self.scale) ** 2 * munk_factor(self.frame)
        if "step" in (self.plan.kernel.dtypes[-1].names or ()):
            fields["step"] = h
        return fields

    def advance(self, k0: int, k1: int) -> np.ndarray:
        """Make the steps k0 to k1; returns a copy of their samples, (samples, count * width, numbers of a sample)."""
        return by_members(self._values(self.launch(k0, k1)))

    def raw_slopes(self, k0: int, k1: int) -> tuple[np.ndarray, list[np.ndarray], list[Any]]:
        """The samples that the last launch wrote in these steps, and their slopes and the frame's, by each number.

        Returns: samples (samples, members, numbers), their slopes by each number, and slopes of the frame's Q and origin.
        """
        assert self.slopes is not None
        s0, s1 = self.plan.launches.samples_due(k0, k1)
        lanes, m = self._launched_samples(s1 - s0), self.members.count
        each = [by_members(lanes[..., place])[:, :m] for place in self.slopes.places()]
        return by_members(self._values(lanes))[:, :m], each, slopes_of_frame(self.slopes, self._packing.frame)

    def slopes_of_start(self, names: Sequence[str]) -> list[dict[str, np.ndarray]]:
        """Slopes of the motion (1, m, ...) at the start, by each number."""
        shifted = self.members.shifted
        assert self.slopes is not None
        assert shifted is not None
        slopes = {name: self.slopes.of(getattr(shifted.members, name))[1] for name in names}
        return [{name: slopes[name][i][None] for name in names} for i in range(self.plan.spec.tangents)]

    def slopes_of_first_signals(self) -> list[np.ndarray]:
        """Slopes of the signals at the start, (1, m, numbers of the signals), by each number."""
        assert self.slopes is not None
        rows, m = self.monitor.first_signals.numpy()[:, : len(self.plan.layout.signal_rows)], self.members.count
        return [by_members(rows[:, None, :, place])[:, :m] for place in self.slopes.places()]

    def launch(self, k0: int, k1: int) -> np.ndarray:
        """Make the steps k0 to k1, and return the samples due after k0 and no later than k1.

        Returns: (count, samples, numbers of a sample, width), in memory that the next launch overwrites.
        """
        plan = self.plan
        s0, s1 = plan.launches.samples_due(k0, k1)
        numbers = sum(plan.layout.sizes.values())
        waste = WASTE if SAMPLE_FIELDS.keys() - plan.layout.sizes.keys() else 0
        shape = (self.count, max(1, (s1 - s0) * numbers) + waste)
        if self.out is None or self.out.shape != shape:
            self.out = wp.empty(shape, dtype=plan.kernel.advance.types.Lane, device="cpu")
            self._samples = self.out.numpy()
            self._launch = None
        tolerances = plan.method.tolerances(plan.dtype)
        if self._launch is None:
            self._launch = self._recorded(tolerances, k0, k1, s0)
        elif self._launched != (k0, k1, s0):
            # Replaying a launch costs a tenth of a new one.
            for name, value in enumerate((k0, k1, s0, plan.launches.beginning(k0)), 7 + len(tolerances)):
                self._launch.set_param_at_index(name, value)
        self._launched = k0, k1, s0
        self._launch.launch()
        return self._launched_samples(s1 - s0)

    def _launched_samples(self, count: int) -> np.ndarray:
        """This many samples of the last launch, (packets, samples, numbers of a sample, numbers of a lane)."""
        numbers = sum(self.plan.layout.sizes.values())
        return self._samples[:, : count * numbers].reshape(self.count, count, numbers, self.plan.spec.lanes)

    def _recorded(self, tolerances: Any, k0: int, k1: int, s0: int) -> Any:
        """Record a launch of the kernel without launching it."""
        plan = self.plan
        stage_h, lead_h, sample_step = plan.launches.times
        inputs = [*self._arrays()[:4], *(plan.spec.real(tolerance) for tolerance in tolerances)]
        inputs += [wp.float64(plan.grid.h), stage_h, lead_h, k0, k1, s0, plan.launches.beginning(k0), sample_step]
        inputs += [self.state, self.memory, self.status, self.failed_step, self.failed_size, self.monitor]
        inputs += [sum(plan.layout.sizes.values()), columns_of(plan.layout.sizes), self.out]
        with build_lock:
            return wp.launch(plan.kernel.advance.kernel, dim=self.count, inputs=inputs, device="cpu", record_cmd=True)

    def gathered(self, when: slice) -> np.ndarray:
        """Values that the last launch gathered at ticks, in the user's axes.

        Returns: (ticks, members, numbers of a sample), in memory that the next launch overwrites.
        """
        slots, numbers = self.monitor.slots, self.monitor.numbers
        first = self.plan.launches.slot_of(when.start, slots)
        rows = self._values(self.monitor.ticks.numpy()[first * numbers : (first + when.stop - when.start) * numbers])
        by_tick = rows.reshape(when.stop - when.start, numbers, math.prod(rows.shape[1:]))[..., : self.members.count]
        return by_tick.transpose(0, 2, 1)

    def first_signals(self) -> np.ndarray:
        """Copy of the signals at t = 0 after the first launch, (1, count * width, numbers of the signals)."""
        rows = self._values(self.monitor.first_signals.numpy()[:, : len(self.plan.layout.signal_rows)])
        packets, numbers, width = rows.shape
        return rows.transpose(0, 2, 1).reshape(1, packets * width, numbers).copy()

    def outcome(self, warned: bool = True) -> MemberStatus:
        """The outcome of each member so far."""
        m = self.members.count
        none = np.zeros(m, np.uint16), np.zeros(m, np.int64), np.full(m, np.nan)
        warnings: tuple[np.ndarray, np.ndarray, np.ndarray] = self._warnings() if warned else none
        if self.untroubled and not (warnings[0].any() or self.plan.method.adaptive or self.plan.spec.substep):
            return MemberStatus.clear(m, 0)
        kept = PACE_FIELDS if self.plan.method.adaptive else 0
        pace = self._values(self.state_lanes.view[:, STATE_FIELDS + 2 : STATE_FIELDS + kept])
        code = self._status[:m].astype(np.uint8)
        status, stopped_by = code.copy(), np.zeros(m, np.uint8)
        for number, (event, _) in enumerate(self.plan.kernel_choice.events):
            stopped = code == FIRST + number
            status[stopped], stopped_by[stopped] = event.status, 1 + number
        return MemberStatus(
            status,
            self._failed_step[:m].astype(np.int64),
            np.sqrt(self._failed_size[:m].astype(np.float64)),
            pace.transpose(0, 2, 1).reshape(self.count * self.plan.spec.width, pace.shape[1])[:m].astype(np.int64),
            *warnings,
            self._of_members(self.monitor.substeps, np.int64) if self.plan.spec.substep else np.zeros(m, np.int64),
            stopped_by,
        )

    @property
    def untroubled(self) -> bool:
        """Whether no member has failed or was stopped so far."""
        return not self._status.any()

    def ended(self) -> tuple[np.ndarray, np.ndarray]:
        """Status (m,) of each member, and the last step (m,) that it made.

        After this step an ended member keeps its state.
        """
        outcome = self.outcome(warned=False)
        return outcome.status, outcome.failed_step

    def _of_members(self, lanes: Any, kind: Any) -> np.ndarray:
        """One number of each member, from an array of lanes."""
        return np.asarray(self._values(lanes.numpy()).reshape(-1)[: self.members.count].astype(kind))

    def _warnings(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(bits, step, value) of the warnings at the start and of the warnings from the kernel.

        Step and value belong to the more serious warning; if both are equal, to the warning at the start.
        """
        return self.heights.added(*self._of_steps())

    def _of_steps(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(bits, step, value) of the warnings about the step."""
        bits, value = self.warned_at_start
        step = np.zeros(len(bits), np.int64)
        value = value if len(value) else np.full(len(bits), np.nan)
        if not self.plan.spec.warning_rows:
            return self._with_counted(bits, step, value)
        monitor = self.monitor
        noted = self._of_members(monitor.warned, np.uint16)
        # The kernel's warning is more serious if its highest bit is above all bits of the start.
        later = (noted & ~bits) > bits
        step = np.where(later, self._of_members(monitor.warned_step, np.int64), 0)
        value = np.where(later, np.sqrt(self._of_members(monitor.warned_size, np.float64)), value)
        found = bits | noted, step, value
        return self._with_counted(*(self._with_departed(*found) if leaves_rotations(self.plan.method) else found))

    def _with_counted(
        self, bits: np.ndarray, step: np.ndarray, value: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Add warnings of members with ticks whose iterations did not converge, or whose filter diverged."""
        controller, m = self.plan.kernel_choice.controller, len(bits)
        if controller is None or self.plan.checks == "none":
            return bits, step, value
        bus, h = controller.bus, self.plan.grid.h
        counted = ((bus.unconverged, Warnings.CONTROL_NOT_CONVERGED), (bus.diverged, Warnings.FILTER_DIVERGED))
        for row, warning in (each for each in counted if each[0] >= 0):
            rows = self._values(self.laws.memory.view[:, row:][:, :2])
            count, later = rows.transpose(1, 0, 2).reshape(2, -1)[:, :m].astype(np.float64)
            first = np.rint(later / h).astype(np.int64) - controller.every(h)
            # Ticks of a member that ended go on, at rest.
            own = np.where(self._status[:m] == 0, np.inf, (self._failed_step[:m] - first) // controller.every(h) + 1)
            seen = (count > 0.0) & (own > 0)
            bits = bits | np.uint16(warning) * seen
            step, value = np.where(seen, first, step), np.where(seen, np.minimum(count, own), value)
        return bits, step, value

    def _warned_at_start(self) -> tuple[np.ndarray, np.ndarray]:
        """(bits, value) of the warnings at the start; NaN as the value without a warning."""
        plan, members, peaks = self.plan, self.members, self.state_lanes.peaks
        among = frozenset[Warnings]()
        if plan.checks != "none":
            # Along packets first: lanes beside each other in memory are compared at once.
            most = None if peaks is None else peaks.max(axis=0).max(axis=1)
            among = AT_START if most is None else possible(plan, members, self.frame, most)
        if not among:
            return np.zeros(members.count, np.uint16), np.zeros(0)
        momenta, water = self.state_lanes.momenta(), self._packing.water
        if isinstance(self._packing, CopiesPacking):
            momenta = self._packing.of_members(momenta)
            water = None if water is None else self._packing.of_members(water)
        return at_start(plan, members, self.frame, momenta * self.scale[:, None], water, among)

    def _with_departed(
        self, bits: np.ndarray, step: np.ndarray, value: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Add a warning of members whose last attitude is no rotation: some members end between two ticks."""
        size = departure(self._values(self.state_lanes.view[:, :9]))[: len(bits)]
        warning = np.uint16(Warnings.ORTHOGONALITY)
        over = size > orthogonality_limit(self.plan)
        first = over & (warning > bits)
        steps_made = np.where(self._status[: len(bits)] == 0, self._launched[1], self._failed_step[: len(bits)])
        return bits | warning * over, np.where(first, steps_made, step), np.where(first, size, value)


def by_members(lanes: np.ndarray) -> np.ndarray:
    """Samples (packets, samples, numbers, width) by member, (samples, packets times width, numbers), a copy."""
    packets, samples, numbers, width = lanes.shape
    return lanes.transpose(1, 0, 3, 2).copy().reshape(samples, packets * width, numbers)


def columns_of(sizes: Mapping[str, int]) -> Any:
    """Columns into which the kernel writes the motion."""
    firsts = dict(zip(sizes, accumulate(sizes.values(), initial=0), strict=False))
    return wp.vec4i(*(firsts.get(name, -1) for name in SAMPLE_FIELDS))


def columns_at_ticks(plan: Plan) -> np.ndarray:
    """Columns of a tick's rows into which the kernel writes the motion."""
    columns, row, firsts = [], 0, {}
    for name, size in plan.layout.tick_fields.items():
        firsts[name], row = row, row + size
    for name, size in SAMPLE_FIELDS.items():
        rows = np.full(size, -1)
        if name in firsts:
            entries = plan.layout.tick_entries.get(name, range(size))
            rows[list(entries)] = firsts[name] + np.arange(len(entries))
        columns.append(rows)
    return np.concatenate(columns).astype(np.int32)
