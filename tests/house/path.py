# SPDX-License-Identifier: Apache-2.0
"""Path of an argument from `lw.solve` to the kernel: `python -m tests.house.path h [scene.toml]` prints its walk.

`python -m tests.house.path files` prints the files that a run enters, in the order of their first calls.

A real run of a scene's first members is watched. A stay is a function that has the value in a name, in a container or in an
attribute that it reads, or a class whose object holds it. A climb is a step of this walk, in the order of first visits, from a
room to a higher one.
"""

import importlib
import inspect
import os
import sys
import threading
from collections.abc import Mapping
from pathlib import Path

import lgvi_warp as lw
from tests.house.graph import ROOMS, ROOT, SOURCE_ROOTS

# Values that no other number of the run has.
ARGUMENTS = {"h": 0.0123456789, "t1": 0.123456789}
FLOORS = {room: floor for floor, rooms in enumerate(ROOMS) for room in rooms}
MOST_ENTRIES, MEMBERS = 32, 16
# Where the kernel takes over: of what is called later nothing is looked at.
LAUNCH = "Packets.advance"


def place_of(file):
    """(room, path) of a file of the program; None for another's."""
    for package, root in SOURCE_ROOTS.items():
        if file.startswith(f"{root / package}{os.sep}"):
            parts = Path(file).relative_to(root / package).parts
            room = parts[0] if package == "lgvi_warp" else "kernels"
            return room, str(Path(file).relative_to(ROOT))
    return None


def attributes(value):
    """Attributes of an object of the program, by name."""
    own = type(value).__module__.startswith(tuple(SOURCE_ROOTS)) and not isinstance(value, type)
    return getattr(value, "__dict__", {}) if own else {}


def entries(value):
    """Entries of a container of the language."""
    if isinstance(value, Mapping):
        return list(value.values())[:MOST_ENTRIES] if type(value) is dict else []
    return list(value[:MOST_ENTRIES]) if type(value) in (tuple, list) else []


class Walk:
    """The stays of one value: name -> (room, file), in the order of their calls."""

    def __init__(self, value):
        self.value, self.begun, self.found, self.launched = value, {}, [], False
        self.files: dict[str, None] = {}

    def is_it(self, value):
        return isinstance(value, float) and value == self.value

    def holders(self, value):
        """(attribute, class) of the objects that hold the value: a local one, or one of its attributes."""
        for holder in (value, *attributes(value).values()):
            for name, held in list(attributes(holder).items()):
                if self.is_it(held):
                    yield name, type(holder)

    def watch(self, frame, event, _):
        """Look at each function of the program when it is left: all that it had is in its names then."""
        code = frame.f_code
        # What an import runs, modules and bodies of classes, is no call.
        if event == "call" and code.co_flags & inspect.CO_OPTIMIZED and (place := place_of(code.co_filename)):
            self.files.setdefault(place[1])
        if event == "call" and not self.launched:
            self.begun[frame] = len(self.begun)
        self.launched = self.launched or (event == "call" and code.co_qualname == LAUNCH)
        if event != "return" or frame not in self.begun or (place := place_of(code.co_filename)) is None:
            return
        order = self.begun[frame]
        values = list(frame.f_locals.values())
        if any(self.is_it(value) or any(map(self.is_it, entries(value))) for value in values):
            self.found.append((order, code.co_qualname, *place))
        for value in values:
            for name, kind in self.holders(value):
                module = sys.modules[kind.__module__].__file__
                self.found.append((order, f"class {kind.__qualname__}", *place_of(module)))
                if name in code.co_names:
                    self.found.append((order, code.co_qualname, *place))

    def stays(self):
        """[(name, room, file)], each once."""
        return list(dict.fromkeys(found[1:] for found in sorted(self.found)))


def watched(argument, scene):
    """The Walk of an argument in a run of a scene's first members."""
    fleet = lw.Ensemble(scene, MEMBERS)
    walk = Walk(ARGUMENTS[argument])
    before = sys.getprofile()
    threading.setprofile(walk.watch)
    sys.setprofile(walk.watch)
    try:
        lw.solve(fleet, **ARGUMENTS, save=lw.SaveAt(), threads=1)
    finally:
        sys.setprofile(before)
        threading.setprofile(None)
    return walk


def walked(argument, scene=ROOT / "examples" / "paper.toml"):
    """The stays of an argument in a small run of a scene file."""
    return watched(argument, lw.Scene.load(scene)).stays()


def entered():
    """Files that a run of a scene without a method enters, in the order of their first calls; once in a process."""
    for module in ("lgvi_warp.calls.solve", "lgvi_kernels.advance.kernel"):
        importlib.import_module(module)
    return list(watched("h", lw.Scene.named("sphere")).files)


def climbs(stays):
    """Number of steps of the walk into a higher room."""
    floors = [FLOORS.get(room, -1) for _, room, _ in stays]
    return sum(after > before for before, after in zip(floors, floors[1:], strict=False))


def main(argument, *scene):
    stays = walked(argument, *scene)
    for name, _, file in stays:
        print(f"{file:45s} {name}")
    print(f"{argument}: {len(stays)} stays, {len({file for *_, file in stays})} files, {climbs(stays)} climbs")


if __name__ == "__main__":
    if sys.argv[1:] == ["files"]:
        print(*entered(), sep="\n")
        sys.exit()
    if sys.argv[1:2] == [] or sys.argv[1] not in ARGUMENTS:
        sys.exit(f"Give one of {', '.join(ARGUMENTS)}")
    main(*sys.argv[1:3])
