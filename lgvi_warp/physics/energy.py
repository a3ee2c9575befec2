# SPDX-License-Identifier: Apache-2.0
"""Energy and momenta of a result's samples, in float64."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from lgvi_warp.common.status import failed, under_way
from lgvi_warp.physics import terms, vehicle
from lgvi_warp.physics.terms.base import CONSERVED, Inner, Term


class Sampled(Protocol):
    """Samples at k times of n members: a `Result`, or one block of it."""

    @property
    def time(self) -> np.ndarray:
        """Times of the samples, (k,) [s]."""

    @property
    def position(self) -> np.ndarray:
        """Positions, (k, n, 3) [m], in inertial axes."""

    @property
    def attitude(self) -> np.ndarray:
        """Attitudes, (k, n, 3, 3), body to inertial axes."""

    @property
    def velocity(self) -> np.ndarray:
        """Velocities, (k, n, 3) [m/s], in body axes."""

    @property
    def angular_velocity(self) -> np.ndarray:
        """Angular velocities, (k, n, 3) [rad/s], in body axes."""

    @property
    def energy(self) -> np.ndarray:
        """Total energy, (k, n) [J], as computed by `energy`."""

    @property
    def status(self) -> np.ndarray:
        """Status of each member, (n,)."""

    @property
    def members(self) -> int:
        """The number of members, n."""

    @property
    def parameters(self) -> Mapping[str, np.ndarray]:
        """The scene's parameters by name, each of shape (1, ...) or (n, ...)."""

    @property
    def terms(self) -> Sequence[Term]:
        """The terms of the scene, without weight and restoring moment."""

    def own(self, term: Term) -> dict[str, np.ndarray]:
        """The numbers of one term by field, each of shape (1, ...) or (n, ...)."""


