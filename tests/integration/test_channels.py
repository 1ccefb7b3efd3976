"""A goal that names a channel: where the finding goes, what is read back of it, and what is only declared."""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from click.testing import Result
from typer.testing import CliRunner

from app.cli.main import app
from harness.baseline import load
from tests.fakes.channel_services import (
    APP_KEY,
    APP_SECRET,
    CONVERSATION,
    ROBOT_CODE,
    DingTalkService,
    MailService,
    dingtalk,
    mail_service,
)

QUICK = ("--speed", "0", "--fidelity", "kinematic", "--seed", "3")
SECRETS = {"DING_KEY": APP_KEY, "DING_APP": APP_SECRET, "MAIL_PASSWORD": "mail-secret"}


class Site:
    """The simulated site as a folder of one's own, with a DingTalk group and a mailbox."""

    def __init__(self, folder: Path, group: DingTalkService, post: MailService) -> None:
        self.folder, self.data, self.group, self.post = folder / "site", folder / "data", group, post
        shutil.copytree(Path(load.__file__).with_name("site"), self.folder)
        account = {"host": "127.0.0.1", "encryption": "none"}
        password = {"environment": "MAIL_PASSWORD"}
        self.write(
            channels=[
                {
                    "kind": "dingtalk-app",
                    "name": "operations",
                    "aliases": ["operations group", "运维群"],
                    "address": group.address,
                    "media_address": group.address,
                    "app_key": {"environment": "DING_KEY"},
                    "app_secret": {"environment": "DING_APP"},
                    "robot_code": ROBOT_CODE,
                    "conversation": CONVERSATION,
                },
                {
                    "kind": "email",
                    "name": "duty",
                    "aliases": ["duty mailbox"],
                    "server": account | {"port": post.smtp_port},
                    "mailbox": account | {"port": post.imap_port, "user": "robot", "password": password},
                    "sender": "robot@example.org",
                    "recipients": ["duty@example.org"],
                },
            ]
        )

    def write(self, **content: Any) -> None:
        (self.folder / "channels.yaml").write_text(yaml.safe_dump(content, allow_unicode=True))

    def regen(self, *words: object) -> Result:
        return CliRunner(env=SECRETS).invoke(app, [str(word) for word in words])

    def ask(self, goal: str) -> tuple[Result, dict[str, Any]]:
        done = self.regen("mission", "run", goal, "--site", self.folder, "--data", self.data, *QUICK, "--json")
        return done, json.loads(done.stdout) if done.stdout.startswith("{") else {}


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    with dingtalk() as group, mail_service() as post:
        yield Site(tmp_path, group, post)


def test_mail_to_the_named_channel_is_read_back_and_the_goal_is_met(site: Site) -> None:
    done, outcome = site.ask("Check the office storage area and send it to the duty mailbox")
    assert done.exit_code == 0, done.output
    assert outcome["goal_verdict"] == "satisfied" and len(site.post.mails) == 1 and site.group.messages == []
    (sent,) = outcome["messages"]
    assert (sent["channel"], sent["images"], sent["shown"]) == ("duty", 4, "read_back")
    assert sent["ids"].endswith("@regenharness.invalid>") and sent["wall"] and len(sent["read_s"]) == 1
    told = next(one for one in outcome["clauses"] if one["told"] == "send the finding to duty mailbox")
    assert [one["condition_id"] for one in told["conditions"]] == ["goal.delivered"]


@pytest.mark.ledger(
    "R185", entry="command line", symbol="harness.adapters.providers.messaging.dingtalk:DingTalkApp.send"
)
def test_what_a_dingtalk_group_acknowledges_is_declared_and_never_more(site: Site) -> None:
    done, outcome = site.ask("检查办公室储物区,然后发给运维群")
    assert done.exit_code != 0
    assert (outcome["status"], outcome["goal_verdict"]) == ("partly_verified", "partly_verified")
    (sent,) = outcome["messages"]
    assert (sent["channel"], sent["shown"], sent["read_s"]) == ("operations", "declared", [])
    assert sent["ids"] == "query-1,query-2,query-3,query-4,query-5 query=SUCCESS read=2"
    receipts = [one for one in outcome["receipts"] if one["kind"] == "delivery"]
    assert len(receipts) == 5 and all("query-1" in one["text"] for one in receipts)
    assert {one["condition_id"] for one in outcome["declared_conditions"]} >= {"delivery.stored", "goal.delivered"}
    shown = [site.group.media[one["picture"]] for one in site.group.messages if "picture" in one]
    assert len(shown) == 4 and all(one.startswith(b"\xff\xd8\xff") for one in shown)


def test_a_mailbox_that_lies_never_meets_the_goal(site: Site) -> None:
    site.post.mood = "rewrites"
    done, outcome = site.ask("Check the office storage area and send it to the duty mailbox")
    assert done.exit_code == 3 and outcome["status"] == "awaiting_human"
    assert all(one["shown"] == "open" for one in outcome["messages"])


def test_a_channel_that_the_site_does_not_have_starts_nothing(site: Site) -> None:
    done, _ = site.ask("Check the office storage area and send it to the finance team")
    assert done.exit_code != 0
    assert json.loads(site.regen("mission", "list", "--data", site.data, "--json").stdout)["missions"] == []


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"channels": [{"kind": "fax", "name": "a"}]}, "channels.yaml:2"),
        ({"channels": [{"kind": "folder", "name": "a"}, {"kind": "folder", "name": "a"}]}, "stands twice"),
        ({"channels": [{"kind": "folder", "name": "a"}], "default": "b"}, "no channel b"),
        ({"channels": [{"kind": "apprise", "name": "a", "url": {}}]}, "environment or in a file"),
        ({"channels": [{"kind": "apprise", "name": "a", "url": "mailto://secret"}]}, "url"),
        ({"channels": [{"kind": "folder", "name": "a", "aliases": ["storage area"]}]}, "names two things"),
    ],
    ids=["kind", "twice", "default", "no-secret", "secret-in-file", "name-of-a-place"],
)
def test_a_channels_file_that_is_wrong_is_named_with_its_line(site: Site, content: dict[str, Any], said: str) -> None:
    site.write(**content)
    done = site.regen("check", site.folder)
    assert done.exit_code == 2 and said in done.output, done.output


def test_a_missing_secret_and_a_channel_without_read_back_are_notes(site: Site) -> None:
    done = CliRunner(env=dict.fromkeys(SECRETS, "")).invoke(app, ["check", str(site.folder)])
    assert done.exit_code == 0
    assert "DING_KEY" in done.output and "never verified" in done.output and "MAIL_PASSWORD" in done.output
