# SPDX-License-Identifier: Apache-2.0
"""Measure what each term costs, alone and all together."""

from benchmarks.cases.terms import case
from benchmarks.pages import markdown, stamp
from lgvi_warp.engine import widths

TEXT = """Nanoseconds per vehicle and step on one core: psi_s and rk4 with the term alone, and what that is more than with
weight, buoyancy and restoring moment alone ("none"). One run, all scenes in turn, medians; {members} vehicles in lanes
(float64: {width64}, float32: {width32} a packet, methods of turns in two
registers where the processor has enough), h = {step} s, checks on. The numbers of the terms are those of
`benchmarks/problems.py`: of waves 8 components, of cross-flow 10 stations, of thrusters and fins 4, of control fins 2,
of tables 4 knots.

{stamp}

{terms}

`rk4` refuses `gauss_markov_current`, and its "all terms" are without noise; `psi_s` takes a moving mass by its weight
alone. Driven vehicles of the package, with their terms and commands as shipped:

{driven}

Terms that share work cost less together than the sum of their rows. In psi_s the first law with a damping
matrix (`drag_matrix`, `fins`, `control_fins`, `cross_flow`, `body_lift`) brings the implicit step V, three solutions of a 6x6
system; the first current that varies in space (`current_profile`, `waves`) brings V too. Drag alone along the axes of
the inertia needs no V.

Methods for coupled inertia, without terms; the ratio is to psi_s for the uncoupled vehicle ("none" above):

{methods}
"""


KINDS = ("term", "vehicle")
RATIOS = (("ns_per_vehicle_step", 1), ("over_none", 2))


def rows(records):
    """(kind, name, method) -> (record of float64, record of float32)."""
    found = {}
    for record in records:
        kind = next(kind for kind in KINDS if kind in record)
        found.setdefault((kind, record[kind], record["method"]), []).append(record)
    return found


def numbers(pair, columns):
    """Cells of both precisions."""
    return [f"{one[key]:.{digits}f}" for one in pair for key, digits in columns]


def tables(answer):
    """Tables of terms, of driven vehicles, and of methods for coupled inertia."""
    columns = (("ns_per_vehicle_step", 1), ("more_than_none", 1))
    terms, driven, methods = {}, [], []
    for (kind, name, method), pair in answer.items():
        if kind == "vehicle":
            driven.append([name, method, *numbers(pair, RATIOS[:1])])
        elif method in ("psi_s", "rk4"):
            terms.setdefault(name, {})[method] = numbers(pair, columns)
        else:
            methods.append(["uncoupled" if name == "none" else name, method, *numbers(pair, RATIOS)])
    empty = [""] * 4
    cells = [[name, *by.get("psi_s", empty), *by.get("rk4", empty)] for name, by in terms.items()]
    heads = [f"{method}, {dtype} ns|more" for method in ("psi_s", "rk4") for dtype in ("float64", "float32")]
    head = ["term", *(cell for text in heads for cell in text.split("|"))]
    return (
        markdown(head, cells, "lrrrrrrrr"),
        markdown(["vehicle", "method", "float64 ns", "float32 ns"], driven, "llrr"),
        markdown(["vehicle", "method", "float64 ns", "ratio", "float32 ns", "ratio"], methods, "llrrrr"),
    )


def main():
    terms, driven, methods = tables(rows(case.run(quick=False)))
    return TEXT.format(
        members=4096,
        width64=widths.of_table("plain", "float64").lanes,
        width32=widths.of_table("plain", "float32").lanes,
        step=case.STEP,
        stamp=stamp("term"),
        terms=terms,
        driven=driven,
        methods=methods,
    )
