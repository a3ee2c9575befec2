"""Energy and momenta of a result's samples, in float64."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lgvi_warp import terms

if TYPE_CHECKING:
    from lgvi_warp.result import Result


def _times(matrix: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Matrices (1 or n, 3, 3) or (k, n, 3, 3) times vectors (k, n, 3)."""
    diagonal = matrix.ndim == 3 and not np.any(matrix[:, ~np.eye(3, dtype=bool)])
    if diagonal:
        return np.einsum("nii->ni", matrix) * vectors
    rows = (sum(matrix[..., i, j] * vectors[..., j] for j in range(3)) for i in range(3))
    return np.stack(list(rows), axis=-1)


def _mass_matrix(parameters: terms.Parameters) -> np.ndarray:
    return parameters["vehicle.mass"][:, None, None] * np.eye(3) + parameters["vehicle.added_mass"]


def energy(result: Result) -> np.ndarray:
    """nu.M nu / 2 + Om.J Om / 2 + U(b, R), (k, n) [J]."""
    parameters = result.parameters
    nu, Om = result.velocity.astype(np.float64), result.angular_velocity.astype(np.float64)
    total = 0.5 * np.sum(nu * _times(_mass_matrix(parameters), nu), axis=-1)
    total += 0.5 * np.sum(Om * _times(parameters["vehicle.inertia"], Om), axis=-1)
    down = result.attitude[..., 2, :].astype(np.float64)
    for kind in terms.present(parameters):
        total += kind.potential(kind.values(parameters), result.position.astype(np.float64), down)
    return total


def linear_momentum(result: Result) -> np.ndarray:
    """R M nu in inertial axes, (k, n, 3) [N s]. Without a potential it is conserved."""
    p = _times(_mass_matrix(result.parameters), result.velocity.astype(np.float64))
    return _times(result.attitude.astype(np.float64), p)


def angular_momentum(result: Result) -> np.ndarray:
    """R J Om + b x R M nu about the inertial origin, (k, n, 3) [N m s]. Without a potential it is conserved."""
    spin = _times(result.parameters["vehicle.inertia"], result.angular_velocity.astype(np.float64))
    b, P = (np.moveaxis(x, -1, 0) for x in (result.position.astype(np.float64), linear_momentum(result)))
    orbit = np.stack([b[1] * P[2] - b[2] * P[1], b[2] * P[0] - b[0] * P[2], b[0] * P[1] - b[1] * P[0]], axis=-1)
    return _times(result.attitude.astype(np.float64), spin) + orbit


def drift(result: Result) -> dict[str, float]:
    """Largest change over times and members of what every scene of weight and buoyancy conserves.

    energy [J]; horizontal linear momentum [N s]; vertical angular momentum [N m s]. Members that failed are left out;
    NaN if none is left.
    """
    good = np.asarray(result.status) == 0
    if not good.any():
        return {"energy": np.nan, "horizontal_momentum": np.nan, "vertical_angular_momentum": np.nan}
    changes = {
        "energy": result.energy,
        "horizontal_momentum": linear_momentum(result)[..., :2],
        "vertical_angular_momentum": angular_momentum(result)[..., 2],
    }
    return {name: float(np.abs(values - values[:1])[:, good].max()) for name, values in changes.items()}
