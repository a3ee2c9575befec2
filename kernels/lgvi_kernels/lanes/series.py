# SPDX-License-Identifier: Apache-2.0
"""C++ of the elementary functions and the normal random numbers of functions.py, for a width and a type.

No function calls the C library, which would go lane by lane: arguments are reduced and series summed in Clang's vector
types. The series are Taylor's, with as many terms as the reduced argument needs: one or two more than a minimax
polynomial of the same accuracy, and no coefficient to look up. "eps" is the spacing of numbers at 1: 2.2e-16 (float64)
or 1.2e-7 (float32).
"""

import functools

import warp as wp

from lgvi_kernels.lanes.native import head

# digits          after the leading one;  bias: the exponent of 1.0
# rounder         1.5 * 2^digits: a number added to it is rounded, and the last bits are that integer
# rounder_bits    the same, and root_half_bits the square root of 1/2, read as integers
# inverse_root    an integer: less half the bits of a number it has about the bits of one over its root (Lomont 2003)
# half_pi, ln2    cut into parts so short that the products with the integers that occur are exact (Cody & Waite 1980)
# extent          the arguments beyond which e^a is surely 0 or inf
# single          the arguments for which 2^N is a normal number and, below which, 1 - e^a is 1
# exponential, sine, logarithm, arctangent: how many terms of the series are needed
FORMATS = {
    wp.float64: {
        "digits": 52,
        "bias": 1023,
        "rounder": 1.5 * 2.0**52,
        "rounder_bits": 0x4338000000000000,
        "root_half_bits": 0x3FE6A09E667F3BCD,
        "inverse_root": 0x5FE6EC85E7DE30DA,
        "half_pi": (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21),
        "ln2": (0.6931471805592082, 7.371002565167799e-13),
        "extent": (-746.0, 710.0),
        "single": (-60.0, 700.0),
        "exponential": 13,
        "sine": 7,
        "logarithm": 10,
        "arctangent": 20,
    },
    wp.float32: {
        "digits": 23,
        "bias": 127,
        "rounder": 1.5 * 2.0**23,
        "rounder_bits": 0x4B400000,
        "root_half_bits": 0x3F3504F3,
        "inverse_root": 0x5F375A86,
        "half_pi": (1.5703125, 0.0004825592041015625, 1.2665987014770508e-06, 9.920935184482005e-10),
        "ln2": (0.693115234375, 3.194618329871446e-05),
        "extent": (-105.0, 89.0),
        "single": (-30.0, 87.0),
        "exponential": 7,
        "sine": 4,
        "logarithm": 5,
        "arctangent": 9,
    },
}


PI = 3.141592653589793
LN2 = 0.6931471805599453


def _factorial(n):
    return functools.reduce(lambda product, k: product * k, range(1, n + 1), 1)


def _horner(x, coefficients):
    """C++ of a polynomial in the variable (or expression) x."""
    *others, text = [f"(S){c!r}" for c in coefficients]
    for c in reversed(others):
        text = f"({c} + {x} * {text})"
    return text


def _series(x, coefficients):
    """C++ of a polynomial, even and odd powers apart: two chains of operations, neither waiting for the other."""
    square = f"({x} * {x})"
    return f"({_horner(square, coefficients[::2])} + {x} * {_horner(square, coefficients[1::2])})"


def _less(x, n, parts):
    """C++ of x - n (parts[0] + parts[1] + ...), the large parts first."""
    return " - ".join([x, *(f"{n} * (S){part!r}" for part in parts)])


def _vector(width, name, type_name, size):
    """C++ that names a vector of `width` numbers of a type of `size` bytes."""
    attribute = "" if width == 1 else f" __attribute__((vector_size({width * size})))"
    return f"typedef {type_name} {name}{attribute};"


def _converted(width, vector, name):
    """C++ of a vector's numbers in another type."""
    return f"({name})({vector})" if width == 1 else f"__builtin_convertvector({vector}, {name})"


