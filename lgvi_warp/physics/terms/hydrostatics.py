# SPDX-License-Identifier: Apache-2.0
"""Weight, buoyancy and restoring moment. They follow from the vehicle, so no scene lists them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lgvi_warp.physics.hydrostatics import moment, net
from lgvi_warp.physics.terms.base import CONSERVED, Array, Numbers, Packed, PackingContext, Term


@dataclass(frozen=True, eq=False, kw_only=True)
class Weight(Term):
    """Weight minus buoyancy, along the vertical (section IV of Nordkvist & Sanyal 2010). The term has no numbers."""

    type: ClassVar[str] = "weight"

    @property
    def conserves(self) -> frozenset[str]:
        # All three: its potential depends on depth alone.
        return CONSERVED

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The net force (m - rho V) g, formed here in float64 since it cancels, whatever the kernel's precision.
        return Packed({"net": net(context.parameters)})

    def potential(self, numbers: Numbers, position: Array, attitude: Array, parameters: Numbers) -> Array:
        # Energy U = -net b3, (k, n) [J], b3 the depth.
        return -net(parameters) * position[..., 2]


@dataclass(frozen=True, eq=False, kw_only=True)
class Restoring(Term):
    """Moment of buoyancy and weight about the body's origin (Nordkvist & Sanyal 2010, section IV). The term has no numbers."""

    type: ClassVar[str] = "restoring"

    @property
    def conserves(self) -> frozenset[str]:
        # All three: its potential depends only on the attitude relative to the vertical.
        return CONSERVED

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The vector B r_b - W r_g [N m] about the origin of the forces, in the kernel's axes.
        p, origin = context.parameters, context.frame.forces
        about = moment(p) + net(p)[:, None] * origin if np.any(origin) else moment(p)
        return Packed({"moment": context.frame.vector(about)})

    def potential(self, numbers: Numbers, position: Array, attitude: Array, parameters: Numbers) -> Array:
        # Energy U = (B r_b - W r_g).R^T e3, (k, n) [J].
        return np.sum(moment(parameters) * attitude[..., 2, :], axis=-1)
