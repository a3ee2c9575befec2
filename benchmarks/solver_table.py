"""Measure the solvers of equation (24) and write the table of docs/explain/solvers.md.

python benchmarks/solver_table.py
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.cases.solvers import case
from lgvi_warp.common import machine, warp_setup

TARGET = Path(__file__).resolve().parent.parent / "docs" / "explain" / "solvers.md"

TEXT = """# Solving equation (24)

F Jd - Jd F^T = hat(a) for the rotation F, in the kernel: `lw.Method("psi_s", solver="quartic", iterations=None)`.

| name | how | start |
| --- | --- | --- |
| `quartic` | a scalar quartic in the Cayley parameter's length; default | its series, or linear |
| `cayley` | Newton on the Cayley parameter | J^-1 a / 2 |
| `newton` | Newton on the rotation vector: the paper's section III-G | J^-1 a |
| `moser_veselov` | explicit: the Riccati equation's matrix by Cayley and Hamilton | |
| `riccati` | the same equation by its invariant subspace; NumPy only | |

`iterations`: None iterates each vehicle until the relative residual is below the tolerance; a number makes so many
Newton steps in all, and a residual that stays above the tolerance gives the status NOT_CONVERGED; "auto" finds the
number before the run.

Columns: nanoseconds per solve and turn of the state (NumPy: per solve), the relative residual where the length of
J^-1 a is 0.003, 0.1 and 0.9, the largest entry of F^T F - I at 0.1, and the range: the largest length up to which the
residual stays below the tolerance (1: all of where a solution is sure). One core of {cpu}, {simd}. Written by
`python -m benchmarks table solver`; do not edit.

{tables}

The paper remarks that in Matlab the explicit Moser-Veselov solution takes at most half the time of Newton's iteration.
Here it takes {ratio:.2f} of the time of `newton` to the tolerance in float64, and {other:.1f} times that of `quartic`:
in lanes a few steps on one number cost less than a cubic, two square roots and a 3x3 system.
"""

SHAPES = ("paper", "slender", "plate")


def line(one):
    """A row of a table."""
    steps = one.get("iterations")
    name = one["solver"] + ("" if steps is None else f", {steps} steps")
    time = one.get("ns_per_solve_and_turn", one.get("ns_per_solve"))
    residuals = " | ".join(f"{one[f'at {at}']['residual']:.1e}" for at in ("0.003", "0.1", "0.9"))
    return f"| {name} | {time:.1f} | {residuals} | {one['at 0.1']['orthogonality']:.1e} | {one['range']:.2f} |"


def table(records, dtype, shape):
    """The rows of one precision and one shape of J."""
    head = f"## {dtype or 'NumPy'}, {shape} J\n\n| solver | ns | at 0.003 | at 0.1 | at 0.9 | F^T F - I | range |"
    chosen = [one for one in records if one.get("shape") == shape and one.get("dtype") == dtype and "at 0.003" in one]
    usable = [one for one in chosen if all("residual" in one[f"at {at}"] for at in ("0.003", "0.1", "0.9"))]
    return "\n".join([head, "| --- | ---: | ---: | ---: | ---: | ---: | ---: |", *map(line, usable)])


def main():
    warp_setup.start()
    records = list(case.run(quick=False))
    tables = [table(records, dtype, shape) for dtype in ("float64", "float32", None) for shape in SHAPES]
    times = {
        one["solver"]: one["ns_per_solve_and_turn"]
        for one in records
        if one.get("shape") == "paper" and one.get("dtype") == "float64" and one.get("iterations") is None
    }
    ratio, other = (times["moser_veselov"] / times[name] for name in ("newton", "quartic"))
    described = machine.describe()
    text = TEXT.format(
        tables="\n\n".join(tables), ratio=ratio, other=other, cpu=described["cpu"], simd=described["simd"]
    )
    TARGET.write_text(text)
    print(text)


if __name__ == "__main__":
    main()
