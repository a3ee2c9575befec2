# SPDX-License-Identifier: Apache-2.0
"""Runs as maps and as messages of ROS: what is read back is what the run holds, where and when on the Earth it was."""

import json
from xml.etree import ElementTree

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.extensions.others.exporting import ros
from lgvi_warp.extensions.others.exporting.lines import cut
from lgvi_warp.scene.start import Environment
from lgvi_warp.store.exporting.tracks import Tracks, tracks_of
from tests.support.exported import DATE, DEGREES, ORIGIN, OUTCOMES, SETTINGS, by_geodesic, fleet, scene

pyproj, pandas = (pytest.importorskip(name) for name in ("pyproj", "pandas"))
pytestmark = pytest.mark.kernel


@pytest.fixture(scope="module")
def result():
    return lw.solve(fleet(), **SETTINGS)


def path_of(run, member):
    """Positions and times of a member until it ended, by the rule in words, one sample after the other."""
    places, times = [], []
    for k, time in enumerate(run.time):
        if time <= run.end_time[member]:
            places.append(run.position[k, member])
            times.append(time)
        else:
            if times[-1] < run.end_time[member]:
                places.append(run.position[k, member])
                times.append(run.end_time[member])
            break
    return np.array(places), np.array(times)


@pytest.mark.ci
def test_a_map_has_the_members_until_they_ended(result, tmp_path):
    content = json.loads(lw.export(result, tmp_path / "run.geojson").read_text())
    assert content["type"] == "FeatureCollection"
    features = {feature["properties"]["member"]: feature for feature in content["features"]}
    assert [features[i]["properties"]["status"] for i in range(5)] == OUTCOMES
    for member in (0, 1, 4):
        places, times = path_of(result, member)
        feature = features[member]
        np.testing.assert_array_equal(feature["properties"]["times"], times)
        longitude, latitude, height = np.array(feature["geometry"]["coordinates"]).T
        np.testing.assert_allclose((latitude, longitude), by_geodesic(places), rtol=0, atol=DEGREES)
        np.testing.assert_array_equal(height, -places[:, 2])
    assert features[1]["properties"]["end_time"] == result.end_time[1] < 3.0
    assert features[1]["properties"]["times"][-1] == result.end_time[1]
    # Nowhere, and at one place alone.
    assert features[2]["geometry"] is None
    assert features[3]["geometry"]["type"] == "Point"


@pytest.mark.ci
def test_a_file_for_globes_has_them_with_their_times(result, tmp_path):
    root = ElementTree.parse(lw.export(result, tmp_path / "run.kml", members=[1, 2, 3])).getroot()
    space = {"k": "http://www.opengis.net/kml/2.2", "gx": "http://www.google.com/kml/ext/2.2"}
    marks = root.findall(".//k:Placemark", space)
    assert [mark.find(".//k:value", space).text for mark in marks] == [OUTCOMES[i] for i in (1, 2, 3)]
    places, times = path_of(result, 1)
    coordinates = [list(map(float, node.text.split())) for node in marks[0].findall(".//gx:coord", space)]
    np.testing.assert_allclose(np.array(coordinates)[:, 1::-1].T, by_geodesic(places), rtol=0, atol=DEGREES)
    np.testing.assert_array_equal(np.array(coordinates)[:, 2], -places[:, 2])
    moments = [np.datetime64(node.text.rstrip("Z")) for node in marks[0].findall(".//k:when", space)]
    seconds_since = (np.array(moments) - np.datetime64("2026-06-01T06:00:00")) / np.timedelta64(1, "s")
    np.testing.assert_allclose(seconds_since, times, rtol=0, atol=5e-7)
    bare = lw.export(lw.solve(fleet(scene(origin=ORIGIN)), **SETTINGS), tmp_path / "bare.kml", members=[0])
    (line,) = ElementTree.parse(bare).getroot().findall(".//k:LineString/k:coordinates", space)
    assert len(line.text.split()) == len(result.time)


def messages_of(path):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        metadata = [record.metadata for record in reader.iter_metadata()]
        found = [(channel.topic, schema.name, message.log_time, content)
                 for schema, channel, message, content in reader.iter_decoded_messages()]  # fmt: skip
    return metadata, found


