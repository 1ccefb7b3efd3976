"""A region is rendered once for everybody who may see the same, and never again after the next signal."""

import asyncio
from collections.abc import Callable

import pytest
from starlette.types import Message, Receive, Scope, Send

from app.auth.permissions import Principal
from app.i18n.languages import CHOICE, LanguageChoice
from app.web.response_cache import LASTS_S, ResponseCache

HEAD = "/missions/msn_1/head"
ADA, BOB = Principal(name="ada", roles=("operator",)), Principal(name="bob", roles=("operator",))
EVE = Principal(name="eve", roles=("viewer",))


class Console:
    """Routes that count their renders, and the readers in front of them."""

    def __init__(self, status: int = 200) -> None:
        self.renders, self.changes, self.now_s, self.status = 0, 0, 0.0, status
        self.held = asyncio.Event()
        self.held.set()
        self.door = ResponseCache(self._routes, changes=lambda: self.changes, clock=lambda: self.now_s)

    async def ask(
        self, principal: Principal = ADA, path: str = HEAD, *, query: bytes = b"", language: str = "en"
    ) -> str:
        told: list[bytes] = []
        state = {"principal": principal}
        scope = {"type": "http", "method": "GET", "path": path, "query_string": query, "state": state}

        async def send(message: Message) -> None:
            told.append(message.get("body", b""))

        async def receive() -> Message:
            return {"type": "http.request"}

        CHOICE.set(LanguageChoice(language))
        await self.door(scope, receive, send)
        return b"".join(told).decode()

    async def _routes(self, scope: Scope, receive: Receive, send: Send) -> None:
        self.renders += 1
        number = self.renders
        await self.held.wait()
        await send({"type": "http.response.start", "status": self.status, "headers": []})
        await send({"type": "http.response.body", "body": f"render {number}".encode()})


def shown(act: Callable[[Console], object], console: Console | None = None) -> Console:
    """The console after an async story."""
    made = console or Console()
    asyncio.run(act(made))  # type: ignore[arg-type]
    return made


def test_a_hundred_browsers_cost_one_render() -> None:
    async def story(console: Console) -> None:
        console.held.clear()
        asked = [asyncio.create_task(console.ask(ADA if one % 2 else BOB)) for one in range(100)]
        await asyncio.sleep(0)
        console.held.set()
        assert set(await asyncio.gather(*asked)) == {"render 1"}
        assert await console.ask() == "render 1"

    assert shown(story).renders == 1


def test_after_a_signal_nobody_is_shown_what_was_rendered_before_it() -> None:
    async def story(console: Console) -> None:
        assert await console.ask() == "render 1"
        console.changes += 1
        assert await console.ask() == "render 2"
        console.now_s += LASTS_S
        assert await console.ask() == "render 3"

    shown(story)


def test_a_render_that_a_signal_overtook_is_not_given_to_who_asks_after_it() -> None:
    async def story(console: Console) -> None:
        console.held.clear()
        early = asyncio.create_task(console.ask())
        await asyncio.sleep(0)
        console.changes += 1
        late = asyncio.create_task(console.ask())
        await asyncio.sleep(0)
        console.held.set()
        assert (await early, await late) == ("render 1", "render 2")

    shown(story)


@pytest.mark.parametrize(
    ("principal", "path", "query", "language"),
    [
        (EVE, HEAD, b"", "en"),
        (ADA, HEAD, b"", "zh-Hans"),
        (ADA, HEAD, b"at=4", "en"),
        (ADA, "/missions/msn_2/head", b"", "en"),
    ],
)
def test_roles_language_instant_and_mission_are_never_mixed(
    principal: Principal, path: str, query: bytes, language: str
) -> None:
    async def story(console: Console) -> None:
        assert await console.ask() == "render 1"
        assert await console.ask(principal, path, query=query, language=language) == "render 2"

    shown(story)


def test_what_names_its_reader_is_shared_with_nobody_else_and_questions_with_nobody_at_all() -> None:
    async def story(console: Console) -> None:
        assert await console.ask(ADA, "/overview/bar") == await console.ask(ADA, "/overview/bar")
        assert await console.ask(BOB, "/overview/bar") == "render 2"
        assert await console.ask(ADA, "/handoffs/hof_1/question") == "render 3"
        assert await console.ask(ADA, "/handoffs/hof_1/question") == "render 4"
        assert await console.ask(ADA, "/missions/msn_1") == "render 5"

    shown(story)


def test_a_refusal_is_not_kept() -> None:
    async def story(console: Console) -> None:
        await console.ask()
        await console.ask()

    assert shown(story, Console(status=404)).renders == 2
