"""Learning: environments, experts of one song, and the data they leave; torch is only here.

Importing it tells Gymnasium, where that is installed, of `pianomime/Song-v0`:

    import gymnasium
    import pianomime.learn

    env = gymnasium.make("pianomime/Song-v0", demonstration="DEMO.npz")
    envs = gymnasium.make_vec("pianomime/Song-v0", num_envs=32, demonstration="DEMO.npz")
"""

import contextlib

with contextlib.suppress(ModuleNotFoundError):
    import gymnasium

    gymnasium.register(
        "pianomime/Song-v0",
        entry_point="pianomime.learn.envs.gym_env:SongEnv",
        vector_entry_point="pianomime.learn.envs.gym_vector_env:SongVectorEnv",
    )
