# SPDX-License-Identifier: Apache-2.0
"""Lift of a hull in proportion to its speed ahead."""

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import Law, View


class BodyLift(Law):
    """Attributes as in `lw.terms.BodyLift`: force_i = -u sum_j matrix_ij v_j."""

    def damping(self, view: View) -> Array:
        """D (6, 6): the speed ahead times the matrix."""
        return np.asarray(view.nu[0] * self.matrix)
