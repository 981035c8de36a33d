"""§1 Polyhedral parts modelled from depth: readings, planes, suggestions, and a history of operations that makes the solid."""
