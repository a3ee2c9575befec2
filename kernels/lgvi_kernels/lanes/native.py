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
    place = f"{kind}* place = ({kind}*)rows.data + ((wp::int64)entry * rows.shape[1] + row + offset);"
    return f"{kind} r; {place} {statement}"


def copied(width, real):
    """C++ that copies rows of one entry, as the place `source` has them, to those of the place `target`."""
    kind = f"wp::vec_t<{width}, wp::{real.__name__}>"
    begin = f"{kind}* row = ({kind}*)rows.data + (wp::int64)entry * rows.shape[1];"
    return f"{begin} for (wp::int64 i = first; i < last; ++i) row[target + i] = row[source + i];"


def less_products(width, real):
    """C++ of a number less products of rows from `a` and from `b` on: a loop of Warp takes longer than its product."""
    loop = f"for (wp::int64 i = 0; i < count; ++i) {{ V A, B; {_read('A', 'a')} {_read('B', 'b')} T -= A * B; }}"
    begin = f"{head(width, real, '')} V T; memcpy(&T, &total, sizeof(V)); {_rows(width)} {loop}"
    return f"{begin} wp::vec_t<{width}, S> r; memcpy(&r, &T, sizeof(V)); return r;"


def less_rows(width, real):
    """C++ that takes f times rows from `source` on from those from `target` on."""
    change = f"{_read('A', 'target')} {_read('B', 'source')} A -= F * B; memcpy(row + target + i, &A, sizeof(V));"
    loop = f"for (wp::int64 i = 0; i < count; ++i) {{ V A, B; {change} }}"
    return f"{head(width, real, 'F')} {_rows(width)} {loop}"


def _rows(width):
    return f"auto* row = (wp::vec_t<{width}, S>*)rows.data + (wp::int64)entry * rows.shape[1];"


def _read(name, place):
    return f"memcpy(&{name}, row + {place} + i, sizeof(V));"


def shared(width, real):
    """C++ that reads one number of a two-dimensional array into all lanes."""
    place = "((S*)rows.data)[(wp::int64)entry * rows.shape[1] + row + offset]"
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


def gather3(width, real, shared):
    """C++ that reads, for each lane, three rows from that of its own index on, side by side in a vector of three lanes."""
    whole = f"wp::vec_t<{3 * width}, wp::{real.__name__}>"
    kind = f"wp::{real.__name__}" if shared else f"wp::vec_t<{width}, wp::{real.__name__}>"
    begin = f"{whole} r; const auto* from = (({kind}*)rows.data) + ((wp::int64)entry * rows.shape[1] + row);"
    value = "from[index[j] + i]" if shared else "from[index[j] + i][j]"
    if width == 1 or width & (width - 1):
        loops = f"for (int i = 0; i < 3; ++i) for (int j = 0; j < {width}; ++j)"
        return f"{begin} {loops} r[i * {width} + j] = {value}; return r;"
    if shared and width % 4 == 0:
        apart = _nodes(width)
    else:
        lanes = f"V X; for (int j = 0; j < {width}; ++j) X[j] = {value};"
        apart = f"for (int i = 0; i < 3; ++i) {{ {lanes} memcpy(&r.c[i * {width}], &X, sizeof(V)); }}"
    # Vehicles near each other ask for one row: a number for them all, or a lane as it stands.
    copy = "V X = V() + from[index[0] + i];" if shared else "V X; memcpy(&X, &from[index[0] + i], sizeof(V));"
    together = f"for (int i = 0; i < 3; ++i) {{ {copy} memcpy(&r.c[i * {width}], &X, sizeof(V)); }}"
    indices = f"typedef int J __attribute__((vector_size({4 * width}))); J K; memcpy(&K, &index, sizeof(J));"
    choice = f"if (__builtin_reduce_or(K != K[0]) == 0) {{ {together} }} else {{ {apart} }}"
    return f"{head(width, real, '')} {begin} {indices} {choice} return r;"


