"""How deep true bodies are in one another."""

from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.check.penetration import overlap, polytopes_of


def body_overlap(a: SolidBody, b: SolidBody) -> float:
    """Greatest depth [m] by which pieces of two bodies overlap; negative when the bodies are apart."""
    return max(overlap(p, a.T_world_body, q, b.T_world_body) for p in polytopes_of(a) for q in polytopes_of(b))
