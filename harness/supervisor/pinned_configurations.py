"""Begins missions under the current configuration, and runs them only where their own can be read (D35)."""

import logging

from harness.contracts.any_events import AnyEvent
from harness.contracts.commands import ActivateMission, EndMission, RecompileContract
from harness.contracts.configuration import Configuration
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import ConfigurationMissing, ContractInvalid, UnknownName
from harness.contracts.ids import Digest
from harness.contracts.reasons import because
from harness.contracts.tasks import TaskContract
from harness.planning.compile import compile_again
from harness.planning.templates import by_name
from harness.projections.mission import Mission, required_contract
from harness.runtime import Runtime

LOG = logging.getLogger("regen.supervisor")


def begin(runtime: Runtime, mission: Mission) -> Accepted[AnyEvent] | Refused:
    """Activate, or first compile again if another configuration became current since (R163, D35).

    A goal that the current configuration cannot serve ends the mission before anything moved. A replay keeps its pin.
    Raises ConfigurationMissing if the current version cannot be read.
    """
    current = runtime.current_configuration_id(mission.robot_id)
    if mission.replay or mission.configuration == current:
        return runtime.submit(mission.mission_id, ActivateMission())
    try:
        return _again(runtime, mission, current)
    except (ContractInvalid, UnknownName) as error:
        why = because("not_compiled_under_current", configuration=current[:12], error=error.reason)
        return runtime.submit(mission.mission_id, EndMission(status="failed", reason=why))


def _again(runtime: Runtime, mission: Mission, current: Digest) -> Accepted[AnyEvent] | Refused:
    configuration = runtime.stored_configuration(current)
    contract = _recompiled(runtime, mission, configuration)
    command = RecompileContract(
        configuration=current,
        contract=contract,
        policy=configuration.recovery,
        trial=runtime.on_trial(current),
        rules=mission.rules if contract == mission.contract else runtime.rules,
    )
    return runtime.submit(mission.mission_id, command, records=(runtime.configuration_record(current),))


def _recompiled(runtime: Runtime, mission: Mission, configuration: Configuration) -> TaskContract:
    """The goal compiled with the version's own template; a template outside the versions is the same in all.

    A mission with a reading is compiled from it; one of an earlier release as it was begun (D62).
    """
    again = runtime.compiled_under(mission, configuration)
    if again is not None:
        return again
    contract = required_contract(mission)
    if mission.template not in {template.name for template in runtime.configuration_of(mission).templates}:
        return contract
    template = by_name(mission.template, configuration.templates)
    again_named = compile_again(contract, template=template, site=runtime.site, rules=runtime.rules)
    return runtime.checked(mission.robot_id, again_named)


def check_readable(runtime: Runtime, mission: Mission) -> None:
    """Raise ConfigurationMissing if this release cannot read the mission's pinned version; the mission is then not run.

    A stop is carried out whatever the mission is pinned to.
    """
    if not mission.ended and mission.status != "stopping":
        runtime.configuration_of(mission)


def tell_unreadable(runtime: Runtime) -> None:
    """Log every unfinished mission that is not run here, with its reason."""
    for one in runtime.unreadable():
        LOG.warning("not_run_here mission=%s robot=%s %s", one.mission_id, one.robot_id, one.reason)


def readable(runtime: Runtime, mission: Mission) -> bool:
    """Whether this release can continue the mission."""
    try:
        check_readable(runtime, mission)
    except ConfigurationMissing:
        return False
    return True
