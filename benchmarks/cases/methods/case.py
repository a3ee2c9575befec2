# SPDX-License-Identifier: Apache-2.0
"""Every method in every precision and at every width, on one core: ns per vehicle and step, and how far off its operations.

A method makes the same operations at every width. A core makes them at a rate that it shows with fused multiply-adds
alone, at that width (fma_peak). `off` is time times that rate, over the same at the default width: 1 where a
width is used as well as the default is, and 10 where vectorisation fell off a cliff.
"""

from benchmarks.timing import interleaved
from lgvi_kernels.lanes.arithmetic import WIDTHS
from lgvi_warp.common.errors import SceneError
from lgvi_warp.engine.peak import fma_peak
from lgvi_warp.measuring import speed
from lgvi_warp.methods.method import Method
from lgvi_warp.runs.settle import make_plan

METHODS = (
    "phi", "phi_adjoint", "psi", "psi_s", "psi_1", "psi_x", "psi_x8", "psi_w", "tj4(psi_s)", "su4(psi_s)", "su4(psi_x)",
    "bm4(psi_x)", "kl6(psi_s)", "bm6(psi_x)", "kl8(psi_s)", "kl8(psi_x)", "ss8_21(psi_x)", "rkn4_6", "rkn6_11", "rkn6_14",
    "gauss4", "gauss6", "gauss8", "gauss10", "gauss12", "cg3", "rkmk4", "rk4", "rk5", "rk5_ck", "rk8", "rk5 chosen",
    "rk8 chosen",
)  # fmt: skip
QUICK = ("psi_x",)
DTYPES = ("float64", "float32", "float32_compensated")


def method_of(name):
    """A method; "chosen": it chooses its steps."""
    base, _, chosen = name.partition(" ")
    return Method(base, rtol=1e-5, atol=1e-5) if chosen else Method(base)


def run(quick):
    members, steps = (512, 50) if quick else (1024, 400)
    names = QUICK if quick else METHODS
    for dtype in DTYPES:
        real = "float64" if dtype == "float64" else "float32"
        widths = WIDTHS if real == "float32" else WIDTHS[:-1]
        rates = rates_of(real, widths)
        for name in names:
            yield from one_method(name, dtype, rates, members, steps)


def rates_of(real, widths):
    """Fused multiply-adds a second that a core has to offer at each width.

    Within one register of 128 bits they go as the width: of chains one lane wide the compiler makes pairs, which it does not
    of a method's, and chains of four float32 it halves, as it halves a method's.
    """
    rates = {width: fma_peak(real, width) for width in widths}
    for width in widths:
        if width * (8 if real == "float64" else 4) <= 16:
            rates[width] = 0.5 * width * rates[2]
    return rates


def one_method(name, dtype, rates, members, steps):
    """One record for each width."""
    fleet = speed.fleet(members)
    try:
        plans = {w: make_plan(fleet, method_of(name), h=0.05, t1=0.05 * steps, dtype=dtype, width=w) for w in rates}
        default = make_plan(fleet, method_of(name), h=0.05, t1=0.05 * steps, dtype=dtype).spec.width
    except SceneError as error:
        yield {"method": name, "dtype": dtype, "refused": error.faults[0]}
        return
    compiled = {width: plan.compile() for width, plan in plans.items()}
    seconds = interleaved([speed.stepper(plan) for plan in plans.values()])
    ns = {width: 1e9 * one / (members * steps) for width, one in zip(plans, seconds, strict=True)}
    operations = {width: ns[width] * rates[width] * 1e-9 for width in ns}
    for width in ns:
        yield {
            "method": name,
            "dtype": dtype,
            "width": width,
            "default": width == default,
            "ns_per_vehicle_step": round(ns[width], 2),
            "off": round(operations[width] / operations[default], 2),
            "load_seconds": round(compiled[width], 2),
        }
