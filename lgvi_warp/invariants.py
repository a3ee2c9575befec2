"""Energy and momenta of a result's samples, in float64."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lgvi_warp import terms, vehicle

if TYPE_CHECKING:
    from lgvi_warp.result import Result


def _times(matrix: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Matrices (1 or n, 3, 3) or (k, n, 3, 3) times vectors (k, n, 3)."""
    diagonal = matrix.ndim == 3 and not np.any(matrix[:, ~np.eye(3, dtype=bool)])
    if diagonal:
        return np.einsum("nii->ni", matrix) * vectors
    rows = (sum(matrix[..., i, j] * vectors[..., j] for j in range(3)) for i in range(3))
    return np.stack(list(rows), axis=-1)


def _relative(result: Result) -> np.ndarray:
    """(nu, Om) relative to the water, (k, n, 6), body axes about the user's origin."""
    nu = result.velocity.astype(np.float64)
    position, time = result.position.astype(np.float64), result.time
    for term in result.terms:
        water = term.water(result.own(term), position, time, result.parameters)
        if water is not None:
            nu = nu - _times(np.swapaxes(result.attitude.astype(np.float64), -1, -2), water)
    return np.concatenate([nu, result.angular_velocity.astype(np.float64)], axis=-1)


def _momenta(result: Result) -> np.ndarray:
    """(p, pi) about the user's origin, (k, n, 6)."""
    return np.einsum("nij,knj->kni", *_broadcast(vehicle.inertia6(result.parameters), _relative(result)))


def _broadcast(matrices: np.ndarray, vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.broadcast_to(matrices, (vectors.shape[1], *matrices.shape[1:])), vectors


def kinetic_energy(result: Result) -> np.ndarray:
    """Kinetic energy relative to the water, (nu, Om).I6 (nu, Om) / 2, (k, n) [J]."""
    return np.asarray(0.5 * np.sum(_relative(result) * _momenta(result), axis=-1))


def energy(result: Result) -> np.ndarray:
    """Kinetic energy and the potential of every term, (k, n) [J]."""
    total = kinetic_energy(result)
    position, attitude = result.position.astype(np.float64), result.attitude.astype(np.float64)
    for term in (*terms.IMPLIED, *result.terms):
        total = total + term.potential(result.own(term), position, attitude, result.parameters)
    return np.asarray(total)


def linear_momentum(result: Result) -> np.ndarray:
    """R p in inertial axes, (k, n, 3) [N s]. Without a potential it is conserved."""
    return _times(result.attitude.astype(np.float64), _momenta(result)[..., :3])


def angular_momentum(result: Result) -> np.ndarray:
    """R pi + b x R p about the inertial origin, (k, n, 3) [N m s]. Without a potential it is conserved."""
    spin = _momenta(result)[..., 3:]
    b, P = (np.moveaxis(x, -1, 0) for x in (result.position.astype(np.float64), linear_momentum(result)))
    orbit = np.stack([b[1] * P[2] - b[2] * P[1], b[2] * P[0] - b[0] * P[2], b[0] * P[1] - b[1] * P[0]], axis=-1)
    return _times(result.attitude.astype(np.float64), spin) + orbit


def energy_growth(result: Result, *, dissipative: bool = False) -> np.ndarray:
    """Largest change of energy (n,), or where it is dissipative largest growth, over what members could hold.

    That is |p|^2 / (2 M_min) + |pi|^2 / (2 J_min) of the start and, up to each time, the largest change of the potential:
    a bounded motion stays below about 1, whatever it exchanges.
    """
    kinetic, total = kinetic_energy(result), result.energy
    potential = total - kinetic
    momenta = _momenta(result)[0]
    I6 = np.broadcast_to(vehicle.inertia6(result.parameters), (result.members, 6, 6))
    held = sum(0.5 * np.sum(momenta[:, part] ** 2, axis=1) / np.linalg.eigvalsh(I6[:, part, part])[:, 0]
               for part in (slice(0, 3), slice(3, 6)))  # fmt: skip
    given = np.maximum.accumulate(np.abs(potential - potential[:1]), axis=0)
    change = total - total[:1]
    growth = np.max((change if dissipative else np.abs(change)) / np.maximum(held + given, 1e-300), axis=0)
    return np.where(np.isfinite(total).all(axis=0), growth, np.inf)


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
