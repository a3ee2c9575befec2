# SPDX-License-Identifier: Apache-2.0
"""Every extreme, what must come of it and what came: writes docs/explain/extremes.md.

python -m tests.extremes.table
"""

from pathlib import Path

import numpy as np

from lgvi_warp.common import machine, warp_setup
from lgvi_warp.common.status import Status
from tests.extremes import cases
from tests.extremes.cases import DTYPES, GROUPS, METHODS, OK

TARGET = Path(__file__).parents[2] / "docs" / "explain" / "extremes.md"

# A position that is off by more than this part of the way is worth a word.
TELLING = 0.01

TEXT = """# At the extremes

For readers who want to know how rounding and extreme inputs affect a run. Each row of the tables is one vehicle with
extreme numbers. It is simulated twice with the same method and steps: by the kernel, and in extended precision
(NumPy's longdouble, `tests/extremes/extended.py`). A cell has the error at the end of the run and a bound of this
error, or the status of the vehicle. "Accurate" means: status OK and an error below the bound.
`tests/extremes/test_extremes.py` runs every row, and asserts that errors are within their bounds and statuses are as
expected.

* **error**: the effect of rounding, the largest of |R - R*|, |p - p*| / |p| and |pi - pi*| / |pi|. R is the attitude,
  p the momentum and pi the angular momentum. R*, p* and pi* are the values of the run in extended precision. Both
  runs have the same error of the method, of second order in the step, so it is not included (see [accuracy and
  speed](../guide/accuracy_and_speed.md)).
* **bound**: G (3 sqrt(n) ({roundings} u + 2 t) + {constants} n u) for n steps. u is the unit of round-off (2^-53 or
  2^-24), and a step adds errors of {roundings} u. psi_s solves [equation (24)](../theory/rotation.md) twice a step,
  each time to the tolerance t; psi_x solves no equation, so t = 0. {constants} is the number of constants that are
  rounded once for all steps. G is the growth of a small error during the run. It is measured by runs in extended
  precision with slightly different starts. *lost*: the bound is above 1, so in this precision the phase of this
  unstable motion is unknown.
* **position**: errors of positions have a bound of their own, the bound above times the path length plus 4 n u times
  the distance from the origin. In float32 at 1e7 m from the origin this bound grows by metres a step, more than the
  vehicle moves, and the status is still OK. If the position error exceeds a hundredth of the path length, the cell
  states it. `dtype="float32_compensated"` has no such error.
* **must be**: the expected outcome, which the tests require.

Statuses: {statuses}.

Other extremes are not in the tables. A negative, zero, infinite or subnormal mass or inertia is refused before the
run. A member whose start is not finite gets NON_FINITE or STEP_TOO_LARGE. It leaves the bits of all other vehicles
unchanged. The tests run one such member among 100,000, or such members only (`tests/extremes/test_inputs.py`,
`test_neighbours.py`). With `rtol` and `atol`, the vehicles of a packet share the steps of rk8. A failing vehicle
then changes the other vehicles of its packet, within their tolerance. Explicit methods such as rk4 never report
STEP_TOO_LARGE. The kernel sets subnormal numbers (below 1e-38 in float32, 2e-308 in float64) to zero. A body that
damping brings to rest ends with momenta of about this size. Its late steps take as long as its early steps
(`tests/extremes/test_rest.py`).

Machine: {cpu}, {simd}. Written by `python -m tests.extremes.table`; do not edit.

{tables}
"""


def cell(answer, i):
    """Outcome of one case in one run."""
    status = Status(int(answer.status[i]))
    if status != OK:
        return status.name
    if answer.bound[i] > 1.0:
        return "*lost*"
    text = f"{answer.error[i]:.1e} < {answer.bound[i]:.0e}"
    if answer.position_error[i] > TELLING * answer.way[i] > 0.0:
        text += f"; position off by {answer.position_error[i]:.1g} m on a way of {answer.way[i]:.1g} m"
    return text


def expected(case):
    """Expected outcome: the same for every method, or by method."""
    words = {
        method: " or ".join("accurate" if s == OK else s.name for s in case.expected(method)) for method in METHODS
    }
    if len(set(words.values())) == 1:
        return words[METHODS[0]]
    return "; ".join(f"{method}: {word}" for method, word in words.items())


def lines(group):
    """A line for each case of a group."""
    found = {}
    for method in METHODS:
        truth = cases.extended_run(group, method)
        for dtype in DTYPES:
            found[method, dtype] = cases.measured(group, method, dtype, truth)
    for i, case in enumerate(group.cases):
        cells = " | ".join(cell(one, i) for one in found.values())
        yield f"| {case.name} | {expected(case)} | {cells} |"


def table(groups):
    """One table for groups of the same kind."""
    heads = [f"{method} {dtype}" for method in METHODS for dtype in DTYPES]
    first = groups[0]
    length = f" of {first.h:g} s" if len(groups) == 1 else ""
    text = [f"## {first.title}", "", f"{first.steps} steps{length}.", "",
            f"| case | must be | {' | '.join(heads)} |", "| --- " * (2 + len(heads)) + "|"]  # fmt: skip
    return "\n".join([*text, *(line for group in groups for line in lines(group))])


def main():
    """Measure and write."""
    warp_setup.start()
    made = [make() for make in GROUPS.values()]
    titles = list(dict.fromkeys(group.title for group in made))
    tables = "\n\n".join(table([group for group in made if group.title == title]) for title in titles)
    described = machine.describe()
    statuses = "; ".join(
        f"{s.name}: {s.text}" for s in (Status.STEP_TOO_LARGE, Status.NOT_CONVERGED, Status.NON_FINITE)
    )
    with np.errstate(all="ignore"):
        TARGET.write_text(TEXT.format(tables=tables, cpu=described["cpu"], simd=described["simd"], statuses=statuses,
                                      roundings=cases.ROUNDINGS, constants=cases.CONSTANTS), encoding="utf-8")  # fmt: skip


if __name__ == "__main__":
    main()
