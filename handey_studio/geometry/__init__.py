"""Frames, polyhedra and their edges, convex pieces, symmetries, height fields."""

from handey_studio.geometry.convex import convex_pieces, hull_triangles
from handey_studio.geometry.height_field import HeightField
from handey_studio.geometry.meshes import polyhedron_from_polygons, prism
from handey_studio.geometry.polyhedron import Edge, Face, Polyhedron, box
from handey_studio.geometry.symmetry import symmetries

__all__ = [
    "Edge",
    "Face",
    "HeightField",
    "Polyhedron",
    "box",
    "convex_pieces",
    "hull_triangles",
    "polyhedron_from_polygons",
    "prism",
    "symmetries",
]
