"""Independent checkers of plans and paths against the true scene. No planner imports this."""
