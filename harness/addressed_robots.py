"""Connects the robots of a site that have addresses: over HTTP, by a broker, and their evidence apart from them."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

from harness.adapters.clock import REAL_TIME, RobotClock
from harness.adapters.providers.http.addressed import AddressedRobot, Refusal, addressed_over_http
from harness.adapters.providers.http.robot import HttpRobot
from harness.adapters.providers.topics.connection import topic_witness
from harness.adapters.providers.topics.ros_messages import ROLES
from harness.adapters.providers.topics.samples import TopicFrames
from harness.adapters.providers.vda5050.connection import BrokerAccess, connected_vehicle, listened_vehicle
from harness.adapters.providers.vda5050.robot import VehicleRobot, VehicleSettings
from harness.adapters.providers.witnessed_stack import WitnessedStack
from harness.adapters.stores.folder import DataFolder
from harness.assembly import (
    Member,
    Parts,
    local_services,
)
from harness.contracts import ports
from harness.contracts.admissions import admission_stream
from harness.contracts.capabilities import CapabilityCard, Vocabulary
from harness.contracts.errors import ContractInvalid, ProviderFailed
from harness.contracts.ids import RobotId
from harness.contracts.reasons import Reason
from harness.gate.admissions import DECIDER as ADMISSION
from harness.projections.admissions import Admissions
from harness.projections.mission import Mission
from harness.workspace.files import AddressedEntry, EvidencePath, HttpRobotEntry, VehicleEntry
from harness.workspace.reading import Workspace, password_of, token_of

CONNECT_S = 5.0
"""The longest that one exchange with a robot at an address may take, wall seconds."""


def connected_robots(
    stack: ExitStack,
    store: ports.EventStore,
    entries: Sequence[AddressedEntry],
    workspace: Workspace,
    folder: DataFolder,
) -> tuple[list[tuple[AddressedEntry, AddressedRobot]], dict[RobotId, Reason]]:
    """The robots that answer at their addresses, and why the others are left out."""
    found: list[tuple[AddressedEntry, AddressedRobot]] = []
    absent: dict[RobotId, Reason] = {}
    for entry in entries:
        name = RobotId(entry.name)
        checks = [ADMISSION.codec.decode(one) for one in store.load(admission_stream(name))]
        admissions = ADMISSION.fold(ADMISSION.initial, checks)
        try:
            refusal = partial(_refusal, vocabulary=workspace.vocabulary, admissions=admissions, address=entry.identity)
            if isinstance(entry, VehicleEntry):
                robot = _addressed_vehicle(stack, entry, workspace, folder, refusal=refusal)
            else:
                robot = _addressed_over_http(stack, entry, workspace, refusal=refusal)
        except (ProviderFailed, ContractInvalid) as error:
            absent[name] = error.reason
            continue
        found.append((entry, robot))
    return found, absent


def _refusal(card: CapabilityCard, *, vocabulary: Vocabulary, admissions: Admissions, address: str) -> Reason | None:
    """Why a provider is not used here: its capability is not declared at this site, or the kit did not admit it."""
    return vocabulary.refusal(card) or admissions.refusal(card, address=address)


def _addressed_over_http(
    stack: ExitStack, entry: HttpRobotEntry, workspace: Workspace, *, refusal: Refusal
) -> AddressedRobot:
    """The robot of an entry, and what gives its evidence where the entry names that."""
    return addressed_over_http(
        _client(stack, entry, workspace),
        name=entry.name,
        refusal=refusal,
        speed_limit_mps=entry.speed_limit_mps,
        camera=entry.camera,
        witness=_witness(stack, entry.evidence, workspace) if entry.evidence is not None else None,
    )


def _client(stack: ExitStack, address: HttpRobotEntry | EvidencePath, workspace: Workspace) -> HttpRobot:
    opened = HttpRobot(address.address, token_of(address, workspace.folder), timeout_s=CONNECT_S)
    stack.callback(opened.close)
    return opened


def _witness(
    stack: ExitStack, path: EvidencePath, workspace: Workspace
) -> Callable[[ports.Robot, ports.Clock], ports.Robot]:
    """What gives the evidence of a robot apart from who executes: another program, or the robot's own topics."""
    transport, topics = path.kind, path.topics
    if transport == "http" or topics is None:
        return lambda robot, clock: _client(stack, path, workspace)
    named = {role: name for role in ROLES if (name := getattr(topics, role)) is not None}
    frames = TopicFrames(
        frame=workspace.site.frame,
        map_version=workspace.site.map_version,
        base_frame=path.base_frame,
        laser=path.laser,
    )

    def opened(robot: ports.Robot, clock: ports.Clock) -> ports.Robot:
        return stack.enter_context(
            topic_witness(
                robot,
                transport=transport,
                address=path.address,
                token=token_of(path, workspace.folder),
                topics=named,
                frames=frames,
                now_s=lambda: clock.now().mission_s,
            )
        )

    return opened


