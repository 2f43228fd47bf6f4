"""Learning: environments, experts of one song, and policies of all songs; torch is only here.

Importing it registers `pianomime/Song-v0` with Gymnasium, where that is installed. Gymnasium 1.x
does not look for environments of other packages, but imports the module before the colon:

    import gymnasium

    env = gymnasium.make("pianomime.learn:pianomime/Song-v0", demonstration="DEMO.npz")
    envs = gymnasium.make_vec(
        "pianomime.learn:pianomime/Song-v0", num_envs=32, demonstration="DEMO.npz"
    )
"""

import contextlib

with contextlib.suppress(ModuleNotFoundError):
    import gymnasium

    gymnasium.register(
        "pianomime/Song-v0",
        entry_point="pianomime.learn.envs.gym_env:SongEnv",
        vector_entry_point="pianomime.learn.envs.gym_vector_env:SongVectorEnv",
    )
