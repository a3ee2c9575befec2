# SPDX-License-Identifier: Apache-2.0
"""A trained perceptron as a control law."""

from __future__ import annotations

import math
import os
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.declared import word
from lgvi_warp.common.errors import Faults
from lgvi_warp.common.npy_files import of_npz
from lgvi_warp.control.base import ControlLaw, Numbers, Packed, PackingContext, list_of_names
from lgvi_warp.physics.terms.base import number

# What a policy may look at, in the device code's order: how many numbers each is, and what must be wanted for it.
INPUTS = {
    "depth_error": (1, "depth"),
    "heading_error": (1, "heading"),
    "speed_error": (1, "speed"),
    "depth": (1, None),
    "position_error": (3, "position"),
    "attitude_error": (3, "attitude"),
    "velocity": (3, None),
    "water_velocity": (3, None),
    "angular_velocity": (3, None),
    "down": (3, None),
}
OUTPUTS = ("X", "Y", "Z", "K", "M", "N")
# By the numbers that the device code has for them.
FUNCTIONS = ("linear", "tanh", "clip", "relu")
HIDDEN, LAST = ("tanh", "relu"), ("linear", "tanh", "clip")
# Weights and biases of a file; each is a row of the table.
MOST_NUMBERS = 1_000_000


def _places() -> Iterator[tuple[str, str | None]]:
    """(name, quantity) for each input of a policy, with the quantity that guidance must set for it or None."""
    for name, (length, wish) in INPUTS.items():
        yield from ((name if length == 1 else f"{name}[{i}]", wish) for i in range(length))


# Name of each number -> its place and what must be wanted for it.
PLACES = {name: (place, wish) for place, (name, wish) in enumerate(_places())}


@dataclass(frozen=True, eq=False, kw_only=True)
class Policy(ControlLaw):
    """A trained multilayer perceptron: each layer maps its input y to f(W y + b), where f is its activation function.

    The demand is `scale` times the output. The file holds W and b of each layer: weights_0 (n1, n0), biases_0 (n1,),
    weights_1 (n2, n1), ... as np.savez writes them, uncompressed. n0 is the number of inputs. Loading runs no code.

    Inputs that are wanted minus measured values are "depth_error" [m], "heading_error" [rad], "speed_error" [m/s],
    "position_error" [m, body axes], and "attitude_error", the e_R of `PosePID`. Inputs that are measured values are "depth"
    [m] and, in body axes, "velocity" over ground [m/s], "water_velocity" [m/s], "angular_velocity" [rad/s] and "down", the
    downward direction. A name with [0], [1] or [2] is one component of a vector.

    Args:
        file: Path of the .npz file. In a scene file the path is relative to the folder of the scene file.
        inputs: Names of the inputs in their order; together these inputs must have n0 numbers.
        outputs: Components of the demand that the last layer gives, among "X", "Y", "Z", "K", "M", "N", in their order.
        scale: Demand at an output of 1, one number for each output [N, N m]; 1 by default.
        activation: Activation of all layers but the last: "tanh", the default, or "relu".
        output_activation: Activation of the last layer: "linear", the default, "tanh", or "clip", which limits to [-1, 1].
        checksum: Checksum of the file's numbers; a file with another checksum is refused. By default it is not compared.

    Raises:
        SceneError: If the file cannot be read or does not fit `inputs` and `outputs`, or a number is invalid (see `Term`).
    """

    type: ClassVar[str] = "policy"

    file: str
    inputs: Sequence[str]
    outputs: Sequence[str]
    scale: Any = number(("n",), "N, N m", None, optional=True)
    activation: str = word("tanh", known=HIDDEN)
    output_activation: str = word("linear", known=LAST)
    checksum: int | None = None

    def check(self, faults: Faults) -> None:
        places = list_of_names(faults, "inputs", self.inputs, {name: name for name in (*INPUTS, *PLACES)})
        outputs = list_of_names(faults, "outputs", self.outputs, dict.fromkeys(OUTPUTS))
        if self.scale is not None and len(self.scale) != len(outputs):
            faults.add(
                "scale", self.scale, f"has {len(self.scale)} numbers", f"give {len(outputs)}, one for each output"
            )
        layers = _read(faults, self.file)
        names = [name for place in places for name in PLACES if place in (name, name.partition("[")[0])]
        if faults or not layers:
            return
        for where, got, want in (
            ("inputs", len(names), layers[0][0].shape[1]),
            ("outputs", len(outputs), len(layers[-1][0])),
        ):
            if got != want:
                faults.add(where, getattr(self, where), f"are {got} numbers", f"name the {want} of {self.file}")
        numbers = np.concatenate([np.concatenate([W.ravel(), b]) for W, b in layers])
        checksum = zlib.crc32(numbers.astype("<f8").tobytes())
        if self.checksum not in (None, checksum):
            faults.add(
                "checksum", self.checksum, f"is not that of {self.file}, {checksum}", "leave it out to take this file"
            )
        wishes = dict.fromkeys(PLACES[name][1] for name in names)
        known = {
            "file": os.fspath(self.file),
            "layers": layers,
            "places": np.array([PLACES[name][0] for name in names]),
            "needs": tuple(wish for wish in wishes if wish),
            "demands": tuple(outputs),
            "checksum": checksum,
            "inputs": tuple(places),
            "outputs": tuple(outputs),
        }
        for name, value in known.items():
            object.__setattr__(self, name, value)

    def to_dict(self) -> dict[str, Any]:
        return super().to_dict() | {"inputs": list(self.inputs), "outputs": list(self.outputs)}

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # Places of the inputs; of each layer its sizes, W line by line and b; then places of the outputs.
        layers, places = vars(self)["layers"], vars(self)["places"]
        outputs = [OUTPUTS.index(name) for name in self.outputs]
        each = [np.concatenate([[W.shape[1], len(b)], W.ravel(), b]) for W, b in layers]
        rows = np.concatenate([places, *each, outputs]).astype(float)
        scale = numbers.get("scale", np.ones((1, len(outputs))))
        wrench = np.zeros((len(scale), 6))
        wrench[:, outputs] = scale
        widest = max(max(W.shape) for W, _ in layers)
        words = {"inputs": len(places), "layers": len(layers), "outputs": len(outputs), "widest": widest}
        words |= {"hidden": FUNCTIONS.index(self.activation), "last": FUNCTIONS.index(self.output_activation)}
        scales = {"force": wrench[:, :3], "torque": wrench[:, 3:]}
        return Packed(words | scales, rows[None], work=len(PLACES) + len(OUTPUTS) + 2 * widest)


