"""Configs of the environment cannot be made with settings that make no sense."""

from __future__ import annotations

import math
from typing import Any

import pytest

from pianomime.errors import InputError
from pianomime.learn.envs.config import (
    ActionConfig,
    EnvConfig,
    EpisodeConfig,
    ObservationConfig,
    RewardConfig,
)


@pytest.mark.parametrize(
    ("kind", "settings", "message"),
    [
        (RewardConfig, {"press": math.nan}, "env.reward.press must be 0 or more, not nan"),
        (RewardConfig, {"mimic": math.inf}, "env.reward.mimic must be 0 or more, not inf"),
        (RewardConfig, {"pedal": -1.0}, "env.reward.pedal must be 0 or more, not -1"),
        (RewardConfig, {"hit": 7.0}, "env.reward.hit must be 0 to 1, not 7"),
        (ActionConfig, {"factor": -0.1}, "env.action.factor must be 0 to 1, not -0.1"),
        (ObservationConfig, {"goal": -1}, "env.observation.goal must be 0 to 200, not -1"),
        (
            ObservationConfig,
            {"fingertips": -2},
            "env.observation.fingertips must be 0 to 200, not -2",
        ),
        (EpisodeConfig, {"frames": -5}, "env.episode.frames must be 0 or more, not -5"),
        (
            EpisodeConfig,
            {"start": "end"},
            "env.episode.start must be one of beginning, anywhere, not 'end'",
        ),
        (EnvConfig, {"world": "moon"}, "env.world must be one of paper, solid, not 'moon'"),
        (
            EnvConfig,
            {"device": "gpu"},
            "env.device must be one of cpu, cuda, warp-cpu, not 'gpu'",
        ),
        (EnvConfig, {"base": "pid"}, "env.base must be one of ik, dynamic, not 'pid'"),
    ],
)
def test_what_makes_no_sense_is_refused(
    kind: type[Any], settings: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError) as refused:
        kind(**settings)
    assert str(refused.value) == message


def test_an_observation_has_terms() -> None:
    with pytest.raises(InputError, match="at least one"):
        ObservationConfig(False, False, False, 0, 0, False, False)