def _nodes(width):
    """C++ of three rows of each lane by one load of four: the last one, which may lie behind the table, is not used.

    Four lanes at a time are a matrix of 4 x 4, whose first three columns are wanted.
    """
    quads = range(0, width, 4)
    text = "typedef S Q __attribute__((vector_size(4 * sizeof(S))));"
    text += "".join(f" Q q{j}; memcpy(&q{j}, from + index[{j}], sizeof(Q));" for j in range(width))
    for t in range(4):
        text += f" const V T{t} = {_side_by_side([f'q{at + t}' for at in quads], 4)};"
    for name, a, b, first in (("E", 0, 1, 0), ("F", 2, 3, 0), ("G", 0, 1, 1), ("H", 2, 3, 1)):
        order = [i for at in quads for i in (at + first, width + at + first, at + 2 + first, width + at + 2 + first)]
        text += f" const V {name} = {_shuffled(f'T{a}', f'T{b}', order)};"
    for i, (a, b, first) in enumerate((("E", "F", 0), ("G", "H", 0), ("E", "F", 2))):
        order = [i for at in quads for i in (at + first, at + first + 1, width + at + first, width + at + first + 1)]
        text += f" const V R{i} = {_shuffled(a, b, order)}; memcpy(&r.c[{i * width}], &R{i}, sizeof(V));"
    return text


def _shuffled(a, b, order):
    return f"__builtin_shufflevector({a}, {b}, {', '.join(map(str, order))})"


def _side_by_side(names, size):
    """C++ of one vector of the vectors with these names, a power of two of them, each of so many numbers."""
    if len(names) == 1:
        return names[0]
    pairs = [_shuffled(a, b, range(2 * size)) for a, b in zip(names[::2], names[1::2], strict=True)]
    return _side_by_side(pairs, 2 * size)


def third(width, real):
    """C++ of one of three lanes that stand side by side."""
    kind = f"wp::vec_t<{width}, wp::{real.__name__}>"
    return f"{kind} r; memcpy(&r, &a.c[k * {width}], sizeof(r)); return r;"


def whole(width, real, repeats=1, rest=0):
    """C++ of the whole numbers at or below those of a lane; what is no number, or beyond int32, becomes an end of int32.

    repeats: how often they stand one after the other; the lane has `width` numbers, and then others.
    rest: how many of them follow once more: what pads the lane is an index of a row as well.
    """
    floor = "__builtin_floorf" if real == wp.float32 else "__builtin_floor"
    least, beyond = "(S)-2147483648.0", "(S)2147483648.0"
    result = f"wp::vec_t<{width * repeats + rest}, wp::int32> r;"
    last = f" memcpy(&r.c[{width * repeats}], &K, {4 * rest});" if rest else ""
    copies = f"for (int i = 0; i < {repeats}; ++i) memcpy(&r.c[i * {width}], &K, sizeof(K));{last} return r;"
    if width == 1:
        value = f"v >= {least} ? (v < {beyond} ? (int){floor}(v) : 2147483647) : -2147483647 - 1"
        return f"typedef wp::{real.__name__} S; const S v = a[0]; const int K = {value}; {result} {copies}"
    # Numbers that int32 holds are converted; the first beyond them is its last by choice, since float32 does not hold that.
    bounds = f"V F = A >= {least} ? __builtin_elementwise_floor(A) : V() + {least};"
    if real == wp.float32:
        bounds += f" auto M = A >= {beyond}; F = M ? V() : F;"
        convert = "J K = __builtin_convertvector(F, J); K = M ? J() + 2147483647 : K;"
    else:
        bounds += " F = F < (S)2147483647.0 ? F : V() + (S)2147483647.0;"
        convert = "J K = __builtin_convertvector(F, J);"
    return (
        f"{head(width, real, 'A')} typedef int J __attribute__((vector_size({4 * width}))); {bounds} {convert}"
        f" {result} {copies}"
    )


def below(width, real):
    """C++ of floor, lane by lane."""
    floor = "__builtin_floorf" if real == wp.float32 else "__builtin_floor"
    kind = f"wp::vec_t<{width}, wp::{real.__name__}>"
    return f"{kind} r; for (int j = 0; j < {width}; ++j) r[j] = {floor}(a[j]); return r;"


def integers(width, expression):
    """C++ of a sum or product of whole numbers, lane by lane, which wraps around."""
    each = f"const unsigned x = {expression[0]}, y = b[j]; r[j] = (int)(x {expression[1]} y);"
    return f"wp::vec_t<{width}, wp::int32> r; for (int j = 0; j < {width}; ++j) {{ {each} }} return r;"
