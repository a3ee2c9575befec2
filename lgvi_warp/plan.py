"""From an ensemble to kernel launches: the kernel with only what the scene has, and packets of lanes for its blocks."""

from __future__ import annotations

import functools
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import warp as wp

from lgvi_kernels.advance import CHUNK, SAMPLE_FIELDS, STATE_FIELDS, Advance, Spec, make_advance
from lgvi_kernels.lanes import WIDTHS, int_lane
from lgvi_warp import notation, terms, warp_setup
from lgvi_warp.ensemble import Ensemble, Members
from lgvi_warp.errors import Faults
from lgvi_warp.machine import default_width
from lgvi_warp.method import Method, merged, simplified
from lgvi_warp.saveat import TimeGrid

DTYPES = ("float64", "float32")
CHECKS = ("none", "safe")

# One launch advances at most this many vehicle-steps and samples: so progress moves, an interrupt is heard, and the
# buffer that samples pass through stays small, however long the run is.
SEGMENT_VEHICLE_STEPS = 20_000_000
SEGMENT_SAMPLE_BYTES = 16_000_000

# Off-diagonal elements below this fraction of the largest element are the round-off of turning the axes.
DIAGONAL = 1e-14

_build = threading.Lock()


@dataclass(frozen=True)
class Block:
    """A run of members, first to stop: the unit of work."""

    first: int
    stop: int

    @property
    def count(self) -> int:
        """Members in it."""
        return self.stop - self.first


def blocks(members: int) -> list[Block]:
    """Runs of 256 to 4096 members, a power of two. Depends on the number of members only, so bits and files do too."""
    size = 256
    while size < 4096 and size * 64 <= members:
        size *= 2
    return [Block(i, min(i + size, members)) for i in range(0, members, size)]


@dataclass
class Outcome:
    """What a block's members came to: arrays over its members, and their samples by field, (k, count, ...)."""

    status: np.ndarray
    failed_step: np.ndarray
    failed_size: np.ndarray


def shape_of_mass(M: np.ndarray) -> str:
    """ "isotropic", "diagonal" or "full": the simplest that holds every matrix of M (n, 3, 3)."""
    off = np.abs(M[:, ~np.eye(3, dtype=bool)]).max(axis=1)
    diagonal = np.einsum("nii->ni", M)
    if np.any(off > DIAGONAL * np.abs(diagonal).max(axis=1)):
        return "full"
    return "isotropic" if np.all(diagonal == diagonal[:, :1]) else "diagonal"


