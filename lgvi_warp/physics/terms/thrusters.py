# SPDX-License-Identifier: Apache-2.0
"""Thrusters with a thrust curve (square, polynomial or table), dead band, saturation, lag, and loss by advance speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.physics.notation import repeated
from lgvi_warp.physics.terms import thruster_power
from lgvi_warp.physics.terms.actuators import (
    Commanded,
    motion,
    packed_following,
    refuse_idle,
    refuse_unread,
)
from lgvi_warp.physics.terms.base import (
    MOST_UNROLLED,
    Numbers,
    Packed,
    PackingContext,
    knots,
    number,
    rows_of,
    side_by_side,
)
from lgvi_warp.physics.terms.thrust_curves import (
    SQUARE,
    parted,
    polynomial_values,
    side_of_table,
    solve,
    table_values,
    unfit,
)


@dataclass(frozen=True, eq=False, kw_only=True)
class Thrusters(Commanded):
    """n thrusters, each with thrust = c+ f+(max(u - band, 0)) - c- f-(max(-u - band, 0)) along its direction (Fossen 2021, 9).

    f(w) = polynomial_1 w + polynomial_2 w^2 + ..., by default w^2, or a table; f+ is f ahead, f- is f astern. band is the
    dead band. u follows the command with the lag, within the limit and the rate limit. A single number stands for n equal
    numbers. The user chooses the unit of the command, such as 1, V or rad/s.

    Beyond the dead band, w = sign(u) max(|u| - band, 0). Thrust falls by advance_loss |w| a and torque by torque_loss |w| a,
    where a is the speed of the thruster through the water along its direction (Fossen 2021, 9.1).

    Args:
        position: Point at which each thrust acts, (n, 3) [m] from the body's origin.
        direction: Direction in which each thruster pushes the vehicle, (n, 3), of any length but 0.
        coefficient: Coefficient c+ ahead, (n,) [N per unit of f]; 1 by default if a polynomial or a table [N] is given.
        coefficient_astern: Coefficient c- astern, (n,) [N per unit of f]; by default the coefficient ahead.
        polynomial: Polynomial f+ of all thrusters, (p,), from the first power up; w^2 by default.
        polynomial_astern: Polynomial f- of all thrusters, (q,), from the first power up; by default the polynomial ahead.
        table_commands: Commands of a table of thrust, (t,) [unit], rising; instead of polynomials. None by default.
        table_thrusts: Thrusts at these commands, (t, n) [N], or (t,) for n equal thrusters, linear between the commands and
            constant outside. They must rise and be 0 at the command 0; near this command several may be 0.
        advance_loss: Coefficient of the loss of thrust ahead, (n,) [N per unit and m/s]; by default there is no loss.
        advance_loss_astern: The same coefficient astern, (n,) [N per unit and m/s]; by default the coefficient ahead.
        torque_coefficient: Torque on the vehicle about the thruster's direction, divided by w |w|, (n,) [N m per unit^2]. Its
            sign depends on the propeller's sense of rotation. By default there is no torque.
        torque_loss: Coefficient of the loss of torque, (n,) [N m per unit and m/s]; 0 by default. It has the torque's sign.
        power_commands: Values of w of a table of power, (s,) [unit], rising, as in the table of thrust. By default they are
            the `table_commands`.
        power: Electrical power at these commands, (s, n) [W], or (s,) for n equal thrusters, linear between the commands and
            constant outside. By default no power is counted (see `EnergyUse`).
        shaft_speed: Angular speed of the propeller per unit of w, (n,) [rad/s per unit], instead of `power`. Power is then
            torque times shaft speed, divided by the efficiency. None by default.
        efficiency: Mechanical power of the shaft divided by electrical power, (n,); 1 by default.
        dead_band: Size of the command below which there is no thrust, (n,) [unit]; 0 by default.
        limit: Largest size of the command, (n,) [unit]; 1e6 by default.
        time_constant: Time constant of the first-order lag from the command to u, (n,) [s]; 0 by default (no lag).
        rate_limit: Largest rate of u, (n,) [unit/s]; by default there is no limit.
        command: Constant command, (n,) [unit]; 0 by default.
        times: Times of the schedule, (k,) [s], rising.
        command_schedule: Commands at these times, (k, n) [unit], linear between them; instead of `command`.

    Methods:
        thrust: Steady thrust at given commands.
        command_for: The smallest commands that give requested thrusts.

    Raises:
        SceneError: If a direction has length 0, times or a table do not rise, the command is given twice, a table is given
            together with a polynomial, or none of coefficient, polynomial and table is given. Also if a number is invalid
            (see `Term`).

    Examples:
        >>> import lgvi_warp as lw
        >>> thrusters = lw.terms.Thrusters(
        ...     position=[[-0.7, 0, 0]], direction=[[1, 0, 0]], coefficient=[4e-6], command=[1200.0]
        ... )
        >>> result = lw.solve(lw.Scene.named("torpedo", terms=[thrusters]), h=0.05, t1=1.0)
        >>> print(f"{result.velocity[-1, 0, 0]:.2f} m/s")
        0.16 m/s
    """

    type: ClassVar[str] = "thrusters"

    position: Any = number(("n", 3), "m")
    direction: Any = number(("n", 3), "1")
    coefficient: Any = number(("n",), "N per unit^2", None, least=0.0)
    coefficient_astern: Any = number(("n",), "N per unit^2", None, least=0.0)
    polynomial: Any = number(("p",), "1 per unit, 1 per unit^2 ...", None)
    polynomial_astern: Any = number(("q",), "1 per unit, 1 per unit^2 ...", None)
    table_commands: Any = number(("t",), "unit", None, rising=True, optional=True)
    table_thrusts: Any = number(("t", "n"), "N", None, optional=True)
    advance_loss: Any = number(("n",), "N per unit and m/s", None, least=0.0, optional=True)
    advance_loss_astern: Any = number(("n",), "N per unit and m/s", None, least=0.0, optional=True)
    torque_coefficient: Any = number(("n",), "N m per unit^2", None, optional=True)
    torque_loss: Any = number(("n",), "N m per unit and m/s", None, optional=True)
    power_commands: Any = number(("s",), "unit", None, rising=True, optional=True)
    power: Any = number(("s", "n"), "W", None, least=0.0, optional=True)
    shaft_speed: Any = number(("n",), "rad/s per unit", None, least=0.0, optional=True)
    efficiency: Any = number(("n",), "1", None, above=0.0, most=1.0, optional=True)
    dead_band: Any = number(("n",), "unit", None, least=0.0)
    limit: Any = number(("n",), "unit", None, least=0.0)
    time_constant: Any = number(("n",), "s", None, least=0.0)
    rate_limit: Any = number(("n",), "unit/s", None, least=0.0, optional=True)
    command: Any = number(("n",), "unit", None)
    times: Any = number(("k",), "s", None, rising=True)
    command_schedule: Any = number(("k", "n"), "unit", None)

    def __post_init__(self) -> None:
        if self.coefficient is None:
            if self.polynomial is None and self.table_commands is None:
                fault, remedy = "is missing", "give (n,) [N per unit^2], a table [N], or a polynomial [N]"
                raise refusal(f"{self.key}.coefficient", None, fault, remedy)
            object.__setattr__(self, "coefficient", np.ones(rows_of(self.position)))
        for name, value in (("polynomial", SQUARE), ("polynomial_astern", self.polynomial)):
            if getattr(self, name) is None:
                object.__setattr__(self, name, SQUARE if value is None else value)
        n = rows_of(self.position)
        self.repeat(n, "coefficient")
        if self.advance_loss is None and self.advance_loss_astern is not None:
            object.__setattr__(self, "advance_loss", np.zeros(n))
        if self.advance_loss_astern is None and self.advance_loss is not None:
            object.__setattr__(self, "advance_loss_astern", self.advance_loss)
        if np.ndim(np.asarray(self.table_thrusts, dtype=object)) == 1:
            object.__setattr__(self, "table_thrusts", [[value] * n for value in self.table_thrusts])
        self.repeat(n, *OPTIONAL)
        thruster_power.settle(self, n)
        defaults = {"coefficient_astern": self.coefficient, "dead_band": np.zeros(n), "limit": np.full(n, 1e6),
                    "time_constant": np.zeros(n)}  # fmt: skip
        if self.command_schedule is None:
            self.repeat(n, "times")
        self.settle_commands(n)
        for name, value in defaults.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)
        self.repeat(n, *defaults)
        if self.torque_loss is not None:
            # The torque is not along the velocity that it falls with.
            object.__setattr__(self, "dissipative", False)
        super().__post_init__()

    @property
    def propels(self) -> bool:
        """Whether thrust falls with the advance speed, or propellers exert a torque on the vehicle."""
        return any(getattr(self, name) is not None for name in PROPELLER)

    @property
    def powered(self) -> str:
        """Relation of power to command, in a scene that accounts the energy used (see thruster_power.kind_of)."""
        return thruster_power.kind_of(self) if self.accounted else ""

    @property
    def shape(self) -> str:
        """Relation of thrust to command: "square", "polynomial" or "table"."""
        if self.table_commands is not None:
            return "table"
        return "square" if self.is_square else "polynomial"

    @property
    def is_square(self) -> bool:
        """Whether the curves ahead and astern are w^2."""
        return all(np.array_equal(curve, SQUARE) for curve in (self.polynomial, self.polynomial_astern))

    @property
    def channels(self) -> int:
        return len(self.coefficient)

    def effect(self, numbers: Numbers, parameters: Numbers, speed: np.ndarray) -> np.ndarray:
        # The wrench of a unit of thrust of each thruster, about the body's origin.
        position, direction = repeated(numbers["position"], numbers["direction"])
        direction = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
        wrench = np.concatenate([direction, np.cross(position, direction)], axis=-1)
        return np.swapaxes(wrench, -1, -2)

    @property
    def pushes_steadily(self) -> bool:
        """Whether force and torque are constant in body axes, since commands are constant and thrust has no advance loss."""
        lossless = self.advance_loss is None and self.torque_loss is None
        return self.driver is None and self.holds and lossless

    def device_in(self, aligned: bool) -> str:
        if self.pushes_steadily:
            return "thrusters_held:power" if self.powered else "thrusters_held"
        driven = self.driver is not None
        # Members may bring in a lag where the scene has a limited rate.
        motions = motion(self) if driven else {"lag": self.slow, "rate": self.rate_limit is not None}
        features = (
            {"driven": driven, "scheduled": not driven}
            | {name: acts and self.memory for name, acts in motions.items()}
            | {"table": self.shape == "table", f"powers{self.powers}": self.shape == "polynomial"}
            | {"propeller": self.propels, self.powered: bool(self.powered)}
        )
        return f"thrusters_with:{','.join(name for name, present in features.items() if present)}"

    @property
    def pattern_device(self) -> str:  # type: ignore[override]
        """Device code that leaves out zeros of the wrenches, for few thrusters without advance loss and torque."""
        return "" if self.pushes_steadily or self.propels or self.channels > MOST_UNROLLED else self.device_in(True)

    def entries(self, numbers: Numbers) -> tuple[str, ...]:
        # Of the wrench of each thruster in the user's axes, wherever it is: so positions may vary with the same device code.
        acts = numbers["direction"] != 0.0
        rows = np.concatenate([acts, acts[..., [1, 0, 0]] | acts[..., [2, 2, 1]]], axis=-1)
        curves, _ = self.curve_rows(numbers)
        words = () if self._plain(numbers, parted(curves)[1] if self.shape == "polynomial" else True) else ("sided",)
        return words + tuple(f"{i}f{j}" for i in range(self.channels) for j in range(6) if np.any(rows[:, i, j]))

    def _plain(self, numbers: Numbers, odd: bool) -> bool:
        """Whether all members have equal thrust ahead and astern and no dead band; odd: Whether the curves are odd."""
        alike = np.all(numbers["coefficient"] == numbers["coefficient_astern"])
        return bool(odd and alike and not np.any(numbers["dead_band"]))

    @property
    def powers(self) -> int:
        """Number of powers of the longer polynomial."""
        return max(len(self.polynomial), len(self.polynomial_astern))

    def to_dict(self) -> dict[str, Any]:
        # The term as a table of a scene file: of its commands what acts; polynomials only where they are not w^2.
        left_out = ("polynomial", "polynomial_astern") if self.is_square else ()
        return {key: value for key, value in super().to_dict().items() if key not in left_out}

    def thrust(self, command: Any) -> np.ndarray:
        """Steady thrust at given commands, without speed through the water; commands beyond the limits are clipped.

        Args:
            command: Commands of the n thrusters, (n,) or k of each, (k, n) [unit of the command].

        Returns:
            Thrust (n,) or (k, n) [N] along each direction.
        """
        command = np.asarray(command, dtype=np.float64)
        numbers = {name: value[None] for name, value in self.parameters().items()}
        return self._thrusts(numbers, self._beyond(numbers, np.atleast_2d(command))).reshape(command.shape)

    def largest_thrust(self, numbers: Numbers, command: np.ndarray) -> np.ndarray:
        """Largest steady thrust of any thruster at commands of either sign, as a size.

        Args:
            numbers: The term's numbers by field.
            command: Sizes of the commands (n, units) [unit].

        Returns:
            Sizes (n,) [N].
        """
        both = [np.abs(self._thrusts(numbers, self._beyond(numbers, sign * command))) for sign in (1.0, -1.0)]
        return np.asarray(np.maximum(*both).max(axis=1))

    def _beyond(self, numbers: Numbers, command: np.ndarray) -> np.ndarray:
        """Commands (n, units) within their limits, minus the dead band."""
        u = np.clip(command, -numbers["limit"], numbers["limit"])
        return np.asarray(np.sign(u) * np.maximum(np.abs(u) - numbers["dead_band"], 0.0))

    def _thrusts(self, numbers: Numbers, w: np.ndarray) -> np.ndarray:
        """Thrusts (n, units) [N] at zero advance speed, for commands w (n, units) beyond the dead band."""
        if self.shape == "table":
            f = table_values(numbers["table_commands"], numbers["table_thrusts"], w)
        else:
            ahead, astern = np.maximum(w, 0.0), np.maximum(-w, 0.0)
            f = polynomial_values(numbers["polynomial"], ahead) - polynomial_values(
                numbers["polynomial_astern"], astern
            )
        return np.asarray(np.where(w > 0.0, numbers["coefficient"], numbers["coefficient_astern"]) * f)

    def drive(self) -> np.ndarray:
        # The largest force and torque of all thrusters together, over the times of the schedule.
        along = self.direction / np.linalg.norm(self.direction, axis=1, keepdims=True)
        wrenches = np.concatenate([along, np.cross(self.position, along)], axis=1)
        return np.asarray(np.abs(self.thrust(self.command_schedule) @ wrenches).max(axis=0))

    def command_for(self, thrust: Any) -> np.ndarray:
        """The smallest commands that give requested thrusts.

        Args:
            thrust: Thrusts of the n thrusters, (n,) [N], or one number for all.

        Returns:
            Commands (n,) [unit of the command]; if a curve does not reach the thrust, the command of its largest thrust.
        """
        least_commands = np.zeros(len(self.coefficient))
        for i, wanted in enumerate(np.broadcast_to(np.asarray(thrust, dtype=np.float64), least_commands.shape)):
            side = 1.0 if wanted > 0.0 else -1.0
            curve = self.polynomial if side > 0.0 else self.polynomial_astern
            gain = self.coefficient if side > 0.0 else self.coefficient_astern
            if wanted and gain[i] > 0.0:
                reach, size = max(self.limit[i] - self.dead_band[i], 0.0), abs(wanted) / gain[i]
                if self.shape == "table":
                    places, values = side_of_table(self.table_commands[None], self.table_thrusts[None, :, i], side)
                    w = np.interp(size, values[0], places[0])
                else:
                    w = solve(curve, size, reach)
                least_commands[i] = side * (self.dead_band[i] + w)
        return np.clip(least_commands, -self.limit, self.limit)

    def check(self, faults: Faults) -> None:
        zero = np.flatnonzero(np.linalg.norm(self.direction, axis=1) == 0.0)
        if len(zero):
            remedy = "give the direction that the thrust pushes the vehicle, such as [1, 0, 0]"
            faults.add(f"direction[{zero[0]}]", self.direction[zero[0]], "has zero length", remedy)
        if (self.table_commands is None) != (self.table_thrusts is None):
            alone = "table_commands" if self.table_thrusts is None else "table_thrusts"
            faults.add(alone, getattr(self, alone), "is given alone", "give table_commands and table_thrusts, or none")
        elif self.table_commands is not None:
            if not self.is_square:
                faults.add("polynomial", self.polynomial, "is given beside a table", "keep one of them")
            if unfit(self.table_commands[None], self.table_thrusts[None])[0]:
                fault = "does not rise from below 0 through 0 at the command 0"
                faults.add(
                    "table_thrusts", self.table_thrusts, fault, "sort it, and count commands from the neutral one"
                )
        if self.torque_loss is not None and self.torque_coefficient is None:
            faults.add("torque_loss", self.torque_loss, "is given without torque_coefficient", "give both")
        thruster_power.check(self, faults)
        if vars(self)["commanded_twice"]:
            faults.add("command", self.command, "differs from the first of command_schedule", "keep one of them")

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        # In addition, refuses directions without length; raises SceneError for members' numbers that would have no effect.
        bad = super().unphysical(numbers)
        bad["direction"] = bad["direction"] | np.any(~np.any(numbers["direction"], axis=-1), axis=-1)
        remedy = f"give {self.key}.time_constant above 0 [s] in the scene as well"
        if "table_commands" in numbers:
            bad["table_thrusts"] = bad["table_thrusts"] | unfit(numbers["table_commands"], numbers["table_thrusts"])
        refuse_idle(self, numbers, "time_constant", numbers["time_constant"] > 0.0, remedy)
        self._refuse_idle_polynomial(numbers)
        if self.driver is not None:
            refuse_unread(self, numbers)
        return bad

    def _refuse_idle_polynomial(self, numbers: Numbers) -> None:
        """Refuse members' polynomials in a scene without polynomials, whose device code does not read them."""
        faults = Faults(f"{self.key}.")
        for name in ("polynomial", "polynomial_astern"):
            if self.is_square and not np.all(numbers[name] == SQUARE):
                fault = "does not act: the scene has none"
                faults.add(name, numbers[name][0], fault, f"give {self.key}.{name} in the scene as well")
        faults.raise_if_any()

    @property
    def slow(self) -> bool:
        # Whether thrusters have a limited rate, or one of them a lag.
        if self.driver is not None:
            return any(motion(self).values())
        return bool(self.rate_limit is not None or np.any(self.time_constant > 0.0))

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The device rows: those of each thruster, then the command table of each thruster; or the sum of all that they push.
        direction = numbers["direction"] / np.linalg.norm(numbers["direction"], axis=-1, keepdims=True)
        arms = np.cross(numbers["position"] + 0.0 * direction, direction + 0.0 * numbers["position"])
        if self.pushes_steadily:
            return self._packed_push(numbers, context, direction, arms)
        force, torque = context.frame.vector(direction), context.frame.torque(arms, direction + 0.0 * arms)
        blocks = [numbers[key][..., None] for key in ("coefficient", "coefficient_astern", "dead_band")]
        if self.propels:
            none = np.zeros_like(numbers["coefficient"])
            losses = (numbers.get(key, none)[..., None] for key in PROPELLER)
            blocks += [context.frame.vector(direction), *losses]
        curves, size = self.curve_rows(numbers)
        odd = True
        if self.shape == "polynomial":
            curves, odd = parted(curves)
        words = {"plain": int(self._plain(numbers, odd))}
        shared = curves
        if self.powered:
            watts, intervals = thruster_power.rows(self, numbers)
            shared = side_by_side(curves, watts)
            words |= {"power": curves.shape[1], "power_size": intervals}
        each = side_by_side(force, torque, *blocks)
        return packed_following(self, numbers, each, shared, size, 6, words, context.time)

    def _packed_push(
        self, numbers: Numbers, context: PackingContext, direction: np.ndarray, arms: np.ndarray
    ) -> Packed:
        """Force and torque of constant commands; direction, arms: Force and torque per unit of thrust, (n, units, 3)."""
        # Members whose numbers overflow fail in their first step.
        with np.errstate(over="ignore", invalid="ignore"):
            w = self._beyond(numbers, numbers["command"])
            thrust = self._thrusts(numbers, w)
            force, torque = _summed(thrust, direction), _summed(thrust, arms)
            if self.torque_coefficient is not None:
                torque = torque + _summed(numbers["torque_coefficient"] * w * np.abs(w), direction)
            force, torque = repeated(force, torque)
            values = {"force": context.frame.vector(force), "torque": context.frame.torque(torque, force)}
            if self.powered:
                values["power"] = thruster_power.at_rest(self, numbers, w).sum(axis=1)
            return Packed(values)

    def curve_rows(self, numbers: Numbers) -> tuple[np.ndarray, int]:
        """The thrust curves in the form that an allocation reads.

        Args:
            numbers: The term's numbers by field.

        Returns:
            Rows (1 or n, rows): none for a square, the polynomials ahead and astern, or a table for each thruster; and the
            number of powers or intervals.
        """
        if self.shape == "square":
            return np.zeros((1, 0)), 0
        if self.shape == "table":
            at, values = numbers["table_commands"], numbers["table_thrusts"]
            tables = [knots(at, values[:, :, i : i + 1]) for i in range(self.channels)]
            return side_by_side(*tables), at.shape[1] - 1
        ahead, astern = numbers["polynomial"], numbers["polynomial_astern"]
        padded = [np.pad(curve, ((0, 0), (0, self.powers - curve.shape[1]))) for curve in (ahead, astern)]
        return side_by_side(*padded), self.powers


# Numbers of propellers in the order of their rows, and all that may be absent with one number for each thruster.
PROPELLER = ("advance_loss", "advance_loss_astern", "torque_coefficient", "torque_loss")
OPTIONAL = (*PROPELLER, "rate_limit")


def _summed(sizes: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """The sum of vectors (n, units, 3) times sizes (n, units), added one by one, so that the bits do not depend on n."""
    total = np.zeros((1, 3))
    for i in range(vectors.shape[1]):
        total = total + sizes[:, i, None] * vectors[:, i]
    return total
