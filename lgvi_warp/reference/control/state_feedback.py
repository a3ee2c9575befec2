# SPDX-License-Identifier: Apache-2.0
"""Linear feedback of the whole state."""

import numpy as np

from lgvi_warp.reference.control import Measurement, Part, Reference, pose_errors
from lgvi_warp.reference.rotation import Array


class StateFeedback(Part):
    """Attributes as in `lw.control.StateFeedback`."""

    def control(self, w: Array, r: Reference, y: Measurement, unmet: Array) -> Array:
        """w = -K x."""
        e, e_R, velocity, rate = pose_errors(r, y)
        return np.asarray(w - self.K @ np.concatenate([-e, e_R, -velocity, -rate]))
