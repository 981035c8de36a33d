"""The workbench in the browser. The only room that imports viser."""

import os

from handey_studio.session import Session
from handey_studio.world import Library


def run(
    session: Session | str | os.PathLike,
    *,
    library: Library,
    host: str = "127.0.0.1",
    port: int = 8080,
    open_browser: bool = False,
) -> None:
    """Run the workbench on a session (a value, a path or a name in the library) until interrupted.

    Raises BadInput with one sentence when the session cannot be opened or the port is taken.
    """
    # Imported here because the planner's own process imports this package as well, and needs no web server.
    from handey_studio.app.server import serve, start

    serve(start(session, library=library, host=host, port=port), open_browser)


__all__ = ["run"]
