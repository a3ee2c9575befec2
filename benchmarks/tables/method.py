# SPDX-License-Identifier: Apache-2.0
"""Measure every method in every precision at every width: some 500 kernels, half an hour."""

from pathlib import Path

from benchmarks.cases.methods import case
from benchmarks.pages import markdown, read, show, stamp

SOUND = 1.5

WHY = """Four float32 are passed as two pairs by the calling convention of x86-64, and LLVM keeps the pairs: a register half as
wide as it should be; no default on AVX uses that width. The operations of a turn of `psi_x`, and of a solve of (24), wait
for one another: a narrower packet has fewer of them under way at a time, which is why `psi_x` takes two registers."""


def cells(records, method, dtype):
    """Time at the default width, and the worst width with how far off it is."""
    found = [one for one in records if one["method"] == method and one["dtype"] == dtype and "width" in one]
    if not found:
        return None, "", ""
    default = next(one for one in found if one["default"])
    worst = max(found, key=lambda one: one["off"])
    return (
        default["ns_per_vehicle_step"],
        f"{default['ns_per_vehicle_step']:.1f}",
        f"{worst['width']}: {worst['off']:.2f}",
    )


def row(records, method):
    """The cells of a line of the table."""
    (t64, c64, w64), (t32, c32, w32), (_, cc, wc) = (cells(records, method, dtype) for dtype in case.DTYPES)
    ratio = f"{t64 / t32:.2f}" if t64 and t32 else ""
    load = max(one["load_seconds"] for one in records if one["method"] == method and "width" in one)
    return [f"`{method}`", c64, w64, c32, w32, ratio, cc, wc, f"{load:.1f}"]


def notes(records):
    """Notes on widths that are worse than they should be, on single precision that gains less than 1.9, and on long loads."""
    timed, lines = [one for one in records if "width" in one], []
    for dtype in case.DTYPES:
        for width in sorted({one["width"] for one in timed}):
            here = [one for one in timed if one["dtype"] == dtype and one["width"] == width]
            off = [one for one in here if one["off"] > SOUND]
            if off:
                most = max(one["off"] for one in off)
                names = "every method" if len(off) == len(here) else ", ".join(f"`{one['method']}`" for one in off)
                lines.append(f"* {dtype} at {width}: {names}; up to {most:.2f}.")
    text = f"Further off than {SOUND}:\n\n" + "\n".join(lines) if lines else f"Nothing is further off than {SOUND}."
    lines = [text, WHY]
    slow = []
    for method in case.METHODS:
        t64, t32 = (cells(records, method, dtype)[0] for dtype in ("float64", "float32"))
        if t64 and t32 and t64 < 1.9 * t32:
            slow.append(f"`{method}` ({t64 / t32:.2f})")
    lines.append(f"float32 less than 1.9 times as fast as float64: {', '.join(slow) or 'none'}.")
    late = [
        f"`{one['method']}` {one['dtype']} at {one['width']} ({one['load_seconds']:.0f} s)"
        for one in timed
        if one["load_seconds"] > 15
    ]
    lines.append(f"Compiled for longer than 15 s: {', '.join(late) or 'none'}.")
    return "\n\n".join(lines)


def add_options(parser):
    what = "JSON lines of `python -m benchmarks run methods`, in place of measuring"
    parser.add_argument("lines", nargs="?", type=Path, metavar="FILE", help=what)


def main(lines):
    if lines:
        records = [one for one in read(lines) if "method" in one]
    else:
        records = []
        for one in case.run(False):
            records.append(one)
            show(one)
    head = ["method", "float64 [ns]", "worst", "float32 [ns]", "worst", "ratio", "float32_compensated [ns]", "worst",
            "load [s]"]  # fmt: skip
    table = markdown(head, (row(records, method) for method in case.METHODS), "lrrrrrrrr")
    return "\n\n".join([stamp("method"), table, notes(records)])