def _read(faults: Faults, file: Any) -> list[tuple[np.ndarray, np.ndarray]]:
    """Weights (n, m) and biases (n,) of each layer of a file."""
    remedy = "save it by np.savez(file, weights_0=..., biases_0=..., weights_1=..., ...)"
    try:
        arrays = of_npz(os.fspath(file))
    except (OSError, ValueError, TypeError) as error:
        faults.add("file", file, str(getattr(error, "strerror", None) or error), remedy)
        return []
    count = len(arrays) // 2
    names = [f"{kind}_{i}" for i in range(count) for kind in ("weights", "biases")]
    if not count or set(names) != set(arrays):
        problem = f"has {', '.join(sorted(arrays)[:6]) or 'no arrays'}"
        faults.add("file", file, problem, remedy)
        return []
    if sum(array.size for array in arrays.values()) > MOST_NUMBERS:
        faults.add("file", file, f"has more than {MOST_NUMBERS:,} numbers", "train a smaller policy")
        return []
    layers: list[tuple[np.ndarray, np.ndarray]] = []
    for i in range(count):
        W, b = arrays[f"weights_{i}"], arrays[f"biases_{i}"]
        wide = len(layers[-1][1]) if layers else None
        if W.ndim != 2 or 0 in W.shape or b.shape != W.shape[:1] or wide not in (None, W.shape[1]):
            shapes = f"has weights_{i} of shape {W.shape} and biases_{i} of shape {b.shape}"
            faults.add("file", file, shapes, f"give (n, {wide or 'm'}) and (n,)")
            return []
        if not all(array.dtype.kind in "fiu" and math.isfinite(float(np.abs(array).max())) for array in (W, b)):
            faults.add("file", file, f"has other than finite numbers in layer {i}", "give finite numbers")
            return []
        layers.append((W.astype(float), b.astype(float)))
    return layers
