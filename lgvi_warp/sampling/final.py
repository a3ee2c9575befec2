# SPDX-License-Identifier: Apache-2.0
"""Final states and memory of a run's members: all data that another run needs to continue seamlessly."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import MOST, mapping_of, members_of
from lgvi_warp.common.errors import Faults, ragged
from lgvi_warp.common.real_numbers import is_whole
from lgvi_warp.common.status import Status
from lgvi_warp.common.summaries import Rows, Summarized
from lgvi_warp.common.times import whole_steps
from lgvi_warp.physics import notation
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.physics.notation import ORTHOGONAL

# Of a state as the kernel has it: attitude, position, and momenta.
NUMBERS_OF_STATE = 18
# Most that an attitude of a run may have drifted from the rotations, |R^T R - I|.
MOST_DRIFT = 0.1


@dataclass(frozen=True, eq=False, repr=False)
class Final(Summarized):
    """Final states of n members of a run, and the memory of forces, actuators and controllers.

    A run can continue from them: `lw.solve(..., start=final)`, `lw.prepare(...).states(final)`. With the same scene,
    members and settings, the two runs give the same bits as a single run. With other settings or other numbers of the
    members, or after `changed`, the second run starts from `states` and the memory.

    Attributes:
        time: Time [s] since t = 0 of the first run.
        step: Step of the run [s].
        steps: Number of steps from t = 0.
        states: Arrays of the saved fields of the motion, by name: position (n, 3) [m, inertial axes], attitude (n, 3,
            3) (body to inertial axes), velocity (n, 3) [m/s, body axes], angular_velocity (n, 3) [rad/s, body axes].
        status: Status of each member, shape (n,). A member that failed or was stopped does not move again.
        indices: Index of each member in its ensemble (n,), which determines its noise.
        seed: Seed of the ensemble.
        parameters: Parameters of the members by name, each with a first dimension of 1 or n.
        lanes: Arrays (n, rows) by name, in the form of the kernel: state, memory and outcome of each member.
        settings: Settings of the run: method, step, number type and laws. A run with other settings uses `states`
            and the memory. So does every run if `settings` is empty, as after `changed`.

    Methods:
        part: Select members.
        changed: Give members other states.

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
        """Title and rows of the summary."""
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
        """Select members, in the given order; a member may occur several times.

        Args:
            places: Indices (m,) of m members among the n members, counted from 0; a slice; or a mask (n,).

        Returns:
            The final states of these members.

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
        """Replace states of the members; forces, actuators and controllers keep their memory.

        Args:
            states: New arrays by name, as in the attribute `states`: any of position (n, 3) [m], attitude (n, 3, 3),
                velocity (n, 3) [m/s] and angular_velocity (n, 3) [rad/s].

        Returns:
            The final states with these changes.

        Raises:
            SceneError: If a name is unknown, an array has a wrong shape, or an attitude is not a rotation.
        """
        faults, n = Faults(), self.members
        arrays = dict[str, np.ndarray]()
        for name, values in states.items():
            if faults.choice("states", name, FIELDS):
                array = faults.finite(name, values, (n, 3, 3) if name == "attitude" else (n, 3))
                arrays |= {} if array is None else {name: array}
        faults.raise_if_any()
        _check_rotations(faults, arrays.get("attitude"))
        faults.raise_if_any()
        lanes = {name: rows for name, rows in self.lanes.items() if name not in EXACT}
        return replace(self, states={**self.states, **arrays}, lanes=lanes, settings={})

    def to_arrays(self) -> dict[str, np.ndarray]:
        """Convert to the arrays that `from_arrays` reads, without its other arguments `numbers` and `parameters`.

        Returns:
            Arrays (n, ...) by name.
        """
        parts = {"states": self.states, "lanes": self.lanes}
        arrays = {f"{PREFIX}{kind}.{name}": rows for kind, each in parts.items() for name, rows in each.items()}
        arrays |= {f"{PREFIX}{SUM}{name.removeprefix(PREFIX)}": _sums(rows) for name, rows in arrays.items()}
        arrays |= {f"{PREFIX}status": self.status, f"{PREFIX}indices": self.indices}
        whole = {name: rows.astype(np.int64) for name, rows in arrays.items() if rows.dtype.kind in "iu"}
        return arrays | whole

    @classmethod
    def from_arrays(
        cls, arrays: Mapping[str, np.ndarray], numbers: Mapping[str, Any], parameters: Mapping[str, np.ndarray]
    ) -> Final:
        """Read final states from arrays.

        Args:
            arrays: Arrays by name, as returned by `to_arrays`; arrays with other names are ignored.
            numbers: Attributes of the final states by name: time, step, steps, seed and settings.
            parameters: Parameters of the members by name.

        Returns:
            The final states.

        Raises:
            SceneError: If an entry is missing, or if a status, an index, a shape or an attitude is not possible at the
                end of a run.
        """
        mapping_of("arrays", arrays, "arrays by name, as of Final.to_arrays")
        mapping_of("numbers", numbers, f"{', '.join(NUMBERS)}")
        mapping_of("parameters", parameters, "arrays (n, ...) by name")
        own = {name.removeprefix(PREFIX): rows for name, rows in arrays.items() if str(name).startswith(PREFIX)}
        states, lanes = (
            {name.removeprefix(kind): rows for name, rows in own.items() if name.startswith(kind)}
            for kind in ("states.", "lanes.")
        )
        faults = Faults("final.")
        for name in [name for name in NUMBERS if name not in numbers] + [
            n for n in ("status", "indices") if n not in own
        ]:
            faults.add(name, None, "is missing", "give what Final.to_arrays and the attributes of the end say")
        faults.raise_if_any()
        known = {name: numbers[name] for name in NUMBERS}
        end = cls(
            **known, states=states, lanes=lanes, status=own["status"], indices=own["indices"], parameters=parameters
        ).checked()
        # What goes on from its rows alone would leave other states without effect.
        for name in (name for name in own if f"{SUM}{name}" in own and "state" in lanes):
            if not np.array_equal(_sums(own[name]), own[f"{SUM}{name}"]):
                remedy = "give what Final.to_arrays wrote, and change states by final.changed(...)"
                faults.add(name, own[name], "is not what its run ended with", remedy)
        faults.raise_if_any()
        return end

    def checked(self) -> Final:
        """Check values that come from a file.

        Returns:
            This object.

        Raises:
            SceneError: If a number, a status, an index, a shape or an attitude is not possible at the end of a run.
        """
        faults, remedy = Faults("final."), "give an end that lgvi-warp wrote"
        time, step = faults.number("time", self.time, "s", 0.0), faults.positive("step", self.step)
        for name in ("steps", "seed"):
            if not is_whole(getattr(self, name), 0):
                faults.add(name, getattr(self, name), "is not a whole number from 0", remedy)
        if not faults and whole_steps(time or 0.0, step or 1.0) != self.steps:
            faults.add("time", self.time, f"is not that of {self.steps} steps of {self.step:.9g} s", remedy)
        codes = _whole_numbers(faults, "status", self.status, remedy)
        keys = _whole_numbers(faults, "indices", self.indices, remedy)
        n = -1 if codes is None else len(codes)
        odd = [] if codes is None else sorted(set(codes.tolist()) - {int(code) for code in Status})
        for code in odd[:1]:
            faults.add("status", code, "is none that a member ends with", remedy)
        if keys is not None and (len(keys) != n or (n and not 0 <= keys.min() <= keys.max() < MOST)):
            faults.add("indices", keys, f"are not {n} whole numbers from 0 to {MOST - 1}", remedy)
        for name, rows in self.states.items():
            shape = (n, 3, 3) if name == "attitude" else (n, 3)
            if faults.choice("states", name, FIELDS) and (
                np.shape(rows) != shape or np.asarray(rows).dtype.kind != "f"
            ):
                faults.add(f"states.{name}", rows, f"is not an array of shape {shape}", remedy)
        for name, rows in self.lanes.items():
            if np.ndim(rows) != 2 or len(rows) != n or np.asarray(rows).dtype.kind not in "fiu":
                faults.add(f"lanes.{name}", np.shape(rows), f"is not the shape of rows of {n} members", remedy)
        for name, values in self.parameters.items():
            rows = np.asarray(None if ragged(values) else values)
            if rows.dtype.kind not in "fiub" or rows.ndim == 0 or len(rows) not in (1, n):
                faults.add(
                    f"parameters.{name}",
                    values,
                    f"is not an array of numbers of {n} members, or of one for all",
                    remedy,
                )
        rows = np.asarray(self.lanes.get("state", np.zeros((max(n, 0), NUMBERS_OF_STATE))))
        if not isinstance(self.settings, Mapping):
            faults.add("settings", self.settings, "is not a mapping", remedy)
        elif self.settings and "state" not in self.lanes:
            faults.add("lanes.state", "...", "is missing", f"{remedy}, or final.changed() to go on from the states")
        elif not faults and rows.shape[1] < NUMBERS_OF_STATE:
            faults.add(
                "lanes.state", rows.shape, f"is not the shape of {NUMBERS_OF_STATE} numbers or more a member", remedy
            )
        faults.raise_if_any()
        # Without checks a run goes on with members that are not finite.
        running = (np.asarray(codes) == Status.OK) & np.isfinite(rows).all(axis=1)
        for name, values in self.states.items():
            if not np.isfinite(values[running]).all():
                faults.add(f"states.{name}", values, "is not finite, and its members go on", remedy)
        # Runge-Kutta methods and float32 let attitudes drift, about which their runs warn.
        keeps = self.settings.get("dtype") == "float64" and not str(self.settings.get("method")).startswith("rk")
        for R in (self.states.get("attitude"), rows[:, :9].reshape(n, 3, 3) if "state" in self.lanes else None):
            exact = keeps and R is not None and R.dtype == np.float64
            _check_rotations(faults, R, np.asarray(codes) == Status.OK, ORTHOGONAL if exact else MOST_DRIFT)
        faults.raise_if_any()
        return self


def _sums(rows: Any) -> np.ndarray:
    """Checksum (n,) of each member's numbers (n, ...), which changes with any of them."""
    numbers = np.ascontiguousarray(rows, dtype=np.float64)
    bits = numbers.view(np.int64).reshape(len(numbers), math.prod(numbers.shape[1:]))
    return np.asarray((bits * (2 * np.arange(bits.shape[1]) + 3) ** 7).sum(axis=1))


