"""Players: what performs a Score in the World, and the Performance that it leaves."""
