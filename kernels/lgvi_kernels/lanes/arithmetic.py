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

from lgvi_kernels.lanes import overloads

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


def native_head(width, real, arguments):
    """C++ that declares the vector type V and copies the lanes a, b, c into vectors A, B, C."""
    name = "wp::float32" if real == wp.float32 else "wp::float64"
    size = width * (4 if real == wp.float32 else 8)
    vector = "S V" if width == 1 else f"S V __attribute__((vector_size({size})))"
    loads = "".join(f" V {v}; memcpy(&{v}, &{v.lower()}, sizeof(V));" for v in arguments)
    return f"typedef {name} S; typedef {vector};{loads}"


def native_code(width, real, arguments, expression):
    """C++ of a function of the lanes a, b, c: the expression is written in their vectors A, B, C (and a number s)."""
    # Warp's vec_t is a struct around an array. memcpy is the legal way to read its bytes as a vector; compiled, it is no copy.
    result = f"V R = {expression}; wp::vec_t<{width}, S> r; memcpy(&r, &R, sizeof(V)); return r;"
    return f"{native_head(width, real, arguments)} {result}"


def _native_any_positive(width, real):
    """C++ of: some lane of `a` is positive. The maximum would not do: it may drop a lane beside one that is NaN."""
    if width == 1:
        return "return a[0] > 0;"
    return f"{native_head(width, real, 'A')} return __builtin_reduce_or(A > (S)0) != 0;"


def _native_element(width, real, statement):
    """C++ that reads or writes a lane r at its place in a two-dimensional array."""
    kind = f"wp::vec_t<{width}, wp::{real.__name__}>"
    place = f"{kind}* place = ({kind}*)rows.data + ((wp::int64)(entry * rows.shape[1] + row) + offset);"
    return f"{kind} r; {place} {statement}"


def _native_shared(width, real):
    """C++ that reads one number of a two-dimensional array into all lanes."""
    place = "((S*)rows.data)[(wp::int64)(entry * rows.shape[1] + row) + offset]"
    return f"{native_head(width, real, '')} V R = V() + {place}; wp::vec_t<{width}, S> r; memcpy(&r, &R, sizeof(V)); return r;"


def _native_own(width, real, statement):
    """C++ that reads or writes a lane r at its place among the rows that a law may see; where there is none, nothing."""
    kind = f"wp::vec_t<{width}, wp::{real.__name__}>"
    place = f"{kind}* place = ({kind}*)rows.rows.data + ((wp::int64)entry * rows.rows.shape[1] + at);"
    return f"{kind} r = {kind}(); {_OWN_ROW} if (at <= last) {{ {place} {statement} }}"


def _native_own_shared(width, real):
    """C++ that reads one number, of a row that a law may see, into all lanes."""
    kind = f"wp::vec_t<{width}, wp::{real.__name__}>"
    number = f"((wp::{real.__name__}*)rows.rows.data)[(wp::int64)entry * rows.rows.shape[1] + at]"
    return f"{_OWN_ROW} return at <= last ? {kind}({number}) : {kind}();"


def _native_gather(width, real, shared):
    """C++ that reads, for each lane, the row of its own index among those that a law may see."""
    kind, number = f"wp::vec_t<{width}, wp::{real.__name__}>", f"wp::{real.__name__}"
    value = f"(({number}*)rows.rows.data)[begin + at]" if shared else f"(({kind}*)rows.rows.data)[begin + at][j]"
    each = f"const int step = index[j]; {_OWN_ROW.replace('offset', 'offset + step')} if (at <= last) r[j] = {value};"
    begin = "const wp::int64 begin = (wp::int64)entry * rows.rows.shape[1];"
    return f"{kind} r = {kind}(); {begin} for (int j = 0; j < {width}; ++j) {{ {each} }} return r;"


# C++: the row `at` that a law sees for the one it asks for, and the last one that it may see; there is none if at > last.
_OWN_ROW = (
    "wp::int64 at = (wp::int64)row + offset, last = rows.last; if (at >= 0 && at < rows.common) last = at;"
    " else at = at < rows.first ? rows.first : at > last && last >= rows.first ? last : at;"
)