def _whole_numbers(faults: Faults, key: str, values: Any, remedy: str) -> np.ndarray | None:
    """Whole numbers (n,) from a file; None after adding a fault."""
    array = np.asarray(None if ragged(values) else values)
    if array.ndim == 1 and array.dtype.kind in "iu":
        return array
    faults.add(key, values, "is not a list of whole numbers", remedy)
    return None


def _check_rotations(
    faults: Faults, R: np.ndarray | None, judged: np.ndarray | None = None, limit: float = ORTHOGONAL
) -> None:
    """Add a fault for the first attitude (n, 3, 3) that is no rotation; judged: mask of members to check, NaN allowed."""
    if R is None:
        return
    good = notation.rotations(R, limit)
    if judged is not None:
        good |= ~judged | ~np.isfinite(R).all(axis=(1, 2))
    if not good.all():
        bad = int(np.argmin(good))
        faults.add(f"attitude of member {bad}", R[bad], "is not a rotation", "give R^T R = I, det R = 1")


def joined_rows(parts: Sequence[Mapping[str, np.ndarray]], counts: Sequence[int]) -> dict[str, np.ndarray]:
    """Concatenate rows by name, of `counts` members each; shorter or missing rows are padded with zeros."""
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
    """Join final states with the same time, step and scene."""
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
# Of an array's sums in a file.
SUM = "sum of "
