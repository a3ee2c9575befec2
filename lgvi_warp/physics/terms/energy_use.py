# SPDX-License-Identifier: Apache-2.0
"""The account of the energy that a vehicle uses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from lgvi_warp.physics.terms.base import CONSERVED, Term, number


@dataclass(frozen=True, eq=False, kw_only=True)
class EnergyUse(Term):
    """The account of the energy used: `energy_used` [J] is the time integral of the hotel load and of the power of all terms.

    The power of thrusters follows from their `power` or `shaft_speed`; the power of pumps follows from their `efficiency`. A
    scene without this term has no account. The account starts at 0 and continues when a run is continued. Its value
    can be saved as a sample, `lw.SaveAt(fields=[..., "energy_used"])`, and is a quantity of statistics.

    Args:
        hotel: Hotel load, the constant power of computers and sensors [W]; 0 by default.

    Examples:
        >>> import lgvi_warp as lw
        >>> account = lw.terms.EnergyUse(hotel=20.0)
        >>> scene = lw.Scene.named("remus_100", terms=[account])
        >>> result = lw.solve(scene, h=0.1, t1=5.0, save=lw.SaveAt(fields=("position", "energy_used")))
        >>> print(f"{result.samples['energy_used'][-1, 0]:.6g} J")
        100 J
    """

    type: ClassVar[str] = "energy_use"
    accounts: ClassVar[bool] = True
    unique: ClassVar[bool] = True
    # The energy used, and the digits that it cannot hold.
    memory_rows: ClassVar[int] = 2

    hotel: Any = number((), "W", 0.0, least=0.0)

    @property
    def conserves(self) -> frozenset[str]:
        # It does nothing to the motion.
        return CONSERVED
