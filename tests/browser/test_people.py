"""People at the door: signing in, being slowed down, seeing without acting, and an admin's pages, in a browser."""

from collections.abc import Iterator
from threading import Thread

import pytest
import uvicorn
from playwright.sync_api import Page, Response, expect
from pydantic import SecretStr

from app.auth.accounts import FREE_TRIES
from app.auth.permissions import ROLES
from app.main import bind
from app.settings import ConsoleSettings
from tests.browser.conftest import ConsoleWatch, OpenPage, TakePicture
from tests.builders.consoles import OWNER, Stand, console_stand
from tests.builders.people import PASSWORD, SETTING_UP, standing_watch
from tests.builders.timeouts import TIMEOUT_S

REFUSED = r"the server responded with a status of 4(01|03|22|29)"


@pytest.fixture
def served() -> Iterator[tuple[Stand, str]]:
    """A console with somebody of every role, a mission under way and a question, on a port of its own."""
    with bind(0) as listener:
        port = listener.getsockname()[1]
        settings = ConsoleSettings(
            port=port, robots=("vbot-1",), owner_token=SecretStr(OWNER), password_memory_kib=19456
        )
        with console_stand(settings=settings) as stand:
            stand.handed_off()
            stand.driving()
            for role in ("admin", *(one for one in ROLES if one != "admin")):
                stand.app.state.sessions.accounts.add(f"the-{role}", roles=[role], password=PASSWORD, by=SETTING_UP)
            server = uvicorn.Server(uvicorn.Config(stand.app, log_level="error", timeout_graceful_shutdown=2))
            thread = Thread(target=server.run, kwargs={"sockets": [listener]})
            thread.start()
            yield stand, f"http://127.0.0.1:{port}"
            stand.app.state.console.broker.close()
            server.should_exit = True
            thread.join(timeout=TIMEOUT_S)


def sign_in(page: Page, name: str, password: str = PASSWORD) -> None:
    page.get_by_label("Name").fill(name)
    page.get_by_label("Password").fill(password)
    page.get_by_role("button", name="Sign in").click()


def no_faults(page: Page) -> list[str]:
    """Answers of the server that say that it broke, as they come."""
    faults: list[str] = []

    def look(answer: Response) -> None:
        if answer.status >= 500:
            faults.append(f"{answer.status} {answer.url}")

    page.on("response", look)
    return faults


def test_a_person_signs_in_with_a_password_and_is_slowed_down_after_wrong_ones(
    served: tuple[Stand, str], open_page: OpenPage, take_picture: TakePicture, console_watch: ConsoleWatch
) -> None:
    console_watch.expect(REFUSED)
    watch = standing_watch(served[0])
    page = open_page(f"{served[1]}/")
    expect(page.get_by_role("heading", name="You are not signed in")).to_be_visible()
    page.get_by_role("link", name="Sign in").click()
    take_picture(page, "people-sign-in")
    for _ in range(FREE_TRIES):
        sign_in(page, "the-operator", "wrong password")
        expect(page.get_by_role("alert")).to_contain_text("do not belong together")
    sign_in(page, "the-operator", PASSWORD)
    expect(page.get_by_role("alert")).to_contain_text("Too many wrong passwords")
    take_picture(page, "people-throttled")
    watch[0] += 1.1
    sign_in(page, "the-operator")
    expect(page.get_by_role("heading", level=1)).to_be_visible()
    expect(page.locator("#bar")).to_contain_text("operating: the-operator")
    expect(page.get_by_role("link", name="Start a mission", exact=True)).to_be_visible()


def test_a_viewer_sees_everything_and_changes_nothing(
    served: tuple[Stand, str], open_page: OpenPage, take_picture: TakePicture, console_watch: ConsoleWatch
) -> None:
    console_watch.expect(REFUSED)
    stand, url = served
    page = open_page(f"{url}/account/sign-in", width=390, height=844, scheme="dark")
    faults = no_faults(page)
    take_picture(page, "people-sign-in-phone-dark")
    sign_in(page, "the-viewer")
    expect(page.locator("#rail")).to_be_visible()
    mission = stand.harness.runtime.missions()[0]
    before = stand.harness.runtime.head()
    for path in ("/", "/missions", f"/missions/{mission.mission_id}", "/handoffs", "/audit", "/account"):
        page.goto(url + path)
        expect(page.get_by_role("heading", level=1)).to_be_visible()
        expect(page.get_by_role("link", name="Start a mission")).to_have_count(0)
        expect(page.locator("#bar button.stop:not([disabled])")).to_have_count(0)
    take_picture(page, "people-account-phone-dark")
    page.goto(f"{url}/missions/{mission.mission_id}/stop")
    expect(page.locator("#main")).to_contain_text("Your role does not let you stop a robot from here")
    expect(page.locator("#main form")).to_have_count(0)
    page.goto(f"{url}/account/people")
    expect(page.get_by_role("heading", level=1)).to_contain_text("Your role does not let you")
    assert stand.harness.runtime.head() == before
    assert faults == []


def test_an_admin_adds_somebody_makes_a_token_and_reads_the_trail(
    served: tuple[Stand, str], open_page: OpenPage, take_picture: TakePicture
) -> None:
    url = served[1]
    page = open_page(f"{url}/account/sign-in")
    faults = no_faults(page)
    sign_in(page, "the-admin")
    expect(page.locator("#rail")).to_be_visible()
    page.goto(f"{url}/account")
    take_picture(page, "people-account")
    page.get_by_role("link", name="People and tokens").click()
    adding = page.get_by_role("region", name="Add somebody")
    adding.get_by_label("Name").fill("newcomer")
    adding.get_by_label("First password").fill("one very long sentence")
    adding.get_by_role("button", name="Add").click()
    expect(page.get_by_role("region", name="People", exact=True)).to_contain_text("newcomer")
    tokens = page.get_by_role("region", name="Tokens of robots and integrations")
    tokens.get_by_label("Name of the robot").fill("dock")
    tokens.get_by_label("read").check()
    tokens.get_by_role("button", name="Make it").click()
    secret = page.locator(".callout pre")
    expect(secret).to_contain_text("regen_")
    take_picture(page, "people-people")
    page.goto(f"{url}/account/people")
    expect(secret).to_have_count(0)
    page.goto(f"{url}/audit?everything=true&verify=true")
    expect(page.locator("main")).to_contain_text("intact")
    take_picture(page, "people-audit", whole=False)
    page.goto(f"{url}/audit/access")
    expect(page.locator("main")).to_contain_text("account.added")
    take_picture(page, "people-access")
    phone = open_page(f"{url}/account/sign-in", width=390, height=844)
    sign_in(phone, "the-admin")
    expect(phone.locator("#rail")).to_be_visible()
    phone.goto(f"{url}/account/people")
    assert phone.evaluate("document.documentElement.scrollWidth <= innerWidth")
    take_picture(phone, "people-people-phone")
    phone.goto(f"{url}/audit?everything=true")
    assert phone.evaluate("document.documentElement.scrollWidth <= innerWidth")
    take_picture(phone, "people-audit-phone", whole=False)
    assert faults == []
