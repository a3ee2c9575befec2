# SPDX-License-Identifier: Apache-2.0
"""The functions of `lw.notation`: those of notation.py, with conversion and checks of the arguments."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.physics import notation

Function = TypeVar("Function", bound=Callable[..., Any])
VECTOR, MATRIX, QUATERNION = (3,), (3, 3), (4,)


def _checked(function: Function, rows: bool = False, **shapes: tuple[int, ...]) -> Function:
    """Wrap a function with checks of its arrays' last dimensions; rows: Whether there is one dimension before these."""
    signature = inspect.signature(function)

    @functools.wraps(function)
    def call(*args: Any, **settings: Any) -> Any:
        bound, faults, leading = signature.bind(*args, **settings), Faults(), []
        for name, value in bound.arguments.items():
            if name not in shapes:
                bound.arguments[name] = faults.number(name, value, "1", 0.0)
                continue
            shape, array = shapes[name], _array(faults, name, value)
            before = array.ndim - len(shape)
            if not faults and (array.shape[before:] != shape or before < 0 or (rows and before != 1)):
                wanted = ", ".join(["n" if rows else "...", *map(str, shape)])
                faults.add(name, array, f"has shape {array.shape}", f"give an array of shape ({wanted})")
            elif rows and not np.isfinite(array).all():
                faults.add(name, array, "is not finite", "give finite numbers")
            leading.append(array.shape[: max(before, 0)])
            bound.arguments[name] = array
        faults.raise_if_any()
        try:
            np.broadcast_shapes(*leading)
        except ValueError:
            text = f"have the leading dimensions {', '.join(map(str, leading))}, which do not fit"
            raise refusal(" and ".join(shapes), "...", text, "give as many of each, or one") from None
        return function(*bound.args, **bound.kwargs)

    call.__module__ = __name__  # where a copy by pickle finds it
    return call  # type: ignore[return-value]


def _array(faults: Faults, name: str, value: Any) -> np.ndarray:
    """An array of real numbers; an array of floats is returned unchanged."""
    if type(value) is np.ndarray and value.dtype.kind == "f":
        return value
    read = faults.real(name, value)
    return np.zeros(0) if read is None else read


@functools.wraps(notation.repeated)
def repeated(*arrays: np.ndarray) -> list[np.ndarray]:
    """Check arrays, and repeat single rows, so that all arrays have the same number of rows."""
    faults = Faults()
    read = [_array(faults, f"arrays[{i}]", value) for i, value in enumerate(arrays)]
    most = max((len(array) for array in read if array.ndim), default=0)
    for i, array in enumerate(read):
        if not faults and (not array.ndim or len(array) not in (1, most)):
            faults.add(f"arrays[{i}]", array, f"has shape {array.shape}", f"give 1 row, or {most} as others have")
    if not arrays:
        faults.add("arrays", arrays, "is empty", "give one or more")
    faults.raise_if_any()
    return notation.repeated(*read)


repeated.__doc__, repeated.__module__ = notation.repeated.__doc__, __name__


hat = _checked(notation.hat, a=VECTOR)
cross = _checked(notation.cross, a=VECTOR, b=VECTOR)
to_momenta = _checked(notation.to_momenta, M=MATRIX, J=MATRIX, nu=VECTOR, Om=VECTOR)
principal_axes = _checked(notation.principal_axes, rows=True, J=MATRIX)
off_diagonal = _checked(notation.off_diagonal, matrices=MATRIX)
rotations = _checked(notation.rotations, R=MATRIX)
rotate_into = _checked(notation.rotate_into, Q=MATRIX, vectors=VECTOR)
rotate_out = _checked(notation.rotate_out, Q=MATRIX, vectors=VECTOR)
matrix_from_rotation_vector = _checked(notation.matrix_from_rotation_vector, f=VECTOR)
matrix_from_quaternion = _checked(notation.matrix_from_quaternion, q=QUATERNION)
quaternion_from_matrix = _checked(notation.quaternion_from_matrix, R=MATRIX)
matrix_from_euler_deg = _checked(notation.matrix_from_euler_deg, angles=VECTOR)