def _native_whole(width, real):
    """C++ of the whole numbers at or below those of a lane; what is no number, or beyond int32, becomes an end of int32."""
    floor = "__builtin_floorf" if real == wp.float32 else "__builtin_floor"
    value = f"v >= (S)-2147483648.0 ? (v < (S)2147483648.0 ? (int){floor}(v) : 2147483647) : -2147483647 - 1"
    each = f"for (int j = 0; j < {width}; ++j) {{ const S v = a[j]; r[j] = {value}; }}"
    return f"typedef wp::{real.__name__} S; wp::vec_t<{width}, wp::int32> r; {each} return r;"


def _native_below(width, real):
    """C++ of floor, lane by lane."""
    floor = "__builtin_floorf" if real == wp.float32 else "__builtin_floor"
    kind = f"wp::vec_t<{width}, wp::{real.__name__}>"
    return f"{kind} r; for (int j = 0; j < {width}; ++j) r[j] = {floor}(a[j]); return r;"


def _native_integers(width, expression):
    """C++ of a sum or product of whole numbers, lane by lane, which wraps around."""
    each = f"const unsigned x = {expression[0]}, y = b[j]; r[j] = (int)(x {expression[1]} y);"
    return f"wp::vec_t<{width}, wp::int32> r; for (int j = 0; j < {width}; ++j) {{ {each} }} return r;"


@functools.cache
def own_rows(kind):
    """Type of the rows of an array that a law may see: those from `first` to `last`, and the first `common` ones.

    A read of any other row reads the nearest of the law's own; where it has none, 0. A write goes there too, or nowhere.
    kind: what the array holds.
    """
    return struct("OwnRows", rows=wp.array2d(dtype=kind), **dict.fromkeys(("first", "last", "common"), wp.int32))


@overloads.family
def add():
    """a + b, lane by lane; of whole numbers, and below, it wraps around."""
    ...


@overloads.family
def sub():
    """a - b."""
    ...


@overloads.family
def neg():
    """-a."""
    ...


@overloads.family
def mul():
    """a b, where a may be a number, or a symmetric matrix before a vector."""
    ...


@overloads.family
def div():
    """a / b."""
    ...


@overloads.family
def absolute():
    """|a|."""
    ...


@overloads.family
def least():
    """The lesser of a and b; b where one is no number."""
    ...


@overloads.family
def largest():
    """The larger of a and b; a where one is no number."""
    ...


@overloads.family
def ones():
    """1 in every lane; `like` only says which type. The zero is ones(x) - ones(x): x - x would keep a NaN."""
    ...


@overloads.family
def positive():
    """`b` in the lanes where a > 0, `c` in the others (and where a is not a number)."""
    ...


@overloads.family
def any_positive():
    """Whether some lane is positive."""
    ...


@overloads.family
def whole():
    """The whole number at or below each, as an index; what is no number, or beyond int32, becomes an end of int32."""
    ...


@overloads.family
def below():
    """The whole number at or below each."""
    ...


@overloads.family
def element():
    """rows[entry, row + offset] of an array without gaps: one address serves all (constant) offsets."""
    ...


@overloads.family
def entry_of():
    """`element`; `like` says which type, since the overload whose lanes share a number cannot know it."""
    ...


@overloads.family
def set_element():
    """rows[entry, row + offset] = value."""
    ...


@overloads.family
def gathered():
    """The row + offset + index of each lane."""
    ...


@overloads.family
def pieces_of():
    """How many pieces of a table to read: as many as are asked for.

    Of own rows no more than they hold behind `first` and the `head` rows of the first value, of `each` rows.
    """
    ...


@overloads.family
def vec3():
    """A 3-vector of three lanes."""
    ...


@functools.cache
def _declare_integers(width):
    I = int_lane(width)  # noqa: E741

    @overloads.func_native(_native_integers(width, ("a[j]", "+")))
    def add(a: I, b: I) -> I: ...

    @overloads.func_native(_native_integers(width, ("a[j]", "-")))
    def sub(a: I, b: I) -> I: ...

    @overloads.func_native(_native_integers(width, ("a[j]", "*")))
    def mul(a: I, b: I) -> I: ...

    @overloads.func_native(_native_integers(width, ("s", "*")))
    def mul(s: wp.int32, b: I) -> I: ...


