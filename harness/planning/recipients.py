"""Binds the stages of a contract that send messages to a channel of the site (D46). Pure.

Of a channel that nobody can read back, the delivery is declared by its provider and no more: the stage says so, and so
does the end of the mission.
"""

from collections.abc import Sequence

from msgspec import UNSET
from msgspec.structs import replace

from harness.contracts.effects import Condition, Symbolic
from harness.contracts.places import Site, SiteChannel
from harness.contracts.readings import Clause
from harness.contracts.tasks import Node, TaskContract

SENDING = "deliver_message"
CHANNEL = "channel"
STORED, DECLARED = "message_stored", "delivered"


def recipient(clause: Clause | None, site: Site) -> SiteChannel | None:
    """The channel that a clause names; the site's default where it names none, and None where there is no default."""
    name = clause.object.id if clause is not None and clause.object and clause.object.kind == "channel" else ""
    chosen = (one for one in site.channels if (one.name == name if name else one.default))
    return next(chosen, None)


def sent_to(node: Node, channel: SiteChannel | None) -> Node:
    """The stage as it sends to this channel; unchanged where it sends nothing, or to the data folder's outbox."""
    if channel is None or SENDING not in node.capabilities:
        return node
    parameters = {**node.parameters, CHANNEL: channel.name}
    if channel.readable:
        conditions = tuple(of_channel(one, channel) for one in node.success_conditions)
        return replace(node, parameters=parameters, success_conditions=conditions)
    conditions = tuple(_declared(one) for one in node.success_conditions)
    named = tuple(one.condition_id for one in conditions if _is(one, DECLARED))
    return replace(
        node,
        parameters=parameters,
        success_conditions=conditions,
        evidence=replace(node.evidence, declared=named or UNSET),
    )


def of_channel(condition: Condition, channel: SiteChannel | None) -> Condition:
    """A condition on a stored message, of this channel and no other."""
    effect = condition.effect
    if channel is None or not isinstance(effect, Symbolic) or effect.predicate != STORED:
        return condition
    arguments = {**effect.arguments, CHANNEL: f"{CHANNEL}:{channel.name}"}
    return replace(condition, effect=replace(effect, arguments=arguments))


def by_default(contract: TaskContract, site: Site) -> TaskContract:
    """A contract without a reading: everything is sent to the site's default channel."""
    channel = recipient(None, site)
    if channel is None:
        return contract
    return replace(
        contract,
        nodes=tuple(sent_to(node, channel) for node in contract.nodes),
        completion_conditions=_all_of(contract.completion_conditions, channel),
    )


def _all_of(conditions: Sequence[Condition], channel: SiteChannel) -> tuple[Condition, ...]:
    return tuple(of_channel(one, channel) if channel.readable else one for one in conditions)


def _declared(condition: Condition) -> Condition:
    """What the channel acknowledged, in place of what it holds."""
    effect = condition.effect
    if not isinstance(effect, Symbolic) or effect.predicate != STORED:
        return condition
    text = "The channel acknowledged the message and its pictures"
    return replace(condition, text=text, effect=replace(effect, predicate=DECLARED))


def _is(condition: Condition, predicate: str) -> bool:
    return condition.effect.predicate == predicate
