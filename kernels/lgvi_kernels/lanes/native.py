# SPDX-License-Identifier: Apache-2.0
"""C++ of the functions of arithmetic.py, for a width and a type."""

import warp as wp

# C++: the row `at` that a law sees for the one it asks for, and the last one that it may see; there is none if at > last.
_OWN_ROW = (
    "wp::int64 at = (wp::int64)row + offset, last = rows.last; if (at >= 0 && at < rows.common) last = at;"
    " else at = at < rows.first ? rows.first : at > last && last >= rows.first ? last : at;"
)


def head(width, real, arguments):
    """C++ that declares the vector type V and copies the lanes a, b, c into vectors A, B, C."""
    name = "wp::float32" if real == wp.float32 else "wp::float64"
    size = width * (4 if real == wp.float32 else 8)
    vector = "S V" if width == 1 else f"S V __attribute__((vector_size({size})))"
    loads = "".join(f" V {v}; memcpy(&{v}, &{v.lower()}, sizeof(V));" for v in arguments)
    return f"typedef {name} S; typedef {vector};{loads}"


def code(width, real, arguments, expression):
    """C++ of a function of the lanes a, b, c: the expression is written in their vectors A, B, C (and a number s)."""
    # Warp's vec_t is a struct around an array. memcpy is the legal way to read its bytes as a vector; compiled, it is no copy.
    result = f"V R = {expression}; wp::vec_t<{width}, S> r; memcpy(&r, &R, sizeof(V)); return r;"
    return f"{head(width, real, arguments)} {result}"


def any_positive(width, real):
    """C++ of: some lane of `a` is positive. The maximum would not do: it may drop a lane beside one that is NaN."""
    if width == 1:
        return "return a[0] > 0;"
    return f"{head(width, real, 'A')} return __builtin_reduce_or(A > (S)0) != 0;"


def element(width, real, statement):
    """C++ that reads or writes a lane r at its place in a two-dimensional array."""
    kind = f"wp::vec_t<{width}, wp::{real.__name__}>"
    place = f"{kind}* place = ({kind}*)rows.data + ((wp::int64)(entry * rows.shape[1] + row) + offset);"
    return f"{kind} r; {place} {statement}"


def shared(width, real):
    """C++ that reads one number of a two-dimensional array into all lanes."""
    place = "((S*)rows.data)[(wp::int64)(entry * rows.shape[1] + row) + offset]"
    return f"{head(width, real, '')} V R = V() + {place}; wp::vec_t<{width}, S> r; memcpy(&r, &R, sizeof(V)); return r;"


def own(width, real, statement):
    """C++ that reads or writes a lane r at its place among the rows that a law may see; where there is none, nothing."""
    kind = f"wp::vec_t<{width}, wp::{real.__name__}>"
    place = f"{kind}* place = ({kind}*)rows.rows.data + ((wp::int64)entry * rows.rows.shape[1] + at);"
    return f"{kind} r = {kind}(); {_OWN_ROW} if (at <= last) {{ {place} {statement} }}"


def own_shared(width, real):
    """C++ that reads one number, of a row that a law may see, into all lanes."""
    kind = f"wp::vec_t<{width}, wp::{real.__name__}>"
    number = f"((wp::{real.__name__}*)rows.rows.data)[(wp::int64)entry * rows.rows.shape[1] + at]"
    return f"{_OWN_ROW} return at <= last ? {kind}({number}) : {kind}();"


def gather(width, real, shared):
    """C++ that reads, for each lane, the row of its own index among those that a law may see."""
    kind, number = f"wp::vec_t<{width}, wp::{real.__name__}>", f"wp::{real.__name__}"
    value = f"(({number}*)rows.rows.data)[begin + at]" if shared else f"(({kind}*)rows.rows.data)[begin + at][j]"
    each = f"const int step = index[j]; {_OWN_ROW.replace('offset', 'offset + step')} if (at <= last) r[j] = {value};"
    begin = "const wp::int64 begin = (wp::int64)entry * rows.rows.shape[1];"
    return f"{kind} r = {kind}(); {begin} for (int j = 0; j < {width}; ++j) {{ {each} }} return r;"


def gather_any(width, real, shared):
    """C++ that reads, for each lane, the row of its own index, which the caller knows to be there."""
    kind, number = f"wp::vec_t<{width}, wp::{real.__name__}>", f"wp::{real.__name__}"
    value = "from[index[j]]" if shared else "from[index[j]][j]"
    place = f"(({number if shared else kind}*)rows.data) + ((wp::int64)entry * rows.shape[1] + row + offset)"
    return f"{kind} r; const auto* from = {place}; for (int j = 0; j < {width}; ++j) r[j] = {value}; return r;"


def whole(width, real):
    """C++ of the whole numbers at or below those of a lane; what is no number, or beyond int32, becomes an end of int32."""
    floor = "__builtin_floorf" if real == wp.float32 else "__builtin_floor"
    value = f"v >= (S)-2147483648.0 ? (v < (S)2147483648.0 ? (int){floor}(v) : 2147483647) : -2147483647 - 1"
    each = f"for (int j = 0; j < {width}; ++j) {{ const S v = a[j]; r[j] = {value}; }}"
    return f"typedef wp::{real.__name__} S; wp::vec_t<{width}, wp::int32> r; {each} return r;"


def below(width, real):
    """C++ of floor, lane by lane."""
    floor = "__builtin_floorf" if real == wp.float32 else "__builtin_floor"
    kind = f"wp::vec_t<{width}, wp::{real.__name__}>"
    return f"{kind} r; for (int j = 0; j < {width}; ++j) r[j] = {floor}(a[j]); return r;"


def integers(width, expression):
    """C++ of a sum or product of whole numbers, lane by lane, which wraps around."""
    each = f"const unsigned x = {expression[0]}, y = b[j]; r[j] = (int)(x {expression[1]} y);"
    return f"wp::vec_t<{width}, wp::int32> r; for (int j = 0; j < {width}; ++j) {{ {each} }} return r;"
