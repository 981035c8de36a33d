"""Starting the workbench: the address, the session, the browser."""

import errno
import logging
import os
import socket
import threading
import webbrowser
from functools import partial
from pathlib import Path

import viser

from handey_studio.app.autosave import Offer, left_behind
from handey_studio.app.planner import Run
from handey_studio.app.wire import close_share_tunnel
from handey_studio.app.workbench import Workbench
from handey_studio.base import BadInput
from handey_studio.motion import warm_up
from handey_studio.session import Session, find_session, looking, read_session
from handey_studio.session.ahead import compile_beside, rehearse
from handey_studio.session.run import run_session
from handey_studio.world import Library

DEFAULT_HOST, DEFAULT_PORT = "127.0.0.1", 8080


def start(
    session: Session | str | os.PathLike,
    *,
    library: Library,
    host: str = DEFAULT_HOST,
    port: int = DEFAULT_PORT,
    run: Run = run_session,
) -> Workbench:
    """Start the workbench on a session, given as a value, a path or a name in the library; it runs in threads of its own.

    Raises BadInput when the session cannot be opened or the port is taken.
    """
    path: Path | None = None
    if not isinstance(session, Session):
        path = find_session(library, session)
        session = read_session(path)
    robot = library.robot(session.workcell.robot)
    check_port(host, port)
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL)  # a probe of the port is no news for the terminal
    server = viser.ViserServer(host=host, port=port, label="Handey Studio", verbose=False)
    if server.get_port() != port:
        server.stop()
        raise _port_taken(host, port)
    close_share_tunnel(server)
    prepare = partial(warm_up, robot) if run is run_session else None
    workbench = Workbench(server, library, session, path, run, prepare)
    left = left_behind(library)
    if left is not None:
        workbench.send(Offer(left))
    workbench.start()
    threading.Thread(target=looking.warm_up, name="warm-up", daemon=True).start()
    return workbench


def serve(workbench: Workbench, open_browser: bool) -> None:
    """Stay until interrupted. On a machine where all is new, what a MOVE needs is compiled meanwhile."""
    compile_beside(rehearse, workbench.state.session, workbench.state.library)
    if open_browser:
        webbrowser.open(f"http://{workbench.server.get_host()}:{workbench.server.get_port()}")
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        pass
    finally:
        workbench.stop()


def check_port(host: str, port: int) -> None:
    """Raises BadInput when the address cannot be listened on."""
    if not 0 < port < 65536:
        raise BadInput(f"port {port} does not exist; choose one from 1024 to 65535 with --port.")
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            if error.errno in (errno.EADDRINUSE, errno.EACCES):
                raise _port_taken(host, port) from None
            raise BadInput(f'the address "{host}" cannot be listened on: {error.strerror}; 127.0.0.1 is this machine.') from None


def _port_taken(host: str, port: int) -> BadInput:
    return BadInput(f"port {port} on {host} is in use or not allowed; choose another with --port, such as --port {port % 65000 + 1}.")
