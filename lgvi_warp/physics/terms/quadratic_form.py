# SPDX-License-Identifier: Apache-2.0
"""Forces that are sums of products of two velocities, with named coefficients."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from lgvi_warp.common.arguments import mapping_of, name_set, names_of
from lgvi_warp.common.declared import declared
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.sentences import capital
from lgvi_warp.physics.notation import cross
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number, side_by_side

FORCES, VELOCITIES = "XYZKMN", "uvwpqr"
_NAME = re.compile(r"^([XYZKMN])(?:([uvwpqr])([uvwpqr])|([uvwpqr])\|([uvwpqr]|vw)\||\|([uvwpqr]|vw)\|([uvwpqr]))$")
_REMEDY = "write X_vr, Y_v|r| or Y_|v|r, with X Y Z K M N and u v w p q r; |vw| is (v^2 + w^2)^1/2"


class Product(NamedTuple):
    """A product in force i of a factor and v_k. kind of the factor: "c" v_j, "d" |v_j|, "h" (v^2 + w^2)^1/2 with j = 1."""

    kind: str
    i: int
    j: int
    k: int

    @property
    def name(self) -> str:
        """Name of the coefficient in the usual spelling: X_vr, Y_|v|r, Y_|vw|v."""
        factor = "vw" if self.kind == "h" else VELOCITIES[self.j]
        factor = factor if self.kind == "c" else f"|{factor}|"
        return f"{FORCES[self.i]}_{factor}{VELOCITIES[self.k]}"


def read_product(name: Any) -> Product | None:
    """The product of a coefficient's name; None for any other name."""
    match = _NAME.match(re.sub(r"[\s_{}\\$,()]", "", str(name)))
    if match is None:
        return None
    force, first, second, *bars = match.groups()
    i = FORCES.index(force)
    if first:
        return Product("c", i, VELOCITIES.index(first), VELOCITIES.index(second))
    factor, velocity = (bars[1], bars[0]) if bars[0] else (bars[2], bars[3])
    kind, j = ("h", 1) if factor == "vw" else ("d", VELOCITIES.index(factor))
    return Product(kind, i, j, VELOCITIES.index(velocity))


def _read_products(faults: Faults, key: str, value: Any) -> None:
    """Add faults for invalid names and for products that are given twice."""
    try:
        names = names_of(key, value)
    except SceneError as error:
        faults.add(key, value, str(error), _REMEDY)
        return
    read = [read_product(name) for name in names]
    for name in (name for name, product in zip(names, read, strict=True) if product is None):
        faults.add(key, name, "is not a product of two velocities", _REMEDY)
    twice = [
        product for product, count in Counter(_ordered(product) for product in read if product).items() if count > 1
    ]
    for product in twice:
        faults.add(key, product.name, "is given twice", "keep one of them")


def _ordered(product: Product) -> Product:
    """The same product with its factors in a fixed order, to compare products."""
    return product._replace(j=min(product[2:]), k=max(product[2:])) if product.kind == "c" else product