def vector(message):
    return np.array([message.x, message.y, message.z])


def test_messages_of_ros_are_in_its_axes(result, tmp_path):
    pytest.importorskip("mcap_ros2")
    from scipy.spatial.transform import Rotation

    metadata, found = messages_of(lw.export(result, tmp_path / "run.mcap"))
    assert metadata[0]["origin"] == "63.44 10.4"
    assert metadata[0]["member_1"] == f"floor at {float(result.end_time[1])!r} s"
    odometry = [entry for entry in found if entry[0] == "/member_4/odometry"]
    assert {entry[1] for entry in odometry} == {"nav_msgs/msg/Odometry"}
    start = int(np.datetime64("2026-06-01T06:00:00", "ns").astype(np.int64))
    np.testing.assert_array_equal([entry[2] - start for entry in odometry], result.time * 1e9)
    # A quaternion is of a rotation; the run's matrices are as far from one as their columns are from right angles.
    off = np.abs(np.swapaxes(result.attitude[:, 4], 1, 2) @ result.attitude[:, 4] - np.eye(3)).max()
    assert off < 1e-7
    for k, (_, _, log_time, message) in enumerate(odometry):
        assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == log_time
        assert (message.header.frame_id, message.child_frame_id) == ("map", "member_4/base_link")
        north, east, down = result.position[k, 4]
        np.testing.assert_array_equal(vector(message.pose.pose.position), [east, north, -down])
        q = message.pose.pose.orientation
        turn = Rotation.from_quat([q.x, q.y, q.z, q.w])
        # Ahead, to port and up, in east, north and up: columns of the attitude, told in words.
        for ros_axis, body in ((0, [1.0, 0.0, 0.0]), (1, [0.0, -1.0, 0.0]), (2, [0.0, 0.0, -1.0])):
            n, e, d = result.attitude[k, 4] @ np.array(body)
            np.testing.assert_allclose(turn.apply(np.eye(3)[ros_axis]), [e, n, -d], rtol=0, atol=2.0 * off + 1e-14)
        u, v, w = result.velocity[k, 4]
        np.testing.assert_array_equal(vector(message.twist.twist.linear), [u, -v, -w])
        p, q_, r = result.angular_velocity[k, 4]
        np.testing.assert_array_equal(vector(message.twist.twist.angular), [p, -q_, -r])


def test_members_leave_the_transforms_as_they_end(result, tmp_path):
    pytest.importorskip("mcap_ros2")
    _, found = messages_of(lw.export(result, tmp_path / "run.mcap"))
    transforms = [(time, message) for topic, _, time, message in found if topic == "/tf"]
    times = np.array([time for time, _ in transforms])
    assert np.all(np.diff(times) >= 0)
    last = {}
    for time, message in transforms:
        last |= {entry.child_frame_id: (time, vector(entry.transform.translation)) for entry in message.transforms}
    assert set(last) == {f"member_{i}/base_link" for i in (0, 1, 3, 4)}
    places, ends = path_of(result, 1)
    time, place = last["member_1/base_link"]
    assert abs(time - (times[0] + ends[-1] * 1e9)) <= 500
    np.testing.assert_array_equal(place, [places[-1, 1], places[-1, 0], -places[-1, 2]])
    assert sum(topic == "/member_1/odometry" for topic, *_ in found) == len(ends)
    assert sum(topic == "/member_3/odometry" for topic, *_ in found) == len(path_of(result, 3)[1])


