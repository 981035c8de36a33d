"""The planner's process: results, cancel, breaking down, coming back. And the address the workbench listens on."""

import queue
import socket

import pytest

from handey_studio.app.planner import Failed, Finished, Planner, Progressed
from handey_studio.app.server import check_port, start
from handey_studio.base import BadInput
from tests.browser.planners import dying, patient, refusing
from tests.session.samples import fresh_session, library


@pytest.fixture
def planner_of():
    running = []

    def begin(run):
        heard = queue.Queue()
        running.append(Planner(run, heard.put))
        return running[-1], heard

    yield begin
    for planner in running:
        planner.stop()


def wait_for(heard, kind):
    while True:
        message = heard.get(timeout=60)
        if isinstance(message, kind):
            return message


def test_a_job_reports_is_cancelled_and_the_next_one_is_not(planner_of, tmp_path):
    planner, heard = planner_of(patient)
    session = fresh_session(tmp_path)
    for number in (1, 2):
        planner.order(number, session, library(tmp_path), False)
        assert wait_for(heard, Progressed).number == number
        planner.cancel()
        done = wait_for(heard, Finished)
        assert done.number == number and done.found.results[0].reason == "cancelled"
        assert done.found.parts == session.parts


def test_a_process_that_ends_is_told_and_replaced(planner_of, tmp_path):
    planner, heard = planner_of(dying)
    before = planner.pid
    planner.order(1, fresh_session(tmp_path), library(tmp_path), False)
    failed = wait_for(heard, Failed)
    assert failed.broken and "exit status 7" in failed.sentence
    planner.order(2, fresh_session(tmp_path), library(tmp_path), True)
    assert wait_for(heard, Finished).found.results[0].reason == "survived"
    assert planner.pid != before


def test_bad_input_comes_back_as_its_sentence(planner_of, tmp_path):
    planner, heard = planner_of(refusing)
    planner.order(1, fresh_session(tmp_path), library(tmp_path), False)
    assert "not to my taste" in wait_for(heard, Failed).sentence


def test_a_port_in_use_is_told_with_a_way_out(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(BadInput, match=f"port {port} on 127.0.0.1 is in use .* --port"):
            start(fresh_session(tmp_path), library=library(tmp_path), port=port)


@pytest.mark.parametrize(("host", "port"), [("127.0.0.1", 0), ("127.0.0.1", 70000), ("192.0.2.1", 8080), ("no.such.host.invalid", 8080)])
def test_an_address_that_cannot_be_is_told(host, port):
    with pytest.raises(BadInput):
        check_port(host, port)


def test_an_unknown_session_is_told_before_anything_starts(tmp_path):
    with pytest.raises(BadInput, match='session "nothing" is not known'):
        start("nothing", library=library(tmp_path), port=1)
