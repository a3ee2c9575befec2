# SPDX-License-Identifier: Apache-2.0
"""Joint distributions of one or several whole quantities: correlated normals, rotations, physical matrices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults, ragged
from lgvi_warp.physics import inertia, notation
from lgvi_warp.sampling.distributions.basic import Distribution, Spread, floats

# The fraction of a matrix's largest entry that a negative eigenvalue may reach by round-off.
ROUND_OFF = 1e-12
# The size that a negative eigenvalue may reach in a correlation matrix that is written with six digits.
SIX_DIGITS = 1e-5


def normals(u: np.ndarray) -> np.ndarray:
    """Standard normal numbers at given levels in (0, 1), of any shape."""
    from scipy.special import ndtri

    return np.asarray(ndtri(u))


def combined(matrix: np.ndarray, z: np.ndarray) -> np.ndarray:
    """A matrix (d, d) times each row of numbers (n, d).

    The sum is written out, since its order, and so its bits, must not depend on the number of rows.
    """
    total = z[:, :1] * matrix[:, 0]
    for k in range(1, z.shape[1]):
        total = total + z[:, k : k + 1] * matrix[:, k]
    return total


def correlation(covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Standard deviations (d,) and correlation (d, d) of a covariance, with 1 on the diagonal even if a variance is 0.

    The correlation does not depend on units and sizes of the entries, such as metres next to newtons.
    """
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    scale = np.where(std > 0.0, std, 1.0)
    return std, covariance / np.outer(scale, scale) + np.diag(np.where(std > 0.0, 0.0, 1.0))


def root_of_covariance(covariance: np.ndarray) -> np.ndarray:
    """Root L with L L^T = covariance (d, d), positive semidefinite, computed from the correlation."""
    std, C = correlation(covariance)
    return np.asarray(std[:, None] * root(C))


def root(matrix: np.ndarray) -> np.ndarray:
    """Root L with L L^T = matrix (d, d): the Cholesky factor, or the symmetric root if the matrix is singular."""
    try:
        return np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        values, axes = np.linalg.eigh(matrix)
        return np.asarray((axes * np.sqrt(np.maximum(values, 0.0))) @ axes.T)


def covariance_of(faults: Faults, distribution: Any, size: int | None) -> np.ndarray | None:
    """The given covariance, or the one from std and correlation; None after adding a fault."""
    arguments = {name for name in ("covariance", "std", "correlation") if getattr(distribution, name, None) is not None}
    if ("covariance" in arguments) == ("std" in arguments) or arguments == {"covariance", "correlation"}:
        fault = f"{' and '.join(sorted(arguments)) or 'nothing'} given"
        faults.add("covariance", "...", fault, "give covariance, or std (and correlation)")
        return None
    name = "correlation" if "correlation" in arguments else next(iter(arguments))
    matrix = np.asarray(faults.finite(name, getattr(distribution, name)), dtype=np.float64)
    if matrix.dtype == object or np.any(np.isnan(matrix)):
        return None
    square = matrix.ndim == 2 and matrix.shape[0] == matrix.shape[1]
    if name != "std" and not (square and np.allclose(matrix, matrix.T)):
        faults.add(
            name, matrix, "is not a symmetric matrix", "give n x n numbers, the same on both sides of the diagonal"
        )
        return None
    if name != "covariance":
        std = faults.finite("std", distribution.std)
        n = size or (len(matrix) if name == "correlation" else max(1, matrix.size))
        if std is None or std.ndim > 1 or std.size not in (1, n):
            faults.add("std", distribution.std, f"does not fit {n} components", f"give one number or {n}")
            return None
        if np.any(std < 0.0):
            faults.add("std", distribution.std, "is negative", "give a spread from 0")
            return None
        std = np.broadcast_to(std, n)
        if name == "correlation" and np.any(np.abs(np.diag(matrix) - 1.0) > SIX_DIGITS):
            faults.add(name, matrix, "has a diagonal that is not 1", "give 1 on the diagonal, or a covariance")
            return None
        matrix = np.outer(std, std) * (correlation(matrix)[1] if name == "correlation" else np.eye(n))
    matrix = 0.5 * (matrix + matrix.T)
    if np.any(np.diag(matrix) < 0.0):
        fault = "has a negative variance on its diagonal"
        faults.add(name, getattr(distribution, name), fault, "give variances from 0")
        return None
    std, C = correlation(matrix)
    least = -np.inf if np.any(matrix[std == 0.0]) else float(np.linalg.eigvalsh(C)[0])
    if least < -SIX_DIGITS:
        faults.add(name, getattr(distribution, name),
                   f"is not positive semidefinite (eigenvalue {least:.3g} of the correlation)",
                   "give what some numbers can have: no correlation beyond 1, and such that agree")  # fmt: skip
        return None
    return matrix