@overloads.for_each_type
def _declare_numbers(width, real):
    _declare_integers(width)
    R, L, I = real, lane(width, real), int_lane(width)  # noqa: E741
    native = functools.partial(native_code, width, real)

    @overloads.func_native(native("AB", "A + B"))
    def add(a: L, b: L) -> L: ...

    @overloads.func_native(native("AB", "A - B"))
    def sub(a: L, b: L) -> L: ...

    @overloads.func_native(native("A", "-A"))
    def neg(a: L) -> L: ...

    @overloads.func_native(native("AB", "A * B"))
    def mul(a: L, b: L) -> L: ...

    @overloads.func_native(native("A", "s * A"))
    def mul(s: R, a: L) -> L: ...

    @overloads.func_native(native("AB", "A / B"))
    def div(a: L, b: L) -> L: ...

    @overloads.func_native(native("A", "A < (S)0 ? -A : A"))
    def absolute(a: L) -> L: ...

    @overloads.func_native(native("AB", "A < B ? A : B"))
    def least(a: L, b: L) -> L: ...

    @overloads.func_native(native("AB", "A < B ? B : A"))
    def largest(a: L, b: L) -> L: ...

    @overloads.func_native(native("", "V() + (S)1"))
    def ones(like: L) -> L: ...

    @overloads.func_native(native("ABC", "A > (S)0 ? B : C"))
    def positive(a: L, b: L, c: L) -> L: ...

    @overloads.func_native(_native_any_positive(width, real))
    def any_positive(a: L) -> bool: ...

    @overloads.func_native(_native_whole(width, real))
    def whole(a: L) -> I: ...

    @overloads.func_native(_native_below(width, real))
    def below(a: L) -> L: ...


@overloads.for_each_type
def _declare_rows(width, real):
    L, I = lane(width, real), int_lane(width)  # noqa: E741
    Rows, Numbers = wp.array2d(dtype=L), wp.array2d(dtype=real)
    OwnLanes, OwnNumbers = own_rows(L), own_rows(real)
    read = "memcpy(&r, place, sizeof(r)); return r;"
    write = "memcpy(place, &value, sizeof(r));"
    read_own = _native_own(width, real, "memcpy(&r, place, sizeof(r));") + " return r;"

    @overloads.func_native(_native_element(width, real, read))
    def element(rows: Rows, entry: int, row: int, offset: int) -> L: ...

    @overloads.func_native(_native_element(width, real, read))
    def entry_of(like: L, rows: Rows, entry: int, row: int, offset: int) -> L: ...

    @overloads.func_native(_native_shared(width, real))
    def entry_of(like: L, rows: Numbers, entry: int, row: int, offset: int) -> L: ...

    @overloads.func_native(_native_element(width, real, write))
    def set_element(rows: Rows, entry: int, row: int, offset: int, value: L): ...

    @overloads.func_native(read_own)
    def element(rows: OwnLanes, entry: int, row: int, offset: int) -> L: ...

    @overloads.func_native(read_own)
    def entry_of(like: L, rows: OwnLanes, entry: int, row: int, offset: int) -> L: ...

    @overloads.func_native(_native_own_shared(width, real))
    def entry_of(like: L, rows: OwnNumbers, entry: int, row: int, offset: int) -> L: ...

    @overloads.func_native(_native_own(width, real, write))
    def set_element(rows: OwnLanes, entry: int, row: int, offset: int, value: L): ...

    @overloads.func_native(_native_gather(width, real, False))
    def gathered(like: L, rows: OwnLanes, entry: int, row: int, offset: int, index: I) -> L: ...

    @overloads.func_native(_native_gather(width, real, True))
    def gathered(like: L, rows: OwnNumbers, entry: int, row: int, offset: int, index: I) -> L: ...

    _declare_pieces(L)
    _declare_pieces(real)


@functools.cache
def _declare_pieces(kind):
    Rows, OwnRows = wp.array2d(dtype=kind), own_rows(kind)

    @overloads.func
    def pieces_of(rows: Rows, first: int, count: int, head: int, each: int):
        return count

    @overloads.func
    def pieces_of(rows: OwnRows, first: int, count: int, head: int, each: int):
        return wp.min(count, (rows.last - wp.clamp(first, rows.first, rows.last) + 1 - head) // each)


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
