# SPDX-License-Identifier: Apache-2.0
"""Rates of a member's motion at its start, which limit the step of a method.

The rates are |J^-1 pi| of the rotation, the frequencies w of the Munk oscillation and of the restoring oscillation, and
(l + 2 q |v|) / I of the drag.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lgvi_warp.physics import inertia, vehicle


def rates(
    parameters: Mapping[str, np.ndarray], velocity: np.ndarray, angular_velocity: np.ndarray
) -> dict[str, np.ndarray]:
    """Rates of members at their start, {name in LIMITS: (n,) [rad/s; drag 1/s]} (Mathematics, section 7).

    w_Munk^2 = |p|^2 (1/M_min - 1/M_max) / J_min, w_restoring^2 = B |r| / J_min. Velocities (n, 3) are in body axes.
    """
    n = len(velocity)
    I6 = np.broadcast_to(vehicle.inertia6(parameters), (n, 6, 6))
    p = np.einsum("nij,nj->ni", I6, np.concatenate([velocity, angular_velocity], axis=1))[:, :3]
    frame, _ = inertia.uncoupled_frame(inertia.blocks(I6))
    least, most = (1.0 / np.linalg.eigvalsh(frame.M)[:, i] for i in (-1, 0))
    J = np.min(frame.J, axis=1)
    arm = parameters["vehicle.center_of_buoyancy"] - parameters.get("vehicle.center_of_gravity", np.zeros((1, 3)))
    moment = parameters["vehicle.buoyancy"] * np.linalg.norm(arm, axis=-1)
    # A difference of two equal masses is round-off.
    spread = np.where(most - least > 1e-12 * most, most - least, 0.0)
    by_kind = {
        "rotation": np.linalg.norm(angular_velocity, axis=1),
        "munk": np.linalg.norm(p, axis=1) * np.sqrt(spread / J),
        "restoring": np.sqrt(moment / J) + np.zeros(n),
    }
    return by_kind | {"drag": drag_rate(parameters, I6, velocity, angular_velocity)}


def drag_rate(
    parameters: Mapping[str, np.ndarray], I6: np.ndarray, velocity: np.ndarray, angular_velocity: np.ndarray
) -> np.ndarray:
    """The largest (l_ii + 2 q_ii |v_i|) / I_ii of the six axes (n,) [1/s], with the sums l and q of all drag terms."""
    speeds = np.abs(np.concatenate([velocity, angular_velocity], axis=1))
    total = np.zeros_like(speeds)
    for key in drag_keys(parameters):
        linear, quadratic = (_diagonal(parameters[f"{key}.{kind}"]) for kind in ("linear", "quadratic"))
        total = total + linear + 2.0 * quadratic * speeds
    return np.asarray(np.max(total / np.einsum("nii->ni", I6), axis=1))


def drag_keys(parameters: Mapping[str, np.ndarray]) -> list[str]:
    """Find the terms with linear and quadratic drag coefficients on six axes."""
    keys = [name.removesuffix(".quadratic") for name in parameters if name.endswith(".quadratic")]
    return [key for key in keys if parameters.get(f"{key}.linear", np.zeros(1)).shape[-1] == 6]


def _diagonal(values: np.ndarray) -> np.ndarray:
    return values if values.ndim == 2 else np.einsum("nii->ni", values)
