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

WIDTHS = (1, 2, 4, 8, 16, 32)
REALS = (wp.float32, wp.float64)


@functools.cache
def lane(width, real):
    """Type of one number of `width` vehicles."""
    return wp.types.vector(width, real)


@functools.cache
def int_lane(width):
    """Type of one int32 of `width` vehicles."""
    return wp.types.vector(width, wp.int32)


@functools.cache
def lane3(width, real):
    """Type of one 3-vector of `width` vehicles."""
    Lane = lane(width, real)

    @wp.struct
    class Lane3:
        x: Lane
        y: Lane
        z: Lane

    return Lane3


@functools.cache
def symmetric3(width, real):
    """Type of one symmetric 3x3 matrix of `width` vehicles: diagonal 11, 22, 33 and off-diagonal 23, 31, 12."""
    Lane3 = lane3(width, real)

    @wp.struct
    class Symmetric3:
        diagonal: Lane3
        off_diagonal: Lane3

    return Symmetric3


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


def _vec3_maker(width, real):
    """The constructor of one type of Lane3."""
    # An overload cannot name its type by itself: its body is compiled after the loop below, when _L3 is the last type.
    Lane, Lane3 = lane(width, real), lane3(width, real)

    @wp.func
    def make(x: Lane, y: Lane, z: Lane):
        return Lane3(x, y, z)

    return make


_LANES3 = [lane3(_width, _real) for _width in WIDTHS for _real in REALS]


@functools.cache
def own_rows(kind):
    """Type of the rows of an array that a law may see: those from `first` to `last`, and the first `common` ones.

    A read of any other row reads the nearest of the law's own; where it has none, 0. A write goes there too, or nowhere.
    kind: what the array holds.
    """
    rows = {"rows": wp.array2d(dtype=kind), **dict.fromkeys(("first", "last", "common"), wp.int32)}
    return wp.struct(type("OwnRows", (), {"__annotations__": rows, "__module__": __name__}))


# Definitions of one name at module level become overloads of one Warp function; inside a factory they would not.
for _width in WIDTHS:
    _I = int_lane(_width)

    @wp.func_native(_native_integers(_width, ("a[j]", "+")))
    def add(a: _I, b: _I) -> _I: ...

    @wp.func_native(_native_integers(_width, ("a[j]", "-")))
    def sub(a: _I, b: _I) -> _I: ...

    @wp.func_native(_native_integers(_width, ("a[j]", "*")))
    def mul(a: _I, b: _I) -> _I: ...

    @wp.func_native(_native_integers(_width, ("s", "*")))
    def mul(s: wp.int32, b: _I) -> _I: ...


