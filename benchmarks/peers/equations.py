# SPDX-License-Identifier: Apache-2.0
"""The equations of a driven, damped body as lines of text, for Python and for C++: its numbers folded in, zeros left out.

    M6 (nu, Om)' = (p x Om, pi x Om + p x nu) + wrench,   (p, pi) = M6 (nu, Om),   z = R^T e3

Names: u1 u2 u3 for nu, o1 o2 o3 for Om, z1 z2 z3 for z. Both languages have `absolute` and `root`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from benchmarks.peers.body import Body, Fin

VELOCITY = ("u1", "u2", "u3", "o1", "o2", "o3")
FORCE = ("f1", "f2", "f3", "f4", "f5", "f6")
RATE = ("a1", "a2", "a3", "a4", "a5", "a6")
# Entries of an inverse below this part of the largest are round-off.
ROUND_OFF = 1e-14
# Added to the square of a fin's speed [m2/s2], so that a fin at rest has no force rather than 0 / 0; within float32.
LITTLE = 1e-30

Number = Callable[[float], str]


def python_number(x: float) -> str:
    """A number as Python writes it."""
    return f"({float(x)!r})"


class Writer:
    """Lines that assign to names. number: how the language writes a constant."""

    def __init__(self, number: Number):
        self.lines: list[tuple[str, str]] = []
        self.number = number

    def let(self, name: str, expression: str) -> str:
        """Assign."""
        self.lines.append((name, expression))
        return name

    def total(self, coefficients: Iterable[float], names: Iterable[str], *more: str) -> str:
        """The sum of coefficients times names and of other expressions; "" where nothing is left."""
        parts = [self.times(float(c), name) for c, name in zip(coefficients, names, strict=True) if c != 0.0]
        return " + ".join([*(part for part in more if part), *parts])

    def times(self, coefficient: float, name: str) -> str:
        """A product."""
        if coefficient in (1.0, -1.0):
            return name if coefficient > 0.0 else f"(-{name})"
        return f"{self.number(coefficient)} * {name}"


def twist_rates(body: Body, writer: Writer, wrench: Sequence[str] = ()) -> None:
    """a1 to a6, the rates of nu and Om, from u, o and z. wrench: names of six numbers that are added to its own."""
    momenta = [
        writer.let(name, writer.total(row, VELOCITY))
        for name, row in zip(("p1", "p2", "p3", "q1", "q2", "q3"), body.mass_matrix, strict=True)
    ]
    p, pi, u, o = momenta[:3], momenta[3:], VELOCITY[:3], VELOCITY[3:]
    forces = [[one] for one in cross(p, o)] + [[a, b] for a, b in zip(cross(pi, o), cross(p, u), strict=True)]
    constant = [writer.number(x) if x else "" for x in body.wrench]
    fins = (fin(i, one, writer) for i, one in enumerate(body.fins))
    acting = (hydrostatics(body, writer), drag(body, writer), lift(body, writer), *fins, constant, wrench or [""] * 6)
    for found in acting:
        for parts, more in zip(forces, found, strict=True):
            parts.append(more)
    for name, parts in zip(FORCE, forces, strict=True):
        writer.let(name, " + ".join(part for part in parts if part))
    inverse = np.linalg.inv(body.mass_matrix)
    inverse[np.abs(inverse) < ROUND_OFF * np.abs(inverse).max()] = 0.0
    for name, row in zip(RATE, inverse, strict=True):
        writer.let(name, writer.total(row, FORCE))


def cross(a: Sequence[str], b: Sequence[str]) -> list[str]:
    """a x b."""
    return [f"({a[i]} * {b[j]} - {a[j]} * {b[i]})" for i, j in ((1, 2), (2, 0), (0, 1))]


def hydrostatics(body: Body, writer: Writer) -> list[str]:
    """net z, and -moment x z."""
    m1, m2, m3 = body.moment
    turning = ((0.0, m3, -m2), (-m3, 0.0, m1), (m2, -m1, 0.0))
    z = ("z1", "z2", "z3")
    return [writer.total((body.net,), (name,)) for name in z] + [writer.total(row, z) for row in turning]


def drag(body: Body, writer: Writer) -> list[str]:
    """-(linear v + quadratic |v| v)."""
    used = np.any(body.quadratic, axis=0)
    squares = [
        writer.let(f"s{j + 1}", f"absolute({name}) * {name}") if used[j] else "" for j, name in enumerate(VELOCITY)
    ]
    rows = zip(body.linear, body.quadratic, strict=True)
    return [writer.total((*-linear, *-quadratic), (*VELOCITY, *squares)) for linear, quadratic in rows]


def lift(body: Body, writer: Writer) -> list[str]:
    """-u (lift v)."""
    sums = [writer.total(-row, VELOCITY) for row in body.lift]
    return [f"u1 * ({one})" if one else "" for one in sums]


def fin(i: int, first: Fin, writer: Writer) -> list[str]:
    """Lift l (un c - uc n) and drag -d (uc c + un n), with l = lift uc un / V and d = drag V + drag_normal un^2 / V."""
    uc = writer.let(f"c{i}", writer.total(first.chord, VELOCITY))
    un = writer.let(f"n{i}", writer.total(first.normal, VELOCITY))
    V = writer.let(f"v{i}", f"root({uc} * {uc} + {un} * {un} + {writer.number(LITTLE)})")
    part = writer.let(f"e{i}", f"{un} / {V}")
    across = writer.let(f"l{i}", f"{writer.number(first.lift)} * {uc} * {part}")
    against = writer.total((first.drag, first.drag_normal), (V, f"{un} * {part}"))
    along_chord, along_normal = f"{across} * {un}", f"-{across} * {uc}"
    if against:
        against = writer.let(f"d{i}", against)
        along_chord, along_normal = f"{along_chord} - {against} * {uc}", f"{along_normal} - {against} * {un}"
    names = writer.let(f"g{i}", along_chord), writer.let(f"h{i}", along_normal)
    return [writer.total(pair, names) for pair in zip(first.chord, first.normal, strict=True)]


def with_quaternion(body: Body, writer: Writer) -> list[str]:
    """The rates of b, w x y z, nu, Om from these 13 numbers by name."""
    writer.let("t1", "2.0 * (y * u3 - z * u2)")
    writer.let("t2", "2.0 * (z * u1 - x * u3)")
    writer.let("t3", "2.0 * (x * u2 - y * u1)")
    writer.let("z1", "2.0 * (x * z - w * y)")
    writer.let("z2", "2.0 * (y * z + w * x)")
    writer.let("z3", "1.0 - 2.0 * (x * x + y * y)")
    twist_rates(body, writer)
    return [
        "u1 + w * t1 + y * t3 - z * t2",
        "u2 + w * t2 + z * t1 - x * t3",
        "u3 + w * t3 + x * t2 - y * t1",
        "-0.5 * (x * o1 + y * o2 + z * o3)",
        "0.5 * (w * o1 + y * o3 - z * o2)",
        "0.5 * (w * o2 + z * o1 - x * o3)",
        "0.5 * (w * o3 + x * o2 - y * o1)",
        *RATE,
    ]


def with_rows(body: Body, writer: Writer, rows: Sequence[str], wrench: Sequence[str] = ()) -> list[str]:
    """The rates of b, of these rows of R ("xyz" or "xz"), nu, Om; the row y follows where it is left out."""
    for name, value in zip(("y1", "y2", "y3"), cross(("z1", "z2", "z3"), ("x1", "x2", "x3")), strict=True):
        if "y" not in rows:
            writer.let(name, value)
    twist_rates(body, writer, wrench)
    way = [f"{row}1 * u1 + {row}2 * u2 + {row}3 * u3" for row in "xyz"]
    turning = [one for row in rows for one in cross((f"{row}1", f"{row}2", f"{row}3"), VELOCITY[3:])]
    return [*way, *turning, *RATE]


QUATERNION = ("b1", "b2", "b3", "w", "x", "y", "z", *VELOCITY)


def rows_of_names(rows: Sequence[str]) -> tuple[str, ...]:
    """The names of a state with these rows of R."""
    return ("b1", "b2", "b3", *(f"{row}{i}" for row in rows for i in "123"), *VELOCITY)


def python_rates(body: Body, form: str, absolute: Any, root: Any) -> Callable[[Any], tuple[Any, ...]]:
    """The rates as a function of a tuple of numbers. form: "quaternion", or the rows of R, "xyz"."""
    writer = Writer(python_number)
    names, found = (
        (QUATERNION, with_quaternion(body, writer))
        if form == "quaternion"
        else (rows_of_names(form), with_rows(body, writer, form))
    )
    lines = [f"{', '.join(names)} = state", *(f"{name} = {text}" for name, text in writer.lines)]
    text = "\n    ".join(["def rates(state):", *lines, f"return ({', '.join(found)},)"])
    scope: dict[str, Any] = {"absolute": absolute, "root": root}
    exec(text, scope)
    return scope["rates"]
