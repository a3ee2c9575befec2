# SPDX-License-Identifier: Apache-2.0
"""Members of a run as messages of ROS 2 in an MCAP file: odometry of each, and transforms of all.

Axes follow REP 103 and REP 105: the frame "map" points east, north and up; "member_3/base_link" forward, to port and up.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lgvi_warp.common.errors import refusal
from lgvi_warp.common.files import new_file
from lgvi_warp.physics import notation
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.store.exporting.tracks import Report, Tracks

# From north, east, down to east, north, up; and from ahead, starboard, down to ahead, port, up. Each is its own inverse.
TO_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
TO_FLU = np.diag([1.0, -1.0, -1.0])
# Frame of the axes.
MAP = "map"

_SEPARATOR = "=" * 80
_TIME = "int32 sec\nuint32 nanosec\n"
_HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
_VECTOR = "float64 x\nfloat64 y\nfloat64 z\n"
_QUATERNION = "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
_PARTS = {
    "std_msgs/Header": _HEADER,
    "builtin_interfaces/Time": _TIME,
    "geometry_msgs/Vector3": _VECTOR,
    "geometry_msgs/Quaternion": _QUATERNION,
}
_ODOMETRY_PARTS = _PARTS | {
    "geometry_msgs/Point": _VECTOR,
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose\nfloat64[36] covariance\n",
    "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist\nfloat64[36] covariance\n",
}
_TRANSFORM_PARTS = _PARTS | {
    "geometry_msgs/TransformStamped": "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
}

# Programs read such a file whole.
MOST_MEMBERS = 1000


def _definition(main: str, parts: Mapping[str, str]) -> str:
    """The definition of a message followed by those of its parts, in the format of ROS 2 bags."""
    return main + "".join(f"{_SEPARATOR}\nMSG: {name}\n{text}" for name, text in parts.items())


ODOMETRY = _definition(
    "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
    "geometry_msgs/TwistWithCovariance twist\n",
    _ODOMETRY_PARTS,
)
TRANSFORMS = _definition("geometry_msgs/TransformStamped[] transforms\n", _TRANSFORM_PARTS)
# Covariances are not known: a run is of exact states.
UNKNOWN = [0.0] * 36


class State(NamedTuple):
    """States of members at one time, in the axes of ROS: positions of the members in the run (m,), and numbers."""

    time: float
    at: np.ndarray
    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    turning: np.ndarray


def write(tracks: Tracks, target: Path, report: Report) -> None:
    """Write the messages in the order of their times."""
    tracks.needing(FIELDS, "odometry")
    if tracks.moments(tracks.time[0]).astype(np.int64) < 0:
        remedy = "give a later start, or none: times then count from 1970"
        raise refusal("start", tracks.environment.start, "is before 1970, and stamps of ROS cannot be", remedy)
    from mcap_ros2.writer import Writer

    with new_file(target) as file, Writer(file) as writer:
        odometry = writer.register_msgdef("nav_msgs/msg/Odometry", ODOMETRY)
        transforms = writer.register_msgdef("tf2_msgs/msg/TFMessage", TRANSFORMS)
        writer.add_metadata("lgvi-warp", _about(tracks))
        frames = [f"member_{member}" for member in tracks.members]
        for state in _states(tracks):
            stamp = int(tracks.moments(state.time).astype(np.int64)) * 1000
            header = {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": MAP}
            posed = []
            for i, place in enumerate(state.at):
                frame = f"{frames[place]}/base_link"
                position, orientation = _named(state.position[i]), _named(state.orientation[i], "wxyz")
                pose = {"position": position, "orientation": orientation}
                twist = {"linear": _named(state.velocity[i]), "angular": _named(state.turning[i])}
                message = {"header": header, "child_frame_id": frame, "pose": {"pose": pose, "covariance": UNKNOWN},
                           "twist": {"twist": twist, "covariance": UNKNOWN}}  # fmt: skip
                writer.write_message(f"/{frames[place]}/odometry", odometry, message, stamp)
                transform = {"translation": position, "rotation": orientation}
                posed.append({"header": header, "child_frame_id": frame, "transform": transform})
            writer.write_message("/tf", transforms, {"transforms": posed}, stamp)
            report((state.time - tracks.time[0]) / (np.ptp(tracks.time) or 1.0))


def _named(values: np.ndarray, names: str = "xyz") -> dict[str, float]:
    return dict(zip(names, values.tolist(), strict=True))


def _about(tracks: Tracks) -> dict[str, str]:
    """Metadata that messages cannot hold: origin of the axes, start time, and the outcome of each member."""
    environment = tracks.environment
    about = {"source": tracks.source, "axes": "map: east, north, up; base_link: ahead, port, up"}
    about |= {} if environment.origin is None else {"origin": " ".join(map(repr, environment.origin))}
    about |= {} if environment.start is None else {"start": environment.start}
    ends = zip(tracks.members, tracks.statuses(), tracks.of_members("end_time").tolist(), strict=True)
    return about | {f"member_{member}": f"{status} at {end!r} s" for member, status, end in ends}


def _states(tracks: Tracks) -> Iterator[State]:
    """States in the order of their times: of all members under way at each sample, and of each member at its end."""
    ends, time = tracks.of_members("end_time"), tracks.time
    end_stamps, stamps = tracks.moments(ends), tracks.moments(time)
    for when in tracks.spans(30):
        samples = {name: np.asarray(tracks.sample(name, when=when), dtype=np.float64) for name in FIELDS}
        for k, index in enumerate(range(when.start, when.stop)):
            ended_since = ends < time[index]
            if index:
                # An end with the stamp of a sample is written as that sample.
                ended_since &= end_stamps > stamps[index - 1]
            # Members that ended between two samples have the state of their end in the later one.
            for end in np.unique(ends[ended_since]):
                yield from _state(samples, k, float(end), ended_since & (ends == end))
            yield from _state(samples, k, float(time[index]), ends >= time[index])


def _state(samples: Mapping[str, np.ndarray], k: int, time: float, chosen: np.ndarray) -> Iterator[State]:
    """The state of some members at a sample, without members that have no state there; empty if no member has one."""
    whole = [np.isfinite(samples[name][k].reshape(len(chosen), -1)).all(axis=1) for name in FIELDS]
    at = np.flatnonzero(np.logical_and.reduce([chosen, *whole]))
    if len(at):
        position, attitude, velocity, turning = (samples[name][k, at] for name in FIELDS)
        orientation = notation.quaternion_from_matrix(TO_ENU @ attitude @ TO_FLU)
        yield State(time, at, position @ TO_ENU, orientation, velocity @ TO_FLU, turning @ TO_FLU)
