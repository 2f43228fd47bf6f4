"""Replays: what a page reads out of them is what the performance holds."""

from __future__ import annotations

import gzip
import json
import struct
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

import made_up
from pianomime import load_player
from pianomime.evaluation.summary import summarize
from pianomime.keyboard import KEYS
from pianomime.music import match_notes
from pianomime.players.motion import motion
from pianomime.players.performance import Performance
from pianomime.replay import POSES_PER_SECOND, Judgement, Poses, block, move_block, write_replay
from pianomime.replay.replay import replay_blocks
from pianomime.world.model import world_model

UNIT = 1e-4


@pytest.fixture(scope="module")
def performance() -> Performance:
    return load_player("zero-shot", effort=0).play(made_up.score(20, 2.0))


@pytest.fixture(scope="module")
def blocks(performance: Performance) -> list[tuple[str, bytes]]:
    poses = Poses(performance)
    row = summarize(performance, poses.of(motion(performance)))
    return list(split(b"".join(replay_blocks(performance, row, poses))))


def split(replay: bytes) -> Iterator[tuple[str, bytes]]:
    """Tags and contents of the blocks, as the documentation of the format has it."""
    while replay:
        tag, length = replay[:4].decode(), int.from_bytes(replay[4:8], "little")
        assert len(replay) >= 8 + length
        yield tag, replay[8 : 8 + length]
        replay = replay[8 + length :]


def content(blocks: list[tuple[str, bytes]], tag: str) -> Any:
    (found,) = [content for name, content in blocks if name == tag]
    return json.loads(found)


def positions(blocks: list[tuple[str, bytes]], joints: int) -> NDArray[np.float64]:
    """(N, joints) The positions in all blocks of poses."""
    parts, next_first = [], 0
    for tag, content in blocks:
        if tag == "MOVE":
            first, count = struct.unpack("<II", content[:8])
            assert first == next_first
            changes = np.frombuffer(content[8:], "<i2").reshape(joints, count)
            parts.append(np.cumsum(changes, axis=1, dtype=np.int16).T * UNIT)
            next_first += count
    return np.vstack(parts)


