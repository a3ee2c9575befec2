# SPDX-License-Identifier: Apache-2.0
"""A control law in Python: a function of all members of a block, called once a period."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.common.identity import check_version
from lgvi_warp.control.base import Allocation, ControlLaw
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext

PROBLEM = "cannot stand in a scene file, which runs no code"
REMEDY = "give lw.control.Callback(function) to lw.Controller in Python; lw.resume(path, fleet) goes on with such a run"


@dataclass(frozen=True, eq=False, kw_only=True)
class Callback(ControlLaw):
    """A control law in Python: `function(t, y, r, members)` returns the demand of all members of a block, (m, 6) [N, N m].

    t is the time of the tick [s]. y is the measured and r the wanted motion, each with arrays of m members (see
    `lw.control.CallbackInput`); `members` are the members' indices (m,). The function may use NumPy, PyTorch, JAX or any
    solver. Each period costs one kernel launch; docs/controllers/callback.md has the measured cost.
    Calls for one block come in the order of time; different blocks run in different threads.

    Args:
        function: The function. It must be picklable if other processes run it.
        to: Key of a term, or a list of keys. The function then returns the commands of all their channels, side by side,
            (m, channels), and no law or allocation acts on these terms. By default, the function returns demands.
        version: Text or number that identifies the function in sweeps and stores; change it whenever the function changes.
            With None, the default, the function is identified by its code. Give a version if the function reads files
            or holds objects that cannot be compared.

    Examples:
        >>> import lgvi_warp as lw
        >>> import numpy as np
        >>> def heave(t, y, r, members):
        ...     return np.outer(20.0 * (5.0 - y.depth), [0, 0, 1, 0, 0, 0])
        >>> lw.control.Callback(heave).to_dict()
        {'type': 'callback', 'function': 'heave'}
    """

    type: ClassVar[str] = "callback"
    demands: ClassVar[tuple[str, ...]] = ("X", "Y", "Z", "K", "M", "N")

    function: Callable[..., Any] | None = None
    to: str | Sequence[str] | None = None
    version: Any = None

    def __init__(
        self,
        function: Callable[..., Any] | None = None,
        *,
        to: str | Sequence[str] | None = None,
        version: str | int | float | None = None,
        name: str = "",
    ) -> None:
        for key, value in (("function", function), ("to", to), ("version", version), ("name", name)):
            object.__setattr__(self, key, value)
        super().__post_init__()

    def check(self, faults: Faults) -> None:
        if not callable(self.function):
            faults.add("function", self.function, PROBLEM if self.function is None else "is not a function", REMEDY)
        check_version(faults, self.version)

    @property
    def targets(self) -> tuple[str, ...]:
        """Keys of the terms whose commands the function returns; empty if it returns demands."""
        return (self.to,) if isinstance(self.to, str) and self.to else tuple(self.to or ())

    def answers(self, channels: Mapping[str, int]) -> int:
        """Count of numbers that the function returns for a member.

        Args:
            channels: Number of commands of each actuator, by its key.

        Returns:
            The number of channels of all terms in `to`, or 6 for a demand.
        """
        return sum(channels[key] for key in self.targets) or len(self.demands)

    def to_dict(self) -> dict[str, Any]:
        # Its type and the name of its function, which a scene file cannot hold.
        name = getattr(self.function, "__qualname__", repr(self.function))
        to = self.to if isinstance(self.to, str) else list(self.targets)
        options = {"to": to or None, "version": self.version}
        return {"type": self.type, "function": name} | {
            key: value for key, value in options.items() if value is not None
        }

    def words(self) -> dict[str, Any]:
        return {"answer": self.bus.answer}


@dataclass(frozen=True, eq=False, kw_only=True)
class CallbackCommands(Allocation):
    """Allocation that passes the answer of a `Callback` with `to` to its actuator; a `Controller` creates it."""

    device: ClassVar[str] = "callback_commands"

    # Keys of the terms whose commands stand before those of this one in the answer.
    before: tuple[str, ...] = ()

    def reach(self) -> np.ndarray:
        # Everything: no law asks it for a demand.
        return np.eye(6)

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # Where the answer is, and the limits of the commands.
        first, count = self.bus.commands[self.to]
        limit = context.own(self.actuator)["limit"]
        answer = self.bus.answer + sum(self.bus.commands[key][1] for key in self.before)
        return Packed({"answer": answer, "commands": first, "count": count}, limit)


def refuse_second(callbacks: list[Callback]) -> None:
    """Raise an error if there is more than one callback, since each would need its own launch."""
    if len(callbacks) > 1:
        raise refusal(
            "laws", f"{len(callbacks)} callbacks", "are more than one", "call the other function from the first"
        )
