# SPDX-License-Identifier: Apache-2.0
"""White noise of force and torque in body axes."""

import numpy as np

from lgvi_warp.reference.random import draws_of_step
from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import Law, View


class WrenchNoise(Law):
    """Attributes as in `lw.terms.WrenchNoise`; the key of its noise."""

    channel = 0
    seed0 = 0
    seed1 = 0
    noise_step = None

    def wrench(self, view: View) -> tuple[Array, Array]:
        """Force and torque S xi / sqrt(h), constant over the step; xi: sum of the draws divided by sqrt(their number)."""
        draws = [draws_of_step(self, view, stream) for stream in (0, 1)]
        f, m = (xi.sum(axis=0) / np.sqrt(len(xi)) / np.sqrt(view.h) for xi in draws)
        return self.force * f, self.torque * m
