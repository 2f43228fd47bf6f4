"""The simulated world: a piano and two Shadow hands in MuJoCo. It knows keys and joints, not songs.

`World` is one simulation, `WorldBatch` many that step together; `layout` says where joints and
actuators stand in their arrays, `parameters.json` holds every physical constant.
"""

from pianomime.world.import_mujoco import import_mujoco

import_mujoco()  # Before the modules that import it.

from pianomime.world.batch import WorldBatch  # noqa: E402
from pianomime.world.state import PhysicsWarning  # noqa: E402
from pianomime.world.world import World  # noqa: E402

__all__ = ["PhysicsWarning", "World", "WorldBatch"]
