# SPDX-License-Identifier: Apache-2.0
"""A multilayer perceptron as a law."""

from collections.abc import Callable

import numpy as np

from lgvi_warp.reference.control import Measurement, Part, Reference, heading_error, pose_errors
from lgvi_warp.reference.rotation import Array

FUNCTIONS: dict[str, Callable[[Array], Array]] = {
    "linear": lambda x: x,
    "tanh": np.tanh,
    "clip": lambda x: np.clip(x, -1.0, 1.0),
    "relu": lambda x: np.maximum(x, 0.0),
}


class Policy(Part):
    """Attributes as in `lw.control.Policy`, but instead of its file layers: pairs of weights (n, m) and biases (n,)."""

    scale = 1.0
    activation, output_activation = "tanh", "linear"

    def seen(self, name: str, r: Reference, y: Measurement) -> Array:
        """The numbers (1,) or (3,) of an input, such as depth_error or velocity[0]."""
        e, e_R, _, _ = pose_errors(r, y)
        values = {
            "depth_error": r.position[2] - y.position[2],
            "heading_error": heading_error(r.R, y.R),
            "speed_error": r.speed - y.water_velocity[0],
            "depth": y.position[2],
            "position_error": y.R.T @ e,
            "attitude_error": e_R,
            "velocity": y.velocity,
            "water_velocity": y.water_velocity,
            "angular_velocity": y.angular_velocity,
            "down": y.R[2],
        }
        name, _, index = name.removesuffix("]").partition("[")
        value = np.atleast_1d(values[name])
        return value[[int(index)]] if index else value

    def control(self, w: Array, r: Reference, y: Measurement, unmet: Array) -> Array:
        """y = f(W y + b) layer by layer."""
        x = np.concatenate([self.seen(name, r, y) for name in self.inputs])
        *hidden, last = self.layers
        for W, b in hidden:
            x = FUNCTIONS[self.activation](W @ x + b)
        x = FUNCTIONS[self.output_activation](last[0] @ x + last[1])
        w = w.copy()
        w[["XYZKMN".index(name) for name in self.outputs]] += self.scale * x
        return w
