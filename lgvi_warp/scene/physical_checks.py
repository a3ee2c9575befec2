# SPDX-License-Identifier: Apache-2.0
"""Checks that the varied numbers of an ensemble's members are physical."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics import notation
from lgvi_warp.physics import vehicle as vehicles
from lgvi_warp.physics.terms.base import own
from lgvi_warp.scene.like import SceneLike
from lgvi_warp.scene.slices import over_members


@dataclass
class Unphysical:
    """Unphysical values of one quantity: the first member, its value, and the count. shared: One value for all members."""

    first: int
    value: Any
    shared: bool
    of: int
    count: int


RIGID, ADDED = "vehicle.rigid_body_mass_matrix", "vehicle.added_mass_matrix"
Numbers = Mapping[str, np.ndarray]
# (numbers, tolerance of the body's inertia) -> mask (n,).
Check = Callable[[Numbers, float], np.ndarray]


def _odd_entry(value: Any) -> tuple[str, Any]:
    """Return the index of the first entry that is not finite, such as "[1,2]", and the entry; else "" and the value."""
    numbers = np.asarray(value)
    if not numbers.ndim or np.isfinite(numbers).all():
        return "", value
    place = tuple(np.argwhere(~np.isfinite(numbers))[0].tolist())
    return f"[{','.join(map(str, place))}]", numbers[place]


@dataclass(frozen=True)
class PhysicalChecks:
    """The checks of an ensemble, which raise SceneError if a member is unphysical and name the first such member.

    Only varied parameters are checked. For drawn parameters, the message says that they are drawn.
    """

    scene: SceneLike
    varied: AbstractSet[str]
    drawn: AbstractSet[str]
    members: int

    def of_members(self, parameters: Callable[[int, int], Mapping[str, np.ndarray]], count: int) -> None:
        """Check the first `count` members in groups that need little memory; parameters(first, stop) gives their numbers."""

        def look(first: int, stop: int) -> dict[str, Unphysical]:
            with np.errstate(over="ignore", invalid="ignore"):
                return self._look_at(first, stop, parameters(first, stop))

        findings: dict[str, Unphysical] = {}
        for block_findings in over_members(look, count if self.varied else 0):
            for key, finding in block_findings.items():
                if key not in findings:
                    findings[key] = finding
                elif not finding.shared:
                    findings[key].count += finding.count
        self._refuse(findings, count)

    def of_block(self, first: int, stop: int, parameters: Mapping[str, np.ndarray]) -> None:
        """Check the members first to stop - 1."""
        self._refuse(self._look_at(first, stop, parameters), stop - first)

    def _refuse(self, findings: Mapping[str, Unphysical], looked_at: int) -> None:
        if not findings:
            return
        faults = Faults()
        all_seen = looked_at == self.members
        for key, finding in findings.items():
            is_drawn = not self.drawn.isdisjoint(key.split(" + "))
            remedy = (
                "use a smaller spread, TruncatedNormal or LogNormal" if is_drawn else "give finite, physical values"
            )
            of = f"{looked_at} members" if all_seen else f"the {looked_at:,} members that were looked at"
            of = f"{finding.of} members" if finding.shared else of
            entry, value = _odd_entry(finding.value)
            problem = f"is unphysical ({finding.count} of {of})"
            faults.add(f"{key}{entry} of member {finding.first}", value, problem, remedy)
        faults.raise_if_any()

    def _look_at(self, first: int, stop: int, p: Mapping[str, np.ndarray]) -> dict[str, Unphysical]:
        keys = {name.rpartition(".")[0] for name in self.varied}
        with np.errstate(over="ignore", invalid="ignore"):
            checks = _vehicle_checks(p, self.varied, self.scene.vehicle.inertia_tolerance)
            for term in self.scene.parts:
                if term.key in keys:
                    checks |= {f"{term.key}.{name}": bad for name, bad in term.unphysical(own(term, p)).items()}
        unphysical = {}
        for key, bad in checks.items():
            bad = np.atleast_1d(bad)
            if np.any(bad):
                names = key.split(" + ")
                i = int(np.argmax(bad))
                value = sum(p[name][i % len(p[name])] for name in names if p[name].ndim == p[names[-1]].ndim)
                shared = len(bad) == 1 and stop - first > 1
                unphysical[key] = Unphysical(first + i, value, shared, len(bad), int(bad.sum()))
        return unphysical


def _vehicle_checks(p: Numbers, varied: AbstractSet[str], tolerance: float) -> dict[str, np.ndarray]:
    """Return {name: mask (n,)} of the members with unphysical varied numbers of vehicle and environment."""
    return {key: check(p, tolerance) for key, check in _checks_of(frozenset(p), frozenset(varied))}


@functools.lru_cache(maxsize=64)
def _checks_of(names: frozenset[str], varied: frozenset[str]) -> tuple[tuple[str, Check], ...]:
    """The checks of varied numbers of vehicle and environment, by name. Cached, since calls with few members repeat."""
    vectors, sizes = ("center_of_buoyancy", "center_of_gravity"), ("buoyancy", "weight")
    checks: dict[str, Check] = {}
    if "vehicle.mass" in names:
        checks["vehicle.mass"] = lambda p, tolerance: ~_heavy(p)
        checks["vehicle.inertia"] = lambda p, tolerance: ~_positive_definite(p["vehicle.inertia"])
        checks["vehicle.mass + vehicle.added_mass"] = _light_with_water
    else:
        checks[RIGID] = _impossible_body
        checks[f"{RIGID} + {ADDED}"] = lambda p, tolerance: ~_positive_definite(p[RIGID] + p[ADDED])
    known = [f"vehicle.{name}" for name in vectors if f"vehicle.{name}" in names]
    checks |= {key: functools.partial(_not_finite, key) for key in known}
    known = [f"vehicle.{name}" for name in sizes if f"vehicle.{name}" in names]
    if "environment.gravity" in names:
        known.append("environment.gravity")
    checks |= {key: functools.partial(_negative, key) for key in known}
    checks["environment.water_density"] = _no_density
    return tuple((key, check) for key, check in checks.items() if not varied.isdisjoint(key.split(" + ")))


def _heavy(p: Numbers) -> np.ndarray:
    return np.asarray(np.isfinite(p["vehicle.mass"]) & (p["vehicle.mass"] >= vehicles.LEAST))


def _light_with_water(p: Numbers, tolerance: float) -> np.ndarray:
    added = notation.only_diagonal(p["vehicle.added_mass"])
    if added is not None:
        return _heavy(p) & ~_positive(p["vehicle.mass"][:, None] + added)
    return _heavy(p) & ~_positive_definite(vehicles.mass_matrix(p))


def _impossible_body(p: Numbers, tolerance: float) -> np.ndarray:
    good = _positive_definite(p[RIGID])
    possible = np.where(good[:, None, None], p[RIGID], np.eye(6))
    return np.asarray(~good | vehicles.impossible(possible, tolerance))


def _negative(key: str, p: Numbers, tolerance: float) -> np.ndarray:
    return np.asarray(~(np.isfinite(p[key]) & (p[key] >= 0.0)))


def _not_finite(key: str, p: Numbers, tolerance: float) -> np.ndarray:
    return np.asarray(~np.isfinite(p[key]).all(axis=1))


def _no_density(p: Numbers, tolerance: float) -> np.ndarray:
    density = p["environment.water_density"]
    return np.asarray(~(np.isfinite(density) & (density > 0)))


def _positive(diagonals: np.ndarray) -> np.ndarray:
    """Mask of the diagonals (n, d) whose entries are positive."""
    # By columns: rows of few numbers take many times as long.
    return functools.reduce(np.logical_and, [(x >= vehicles.LEAST) & np.isfinite(x) for x in diagonals.T])


def _positive_definite(matrices: np.ndarray) -> np.ndarray:
    """Mask of the symmetric matrices (n, d, d) that are positive definite, by elimination; False if not finite."""
    d, diagonals = matrices.shape[-1], np.einsum("nii->ni", matrices)
    if np.count_nonzero(matrices) == np.count_nonzero(diagonals):  # diagonal matrices
        return _positive(diagonals)
    remainder = matrices.copy()
    good = np.isfinite(matrices).all(axis=(1, 2))
    for k in range(d):
        pivot = remainder[:, k, k]
        good &= pivot >= vehicles.LEAST
        row = remainder[:, k, k + 1 :] / np.where(good, pivot, 1.0)[:, None]
        remainder[:, k + 1 :, k + 1 :] -= remainder[:, k + 1 :, k, None] * row[:, None, :]
    return np.asarray(good)
