"""A person signs in at an identity provider, in a browser: by the button, there, and back to what they wanted."""

import re
from collections.abc import Iterator
from threading import Thread

import pytest
import uvicorn
from playwright.sync_api import expect

from app.main import bind
from tests.browser.conftest import ConsoleWatch, OpenPage, TakePicture
from tests.browser.test_accessible import CONTRAST, LEVELS, SIZES, broken
from tests.builders.consoles import Stand, console_stand
from tests.builders.oidc_console import trusting
from tests.builders.people import PASSWORD, SETTING_UP
from tests.builders.timeouts import TIMEOUT_S
from tests.fakes.issuer import ADA, Issuer, issuing

REFUSED = r"the server responded with a status of 40[13]"


@pytest.fixture
def served() -> Iterator[tuple[Stand, Issuer, str]]:
    """A console with an admin, an issuer on another port, and the console's address."""
    with issuing() as issuer, bind(0) as listener:
        port = listener.getsockname()[1]
        with console_stand(settings=trusting(issuer, port=port)) as stand:
            stand.app.state.sessions.accounts.add("the-admin", roles=["admin"], password=PASSWORD, by=SETTING_UP)
            server = uvicorn.Server(uvicorn.Config(stand.app, log_level="error", timeout_graceful_shutdown=2))
            thread = Thread(target=server.run, kwargs={"sockets": [listener]})
            thread.start()
            yield stand, issuer, f"http://127.0.0.1:{port}"
            stand.app.state.console.broker.close()
            server.should_exit = True
            thread.join(timeout=TIMEOUT_S)


@pytest.mark.parametrize("scripts", [True, False])
def test_a_person_signs_in_at_the_issuers_page_and_lands_where_they_wanted_to_go(
    served: tuple[Stand, Issuer, str], open_page: OpenPage, take_picture: TakePicture, console_watch: ConsoleWatch,
    scripts: bool,
) -> None:  # fmt: skip
    console_watch.expect(REFUSED)
    _, issuer, url = served
    page = open_page(f"{url}/missions?everything=true", scripts=scripts)
    expect(page.get_by_role("heading", name="You are not signed in")).to_be_visible()
    page.get_by_role("link", name="Sign in").click()
    take_picture(page, "identity-sign-in")
    if scripts:
        assert broken(page, LEVELS) == []
    page.get_by_role("link", name="Sign in with Example ID").click()
    expect(page.get_by_role("heading", name="The issuer")).to_be_visible()
    assert page.url.startswith(f"{issuer.url}/authorize?")
    page.get_by_role("button", name="I am ada").click()
    expect(page).to_have_url(f"{url}/missions?everything=true")
    expect(page.get_by_role("heading", level=1)).to_have_text("Missions")
    expect(page.locator("#bar")).to_contain_text("operating: ada")
    kept = {one["name"]: one for one in page.context.cookies(url)}
    assert [one["sameSite"] for name, one in kept.items() if name.startswith("regen_session")] == ["Strict"]
    assert not [name for name in kept if name.startswith("regen_sign_in")]
    page.goto(f"{url}/account")
    page.get_by_role("button", name="Sign out everywhere").click()
    expect(page).to_have_url(re.compile(r"/account/sign-in\?left=true$"))
    page.get_by_role("link", name="Sign out of Example ID too").click()
    expect(page).to_have_url(f"{url}/account/sign-in")
    expect(page.get_by_label("Password")).to_be_visible()


def test_a_stranger_reads_why_they_are_not_let_in_and_whom_to_ask(
    served: tuple[Stand, Issuer, str], open_page: OpenPage, take_picture: TakePicture, console_watch: ConsoleWatch
) -> None:
    console_watch.expect(REFUSED)
    _, issuer, url = served
    issuer.person = {**ADA, "groups": ["visitors"]}
    page = open_page(f"{url}/account/sign-in", width=390, height=844, scheme="dark")
    page.get_by_role("link", name="Sign in with Example ID").click()
    page.get_by_role("button", name="I am ada").click()
    expect(page.get_by_role("alert")).to_contain_text("you have no role in this console")
    expect(page.get_by_role("alert")).to_contain_text("Ask an admin of this console")
    take_picture(page, "identity-refused-phone-dark")
    assert [wrong for rules in (LEVELS, CONTRAST, SIZES) for wrong in broken(page, rules)] == []
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.goto(f"{url}/missions")
    expect(page.get_by_role("heading", name="You are not signed in")).to_be_visible()
