# SPDX-License-Identifier: Apache-2.0
"""`lqr`: gains of the linear quadratic regulator of a linear model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import explained, of_kind
from lgvi_warp.common.errors import Faults, SceneError, refusal
from lgvi_warp.control.state_feedback import StateFeedback
from lgvi_warp.physics import notation
from lgvi_warp.physics.terms.control_wrench import COMPONENTS
from lgvi_warp.robustness.linear.bench import COORDINATES
from lgvi_warp.robustness.linear.linearize import LinearModel


@explained
@dataclass(frozen=True)
class Regulator:
    """Linear quadratic regulator u = -K x, with n states x and m inputs u of a linear model.

    Attributes:
        K: the gains (m, n), from each state to each input.
        P: (n, n), matrix of the minimal cost: for a start at x, the sum of x^T Q x + u^T R u over all ticks is x^T P x.
        poles: eigenvalues of A - B K (n,), the largest first; A and B are the matrices of the model.
        model: the linear model.
    """

    K: np.ndarray
    P: np.ndarray
    poles: np.ndarray
    model: LinearModel

    def law(self, name: str = "") -> StateFeedback:
        """Convert the gains to a law of a controller.

        Args:
            name: Name of the law in the controller; by default its type, "state_feedback".

        Returns:
            The law. Its velocity error, unlike the model's, depends on attitude; the attitude gains correct for this.

        Raises:
            SceneError: If an input is not a component of a wrench, or a state is not a coordinate of the motion.
        """
        faults, model = Faults(), self.model
        for key, names, known in (("inputs", model.inputs, COMPONENTS), ("states", model.states, COORDINATES)):
            wrong = [name for name in names if name not in known]
            if wrong:
                remedy = (
                    'give lw.linear.linearize(scene, inputs="wrench"), and .part(...) without what actuators remember'
                )
                faults.add(f"model.{key}", ", ".join(wrong), "is nothing that a state feedback knows", remedy)
        faults.raise_if_any()
        gains = np.zeros((6, 12))
        rows, columns = map(COMPONENTS.index, model.inputs), map(COORDINATES.index, model.states)
        gains[np.ix_(list(rows), list(columns))] = self.K
        # The law's error of velocity is nu - R^T v_d = d nu - v x d rotation, to first order: K x is the same with this.
        gains[:, 3:6] += gains[:, 6:9] @ notation.hat(model.about["velocity"])
        return StateFeedback(K=gains, name=name)


def lqr(model: LinearModel, Q: Any, R: Any) -> Regulator:
    """Design a linear quadratic regulator: gains that minimise the sum of x^T Q x + u^T R u over all ticks.

    Args:
        model: Linear model from `lw.linear.linearize`; n states x, m inputs u. `Regulator.law` needs inputs="wrench".
        Q: Weights of the states: a positive semidefinite matrix (n, n), or its diagonal (n,).
        R: Weights of the inputs: a positive definite matrix (m, m), or its diagonal (m,).

    Returns:
        The gains, the matrix of the cost, and the poles of the closed loop.

    Raises:
        SceneError: If a matrix is wrong, or no gains stabilise all states; the message names the uncontrollable poles.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("bluerov2_heavy")
        >>> steady = lw.linear.trim(scene, speed=0.5, fixed={"pitch": 0.0}, method="psi_s", h=0.02)
        >>> model = lw.linear.linearize(scene, steady, period=0.1, inputs="wrench")
        >>> regulator = lw.linear.lqr(model, Q=[4.0] * 3 + [9.0] * 3 + [1.0] * 6, R=[0.01] * 6)
        >>> regulator.K.shape, bool((abs(regulator.poles) < 1.0).all())
        ((6, 12), True)
    """
    from scipy.linalg import solve_discrete_are

    faults = Faults()
    n, m = of_kind("model", model, "A B C D", "a LinearModel", "give what lw.linear.linearize returns").B.shape
    Q, R = _weights(faults, "Q", Q, n, 0.0), _weights(faults, "R", R, m, np.finfo(float).tiny)
    faults.raise_if_any()
    A, B = model.A, model.B
    try:
        P = solve_discrete_are(A, B, Q, R)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise _not_held(model) from error
    K = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
    poles = np.linalg.eigvals(A - B @ K)
    return Regulator(K, P, poles[np.argsort(-np.abs(poles))], model)


def _weights(faults: Faults, key: str, value: Any, size: int, least: float) -> np.ndarray:
    """Read a symmetric matrix of weights."""
    shape = f"give ({size}, {size}), or ({size},) of its diagonal"
    array = faults.real(key, value, shape)
    if array is None:
        return np.eye(size)
    matrix = np.diag(array) if array.ndim == 1 else array
    if matrix.shape != (size, size):
        faults.add(key, "...", f"has shape {array.shape}", shape)
        return np.eye(size)
    if not np.allclose(matrix, matrix.T) or np.linalg.eigvalsh(matrix).min() < least - 1e-12 * np.abs(matrix).max():
        faults.add(key, value, "is not symmetric and " + ("positive" if least else "at least 0"), "give such weights")
    return matrix


def _not_held(model: LinearModel) -> SceneError:
    """Error for a model with poles z that no gain moves (Hautus): the rows of [A - z, B] are linearly dependent."""
    n = len(model.A)
    stuck = [
        z for z in model.poles if abs(z) >= 1.0 - 1e-9
        and np.linalg.svd(np.hstack([model.A - z * np.eye(n), model.B]), compute_uv=False)[-1] < 1e-7
    ]  # fmt: skip
    which = ", ".join(f"{z:.4g}" for z in stuck) or "none far from the edge"
    problem = f"has no gains that hold every state: poles that no input moves are {which}"
    remedy = "give other inputs, leave states out by .part(...), or weigh them in Q"
    return refusal("model", ", ".join(model.inputs), problem, remedy)
