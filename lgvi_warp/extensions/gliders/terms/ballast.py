# SPDX-License-Identifier: Apache-2.0
"""Volumes that a vehicle displaces in addition to its hull: constant, by a schedule, or commanded by a controller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.extensions.gliders import DEVICE
from lgvi_warp.extensions.gliders.terms.density_profile import in_profile, profile_rows
from lgvi_warp.physics.terms.actuators import Commanded, motion, packed_following, refuse_idle, refuse_unread
from lgvi_warp.physics.terms.base import (
    CONSERVED,
    Array,
    Numbers,
    Packed,
    PackingContext,
    Term,
    number,
    own,
    rows_of,
    side_by_side,
)
from lgvi_warp.physics.terms.wrench import at_start, commands


@dataclass(frozen=True, eq=False, kw_only=True)
class Ballast(Commanded):
    """n volumes V of water displaced in addition to the hull: force -rho g V R^T e3 at points of the body (Graver 2005).

    R^T e3 is the downward vertical in body axes. V follows the command after the lag, within the limit and the rate limit. A
    positive V lifts the vehicle, a negative V sinks it. To model a weight of N newtons in water, use V = -N / (rho g). The
    vehicle's mass does not change, as when oil is pumped into a bladder.

    With an efficiency, the pump's work is part of the energy used (`EnergyUse`). The energy is the water's pressure relative
    to the surface, times the volume that is pumped out, divided by the efficiency. If the pressure pushes volume back in,
    no energy is used or recovered.

    Args:
        position: Point at which each volume acts, (n, 3) [m] from the body's origin; by default one volume at the origin.
        limit: Largest size of the command, (n,) [m3]; 1e6 by default.
        time_constant: Time constant of the first-order lag from the command to V, (n,) [s]; 0 by default, for no lag.
        rate_limit: Largest rate of change of V, such as the pump's rate, (n,) [m3/s]; by default no limit.
        efficiency: Work against the water's pressure divided by the electrical energy of each pump, (n,), above 0 and at
            most 1. If omitted, the volumes use no energy, as when weights are dropped.
        command: Constant volume, (n,) [m3]; 0 by default.
        times: Times of the schedule, (k,) [s], rising.
        command_schedule: Volumes at these times, (k, n) [m3], linear between them; instead of `command`.

    Raises:
        SceneError: If times do not rise, `command` differs from the first volumes of the schedule, or a number is invalid
            (see `Term`).

    Examples:
        >>> import lgvi_warp as lw
        >>> ballast = lw.terms.Ballast(command=[-2e-4])
        >>> result = lw.solve(lw.Scene.named("torpedo", terms=[ballast]), h=0.05, t1=1.0)
        >>> print(f"{1000 * result.position[-1, 0, 2]:.1f} mm down")
        15.0 mm down
    """

    type: ClassVar[str] = "ballast"
    device: ClassVar[str] = f"{DEVICE}.ballast"
    # The density of the water by depth, where the scene has a profile; set for a term of a scene.
    profile: ClassVar[Any] = None

    position: Any = number(("n", 3), "m", ((0.0, 0.0, 0.0),))
    limit: Any = number(("n",), "m3", None, least=0.0)
    time_constant: Any = number(("n",), "s", None, least=0.0)
    rate_limit: Any = number(("n",), "m3/s", None, least=0.0, optional=True)
    efficiency: Any = number(("n",), "1", None, above=0.0, most=1.0, optional=True)
    command: Any = number(("n",), "m3", None)
    times: Any = number(("k",), "s", None, rising=True)
    command_schedule: Any = number(("k", "n"), "m3", None)

    def __post_init__(self) -> None:
        n = rows_of(self.position)
        if self.command_schedule is None:
            self.repeat(n, "times")
        self.settle_commands(n)
        for name, value in {"limit": np.full(n, 1e6), "time_constant": np.zeros(n)}.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)
        self.repeat(n, "limit", "time_constant", "rate_limit", "efficiency")
        super().__post_init__()

    def beside(self, terms: Sequence[Term]) -> Any:
        # Knows the density of the water by depth.
        return in_profile(super().beside(terms), terms)

    @property
    def looks_at_surface(self) -> bool:  # type: ignore[override]
        # Where density or pressure at its depth act.
        return self.profile is not None or self.powered

    @property
    def channels(self) -> int:
        return len(self.position)

    @property
    def steady(self) -> bool:
        """Whether the volumes never change."""
        return self.driver is None and self.holds

    @property
    def slow(self) -> bool:
        # Whether some volume has a limited rate, or a lag.
        if self.driver is not None:
            return any(motion(self).values())
        return bool(self.rate_limit is not None or np.any(self.time_constant > 0.0))

    @property
    def powered(self) -> bool:
        """Whether the scene's energy account includes the work of these pumps."""
        return self.accounted and self.efficiency is not None and not self.steady

    @property
    def memory(self) -> bool:
        # In addition, the volumes and pressures of the last look.
        return super().memory or self.powered

    @property
    def conserves(self) -> frozenset[str]:
        # All three: the potential of a constant volume depends only on the depth of its point.
        return CONSERVED if self.steady else frozenset()

    def device_in(self, aligned: bool) -> str:
        if self.steady:
            return self.device if self.profile is None else f"{self.device}_in_profile"
        driven = self.driver is not None
        # Members may bring in a lag where the scene has a limited rate.
        motions = motion(self) if driven else {"lag": self.slow, "rate": self.rate_limit is not None}
        moves = super().memory
        features = [
            "driven" if driven else "scheduled",
            *(name for name, acts in motions.items() if acts and moves),
            *["power"] * self.powered,
            *["profile"] * (self.profile is not None),
        ]
        return f"{DEVICE}.ballast_with:{','.join(features)}"

    def check(self, faults: Faults) -> None:
        if vars(self)["commanded_twice"]:
            faults.add("command", self.command, "differs from the first of command_schedule", "keep one of them")

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        # In addition, raises SceneError for members' numbers that would have no effect.
        bad = super().unphysical(numbers)
        remedy = f"give {self.key}.time_constant above 0 [s] in the scene as well"
        refuse_idle(self, numbers, "time_constant", numbers["time_constant"] > 0.0, remedy)
        if self.driver is not None:
            refuse_unread(self, numbers)
        return bad

    def effect(self, numbers: Numbers, parameters: Numbers, speed: np.ndarray) -> np.ndarray:
        # The wrench of 1 m3 of each volume on an upright vehicle, about the body's origin; without gravity, as if it were 1.
        gravity = {"environment.gravity": np.ones(1)}
        up = np.array([0.0, 0.0, -1.0]) * specific_weight({**gravity, **parameters})[:, None, None]
        force, position = np.broadcast_arrays(up, numbers["position"])
        return np.swapaxes(np.concatenate([force, np.cross(position, force)], axis=-1), -1, -2)

    def drive(self) -> np.ndarray:
        # The largest buoyancy along any axis, and its moments, over the times of the schedule, in sea water.
        volumes = np.clip(self.command_schedule, -self.limit, self.limit)
        lifts, moments = abs(volumes.sum(axis=1)).max(), np.abs(volumes @ self.position).max(axis=0)
        return SEA_WATER * np.array([lifts, lifts, lifts, *np.maximum(moments[[1, 0, 0]], moments[[2, 2, 1]])])

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The device rows of each volume, and of its schedule; or the sum of what is held.
        weight = specific_weight(context.parameters)
        points = context.frame.point(numbers["position"])
        table, count = (None, 0) if self.profile is None else profile_rows(self, context.parameters)
        if self.steady:
            if table is not None:
                forces = -weight[:, None] * np.clip(numbers["command"], -numbers["limit"], numbers["limit"])
                rows = side_by_side(forces[..., None], points).reshape(max(len(forces), len(points)), -1)
                words = {"count": points.shape[1], "density": rows.shape[1], "density_knots": count}
                return Packed(words, side_by_side(rows, table))
            net, lever = _held(numbers, weight, points)
            return Packed({"net": net, "lever": lever})
        each = np.broadcast_arrays(weight[:, None, None], points[..., :1])[0]
        blocks = side_by_side(each, each * points)
        if self.powered:
            blocks = side_by_side(blocks, 1.0 / numbers["efficiency"][..., None])
            return self._with_work(numbers, blocks, context, table, count)
        return packed_following(self, numbers, blocks, table, count, start=context.time)

    def _with_work(
        self, numbers: Numbers, blocks: Array, context: PackingContext, table: Array | None, size: int
    ) -> Packed:
        """Packed numbers with a memory of the volumes and pressures at the last step; pressures are -1 before the first."""
        plain, start = self.beside_account(False), np.zeros((1, self.channels))
        if self.driver is None:
            start = at_start(*commands(numbers), context.time)
            start = np.clip(start, -numbers["limit"], numbers["limit"])
        # Where the account lies is filled in with the rows of the memory.
        words = {"account_row": -1, "tally": self.channels if plain.memory else 0}
        packed = packed_following(plain, numbers, blocks, table, size, words=words, start=context.time)
        tally = np.stack(np.broadcast_arrays(start, -1.0), axis=-1).reshape(len(start), -1)
        return packed._replace(memory=tally if packed.memory is None else side_by_side(packed.memory, tally))

    def potential(self, numbers: Numbers, position: Array, attitude: Array, parameters: Numbers) -> Array | float:
        # U = -(net b3 + lever.R^T e3), (k, n) [J], of volumes that are held: else the pump does work.
        if not self.steady:
            return 0.0
        if self.profile is not None:
            return self._in_profile(numbers, position, attitude, parameters)
        net, lever = _held(numbers, specific_weight(parameters), numbers["position"])
        return -(net * position[..., 2] + np.sum(lever * attitude[..., 2, :], axis=-1))

    def _in_profile(self, numbers: Numbers, position: Array, attitude: Array, parameters: Numbers) -> Array:
        """The potential in water whose density varies with depth: volumes times the weight of the water column above them."""
        profile, density = own(self.profile, parameters), parameters["environment.water_density"]
        volumes = np.clip(numbers["command"], -numbers["limit"], numbers["limit"])
        total = np.zeros(position.shape[:-1])
        for i in range(self.channels):
            depth = position[..., 2] + np.sum(numbers["position"][:, i] * attitude[..., 2, :], axis=-1)
            total = total + volumes[:, i] * self.profile.column(profile, density, depth)
        return np.asarray(specific_weight(parameters) * total)


# Buoyancy of 1 m3 of sea water [N]: for sizes of which a choice depends, no result.
SEA_WATER = 1025.0 * 9.81


def specific_weight(parameters: Numbers) -> np.ndarray:
    """rho g, the buoyancy of 1 m3 (n,) [N/m3]."""
    return np.asarray(parameters["environment.water_density"] * parameters["environment.gravity"])


def _held(numbers: Numbers, weight: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Downward force (n,) [N] of constant volumes, and the sum of points (n, volumes, 3) times forces (n, 3) [N m]."""
    volumes = np.clip(numbers["command"], -numbers["limit"], numbers["limit"])
    net, lever = np.zeros(1), np.zeros((1, 3))
    # One after the other: the same bits for one member and for many.
    for i in range(points.shape[1]):
        force = -weight * volumes[:, i]
        net, lever = net + force, lever + force[:, None] * points[:, i]
    return net, lever
