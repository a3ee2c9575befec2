# SPDX-License-Identifier: Apache-2.0
"""Runge-Kutta methods as data, explicit and linearly implicit, for the kernels and for their NumPy twin.

k_i = f(t + c_i h, y + h sum_j a_ij k_j), y <- y + h sum_i b_i k_i; an error estimate is h sum_i e_i k_i. A linearly
implicit method adds h A sum_j g_ij k_j to k_i, where the matrix A approximates df/dy.
"""

from dataclasses import dataclass

Row = tuple[float, ...]


@dataclass(frozen=True)
class Tableau:
    """Coefficients of a Runge-Kutta method with s stages: weights b (s,), nodes c (s,).

    errors: Coefficients e of each error estimate, (s,), or (s + 1,) with the slope at the new state last; default none.
    implicit: Matrix g of a linearly implicit method: row i has i + 1 numbers; the last number is the same in all rows.
    """

    order: int
    a: tuple[Row, ...]
    b: Row
    c: Row
    errors: tuple[Row, ...] = ()
    estimate: int = 0
    implicit: tuple[Row, ...] = ()


# Kutta (1901): the classical method.
# docs/theory/runge_kutta.md, (K5).
RK4 = Tableau(
    order=4,
    a=((), (1 / 2,), (0.0, 1 / 2), (0.0, 0.0, 1.0)),
    b=(1 / 6, 1 / 3, 1 / 3, 1 / 6),
    c=(0.0, 1 / 2, 1 / 2, 1.0),
)

# The classical method with a linearly implicit part, a W-method (Steihaug & Wolfbrandt 1979; Hairer & Wanner, Solving Ordinary
# Differential Equations II, IV.7): of order 3 whatever the matrix, L-stable with the true one, and without one the classical
# method. Five of the seven numbers g solve its equations, b g 1 = b a g 1 = b g c = b g g 1 = 0 and R(infinity) = 0; the other
# two, 0.37 and -0.42, are about those with the least errors of order 4.
# docs/theory/runge_kutta.md, (K15).
RKW3 = Tableau(
    order=3,
    a=RK4.a,
    b=RK4.b,
    c=RK4.c,
    implicit=(
        (0.37,),
        (-0.42, 0.37),
        (0.36626076771653543284, -1.0562607677165354329, 0.37),
        (0.10747846456692913424, -0.5185895756780402451, 37 / 90, 0.37),
    ),
)

# Dormand & Prince (1980); Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, table II.5.2: 5(4).
DOPRI5 = Tableau(
    order=5,
    a=(
        (),
        (1 / 5,),
        (3 / 40, 9 / 40),
        (44 / 45, -56 / 15, 32 / 9),
        (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
        (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    ),
    b=(35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
    c=(0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0),
    errors=((71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40),),
    estimate=5,
)

# Cash & Karp (1990), ACM Transactions on Mathematical Software 16, 201, the first of its methods: 5(4), six stages.
CASH_KARP = Tableau(
    order=5,
    a=(
        (),
        (1 / 5,),
        (3 / 40, 9 / 40),
        (3 / 10, -9 / 10, 6 / 5),
        (-11 / 54, 5 / 2, -70 / 27, 35 / 27),
        (1631 / 55296, 175 / 512, 575 / 13824, 44275 / 110592, 253 / 4096),
    ),
    b=(37 / 378, 0.0, 250 / 621, 125 / 594, 0.0, 512 / 1771),
    c=(0.0, 1 / 5, 3 / 10, 3 / 5, 1.0, 7 / 8),
    errors=((-277 / 64512, 0.0, 6925 / 370944, -6925 / 202752, -277 / 14336, 277 / 7084),),
    estimate=5,
)

# Crouch & Grossman (1993), order 3, on a Lie group: the moves by the stages follow one another, the last with `b`.
# Hairer, Lubich & Wanner, Geometric Numerical Integration, IV.8.
# docs/theory/runge_kutta.md, (K13).
CG3 = Tableau(
    order=3,
    a=((), (-1 / 24,), (161 / 24, -6.0)),
    b=(1.0, -2 / 3, 2 / 3),
    c=(0.0, -1 / 24, 161 / 24 - 6.0),
)

# Hairer, Norsett & Wanner, II.5 and II.10: DOP853, 8(5,3), twelve stages, after Dormand & Prince. errors: of order 5 and 3.
DOP853 = Tableau(
    order=8,
    a=(
        (),
        (0.05260015195876773,),
        (0.0197250569845379, 0.0591751709536137),
        (0.02958758547680685, 0.0, 0.08876275643042054),
        (0.2413651341592667, 0.0, -0.8845494793282861, 0.924834003261792),
        (0.037037037037037035, 0.0, 0.0, 0.17082860872947386, 0.12546768756682242),
        (0.037109375, 0.0, 0.0, 0.17025221101954405, 0.06021653898045596, -0.017578125),
        (0.03709200011850479, 0.0, 0.0, 0.17038392571223998, 0.10726203044637328, -0.015319437748624402,
         0.008273789163814023),
        (0.6241109587160757, 0.0, 0.0, -3.3608926294469414, -0.868219346841726, 27.59209969944671, 20.154067550477894,
         -43.48988418106996),
        (0.47766253643826434, 0.0, 0.0, -2.4881146199716677, -0.590290826836843, 21.230051448181193,
         15.279233632882423, -33.28821096898486, -0.020331201708508627),
        (-0.9371424300859873, 0.0, 0.0, 5.186372428844064, 1.0914373489967295, -8.149787010746927, -18.52006565999696,
         22.739487099350505, 2.4936055526796523, -3.0467644718982196),
        (2.273310147516538, 0.0, 0.0, -10.53449546673725, -2.0008720582248625, -17.9589318631188, 27.94888452941996,
         -2.8589982771350235, -8.87285693353063, 12.360567175794303, 0.6433927460157636),
    ),
    b=(0.054293734116568765, 0.0, 0.0, 0.0, 0.0, 4.450312892752409, 1.8915178993145003, -5.801203960010585,
       0.3111643669578199, -0.1521609496625161, 0.20136540080403034, 0.04471061572777259),
    c=(0.0, 0.05260015195876773, 0.0789002279381516, 0.1183503419072274, 0.2816496580927726, 0.3333333333333333, 0.25,
       0.3076923076923077, 0.6512820512820513, 0.6, 0.8571428571428571, 1.0),
    errors=(
        (0.01312004499419488, 0.0, 0.0, 0.0, 0.0, -1.2251564463762044, -0.4957589496572502, 1.6643771824549864,
         -0.35032884874997366, 0.3341791187130175, 0.08192320648511571, -0.022355307863886294),
        (-0.18980075407240762, 0.0, 0.0, 0.0, 0.0, 4.450312892752409, 1.8915178993145003, -5.801203960010585,
         -0.4226823213237919, -0.1521609496625161, 0.20136540080403034, 0.02265179219836082),
    ),
    estimate=8,
)  # fmt: skip
