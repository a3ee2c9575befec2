# SPDX-License-Identifier: Apache-2.0
"""A scene as an FMU: a co-simulation unit of FMI 2.0, run by PythonFMU's wrapper in the Python with lgvi_warp installed.

PythonFMU provides the wrapper's libraries and base class. Its builder is not used, because it runs the packed script, leaves
a folder on the path, and writes time and machine into the file. Here the same scene always gives the same bytes.
"""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from lgvi_warp import __version__
from lgvi_warp.common.errors import Faults, MissingExtra, SceneError
from lgvi_warp.common.files import new_file
from lgvi_warp.extensions.others.fmu.slave import CONTENT
from lgvi_warp.extensions.others.fmu.unit import INPUTS, Variable, VehicleUnit
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.runs.request import Request
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene

# Name of the model and of the wrapper's libraries, and of the module with the class.
MODEL, MODULE = "Vehicle", "lgvi_warp_vehicle"
SCRIPT = '''"""A vehicle of lgvi_warp as a unit of FMI: vehicle.json has its scene."""

import sys

from pythonfmu import Fmi2Slave

try:
    from lgvi_warp.extensions.others.fmu.slave import UnitOfVehicle as Base
except ImportError as error:
    raise ImportError(
        f"lgvi_warp is not installed in {sys.prefix}, the Python that runs this unit: install it there ({error})"
    ) from error


# With each instance the wrapper of PythonFMU 0.7 gives back a reference to the names of this module that it does not own
# (findClass in PySlaveInstance.cpp). These stand for it: without them the names are freed while they are used.
SPARE = [globals(), globals()]


class Vehicle(Base, Fmi2Slave):
    """The vehicle of vehicle.json."""

    def __init__(self, **kwargs):
        SPARE.append(globals())
        super().__init__(**kwargs)
'''
NEEDS = (
    f"Runs in a Python that has lgvi_warp {__version__}: that of the program which loads it. "
    "The first start compiles a kernel, which takes about a minute. Communication steps are whole numbers of the step."
)
# The date of all files in the archive: the first that ZIP knows.
DATE = (1980, 1, 1, 0, 0, 0)
# Libraries of the wrapper, by the folder of a platform in PythonFMU and in a unit.
ENDINGS = (".so", ".dll", ".dylib")
# Keys of a scene whose values name files.
OF_FILES = ("file", "mesh")


def scene_writer(scene: Scene, inputs: str) -> Any:
    """Check that a scene can become a unit, and return the function (target, report) that writes the unit.

    inputs: As in `VehicleUnit`.

    Raises:
        SceneError: If the scene cannot become a unit; the message lists every fault.
    """
    files = dict(_of_wrapper())
    content = _content(scene, inputs)
    text = json.dumps(content, indent=1).encode()
    token = hashlib.sha256(text).hexdigest()
    unit = VehicleUnit(Scene.from_dict(content["scene"]), inputs)
    files[f"resources/{CONTENT}"] = text
    files[f"resources/{MODULE}.py"] = SCRIPT.encode()
    files["resources/slavemodule.txt"] = MODULE.encode()
    parts = {"modelDescription.xml": description(unit, token), **dict(sorted(files.items()))}

    def write(target: Path, report: Any) -> None:
        with new_file(target) as file, zipfile.ZipFile(file, "w") as archive:
            for done, (name, data) in enumerate(parts.items()):
                entry = zipfile.ZipInfo(name, DATE)
                entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
                archive.writestr(entry, data)
                report((done + 1) / len(parts))

    return write


def _of_wrapper() -> Iterator[tuple[str, bytes]]:
    """Files of PythonFMU that a unit contains."""
    try:
        import pythonfmu
    except ImportError as error:
        raise MissingExtra("units of FMI", "pythonfmu", "fmu") from error
    home = Path(pythonfmu.__file__).parent
    for path in home.glob("*.py"):
        yield f"resources/pythonfmu/{path.name}", path.read_bytes()
    for path in (home / "resources" / "binaries").rglob("*"):
        if path.suffix in ENDINGS:
            yield f"binaries/{path.parent.name}/{MODEL}{path.suffix}", path.read_bytes()


