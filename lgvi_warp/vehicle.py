"""The vehicle: a rigid body with added mass, weight and buoyancy."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lgvi_warp.errors import Faults


@dataclass(frozen=True, eq=False)
class Vehicle:
    """A rigid body in water, about its centre of gravity, in body axes (x ahead, y to starboard, z down).

    mass: dry mass [kg]. added_mass: diagonal (3,) or symmetric (3, 3) [kg]. inertia: (3,) or (3, 3) [kg m2], added
    inertia included. buoyancy: weight of the displaced water [N]. center_of_buoyancy: (3,) [m], from the centre of
    gravity. Matrices are kept as (3, 3). `warnings` holds what is unusual but allowed.

    Raises SceneError naming every fault: not positive, not finite, wrong shape, not symmetric, not positive definite.
    """

    mass: float
    inertia: Any
    added_mass: Any = (0.0, 0.0, 0.0)
    buoyancy: float = 0.0
    center_of_buoyancy: Any = (0.0, 0.0, 0.0)
    warnings: tuple[str, ...] = field(default=(), init=False)

    def __post_init__(self) -> None:
        faults = Faults("vehicle.")
        mass = faults.positive("mass", self.mass, "kg")
        added = faults.symmetric("added_mass", self.added_mass, "kg")
        inertia = faults.symmetric("inertia", self.inertia, "kg m2")
        buoyancy = faults.number("buoyancy", self.buoyancy, "N", least=0.0)
        center = faults.finite("center_of_buoyancy", self.center_of_buoyancy, (3,), "m")
        if inertia is not None and np.linalg.eigvalsh(inertia)[0] <= 0.0:
            faults.add("inertia", self.inertia, "is not positive definite", "give principal inertias above 0 [kg m2]")
        if mass is not None and added is not None and np.linalg.eigvalsh(mass * np.eye(3) + added)[0] <= 0.0:
            faults.add(
                "added_mass",
                self.added_mass,
                "with the mass is not positive definite",
                "added mass is positive here: minus Fossen's X_udot, Y_vdot, Z_wdot [kg]",
            )
        faults.raise_if_any()
        values = {"mass": mass, "added_mass": added, "inertia": inertia, "buoyancy": buoyancy}
        for name, value in (values | {"center_of_buoyancy": center, "warnings": unusual(inertia)}).items():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
            object.__setattr__(self, name, value)

    @property
    def mass_matrix(self) -> np.ndarray:
        """M = mass I + added_mass, (3, 3) [kg]."""
        return self.mass * np.eye(3) + np.asarray(self.added_mass)

    def to_dict(self) -> dict[str, Any]:
        """As in a scene file: diagonal matrices as 3 numbers."""
        return {
            "mass": self.mass,
            "added_mass": compact(self.added_mass),
            "inertia": compact(self.inertia),
            "buoyancy": self.buoyancy,
            "center_of_buoyancy": self.center_of_buoyancy.tolist(),
        }


def compact(matrix: np.ndarray) -> list[Any]:
    """A diagonal matrix as its 3 numbers, another as nested lists."""
    diagonal = np.diag(matrix)
    return (diagonal if np.array_equal(matrix, np.diag(diagonal)) else matrix).tolist()


def unusual(inertia: Any) -> tuple[str, ...]:
    """Warns of principal inertias that no rigid body has (J_i + J_j < J_k); added inertia can have them."""
    small, middle, large = np.linalg.eigvalsh(inertia)
    if small + middle >= large * (1.0 - 1e-12):
        return ()
    text = f"vehicle.inertia: principal inertias {small:.6g} + {middle:.6g} < {large:.6g} [kg m2]"
    return (text + ": no rigid body has these; that is right only if added inertia makes the difference",)
