# SPDX-License-Identifier: Apache-2.0
"""`mpc`: model predictive control by a linear model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import of_kind
from lgvi_warp.common.errors import Faults
from lgvi_warp.extensions.others.control.linear_mpc import COORDINATES, LinearMPC
from lgvi_warp.physics.terms.control_wrench import COMPONENTS
from lgvi_warp.robustness.linear.linearize import LinearModel
from lgvi_warp.robustness.linear.lqr import lqr


def mpc(
    model: LinearModel,
    Q: Any,
    R: Any,
    limit: Any,
    *,
    rate_limit: Any = None,
    horizon: int = 10,
    iterations: int = 50,
    disturbance_time: float = 5.0,
    tracked: Sequence[str] | None = None,
    lower: Any = None,
    outputs: Any = None,
    output_limit: Any = None,
    excess_cost: Any = None,
    preview: bool = False,
    name: str = "",
) -> LinearMPC:
    """Design model predictive control of a linear model, with the terminal cost of its linear quadratic regulator.

    While no limit is active, the law equals the linear quadratic regulator for any horizon.

    Args:
        model: Linear model from `lw.linear.linearize(scene, inputs="wrench", period=...)`, reduced to some states and inputs
            by `.part(...)`. Its period must be that of the controller. Velocities are over ground, as for a set-point.
        Q: Weights of the states (n,), at least 0.
        R: Weights of the inputs (m,), above 0.
        limit: Largest inputs (m,) [N, N m].
        rate_limit: Largest rates of the inputs (m,) [N/s, N m/s]; by default no limit.
        horizon: Number of periods, 1 to 100; 10 by default.
        iterations: Largest number of iterations at a tick; 50 by default.
        disturbance_time: Time constant of the disturbance filter [s]; with inf, no disturbance is estimated. 5 by default.
        tracked: Names of the states whose steady errors are to be 0; by default the first m states.
        lower: Least inputs (m,) [N, N m]; by default -limit.
        outputs: Combinations of the states (p, n) that have a limit, C x <= output_limit; by default none.
        output_limit: Largest outputs (p,).
        excess_cost: Cost of one unit of an output beyond its limit, at each tick (p,), above 0.
        preview: Whether to use the future reference of set-points and trajectories; False by default.
        name: Name of the part; by default its type.

    Returns:
        The control law.

    Raises:
        SceneError: If inputs are not components of a wrench, states are not coordinates of the motion, a weight is invalid,
            or no gains stabilise every state.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("bluerov2_heavy")
        >>> model = lw.linear.linearize(scene, period=0.1, inputs="wrench", method="psi_s", h=0.02)
        >>> heave = model.part(("position[2]", "velocity[2]"), ("Z",))
        >>> law = lw.linear.mpc(heave, Q=[4.0, 1.0], R=[1e-4], limit=[60.0], rate_limit=[100.0])
        >>> law.states, law.horizon
        (('position[2]', 'velocity[2]'), 10)
    """
    faults = Faults()
    of_kind("model", model, "A B C D", "a LinearModel", "give what lw.linear.linearize returns")
    for key, names, known in (("inputs", model.inputs, COMPONENTS), ("states", model.states, tuple(COORDINATES))):
        wrong = [each for each in names if each not in known]
        if wrong:
            remedy = 'give lw.linear.linearize(scene, inputs="wrench"), and .part(...) of coordinates of the motion'
            faults.add(f"model.{key}", ", ".join(wrong), "is nothing that the law knows", remedy)
    faults.raise_if_any()
    weights = {key: np.atleast_1d(np.asarray(value, dtype=float)) for key, value in (("Q", Q), ("R", R))}
    return LinearMPC(
        states=model.states,
        inputs=model.inputs,
        A=model.A,
        B=model.B,
        **weights,
        P=lqr(model, **weights).P,
        limit=limit,
        rate_limit=rate_limit,
        disturbance_time=disturbance_time,
        tracked=tracked,
        lower=lower,
        outputs=outputs,
        output_limit=output_limit,
        excess_cost=excess_cost,
        preview=preview,
        horizon=horizon,
        iterations=iterations,
        period=model.dt,
        name=name,
    )
