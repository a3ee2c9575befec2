# SPDX-License-Identifier: Apache-2.0
"""Lane arithmetic: one Warp thread advances a packet of W vehicles, side by side in SIMD lanes.

A `Lane` is wp.vec(W): one number of W vehicles. A `Lane3` is a struct of three lanes: one 3-vector of W vehicles.
A module that imports the operators `add`, `sub`, `mul`, `div` from here gets `+ - * /` between them lane by lane
(Warp looks an operator's name up among the module's functions first), so formulas read as they would for one vehicle.

Each operator is one expression of Clang's vector types: it becomes SIMD instructions in every width and every size of
kernel. (An automatic vectoriser misses some kernels, which are then 5 to 14 times slower.) With one lane, as for CUDA, the
same expressions are plain numbers.

Types come from cached functions of (width, real): to Warp, two structs with the same fields are two types.
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes import native, overloads

WIDTHS = (1, 2, 4, 8, 16, 32)
REALS = (wp.float32, wp.float64)


@functools.cache
def lane(width, real):
    """Type of one number of `width` vehicles; all functions of lanes know it from now on."""
    overloads.ask_for(width, real)
    return wp.types.vector(width, real)


@functools.cache
def int_lane(width):
    """Type of one int32 of `width` vehicles."""
    return wp.types.vector(width, wp.int32)


@functools.cache
def struct(name, **fields):
    """A Warp struct from names and types: for structs whose fields depend on what a scene has.

    The same names and types give the same struct, so that a law defined anew (a notebook's cell run twice) fits the kernel
    that Warp keeps for its source.
    """
    return wp.struct(type(name, (), {"__annotations__": fields, "__module__": __name__}))


@functools.cache
def lane3(width, real):
    """Type of one 3-vector of `width` vehicles."""
    return struct("Lane3", **dict.fromkeys("xyz", lane(width, real)))


@functools.cache
def symmetric3(width, real):
    """Type of one symmetric 3x3 matrix of `width` vehicles: diagonal 11, 22, 33 and off-diagonal 23, 31, 12."""
    return struct("Symmetric3", **dict.fromkeys(("diagonal", "off_diagonal"), lane3(width, real)))


@functools.cache
def own_rows(kind):
    """Type of the rows of an array that a law may see: those from `first` to `last`, and the first `common` ones.

    A read of any other row reads the nearest of the law's own; where it has none, 0. A write goes there too, or nowhere.
    kind: what the array holds.
    """
    return struct("OwnRows", rows=wp.array2d(dtype=kind), **dict.fromkeys(("first", "last", "common"), wp.int32))


add = overloads.family("add", "a + b, lane by lane; of whole numbers, it wraps around.")
sub = overloads.family("sub", "a - b.")
neg = overloads.family("neg", "-a.")
mul = overloads.family("mul", "a b, where a may be a number, or a symmetric matrix before a vector.")
div = overloads.family("div", "a / b.")
absolute = overloads.family("absolute", "|a|.")
least = overloads.family("least", "The lesser of a and b; b where one is no number.")
largest = overloads.family("largest", "The larger of a and b; a where one is no number.")
ones = overloads.family(
    "ones", "1 in every lane; `like` only says which type. The zero is ones(x) - ones(x): x - x would keep a NaN."
)
positive = overloads.family(
    "positive", "`b` in the lanes where a > 0, `c` in the others (and where a is not a number)."
)
any_positive = overloads.family("any_positive", "Whether some lane is positive.")
whole = overloads.family(
    "whole",
    "The whole number at or below each, as an index; what is no number, or beyond int32, becomes an end of int32.",
)
below = overloads.family("below", "The whole number at or below each.")
element = overloads.family(
    "element", "rows[entry, row + offset] of an array without gaps: one address serves all (constant) offsets."
)
entry_of = overloads.family(
    "entry_of", "`element`; `like` says which type, since the overload whose lanes share a number cannot know it."
)
set_element = overloads.family("set_element", "rows[entry, row + offset] = value.")
copy_rows = overloads.family("copy_rows", "rows[entry, target + i] = rows[entry, source + i] for i from first to last.")
rows_less_products = overloads.family(
    "rows_less_products", "total less the sum of rows[entry, a + i] rows[entry, b + i] for i below count."
)
rows_less_rows = overloads.family(
    "rows_less_rows", "rows[entry, target + i] -= f rows[entry, source + i] for i below count."
)
gathered = overloads.family("gathered", "The row + offset + index of each lane.")
gathered3 = overloads.family("gathered3", "`gathered` of three rows from row + index on, as a vector.")
thirds = overloads.family(
    "thirds", "`gathered3` as three lanes side by side, of rows that the caller knows to be there."
)
third = overloads.family("third", "The k-th of three lanes side by side.")
pieces_of = overloads.family(
    "pieces_of",
    "How many pieces of a table, each of `each` rows, to read behind `first` and the `head` rows of the first value: as many "
    "as are asked for; of own rows no more than they hold.",
)
vec3 = overloads.family("vec3", "A 3-vector of three lanes.")


@functools.cache
def _declare_integers(width):
    I = int_lane(width)  # noqa: E741

    @overloads.func_native(native.integers(width, ("a[j]", "+")))
    def add(a: I, b: I) -> I: ...

    @overloads.func_native(native.integers(width, ("a[j]", "-")))
    def sub(a: I, b: I) -> I: ...

    @overloads.func_native(native.integers(width, ("a[j]", "*")))
    def mul(a: I, b: I) -> I: ...

    @overloads.func_native(native.integers(width, ("s", "*")))
    def mul(s: wp.int32, b: I) -> I: ...


@overloads.for_each_type
def _declare_numbers(width, real):
    _declare_integers(width)
    R, L, I = real, lane(width, real), int_lane(width)  # noqa: E741
    code = functools.partial(native.code, width, real)

    @overloads.func_native(code("AB", "A + B"))
    def add(a: L, b: L) -> L: ...

    @overloads.func_native(code("AB", "A - B"))
    def sub(a: L, b: L) -> L: ...

    @overloads.func_native(code("A", "-A"))
    def neg(a: L) -> L: ...

    @overloads.func_native(code("AB", "A * B"))
    def mul(a: L, b: L) -> L: ...

    @overloads.func_native(code("A", "s * A"))
    def mul(s: R, a: L) -> L: ...

    @overloads.func_native(code("AB", "A / B"))
    def div(a: L, b: L) -> L: ...

    @overloads.func_native(code("A", "A < (S)0 ? -A : A"))
    def absolute(a: L) -> L: ...

    @overloads.func_native(code("AB", "A < B ? A : B"))
    def least(a: L, b: L) -> L: ...

    @overloads.func_native(code("AB", "A < B ? B : A"))
    def largest(a: L, b: L) -> L: ...

    @overloads.func_native(code("", "V() + (S)1"))
    def ones(like: L) -> L: ...

    @overloads.func_native(code("ABC", "A > (S)0 ? B : C"))
    def positive(a: L, b: L, c: L) -> L: ...

    @overloads.func_native(native.any_positive(width, real))
    def any_positive(a: L) -> bool: ...

    @overloads.func_native(native.whole(width, real))
    def whole(a: L) -> I: ...

    @overloads.func_native(native.below(width, real))
    def below(a: L) -> L: ...


@functools.cache
def _declare_pieces(kind):
    Rows, OwnRows = wp.array2d(dtype=kind), own_rows(kind)

    @overloads.func
    def pieces_of(rows: Rows, first: int, count: int, head: int, each: int):
        return count

    @overloads.func
    def pieces_of(rows: OwnRows, first: int, count: int, head: int, each: int):
        return wp.min(count, (rows.last - wp.clamp(first, rows.first, rows.last) + 1 - head) // each)


def declare_loops(rows_type, L):  # noqa: N803
    """Declare the functions of rows as loops of Warp: for guarded rows, and for lanes whose products have own rules."""

    @overloads.func
    def rows_less_products(rows: rows_type, entry: int, a: int, b: int, count: int, total: L):
        for i in range(count):
            total = total - element(rows, entry, a, i) * element(rows, entry, b, i)
        return total

    @overloads.func
    def rows_less_rows(rows: rows_type, entry: int, target: int, f: L, source: int, count: int):
        for i in range(count):
            value = element(rows, entry, target, i) - f * element(rows, entry, source, i)
            set_element(rows, entry, target, i, value)


@overloads.for_each_type
def _declare_rows(width, real):
    L, I = lane(width, real), int_lane(width)  # noqa: E741
    Rows, Numbers = wp.array2d(dtype=L), wp.array2d(dtype=real)
    OwnLanes, OwnNumbers = own_rows(L), own_rows(real)
    Three = wp.types.vector(3 * width, real)
    read = "memcpy(&r, place, sizeof(r)); return r;"
    write = "memcpy(place, &value, sizeof(r));"
    read_own = native.own(width, real, "memcpy(&r, place, sizeof(r));") + " return r;"

    @overloads.func_native(native.element(width, real, read))
    def element(rows: Rows, entry: int, row: int, offset: int) -> L: ...

    @overloads.func_native(native.element(width, real, read))
    def entry_of(like: L, rows: Rows, entry: int, row: int, offset: int) -> L: ...

    @overloads.func_native(native.shared(width, real))
    def entry_of(like: L, rows: Numbers, entry: int, row: int, offset: int) -> L: ...

    @overloads.func_native(native.copied(width, real))
    def copy_rows(rows: Rows, entry: int, source: int, target: int, first: int, last: int): ...

    @overloads.func_native(native.less_products(width, real))
    def rows_less_products(rows: Rows, entry: int, a: int, b: int, count: int, total: L) -> L: ...

    @overloads.func_native(native.less_rows(width, real))
    def rows_less_rows(rows: Rows, entry: int, target: int, f: L, source: int, count: int): ...

    @overloads.func_native(native.element(width, real, write))
    def set_element(rows: Rows, entry: int, row: int, offset: int, value: L): ...

    @overloads.func_native(read_own)
    def element(rows: OwnLanes, entry: int, row: int, offset: int) -> L: ...

    @overloads.func_native(read_own)
    def entry_of(like: L, rows: OwnLanes, entry: int, row: int, offset: int) -> L: ...

    @overloads.func_native(native.own_shared(width, real))
    def entry_of(like: L, rows: OwnNumbers, entry: int, row: int, offset: int) -> L: ...

    @overloads.func_native(native.own(width, real, write))
    def set_element(rows: OwnLanes, entry: int, row: int, offset: int, value: L): ...

    declare_loops(OwnLanes, L)

    @overloads.func_native(native.gather_any(width, real, False))
    def gathered(like: L, rows: Rows, entry: int, row: int, offset: int, index: I) -> L: ...

    @overloads.func_native(native.gather_any(width, real, True))
    def gathered(like: L, rows: Numbers, entry: int, row: int, offset: int, index: I) -> L: ...

    @overloads.func_native(native.gather3(width, real, False))
    def thirds(rows: Rows, entry: int, row: int, index: I) -> Three: ...

    @overloads.func_native(native.gather3(width, real, True))
    def thirds(rows: Numbers, entry: int, row: int, index: I) -> Three: ...

    @overloads.func_native(native.third(width, real))
    def third(a: Three, k: int) -> L: ...

    @overloads.func_native(native.gather(width, real, False))
    def gathered(like: L, rows: OwnLanes, entry: int, row: int, offset: int, index: I) -> L: ...

    @overloads.func_native(native.gather(width, real, True))
    def gathered(like: L, rows: OwnNumbers, entry: int, row: int, offset: int, index: I) -> L: ...

    _declare_pieces(L)
    _declare_pieces(real)


@overloads.for_each_type
def _declare_vectors(width, real):
    R, L, L3, S3 = real, lane(width, real), lane3(width, real), symmetric3(width, real)

    @overloads.func
    def vec3(x: L, y: L, z: L):
        return L3(x, y, z)

    @overloads.func
    def add(a: L3, b: L3):
        return vec3(a.x + b.x, a.y + b.y, a.z + b.z)

    @overloads.func
    def sub(a: L3, b: L3):
        return vec3(a.x - b.x, a.y - b.y, a.z - b.z)

    @overloads.func
    def neg(a: L3):
        return vec3(neg(a.x), neg(a.y), neg(a.z))

    # For an operator of one operand Warp asks its own functions alone: there the minus before a 3-vector is one of them.
    wp._src.context.builtin_functions["neg"].overloads.append(neg.get_overload([L3], {}))

    @overloads.func
    def mul(a: L3, b: L3):
        return vec3(a.x * b.x, a.y * b.y, a.z * b.z)

    @overloads.func
    def mul(a: L, b: L3):
        return vec3(a * b.x, a * b.y, a * b.z)

    @overloads.func
    def mul(s: R, b: L3):
        return vec3(s * b.x, s * b.y, s * b.z)

    @overloads.func
    def mul(a: S3, b: L3):
        d = a.diagonal
        o = a.off_diagonal
        return vec3(
            d.x * b.x + o.z * b.y + o.y * b.z, o.z * b.x + d.y * b.y + o.x * b.z, o.y * b.x + o.x * b.y + d.z * b.z
        )

    @overloads.func
    def div(a: L3, b: L3):
        return vec3(a.x / b.x, a.y / b.y, a.z / b.z)

    @overloads.func
    def positive(a: L, b: L3, c: L3):
        return vec3(positive(a, b.x, c.x), positive(a, b.y, c.y), positive(a, b.z, c.z))


@overloads.for_each_type
def _declare_nodes(width, real):
    L, I = lane(width, real), int_lane(width)  # noqa: E741
    Rows, Numbers = wp.array2d(dtype=L), wp.array2d(dtype=real)

    @overloads.func
    def gathered3(like: L, rows: Rows, entry: int, row: int, index: I):
        a = thirds(rows, entry, row, index)
        return vec3(third(a, 0), third(a, 1), third(a, 2))

    @overloads.func
    def gathered3(like: L, rows: Numbers, entry: int, row: int, index: I):
        a = thirds(rows, entry, row, index)
        return vec3(third(a, 0), third(a, 1), third(a, 2))

    for kind in (L, real):
        _declare_own_nodes(width, real, kind)


def _declare_own_nodes(width, real, kind):
    L, I, Own = lane(width, real), int_lane(width), own_rows(kind)  # noqa: E741

    @overloads.func
    def gathered3(like: L, rows: Own, entry: int, row: int, index: I):
        x = gathered(like, rows, entry, row, 0, index)
        y = gathered(like, rows, entry, row, 1, index)
        return vec3(x, y, gathered(like, rows, entry, row, 2, index))


@wp.func
def dot(a: Any, b: Any):
    """a.b, lane by lane."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@wp.func
def cross(a: Any, b: Any):
    """a x b, lane by lane."""
    return vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@wp.func
def component_x(v: Any):
    """v.x."""
    return v.x


@wp.func
def component_y(v: Any):
    """v.y."""
    return v.y


@wp.func
def component_z(v: Any):
    """v.z."""
    return v.z