for _real in REALS:
    for _width in WIDTHS:
        _R, _L, _L3, _S3 = _real, lane(_width, _real), lane3(_width, _real), symmetric3(_width, _real)
        _I, _OwnLanes, _OwnNumbers = int_lane(_width), own_rows(_L), own_rows(_R)
        _make = _vec3_maker(_width, _real)
        _native_here = functools.partial(native_code, _width, _real)

        @wp.func_native(_native_here("AB", "A + B"))
        def add(a: _L, b: _L) -> _L: ...

        @wp.func_native(_native_here("AB", "A - B"))
        def sub(a: _L, b: _L) -> _L: ...

        @wp.func_native(_native_here("A", "-A"))
        def neg(a: _L) -> _L: ...

        @wp.func_native(_native_here("AB", "A * B"))
        def mul(a: _L, b: _L) -> _L: ...

        @wp.func_native(_native_here("A", "s * A"))
        def mul(s: _R, a: _L) -> _L: ...

        @wp.func_native(_native_here("AB", "A / B"))
        def div(a: _L, b: _L) -> _L: ...

        @wp.func_native(_native_here("A", "A < (S)0 ? -A : A"))
        def absolute(a: _L) -> _L: ...

        @wp.func_native(_native_here("AB", "A < B ? A : B"))
        def least(a: _L, b: _L) -> _L: ...

        @wp.func_native(_native_here("AB", "A < B ? B : A"))
        def largest(a: _L, b: _L) -> _L: ...

        @wp.func_native(_native_here("", "V() + (S)1"))
        def ones(like: _L) -> _L:
            """1 in every lane; `like` only says which type. The zero is ones(x) - ones(x): x - x would keep a NaN."""
            ...

        @wp.func_native(_native_here("ABC", "A > (S)0 ? B : C"))
        def positive(a: _L, b: _L, c: _L) -> _L:
            """`b` in the lanes where a > 0, `c` in the others (and where a is not a number)."""
            ...

        @wp.func_native(_native_any_positive(_width, _real))
        def any_positive(a: _L) -> bool:
            """Whether some lane is positive."""
            ...

        @wp.func_native(_native_element(_width, _real, "memcpy(&r, place, sizeof(r)); return r;"))
        def element(rows: wp.array2d(dtype=_L), entry: int, row: int, offset: int) -> _L:
            """rows[entry, row + offset] of an array without gaps: one address serves all (constant) offsets."""
            ...

        @wp.func_native(_native_element(_width, _real, "memcpy(&r, place, sizeof(r)); return r;"))
        def entry_of(like: _L, rows: wp.array2d(dtype=_L), entry: int, row: int, offset: int) -> _L:
            """`element`; `like` says which type, since the other overload, whose lanes share a number, cannot know it."""
            ...

        @wp.func_native(_native_shared(_width, _real))
        def entry_of(like: _L, rows: wp.array2d(dtype=_R), entry: int, row: int, offset: int) -> _L: ...

        @wp.func_native(_native_element(_width, _real, "memcpy(place, &value, sizeof(r));"))
        def set_element(rows: wp.array2d(dtype=_L), entry: int, row: int, offset: int, value: _L):
            """rows[entry, row + offset] = value."""
            ...

        @wp.func_native(_native_own(_width, _real, "memcpy(&r, place, sizeof(r));") + " return r;")
        def element(rows: _OwnLanes, entry: int, row: int, offset: int) -> _L: ...

        @wp.func_native(_native_own(_width, _real, "memcpy(&r, place, sizeof(r));") + " return r;")
        def entry_of(like: _L, rows: _OwnLanes, entry: int, row: int, offset: int) -> _L: ...

        @wp.func_native(_native_own_shared(_width, _real))
        def entry_of(like: _L, rows: _OwnNumbers, entry: int, row: int, offset: int) -> _L: ...

        @wp.func_native(_native_own(_width, _real, "memcpy(place, &value, sizeof(r));"))
        def set_element(rows: _OwnLanes, entry: int, row: int, offset: int, value: _L): ...

        @wp.func_native(_native_gather(_width, _real, False))
        def gathered(like: _L, rows: _OwnLanes, entry: int, row: int, offset: int, index: _I) -> _L:
            """The row + offset + index of each lane."""
            ...

        @wp.func_native(_native_gather(_width, _real, True))
        def gathered(like: _L, rows: _OwnNumbers, entry: int, row: int, offset: int, index: _I) -> _L: ...

        @wp.func
        def pieces_of(rows: wp.array2d(dtype=_L), first: int, count: int, head: int, each: int):
            """How many pieces of a table to read: as many as are asked for."""
            return count

        @wp.func
        def pieces_of(rows: _OwnLanes, first: int, count: int, head: int, each: int):
            """No more than the law's own rows hold behind `first` and the `head` rows of the first value, of `each` rows."""
            return wp.min(count, (rows.last - wp.clamp(first, rows.first, rows.last) + 1 - head) // each)

        @wp.func_native(_native_whole(_width, _real))
        def whole(a: _L) -> _I:
            """The whole number at or below each, as an index; what is no number, or beyond int32, becomes an end of int32."""
            ...

        @wp.func_native(_native_below(_width, _real))
        def below(a: _L) -> _L:
            """The whole number at or below each."""
            ...

        @wp.func
        def vec3(x: _L, y: _L, z: _L):
            return wp.static(_make)(x, y, z)

        @wp.func
        def add(a: _L3, b: _L3):
            return vec3(a.x + b.x, a.y + b.y, a.z + b.z)

        @wp.func
        def sub(a: _L3, b: _L3):
            return vec3(a.x - b.x, a.y - b.y, a.z - b.z)

        @wp.func
        def neg(a: _L3):
            return vec3(neg(a.x), neg(a.y), neg(a.z))

        @wp.func
        def mul(a: _L3, b: _L3):
            return vec3(a.x * b.x, a.y * b.y, a.z * b.z)

        @wp.func
        def mul(a: _L, b: _L3):
            return vec3(a * b.x, a * b.y, a * b.z)

        @wp.func
        def mul(s: _R, b: _L3):
            return vec3(s * b.x, s * b.y, s * b.z)

        @wp.func
        def mul(a: _S3, b: _L3):
            d = a.diagonal
            o = a.off_diagonal
            return vec3(
                d.x * b.x + o.z * b.y + o.y * b.z, o.z * b.x + d.y * b.y + o.x * b.z, o.y * b.x + o.x * b.y + d.z * b.z
            )

        @wp.func
        def div(a: _L3, b: _L3):
            return vec3(a.x / b.x, a.y / b.y, a.z / b.z)

        @wp.func
        def positive(a: _L, b: _L3, c: _L3):
            return vec3(positive(a, b.x, c.x), positive(a, b.y, c.y), positive(a, b.z, c.z))


# For an operator of one operand Warp asks its own functions alone: there the minus before a 3-vector is one of them.
wp._src.context.builtin_functions["neg"].overloads += [
    f for f in neg.user_overloads.values() if f.input_types["a"] in _LANES3
]
for _real in REALS:
    _OwnNumbers = own_rows(_real)

    @wp.func
    def pieces_of(rows: wp.array2d(dtype=_real), first: int, count: int, head: int, each: int):
        return count

    @wp.func
    def pieces_of(rows: _OwnNumbers, first: int, count: int, head: int, each: int):
        return wp.min(count, (rows.last - wp.clamp(first, rows.first, rows.last) + 1 - head) // each)


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
