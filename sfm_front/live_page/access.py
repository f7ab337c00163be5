"""Who may see the page: browsers on this machine, and only the page itself in them.

Any site that is open in a browser may ask it for a connection to this machine, and would be sent
photos. Browsers say which site asks.
"""

from __future__ import annotations

from urllib.parse import urlsplit

import viser

_LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})


def keep_private(server: viser.ViserServer) -> None:
    """Turn away connections that another site asks for, and requests to share the page."""
    websockets = server._websock_server

    async def check(connection: viser.infra.WebsockClientConnection) -> None:
        socket = websockets._live_connections.get(connection.client_id)
        if socket is not None and not is_own(socket.request.headers.get("Origin")):
            await socket.close(1008, "not from this page")

    websockets.on_client_connect(check)
    # A tunnel to a server of the library's makers, open to whoever has the address.
    server.request_share_url = _refuse


def _refuse(*_: object, **__: object) -> None:
    pass


def is_own(origin: str | None) -> bool:
    """Whether a page of this machine asks; what is no browser does not say, and may."""
    if origin is None:
        return True
    try:
        return urlsplit(origin).hostname in _LOOPBACK
    except ValueError:
        return False
