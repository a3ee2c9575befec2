# SPDX-License-Identifier: Apache-2.0
"""Measure the solvers of equation (24)."""

from benchmarks.cases.solvers import case
from benchmarks.pages import markdown, stamp

TEXT = """One core. {stamp}

{tables}

The paper remarks that in Matlab the explicit Moser-Veselov solution takes at most half the time of Newton's iteration.
Here it takes {ratio:.2f} of the time of `newton` to the tolerance in float64, and {other:.1f} times that of `quartic`:
in lanes a few steps on one number cost less than a cubic, two square roots and a 3x3 system.
"""

SHAPES = ("paper", "slender", "plate")
# Of J^-1 a.
LENGTHS = ("0.003", "0.1", "0.9")


def cells(first):
    """A row of a table."""
    steps = first.get("iterations")
    name = first["solver"] + ("" if steps is None else f", {steps} steps")
    time = first.get("ns_per_solve_and_turn", first.get("ns_per_solve"))
    residuals = [f"{first[f'at {at}']['residual']:.1e}" for at in LENGTHS]
    return [name, f"{time:.1f}", *residuals, f"{first['at 0.1']['orthogonality']:.1e}", f"{first['range']:.2f}"]


def table(records, dtype, shape):
    """The rows of one precision and one shape of J."""
    head = ["solver", "ns", *(f"at {at}" for at in LENGTHS), "F^T F - I", "range"]
    chosen = [one for one in records if one.get("shape") == shape and one.get("dtype") == dtype and "at 0.003" in one]
    usable = [one for one in chosen if all("residual" in one[f"at {at}"] for at in LENGTHS)]
    return f"## {dtype or 'NumPy'}, {shape} J\n\n{markdown(head, map(cells, usable), 'lrrrrrr')}"


def main():
    records = list(case.run(quick=False))
    tables = [table(records, dtype, shape) for dtype in ("float64", "float32", None) for shape in SHAPES]
    times = {
        one["solver"]: one["ns_per_solve_and_turn"]
        for one in records
        if one.get("shape") == "paper" and one.get("dtype") == "float64" and one.get("iterations") is None
    }
    ratio, other = (times["moser_veselov"] / times[name] for name in ("newton", "quartic"))
    return TEXT.format(tables="\n\n".join(tables), ratio=ratio, other=other, stamp=stamp("solver"))
