# SPDX-License-Identifier: Apache-2.0
"""Spec, which decides the code of a kernel, and the types that the kernel's functions share."""

import functools
from typing import Any, NamedTuple

import warp as wp

from lgvi_kernels.advance import monitor as monitors
from lgvi_kernels.advance.rows import PACE_FIELDS, STATE_FIELDS
from lgvi_kernels.lanes.arithmetic import int_lane, lane
from lgvi_kernels.lanes.state import alarm_struct, inertia_struct, state_struct, struct, table_number, view_struct
from lgvi_kernels.laws import drag
from lgvi_kernels.maps.accounting import keeps_account
from lgvi_kernels.maps.compose import params_of

# Steps between two looks at the alarms. A chunk with an alarm is repeated one step at a time by the same code.
CHUNK = 128


class Control(NamedTuple):
    """Parts of a scene's controller in its kernel."""

    parts: tuple  # modules: sensors, guidance, laws, allocation, then what commands pass on their way
    numbers: tuple  # the declared numbers of each part (see params_of)
    reports: bool = False  # samples show where actuators are
    exerts: bool = False  # or the wrench that they exert
    asked: bool = False  # a function of the host answers each tick, between launches; such a kernel has no lead
    headings: bool = False  # the headings among what is noted are computed: others read attitudes


class Spec(NamedTuple):
    """Everything that decides the code of a kernel, and nothing else: it is the key by which kernels are cached.

    Two scenes with equal Specs share a compiled kernel, so numbers that may differ between them are arguments, not here.
    """

    width: int  # lanes of a packet
    real: Any  # the type of its numbers
    maps: tuple  # the sub-maps after the leading one, as (letter, coefficient)
    lead: tuple | None  # the sub-map that opens a step and merges with the end of the step before
    laws: tuple  # modules; drag along the axes comes first if a scene has it
    numbers: tuple  # the declared numbers of each law, then of each event (see params_of)
    mass: str  # shape of M, "isotropic", "diagonal" or "full"
    solver: str  # of equation (24), as the next three (see make_solve)
    iterations: int
    adaptive: bool
    checked: bool  # unchecked kernels have no alarms at all
    events: tuple = ()  # modules
    drag: tuple = ()  # parts of drag along the axes (by its exact flow, or as rates) that some member has
    parts: tuple = ()  # optional fields of the inertia (see inertia_struct)
    coupling: tuple = (False,) * 6  # which of U12, U13, U23 and of the three pitches some member has
    flow: str = "none"  # or "steady" (uniform, the same for ever), "uniform", "varying"
    timed: bool = False  # a law looks at the time
    memory: bool = False  # a law or the method remembers numbers from step to step
    averages: tuple | None = None  # alpha and beta of (15), (16); None for conservative maps
    composed: bool = False  # several stages a step; False for one, whose constants are made once for all steps
    paired: bool = False  # a stage is two halves, each with a length of its own
    gauss: tuple = ()  # numbers of a collocation method
    lead_time: float = 0.0  # the part of a step for which the lead drifts
    explicit: Any = None  # an explicit method, which has no maps
    inverse: tuple = ()  # entries (i, j) that are not zero of the inverse inertia, where it is no product of M^-1 and J^-1
    compensated: bool = False  # sums of two float32 (see sums)
    warning_rows: tuple = ()  # see monitor
    energy: bool = False  # its growth is a failure
    backward: bool = False  # drag is checked for stages that go backward
    substep: bool = False  # a step that has no solution is divided
    control: Control | None = None
    shared_rows: bool = False  # all members share the rows of the laws' table (see table_number)
    tangents: int = 0  # slopes that each number carries; with any, lanes are those of lgvi_kernels.tangents

    @property
    def lanes(self) -> int:
        """Numbers in a lane as Warp knows it: one for each vehicle, and those of its slopes."""
        if not self.tangents:
            return self.width
        # Where a kernel has slopes, here: other runs do without this code.
        from lgvi_kernels.tangents.lanes import declare
        from lgvi_kernels.tangents.native import DualShape

        return declare(DualShape(self.width, self.tangents, self.real))

    @property
    def watched(self) -> bool:
        """Whether events are looked at."""
        return bool(self.events)

    @property
    def dragged(self) -> bool:
        """Whether a sub-map makes drag by its exact flow."""
        return bool(self.drag) and self.explicit is None

    @property
    def turned(self) -> bool:
        """Whether the method turns about the body's axes: the angle of these turns has a limit."""
        return any(letter[0] == "R" for letter, _ in self.maps)

    @property
    def paced(self) -> bool:
        """Whether a packet chooses its steps: it keeps its step from launch to launch, and no frozen lane decides it."""
        return self.explicit is not None and self.explicit.adaptive

    @property
    def drifted_time(self) -> float:
        """The part of a step for which the lead has drifted when the step begins; with stages, the part of the first one."""
        return self.lead_time if self.lead is not None and self.lead[0] in ("Ab", "T", "B") else 0.0

    @property
    def scaled(self) -> bool:
        """Whether momenta and inertia are divided by max J: for (24), and where a step is chosen, for its tolerance."""
        return self.explicit is None or self.explicit.adaptive

    @property
    def inertial(self) -> bool:
        """Whether the state holds R p in place of p."""
        return self.explicit is not None and self.explicit.kind == "inertial"

    @property
    def still(self) -> bool:
        """Whether the velocity of the water where a member stopped is kept: later the water there has another one."""
        return self.watched and self.flow in ("uniform", "varying")

    @property
    def accounted(self) -> bool:
        """Whether the energy that laws use is summed."""
        return any(map(keeps_account, self.laws))

    @property
    def signalled(self) -> bool:
        """Whether samples may have rows of the memory: signals of a controller, or the energy used."""
        return self.control is not None or self.accounted

    @property
    def state_fields(self) -> int:
        """Numbers of a packet's state."""
        return STATE_FIELDS * (1 + self.compensated) + PACE_FIELDS * self.paced


