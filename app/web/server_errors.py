"""The outermost middleware: logs an unexpected failure and answers it like every other failure."""

import logging

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.auth.rate_limits import TooLarge
from app.web.errors import refused

LOG = logging.getLogger(__name__)


class ServerErrorMiddleware:
    """ASGI middleware within the doorkeeper, so that even this answer carries its headers.

    What the doorkeeper itself answers goes on to it. An answer that has begun cannot be taken back: then the exception
    goes on to the server, which closes the line.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        has_begun = False

        async def relay(message: Message) -> None:
            nonlocal has_begun
            has_begun = True
            await send(message)

        try:
            await self._app(scope, receive, relay)
        except TooLarge:
            raise
        except Exception:
            if scope["type"] != "http" or has_begun:
                raise
            LOG.exception("unforeseen method=%s path=%s", scope["method"], scope["path"])
            await refused(scope, status=500, code="unexpected")(scope, receive, send)
