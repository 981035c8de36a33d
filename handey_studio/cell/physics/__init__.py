"""The simulated cell with forces (MuJoCo). No planner imports this."""
