# SPDX-License-Identifier: Apache-2.0
"""A result keeps what it says, on disk as well, and its energy and momenta are those of the definitions."""

import json

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.physics import energy as invariants
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.reference import energy
from tests.support.tools import TURN, body_of, one, random_states, scene_of, to_state

pytestmark = pytest.mark.kernel


@pytest.fixture(scope="module")
def result():
    scene = scene_of((1.0, 2.0, 3.0), TURN @ np.diag((1.0, 2.0, 2.5)) @ TURN.T, net=-0.3, moment=(0.1, 0.2, -0.5))
    b, R, nu, Om = random_states(6, 5)
    Om[3] *= 1e4
    return lw.solve(one(scene, b, R, nu, Om), h=0.05, t1=1.0, save=lw.SaveAt(every=0.25)), body_of(scene)


@pytest.mark.ci
def test_shapes(result):
    r, _ = result
    k, n = 5, 5
    shapes = {"position": (k, n, 3), "attitude": (k, n, 3, 3), "quaternion_wxyz": (k, n, 4), "velocity": (k, n, 3)}
    assert r.time.shape == (k,)
    assert r.energy.shape == (k, n)
    assert r.status.shape == (n,)
    assert all(getattr(r, name).shape == shape for name, shape in shapes.items())
    assert all(x.dtype == np.float64 for x in r.samples.values())
    assert r.status.counts() == {"ok": 4, "step_too_large": 1}
    assert list(np.flatnonzero(r.status)) == [3]


def test_energy_and_momenta(result):
    r, body = result
    P, L = invariants.linear_momentum(r), invariants.angular_momentum(r)
    for k, member in ((0, 0), (4, 2)):
        x = to_state(body, *(getattr(r, name)[k, member] for name in FIELDS))
        assert r.energy[k, member] == pytest.approx(energy.energy(x, body), rel=1e-13)
        np.testing.assert_allclose(P[k, member], energy.linear_momentum(x), rtol=1e-13)
        np.testing.assert_allclose(L[k, member], energy.angular_momentum(x), rtol=1e-12)


def test_quaternions_are_those_of_the_attitude(result):
    r, _ = result
    np.testing.assert_allclose(lw.notation.matrix_from_quaternion(r.quaternion_wxyz), r.attitude, atol=1e-14)


def test_drift_leaves_failed_members_out(result):
    assert all(0.0 <= value < 1.0 for value in invariants.drift(result[0]).values())


def test_save_and_load(result, tmp_path):
    r, _ = result
    path = r.save(tmp_path / "result.npz")
    again = lw.Result.load(path)
    for name in (*FIELDS, "energy", "quaternion_wxyz", "status", "failure_time", "failure_value", "time"):
        np.testing.assert_array_equal(getattr(again, name), getattr(r, name))
    assert again.provenance == json.loads(json.dumps(r.provenance))
    assert again.messages == r.messages
    assert again.status.counts() == r.status.counts()
    assert [p.name for p in tmp_path.iterdir()] == ["result.npz"]


def test_saving_twice_gives_the_same_bytes(result, tmp_path):
    r, _ = result
    assert r.save(tmp_path / "a.npz").read_bytes() == r.save(tmp_path / "b.npz").read_bytes()


def test_a_save_that_fails_leaves_the_old_file(result, tmp_path, monkeypatch):
    r, _ = result
    path = r.save(tmp_path / "result.npz")
    before = path.read_bytes()

    def full_disk(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez", full_disk)
    with pytest.raises(OSError, match="No space"):
        r.save(path)
    assert path.read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


def test_provenance_names_what_the_result_follows_from(result):
    p = result[0].provenance
    assert (p["terms"], p["method"]["name"], p["step"]) == (["weight", "restoring"], "psi_s", 0.05)
    assert {"python", "lgvi-warp", "warp-lang", "numpy"} <= p["versions"].keys()
    assert p["machine"]["threads"] >= 1


def test_dataset(result):
    dataset = result[0].dataset
    assert dict(dataset.sizes) == {"time": 5, "realization": 5, "component": 3, "row": 3, "column": 3}
    assert (dataset.position.attrs["units"], dataset.attrs["Conventions"]) == ("m", "CF-1.11")
