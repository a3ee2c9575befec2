"""What became of each member, and what to do about it."""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Status(IntEnum):
    """Outcome of one member. A member that failed stays at its last good state; no other member notices."""

    OK = 0
    STEP_TOO_LARGE = 1
    NOT_CONVERGED = 2
    NON_FINITE = 3
    FORCES_NOT_CONVERGED = 4
    STEP_TOO_SMALL = 5
    SURFACE = 16
    FLOOR = 17
    BOX = 18
    TIME = 19
    CONDITION = 20

    @property
    def stopped(self) -> bool:
        """Whether an event of the scene stopped the member: an outcome, no failure."""
        return self >= Status.SURFACE

    @property
    def text(self) -> str:
        """What happened and the remedy, in a sentence."""
        return _TEXT[self]


_TEXT = {
    Status.OK: "ran to the end",
    Status.STEP_TOO_LARGE: "the step is too large: |J^-1 a| reached 1, where equation (24) may have no solution, or half the "
    "angle of a turn of psi_x did; shorten the step below 1 / |angular velocity| (psi and psi_s: below 2 / |angular "
    "velocity|; rkn*: a quarter turn in a part; psi_x: below 4 / |angular velocity|, and shorter for slender bodies, whose "
    "turns about their length it splits off: there psi_s is better)",
    Status.NOT_CONVERGED: "the solve of the implicit rotation (equation (24); psi_w: its coupled form; gauss*: the stages) "
    "kept a residual above the tolerance; give a shorter step, more iterations or a larger tolerance "
    '(for slender bodies, whose inertias are 100 times apart and more: solver="cayley")',
    Status.FORCES_NOT_CONVERGED: "the iteration for nonconservative forces in Phi* did not settle: they are stiff; "
    "shorten the step, or use psi_s or psi_x, which treat drag implicitly",
    Status.STEP_TOO_SMALL: "the steps that the tolerance asks for became too small, or too many (100,000 within one h); "
    "loosen rtol or atol (float32 reaches about 1e-6), or look for forces that jump or are stiff",
    Status.SURFACE: "stopped by an event: rose to the surface",
    Status.FLOOR: "stopped by an event: sank to the sea floor",
    Status.BOX: "stopped by an event: left the box",
    Status.TIME: "stopped by an event: its time was over",
    Status.CONDITION: "stopped by an event: a condition of the user",
    Status.NON_FINITE: "a number of the state is not finite; check the start state, the parameters and the step",
}


class StatusArray(np.ndarray):
    """Status of each member, shape (n,), uint8: compares with `Status` members; `counts()` sums up."""

    def counts(self) -> dict[str, int]:
        """Members by status name, those that occur, the most serious last."""
        values, numbers = np.unique(np.asarray(self), return_counts=True)
        return {Status(v).name.lower(): int(n) for v, n in zip(values, numbers, strict=True)}
