"""The page is for this machine: who may connect, and what is served."""

from __future__ import annotations

import http.client
from collections.abc import Iterator
from typing import Any

import pytest

from sfm_front.live_page.access import is_own

viser = pytest.importorskip("viser")


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Iterator[Any]:
    from sfm_front.live_page.server import LivePage

    with LivePage(tmp_path_factory.mktemp("empty"), 18180) as served:
        yield served


def port_of(page: Any) -> int:
    return int(page.address.rpartition(":")[2])


def get(page: Any, path: str) -> tuple[int, bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", port_of(page), timeout=10)
    connection.putrequest("GET", path, skip_host=False)
    connection.endheaders()
    answer = connection.getresponse()
    return answer.status, answer.read()


@pytest.mark.parametrize(
    ("origin", "own"),
    [
        (None, True),
        ("http://127.0.0.1:8080", True),
        ("http://localhost:9000", True),
        ("http://[::1]:8080", True),
        ("https://example.org", False),
        ("http://127.0.0.1.example.org:8080", False),
        ("http://localhost@example.org", False),
        ("null", False),
        ("http://[", False),
    ],
)
def test_only_pages_of_this_machine_are_own(origin, own):
    assert is_own(origin) is own


def test_it_listens_on_this_machine_alone(page):
    assert page._server.get_host() == "127.0.0.1"
    assert page.address.startswith("http://127.0.0.1:")


def test_another_page_takes_the_next_port(page, tmp_path):
    with type(page)(tmp_path, port_of(page)) as other:
        assert port_of(other) > port_of(page)


def test_the_page_is_served_and_nothing_else(page):
    status, body = get(page, "/")
    assert status == 200
    assert b"<html" in body
    for path in (
        "/../../../../../../../etc/passwd",
        "/%2e%2e/%2e%2e/%2e%2e/%2e%2e/%2e%2e/etc/passwd",
        "/..%5c..%5cpyproject.toml",
        "//etc/passwd",
        "/database.db",
    ):
        assert get(page, path)[0] == 404


def test_a_site_elsewhere_is_turned_away(page):
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect

    protocol = f"viser-v{viser.__version__}"
    address = page.address.replace("http", "ws")
    with connect(address, origin="https://example.org", subprotocols=[protocol]) as socket:
        with pytest.raises(ConnectionClosed) as closed:
            socket.recv(timeout=10)
        assert closed.value.rcvd.code == 1008
    with connect(address, origin=page.address, subprotocols=[protocol]) as socket:
        assert len(socket.recv(timeout=10)) > 100


def test_it_is_not_shared(page):
    assert page._server.request_share_url() is None
