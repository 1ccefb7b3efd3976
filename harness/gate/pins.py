"""Decides whether a mission may change its pinned configuration: only before it is active, by compiling again (D35).
Pure."""

from harness.contracts.commands import RecompileContract
from harness.contracts.decisions import Accepted, Decision, refused
from harness.contracts.events import ContractRecompiled, MissionEvent
from harness.contracts.reasons import because
from harness.contracts.tasks import check
from harness.contracts.values import digest
from harness.projections.mission import Mission, required_contract

BEFORE_ACTIVE = ("compiled", "awaiting_approval")


def recompile(mission: Mission, command: RecompileContract) -> Decision[MissionEvent]:
    """The same goal under another version. Approvals of the old contract no longer count: k advances.

    Raises ContractInvalid for a broken contract.
    """
    if mission.status not in BEFORE_ACTIVE or mission.replay:
        pinned = mission.configuration[:12]
        return refused("pinned", because("mission_pinned", status=mission.status, configuration=pinned))
    if command.configuration == mission.configuration:
        return Accepted(())
    if command.contract.goal != required_contract(mission).goal:
        return refused("another_goal")
    check(command.contract, rules=command.rules)
    again = ContractRecompiled(
        configuration=command.configuration,
        replaces=mission.configuration,
        contract=command.contract,
        contract_digest=digest(command.contract),
        policy=command.policy,
        trial=command.trial,
        rules=command.rules,
    )
    return Accepted((again,))