def _times(matrix: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Matrices (1 or n, 3, 3) or (k, n, 3, 3) times vectors (k, n, 3)."""
    diagonal = matrix.ndim == 3 and not np.any(matrix[:, ~np.eye(3, dtype=bool)])
    if diagonal:
        return np.einsum("nii->ni", matrix) * vectors
    rows = (sum(matrix[..., i, j] * vectors[..., j] for j in range(3)) for i in range(3))
    return np.stack(list(rows), axis=-1)


def _relative(result: Sampled) -> np.ndarray:
    """Velocities (nu, Om) relative to the water, (k, n, 6), in body axes about the user's origin."""
    nu = result.velocity.astype(np.float64)
    position, time = result.position.astype(np.float64), result.time
    for term in result.terms:
        water = term.water(result.own(term), position, time, result.parameters)
        if water is not None:
            nu = nu - _times(np.swapaxes(result.attitude.astype(np.float64), -1, -2), water)
    return np.concatenate([nu, result.angular_velocity.astype(np.float64)], axis=-1)


def _momenta(result: Sampled) -> np.ndarray:
    """(p, pi) about the user's origin, (k, n, 6), of the vehicle and of the masses that move in it."""
    relative = _relative(result)
    momenta = _momenta_of_vehicle(result, relative)
    return np.asarray(sum((inner.momenta for inner in _inner(result, relative)), momenta))


def _momenta_of_vehicle(result: Sampled, relative: np.ndarray) -> np.ndarray:
    """Momenta of the vehicle's own inertia at the velocities `relative` (k, n, 6)."""
    return np.einsum("nij,knj->kni", *_broadcast(vehicle.inertia6(result.parameters), relative))


def _inner(result: Sampled, relative: np.ndarray) -> list[Inner]:
    """Momenta and energy of masses that move in the vehicle."""
    down, time = result.attitude[..., 2, :].astype(np.float64), result.time
    each = (term.inner(result.own(term), time, relative, down, result.parameters) for term in result.terms)
    return [inner for inner in each if inner is not None]


def _broadcast(matrices: np.ndarray, vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.broadcast_to(matrices, (vectors.shape[1], *matrices.shape[1:])), vectors


def kinetic_energy(result: Sampled) -> np.ndarray:
    """Kinetic energy relative to the water, (nu, Om).I6 (nu, Om) / 2, as (k, n) [J]."""
    relative = _relative(result)
    own = 0.5 * np.sum(relative * _momenta_of_vehicle(result, relative), axis=-1)
    return np.asarray(sum((inner.kinetic for inner in _inner(result, relative)), own))


def energy(result: Sampled) -> np.ndarray:
    """Total energy (k, n) [J]: kinetic energy relative to the water, plus the potential of every term."""
    total = kinetic_energy(result)
    position, attitude = result.position.astype(np.float64), result.attitude.astype(np.float64)
    for term in (*terms.IMPLIED, *result.terms):
        total = total + term.potential(result.own(term), position, attitude, result.parameters)
    return np.asarray(sum((inner.potential for inner in _inner(result, _relative(result))), total))


def linear_momentum(result: Sampled) -> np.ndarray:
    """Linear momentum R p in inertial axes, (k, n, 3) [N s]; conserved without a potential."""
    return _times(result.attitude.astype(np.float64), _momenta(result)[..., :3])


def angular_momentum(result: Sampled) -> np.ndarray:
    """Angular momentum R pi + b x R p about the inertial origin, (k, n, 3) [N m s]; conserved without a potential."""
    spin = _momenta(result)[..., 3:]
    b, P = (np.moveaxis(x, -1, 0) for x in (result.position.astype(np.float64), linear_momentum(result)))
    orbit = np.stack([b[1] * P[2] - b[2] * P[1], b[2] * P[0] - b[0] * P[2], b[0] * P[1] - b[1] * P[0]], axis=-1)
    return _times(result.attitude.astype(np.float64), spin) + orbit


def energy_growth(result: Sampled, *, dissipative: bool = False) -> np.ndarray:
    """Largest change of energy of each member (n,), relative to an energy scale; inf if some energy is not finite.

    The scale is |p|^2 / (2 M_min) + |pi|^2 / (2 J_min) at the start, plus the largest change of the potential up to each
    time. For a bounded motion the result stays below about 1, for any exchange of energy.
    """
    kinetic, total = kinetic_energy(result), result.energy
    potential = total - kinetic
    momenta = _momenta(result)[0]
    I6 = np.broadcast_to(vehicle.inertia6(result.parameters), (result.members, 6, 6))
    held = sum(0.5 * np.sum(momenta[:, half] ** 2, axis=1) / np.linalg.eigvalsh(I6[:, half, half])[:, 0]
               for half in (slice(0, 3), slice(3, 6)))  # fmt: skip
    exchanged = np.maximum.accumulate(np.abs(potential - potential[:1]), axis=0)
    change = total - total[:1]
    growth = np.max((change if dissipative else np.abs(change)) / np.maximum(held + exchanged, 1e-300), axis=0)
    return np.where(np.isfinite(total).all(axis=0), growth, np.inf)


def _present(result: Sampled) -> tuple[Term, ...]:
    """The terms that act on some member of a result."""
    return (*terms.IMPLIED, *(term for term in result.terms if term.present(result.own(term))))


def conserved(result: Sampled) -> frozenset[str]:
    """The quantities of `CONSERVED` that every acting law of a result's scene conserves (`Term.conserves`)."""
    return CONSERVED.intersection(*(term.conserves for term in _present(result)))


def at_work(result: Sampled) -> tuple[str, ...]:
    """The terms that do work: drag, thrust, noise, moving water and the like."""
    return tuple(term.key for term in _present(result) if "energy" not in term.conserves)


def drift(result: Sampled) -> dict[str, float]:
    """Largest change of energy and momenta while members were under way.

    If `conserved` names a quantity, its change is an error of the method. Otherwise it includes the work of forces.

    Args:
        result: Samples with all four fields of the state.

    Returns:
        {name: largest change over times and members} of "energy" [J], "horizontal_momentum" [N s] and
        "vertical_angular_momentum" [N m s]. Failed members are left out; NaN if all failed.
    """
    successful = ~failed(result.status)
    if not successful.any():
        return dict.fromkeys(sorted(CONSERVED), np.nan)
    changes = {
        "energy": result.energy,
        "horizontal_momentum": linear_momentum(result)[..., :2],
        "vertical_angular_momentum": angular_momentum(result)[..., 2],
    }
    counted = under_way(result)[:, successful]
    return {name: float(np.abs(values - values[:1])[:, successful][counted].max()) for name, values in changes.items()}