def _addressed_vehicle(
    stack: ExitStack, entry: VehicleEntry, workspace: Workspace, folder: DataFolder, *, refusal: Refusal
) -> AddressedRobot:
    vehicle = stack.enter_context(met_vehicle(entry, workspace, folder.root))
    clock = RobotClock(vehicle.now_s, REAL_TIME)
    return AddressedRobot(
        vehicle,
        name=entry.name,
        refusal=refusal,
        clock=clock,
        witness=_witness(stack, entry.evidence, workspace)(vehicle, clock) if entry.evidence is not None else None,
        speed_limit_mps=entry.speed_limit_mps,
        camera=entry.camera,
    )


def met_vehicle(entry: VehicleEntry, workspace: Workspace, data: Path) -> AbstractContextManager[VehicleRobot]:
    """A vehicle of a site by its broker; what it is asked is remembered in the data folder. Raises as
    `connected_vehicle` does."""
    settings, broker = _vehicle_settings(entry, workspace), _broker_access(entry, workspace)
    return connected_vehicle(settings, broker, journal=data / "vehicles" / f"{entry.name}.jsonl")


def _vehicle_settings(entry: VehicleEntry, workspace: Workspace) -> VehicleSettings:
    """Which vehicle an entry means, on the site's map."""
    return VehicleSettings(
        name=entry.name,
        interface=entry.interface,
        manufacturer=entry.manufacturer,
        serial_number=entry.serial_number,
        version=entry.version,
        frame=workspace.site.frame,
        map_version=workspace.site.map_version,
        map_id=entry.map_id,
        base_m=entry.base_m,
        velocity_measured=entry.velocity == "measured",
        speed_limit_mps=entry.speed_limit_mps,
    )


def _broker_access(entry: VehicleEntry, workspace: Workspace) -> BrokerAccess:
    """Where a vehicle's broker is, and who asks. Raises ContractInvalid for a password that is not there."""
    return BrokerAccess(
        address=entry.address,
        user=entry.user,
        password=password_of(entry, workspace.folder),
        authority_file=str(workspace.folder / entry.authority_file) if entry.authority_file else "",
    )


@contextmanager
def observed_robot(entry: AddressedEntry, workspace: Workspace) -> Iterator[ports.ObservedRobot]:
    """A robot in shadow mode, to be read until the block ends. Raises as connecting it does."""
    with ExitStack() as stack:
        yield read_only(stack, entry, workspace)


def read_only(stack: ExitStack, entry: AddressedEntry, workspace: Workspace) -> ports.ObservedRobot:
    """The robot of an entry, to be read and nothing else, until the stack closes."""
    if isinstance(entry, VehicleEntry):
        listened = stack.enter_context(
            listened_vehicle(_vehicle_settings(entry, workspace), _broker_access(entry, workspace))
        )
        if entry.evidence is None:
            return listened
        clock = RobotClock(listened.now_s, REAL_TIME)
        return WitnessedStack(listened, _witness(stack, entry.evidence, workspace)(listened, clock))
    client = _client(stack, entry, workspace)
    if entry.evidence is None:
        return client
    clock = RobotClock(lambda: client.status().at_s, REAL_TIME)
    return WitnessedStack(client, _witness(stack, entry.evidence, workspace)(client, clock))


def addressed_member(parts: Parts, entry: AddressedEntry, robot: AddressedRobot, folder: DataFolder) -> Member:
    def configure(mission: Mission) -> None:
        """A robot of its own world has nothing to configure."""

    own = replace(parts, clock=robot.clock)
    beside = local_services(own, camera=robot.status().camera, folder=folder.root, robot_id=entry.name)
    return Member(
        robot_id=RobotId(entry.name),
        robot=robot,
        clock=robot.clock,
        local=beside.providers,
        sources=beside.sources,
        configure=configure,
        camera=robot.live_camera,
        hand=robot.hand if isinstance(entry, HttpRobotEntry) and entry.teleoperation else None,
        origin=entry.identity,
        evidence_origin=entry.evidence.address if entry.evidence else "",
        embodiment=entry.embodiment or robot.embodiment,
    )
