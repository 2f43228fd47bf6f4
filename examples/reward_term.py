"""Add a reward term of one's own to the environment, and see what each term gives."""

import gymnasium
import numpy as np

from pianomime.learn.envs.reward import RewardTerm
from pianomime.learn.envs.state import EnvState


def idle_speed(state: EnvState) -> np.ndarray:
    """(n,) mean speed of the joints in frames in which no key is due [rad/s]."""
    rests = ~state.goal.any(axis=1)
    return rests * np.abs(state.velocities).mean(axis=1)


def main() -> None:
    env = gymnasium.make(
        "pianomime.learn:pianomime/Song-v0",
        demonstration="twinkle-twinkle",
        config="paper",
        extra_rewards=[RewardTerm("stillness", idle_speed, weight=-0.1)],
    )
    print(env.unwrapped)  # the table of terms
    env.reset(seed=0)
    sums: dict[str, float] = {}
    for _ in range(60):  # 3 s of music
        action = env.action_space.sample()
        _, _, terminated, truncated, info = env.step(action)
        for name, value in info.items():
            if name.startswith("reward/"):
                sums[name] = sums.get(name, 0.0) + value
        if terminated or truncated:
            break
    for name, value in sums.items():
        print(f"{name:18} {value:8.3f}")


if __name__ == "__main__":
    main()
