"""Random scenes by seed, as their hidden truth. No planner imports this."""
