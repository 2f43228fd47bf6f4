"""The solid world: hands collide, motors have limits; the rest it shares with the paper's."""

from __future__ import annotations

import copy
from collections.abc import Callable

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.keyboard import KEYS
from pianomime.world import World, WorldBatch
from pianomime.world.hand import Hand
from pianomime.world.layout import LAYOUT
from pianomime.world.model import SIDES, build_spec, name_of, world_model
from pianomime.world.one_hand import one_hand_model
from pianomime.world.overlap import Overlap, overlap
from pianomime.world.solid import JOINT_SPEED, RAIL_FORCE, RAIL_SPEED
from pianomime.world.state import reset_pose_after_instability
from pianomime.world_names import WORLDS

PAPER, SOLID = world_model("paper"), world_model("solid")
MILLIMETRE = 1e-3
FRAMES = 20


def controls(**targets: float) -> NDArray[np.float64]:
    """(46,) controls that hold the rest pose, but for some actuators, such as rh_FFJ4."""
    ctrl = np.zeros(LAYOUT.ctrl_size)
    for name, target in targets.items():
        ctrl[PAPER.actuator(name).id] = target
    return ctrl


def played(
    name: str,
    *held: NDArray[np.float64],
    watch: Callable[[World], None] | None = None,
    frames: int = FRAMES,
) -> World:
    """A world in which controls were held, each for some frames, one after the other."""
    world = World(name)
    for ctrl in held:
        for _ in range(frames):
            world.step(ctrl, watch=None if watch is None else lambda: watch(world))
    return world


def deepest(name: str, *held: NDArray[np.float64], frames: int = FRAMES) -> Overlap:
    """The overlap of each physics step, while controls are held."""
    poses: list[NDArray[np.float64]] = []
    played(name, *held, watch=lambda world: poses.append(world.qpos_hands), frames=frames)
    return overlap(np.array(poses))


def test_a_world_knows_its_name() -> None:
    assert WORLDS == ("paper", "solid")
    assert World().name == "paper"
    for name in WORLDS:
        assert World(name).name == World(name).copy().name == name
        assert name_of(WorldBatch(2, model=name).model) == name
        assert Hand("lh", name).world == name_of(Hand("lh", name).model) == name
    assert World("solid").model is World("solid").copy().model is world_model("solid")
    assert World("solid").model is not World("paper").model


def test_there_are_no_other_worlds() -> None:
    makers: list[Callable[[str], object]] = [
        World,
        lambda name: WorldBatch(1, model=name),
        lambda name: Hand("rh", name),
    ]
    for make in makers:
        with pytest.raises(InputError, match="no world 'sold'; did you mean 'solid'"):
            make("sold")


@pytest.mark.parametrize("name", WORLDS)
def test_a_world_of_a_changed_model(name: str) -> None:
    """A copy of a model with other parameters is played in, keeps its name, and changes nothing."""
    heavy = copy.copy(world_model(name))
    heavy.body_mass[:] *= 2
    ctrl = controls(rh_WRJ1=0.3, rh_forearm_tx=0.05)
    changed, usual = World(heavy), World(name)
    again = changed.copy()
    batch = WorldBatch(1, 1, model=heavy)
    for _ in range(5):
        for world in (changed, usual, again):
            world.step(ctrl)
        batch.step(ctrl[None])
    assert again.model is changed.model is batch.model is heavy
    assert changed.name == name
    np.testing.assert_array_equal(again.state(), changed.state())
    np.testing.assert_array_equal(batch.state()[0], changed.state())
    assert np.abs(changed.qpos - usual.qpos).max() > 1e-4
    assert world_model(name).body_mass.sum() == pytest.approx(heavy.body_mass.sum() / 2)


def test_both_worlds_have_the_same_bodies() -> None:
    for name in (
        *("body_mass", "body_inertia", "body_pos", "body_quat", "body_ipos", "jnt_range"),
        *("dof_damping", "dof_armature", "actuator_gainprm", "actuator_ctrlrange", "site_pos"),
    ):
        np.testing.assert_array_equal(getattr(PAPER, name), getattr(SOLID, name), name)


def test_alike_where_nothing_meets_and_no_limit_is_reached() -> None:
    """Hands apart that move slowly and press a key: the same motion in both worlds, bit for bit."""
    down = controls(rh_FFJ3=0.9, rh_FFJ0=0.6, rh_forearm_tz=-0.04)
    paths = []
    for name in WORLDS:
        world, states = World(name), []
        for share in np.linspace(0, 1, 40):
            world.step(share * down)
            states.append(world.state())
        assert world.key_state.max() > 0.5
        paths.append(states)
    np.testing.assert_array_equal(*paths)


@pytest.mark.parametrize("pose", ["rest", "spread"])
def test_nothing_meets_where_hands_begin(pose: str) -> None:
    data = mujoco.MjData(SOLID)
    if pose == "spread":
        for name, angle in (("FFJ4", -0.2), ("LFJ4", -0.2), ("THJ4", 0.5)):
            for side in SIDES:
                data.joint(f"{side}_{name}").qpos[:] = angle
    mujoco.mj_forward(SOLID, data)
    assert data.ncon == 0


