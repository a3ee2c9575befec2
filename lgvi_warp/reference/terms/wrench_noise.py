"""White noise of force and torque in body axes."""

from dataclasses import dataclass

import numpy as np

from lgvi_warp.reference.random import normals
from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import Law, View


@dataclass(frozen=True)
class WrenchNoise(Law):
    """force (3,) [N s^1/2], torque (3,) [N m s^1/2], the key of its noise."""

    force: Array
    torque: Array
    channel: int = 0
    seed0: int = 0
    seed1: int = 0

    def wrench(self, view: View) -> tuple[Array, Array]:
        """Force and torque S xi / sqrt(h), held over the step."""
        channels = np.array([self.channel, self.channel + 1])
        xi = normals(self.seed0, self.seed1, view.member, view.step, channels)[:, :3] / np.sqrt(view.h)
        return self.force * xi[0], self.torque * xi[1]
