"""The host's side of each law: when a scene has it, its parameters from the vehicle's, and its potential energy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from lgvi_warp.notation import rotate_into

Parameters = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class TermKind:
    """A law as the host sees it. Arrays have a leading dimension of 1 (shared) or n (one per member).

    name: that of the law in lgvi_kernels.terms; needs: the parameters it is computed from;
    values: physical parameters -> the law's own, by field name, in the user's body axes;
    vectors: which of these turn with the axes;
    potential: (own parameters, position (k, n, 3), downward direction R^T e3 (k, n, 3)) -> energy (k, n) [J].
    """

    name: str
    needs: tuple[str, ...]
    values: Callable[[Parameters], dict[str, np.ndarray]]
    vectors: tuple[str, ...]
    potential: Callable[[Mapping[str, np.ndarray], np.ndarray, np.ndarray], np.ndarray]

    def present(self, parameters: Parameters) -> bool:
        """Whether any member has this law: a value of it differs from zero."""
        return any(np.any(value != 0.0) for value in self.values(parameters).values())

    def in_axes(self, parameters: Parameters, Q: np.ndarray) -> dict[str, np.ndarray]:
        """The law's parameters with vectors turned into the axes Q (1 or n, 3, 3)."""
        own = self.values(parameters)
        return {key: rotate_into(Q, value) if key in self.vectors else value for key, value in own.items()}


def _weight(p: Parameters) -> dict[str, np.ndarray]:
    # (m - rho V) g cancels: formed here in float64, whatever the kernel's precision.
    return {"net": p["vehicle.mass"] * p["environment.gravity"] - p["vehicle.buoyancy"]}


def _restoring(p: Parameters) -> dict[str, np.ndarray]:
    return {"moment": p["vehicle.buoyancy"][:, None] * p["vehicle.center_of_buoyancy"]}


def _weight_potential(own: Mapping[str, np.ndarray], position: np.ndarray, down: np.ndarray) -> np.ndarray:
    """U = -net b3."""
    return -own["net"] * position[..., 2]


def _restoring_potential(own: Mapping[str, np.ndarray], position: np.ndarray, down: np.ndarray) -> np.ndarray:
    """U = B r.R^T e3."""
    return np.sum(own["moment"] * down, axis=-1)


KINDS = (
    TermKind("weight", ("vehicle.mass", "environment.gravity", "vehicle.buoyancy"), _weight, (), _weight_potential),
    TermKind(
        "restoring",
        ("vehicle.buoyancy", "vehicle.center_of_buoyancy"),
        _restoring,
        ("moment",),
        _restoring_potential,
    ),
)


def present(parameters: Parameters) -> tuple[TermKind, ...]:
    """The laws that some member of the ensemble has, in a fixed order."""
    return tuple(kind for kind in KINDS if kind.present(parameters))
