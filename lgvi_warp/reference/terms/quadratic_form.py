# SPDX-License-Identifier: Apache-2.0
"""Forces that are sums of products of two velocities."""

import math

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import Law, View


class QuadraticForm(Law):
    """force_i = sum_jk (c_ijk v_j + d_ijk |v_j|) v_k + sum_k h_ik s v_k, s = (v^2 + w^2)^1/2; c, d (6, 6, 6), h (6, 6)."""

    def damping(self, view: View) -> Array:
        """D (6, 6): minus the sums over j, and minus s h."""
        v = np.concatenate([view.nu, view.Om])
        D = np.einsum("ijk,j->ik", self.c, v) + np.einsum("ijk,j->ik", self.d, np.abs(v))
        return np.asarray(-D - math.hypot(v[1], v[2]) * self.h)
