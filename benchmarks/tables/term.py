# SPDX-License-Identifier: Apache-2.0
"""Measure what each term costs, alone and all together."""

from benchmarks.cases.terms import case
from benchmarks.pages import markdown, stamp
from lgvi_warp.engine import widths

TEXT = """Nanoseconds per vehicle and step on one core: psi_s with the term alone, and what that is more than with weight,
buoyancy and restoring moment alone ("none"). One run, all scenes in turn, medians; {members} vehicles in lanes
(float64: {width64}, float32: {width32} a packet, methods of turns in two
registers where the processor has enough), h = {step} s, checks on. The numbers of the terms are those of
`benchmarks/problems.py`: of waves 8 components, of cross-flow 10 stations, of thrusters and fins 4, of control fins 2,
of tables 4 knots.

{stamp}

{terms}

Terms that share work cost less together than the sum of their rows. The first law with a damping matrix
(`drag_matrix`, `fins`, `control_fins`, `cross_flow`, `body_lift`) brings the implicit step V, three solutions of a 6x6
system; the first current that varies in space (`current_profile`, `waves`) brings V too. Drag alone along the axes of
the inertia needs no V.

Methods for coupled inertia, without terms; the ratio is to psi_s for the uncoupled vehicle ("none" above):

{methods}
"""


def rows(records):
    """(name, method) -> (record of float64, record of float32)."""
    found = {}
    for record in records:
        found.setdefault((record["term"], record["method"]), []).append(record)
    return found


def table(found):
    """Both tables."""
    terms, methods = [], []
    for (name, method), pair in found.items():
        if method == "psi_s":
            numbers = [f"{one[key]:.1f}" for one in pair for key in ("ns_per_vehicle_step", "more_than_none")]
            terms.append([name, *numbers])
        else:
            numbers = [f"{one[key]:.{digits}f}" for one in pair for key, digits in RATIOS]
            methods.append(["uncoupled" if name == "none" else name, method, *numbers])
    head = (
        ["float64 ns", "more than none", "float32 ns", "more than none"],
        ["float64 ns", "ratio", "float32 ns", "ratio"],
    )
    return markdown(["term", *head[0]], terms, "lrrrr"), markdown(["vehicle", "method", *head[1]], methods, "llrrrr")


RATIOS = (("ns_per_vehicle_step", 1), ("over_none", 2))


def main():
    terms, methods = table(rows(case.run(quick=False)))
    return TEXT.format(
        members=4096,
        width64=widths.default_width("plain", "float64").lanes,
        width32=widths.default_width("plain", "float32").lanes,
        step=case.STEP,
        stamp=stamp("term"),
        terms=terms,
        methods=methods,
    )
