# SPDX-License-Identifier: Apache-2.0
"""Outcome and warnings of each member of a run, each with its remedy."""

from __future__ import annotations

import html
from enum import IntEnum, IntFlag
from typing import Any

import numpy as np

from lgvi_warp.common.errors import refusal
from lgvi_warp.common.real_numbers import is_whole
from lgvi_warp.common.summaries import counted

# Values of `checks` and `on_failure` in solve and in a scene's [run].
CHECKS = ("none", "safe", "all")
ON_FAILURE = ("freeze", "raise", "substep")


class Status(IntEnum):
    """Outcome of one member: OK, the reason for its failure, or the event that stopped it.

    A failed member stays at its last good state, and other members are not affected. Codes from 16 on are events.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, save=lw.SaveAt(every=1.0))
        >>> result.status.counts()
        {'ok': 8}
        >>> lw.Status.FLOOR.text
        'stopped by an event: sank to the sea floor'
    """

    OK = 0
    STEP_TOO_LARGE = 1
    NOT_CONVERGED = 2
    NON_FINITE = 3
    FORCES_NOT_CONVERGED = 4
    STEP_TOO_SMALL = 5
    ENERGY_GREW = 6
    BACKWARD_DRAG = 7
    CONTROL_NON_FINITE = 8
    SURFACE = 16
    FLOOR = 17
    BOX = 18
    TIME = 19
    CONDITION = 20
    BATTERY = 21
    OUTSIDE = 22
    MISSION_DONE = 23
    POSITION_UNCERTAIN = 24

    @property
    def stopped(self) -> bool:
        """Whether an event of the scene stopped the member; this is not a failure."""
        return self >= Status.SURFACE

    @property
    def text(self) -> str:
        """The outcome in words; for a failure, its problem and remedy."""
        return _TEXT[self]


_TEXT = {
    Status.OK: "ran to the end",
    Status.STEP_TOO_LARGE: "the step is too large: |J^-1 a| reached 1, where equation (24) may have no solution, or half the "
    "angle of a turn of psi_x did. Shorten the step below 1 / |angular velocity| (psi and psi_s: below 2 / |angular "
    "velocity|; rkn*: a quarter turn in a part; psi_x: below 4 / |angular velocity|, and shorter for slender bodies, whose "
    "turns about their length it splits off: there psi_s is better)",
    Status.NOT_CONVERGED: "the solve of the implicit rotation (equation (24); psi_w: its coupled form; gauss*: the stages) "
    "kept a residual above the tolerance. Give a shorter step, more iterations or a larger tolerance "
    '(for slender bodies, whose inertias are 100 times apart and more: solver="cayley")',
    Status.FORCES_NOT_CONVERGED: "the iteration for nonconservative forces in Phi* did not settle: they are stiff. "
    "Shorten the step, or use psi_s or psi_x, which treat drag implicitly",
    Status.STEP_TOO_SMALL: "the steps that the tolerance asks for became too small, or too many (100,000 within one h). "
    "Loosen rtol or atol (float32 reaches about 1e-6), or look for forces that jump or are stiff",
    Status.ENERGY_GREW: "the total energy grew to more than 100 times the energy available, although no force of the scene "
    "supplies any: the method is unstable at this step. Shorten it (result.warnings names what is too fast)",
    Status.BACKWARD_DRAG: "this composition takes some stages with a negative step, and the drag is too strong to be "
    "integrated backward: their drag number, (back) (l + q|v|) / I, passed 0.5. Use the method that is composed, or shorten "
    "the step",
    Status.CONTROL_NON_FINITE: "a command of the controller is not finite. Check its gains, its sensors and a law of your own",
    Status.SURFACE: "stopped by an event: rose to the surface",
    Status.FLOOR: "stopped by an event: sank to the sea floor",
    Status.BOX: "stopped by an event: left the box",
    Status.TIME: "stopped by an event: its time was over",
    Status.CONDITION: "stopped by an event: a condition of the user",
    Status.BATTERY: "stopped by an event: it used the capacity of its battery",
    Status.OUTSIDE: "stopped by an event: left the data of a field",
    Status.MISSION_DONE: "stopped by an event: reached all waypoints of its mission",
    Status.POSITION_UNCERTAIN: "stopped by an event: its filter's standard deviation of the position passed a limit",
    Status.NON_FINITE: "a number of the state is not finite. Check the start state, the parameters and the step",
}


