# SPDX-License-Identifier: Apache-2.0
"""Inertia that laws change in time: momenta (P; Pi) of the vehicle and of moving masses in it, and their velocities.

Lagrange's equations on SE(3) for T = (I6 + D(t)) v.v / 2 + w(t).v, v = (nu; Om): the momenta dT/dv = (I6 + D) v + w
turn with the body like those of a rigid body. Between steps a state contains I6 v, as without such laws.
"""

from dataclasses import replace

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.submaps import Body, State, look
from lgvi_warp.reference.terms import Law


def changes(body: Body) -> bool:
    """Whether a law changes the inertia."""
    return any(type(law).carried is not Law.carried for law in body.terms)


def carried(x: State, body: Body, h: float) -> tuple[Array, Array]:
    """D (6, 6) and w (6,), sums over the laws."""
    D, w = np.zeros((6, 6)), np.zeros(6)
    for law, view in zip(body.terms, look(x, body, h), strict=True):
        more, momentum = law.carried(view)
        D, w = D + more, w + momentum
    return D, w


def velocities(x: State, body: Body, h: float) -> Array:
    """(nu; Om) (6,) of a state with (P; Pi). docs/theory/coupled.md, (X19)."""
    D, w = carried(x, body, h) if changes(body) else (0.0, 0.0)
    return np.asarray(np.linalg.solve(body.I6 + D, np.concatenate([x.p, x.pi]) - w))


def boarded(x: State, body: Body, h: float) -> State:
    """The state with (P; Pi) at the start of a step of h, and the memory of laws for that step.

    docs/theory/coupled.md, (X19).
    """
    if not changes(body):
        return x
    D, w = carried(x, body, h)
    P = np.concatenate([x.p, x.pi])
    P = P + D @ np.linalg.solve(body.I6, P) + w
    memory = tuple(law.depart(view) for law, view in zip(body.terms, look(x, body, h), strict=True))
    return replace(x, p=P[:3], pi=P[3:], memory=memory)


def landed(x: State, body: Body, h: float) -> State:
    """The state with I6 (nu; Om) at the end of a step. docs/theory/coupled.md, (X19)."""
    if not changes(body):
        return x
    P = body.I6 @ velocities(x, body, h)
    return replace(x, p=P[:3], pi=P[3:])
