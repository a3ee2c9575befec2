# SPDX-License-Identifier: Apache-2.0
"""The methods of a unit that PythonFMU's wrapper calls; the class in the unit's own file adds PythonFMU's base class."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lgvi_warp.common.safe_files import read_json
from lgvi_warp.extensions.others.fmu.unit import VehicleUnit
from lgvi_warp.scene.scene import Scene

# In the file, beside the class: the scene, which inputs act on it, and the names of the variables.
CONTENT = "vehicle.json"


class UnitOfVehicle:
    """A vehicle of the file's scene. Value references are indices in its list of variables."""

    # Of PythonFMU's base class.
    log: Any

    def __init__(self, **kwargs: Any):
        super().__init__(**kwargs)
        self.modelName = "Vehicle"
        content = read_json(Path(kwargs["resources"]), CONTENT)
        self.unit = VehicleUnit(Scene.from_dict(content["scene"]), content["inputs"])
        self.names = [variable.name for variable in self.unit.variables]
        if self.names != content["variables"]:
            raise ValueError(
                f"the unit was exported by lgvi_warp {content['version']}, and the one installed here names other "
                "variables. Export the scene with the version here, or install that one"
            )

    def setup_experiment(self, start_time: float, *others: Any) -> None:
        """Begin the experiment at t = 0."""
        if start_time != 0.0:
            raise ValueError(f"start time {start_time:.9g} s: a vehicle begins at 0. Give 0, and [start] in the scene")

    def exit_initialization_mode(self) -> None:
        """Load the kernel, and compile it first if Warp's cache does not have it."""
        self.unit.begin()

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Do a communication step; returns False if it fails, with the reason in the log."""
        from pythonfmu.enums import Fmi2Status

        try:
            self.unit.step(current_time, step_size)
        except ValueError as error:
            self.log(str(error), Fmi2Status.error)
            return False
        return True

    def get_real(self, places: Sequence[int]) -> list[float]:
        """Values of variables."""
        return [float(self.unit.get(self.names[place])) for place in places]

    def get_integer(self, places: Sequence[int]) -> list[int]:
        """Values of whole numbers."""
        return [int(self.unit.get(self.names[place])) for place in places]

    def set_real(self, places: Sequence[int], values: Sequence[float]) -> None:
        """Set inputs and parameters."""
        for place, value in zip(places, values, strict=True):
            self.unit.set(self.names[place], float(value))

    def set_integer(self, places: Sequence[int], values: Sequence[int]) -> None:
        """Set the seed."""
        for place, value in zip(places, values, strict=True):
            self.unit.set(self.names[place], int(value))

    def _get_fmu_state(self) -> dict[str, Any]:
        return self.unit.remembered()

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        self.unit.recall(state)

    @staticmethod
    def _fmu_state_to_bytes(state: dict[str, Any]) -> bytes:
        return json.dumps(state).encode()

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> Any:
        return json.loads(state)