class Types(NamedTuple):
    """The types of a kernel: lanes, the structs of lanes/state.py, and the kernel's arguments.

    Constants: all that is the same in every step of a packet. DragFlow: the constants of drag by its exact flow.
    Loop: the numbers of a controller's parts, nested as those of the laws.
    Number: what the laws' table holds.
    """

    Lane: Any
    Number: Any
    Ints: Any
    State: Any
    Alarm: Any
    View: Any
    Constants: Any
    DragFlow: Any
    Inertia: Any
    Params: Any
    Events: Any
    Limits: Any
    Monitor: Any
    Loop: Any = None


@functools.cache
def make_types(spec):
    """The types for this Spec."""
    width, real = spec.lanes, spec.real
    Lane, Number = lane(width, real), table_number(width, real, spec.shared_rows)
    Inertia = inertia_struct(width, real, spec.mass, spec.parts)
    Params = params_of(spec.laws, spec.numbers, width, real)
    Events = params_of(spec.events, spec.numbers[len(spec.laws) :], width, real)
    DragFlow = drag.flow_struct(width, real)
    Loop = params_of(spec.control.parts, spec.control.numbers, width, real) if spec.control else None
    Constants = struct(
        "Constants",
        inertia=Inertia,
        params=Params,
        tolerance=real,
        force_tolerance=real,
        table=wp.array2d(dtype=Number),
        memory=wp.array2d(dtype=Lane),
        packet=wp.int32,
        entry=wp.int32,
        # The rows of the laws' memory, without those of a controller: from the first one to before the last one.
        first_memory=wp.int32,
        last_memory=wp.int32,
        **({"events": Events} if spec.events else {}),
        **({"drag": DragFlow} if spec.dragged else {}),
        **({"loop": Loop} if spec.control else {}),
        **({"account": wp.int32} if spec.accounted else {}),
        **_rules(spec),
    )
    return Types(
        Lane,
        Number,
        int_lane(width),
        state_struct(width, real, spec.compensated),
        alarm_struct(width, real),
        view_struct(width, real, spec.shared_rows),
        Constants,
        DragFlow,
        Inertia,
        Params,
        Events,
        monitors.limits_struct(width, real, spec.warning_rows),
        monitors.monitor_struct(
            width, real, spec.warning_rows, spec.energy, spec.backward, spec.substep, spec.still, Loop, spec.accounted
        ),
        Loop,
    )


def _rules(spec):
    """A field that nothing reads: its name puts the text of the rules for slopes into the kernel's hash."""
    if not spec.tangents:
        return {}
    from lgvi_kernels.tangents.native import DualShape, digest

    return {f"rules_{digest(DualShape(spec.width, spec.tangents, spec.real))}": wp.uint8}
