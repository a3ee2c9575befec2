"""The base classes of a controller's parts: numbers as those of terms, and where each part finds what others write."""

from __future__ import annotations

import copy
import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, TypeVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term

# What guidance may give, and laws may need.
WISHES = ("depth", "position", "velocity", "heading", "attitude", "angular_velocity", "speed")


class Bus(NamedTuple):
    """The first rows of the memory, by which parts hand numbers on: {actuator: (first row, channels)} and single rows.

    Args:
        commands: Rows of the commands of each actuator, by the key of its term.
        unmet: First of six rows with what of the demand X Y Z K M N the last look did not deliver.
        report: First of as many rows as there are commands, where actuators say where they are.
        acting: First row of the commands that act, where commands are delayed. As many rows of the commands before follow, and
            the row of the step from which the former act.
        rows: Number of rows.
        delayed: Whether the commands of some member are delayed.
    """

    commands: Mapping[str, tuple[int, int]]
    unmet: int
    report: int
    acting: int
    rows: int
    delayed: bool = False

    @property
    def channels(self) -> int:
        """Number of commands."""
        return self.unmet

    @classmethod
    def of(cls, channels: Mapping[str, int]) -> Bus:
        """The bus of some actuators.

        Args:
            channels: Number of commands of each, by the key of its term.

        Returns:
            Rows for all of them.
        """
        commands, row = {}, 0
        for key, count in channels.items():
            commands[key] = (row, count)
            row += count
        return cls(commands, row, row + 6, 2 * row + 6, 4 * row + 7)

    def values_of(self, key: str) -> dict[str, Any]:
        """What the device code of an actuator reads.

        Args:
            key: Key of its term.

        Returns:
            Fields `commands` and `report` of its struct.
        """
        first = self.commands[key][0]
        if not self.delayed:
            return {"commands": {"row": first}, "report": self.report + first}
        rows = {"row": self.acting + first, "old": self.acting + self.channels + first}
        begin = self.acting + 2 * self.channels
        return {"commands": rows | {"begin": begin}, "report": self.report + first}


@dataclass(frozen=True, eq=False, kw_only=True)
class Part(Term):
    """A part of a controller: a term in all but the list that it stands in.

    Class attributes: `type`, `device`: as of `Term`; the module is one of lgvi_kernels.laws.control. `section` is the list;
    `needs`, what it reads of the wanted motion, among `WISHES`.

    Args:
        name: Name of the part in parameters ("name.field"); by default its type.
    """

    acts: ClassVar[bool] = False
    section: ClassVar[str] = ""
    needs: ClassVar[tuple[str, ...]] = ()
    # Where it finds the numbers of others; set for a part of a scene.
    bus: ClassVar[Bus | None] = None

    @property
    def gives(self) -> tuple[str, ...]:
        """What it wants of the motion, among `WISHES`; by default nothing."""
        return ()

    def wired(self, bus: Bus, actuators: Mapping[str, Term]) -> Any:
        """The same part, knowing where it finds what others write.

        Args:
            bus: Rows of the memory.
            actuators: Terms that take commands, by key.

        Returns:
            A copy.
        """
        part = copy.copy(self)
        object.__setattr__(part, "bus", bus)
        return part

    def check_scene(self, faults: Faults, h: float) -> None:
        """Add a fault for each number that does not fit the run.

        Args:
            faults: Collects the faults.
            h: Step of the run [s].
        """


AnyPart = TypeVar("AnyPart", bound=Part)


@dataclass(frozen=True, eq=False, kw_only=True)
class MeasuringPart(Part):
    """A sensor or an estimator: changes what the controller takes for the motion."""

    section: ClassVar[str] = "sensors"
    kinds: ClassVar[dict[str, Any]] = {}


@dataclass(frozen=True, eq=False, kw_only=True)
class Guidance(Part):
    """A part that says which motion is wanted."""

    section: ClassVar[str] = "guidance"
    kinds: ClassVar[dict[str, Any]] = {}


@dataclass(frozen=True, eq=False, kw_only=True)
class ControlLaw(Part):
    """A law: the demand X, Y, Z [N] and K, M, N [N m] in the body's axes, from what is wanted and what is measured.

    Class attributes: `demands` names the components that it asks for, among `COMPONENTS`; none named: all of them.
    """

    section: ClassVar[str] = "laws"
    kinds: ClassVar[dict[str, Any]] = {}
    demands: ClassVar[tuple[str, ...]] = ()

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        """The numbers as they are: a controller works in the user's axes."""
        return Packed(dict(numbers))


