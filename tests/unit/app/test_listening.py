"""Where the console listens."""

import asyncio
import socket

from app.main import bind


def test_an_answer_in_two_pieces_does_not_wait_for_the_readers_acknowledgement() -> None:
    async def undelayed() -> bool:
        found: asyncio.Future[int] = asyncio.get_running_loop().create_future()

        def accepted(_reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            ours = writer.get_extra_info("socket")
            found.set_result(ours.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))
            writer.close()

        listener = bind(0)
        async with await asyncio.start_server(accepted, sock=listener):
            _, way = await asyncio.open_connection(*listener.getsockname())
            told = bool(await found)
            way.close()
            await way.wait_closed()
        return told

    assert asyncio.run(undelayed())