class StatusArray(np.ndarray):
    """Status codes of all members, uint8, shape (n,), which can be compared with members of `Status`."""

    @property
    def failed(self) -> np.ndarray:
        """Mask (n,) of the members that neither reached the end nor were stopped by an event."""
        return failed(self)

    @property
    def stopped(self) -> np.ndarray:
        """Mask (n,) of the members that an event of the scene stopped."""
        return stopped(self)

    def __repr__(self) -> str:
        if self.dtype != np.uint8 or self.ndim != 1 or not np.isin(self, list(Status)).all():
            return super().__repr__()
        return f"StatusArray of {len(self):,} members: {counted(self.counts()) or 'none'}"

    def _repr_html_(self) -> str:
        return f"<div>{html.escape(repr(self))}</div>"

    def counts(self) -> dict[str, int]:
        """Count members by outcome.

        Returns: Number of members by name of the status in lower case, in the order of the codes, without zero counts.
        """
        values, numbers = np.unique(np.asarray(self), return_counts=True)
        return {Status(v).name.lower(): int(n) for v, n in zip(values, numbers, strict=True)}


class Warnings(IntFlag):
    """Warnings of a member, as bits. A bit says, for example, that the motion is too fast for the step or the method.

    A warning does not stop a run. A warning with a higher bit is more serious than one with a lower bit.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> result = lw.solve(scene, "rk4", h=0.2, t1=1.0)
        >>> result.warnings.counts()
        {'munk_coarse': 1, 'restoring_coarse': 1, 'munk_unstable': 1}
    """

    INERTIA = 1
    PRECISION_LOSS = 2
    ORTHOGONALITY = 4
    MUNK_COARSE = 8
    RESTORING_COARSE = 16
    ROTATION = 32
    DRAG_STIFF = 64
    MUNK_UNSTABLE = 128
    RESTORING_UNSTABLE = 256
    ENERGY = 512
    CONTROL_NOT_CONVERGED = 1024
    ABOVE_SURFACE = 2048
    FILTER_DIVERGED = 4096

    @classmethod
    def _missing_(cls, value: object) -> Any:
        """Accept NumPy's whole numbers too, as in result.warnings."""
        return cls(int(value)) if isinstance(value, np.integer) else super()._missing_(value)

    @property
    def text(self) -> str:
        """What was observed, and the remedy, for each warning bit."""
        return "; ".join(_WARNING_TEXT[warning] for warning in Warnings if warning in self)

    @property
    def value_name(self) -> str:
        """Formula of the number in `result.warning_value`, for the most serious warning bit."""
        return _WARNING_VALUE[Warnings(1 << (int(self).bit_length() - 1))] if self else ""


_WARNING_TEXT = {
    Warnings.INERTIA: "two principal moments of inertia sum to less than the third, which no rigid body has; right only if "
    "added inertia makes the difference",
    Warnings.PRECISION_LOSS: "the position loses what a step adds to it: eps |b| > 0.05 h |v|. Use float64 or "
    "float32_compensated, or an origin nearer to the vehicle",
    Warnings.ORTHOGONALITY: "the attitude left the rotations: |R^T R - I| > 1e-10 (float64) or 1e-4 (float32), of rk4, rk5, "
    "rk5_ck, rk8 and rkw3 1e-3. Shorten the step, or use a method that stays on the group (psi_s, psi_x)",
    Warnings.MUNK_COARSE: "the Munk moment's oscillation is coarsely resolved: h w > 0.5 in a stage. Shorten the step, or do "
    "not trust attitudes",
    Warnings.RESTORING_COARSE: "the restoring moment's oscillation is coarsely resolved: h sqrt(B|r|/J) > 0.5 in a stage. "
    "Shorten the step, or do not trust attitudes",
    Warnings.ROTATION: "the rotation in one step is too large: h |Omega| passed the stability limit of the explicit method "
    "(psi_x: 1, beyond which its turns are inaccurate). Shorten the step",
    Warnings.DRAG_STIFF: "drag is stiff: h (l + 2 q|v|) / I > 1 for a method that treats it explicitly, or > 5 for psi_s, "
    "psi_x and psi_w, which stay stable and are then of order 1 to 1.5 in place of 2. Shorten the step, or use rkw3",
    Warnings.MUNK_UNSTABLE: "the Munk moment's oscillation is too fast for this method and step: h w passed the measured "
    "limit of stability. Shorten the step",
    Warnings.RESTORING_UNSTABLE: "the restoring moment's oscillation is too fast for this method and step: h sqrt(B|r|/J) "
    "passed the measured limit of stability. Shorten the step",
    Warnings.ENERGY: "the total energy grew by more than half of the energy available, although no force of the scene "
    "supplies any. Shorten the step",
    Warnings.CONTROL_NOT_CONVERGED: "iterations of a law or an allocation ended before they had converged, so that commands "
    'are not those asked for. Give it more iterations (the signal "unconverged" counts them)',
    Warnings.ABOVE_SURFACE: "the member rose more than 0.1 m above the mean surface, where the model knows no air. Stop "
    "it there by the event surface, or let it float by the term surface_buoyancy",
    Warnings.FILTER_DIVERGED: "the filter's error was far beyond what it believes: NEES above 150, where 15 is right. Give it "
    "the noises that its sensors have, a gate against outliers, or a better first estimate",
}

