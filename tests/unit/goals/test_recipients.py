"""Where a goal's message goes: the channel that it names, the site's default, and what is then only declared."""

import pytest
from msgspec.structs import replace

from harness.baseline.load import baseline, shipped_workspace, site
from harness.contracts.errors import GoalNotUnderstood
from harness.contracts.places import SiteChannel
from harness.contracts.tasks import Node, TaskContract
from harness.goals.spoken import spoken_vocabulary
from harness.goals.understanding import GoalRequest, compiled, understand

GROUP = SiteChannel(name="operations", aliases=("operations group", "运维群"))
MAILBOX = SiteChannel(name="duty", aliases=("duty mailbox",), readable=True)
TEMPLATES = (*baseline().templates, *shipped_workspace().missions)


def contract(goal: str, *channels: SiteChannel, template: str = "", confirm: str = "") -> TaskContract:
    here = replace(site(), channels=channels)
    found = understand(GoalRequest(text=goal, template=template, confirm=confirm), templates=TEMPLATES, site=here)
    return compiled(found, templates=TEMPLATES, site=here, arguments={})


def delivery(made: TaskContract) -> Node:
    return next(node for node in made.nodes if "deliver_message" in node.capabilities)


def channel_of(made: TaskContract) -> object:
    return delivery(made).parameters.get("channel")


CHECK = "Check the office storage area"


@pytest.mark.parametrize(
    "words",
    [
        "and send it to the operations group",
        "and then forward the finding to operations",
        "and notify the operations group",
    ],
)
def test_the_named_channel_is_bound_to_the_delivery(words: str) -> None:
    made = contract(f"{CHECK} {words}", GROUP, replace(MAILBOX, default=True))
    assert channel_of(made) == "operations"


@pytest.mark.parametrize("goal", ["检查办公室储物区,然后发给运维群", "检查办公室储物区,把结果发给运维群"])
def test_the_same_in_chinese(goal: str) -> None:
    assert channel_of(contract(goal, GROUP, MAILBOX)) == "operations"


def test_without_a_name_the_default_takes_it_and_without_a_default_the_outbox() -> None:
    assert channel_of(contract(CHECK, GROUP, replace(MAILBOX, default=True))) == "duty"
    assert channel_of(contract("", replace(MAILBOX, default=True), template="warehouse-inspection")) == "duty"
    assert channel_of(contract(CHECK, GROUP, MAILBOX)) is None
    assert contract(CHECK, GROUP).nodes == contract(CHECK).nodes, "a channel that is not asked for changes nothing"


def test_a_readable_channel_must_be_the_one_that_is_read() -> None:
    made = contract(f"{CHECK} and send it to the duty mailbox", MAILBOX)
    stage = [one.effect for one in delivery(made).success_conditions]
    goal = [one.effect for one in made.completion_conditions if one.effect.predicate == "message_stored"]
    assert [one.arguments["channel"] for one in (*stage, *goal)] == ["channel:duty"] * 2  # type: ignore[union-attr]
    assert not delivery(made).declared


def test_a_channel_that_cannot_be_read_declares_and_the_rest_is_still_tested() -> None:
    made = contract(f"{CHECK} and send it to the operations group", GROUP)
    node = delivery(made)
    assert [one.effect.predicate for one in node.success_conditions] == ["delivered"]
    assert node.declared == {one.condition_id for one in node.success_conditions}
    assert not any(other.declared for other in made.nodes if other is not node)


@pytest.mark.parametrize(
    "words",
    [
        "and send it to the finance team",
        "and send it to the storage area",
        "and send it to the operations group and the duty mailbox",
        "and send it to the operations group and send it to the duty mailbox",
        "and do not send it to the operations group",
        "and go to the operations group",
    ],
)
def test_what_no_channel_can_take_is_asked(words: str) -> None:
    with pytest.raises(GoalNotUnderstood):
        contract(f"{CHECK} {words}", GROUP, MAILBOX)


def test_a_speaker_is_expected_to_name_channels_only_to_send_to_them() -> None:
    expected = spoken_vocabulary(replace(site(), channels=(MAILBOX,)))
    with_channel = [sentence for sentence, _ in expected.sentences if "duty_mailbox" in sentence]
    assert with_channel and all("send" in sentence for sentence in with_channel)
