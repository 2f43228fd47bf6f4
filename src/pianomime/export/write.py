"""The export of a performance: all files that a real controller, or another simulator, wants."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from pianomime.export.limits import Breach, LimitCheck, Limits
from pianomime.export.limits_file import write_limits
from pianomime.export.mjcf import mjcf
from pianomime.export.samples import Sampler, commands, played_again
from pianomime.export.tables import (
    TRAJECTORY_FILES,
    trajectory_tables,
    write_breaches,
    write_key_events,
    write_pedal,
)
from pianomime.export.urdf import mesh_files, write_urdf
from pianomime.installation import install_command
from pianomime.players.performance import Performance
from pianomime.progress import Steps
from pianomime.world.model import world_model

_LOG = "trajectory.mcap"
FILES = (
    *TRAJECTORY_FILES,
    *("key_events.csv", "pedal.csv", "limits.csv", "broken.csv", "performance.mid"),
    *("world.xml", "world.urdf", *mesh_files(world_model())),
    _LOG,
)
"""All files of an export. The log in MCAP may be missing."""


def write_export(
    performance: Performance,
    folder: Path,
    rate: int,
    note: Callable[[str], None],
    limits: Limits | None = None,
) -> list[Breach]:
    """Write the files of an export, `FILES`; tells of its progress as "exporting".

    Args:
        performance: which is played again for it.
        folder: an existing folder for the files.
        rate: samples in a second, 1 to 1000.
        note: called with one line that says what could not be made and why.
        limits: to be kept; None for those of the world.

    Returns:
        What of it breaks a limit, at any physics step.

    Raises:
        InputError: there is no such rate, or the performance cannot be played again.
    """
    model = world_model(performance.world)
    limits = limits or Limits.of(model)
    sampler, check, command = Sampler(performance, rate), LimitCheck(limits), commands(performance)
    steps = Steps("exporting", len(performance))
    with ExitStack() as stack:
        writers = [stack.enter_context(trajectory_tables(folder, limits.joints))]
        try:
            from pianomime.export.ros_log import ros_log
        except ModuleNotFoundError as missing:
            if (missing.name or "").partition(".")[0] not in ("mcap", "mcap_ros2"):
                raise
            note(f"no {_LOG}: it needs the package {missing.name}: {install_command('robot')}")
        else:
            writers.append(stack.enter_context(ros_log(folder / _LOG, limits.joints)))
        for frame, moved in enumerate(played_again(performance)):
            check.see(moved, command[frame])
            block = sampler.of(frame, moved)
            for write in writers:
                write(block)
            steps.advance(1)
    write_key_events(performance, folder / "key_events.csv")
    write_pedal(performance, folder / "pedal.csv")
    write_limits(limits, folder / "limits.csv")
    breaches = check.breaches()
    write_breaches(breaches, folder / "broken.csv")
    performance.played().to_midi(folder / "performance.mid")
    (folder / "world.xml").write_text(mjcf(performance.world), "utf-8")
    write_urdf(model, folder / "world.urdf")
    return breaches