@dataclass(frozen=True, eq=False, kw_only=True)
class QuadraticForm(Term):
    """A sum of products of two velocities: force_i = sum_jk (c_ijk v_j + d_ijk |v_j|) v_k, with named coefficients.

    i runs over forces and torques, and j and k over velocities and angular velocities, relative to the water and about the
    user's origin. Signs are those of published coefficients: a drag coefficient is negative. Any values are allowed, even if
    the law then accelerates the vehicle.

    Args:
        products: Names of the coefficients, (m,): "X_vr" for v r, "Y_v|r|" for v |r|, "Y_|v|r" for |v| r, and "Z_w|vw|" for
            w (v^2 + w^2)^1/2.
        values: The coefficients, (m,). The unit for forces is [kg/m] with two velocities, [kg] with a velocity and an angular
            velocity, and [kg m] with two angular velocities; for torques it is [kg, kg m, kg m2].

    Methods:
        of: Term from coefficients by name.
        gertler_hagen: Term from the coefficients of the standard equations of submarines.

    Raises:
        SceneError: If a name is unknown or given twice, or a number is invalid (see `Term`).

    Examples:
        >>> import lgvi_warp as lw
        >>> form = lw.terms.QuadraticForm(products=["X_u|u|", "Z_uw", "M_uw"], values=[-2.0, -20.0, 10.0])
        >>> scene = lw.Scene.named("torpedo", start={"velocity": [1.5, 0, 0]}, terms=[form])
        >>> scene.parameters()["quadratic_form.values"].tolist()
        [-2.0, -20.0, 10.0]
    """

    type: ClassVar[str] = "quadratic_form"
    strengths: ClassVar[tuple[str, ...]] = ("values",)
    dissipative: ClassVar[bool] = False
    pattern_device: ClassVar[str] = "quadratic_form_pattern"

    products: Any = declared(_read_products)
    values: Any = number(("k",), "kg/m, kg, kg m, kg m2")

    def __post_init__(self) -> None:
        if isinstance(self.products, list | tuple):
            object.__setattr__(self, "products", tuple(self.products))
        super().__post_init__()

    def check(self, faults: Faults) -> None:
        if not faults and len(self.products) != len(self.values):
            problem = f"has {len(self.values)} numbers for {len(self.products)} products"
            faults.add("values", self.values, problem, "give one for each")

    @classmethod
    def of(cls, coefficients: Mapping[str, float], *, name: str = "") -> QuadraticForm:
        """Build the term from coefficients by name.

        Args:
            coefficients: Values by the names of `products`, in the units of `values`.
            name: Name of the term; by default its type.

        Returns:
            The term.

        Raises:
            SceneError: As the class.

        Examples:
            >>> import lgvi_warp as lw
            >>> lw.terms.QuadraticForm.of({"Y_v|v|": -100.0, "N_uv": -4.0}).products
            ('Y_v|v|', 'N_uv')
        """
        table = mapping_of("coefficients", coefficients, "values by name")
        return cls(products=tuple(table), values=list(table.values()), name=name)

    @classmethod
    def gertler_hagen(
        cls,
        coefficients: Mapping[str, float],
        *,
        rho: float,
        length: float,
        added_mass: Any = None,
        ignore: Iterable[str] = (),
        name: str = "",
    ) -> QuadraticForm:
        """Build the term from the dimensionless coefficients of the standard equations of submarines.

        The names are those of Gertler and Hagen (1967) and Feldman (1979), with or without a prime: "X'uu", "Xvr'", "Z'w" for
        u w, "Z'*" for u^2, "M'|w|" for u |w|. In the cross-flow products v|v|, w|w|, |v|r and |w|q, the modulus is
        (v^2 + w^2)^1/2, as published. The products v|r|, w|q| and ww are read as v |r|, w |q| and w^2, which is exact for a
        motion in one plane.

        Args:
            coefficients: Dimensionless values by name: forces divided by rho U^2 L^2 / 2, moments by rho U^2 L^3 / 2, and
                rates multiplied by L / U, where U is the speed.
            rho: Density of the water [kg/m3].
            length: Reference length L of the dimensionless coefficients [m].
            added_mass: The vehicle's added mass, (6, 6) [kg, kg m, kg m2]. Published coefficients include its effect (X'wq,
                Y'wp, ...), which the vehicle's equations already contain. If the added mass is given, this effect is
                subtracted. By default nothing is subtracted.
            ignore: Names to leave out; by default none.
            name: Name of the term; by default its type.

        Returns:
            The term.

        Raises:
            SceneError: If a name is unknown, belongs to an added mass or a fin, or is given twice; the message lists every
                fault.

        Examples:
            >>> import lgvi_warp as lw
            >>> form = lw.terms.QuadraticForm.gertler_hagen({"Z'w": -0.04, "M'q": -0.01}, rho=1000.0, length=2.0)
            >>> form.products, form.values.tolist()
            (('Z_uw', 'M_uq'), [-80.0, -80.0])
        """
        faults, skipped = Faults(), name_set("ignore", ignore)
        density, L = faults.positive("rho", rho, "kg/m3"), faults.positive("length", length, "m")
        matrix = None if added_mass is None else faults.symmetric("added_mass", added_mass, "kg, kg m, kg m2", 6)
        sums: dict[Product, float] = {}
        for key, value in mapping_of("coefficients", coefficients, "values by name").items():
            if key in skipped:
                continue
            product, value = _standard_product(faults, key, value), faults.number(str(key), value)
            if product is None or value is None or density is None or L is None:
                continue
            if product in sums:
                faults.add(key, value, "is given twice", "keep one of them")
            rates = (product.kind != "h" and product.j > 2) + (product.k > 2)
            sums[product] = 0.5 * density * L ** (2 + (product.i > 2) + rates) * value
        faults.raise_if_any()
        for product, value in _of_added_mass(matrix):
            sums[product] = sums.get(product, 0.0) - value
        return cls(products=tuple(product.name for product in sums), values=list(sums.values()), name=name)

    def to_dict(self) -> dict[str, Any]:
        return super().to_dict() | {"products": list(self.products)}

    @property
    def forms(self) -> tuple[Product, ...]:
        """The products, one for each value."""
        return tuple(product for name in self.products if (product := read_product(name)) is not None)

    def entries(self, numbers: Numbers) -> tuple[str, ...]:
        # Of those that are not zero in all members.
        acting = np.any(numbers["values"], axis=0).tolist()
        return tuple(word for word, acts in zip(self._words, acting, strict=True) if acts)

    @property
    def _words(self) -> tuple[str, ...]:
        """A word of the device code for each product: kind, indices, and index of its value."""
        return tuple(f"{p.kind}{p.i}{p.j}{p.k}at{row}" for row, p in enumerate(self.forms))

    def device_in(self, aligned: bool) -> str:
        # Finds the user's velocities, in any axes.
        return f"quadratic_form:{','.join(self._words)}"

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # What gives the user's velocities from those at the origin of the forces, then the values.
        X = context.frame.from_forces
        return Packed({}, side_by_side(X.reshape(len(X), 36), numbers["values"]))

    def braking(self, numbers: Numbers, speeds: np.ndarray, water_density: np.ndarray) -> np.ndarray:
        # Minus the derivative by each factor, as if the vehicle went ahead; the size where a factor's sign is not known.
        values = numbers["values"]
        matrix = np.zeros((max(len(values), len(speeds)), 6, 6))
        for value, (kind, i, j, k) in zip(values.T, self.forms, strict=True):
            size = np.hypot(speeds[:, 1], speeds[:, 2]) if kind == "h" else speeds[:, j]
            known = kind != "c" or j == 0
            matrix[:, i, k] += -value * size if known else np.abs(value) * size
            for factor in (1, 2) if kind == "h" else (j,):
                same = factor == k and known
                matrix[:, i, factor] += (-value if same else np.abs(value)) * speeds[:, k]
        return matrix


