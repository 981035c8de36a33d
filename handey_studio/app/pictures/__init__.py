"""Pictures of plans, grasps and parts as SVG text."""
