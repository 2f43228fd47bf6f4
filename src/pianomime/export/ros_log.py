"""A log in MCAP with messages of ROS 2, which `ros2 bag`, Foxglove and others read.

Neither ROS nor any file of ours is needed to read it: the definitions of its messages are in it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from mcap_ros2.writer import Writer

from pianomime.export.joints import Joints
from pianomime.export.samples import Samples
from pianomime.keyboard import KEYS

STATES, KEY_STATES = "/joint_states", "/key_states"
"""Topics of `sensor_msgs/msg/JointState`: of the hands' joints, and of the keys."""
COMMANDS = "/commands"
"""Topic of `trajectory_msgs/msg/JointTrajectory`: targets of the actuators, one point a message."""

_RULE = "=" * 80
_TIME = f"{_RULE}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
_DURATION = f"{_RULE}\nMSG: builtin_interfaces/Duration\nint32 sec\nuint32 nanosec\n"
_HEADER = f"{_RULE}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n{_TIME}"
_JOINT_STATE = (
    "std_msgs/Header header\n"
    "string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n" + _HEADER
)
_TRAJECTORY = (
    "std_msgs/Header header\nstring[] joint_names\nJointTrajectoryPoint[] points\n"
    f"{_HEADER}"
    f"{_RULE}\nMSG: trajectory_msgs/JointTrajectoryPoint\n"
    "float64[] positions\nfloat64[] velocities\nfloat64[] accelerations\nfloat64[] effort\n"
    f"builtin_interfaces/Duration time_from_start\n{_DURATION}"
)
_NANO = 1_000_000_000
_NOW = {"sec": 0, "nanosec": 0}
"""As the start of a trajectory: when its message comes, which is at its time in the log."""


@contextmanager
def ros_log(path: Path, joints: Joints) -> Iterator[Callable[[Samples], None]]:
    """Write the log of a trajectory as it goes on: yields what writes its next samples.

    Time 0 of the log is the beginning of the performance.

    Args:
        path: of the log.
        joints: whose trajectory it is.
    """
    names, actuators = list(joints.names), list(joints.actuators)
    keys = [f"key_{key}" for key in range(KEYS)]

    def write(block: Samples) -> None:
        rows = zip(*(values.tolist() for values in block), strict=True)
        for time, position, velocity, effort, command, angles in rows:
            nano = round(time * _NANO)
            header = {"stamp": {"sec": nano // _NANO, "nanosec": nano % _NANO}, "frame_id": ""}
            state = {"name": names, "position": position, "velocity": velocity, "effort": effort}
            log.write_message(STATES, joint_state, {"header": header, **state}, nano, nano)
            state = {"name": keys, "position": angles, "velocity": [], "effort": []}
            log.write_message(KEY_STATES, joint_state, {"header": header, **state}, nano, nano)
            point = {"positions": command, "velocities": [], "accelerations": [], "effort": []}
            targets = {
                "header": {"stamp": _NOW, "frame_id": ""},
                "joint_names": actuators,
                "points": [{**point, "time_from_start": _NOW}],
            }
            log.write_message(COMMANDS, trajectory, targets, nano, nano)

    with path.open("wb") as file:
        log = Writer(file)
        joint_state = log.register_msgdef("sensor_msgs/msg/JointState", _JOINT_STATE)
        trajectory = log.register_msgdef("trajectory_msgs/msg/JointTrajectory", _TRAJECTORY)
        yield write
        log.finish()  # type: ignore[no-untyped-call]
