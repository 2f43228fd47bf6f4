"""The world: a piano and two Shadow hands in MuJoCo. It knows keys and joints, not songs."""

from pianomime.world.world import PhysicsWarning, World

__all__ = ["PhysicsWarning", "World"]
