# SPDX-License-Identifier: Apache-2.0
"""Sliding mode control of the heading."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from lgvi_warp.control.base import IntegralLaw
from lgvi_warp.physics.terms.base import number


@dataclass(frozen=True, eq=False, kw_only=True)
class HeadingSMC(IntegralLaw):
    """Integral sliding mode control of the heading, with Nomoto's model as feedforward (Fossen 2021, eq. 16.479).

    Let psi be the heading, r its rate, psi_d and r_d their wanted values, and I the integral of psi - psi_d. Then
    sigma = (r - r_d) + 2 lambda (psi - psi_d) + lambda^2 I, r_v = r - sigma, and
    a_v = dr_d/dt - 2 lambda (r - r_d) - lambda^2 (psi - psi_d). The demand, with sat(x) for x limited to [-1, 1], is
    N = (nomoto_time a_v + r_v - k_d sigma - k_sigma sat(sigma / boundary)) / nomoto_gain.

    Args:
        lambda_: Rate at which errors decay while sigma is 0 [1/s]; its name is `lambda` in a scene file.
        boundary: Half the thickness of the layer about sigma = 0 in which sat is linear [rad/s].
        k_sigma: Gain of the switching part [rad/s].
        k_d: Gain of the linear part [1]; 0 by default.
        nomoto_gain: K of Nomoto's model T dr/dt + r = K N [rad/(s N m)].
        nomoto_time: T of Nomoto's model [s]; 0 by default.
        integral_limit: Largest size of I [rad s]; 1e6 by default.
        anti_windup: "conditional", the default, stops an integrator while the actuators do not deliver the whole demand
            and further integration would increase the undelivered part. "none" never stops an integrator.
    """

    type: ClassVar[str] = "heading_smc"
    needs: ClassVar[tuple[str, ...]] = ("heading",)
    demands: ClassVar[tuple[str, ...]] = ("N",)

    lambda_: Any = number((), "1/s", least=0.0)
    boundary: Any = number((), "rad/s", above=0.0)
    k_sigma: Any = number((), "rad/s", least=0.0)
    k_d: Any = number((), "1", 0.0, least=0.0)
    nomoto_gain: Any = number((), "rad/(s N m)", above=0.0)
    nomoto_time: Any = number((), "s", 0.0, least=0.0)
    integral_limit: Any = number((), "rad s", 1e6, least=0.0)
