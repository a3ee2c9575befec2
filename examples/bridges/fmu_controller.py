# SPDX-License-Identifier: Apache-2.0
"""A co-simulation FMU, of FMI 2 or 3, as the controller of each vehicle: FMPy runs it behind an lw.control.Callback.

    python examples/bridges/fmu_controller.py [file.fmu]

Without a file it compiles heading_law.c, which needs a C compiler, and compares the loop with lw.control.HeadingPID. An FMU is
a program: run those that you trust (docs/guide/what_files_can_do.md). Needs the extra fmu.
"""

import hashlib
import shutil
import subprocess
import sys
import tempfile
import threading
import zipfile
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

import lgvi_warp as lw

PERIOD = 0.1  # s
COMPONENTS = ("X", "Y", "Z", "K", "M", "N")


def heading_error(y, r):
    """The wanted heading less the measured one, the short way (m,) [rad]."""
    return np.remainder(r.heading - y.heading + np.pi, 2.0 * np.pi) - np.pi


def rate_error(y, r):
    """The wanted yaw rate less the measured one (m,) [rad/s]."""
    return r.angular_velocity[:, 2] - y.angular_velocity[:, 2]


# What variables of the FMU are given, each a function of what is measured and wanted that returns (m,).
INPUTS = {"heading_error": heading_error, "rate_error": rate_error}
OUTPUTS = {"N": "moment"}  # which variable each demand is


class FmuLaw:
    """A function for lw.control.Callback: at each tick every vehicle's own instance takes its inputs and makes one step.

    file: path of the FMU. period: length of its step [s], the controller's. inputs, outputs, parameters: by names of its
    variables; outputs by the component of the demand that each is. What an instance answers holds until the next tick.
    """

    def __init__(self, file, period, inputs, outputs, parameters=None):
        if not zipfile.is_zipfile(file):
            raise ValueError(f"{file} is not an FMU, or not there. Give the path of one")
        self.made_of = file, period, inputs, outputs, parameters
        self.version = hashlib.sha256(Path(file).read_bytes()).hexdigest()
        self.period, self.inputs, self.parameters = period, inputs, parameters or {}
        self.description = fmpy.read_model_description(str(file))
        if self.description.coSimulation is None:
            raise ValueError(f"{file}: is not an FMU for co-simulation; export it as one")
        self.places = {
            v.name: v.valueReference for v in self.description.modelVariables if v.type in ("Real", "Float64")
        }
        for name in (*inputs, *outputs.values(), *self.parameters):
            if name not in self.places:
                raise ValueError(f"{file} has no real variable {name!r}. It has {', '.join(self.places)}")
        self.columns = [COMPONENTS.index(name) for name in outputs]
        self.wanted = [self.places[name] for name in outputs.values()]
        self.instances, self.lock = {}, threading.Lock()
        self.folder = fmpy.extract(str(file))

    def begin(self, member):
        """A new instance for a vehicle, in the place of one of an earlier run."""
        with self.lock:  # FMPy changes the process's folder meanwhile
            self.end(member)
            if self.instances and self.description.coSimulation.canBeInstantiatedOnlyOncePerProcess:
                raise ValueError("the FMU allows one instance in a process: give one vehicle")
            instance = fmpy.instantiate_fmu(self.folder, self.description, "CoSimulation")
            if self.description.fmiVersion.startswith("2"):
                instance.setupExperiment(startTime=0.0)
            self.set(instance, list(self.parameters), list(self.parameters.values()))
            instance.enterInitializationMode()
            instance.exitInitializationMode()
            self.instances[member] = instance

    def end(self, member):
        """Free a vehicle's instance."""
        instance = self.instances.pop(member, None)
        if instance is not None:
            instance.terminate()
            instance.freeInstance()

    def set(self, instance, names, values):
        write = instance.setReal if hasattr(instance, "setReal") else instance.setFloat64
        if names:
            write([self.places[name] for name in names], [float(value) for value in values])

    def __call__(self, t, y, r, members):
        rows = np.stack([np.broadcast_to(of(y, r), len(members)) for of in self.inputs.values()], axis=1)
        demand = np.zeros((len(members), 6))
        for i, member in enumerate(members.tolist()):
            if t == 0.0:
                self.begin(member)
            instance = self.instances[member]
            self.set(instance, list(self.inputs), rows[i])
            instance.doStep(t, self.period)
            read = instance.getReal if hasattr(instance, "getReal") else instance.getFloat64
            demand[i, self.columns] = read(self.wanted)
        return demand

    def close(self):
        """Free all instances, and remove the folder that the file was unpacked into."""
        for member in list(self.instances):
            self.end(member)
        shutil.rmtree(self.folder, ignore_errors=True)

    def __reduce__(self):
        """Another process has instances of its own."""
        return FmuLaw, self.made_of