def _types(width, real, arguments):
    """C++ of head, and of vectors of integers of the numbers' size: I with sign, U without."""
    bits = 64 if real == wp.float64 else 32
    signed, unsigned = (
        _vector(width, *kind, bits // 8) for kind in (("I", f"wp::int{bits}"), ("U", f"wp::uint{bits}"))
    )
    return f"{head(width, real, arguments)} {signed} {unsigned}"


def function(width, real, arguments, statements, result="R"):
    """C++ of a function of the lanes a, b, c whose statements leave the result in a vector."""
    finish = f"wp::vec_t<{width}, S> r; memcpy(&r, &{result}, sizeof(V)); return r;"
    return f"{_types(width, real, arguments)} {statements} {finish}"


def _bits(kind, y, x):
    """C++ that declares y, of type `kind`, with the bits of x."""
    return f"{kind} {y}; memcpy(&{y}, &{x}, sizeof(V));"


def root(width):
    # Clang's generic square root is one instruction; with one lane (CUDA has no such builtin) so is the ordinary one.
    return "wp::sqrt({})" if width == 1 else "__builtin_elementwise_sqrt({})"


def about_inverse_root(real):
    """C++ that declares R, 1 / sqrt(A) to 7e-6, without a division: half the exponent, then a series in what that leaves."""
    half = f"{_bits('U', 'N', 'A')} N = {FORMATS[real]['inverse_root']} - (N >> 1); {_bits('V', 'Y', 'N')}"
    series = "((S)0.5 + E * ((S)0.375 + (S)0.3125 * E))"
    return f"{half} V E = (S)1.0 - (A * Y) * Y; V R = Y + (Y * E) * {series};"


def _rounded(real, x, factor):
    """C++ that declares T, the integer nearest to factor * x as a real, and N, the same as an integer."""
    f = FORMATS[real]
    rounder = f"(S){f['rounder']!r}"
    return f"V T = {x} * (S){factor!r} + {rounder}; {_bits('I', 'N', 'T')} N -= {f['rounder_bits']}; T -= {rounder};"


def _powers(real, x, limits):
    """C++ that declares N, R, Q with x = N ln 2 + R and Q = (e^R - 1) / R, |R| <= ln 2 / 2, x kept within limits."""
    f = FORMATS[real]
    low, high = (f"(V() + (S){limit!r})" for limit in f[limits])
    # NaN is neither below nor above a limit, so it stays NaN.
    kept = f"V X = {x}; X = X < {low} ? {low} : X; X = X > {high} ? {high} : X;"
    Q = _series("R", [1.0 / _factorial(k + 1) for k in range(f["exponential"])])
    return f"{kept} {_rounded(real, 'X', 1.0 / LN2)} V R = {_less('X', 'T', f['ln2'])}; V Q = {Q};"


def _power_of_two(real, p, n):
    """C++ that declares p = 2^n."""
    f = FORMATS[real]
    return f"I {p}_ = ({n} + {f['bias']}) << {f['digits']}; {_bits('V', p, f'{p}_')}"


def nearest(real):
    # Beyond half the rounder a number is whole, or as good as whole.
    rounder = FORMATS[real]["rounder"]
    return (
        f"V T = A + (S){rounder!r}; T -= (S){rounder!r}; V B = A < (S)0 ? -A : A; V R = B < (S){rounder / 2!r} ? T : A;"
    )


def exponential(real):
    # 2^N in two factors: N goes from where 2^N underflows to where it overflows.
    halves = f"I H = N >> 1; {_power_of_two(real, 'P', 'H')} {_power_of_two(real, 'O', '(N - H)')}"
    return f"{_powers(real, 'A', 'extent')} {halves} R = ((S)1 + R * Q) * P * O;"


def decay(real):
    # e^-a - 1 = (2^N - 1) + 2^N R Q. With N = 0, R = -a: nothing cancels, nothing is divided by zero.
    far = "((S)1 - P - P * (R * Q)) / A"
    return f"{_powers(real, '-A', 'single')} {_power_of_two(real, 'P', 'N')} R = N == 0 ? Q : {far};"


def _waves(real):
    """C++ that declares SN = sin R, CS = cos R for |R| <= pi/4."""
    terms = FORMATS[real]["sine"]
    sine = [(-1.0) ** k / _factorial(2 * k + 1) for k in range(1, terms + 1)]
    cosine = [(-1.0) ** k / _factorial(2 * k) for k in range(2, terms + 2)]
    return (
        f"V Z = R * R; V SN = R + R * Z * {_series('Z', sine)};"
        f"V CS = (S)1 - (Z * (S)0.5 - Z * Z * {_series('Z', cosine)});"
    )


def _turned(r, quadrant):
    """C++ that declares r: the sine of the angle R after that many quarter turns."""
    return f"I {r}_ = {quadrant}; V {r} = ({r}_ & 1) != 0 ? CS : SN; {r} = ({r}_ & 2) != 0 ? -{r} : {r};"


def sine(real, quadrant):
    reduced = f"{_rounded(real, 'A', 2.0 / PI)} V R = {_less('A', 'T', FORMATS[real]['half_pi'])};"
    return f"{reduced} {_waves(real)} {_turned('Y', quadrant)}"


def _split(real, x):
    """C++ that declares K and M with x = 2^K M, sqrt(1/2) <= M < sqrt(2)."""
    f = FORMATS[real]
    exponent = f"{_bits('I', 'B', x)} I K = (B - {f['root_half_bits']}) >> {f['digits']};"
    return f"{exponent} B -= K << {f['digits']}; {_bits('V', 'M', 'B')}"


def _logarithm_of(real, excess="M - (S)1"):
    """C++ that declares L = ln(2^K M) = K ln 2 + 2 artanh((M - 1) / (M + 1)); `excess` is M - 1."""
    f = FORMATS[real]
    high, low = (f"(S){part!r}" for part in f["ln2"])
    artanh = _series("G", [2.0 / (2 * k + 1) for k in range(1, f["logarithm"] + 1)])
    # E is K as a real: K is put into the last bits of the rounder, as _rounded reads them (see _scaled for why).
    return (
        f"V F = ({excess}) / (M + (S)1); V G = F * F;"
        f"I J = K + {f['rounder_bits']}; {_bits('V', 'E', 'J')} E -= (S){f['rounder']!r};"
        f"V L = E * {high} + ((S)2 * F + (F * G * {artanh} + E * {low}));"
    )


def logarithm(real):
    # Every comparison with NaN fails: R / R, which is 0 / 0, marks a <= 0 and NaN alike.
    return f"{_split(real, 'A')} {_logarithm_of(real)} V R = V(); R = A > (S)0 ? L : R / R;"


def arctangent2(real):
    """C++ of the angle of (B, A): reduced to one eighth of the circle, then to half of it, by one division."""
    terms = FORMATS[real]["arctangent"]
    series = _series("Z", [(-1.0) ** k / (2 * k + 1) for k in range(1, terms + 1)])
    return (
        "V P = A < (S)0 ? -A : A; V Q = B < (S)0 ? -B : B; V L = Q < P ? Q : P; V G = Q < P ? P : Q;"
        # Beyond tan(pi / 8) the angle is pi / 4 less that of (G - L) / (G + L).
        f"V H = (G * (S){2.0**0.5 - 1.0!r}); V T = (L > H ? L - G : L) / (L > H ? L + G : (G == (S)0 ? V() + (S)1 : G));"
        f"V Z = T * T; V R = T + T * Z * {series}; R = L > H ? R + (S){PI / 4!r} : R;"
        f"R = P > Q ? (S){PI / 2!r} - R : R; R = B < (S)0 ? (S){PI!r} - R : R; R = A < (S)0 ? -R : R;"
    )


# Philox makes numbers from a counter and a key, and has no state: a random number depends on the seed, the member, the step
# and the channel alone. So threads, packets and steps that are made again do not change it.
# Philox4x32: the multipliers of words 0 and 2, and what is added to the key from round to round.
MULTIPLIERS = (0xD2511F53, 0xCD9E8D57)
KEY_STEPS = (0x9E3779B9, 0xBB67AE85)
ROUNDS = 10


def _philox(width):
    """C++ of Philox4x32-10, Salmon et al. 2011: the words C0..C3, each in a 64-bit lane, which holds a product of two."""
    types = f"{_vector(width, 'W', 'wp::uint64', 8)} {_vector(width, 'H', 'wp::uint32', 4)}"
    counter = (
        f"H h; memcpy(&h, &member, sizeof(H)); W C0 = {_converted(width, 'h', 'W')};"
        "W C1 = W() + (wp::uint32)step; W C2 = W() + (wp::uint32)channel; W C3 = W();"
    )
    key = "wp::uint32 k0 = seed0, k1 = seed1; W P0, P1;"
    one_round = (
        f"P0 = C0 * (wp::uint64){MULTIPLIERS[0]}u; P1 = C2 * (wp::uint64){MULTIPLIERS[1]}u;"
        "C0 = (P1 >> 32) ^ C1 ^ (wp::uint64)k0; C1 = P1 & (wp::uint64)0xffffffffu;"
        "C2 = (P0 >> 32) ^ C3 ^ (wp::uint64)k1; C3 = P0 & (wp::uint64)0xffffffffu;"
        f"k0 += {KEY_STEPS[0]}u; k1 += {KEY_STEPS[1]}u;"
    )
    return f"{types} {counter} {key} {one_round * ROUNDS}"


def _scaled(width, real, x, word):
    """C++ that declares x = word + 1/2 for a vector U of whole numbers below 2^32."""
    if real == wp.float32:
        return f"V {x} = {_converted(width, word, 'V')} + (S)0.5;"
    # The last bits of 2^52 + word are the word: a conversion that every processor has.
    return f"U {x}_ = ({word}) | (U)({0x433 << 52} + U()); {_bits('V', x, f'{x}_')} {x} -= (S){2.0**52 - 0.5!r};"


def _radius(width, real, word):
    """C++ that declares l = sqrt(-2 ln x), x = (word + 1/2) / 2^32."""
    x = f"U u = {_converted(width, word, 'U')}; {_scaled(width, real, 'X', 'u')} X *= (S){2.0**-32!r};"
    # Where x is near 1, 1 - x is all that the logarithm sees: from the word it is exact, from a rounded x it is not.
    excess = f"D = K == 0 ? D * (S){-(2.0**-32)!r} : M - (S)1;"
    one_less = f"{_scaled(width, real, 'D', '(U() + 0xffffffffu) - u')} {excess}"
    logarithm = f"{_split(real, 'X')} {one_less} {_logarithm_of(real, 'D')}"
    return f"{x} {logarithm} V l = (S)-2 * L; l = {root(width).format('l')};"


def _direction(width, real, word):
    """C++ that declares c, s: cosine and sine of 2 pi (word + 1/2) / 2^32."""
    # The quarter turns are bits of the word: no argument is reduced.
    quarters = f"U w = {_converted(width, word, 'U')} + {1 << 29}u; U q = w >> 30; {_bits('I', 'Q', 'q')}"
    rest = f"{_scaled(width, real, 'R', f'w & (U() + {(1 << 30) - 1}u)')} R -= (S){2.0**29!r};"
    angle = f"R *= (S){2.0 * PI / 2.0**32!r};"
    return f"{quarters} {rest} {angle} {_waves(real)} {_turned('s', 'Q')} {_turned('c', 'Q + 1')}"


def _pair(width, real, first, second, place):
    """C++ that writes two normals, Box & Muller 1958, to a place of the result."""
    write = f"c *= l; s *= l; memcpy(&r[{place}], &c, sizeof(V)); memcpy(&r[{place + width}], &s, sizeof(V));"
    return f"{{ {_radius(width, real, first)} {_direction(width, real, second)} {write} }}"


def normals(width, real):
    pairs = _pair(width, real, "C0", "C1", 0) + _pair(width, real, "C2", "C3", 2 * width)
    return f"{_types(width, real, '')} {_philox(width)} wp::vec_t<{4 * width}, S> r; {pairs} return r;"