def components(shapes: Sequence[tuple[int, ...]]) -> int:
    """The number of entries in quantities of these shapes."""
    return sum(int(np.prod(shape)) for shape in shapes)


def split(drawn: np.ndarray, bases: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Split entries (n, d) into their quantities, (n, *shape) each."""
    parts = np.split(drawn, np.cumsum([base.size for base in bases])[:-1], axis=1)
    return [entries.reshape(len(drawn), *base.shape) for entries, base in zip(parts, bases, strict=True)]


@dataclass(frozen=True)
class JointLaw(Distribution):
    """A distribution of whole quantities: `size` uniform numbers determine all of their entries."""

    @property
    def joint(self) -> bool:
        return True

    def size(self, bases: Sequence[np.ndarray]) -> int:
        """The number of uniform numbers for one draw. All joint distributions must define this."""
        raise TypeError(f"{type(self).__name__} is abstract")

    def draw(self, u: np.ndarray, bases: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Draw values (n, *shape) of each quantity from levels (n, size). All joint distributions must define this."""
        raise TypeError(f"{type(self).__name__} is abstract")


@dataclass(frozen=True)
class Levels(JointLaw):
    """Independent uniform numbers in (0, 1) for a term's own draws; all entries of a number form one factor."""

    kind: ClassVar[str] = "levels"

    def size(self, bases: Sequence[np.ndarray]) -> int:
        return components([base.shape for base in bases])

    def draw(self, u: np.ndarray, bases: Sequence[np.ndarray]) -> list[np.ndarray]:
        return split(u, bases)


@dataclass(frozen=True)
class CorrelatedNormal(JointLaw):
    """Joint normal distribution of d entries of one quantity, or of several quantities with the key "a, b" in `vary`.

    d counts the entries on and above the diagonal of a symmetric matrix, or the diagonal entries of a diagonal matrix.

    Args:
        covariance: Covariance (d, d), in the units and order of the entries; it may be singular.
        std: Standard deviation of the entries, one number or (d,); instead of `covariance`.
        correlation: Correlation (d, d), together with `std`; by default the entries are independent.
        mean: Mean of the entries, one number or (d,); by default the scene's values.

    Raises:
        SceneError: If the matrix is not positive semidefinite or the numbers do not fit. The message lists every fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> import numpy as np
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> law = lw.distributions.CorrelatedNormal(std=[1.0, 0.1], correlation=[[1.0, 0.9], [0.9, 1.0]])
        >>> fleet = lw.Ensemble(scene, members=1000, vary={"start.position[2], start.velocity[0]": law})
        >>> members = fleet.select(0, 1000)
        >>> print(f"{np.corrcoef(members.position[:, 2], members.velocity[:, 0])[0, 1]:.2f}")
        0.90
    """

    covariance: Any = None
    std: Spread | None = None
    correlation: Any = None
    mean: Spread | None = None
    kind: ClassVar[str] = "correlated_normal"
    several: ClassVar[bool] = True

    def __post_init__(self) -> None:
        faults = Faults(f"{self.kind}.")
        matrix = covariance_of(faults, self, None)
        if self.mean is not None:
            faults.finite("mean", self.mean)
        faults.raise_if_any()
        assert matrix is not None
        object.__setattr__(self, "_root", root_of_covariance(matrix))

    def fault(self, shapes: Sequence[tuple[int, ...]]) -> tuple[str, str] | None:
        d, rows = components(shapes), len(self._root)  # type: ignore[attr-defined]
        if rows != d and not (rows == 1 and self.covariance is None and self.correlation is None):
            return f"is of {rows} components, {d} are named", f"give {d} x {d} numbers, in the order of the names"
        if self.mean is not None and np.size(self.mean) not in (1, d):
            return f"has {np.size(self.mean)} means for {d} components", f"give {d}, or leave mean out"
        return None

    def size(self, bases: Sequence[np.ndarray]) -> int:
        # One uniform number for each entry.
        return components([base.shape for base in bases])

    def draw(self, u: np.ndarray, bases: Sequence[np.ndarray]) -> list[np.ndarray]:
        # Values mean + L Phi^-1(u), L L^T the covariance.
        L: np.ndarray = self._root  # type: ignore[attr-defined]
        if len(L) != u.shape[1]:
            L = L[0, 0] * np.eye(u.shape[1])
        scene = np.concatenate([np.reshape(base, -1) for base in bases])
        drawn = (scene if self.mean is None else floats(self.mean)) + combined(L, normals(u))
        return split(drawn, bases)


@dataclass(frozen=True)
class AttitudeDistribution(JointLaw):
    """A distribution of attitudes; abstract. The ensemble uses it only for attitudes."""

    def fault(self, shapes: Sequence[tuple[int, ...]]) -> tuple[str, str] | None:
        return None

    def size(self, bases: Sequence[np.ndarray]) -> int:
        # Always 3: one uniform number for each degree of freedom.
        return 3


@dataclass(frozen=True)
class RotationNormal(AttitudeDistribution):
    """Concentrated normal distribution of an attitude, R = R0 exp(hat(v)); for "start.attitude".

    R is the drawn attitude, R0 the scene's attitude. v is a rotation vector in body axes, normal with mean 0. Barfoot &
    Furgale (2014), Associating uncertainty with three-dimensional poses, use this distribution with v in other axes.

    Args:
        std: Standard deviation of v about each body axis, one number or (3,) [rad].
        covariance: Covariance of v, (3, 3) [rad^2]; instead of `std`.

    Raises:
        SceneError: If the numbers do not fit. The message lists every fault.
    """

    std: Spread | None = None
    covariance: Any = None
    kind: ClassVar[str] = "rotation_normal"

    def __post_init__(self) -> None:
        faults = Faults(f"{self.kind}.")
        matrix = covariance_of(faults, self, 3)
        if matrix is not None and matrix.shape != (3, 3):
            faults.add("covariance", self.covariance, "is not 3 x 3", "give 3 x 3 numbers [rad^2], body axes")
        faults.raise_if_any()
        assert matrix is not None
        object.__setattr__(self, "_root", root_of_covariance(matrix))

    def draw(self, u: np.ndarray, bases: Sequence[np.ndarray]) -> list[np.ndarray]:
        # Attitudes R0 exp(hat(L Phi^-1(u))), L L^T the covariance.
        v = combined(self._root, normals(u))  # type: ignore[attr-defined]
        return [bases[0] @ notation.matrix_from_rotation_vector(v)]


@dataclass(frozen=True)
class UniformRotation(AttitudeDistribution):
    """Uniform distribution of "start.attitude" on SO(3) (Haar measure). The scene's attitude has no effect.

    Shoemake (1992), Uniform random rotations, in Graphics Gems III.
    """

    kind: ClassVar[str] = "uniform_rotation"

    def draw(self, u: np.ndarray, bases: Sequence[np.ndarray]) -> list[np.ndarray]:
        # Attitudes of unit quaternions that are uniform on their sphere.
        a, b = np.sqrt(1.0 - u[:, 0]), np.sqrt(u[:, 0])
        s, t = 2.0 * np.pi * u[:, 1], 2.0 * np.pi * u[:, 2]
        q = np.stack([a * np.sin(s), a * np.cos(s), b * np.sin(t), b * np.cos(t)], axis=1)
        return [notation.matrix_from_quaternion(q)]


@dataclass(frozen=True)
class PositiveDefinite(JointLaw):
    """Distribution of a symmetric positive definite (d, d) matrix: A = L T T^T L^T; L L^T is the scene's matrix.

    A is the drawn matrix. T is lower triangular, with exp(sigma z / 2) on the diagonal and off_diagonal z below; each z
    is standard normal. So for a diagonal matrix, the logarithm of each diagonal entry has standard deviation sigma, and
    the entry's median is the scene's value. Zeros of the scene, such as an absent added mass, remain zero. Log-Cholesky
    coordinates: Lin (2019), Riemannian geometry of symmetric positive definite matrices via Cholesky decomposition.

    Args:
        sigma: The number sigma of T, a standard deviation: one number, or one for each row, (d,).
        off_diagonal: Standard deviation of the entries of T below the diagonal; 0 by default.
    """

    sigma: Spread | None = None
    off_diagonal: float | None = None
    kind: ClassVar[str] = "positive_definite"
    widths: ClassVar[tuple[str, ...]] = ("sigma",)

    def _check_more(self, faults: Faults) -> None:
        if self.off_diagonal is not None and _dimensions(self.off_diagonal) > 0:
            faults.add("off_diagonal", self.off_diagonal, "is not one number", "give one number from 0")
        if self.sigma is not None and _dimensions(self.sigma) > 1:
            faults.add("sigma", self.sigma, "is a matrix", "give one number, or one for each axis")

    def fault(self, shapes: Sequence[tuple[int, ...]]) -> tuple[str, str] | None:
        # What prevents it from drawing a matrix of this shape: there must be one sigma, or one for each row.
        d = shapes[0][0]
        if np.asarray(self.sigma).size in (1, d):
            return None
        return f"has {np.asarray(self.sigma).size} sigmas for a {d} x {d} matrix", f"give one number or {d}"

    def unusable(self, base: np.ndarray) -> tuple[str, str] | None:
        """Find the reason why the scene's matrix cannot be the centre of the distribution.

        Args:
            base: The scene's matrix (d, d).

        Returns:
            The fault and its remedy; None if the matrix is positive semidefinite, so that it can be the centre.
        """
        if np.linalg.eigvalsh(base)[0] >= -ROUND_OFF * np.abs(base).max():
            return None
        return "varies a matrix that is not positive in the scene", "give the scene a positive semidefinite matrix"

    def size(self, bases: Sequence[np.ndarray]) -> int:
        # One uniform number for each entry on the diagonal of T, and for those below it where they vary.
        d = len(bases[0])
        return d + (d * (d - 1) // 2 if self.off_diagonal else 0)

    def draw(self, u: np.ndarray, bases: Sequence[np.ndarray]) -> list[np.ndarray]:
        # Matrices L T T^T L^T.
        return [self._around(bases[0], u)]

    def _around(self, base: np.ndarray, u: np.ndarray) -> np.ndarray:
        d = len(base)
        z = normals(u)
        T = np.zeros((len(u), d, d))
        diagonal = np.arange(d)
        with np.errstate(over="ignore", invalid="ignore"):  # the ensemble refuses what is too large
            T[:, diagonal, diagonal] = np.exp(0.5 * floats(self.sigma) * z[:, :d])
            if self.off_diagonal:
                rows, columns = np.tril_indices(d, -1)
                T[:, rows, columns] = self.off_diagonal * z[:, d:]
            A = root(base) @ T
            S = A @ np.swapaxes(A, 1, 2)
        return np.asarray(0.5 * (S + np.swapaxes(S, 1, 2)))


@dataclass(frozen=True)
class PhysicalInertia(PositiveDefinite):
    """Distribution of physically possible inertias J: no principal inertia exceeds the sum of the other two.

    The second moments of mass are S = tr(J) I / 2 - J (I: identity). `PositiveDefinite` draws S; J = tr(S) I - S. A
    mass distribution with inertia J exists if and only if S is positive definite (Wensing, Kim & Slotine 2018, Linear
    matrix inequalities for physically consistent inertial parameter identification). Use it for "vehicle.inertia",
    whose scene value must be physical, or for "vehicle.rigid_body_mass_matrix". For this matrix, S is taken about the
    centre of gravity, which stays fixed.

    Args:
        sigma: Standard deviation of the logarithm of the principal second moments, one number or (3,).
        off_diagonal: Standard deviation of the entries below the diagonal of T (see `PositiveDefinite`); 0 by default.
        mass_sigma: Standard deviation of the logarithm of the mass, only for a 6x6 matrix; 0 by default.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> law = lw.distributions.PhysicalInertia(sigma=0.1, mass_sigma=0.01)
        >>> fleet = lw.Ensemble(scene, members=4, vary={"vehicle.rigid_body_mass_matrix": law})
        >>> fleet.parameters(0, 4)["vehicle.rigid_body_mass_matrix"][:, 0, 0].round(1)
        array([30.6, 30.7, 30.8, 30.7])
    """

    mass_sigma: float | None = None
    kind: ClassVar[str] = "physical_inertia"

    def fault(self, shapes: Sequence[tuple[int, ...]]) -> tuple[str, str] | None:
        # What prevents it from drawing a matrix of this shape; mass_sigma needs a matrix that contains the mass.
        if shapes[0] == (3, 3) and self.mass_sigma is not None:
            return "gives mass_sigma to a matrix without mass", 'vary "vehicle.mass"'
        return super().fault([(3, 3)])

    def unusable(self, base: np.ndarray) -> tuple[str, str] | None:
        # What prevents it from starting at the scene's matrix: the second moments must be positive.
        S = second_moments(_about_center(base)[0])
        if np.linalg.eigvalsh(S)[0] > ROUND_OFF * np.trace(S):
            return None
        return ("varies an inertia that no rigid body has (one principal inertia is not below the sum of the others)",
                "use PositiveDefinite, which keeps it positive")  # fmt: skip

    def size(self, bases: Sequence[np.ndarray]) -> int:
        # The uniform numbers of S, and one for the mass of a 6x6 matrix.
        return 3 + 3 * bool(self.off_diagonal) + (len(bases[0]) == 6)

    def draw(self, u: np.ndarray, bases: Sequence[np.ndarray]) -> list[np.ndarray]:
        # Inertia tr(S) - S; a 6x6 matrix is moved back to the scene's origin, with its mass.
        J, mass, center = _about_center(bases[0])
        moments = 3 + 3 * bool(self.off_diagonal)
        S = self._around(second_moments(J), u[:, :moments])
        drawn = _trace(S) * np.eye(3) - S
        if len(bases[0]) == 3:
            return [drawn]
        with np.errstate(over="ignore"):
            m = mass * np.exp((self.mass_sigma or 0.0) * normals(u[:, moments]))
        H = notation.hat(center)
        C = -m[:, None, None] * H
        return [inertia.joined(m[:, None, None] * np.eye(3), C, drawn + C @ H)]


def _trace(matrices: np.ndarray) -> np.ndarray:
    return (matrices[..., 0, 0] + matrices[..., 1, 1] + matrices[..., 2, 2])[..., None, None]


def second_moments(J: np.ndarray) -> np.ndarray:
    """Second moments of mass (..., 3, 3) [kg m2], S = tr(J) / 2 - J: the integral of r r^T over the mass."""
    return np.asarray(0.5 * _trace(J) * np.eye(3) - J)


def _about_center(base: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """Inertia about the centre of gravity, mass and centre of gravity, from a rigid body's 3x3 or 6x6 matrix."""
    if len(base) == 3:
        return base, 0.0, np.zeros(3)
    mass = float(base[0, 0])
    center = -inertia.vee(base[:3, 3:]) / mass
    H = notation.hat(center)
    return base[3:, 3:] + mass * H @ H, mass, center


def _dimensions(values: Any) -> int:
    """The number of dimensions of a user's values; 2 for lists of different lengths."""
    return 2 if ragged(values) else np.ndim(values)