def build(folder, version):
    """Compile heading_law.c to an FMU of FMI 2 or 3 in a folder; returns its path."""
    if shutil.which("cc") is None:
        raise ValueError("cc: no C compiler is on the path; install one, or give an FMU that exists")
    base, variables = (FMU2Slave, "ScalarVariable") if version == 2 else (FMU3Slave, "Float64")
    source, folder = Path(__file__).with_name("heading_law.c"), Path(folder)
    functions = [
        name for name in dir(base) if name.startswith(f"fmi{version}") and name + "(" not in source.read_text()
    ]
    rest, library = folder / "rest.c", folder / f"heading_law{fmpy.sharedLibraryExtension}"
    rest.write_text("".join(f"int {name}(void) {{ return 3; }}\n" for name in functions))
    command = ["cc", "-O2", "-shared", "-fPIC", "-w", f"-DFMI={version}", str(source), str(rest), "-o", str(library)]
    subprocess.run(command, check=True)
    names = {"heading_error": "input", "rate_error": "input", "moment": "output"}
    names |= dict.fromkeys(("kp", "ki", "kd"), "parameter")
    lines = []
    for place, (name, causality) in enumerate(names.items()):
        varies = 'variability="fixed" ' if causality == "parameter" else ""
        start = {"kp": ' start="3"', "ki": ' start="0.5"', "kd": ' start="2"'}.get(
            name, ' start="0"' if place < 2 else ""
        )
        head = f'name="{name}" valueReference="{place}" causality="{causality}" {varies}'
        real = f"<ScalarVariable {head}><Real{start}/></ScalarVariable>"
        lines.append(real if version == 2 else f"<{variables} {head}{start}/>")
    if version == 3:
        lines.append('<Float64 name="time" valueReference="7" causality="independent" variability="continuous"/>')
    identity = 'guid="heading_law"' if version == 2 else 'instantiationToken="heading_law"'
    unknown = '<Outputs><Unknown index="3"/></Outputs>' if version == 2 else '<Output valueReference="2"/>'
    xml = (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<fmiModelDescription fmiVersion="{version}.0" modelName="heading_law" '
        f'{identity}>\n<CoSimulation modelIdentifier="heading_law" canHandleVariableCommunicationStepSize="true"/>\n'
        f"<ModelVariables>\n{chr(10).join(lines)}\n</ModelVariables>\n<ModelStructure>{unknown}</ModelStructure>\n"
        "</fmiModelDescription>\n"
    )
    target, place = folder / f"heading_law_{version}.fmu", fmpy.platform if version == 2 else fmpy.platform_tuple
    with zipfile.ZipFile(target, "w") as archive:
        archive.writestr("modelDescription.xml", xml)
        archive.write(library, f"binaries/{place}/{library.name}")
    return target


def fleet(law, members=100):
    """Bodies that turn to a heading, each with drag of its own."""
    controller = lw.Controller(period=PERIOD, guidance=[lw.control.SetPoint(heading=0.8)], laws=[law])
    drag = lw.terms.Drag(linear=(1.0, 2.0, 2.0, 0.1, 0.1, 0.1), quadratic=(0.0,) * 6)
    vehicle = lw.Vehicle(10.0, inertia=(1.0, 2.0, 3.0))
    scene = lw.Scene(vehicle, terms=[lw.terms.ControlWrench(limit=20.0), drag], controller=controller)
    vary = {
        "start.angular_velocity[2]": lw.distributions.Normal(std=0.1),
        "drag.linear[5]": lw.distributions.Uniform(0.05, 0.5),
    }
    return lw.Ensemble(scene, members, 3, vary)


def ends(law, members=100):
    """Attitudes (members, 3, 3) after 20 s."""
    result = lw.solve(fleet(law, members), "psi_s", h=0.02, t1=20.0, save=lw.SaveAt())
    assert result.status.counts() == {"ok": members}
    return result.attitude[-1]


def main(file=None):
    """Run the fleet under an FMU, and under the law in the kernel where it is that of heading_law.c."""
    with tempfile.TemporaryDirectory() as made:
        law = FmuLaw(file or build(made, 3), PERIOD, INPUTS, OUTPUTS)
        last = ends(lw.control.Callback(law, version=law.version))
        law.close()
    off = np.degrees(np.abs(np.arctan2(last[:, 1, 0], last[:, 0, 0]) - 0.8).max())
    print(f"{len(last)} vehicles, each with an FMU of its own: at most {off:.2g} deg off the heading after 20 s")
    if file is None:
        same = ends(lw.control.HeadingPID(kp=3.0, ki=0.5, kd=2.0, anti_windup="none"))
        print(f"beside heading_pid in the kernel: attitudes at most {np.abs(last - same).max():.1e} apart")


if __name__ == "__main__":
    try:
        main(*sys.argv[1:2])
    except ValueError as error:
        sys.exit(str(error))
