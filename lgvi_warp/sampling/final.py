# SPDX-License-Identifier: Apache-2.0
"""Where the members of a run ended, with all that they remember: what another run needs to go on as if it were one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import members_of
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.summaries import Rows, Summarized
from lgvi_warp.physics import notation
from lgvi_warp.physics.fields import FIELDS


@dataclass(frozen=True, eq=False, repr=False)
class Final(Summarized):
    """Where n members of a run ended: their states, and what forces, actuators and controllers remember.

    A run that goes on from it with the same scene, members and settings has the bits of one run: `lw.solve(..., start=final)`,
    `lw.prepare(...).states(final)`. With other settings or other numbers of the members it goes on from the states, with what
    is remembered; so it does after `changed`.

    Attributes:
        time: Time [s], counted from t = 0 of the first run.
        step: Step of the run [s].
        steps: Number of steps from t = 0.
        states: Arrays of those fields that the run kept, by name: position (n, 3) [m, inertial axes], attitude (n, 3, 3) body
            to inertial axes, velocity (n, 3) [m/s, body axes], angular_velocity (n, 3) [rad/s, body axes].
        status: Status of each member, shape (n,): those that failed or were stopped stay where they are.
        indices: Indices of the members in their ensemble (n,), which key their noise.
        seed: Seed of the ensemble.
        parameters: Parameters of the members by name, each with a leading dimension of 1 or n.
        lanes: Rows (n, rows) by name as the kernel has them: its state, what is remembered, and outcomes.
        settings: What `lanes` depends on: method, step, number type and laws.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> first = lw.solve(scene, h=0.1, t1=2.0)
        >>> second = lw.solve(scene, h=0.1, t1=4.0, start=first.final)
        >>> second.time.tolist()
        [2.0, 4.0]
        >>> bool((second.position[-1] == lw.solve(scene, h=0.1, t1=4.0).position[-1]).all())
        True
    """

    time: float
    step: float
    steps: int
    states: Mapping[str, np.ndarray]
    status: np.ndarray
    indices: np.ndarray
    seed: int
    parameters: Mapping[str, np.ndarray]
    lanes: Mapping[str, np.ndarray] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)

    def summary_rows(self) -> tuple[str, Rows]:
        """Where it came from, and what it holds."""
        remembered = [name.removeprefix(MEMORY) for name, rows in self.lanes.items() if name.startswith(MEMORY)]
        rows = [
            ("step", f"{self.step:g} s, {self.steps:,} steps"),
            ("states", ", ".join(self.states)),
            ("remembered", ", ".join(remembered)),
        ]
        return f"End of a run of {self.members:,} members at {self.time:g} s", [row for row in rows if row[1]]

    @property
    def members(self) -> int:
        """Number of members, n."""
        return len(self.status)

    def _kept(self, name: str) -> np.ndarray:
        if name not in self.states:
            raise AttributeError(f"{name} was not kept: add {name!r} to SaveAt(fields=...) of the run before")
        return self.states[name]

    @property
    def position(self) -> np.ndarray:
        """Positions in inertial axes (north, east, down) [m], shape (n, 3)."""
        return self._kept("position")

    @property
    def attitude(self) -> np.ndarray:
        """Rotations from body to inertial axes, shape (n, 3, 3)."""
        return self._kept("attitude")

    @property
    def velocity(self) -> np.ndarray:
        """Velocities in body axes [m/s], shape (n, 3)."""
        return self._kept("velocity")

    @property
    def angular_velocity(self) -> np.ndarray:
        """Angular velocities in body axes [rad/s], shape (n, 3)."""
        return self._kept("angular_velocity")

    def part(self, places: Sequence[int] | np.ndarray | slice) -> Final:
        """Select members, in the order given; one may come several times.

        Args:
            places: Positions of the members (m,), counted from 0; a slice; or a mask (n,).

        Returns:
            The end of these members.

        Raises:
            SceneError: If there are no such members (also an IndexError).
        """
        at = members_of("places", places, self.members)
        states, lanes = ({name: rows[at] for name, rows in each.items()} for each in (self.states, self.lanes))
        parameters = {name: rows[at] if len(rows) > 1 else rows for name, rows in self.parameters.items()}
        return replace(
            self, states=states, lanes=lanes, parameters=parameters, status=self.status[at], indices=self.indices[at]
        )

    def changed(self, **states: Any) -> Final:
        """Give members other states; what they remember stays.

        Args:
            states: Any of position (n, 3) [m], attitude (n, 3, 3), velocity (n, 3) [m/s] and angular_velocity (n, 3) [rad/s],
                as in `states`.

        Returns:
            The end with these states.

        Raises:
            SceneError: If a name is unknown, or an array has a wrong shape or is no rotation.
        """
        faults, n = Faults(), self.members
        arrays = dict[str, np.ndarray]()
        for name, values in states.items():
            if faults.choice("states", name, FIELDS):
                array = faults.finite(name, values, (n, 3, 3) if name == "attitude" else (n, 3))
                arrays |= {} if array is None else {name: array}
        faults.raise_if_any()
        R = arrays.get("attitude")
        if R is not None and not notation.rotations(R).all():
            bad = int(np.argmin(notation.rotations(R)))
            raise SceneError(
                [f"attitude of member {bad} = {R[bad].tolist()}: is not a rotation; give R^T R = I, det R = 1"]
            )
        lanes = {name: rows for name, rows in self.lanes.items() if name not in EXACT}
        return replace(self, states={**self.states, **arrays}, lanes=lanes)

    def to_arrays(self) -> dict[str, np.ndarray]:
        """Write what `from_arrays` reads, but for numbers and parameters, as arrays.

        Returns:
            Arrays (n, ...) by name.
        """
        parts = {"states": self.states, "lanes": self.lanes}
        arrays = {f"{PREFIX}{kind}.{name}": rows for kind, each in parts.items() for name, rows in each.items()}
        arrays |= {f"{PREFIX}status": self.status, f"{PREFIX}indices": self.indices}
        whole = {name: rows.astype(np.int64) for name, rows in arrays.items() if rows.dtype.kind in "iu"}
        return arrays | whole

    @classmethod
    def from_arrays(
        cls, arrays: Mapping[str, np.ndarray], numbers: Mapping[str, Any], parameters: Mapping[str, np.ndarray]
    ) -> Final:
        """Read an end from arrays.

        Args:
            arrays: Arrays by name, as of `to_arrays`; others are ignored.
            numbers: time, step, steps, seed and settings.
            parameters: Parameters of the members by name.

        Returns:
            The end.
        """
        own = {name.removeprefix(PREFIX): rows for name, rows in arrays.items() if name.startswith(PREFIX)}
        states, lanes = (
            {name.removeprefix(kind): rows for name, rows in own.items() if name.startswith(kind)}
            for kind in ("states.", "lanes.")
        )
        known = {name: numbers[name] for name in NUMBERS}
        return cls(
            **known, states=states, lanes=lanes, status=own["status"], indices=own["indices"], parameters=parameters
        )


def joined_rows(parts: Sequence[Mapping[str, np.ndarray]], counts: Sequence[int]) -> dict[str, np.ndarray]:
    """Rows by name one after the other, of so many members each; those that are shorter, or absent, end in zeros."""
    rows: dict[str, np.ndarray] = {}
    for name in dict.fromkeys(name for part in parts for name in part):
        pieces = [part.get(name) for part in parts]
        like = next(piece for piece in pieces if piece is not None)
        longest = max(piece.shape[1] for piece in pieces if piece is not None)
        whole, at = np.zeros((sum(counts), longest), like.dtype), 0
        for count, piece in zip(counts, pieces, strict=True):
            if piece is not None:
                whole[at : at + count, : piece.shape[1]] = piece
            at += count
        rows[name] = whole
    return rows


def joined(ends: Sequence[Final]) -> Final:
    """The members of several ends of one time, step and scene, one after the other."""
    if len(ends) == 1:
        return ends[0]
    first, counts = ends[0], [end.members for end in ends]

    def of_all(name: str) -> np.ndarray:
        rows = [end.parameters[name] for end in ends]
        if all(len(each) == 1 and np.array_equal(each, rows[0]) for each in rows) and sum(counts) > 1:
            return np.asarray(rows[0])
        return np.concatenate(
            [np.broadcast_to(each, (n, *each.shape[1:])) for each, n in zip(rows, counts, strict=True)]
        )

    return replace(
        first,
        states={name: np.concatenate([end.states[name] for end in ends]) for name in first.states},
        lanes=joined_rows([end.lanes for end in ends], counts),
        status=np.concatenate([end.status for end in ends]),
        indices=np.concatenate([end.indices for end in ends]),
        parameters={name: of_all(name) for name in first.parameters},
    )


# Names in `lanes`: the state as the kernel has it and what belongs to it alone, and the prefix of what a law remembers.
EXACT = ("state", "scratch")
MEMORY = "memory of "
# What files say of an end beside arrays, and the prefix of these.
NUMBERS = ("time", "step", "steps", "seed", "settings")
PREFIX = "final."
