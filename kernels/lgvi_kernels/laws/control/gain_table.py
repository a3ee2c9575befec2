# SPDX-License-Identifier: Apache-2.0
"""A law whose numbers are tables over what is measured: at each tick they are looked up, and the law goes on with them."""

import linecache
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *


@wp.func
def speed(y: Any, p: Any):
    """The measured speed ahead, through the water."""
    return y.water_velocity.x


@wp.func
def depth(y: Any, p: Any):
    """The measured depth."""
    return y.position.z


@wp.func
def altitude(y: Any, p: Any):
    """The height of the body's origin above the point that the altimeter's beam meets, by the measured attitude."""
    return dot(y.down, p.beam_point + remembered(y, p.range_row) * p.beam)


MEASURED = {"speed": speed, "depth": depth, "altitude": altitude}


def tabled(law, own_params, fields):
    """The device code of a law with tables.

    law: its own device code; own_params: (width, real) -> its struct. fields: (name, kind, over) of each field of that which
    has a table; kind 1 for a lane, 3 for a vector; over: a word of MEASURED.
    """
    sounds = any(over == "altitude" for _, _, over in fields)

    def params(width, real):
        """Params: those of the law; the first row of its part of the table, where each field's rows begin, their pieces."""
        kinds = {name: var.type for name, var in own_params(width, real).vars.items()}
        kinds |= {f"{name}_{word}": wp.int32 for name, _, _ in fields for word in ("row", "pieces")}
        beam = dict.fromkeys(("beam", "beam_point"), lane3(width, real)) | {"range_row": wp.int32} if sounds else {}
        return struct("GainTables", **kinds | beam | {"first": wp.int32})

    # Warp names a struct's fields in the text of a function: so there is a text for each law.
    lines = [
        f"p.{name} = table{kind}(y, p.first + p.{name}_row, p.{name}_pieces, {over}(y, p))"
        for name, kind, over in fields
    ]
    text = "\n    ".join(["def control(w: Any, r: Any, y: Any, p: Any):", *lines, "return law_control(w, r, y, p)\n"])
    scope = {**globals(), "law_control": law.control}
    file = f"<{__name__} {' '.join(name for name, _, _ in fields)}>"
    linecache.cache[file] = len(text), None, text.splitlines(keepends=True), file
    exec(compile(text, file, "exec"), scope)
    return device(__name__, [name for name, _, _ in fields], params=params, control=wp.func(scope["control"]))
