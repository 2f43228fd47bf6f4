"""Learning: environments, experts of one song, and the data they leave. Torch is imported here only.

Importing it tells Gymnasium of `pianomime/Song-v0`, one environment and many:

    import gymnasium
    import pianomime.learn

    env = gymnasium.make("pianomime/Song-v0", demonstration="DEMO.npz")
    envs = gymnasium.make_vec("pianomime/Song-v0", num_envs=32, demonstration="DEMO.npz")
"""

from pianomime.errors import InputError

try:
    import gymnasium
except ModuleNotFoundError as missing:
    raise InputError(
        "this needs the extra `train`: pip install 'pianomime[train]' "
        f"(there is no {missing.name})"
    ) from missing

gymnasium.register(
    "pianomime/Song-v0",
    entry_point="pianomime.learn.song_env:SongEnv",
    vector_entry_point="pianomime.learn.song_vector_env:SongVectorEnv",
)
