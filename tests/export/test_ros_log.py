"""The log in MCAP, read by readers that are not ours."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pianomime.export import samples
from pianomime.export.joints import Joints
from pianomime.players.performance import Performance
from pianomime.world.model import world_model

pytest.importorskip("mcap_ros2", reason="the extra robot is not installed")

RATE = 50
TYPES = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/key_states": "sensor_msgs/msg/JointState",
    "/commands": "trajectory_msgs/msg/JointTrajectory",
}


@pytest.fixture(scope="module")
def log(performance: Performance, tmp_path_factory: pytest.TempPathFactory) -> Path:
    from pianomime.export.ros_log import ros_log

    path = tmp_path_factory.mktemp("log") / "trajectory.mcap"
    with ros_log(path, Joints.of(world_model(performance.world))) as write:
        for block in samples(performance, RATE):
            write(block)
    return path


def messages(log: Path) -> dict[str, list[tuple[Any, Any, Any]]]:
    """(schema, channel, message) of each topic, in the order of the log."""
    from mcap.reader import make_reader

    found: dict[str, list[tuple[Any, Any, Any]]] = {topic: [] for topic in TYPES}
    with log.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        for schema, channel, message in reader.iter_messages():
            found[channel.topic].append((schema, channel, message))
    return found


def test_every_sample_is_in_it(performance: Performance, log: Path) -> None:
    typestore = pytest.importorskip("rosbags.typesys", reason="rosbags is not installed")
    store = typestore.get_typestore(typestore.Stores.ROS2_HUMBLE)
    blocks = list(samples(performance, RATE))
    joints = Joints.of(world_model(performance.world))
    for topic, rows in messages(log).items():
        times = np.concatenate([block.time for block in blocks])
        assert [row[2].log_time for row in rows] == [round(time * 1e9) for time in times]
        read = [store.deserialize_cdr(row[2].data, TYPES[topic]) for row in rows]
        for schema, channel, _ in rows:
            assert (schema.name, schema.encoding) == (TYPES[topic], "ros2msg")
            assert channel.message_encoding == "cdr"
        if topic == "/commands":
            wanted = np.concatenate([block.command for block in blocks])
            assert all(tuple(each.joint_names) == joints.actuators for each in read)
            assert all(len(each.points) == 1 for each in read)
            assert all(each.header.stamp.sec == each.header.stamp.nanosec == 0 for each in read)
            np.testing.assert_array_equal([each.points[0].positions for each in read], wanted)
            continue
        stamps = [each.header.stamp.sec + 1e-9 * each.header.stamp.nanosec for each in read]
        np.testing.assert_allclose(stamps, times, atol=1e-9)
        if topic == "/key_states":
            wanted = np.concatenate([block.keys for block in blocks])
            assert list(read[0].name) == [f"key_{key}" for key in range(88)]
            np.testing.assert_array_equal([each.position for each in read], wanted)
            continue
        assert all(tuple(each.name) == joints.names for each in read)
        for name in ("position", "velocity", "effort"):
            wanted = np.concatenate([getattr(block, name) for block in blocks])
            np.testing.assert_array_equal([getattr(each, name) for each in read], wanted)


def test_its_definitions_are_those_of_ros(log: Path) -> None:
    """Definitions in the log, parsed by another library, are the types of a ROS 2 distribution."""
    typesys = pytest.importorskip("rosbags.typesys", reason="rosbags is not installed")
    ros = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    for topic, rows in messages(log).items():
        own = typesys.get_types_from_msg(rows[0][0].data.decode(), TYPES[topic])
        assert TYPES[topic] in own
        for name, definition in own.items():
            assert definition[1] == ros.fielddefs[name][1], name
