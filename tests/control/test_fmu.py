# SPDX-License-Identifier: Apache-2.0
"""An FMU as the controller of each vehicle: a law in C, compiled here to FMI 2 and to FMI 3."""

import pickle
import shutil

import numpy as np
import pytest

import lgvi_warp as lw
from tests.support.bridges import example

pytest.importorskip("fmpy", reason="FMPy is not installed: pip install '.[fmu]'")
if shutil.which("cc") is None:
    pytest.skip("no C compiler, cc, is on the path: no FMU can be made", allow_module_level=True)

BRIDGE = example("fmu_controller")
MEMBERS = 12


@pytest.fixture(scope="module", params=[2, 3])
def fmu(request, tmp_path_factory):
    return BRIDGE.build(tmp_path_factory.mktemp(f"fmi{request.param}"), request.param)


@pytest.fixture
def law(fmu):
    made = BRIDGE.FmuLaw(fmu, BRIDGE.PERIOD, BRIDGE.INPUTS, BRIDGE.OUTPUTS)
    yield made
    made.close()


def ends(law):
    return BRIDGE.ends(lw.control.Callback(law, version=law.version), MEMBERS)


@pytest.mark.ci
def test_the_loop_is_that_of_the_law_in_the_kernel(law):
    """1,000 steps of round-off: the two evaluate one formula, the errors of the heading in another order."""
    fused = lw.control.HeadingPID(kp=3.0, ki=0.5, kd=2.0, anti_windup="none")
    assert np.abs(ends(law) - BRIDGE.ends(fused, MEMBERS)).max() < 1e-12


@pytest.mark.ci
def test_parameters_are_set(fmu):
    law = BRIDGE.FmuLaw(fmu, BRIDGE.PERIOD, BRIDGE.INPUTS, BRIDGE.OUTPUTS, {"kp": 2.0, "ki": 0.0})
    fused = lw.control.HeadingPID(kp=2.0, kd=2.0)
    assert np.abs(ends(law) - BRIDGE.ends(fused, MEMBERS)).max() < 1e-12
    law.close()


def test_a_second_run_begins_anew(law):
    first = ends(law)
    assert np.array_equal(ends(law), first)
    copied = pickle.loads(pickle.dumps(law))
    assert copied.folder != law.folder
    assert np.array_equal(ends(copied), first)
    copied.close()
    copied.close()


def test_what_the_file_has_not_is_named(fmu):
    with pytest.raises(
        ValueError, match=r"has no real variable 'torque'. It has heading_error, rate_error, moment, kp"
    ):
        BRIDGE.FmuLaw(fmu, BRIDGE.PERIOD, BRIDGE.INPUTS, {"N": "torque"})


def test_a_file_that_is_no_fmu_is_told(tmp_path):
    other = tmp_path / "law.fmu"
    for _ in range(2):
        with pytest.raises(ValueError, match=r"law\.fmu is not an FMU, or not there. Give the path of one"):
            BRIDGE.FmuLaw(other, BRIDGE.PERIOD, BRIDGE.INPUTS, BRIDGE.OUTPUTS)
        other.write_text("no archive")


@pytest.mark.ci
def test_the_script_compares_both_laws(capsys):
    BRIDGE.main()
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith("100 vehicles, each with an FMU of its own: at most ")
    assert float(first.split()[11]) < 1.0  # deg
    assert float(second.split()[-2]) < 1e-12


def test_an_error_of_the_fmu_ends_the_run(law):
    """An input that the FMU does not know: its status is an exception, with the tick and the members."""
    law.places["heading_error"] = 99
    with pytest.raises(Exception, match=r"fmi\dSet") as raised:
        ends(law)
    assert "members 0 to 11" in "".join(raised.value.__notes__)


def test_the_version_is_that_of_the_file(law, fmu, tmp_path):
    other = tmp_path / "other.fmu"
    other.write_bytes(fmu.read_bytes() + b"\0")
    changed = BRIDGE.FmuLaw(other, BRIDGE.PERIOD, BRIDGE.INPUTS, BRIDGE.OUTPUTS)
    assert changed.version != law.version
    changed.close()