# How a law's integral is kept from growing while actuators are at their limits.
ANTI_WINDUP = ("conditional", "none")


@dataclass(frozen=True, eq=False, kw_only=True)
class IntegralLaw(ControlLaw):
    """A law with integrals, each in two rows of the memory.

    Args:
        anti_windup: "conditional", the default: an integral stays as it is while the actuators do not deliver the demand and
            its error would make this worse; or "none".
    """

    integrals: ClassVar[int] = 1

    anti_windup: str = "conditional"

    def check(self, faults: Faults) -> None:
        """Adds a fault where `anti_windup` is unknown."""
        faults.choice("anti_windup", self.anti_windup, ANTI_WINDUP)

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        """The numbers, the memory of the integrals, and where the law finds what was not delivered."""
        assert self.bus is not None
        words = {"unmet": self.bus.unmet, "conditional": int(self.anti_windup == "conditional")}
        return Packed(dict(numbers) | words, memory=np.zeros((1, 2 * self.integrals)))


# Later than any run, and within float32.
NEVER = 1e30


@dataclass(frozen=True, eq=False, kw_only=True)
class Allocation(Part):
    """A part that turns the demand into the commands of one term.

    Args:
        to: Key of the term that takes the commands.
    """

    section: ClassVar[str] = "allocation"
    kinds: ClassVar[dict[str, Any]] = {}
    # The term that takes the commands, the faults of its channels that are known, and which of X Y Z K M N laws ask for (6,);
    # set for a part of a scene.
    actuator: ClassVar[Any] = None
    losses: ClassVar[tuple[Any, ...]] = ()
    asked: ClassVar[np.ndarray] = np.ones(6)

    to: str = ""

    def wired(self, bus: Bus, actuators: Mapping[str, Term]) -> Any:
        """In addition, knows its actuator."""
        part = super().wired(bus, actuators)
        object.__setattr__(part, "actuator", actuators[self.to])
        return part

    def informed(self, faults: Sequence[Any], asked: np.ndarray) -> Any:
        """The same part, knowing which channels are lost from some time on, and which components count.

        Args:
            faults: Faults of actuators.
            asked: 1 for each of X Y Z K M N that laws ask for, else 0, (6,).

        Returns:
            A copy.
        """
        part = copy.copy(self)
        known = tuple(fault for fault in faults if fault.of == self.to and fault.known)
        object.__setattr__(part, "losses", known)
        object.__setattr__(part, "asked", asked)
        return part

    @property
    def lost_channels(self) -> tuple[int, ...]:
        """Numbers of the channels that are known to be lost at some time."""
        return tuple(sorted({fault.channel for fault in self.losses}))

    def times_of_loss(self, context: PackingContext) -> np.ndarray:
        """When each channel is known to be lost.

        Args:
            context: The scene's parameters.

        Returns:
            Times (1 or n, channels) [s]; `NEVER` for a channel that is not.
        """
        times = [np.full((1, self.actuator.channels), NEVER)]
        for fault in self.losses:
            time = context.parameters[f"{fault.key}.time"]
            one = np.full((len(time), self.actuator.channels), NEVER)
            one[:, fault.channel] = np.minimum(time, NEVER)
            times.append(one)
        return np.asarray(functools.reduce(np.minimum, times))

    def check_actuator(self, faults: Faults) -> None:
        """Add a fault for what does not fit the actuator.

        Args:
            faults: Collects the faults.
        """

    def reach(self) -> np.ndarray:
        """What the channels make: a wrench for each, of the scene's own numbers.

        Returns:
            (6, channels) [N, N m], of any size.
        """
        raise NotImplementedError


# Entries of a projector below this are round-off.
ROUND_OFF = 1e-12


def rest_rows(reached: np.ndarray) -> np.ndarray:
    """Rows by which the device code finds what actuators cannot make of a demand.

    Args:
        reached: Projector (n, 6, 6) onto the demands that they can make.

    Returns:
        The projector onto the others, line by line, (n, 36), without round-off.
    """
    others = np.eye(6) - reached
    return np.where(np.abs(others) < ROUND_OFF, 0.0, others).reshape(len(others), -1)


@dataclass(frozen=True, eq=False, kw_only=True)
class Sending(Part):
    """A part that changes commands on their way to the actuators."""

    section: ClassVar[str] = "faults"
    kinds: ClassVar[dict[str, Any]] = {}


# The bases of parts by the list that they stand in, in the order in which their roles act.
SECTIONS: dict[str, type[Part]] = {
    kind.section: kind for kind in (MeasuringPart, Guidance, ControlLaw, Allocation, Sending)
}
