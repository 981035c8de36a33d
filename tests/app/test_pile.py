"""What stands in the cell before the first scan."""

from dataclasses import replace

import numpy as np
import viser

from handey_studio.app.scene.pile import PileScene, solid_of
from handey_studio.app.state import State
from handey_studio.cell import TrueBody
from handey_studio.session import find_session, read_session
from handey_studio.session.run import cell_of, station_of
from handey_studio.task import sense
from handey_studio.world import Library
from tests.browser.conftest import free_port

LIBRARY = Library.choose()


def test_bodies_have_their_shape():
    session = read_session(find_session(LIBRARY, "figure1"))
    for body in session.workcell.setup.bodies:
        part = solid_of(session, LIBRARY, body)
        assert part is not None
        if body.size is not None:
            assert np.allclose(np.ptp(part.solid.vertices, axis=0), body.size)
        else:
            assert part.name == body.part
    assert solid_of(session, LIBRARY, TrueBody("gear", np.eye(4), part="gear")) is None


def test_the_pile_is_shown_until_there_is_a_scan():
    session = read_session(find_session(LIBRARY, "figure1"))
    scanned = sense(station_of(session, LIBRARY), cell_of(session, LIBRARY))
    server = viser.ViserServer(host="127.0.0.1", port=free_port(), verbose=False)
    try:
        scene = PileScene(server)
        before = state_of(session)
        scene.render(None, before)
        assert len(scene._frames) == len(session.workcell.setup.bodies) and all(frame.visible for frame in scene._frames)
        scene.render(before, state_of(session, scanned))
        assert not any(frame.visible for frame in scene._frames)
    finally:
        server.stop()


def state_of(session, scene=None) -> State:
    return State(LIBRARY, replace(session, scene=scene), LIBRARY.robot("ur5"))
