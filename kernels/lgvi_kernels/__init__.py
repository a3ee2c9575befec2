# SPDX-License-Identifier: Apache-2.0
"""Device code of lgvi_warp: Warp functions and kernels that advance packets of vehicles. It imports Warp alone.

The rooms; each may import from the earlier ones only:

- lanes: numbers, vectors, matrices and states of a packet, and the operators and functions between them;
- packing: kernels that put the numbers of members into lanes, before the first step;
- law.py: what the author of a force or of an event imports;
- cells.py: grids that laws and events look things up in;
- swell.py: surface and pressure of waves, for laws and sensors that look at them;
- tide.py: height of the surface over time, for those who look at the depth below it;
- laws, stops: one file for each force, one file for each event;
- maps: the maps that a step is made of, and the solvers of equation (24);
- advance: the kernel. method.py makes a step from maps and laws, stepping.py loops over steps, chunks.py looks at the alarms
  between them, kernel.py is launched; feeding.py is the tick of a controller.

Equations of Nordkvist & Sanyal (2010): (12), (23) are in `Ab`, the rotation in (10), (11), (13), (14) and its adjoint
(19)-(22) in `D`, the potential's force and moment in (13), (14), (19), (20) in `K`, their Munk moment in `Ap`, all in
maps/submaps.py; (15), (16), and with them (10)-(16) and (19)-(23) as printed, in maps/paper.py; (24) in maps/rotation.py.

To read any file: a module that writes + - * / between lanes imports `add`, `sub`, `mul`, `div`, although no line names
them (`noqa: F401`), since Warp looks operators up among the module's names; laws and stops import all of law.py.
A function `make_...` runs on the host, once for each kernel. Inside it, `if wp.static(...)` is decided then: what a scene
does not have is not compiled, and costs nothing.
"""

import functools
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType


@functools.cache
def built_in(folder, name):
    """The device code of a name in a folder ("laws", "stops"), imported when it is asked for first; None for no such name.

    A name with points is the path of a module elsewhere: that of an extension.
    Of "thrusters_with:driven,table" it is what that module's `made` returns for the features ("driven", "table"), of "imu:"
    for none; a second colon parts features as a comma does.
    """
    name, chooses, features = name.partition(":")
    path = name if "." in name else f"{__name__}.{folder}.{name}"
    module = import_module(path) if all(map(str.isidentifier, path.split("."))) and is_module(path) else None
    return module.made(tuple(filter(None, features.replace(":", ",").split(",")))) if module and chooses else module


def is_module(path):
    """Whether there is a module at a path."""
    try:
        return find_spec(path) is not None
    except ModuleNotFoundError:  # nor the package that it would be in
        return False


def device(path, features, **functions):
    """Device code that a file makes for some features: a module of this name with its functions, those that are not None."""
    module = ModuleType(f"{path}_{'_'.join(features)}")
    vars(module).update({role: function for role, function in functions.items() if function is not None})
    return module