def principal(parameters: terms.Parameters) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(Q, J, M): principal axes (n, 3, 3), principal inertia (n, 3) and mass matrix in these axes (n, 3, 3)."""
    Q, J = notation.principal_axes(parameters["vehicle.inertia"])
    mass = parameters["vehicle.mass"][:, None, None] * np.eye(3) + parameters["vehicle.added_mass"]
    return Q, J, np.swapaxes(Q, 1, 2) @ mass @ Q


def pack(values: np.ndarray, width: int) -> np.ndarray:
    """Members' rows (m, d) as packets (ceil(m / width), d, width); the last packet is filled up with its last member."""
    m, d = values.shape
    packets = -(-m // width)
    filled = np.concatenate([values, np.repeat(values[-1:], packets * width - m, axis=0)])
    return np.ascontiguousarray(filled.reshape(packets, width, d).transpose(0, 2, 1))


def _set_vector(target: np.ndarray, values: np.ndarray) -> None:
    """Fill a Lane3 field of a structured array from packed rows (packets, 3, width)."""
    for i, axis in enumerate("xyz"):
        target[axis] = values[:, i]


@dataclass(frozen=True)
class Plan:
    """Everything decided before a run: which kernel, which width, which steps.

    Raises SceneError for a dtype, width or checks that do not exist.
    """

    ensemble: Ensemble
    method: Method
    grid: TimeGrid
    fields: tuple[str, ...]
    dtype: str = "float64"
    width: int | None = None
    checks: str = "safe"
    spec: Spec = field(init=False)
    advance: Advance = field(init=False)
    kinds: tuple[terms.TermKind, ...] = field(init=False)

    def __post_init__(self) -> None:
        faults = Faults()
        faults.choice("dtype", self.dtype, DTYPES)
        faults.choice("checks", self.checks, CHECKS)
        if self.width is not None:
            faults.choice("width", self.width, WIDTHS)
        faults.raise_if_any()
        if self.width is None:
            object.__setattr__(self, "width", default_width(self.dtype))
        parameters = self.ensemble.parameters(0, self.ensemble.members)
        object.__setattr__(self, "kinds", terms.present(parameters))
        object.__setattr__(self, "spec", self._spec(shape_of_mass(principal(parameters)[2])))
        object.__setattr__(self, "advance", make_advance(self.spec))

    def _spec(self, mass: str) -> Spec:
        lead, maps = merged(simplified(self.method.program, mass == "isotropic"))
        return Spec(
            width=self.width,
            real=wp.float64 if self.dtype == "float64" else wp.float32,
            maps=maps,
            lead=lead,
            terms=tuple(kind.name for kind in self.kinds),
            mass=mass,
            solver=self.method.solver,
            iterations=self.method.iterations or 0,
            adaptive=self.method.iterations is None,
            checked=self.checks != "none",
            fields=tuple(name for name in SAMPLE_FIELDS if name in self.fields),
        )

    def compile(self) -> float:
        """Load the kernel, compiling it if Warp's cache has none. Returns the seconds it took."""
        start = time.perf_counter()
        warp_setup.start()
        with _build:
            wp.load_module(self.advance.kernel.module, device="cpu")
        _ = self.dtypes, self.times  # made here, before threads ask for them
        return time.perf_counter() - start

    @functools.cached_property
    def dtypes(self) -> tuple[np.dtype, np.dtype]:
        """NumPy's types of the kernel's Inertia and Params."""
        return np.dtype(self.advance.Inertia.numpy_dtype()), np.dtype(self.advance.Params.numpy_dtype())

    @functools.cached_property
    def times(self) -> tuple[Any, Any, Any]:
        """Kernel arguments that all blocks share: stage_h, lead_h and sample_step."""
        g = np.array(self.method.stages)
        due = np.append(self.grid.sample_steps, 2**31 - 1).astype(np.int32)
        return (
            wp.array(g * self.grid.h, dtype=self.spec.real, device="cpu"),
            wp.array((g + np.roll(g, -1)) * self.grid.h, dtype=self.spec.real, device="cpu"),
            wp.array(due, dtype=wp.int32, device="cpu"),
        )

    def due(self, k0: int, k1: int) -> tuple[int, int]:
        """(s0, s1): the samples s0 to s1 fall due after step k0 and up to step k1."""
        s0, s1 = np.searchsorted(self.grid.sample_steps, (k0, k1), side="right")
        return int(s0), int(s1)

    def segments(self, count: int) -> Iterator[tuple[int, int]]:
        """(k0, k1): launches from step k0 to step k1, for a block of `count` members."""
        due = self.grid.sample_steps
        per_sample = sum(SAMPLE_FIELDS[name] for name in self.spec.fields) * count * np.dtype(self.dtype).itemsize
        most_samples = max(1, SEGMENT_SAMPLE_BYTES // max(per_sample, 1))
        most_steps = max(CHUNK, SEGMENT_VEHICLE_STEPS // count // CHUNK * CHUNK)
        k = 0
        while k < self.grid.steps:
            last = self.due(k, k)[1] + most_samples
            k1 = min(k + most_steps, int(due[min(last, len(due)) - 1]))
            yield k, k1
            k = k1


class Packets:
    """One block's members in lanes, ready to launch."""

    def __init__(self, plan: Plan, members: Members):
        self.plan, self.members = plan, members
        self.Q, self.J, self.M = principal(members.parameters)
        self.scale = self.J.max(axis=1)
        width, Lane = plan.spec.width, plan.advance.Lane
        packets = -(-members.count // width)
        self.inertia = wp.array(self._inertia(), dtype=plan.advance.Inertia, device="cpu")
        self.params = wp.array(self._params(), dtype=plan.advance.Params, device="cpu")
        self.state = wp.array(self._state(), dtype=Lane, device="cpu")
        self.status = wp.zeros(packets, dtype=int_lane(width), device="cpu")
        self.failed_step = wp.zeros(packets, dtype=int_lane(width), device="cpu")
        self.failed_size = wp.zeros(packets, dtype=Lane, device="cpu")

    def _lanes(self, values: np.ndarray) -> np.ndarray:
        """Rows (1 or m, d) as (1 or packets, d, width) of the plan's dtype."""
        width = self.plan.spec.width
        if len(values) == 1:
            packed = np.repeat(values[:, :, None], width, axis=2)
        else:
            packed = pack(values, width)
        return packed.astype(self.plan.dtype)

    def _inertia(self) -> np.ndarray:
        J, M, scale = np.broadcast_arrays(self.J[:, :, None], self.M, self.scale[:, None, None])
        inverse = np.linalg.inv(M)
        rows = self._lanes(J[:, :, 0] / scale[:, :, 0])
        data = np.zeros(len(rows), self.plan.dtypes[0])
        _set_vector(data["J"], rows)
        data["inverse_scale"] = self._lanes(1.0 / scale[:, 0, :1])[:, 0]
        mean = np.einsum("nii->n", inverse) / 3.0
        data["mean"] = self._lanes(mean[:, None])[:, 0]
        deviation = inverse - mean[:, None, None] * np.eye(3)
        diagonal = self._lanes(np.einsum("nii->ni", deviation))
        if self.plan.spec.mass == "diagonal":
            _set_vector(data["anisotropy"], diagonal)
        elif self.plan.spec.mass == "full":
            _set_vector(data["anisotropy"]["diagonal"], diagonal)
            off = np.stack([deviation[:, 1, 2], deviation[:, 2, 0], deviation[:, 0, 1]], axis=1)
            _set_vector(data["anisotropy"]["off_diagonal"], self._lanes(off))
        return data

    def _params(self) -> np.ndarray:
        own = [kind.in_axes(self.members.parameters, self.Q) for kind in self.plan.kinds]
        varied = any(len(value) > 1 for values in own for value in values.values())
        packets = -(-self.members.count // self.plan.spec.width)
        data = np.zeros(packets if varied else 1, self.plan.dtypes[1])
        node = data
        for values in own:
            for key, value in values.items():
                if value.ndim == 1:
                    node["own"][key] = self._lanes(value[:, None])[:, 0]
                else:
                    _set_vector(node["own"][key], self._lanes(value))
            node = node["rest"]
        return data

    def _state(self) -> np.ndarray:
        m = self.members
        R = m.attitude @ self.Q
        nu = notation.rotate_into(self.Q, m.velocity)
        Om = notation.rotate_into(self.Q, m.angular_velocity)
        rows = np.empty((m.count, STATE_FIELDS))
        rows[:, :9] = R.reshape(-1, 9)
        rows[:, 9:12] = m.position
        rows[:, 12:15] = np.einsum("nij,nj->ni", np.broadcast_to(self.M, (m.count, 3, 3)), nu)
        rows[:, 15:] = self.J / self.scale[:, None] * Om
        return pack(rows, self.plan.spec.width).astype(self.plan.dtype)

    def advance(self, k0: int, k1: int) -> np.ndarray:
        """Make the steps k0 to k1. Returns the samples due then, (s1 - s0, packets * width, numbers of a sample)."""
        plan = self.plan
        s0, s1 = plan.due(k0, k1)
        numbers = sum(SAMPLE_FIELDS[name] for name in plan.spec.fields)
        packets, width = self.state.shape[0], plan.spec.width
        out = wp.empty((packets, max(1, (s1 - s0) * numbers)), dtype=plan.advance.Lane, device="cpu")
        inputs = [self.inertia, self.params, plan.spec.real(plan.method.residual_tolerance(plan.dtype))]
        stage_h, lead_h, sample_step = plan.times
        inputs += [stage_h, lead_h, k0, k1, s0, sample_step]
        inputs += [self.state, self.status, self.failed_step, self.failed_size, out]
        with _build:
            command: Any = wp.launch(plan.advance.kernel, dim=packets, inputs=inputs, device="cpu", record_cmd=True)
        command.launch()
        samples = out.numpy()[:, : (s1 - s0) * numbers].reshape(packets, s1 - s0, numbers, width)
        return samples.transpose(1, 0, 3, 2).reshape(s1 - s0, packets * width, numbers)

    def outcome(self) -> Outcome:
        """Status, steps made before the failure and the value that crossed its limit, of each member."""
        m = self.members.count
        return Outcome(
            self.status.numpy().reshape(-1)[:m].astype(np.uint8),
            self.failed_step.numpy().reshape(-1)[:m].astype(np.int64),
            np.sqrt(self.failed_size.numpy().reshape(-1)[:m].astype(np.float64)),
        )
