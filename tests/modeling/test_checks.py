import numpy as np
import pytest

from handey_studio.geometry import Face, Polyhedron, box, prism
from handey_studio.geometry.transforms import transform
from handey_studio.modeling.checks import solid_checks
from handey_studio.world import Library
from tests.modeling.looks import moved

LIBRARY = Library.choose()
CUBE = box((0.04, 0.05, 0.06))


def broken(solid: Polyhedron) -> dict:
    """The checks that fail, by name; each must say what would help and show where."""
    failed = {check.name: check for check in solid_checks(solid) if not check.ok}
    for check in failed.values():
        assert check.fix and check.faces and np.isfinite(check.where).all() and len(check.where)
    return failed


def together(*solids: Polyhedron) -> Polyhedron:
    """Several surfaces as one, as they are."""
    corners, faces = np.empty((0, 3)), ()
    for solid in solids:
        shift = len(corners)
        faces += tuple(
            Face(*(tuple(c + shift for c in face.outer), tuple(tuple(c + shift for c in h) for h in face.holes))) for face in solid.faces
        )
        corners = np.concatenate([corners, solid.vertices])
    return Polyhedron(corners, faces)


@pytest.mark.parametrize("name", sorted(LIBRARY.part_files()))
def test_the_bundled_parts_pass(name):
    part = LIBRARY.part(name)
    checks = solid_checks(part.solid, part.density)
    assert all(check.ok and check.sentence and not check.fix for check in checks)
    told = {check.name: check.sentence for check in checks}
    assert f"{1e3 * part.mass:.0f} g" in told["mass"] and f"{1e6 * part.solid.volume_and_centroid[0]:.1f} cm³" in told["volume"]


def test_an_open_surface_is_pointed_at():
    failed = broken(Polyhedron(CUBE.vertices, CUBE.faces[1:]))
    assert set(failed) == {"closed"} and set(failed["closed"].faces) <= set(range(5)) and len(failed["closed"].faces) == 4
    assert "open along 4 sides" in failed["closed"].sentence and np.allclose(failed["closed"].where[:, 0], -0.02)


def test_a_face_that_looks_the_wrong_way_is_not_closed():
    faces = (Face(CUBE.faces[0].outer[::-1]), *CUBE.faces[1:])
    assert set(broken(Polyhedron(CUBE.vertices, faces))) == {"closed"}


@pytest.mark.parametrize(("bend", "broke"), [(2e-4, False), (1e-3, True)])
def test_a_bent_face_is_pointed_at_with_how_much_and_where(bend, broke):
    corners = np.array(CUBE.vertices)
    corners[7, 2] += bend  # bends the top; the walls only lengthen
    failed = broken(Polyhedron(corners, CUBE.faces))
    assert set(failed) == ({"planar"} if broke else set())
    if broke:
        top = int(np.argmax(CUBE.normals[:, 2]))
        assert failed["planar"].faces == (top,) and f"Face {top} is bent by 0.25 mm" in failed["planar"].sentence


@pytest.mark.parametrize("height", [0.05, 0.03])  # the one has no area at all
def test_an_outline_that_crosses_itself(height):
    bow = [[0, 0], [0.05, 0.05], [0.05, 0], [0, height]]
    corners = np.array([[x, y, z] for z in (0.0, 0.03) for x, y in bow])
    sides = tuple(Face((k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k)) for k in range(4))
    assert set(broken(Polyhedron(corners, (Face((3, 2, 1, 0)), Face((4, 5, 6, 7)), *sides)))) >= {"outlines"}


def test_bodies_that_cross_and_bodies_apart():
    apart = together(CUBE, moved(CUBE, transform(translation=(0.2, 0.0, 0.0))))
    assert set(broken(apart)) == {"one body"} and broken(apart)["one body"].faces == tuple(range(6))
    crossed = broken(together(CUBE, moved(CUBE, transform(translation=(0.021, 0.022, 0.023)))))
    assert set(crossed) == {"one body", "crossing"} and "passes through itself" in crossed["crossing"].sentence


def test_thin_walls_and_slivers():
    sheet = box((0.1, 0.1, 0.0006))
    thin = broken(sheet)
    top, bottom = int(np.argmax(sheet.normals[:, 2])), int(np.argmin(sheet.normals[:, 2]))
    assert set(thin) == {"thin"} and set(thin["thin"].faces) == {top, bottom} and "0.6 mm thin" in thin["thin"].sentence
    notched = prism([[0, 0], [0.05, 0], [0.05, 0.03], [0.0502, 0.03], [0.0502, 0.05], [0, 0.05]], 0.04)
    assert set(broken(notched)) == {"sliver"} and "0.2 mm" in broken(notched)["sliver"].sentence
    assert not broken(prism([[0, 0], [0.06, 0], [0, 0.01]], 0.04))  # a sharp wedge is no thin wall


def test_a_part_of_metres_or_micrometres_is_the_wrong_size():
    assert {c.name for c in solid_checks(box((5.0, 1.0, 1.0))) if not c.ok} == {"size"}
    assert "size" in {c.name for c in solid_checks(box((5e-4, 5e-4, 5e-4))) if not c.ok}