TOGETHER = controls(rh_forearm_tx=-0.45, lh_forearm_tx=0.45)
"""Both forearms go to the other one's side."""


def test_hands_do_not_pass_through_each_other() -> None:
    """Where forearms hit each other, thumbs that touch are thrown together for a few steps."""
    slowly = np.linspace(0.0, 0.8, 2 * FRAMES)[:, None] * TOGETHER
    apart = deepest("solid", *slowly, frames=1).hands
    assert (apart > MILLIMETRE).mean() < 0.02
    assert apart.max() < 10 * MILLIMETRE
    through = deepest("paper", *slowly, frames=1).hands
    assert (through > 10 * MILLIMETRE).mean() > 0.1


CROSSED = [
    controls(rh_FFJ4=-0.35, rh_MFJ4=0.35, rh_RFJ4=-0.35),
    controls(lh_THJ2=0.69, lh_THJ1=1.5),
]
"""Fingers of one hand turn into each other: side by side, and a thumb into the others."""


@pytest.mark.parametrize("ctrl", CROSSED, ids=["side by side", "thumb"])
def test_fingers_do_not_pass_through_each_other(ctrl: NDArray[np.float64]) -> None:
    assert deepest("solid", ctrl).fingers.max() < MILLIMETRE
    assert deepest("paper", ctrl).fingers.max() > 5 * MILLIMETRE


def test_a_thumb_does_not_pass_through_its_palm() -> None:
    ctrl = controls(rh_THJ5=1.0, rh_THJ4=1.2, rh_THJ2=0.7, rh_THJ1=1.5)
    spec = build_spec()
    spec.option.disableflags = 0  # The older collider overstates the depth of meshes.
    model = spec.compile()

    def depth(world: World) -> float:
        palm, thumb = (
            np.flatnonzero(model.geom_bodyid == model.body(body).id)
            for body in ("rh_palm", "rh_thdistal")
        )
        data = mujoco.MjData(model)
        data.qpos[:] = world.qpos
        mujoco.mj_kinematics(model, data)
        return -min(
            mujoco.mj_geomDistance(model, data, int(one), int(other), 0.05, None)
            for one in palm
            for other in thumb
        )

    assert depth(played("solid", ctrl)) < MILLIMETRE
    assert depth(played("paper", ctrl)) > 3 * MILLIMETRE


def test_fingers_do_not_pass_through_the_body_of_the_piano() -> None:
    """The hand goes forward over it, and then down."""
    over = controls(rh_forearm_ty=0.1)
    down = over + controls(rh_forearm_tz=-0.04, rh_FFJ3=0.5)
    tips = {name: played(name, over, down).fingertips[1, 2] for name in WORLDS}
    base = PAPER.geom("piano_base")
    top = base.pos[2] + base.size[2]
    assert (np.abs(tips["paper"] - base.pos)[:2] < base.size[:2]).all()
    assert tips["paper"][2] < top < tips["solid"][2]


def test_motors_have_no_force_left_at_their_no_load_speed() -> None:
    """The damping of whatever an actuator moves takes up all its force at that speed."""
    checked = 0
    for model in (SOLID, *(Hand(side, "solid").model for side in SIDES)):
        for index in range(model.nu):
            joints = [model.actuator(index).trnid[0]]
            if model.actuator_trntype[index] == mujoco.mjtTrn.mjTRN_TENDON:
                first = model.tendon_adr[joints[0]]
                joints = model.wrap_objid[first : first + model.tendon_num[joints[0]]].tolist()
            low, high = model.actuator_forcerange[index]
            assert model.actuator_forcelimited[index]
            assert high == -low > 0
            for joint in joints:
                rail = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE
                damping = model.dof_damping[model.jnt_dofadr[joint]]
                assert high / damping <= (RAIL_SPEED if rail else JOINT_SPEED) + 1e-12
                assert not rail or high <= RAIL_FORCE
                checked += 1
    assert checked == 2 * 2 * (LAYOUT.hand_joints)


@pytest.mark.parametrize("name", WORLDS)
def test_a_leap_along_the_keyboard(name: str) -> None:
    """From one end to the other: in the solid world as fast as the motor, and not faster."""
    speeds, forces = [], []
    rail = int(PAPER.joint("rh_forearm_tx").dofadr[0])

    def watch(world: World) -> None:
        speeds.append(abs(world.data.qvel[rail]))
        forces.append(np.abs(world.data.actuator_force[-3:]).max())
        forces.append(abs(world.data.actuator("rh_forearm_tx").force[0]))

    ends = [controls(lh_forearm_tx=end, rh_forearm_tx=0.45) for end in (0.7, -0.4)]
    world = played(name, *ends, watch=watch)
    assert world.blow_ups == 0
    if name == "solid":
        assert max(speeds) <= RAIL_SPEED
        assert max(forces) <= RAIL_FORCE
        assert max(speeds) > 0.7 * RAIL_SPEED
    else:
        assert max(speeds) > RAIL_SPEED
        assert max(forces) > RAIL_FORCE


