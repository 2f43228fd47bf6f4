"""The simulated world: a piano and two Shadow hands in MuJoCo. It knows keys and joints, not songs.

`World` is one simulation, `WorldBatch` many that step together; `layout` says where joints and
actuators stand in their arrays, `parameters.json` holds every physical constant.
"""

from pianomime.world.batch import WorldBatch
from pianomime.world.state import PhysicsWarning
from pianomime.world.world import World

__all__ = ["PhysicsWarning", "World", "WorldBatch"]