@pytest.mark.parametrize(("off", "extra"), [(0.0, 0), (1e-8, 0), (-1e-8, 0), (0.01, 1), (-0.01, 0)])
@pytest.mark.parametrize("at", [1, 3])
def test_a_member_that_ends_at_a_sample_is_written_once(at, off, extra, result, tmp_path, monkeypatch):
    """Each end has one message, and no two of one member share a stamp."""
    pytest.importorskip("mcap_ros2")
    ends = result.end_time.copy()
    ends[1] = result.time[at] + off
    recorded = Tracks.of_members
    monkeypatch.setattr(Tracks, "of_members", lambda self, name: ends if name == "end_time" else recorded(self, name))
    ros.write(tracks_of(result, None, Environment(origin=ORIGIN, start=DATE)), tmp_path / "run.mcap", lambda _: None)
    _, found = messages_of(tmp_path / "run.mcap")
    start = int(np.datetime64(DATE[:-1], "ns").astype(np.int64))
    stamps = [time - start for topic, _, time, _ in found if topic == "/member_1/odometry"]
    wanted = [*result.time[:at], *([result.time[at]] if off > 0.0 else []), *([ends[1]] if extra or off <= 0.0 else [])]
    np.testing.assert_array_equal(stamps, np.round(np.array(wanted) * 1e6) * 1000)
    frames = [(time, entry.child_frame_id) for topic, _, time, message in found if topic == "/tf"
              for entry in message.transforms]  # fmt: skip
    assert len(frames) == len(set(frames))
    assert len(frames) == sum(topic.endswith("/odometry") for topic, *_ in found)


@pytest.mark.ci
def test_a_track_across_the_antimeridian_is_cut(tmp_path):
    of = lw.Scene.named("remus_100", environment={"origin": [10.0, 179.99996]},
                        start={"velocity": [1.5, 0.0, 0.0], "euler_deg": [0.0, 0.0, 90.0]})  # fmt: skip
    run = lw.solve(of, **SETTINGS | {"t1": 6.0})
    (feature,) = json.loads(lw.export(run, tmp_path / "run.geojson").read_text())["features"]
    assert feature["geometry"]["type"] == "MultiLineString"
    west, east = (np.array(part) for part in feature["geometry"]["coordinates"])
    assert np.all(west[:, 0] > 179.0)
    assert np.all(east[:, 0] < -179.0)
    assert (west[-1, 0], east[0, 0]) == (180.0, -180.0)
    np.testing.assert_array_equal(west[-1, 1:], east[0, 1:])
    before, after = feature["properties"]["times"]
    assert (len(before), len(after)) == (len(west), len(east))
    assert before[-1] == after[0]
    # Between samples half a second apart the way is straight but for its acceleration.
    crossing = np.interp(before[-1], run.time, run.position[:, 0, 1])
    distance = pyproj.Geod(ellps="WGS84").inv(179.99996, 10.0, 180.0, 10.0)[2]
    assert crossing == pytest.approx(distance, abs=1e-6)
    frame = pandas.read_csv(lw.export(run, tmp_path / "run.csv"))
    assert frame.longitude.abs().max() <= 180.0
    kml_text = lw.export(run, tmp_path / "run.kml").read_text()
    assert kml_text.count("<LineString>") == 2


def test_lines_are_cut_wherever_they_cross():
    there = np.array(
        [[179.0, 0.0, -1.0, 0.0], [-179.0, 2.0, -3.0, 1.0], [-178.0, 2.0, -3.0, 2.0], [178.0, 4.0, 0.0, 3.0]]
    )
    first, second, third = cut(there)
    np.testing.assert_allclose(first, [there[0], [180.0, 1.0, -2.0, 0.5]])
    np.testing.assert_allclose(second, [[-180.0, 1.0, -2.0, 0.5], there[1], there[2], [-180.0, 3.0, -1.5, 2.5]])
    np.testing.assert_allclose(third, [[180.0, 3.0, -1.5, 2.5], there[3]])
    (whole,) = cut(there[1:3])
    np.testing.assert_array_equal(whole, there[1:3])


@pytest.mark.ci
def test_maps_of_more_than_1000_members_are_of_members_that_are_named(tmp_path):
    many = lw.Ensemble(scene(origin=ORIGIN), members=1001, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
    run = lw.solve(many, **SETTINGS | {"t1": 0.2, "save": lw.SaveAt(every=0.1)})
    with pytest.raises(lw.SceneError, match=r"members = None are 1,001, more than the 1,000 .*--members 0:100"):
        lw.export(run, tmp_path / "run.geojson")
    content = json.loads(lw.export(run, tmp_path / "run.geojson", members=range(1001)).read_text())
    assert len(content["features"]) == 1001