ALONG = [joints.start + LAYOUT.slide for joints in LAYOUT.joints]


@pytest.mark.parametrize(
    "rails",
    [(0.103, -0.103), (0.15, -0.15), (0.2, -0.1), (0.7, 0.45), (-0.45, -0.74), (0.3, -0.3), (0, 0)],
)
def test_hands_have_room_after_broken_physics(rails: tuple[float, float]) -> None:
    """Where open hands would be inside each other they are moved apart; left and right rail."""
    before = np.zeros((2, LAYOUT.qpos_size))
    before[:, ALONG] = rails, (-0.3, 0.3)
    opened = reset_pose_after_instability(before, SOLID)
    assert overlap(opened[:, KEYS:]).hands.tolist() == [0.0, 0.0]
    np.testing.assert_array_equal(opened[1], before[1])
    if overlap(before[:1, KEYS:]).hands[0] == 0.0:
        np.testing.assert_array_equal(opened[0], before[0])
    else:
        assert np.abs(opened[0, ALONG] - rails).max() < 0.15
    low, high = SOLID.jnt_range[ALONG].T
    assert (opened[0, ALONG] >= low).all()
    assert (opened[0, ALONG] <= high).all()
    np.testing.assert_array_equal(np.delete(opened[0], ALONG), 0.0)
    # In the paper's world hands may be inside each other.
    np.testing.assert_array_equal(reset_pose_after_instability(before, PAPER), before)
    # Where the other hand is out of the way there is room.
    alone = one_hand_model(1, "solid")
    np.testing.assert_array_equal(reset_pose_after_instability(before, alone), before)


def test_worlds_recover_with_room() -> None:
    """Two fists, next to each other, where there is no room for two open hands."""
    fist = np.zeros(LAYOUT.hand_joints)
    for joints in LAYOUT.finger_joints[1:]:
        fist[joints] = 1.0
    pose = np.zeros(LAYOUT.qpos_size)
    for joints in LAYOUT.joints:
        pose[joints] = fist
    pose[ALONG] = 0.103, -0.103
    world, batch = World("solid", quiet=True), WorldBatch(2, 1, quiet=True, model="solid")
    world.reset(pose)
    state = world.state()
    state[1 + LAYOUT.qpos_size + KEYS] = 1e12
    world.set_state(state)
    batch.set_state(state)
    world.step(TOGETHER)
    batch.step(np.stack([TOGETHER, TOGETHER]))
    assert world.blow_ups == 1
    assert overlap(world.qpos_hands[None]).hands[0] == 0.0
    np.testing.assert_array_equal(batch.qpos, [world.qpos] * 2)
    for _ in range(20):
        world.step(TOGETHER)
    assert world.blow_ups == 1


def test_the_same_again_and_in_a_batch() -> None:
    """Colliding hands move alike in a World, in its copy, and in a batch of any threads."""
    draw = np.random.default_rng(0)
    low, high = SOLID.actuator_ctrlrange.T
    wild = TOGETHER + 0.3 * draw.uniform(low, high, (FRAMES, LAYOUT.ctrl_size))
    world = World("solid")
    for ctrl in wild[:10]:
        world.step(ctrl)
    copied, batches = world.copy(), [WorldBatch(2, threads, model="solid") for threads in (1, 2)]
    state = world.state()
    restored = World("solid")
    restored.set_state(state)
    for batch in batches:
        batch.set_state(state)
    contacts = 0
    for ctrl in wild[10:]:
        for each in (world, copied, restored):
            each.step(ctrl)
        for batch in batches:
            batch.step(np.stack([ctrl, ctrl]))
        # Geoms of hands that collide with hands; keys and what touches them have the first bit.
        contacts += (SOLID.geom_contype[world.data.contact.geom] > 1).all(axis=1).sum()
    assert contacts > 10
    np.testing.assert_array_equal(copied.state(), world.state())
    for batch in batches:
        np.testing.assert_array_equal(batch.state(), [restored.state()] * 2)


def test_wild_hands_do_not_break_the_physics() -> None:
    """Hands among each other, and controls at random, as often as five times a frame."""
    draw = np.random.default_rng(1)
    low, high = SOLID.actuator_ctrlrange.T
    world = World("solid", quiet=True)
    deep = []
    for _ in range(60):
        ctrl = draw.uniform(low, high, (5, LAYOUT.ctrl_size))
        world.step(ctrl)
        deep.append(world.qpos_hands)
    assert world.blow_ups == 0
    found = overlap(np.array(deep))
    assert (found.hands > 3 * MILLIMETRE).sum() == 0
    assert np.isfinite(world.data.qvel).all()
    assert np.abs(world.data.qvel[KEYS:]).max() < 100