def _content(scene: Scene, inputs: str) -> dict[str, Any]:
    """The scene's content, with its step and method, for the unit's class. Raises SceneError if it is incomplete."""
    faults = Faults()
    faults.choice("inputs", inputs, INPUTS)
    if scene.run.step is None:
        remedy = 'give [run] step, or scene.with_numbers({"run.step": 0.02})'
        faults.add("run.step", None, "is missing, of which communication steps are multiples", remedy)
    tables = scene.to_dict()
    for key, name in _files(tables):
        problem = "is a file, which a unit does not carry"
        faults.add(key, name, problem, "give its numbers in the scene, or leave the part out")
    if scene.controller is not None and scene.controller.callback is not None:
        problem = "is a function of Python, which a unit does not carry"
        faults.add("controller.laws", "callback", problem, "leave it out: a unit takes commands from outside")
    faults.raise_if_any()
    seed = 0 if scene.ensemble_settings is None else scene.ensemble_settings.seed
    kept = ("method", "step", "dtype", "solver", "iterations", "tolerance", "rtol", "atol", "checks", "on_failure")
    run = {name: value for name, value in tables["run"].items() if name in kept}
    tables = {**tables, "run": run, "ensemble": {"members": 1, "seed": seed}}
    try:
        bare = Scene.from_dict(tables)
    except SceneError as error:
        problems = (f"{fault} (a unit carries the scene as its file would have it)" for fault in error.faults)
        raise SceneError(problems) from None
    if bare.run.method is None:
        # What a run of the scene would choose.
        request = Request(Ensemble(bare, 1), t1=100.0 * bare.run.step, save=SaveAt(fields=("position",)))  # type: ignore[operator]
        run["method"] = request.plan().method.name
        bare = replace(bare, run=replace(bare.run, method=run["method"]))
    names = [variable.name for variable in VehicleUnit(bare, inputs).variables]
    return {"version": __version__, "inputs": inputs, "variables": names, "scene": tables}


def _files(part: Any, where: str = "") -> Iterator[tuple[str, str]]:
    """Keys of a scene's tables that name files, with the names; settings of the ensemble are left out."""
    entries = part.items() if isinstance(part, Mapping) else enumerate(part) if isinstance(part, list) else ()
    for key, value in entries:
        place = f"{where}[{key}]" if isinstance(key, int) else f"{where}.{key}".lstrip(".")
        if place == "ensemble":
            continue
        if key in OF_FILES and isinstance(value, str):
            yield place, value
        else:
            yield from _files(value, place)


def description(unit: VehicleUnit, token: str) -> bytes:
    """The model description of a unit (FMI 2.0.4, 2.2 and 4.3.1)."""
    root = Element(
        "fmiModelDescription", fmiVersion="2.0", modelName=MODEL, guid=token, description=NEEDS,
        generationTool=f"lgvi_warp {__version__}", variableNamingConvention="structured",
    )  # fmt: skip
    SubElement(
        root, "CoSimulation", modelIdentifier=MODEL, needsExecutionTool="true",
        canHandleVariableCommunicationStepSize="true", canNotUseMemoryManagementFunctions="true",
        canGetAndSetFMUstate="true", canSerializeFMUstate="true",
    )  # fmt: skip
    units = SubElement(root, "UnitDefinitions")
    for name in sorted({variable.unit for variable in unit.variables if not variable.whole}):
        SubElement(units, "Unit", name=name)
    SubElement(root, "DefaultExperiment", startTime="0", stepSize=repr(unit.h))
    variables, structure = SubElement(root, "ModelVariables"), Element("ModelStructure")
    for place, variable in enumerate(unit.variables):
        _add(variables, place, variable)
    outputs = [str(i + 1) for i, variable in enumerate(unit.variables) if variable.causality == "output"]
    for group in ("Outputs", "InitialUnknowns"):
        unknowns = SubElement(structure, group)
        for index in outputs:
            SubElement(unknowns, "Unknown", index=index)
    root.append(structure)
    indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root) + b"\n"


def _add(variables: Element, place: int, variable: Variable) -> None:
    """Describe a variable."""
    varies = {"parameter": "fixed", "input": "continuous"}.get(
        variable.causality, "discrete" if variable.whole else "continuous"
    )
    entry = SubElement(
        variables, "ScalarVariable", name=variable.name, valueReference=str(place), causality=variable.causality,
        variability=varies, description=variable.meaning,
    )  # fmt: skip
    # 17 digits: what a program reads and gives back is the same number.
    start = {} if variable.start is None else {"start": repr(variable.start)}
    if variable.whole:
        SubElement(entry, "Integer", start)
    else:
        SubElement(entry, "Real", start | {"unit": variable.unit})