def rotation(quat: list[float]) -> NDArray[np.float64]:
    w, x, y, z = quat
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def body_positions(scene: Any, pose: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Where each body is, by what the documentation of the format says of it."""
    place: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
    for body in scene["bodies"]:
        pos, turn = np.array(body["pos"]), rotation(body["quat"])
        if place:
            parent_pos, parent_turn = place[body["parent"]]
            pos, turn = parent_pos + parent_turn @ pos, parent_turn @ turn
        for joint in body["joints"]:
            moved, axis = pose[joint["index"]] - joint["rest"], np.array(joint["axis"])
            if joint["type"] == "slide":
                pos = pos + turn @ axis * moved
            else:
                anchor = np.array(joint["pos"])
                half = moved / 2
                turned = turn @ rotation([np.cos(half), *(np.sin(half) * axis)])
                pos = pos + turn @ anchor - turned @ anchor
                turn = turned
        place.append((pos, turn))
    return {body["name"]: pos for body, (pos, _) in zip(scene["bodies"], place, strict=True)}


def test_bodies_are_where_mujoco_has_them(
    performance: Performance, blocks: list[tuple[str, bytes]]
) -> None:
    scene, head = content(blocks, "SCEN"), content(blocks, "HEAD")
    poses, model = positions(blocks, head["positions"]), world_model(performance.world)
    data = mujoco.MjData(model)
    for frame in np.linspace(0, len(performance) - 1, 10).astype(int).tolist():
        data.qpos[:] = performance.qpos[frame]
        mujoco.mj_kinematics(model, data)
        shown = body_positions(scene, poses[(frame + 1) * head["rate"] // 20])
        for body in range(1, model.nbody):
            name = model.body(body).name
            np.testing.assert_allclose(shown[name], data.xpos[body], atol=5e-4, err_msg=name)


def test_poses_are_those_of_every_second_physics_step(
    performance: Performance, blocks: list[tuple[str, bytes]]
) -> None:
    head = content(blocks, "HEAD")
    found = positions(blocks, head["positions"])
    assert head["rate"] == POSES_PER_SECOND == 100
    assert len(found) == 1 + 5 * len(performance)
    assert not found[0].any()
    np.testing.assert_allclose(found[5::5], performance.qpos, atol=UNIT)
    frame = next(motion(performance))
    np.testing.assert_allclose(found[1:6, :KEYS], frame.keys[2::2], atol=UNIT)


def test_all_that_is_shown_has_a_body_a_material_and_its_key(
    blocks: list[tuple[str, bytes]],
) -> None:
    scene = content(blocks, "SCEN")
    for part in ("key", "lamp"):
        assert sorted(geom[part] for geom in scene["geoms"] if geom[part] >= 0) == [*range(KEYS)]
    for geom in scene["geoms"]:
        assert 0 <= geom["material"] < len(scene["materials"])
        assert (geom["mesh"] >= 0) == (geom["type"] == "mesh")
    assert all(body["parent"] < index for index, body in enumerate(scene["bodies"]) if index)
    assert [(tip["hand"], tip["finger"]) for tip in scene["fingertips"]] == [
        (hand, finger) for hand in range(2) for finger in range(5)
    ]


def test_verdicts_are_those_of_the_music_protocol(performance: Performance) -> None:
    # A note nobody asked for, and one that nobody struck.
    off = performance.event_off.copy()
    changed = replace(
        performance,
        event_key=np.append(performance.event_key[1:], 3),
        event_on=np.append(performance.event_on[1:], 1.0),
        event_off=np.append(off[1:], 1.2),
        event_speed=np.append(performance.event_speed[1:], 0.2),
    )
    judged = Judgement.of(changed)
    matched = match_notes(changed.score, changed.played())
    assert set(np.flatnonzero(judged.played)) == set(matched.wanted)
    assert set(np.flatnonzero(judged.right)) == set(matched.played)
    # Strikes are in the order of their onsets.
    extra = changed.played().key.tolist().index(3)
    assert not judged.right[extra]
    assert judged.heard_hand[extra] == -1
    plan = performance.plan
    assert plan is not None
    for note, strike in zip(matched.wanted, matched.played, strict=True):
        assert judged.heard_hand[strike] == plan.note_hand[note]
        assert judged.heard_finger[strike] == plan.note_finger[note]


def test_a_performance_without_a_plan_has_no_fingers(performance: Performance) -> None:
    judged = Judgement.of(replace(performance, plan=None))
    assert set(judged.heard_finger) == {-1}
    assert set(judged.note_cause) == {None}


def test_the_same_performance_gives_the_same_file(
    performance: Performance, blocks: list[tuple[str, bytes]], tmp_path: Path
) -> None:
    for name in ("one", "other"):
        poses = Poses(performance)
        row = summarize(performance, poses.of(motion(performance)))
        write_replay(tmp_path / name, performance, row, poses)
    one = (tmp_path / "one").read_bytes()
    assert one == (tmp_path / "other").read_bytes()
    assert [*split(gzip.decompress(one))] == blocks


def test_another_motion_leaves_the_poses_that_were_kept(performance: Performance) -> None:
    moved = replace(performance, qpos=performance.qpos + 0.01)
    poses = Poses(moved)
    row = summarize(moved, poses.of(motion(moved)))
    assert "rail_speed_max" in row["body"]["invalid"]
    assert poses.rate == 20
    assert len(poses) == 1 + len(moved)
    found = positions([("MOVE", b[8:]) for b in poses.blocks()], 142)
    np.testing.assert_allclose(found[1:], moved.qpos, atol=UNIT)
    np.testing.assert_array_equal(poses.at(3 / 20), moved.qpos[2])


def test_between_two_poses_joints_move_straight(performance: Performance) -> None:
    poses = Poses(performance)
    for _ in poses.of(motion(performance)):
        pass
    for frame in (0, 7, len(performance) - 1):
        np.testing.assert_allclose(poses.at((frame + 1) / 20), performance.qpos[frame], atol=UNIT)
    early, late = poses.at(1.0), poses.at(1.01)
    np.testing.assert_allclose(poses.at(1.0025), 0.75 * early + 0.25 * late, atol=1e-12)
    np.testing.assert_array_equal(poses.at(1e6), poses.at((len(poses) - 1) / poses.rate))
    assert not poses.at(0.0).any()


def test_positions_of_any_size_keep_their_place() -> None:
    given = np.array([[3.2, -3.2, 99.0], [-3.2, 3.2, -99.0], [0.00004, 0.00006, 0.0]])
    ((_, found),) = split(move_block(7, given))
    assert struct.unpack("<II", found[:8]) == (7, 3)
    changes = np.frombuffer(found[8:], "<i2").reshape(3, 3)
    got = np.cumsum(changes, axis=1, dtype=np.int16).T * UNIT
    np.testing.assert_allclose(got, np.clip(given, -3.2767, 3.2767), atol=UNIT / 2 + 1e-12)


def test_a_tag_has_four_letters() -> None:
    with pytest.raises(ValueError, match="4 letters"):
        block("LONGER", b"")
