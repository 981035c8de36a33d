"""`handey studio`: open the workbench."""

import argparse

from handey_studio.commands.arguments import DONE, port

NAME = "studio"
HELP = "open the workbench in the browser"


def add_arguments(studio: argparse.ArgumentParser) -> None:
    studio.add_argument("session", nargs="?", default="figure1", help="a session file, or its name in a library (default: figure1)")
    studio.add_argument("--host", default="127.0.0.1", help="address to listen on (default: 127.0.0.1, this machine only)")
    studio.add_argument("--port", type=port, default=8080, help="port to listen on (default: 8080)")


def run(given: argparse.Namespace) -> int:
    from handey_studio.app import run as serve
    from handey_studio.session import find_session
    from handey_studio.world import Library

    library = Library.choose(given.library)
    serve(find_session(library, given.session), host=given.host, port=given.port, library=library)
    return DONE
