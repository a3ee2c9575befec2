"""Measure what each term costs and write the table of docs/reference/term_costs.md.

python benchmarks/term_table.py
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.cases.terms import case
from lgvi_warp.common import machine, warp_setup

TARGET = Path(__file__).resolve().parent.parent / "docs" / "reference" / "term_costs.md"

TEXT = """# What each term costs

Nanoseconds per vehicle and step on one core: psi_s with the term alone, and what that is more than with weight,
buoyancy and restoring moment alone ("none"). One run, all scenes in turn, medians; {members} vehicles in lanes
(float64: {width64}, float32: {width32} a packet, methods of turns in two
registers where the processor has enough), h = {step} s, checks on. The numbers of the terms are those of
`benchmarks/scenes.py`: of waves 8 components, of cross-flow 10 stations, of thrusters and fins 4, of control fins 2,
of tables 4 knots.

Machine: {cpu}, {simd}; Warp {warp}, NumPy {numpy}. Written by `python -m benchmarks table term`; do not edit.

| term | float64 ns | more than none | float32 ns | more than none |
| --- | ---: | ---: | ---: | ---: |
{terms}

Terms that share work cost less together than the sum of their rows. The first law with a damping matrix
(`drag_matrix`, `fins`, `control_fins`, `cross_flow`, `body_lift`) brings the implicit step V, three solutions of a 6x6
system; the first current that varies in space (`current_profile`, `waves`) brings V too. Drag alone along the axes of
the inertia needs no V.

Methods for coupled inertia, without terms; the ratio is to psi_s for the uncoupled vehicle ("none" above):

| vehicle | method | float64 ns | ratio | float32 ns | ratio |
| --- | --- | ---: | ---: | ---: | ---: |
{methods}
"""


def rows(records):
    """(name, method) -> (record of float64, record of float32)."""
    found = {}
    for record in records:
        found.setdefault((record["term"], record["method"]), []).append(record)
    return found


def table(found):
    """The lines of both tables."""
    terms, methods = [], []
    for (name, method), pair in found.items():
        if method == "psi_s":
            numbers = [f"{one[key]:.1f}" for one in pair for key in ("ns_per_vehicle_step", "more_than_none")]
            terms.append(f"| {name} | {' | '.join(numbers)} |")
        else:
            numbers = [f"{one[key]:.{digits}f}" for one in pair for key, digits in RATIOS]
            methods.append(f"| {'uncoupled' if name == 'none' else name} | {method} | {' | '.join(numbers)} |")
    return "\n".join(terms), "\n".join(methods)


RATIOS = (("ns_per_vehicle_step", 1), ("over_none", 2))


def main():
    warp_setup.start()
    described, versions = machine.describe(), machine.versions()
    terms, methods = table(rows(case.run(quick=False)))
    text = TEXT.format(
        members=4096,
        width64=machine.default_width("float64"),
        width32=machine.default_width("float32"),
        step=case.STEP,
        cpu=described["cpu"],
        simd=described["simd"],
        warp=versions["warp-lang"],
        numpy=versions["numpy"],
        terms=terms,
        methods=methods,
    )
    TARGET.write_text(text)
    print(text)


if __name__ == "__main__":
    main()
