import importlib.util
from pathlib import Path

import numpy as np
import pytest

from handey_studio.base import BadInput
from handey_studio.geometry import Polyhedron
from handey_studio.world import Library
from handey_studio.world.importing import ImportOptions, import_part

HEAD = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION((''),'2;1');
FILE_NAME('','',(''),(''),'','','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN'));
ENDSEC;
DATA;
"""
LIBRARY = Library.choose()


def step_of(solid: Polyhedron) -> str:
    """The solid as a faceted boundary representation (ISO 10303-42) in millimetres."""
    lines: list[str] = []

    def add(text: str) -> str:
        lines.append(f"#{len(lines) + 1}={text};")
        return f"#{len(lines)}"

    points = [add("CARTESIAN_POINT('',({:.6f},{:.6f},{:.6f}))".format(*(1e3 * p))) for p in solid.vertices]
    faces = []
    for face in solid.faces:
        bounds = []
        for k, loop in enumerate(face.loops):
            ring = add(f"POLY_LOOP('',({','.join(points[c] for c in loop)}))")
            bounds.append(add(f"{'FACE_BOUND' if k else 'FACE_OUTER_BOUND'}('',{ring},.T.)"))
        corner, x, z = (solid.face_frame(solid.faces.index(face))[:3, k] for k in (3, 0, 2))
        place, up, along = (
            add("{}('',({:.9f},{:.9f},{:.9f}))".format(kind, *values))
            for kind, values in (("CARTESIAN_POINT", 1e3 * corner), ("DIRECTION", z), ("DIRECTION", x))
        )
        frame = add(f"AXIS2_PLACEMENT_3D('',{place},{up},{along})")
        plane = add(f"PLANE('',{frame})")
        faces.append(add(f"FACE_SURFACE('',({','.join(bounds)}),{plane},.T.)"))
    shell = add(f"CLOSED_SHELL('',({','.join(faces)}))")
    return _product(add, add(f"FACETED_BREP('',{shell})"), lines)


def _product(add, brep: str, lines: list[str]) -> str:
    """What STEP wants around a shape: units, a context, a product."""
    mm = add("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))")
    rad = add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")
    sr = add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")
    near = add(f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-06),{mm},'distance_accuracy_value','')")
    space = add(
        f"(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({near}))"
        f"GLOBAL_UNIT_ASSIGNED_CONTEXT(({mm},{rad},{sr}))REPRESENTATION_CONTEXT('',''))"
    )
    shape = add(f"FACETED_BREP_SHAPE_REPRESENTATION('',({brep}),{space})")
    about = add("APPLICATION_CONTEXT('automotive design')")
    context = add(f"PRODUCT_CONTEXT('',{about},'mechanical')")
    product = add(f"PRODUCT('part','part','',({context}))")
    formation = add(f"PRODUCT_DEFINITION_FORMATION('','',{product})")
    stage = add(f"PRODUCT_DEFINITION_CONTEXT('part definition',{about},'design')")
    definition = add(f"PRODUCT_DEFINITION('','',{formation},{stage})")
    whole = add(f"PRODUCT_DEFINITION_SHAPE('','',{definition})")
    add(f"SHAPE_DEFINITION_REPRESENTATION({whole},{shape})")
    return HEAD + "\n".join(lines) + "\nENDSEC;\nEND-ISO-10303-21;\n"


@pytest.mark.skipif(importlib.util.find_spec("cascadio") is None, reason="the optional extra is not installed")
@pytest.mark.parametrize("name", sorted(LIBRARY.part_files()))
def test_a_step_file_tells_its_own_unit(name, tmp_path):
    truth = LIBRARY.part(name).solid
    (tmp_path / "thing.step").write_text(step_of(truth))
    made = import_part(tmp_path / "thing.step", ImportOptions())
    off = np.linalg.norm(made.part.solid.vertices[:, None] - truth.vertices, axis=2).min(axis=1)
    assert off.max() < 1e-6 and len(made.part.solid.faces) == len(truth.faces)
    (tmp_path / "broken.stp").write_text("ISO-10303-21;\nHEADER;\n")
    with pytest.raises(BadInput, match=r"broken\.stp.* Open CASCADE"):
        import_part(tmp_path / "broken.stp", ImportOptions())


def test_without_the_extra_a_sentence_says_what_to_install(tmp_path, monkeypatch):
    def missing(name: str):
        raise ImportError(name)

    monkeypatch.setattr("handey_studio.world.step_files.importlib.import_module", missing)
    path: Path = tmp_path / "thing.step"
    path.write_text("")
    with pytest.raises(BadInput, match=r"pip install 'handey-studio\[step\]'; or export it as STL"):
        import_part(path, ImportOptions())
