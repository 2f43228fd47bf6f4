"""Replays: performances in the form in which a page in a browser shows them."""

from pianomime.replay.blocks import block
from pianomime.replay.notes import Judgement, heard_block, notes_block, pedal_block
from pianomime.replay.page_script import PageMissing, page_script
from pianomime.replay.poses import POSE_SUBSTEPS, POSES_PER_SECOND, Poses, move_block
from pianomime.replay.replay import done_block, head_block, replay_blocks, write_replay
from pianomime.replay.scene import scene_block

__all__ = [
    "POSES_PER_SECOND",
    "POSE_SUBSTEPS",
    "Judgement",
    "PageMissing",
    "Poses",
    "block",
    "done_block",
    "head_block",
    "heard_block",
    "move_block",
    "notes_block",
    "page_script",
    "pedal_block",
    "replay_blocks",
    "scene_block",
    "write_replay",
]