_WARNING_VALUE = {
    Warnings.INERTIA: "largest principal moment over the sum of the others",
    Warnings.PRECISION_LOSS: "eps |b| / (h |v|)",
    Warnings.ORTHOGONALITY: "|R^T R - I|",
    Warnings.MUNK_COARSE: "h w",
    Warnings.RESTORING_COARSE: "h sqrt(B|r|/J)",
    Warnings.ROTATION: "h |Omega|",
    Warnings.DRAG_STIFF: "h (l + 2 q|v|) / I",
    Warnings.MUNK_UNSTABLE: "h w",
    Warnings.RESTORING_UNSTABLE: "h sqrt(B|r|/J)",
    Warnings.ENERGY: "energy created over the energy available",
    Warnings.CONTROL_NOT_CONVERGED: "solutions that had not converged",
    Warnings.ABOVE_SURFACE: "height above the mean surface [m]",
    Warnings.FILTER_DIVERGED: "ticks with NEES above 150",
}


# Plain numbers: NumPy compares with an enumeration ten times as slowly.
OK, FIRST_EVENT, LAST_EVENT = int(Status.OK), int(Status.SURFACE), int(max(Status))


def stopped(status: Any) -> np.ndarray:
    """Mask (n,) of the members that an event of the scene stopped (no failure), from codes of `Status` (n,)."""
    codes = np.asarray(status)
    return np.asarray((codes >= FIRST_EVENT) & (codes <= LAST_EVENT))


def failed(status: Any) -> np.ndarray:
    """Mask (n,) of the members that neither reached the end nor were stopped by an event, from codes of `Status` (n,)."""
    codes = np.asarray(status)
    return np.asarray((codes != OK) & ~stopped(codes))


class WarningArray(np.ndarray):
    """Warnings of all members as bits of `Warnings`, uint16, shape (n,)."""

    def counts(self) -> dict[str, int]:
        """Count members by warning.

        Returns: Number of members by name of the warning in lower case, the most serious last, without zero counts. A
            member counts once for each of its warnings.
        """
        bits = np.asarray(self)
        numbers = {warning.name.lower(): int(np.count_nonzero(bits & warning)) for warning in Warnings if warning.name}
        return {name: n for name, n in numbers.items() if n}

    def has(self, warning: Warnings) -> np.ndarray:
        """Mask of the members with a warning.

        Returns: bool, shape (n,).
        """
        if not is_whole(warning, 0, np.iinfo(np.uint16).max):
            raise refusal("warning", warning, "is not a warning", "give one of lw.Warnings, or several joined by |")
        return (np.asarray(self) & int(warning)) != 0

    def worst(self) -> np.ndarray:
        """Find the most serious warning of each member.

        Returns: One bit of `Warnings` for each member, uint16, shape (n,); 0 for a member without a warning.
        """
        bits = np.asarray(self, dtype=np.uint16)
        highest = np.zeros_like(bits)
        for warning in Warnings:
            highest = np.where(bits & warning, np.uint16(warning), highest)
        return highest


def under_way(result: Any) -> np.ndarray:
    """Mask (k, n) of the members under way at each sample: neither stopped by an event nor failed."""
    return np.asarray(result.time[:, None] <= stop_time(result) * (1.0 + ROUNDING))


def stop_time(result: Any) -> np.ndarray:
    """Stop time of each member (n,) [s]: its event, or its last good state before a failure; inf if it ran to the end."""
    return np.where(np.asarray(result.status) != Status.OK, np.asarray(result.failure_time), np.inf)


# Relative tolerance by which a sample at a member's last time still counts as the member's own, despite round-off.
ROUNDING = 1e-12