def drives(forms: Iterable[Product]) -> dict[str, list[int]]:
    """{text: indices} of products that accelerate the vehicle along its own motion if the sum of their values is above 0.

    For the forward velocity u the product is u^2; for another velocity v it is v|v|, or u v. Drag and damping have
    negative values here.
    """
    places: dict[str, list[int]] = {}
    for place, (kind, i, j, k) in enumerate(forms):
        own = VELOCITIES[i]
        if kind == "h":
            along = f"{own}|{own}|" if i == k and i in (1, 2) else ""
        elif i == j == k:
            along = "u|u|" if i == 0 else f"{own}|{own}|" if kind == "d" else ""
        else:
            beside = (i == k and j == 0) or (kind == "c" and i == j and k == 0)
            along = f"u {own}" if beside else ""
        if along:
            places.setdefault(f"{FORCES[i]} of {along}", []).append(place)
    return places


# The standard equations of submarines -------------------------------------------------------------------------------

_FIN = re.compile(r"(delta|\u03b4|d[sbreapn])", re.IGNORECASE)
_DOT = re.compile(r"(dot|\u0307)", re.IGNORECASE)
# As printed, with the speed across the hull for the modulus.
_ACROSS = {"v|v|": "|vw|v", "w|w|": "|vw|w", "|v|r": "|vw|r", "|w|q": "|vw|q"}


def _standard_product(faults: Faults, key: Any, value: Any) -> Product | None:
    """The product of a standard coefficient; None after a fault."""
    text = re.sub(r"['\u2032\s_{}\\$,()]|prime", "", str(key))
    force, tail = text[:1], text[1:]
    if _DOT.search(tail):
        remedy = "give it in the vehicle's added_mass_matrix, and leave it out here (ignore=)"
        faults.add(str(key), value, "is an added mass", remedy)
        return None
    if _FIN.search(tail):
        remedy = "give the fins as a term control_fins, and leave it out here (ignore=)"
        faults.add(str(key), value, "is the force of a control surface", remedy)
        return None
    tail = _ACROSS.get(tail, tail)
    if tail == "*":
        tail = "uu"
    elif len(tail) == 1 or (len(tail) == 3 and tail[0] == tail[2] == "|"):
        tail = f"u{tail}" if tail != "u" else ""
    product = read_product(force + tail)
    if product is None:
        remedy = f"write X'uu, Z'w (of u w), M'* (of u^2), M'|w|, Y'v|r| or the like. {capital(_REMEDY)}"
        faults.add(str(key), value, "is not a coefficient of a product of two velocities", remedy)
    return product


def _of_added_mass(A: np.ndarray | None) -> Iterable[tuple[Product, float]]:
    """The products of Kirchhoff's equations with their values: the wrench due to added mass A (6, 6) at steady velocities."""
    if A is None:
        return

    def force(v: np.ndarray) -> np.ndarray:
        p, pi = np.split(A @ v, 2)
        return np.concatenate([-cross(v[3:], p), -cross(v[3:], pi) - cross(v[:3], p)])

    E = np.eye(6)
    for j in range(6):
        for k in range(j, 6):
            pair = force(E[j]) if j == k else force(E[j] + E[k]) - force(E[j]) - force(E[k])
            yield from ((Product("c", i, j, k), float(pair[i])) for i in np.flatnonzero(pair).tolist())
