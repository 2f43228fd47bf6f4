"""The world: a piano and two Shadow hands in MuJoCo. It knows keys and joints, not songs."""

from pianomime.world.batch import WorldBatch
from pianomime.world.state import PhysicsWarning
from pianomime.world.world import World

__all__ = ["PhysicsWarning", "World", "WorldBatch"]
