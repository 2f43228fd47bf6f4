"""Kernels in Warp: what is done with all worlds of a `WarpBatch` between its physics steps.

A thread has one degree of freedom of one world, the keys first, as positions and velocities have.
Each kernel is launched after a physics step, or before the first one, with (B, 142) threads.
"""

import mujoco
import warp as wp

from pianomime.keyboard import KEYS
from pianomime.world.parameters import PHYSICS_DT

_KEYS = wp.constant(KEYS)
_SECONDS = wp.constant(wp.float32(PHYSICS_DT))
_LARGEST = wp.constant(wp.float32(mujoco.mjMAXVAL))
"""MuJoCo calls physics with larger numbers than this unstable."""


@wp.kernel(enable_backward=False)
def begin(
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    before: wp.array2d[float],
    angle: wp.array2d[float],
    turning: wp.array2d[float],
    broken: wp.array[int],
    overflow: wp.array[int],
    count: wp.array[int],
) -> None:
    """Note positions, and angles and velocities of keys, where a control begins to be held."""
    world, dof = wp.tid()
    before[world, dof] = qpos[world, dof]
    if dof < _KEYS:
        angle[world, dof] = qpos[world, dof]
        turning[world, dof] = qvel[world, dof]
    if dof == 0:
        broken[world] = 0
        overflow[world] = 0
        if world == 0:
            count[0] = 0


@wp.kernel(enable_backward=False)
def find_broken(
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    qacc: wp.array2d[float],
    overflow: wp.array[int],
    lost: int,
    broken: wp.array[int],
) -> None:
    """Mark worlds whose numbers are not finite or too large, or that lost contacts."""
    world, dof = wp.tid()
    # What is not a number is not smaller than anything.
    sound = (
        wp.abs(qpos[world, dof]) < _LARGEST
        and wp.abs(qvel[world, dof]) < _LARGEST
        and wp.abs(qacc[world, dof]) < _LARGEST
    )
    if not sound or (overflow[world] & lost) != 0:
        broken[world] = 1


@wp.kernel(enable_backward=False)
def sense_keys(
    substep: int,
    on_at: wp.array[float],
    off_at: wp.array[float],
    before: wp.array2d[float],
    broken: wp.array[int],
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    warmstart: wp.array2d[float],
    angle: wp.array2d[float],
    turning: wp.array2d[float],
    sounding: wp.array2d[int],
    count: wp.array[int],
    event_key: wp.array2d[int],
    event_moment: wp.array2d[float],
) -> None:
    """Add the events of the last physics step, as `key_sensor.sense` does, in any order.

    Broken worlds rest where they were, so that they harm no others and are not simulated from
    numbers that are none.

    Rows of `event_key` are world, key, and whether it is on; of `event_moment` time [s] and the
    angular velocity of the key [rad/s].
    """
    world, dof = wp.tid()
    if broken[world] != 0:
        qpos[world, dof] = before[world, dof]
        qvel[world, dof] = 0.0
        warmstart[world, dof] = 0.0
        return
    if dof >= _KEYS:
        return
    # One by one: those of a tuple, Warp reads where they are used, which is after they change.
    first = angle[world, dof]
    last = qpos[world, dof]
    earlier = turning[world, dof]
    later = qvel[world, dof]
    angle[world, dof] = last
    turning[world, dof] = later
    threshold = on_at[dof]
    on = 1
    fastest = wp.max(earlier, later)
    if not (last >= threshold and first < threshold):
        threshold = off_at[dof]
        on = 0
        fastest = wp.min(earlier, later)
        if not (last <= threshold and first > threshold):
            return
    if sounding[world, dof] == on:
        return
    sounding[world, dof] = on
    share = (threshold - first) / (last - first)
    row = wp.atomic_add(count, 0, 1)
    event_key[row, 0] = world
    event_key[row, 1] = dof
    event_key[row, 2] = on
    event_moment[row, 0] = (wp.float32(substep) + share) * _SECONDS
    event_moment[row, 1] = fastest


@wp.kernel(enable_backward=False)
def write_rows(
    rows: wp.array[int],
    values: wp.array2d[float],
    out: wp.array2d[float],
) -> None:
    """Write columns into some rows; (n, columns) threads."""
    row, column = wp.tid()
    out[rows[row], column] = values[row, column]
