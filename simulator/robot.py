"""The simulated robot: providers, observations and journals over one simulated world, in this process."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from harness.contracts import protocol
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.control import Posture
from harness.contracts.errors import FencingRefused, ProviderFailed, ProviderUnreachable
from harness.contracts.ids import Digest, MissionId, ProviderId, RequestId
from harness.contracts.reasons import because
from harness.contracts.values import digest
from harness.provider_protocol.journal import JournalEntry, RequestJournal
from harness.provider_protocol.parameters import parameter_problems
from simulator.camera import CAMERA
from simulator.cards import CARDS
from simulator.faults import DUPLICATE_AFTER_S, Fault
from simulator.invocations import RunningSkill, restarted
from simulator.journals import StartJournal
from simulator.picture_cache import LIVE, live_frame
from simulator.room import SimulatedRoom
from simulator.site_map import map_of
from simulator.skills import skill_for
from simulator.world import World, WorldSettings

HAND = ProviderId("hand")
"""Whose invocations are a person's driving; nobody can be routed to it."""
FORSAKEN_S = 2.5
"""Mission time without a keepalive after which nobody is thought to come back to a motion: it was stopped long before.
"""


class SimulatedRobot:
    """Implements `contracts.ports.Robot`; `advance_to` moves its time. One thread at a time.

    With a `folder`, journals and world survive the process; without one everything stays in memory.
    """

    def __init__(self, settings: WorldSettings, folder: Path | None = None, *, robot_id: str = "vbot-1") -> None:
        self.robot_id = robot_id
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
        self.world = World(settings, folder, name=robot_id)
        self.room = SimulatedRoom(robot_id)
        self._map = map_of(self.world.site)
        self._journal = RequestJournal(folder and folder / "requests.jsonl")
        self._starts = StartJournal(folder and folder / "starts.jsonl")
        self._running: dict[RequestId, RunningSkill] = {}
        self._attended_s = self.world.at_s
        self.lying = False
        self._repeats: list[tuple[float, CapabilityCard, protocol.StartRequest]] = []
        self._providers = tuple(SimulatedProvider(self, card) for card in CARDS)
        for report in list(self._journal.reports.values()):
            if report.status not in protocol.TERMINAL:
                self._journal.write(JournalEntry(report=restarted(report)))

    @property
    def at_s(self) -> float:
        """Mission time now."""
        return self.world.at_s

    @property
    def unattended_s(self) -> float:
        """Mission time since somebody last read the sensors or kept an invocation alive.

        Where a motion is under way, time since it was kept alive: another thread may read the sensors while its
        supervisor is far behind, and its deadline would pass meanwhile. A motion that nobody comes back to counts no
        more after FORSAKEN_S.
        """
        mover = self._mover()
        if mover is None or mover.card.provider_id == HAND:
            return self.world.at_s - self._attended_s
        silent_s = mover.silent_s(self.world.at_s)
        return max(self.world.at_s - self._attended_s, silent_s if silent_s < FORSAKEN_S else 0.0)

    @property
    def moving(self) -> bool:
        """Whether the body is not still, or an invocation that the watchdog does not hold may move it."""
        mover = self._mover()
        return not self.world.body.state.still or (mover is not None and not mover.held_still)

    def providers(self) -> Sequence["SimulatedProvider"]:
        return self._providers

    def status(self) -> protocol.RobotStatus:
        world, mover = self.world, self._mover()
        return protocol.RobotStatus(
            robot_id=self.robot_id,
            at_s=world.at_s,
            posture=self._posture(),
            armed=mover is not None and mover.report().status in ("accepted", "running", "stopping"),
            hardware_stop=world.hardware_stop,
            charge=world.sensors.charge,
            localised=world.sensors.localised,
            map_version=world.site.map_version,
            camera=CAMERA,
            pose_age_s=world.ring.pose_age_s(world.at_s),
            driven_by=mover.request.identity.request_id if mover is not None and mover.card.provider_id == HAND else "",
        )

    def picture(self) -> protocol.Picture:
        """What the camera sees from where the body is, for people: it is neither a sample nor evidence."""
        state = self.world.body.state
        pose = (state.x_m, state.y_m, state.yaw_rad)
        width, height = LIVE.width_px, LIVE.height_px
        return protocol.Picture(
            at_s=self.at_s, width_px=width, height_px=height, body=live_frame(self.world.site, pose, tilt=state.tilt)
        )

    def observations(self, after: int, limit: int = 5000) -> protocol.Observations:
        self.attend()
        return self.world.ring.after(after, limit=limit, at_s=self.world.at_s)

    def attend(self) -> None:
        """Whoever supervises the robot has come this far."""
        self._attended_s = self.world.at_s

    def blob(self, digest: Digest) -> bytes:
        return self.world.blobs.get(digest)

    def starts(self) -> Sequence[protocol.PhysicalStart]:
        return self._starts.all()

    def configure(self, mission_id: MissionId, seed: int, faults: Sequence[Fault]) -> None:
        """Begin a mission: its seed for every stream of chance, its faults, its own truth file."""
        self.world.configure(mission_id, seed, faults)

    def struck(self) -> dict[str, int]:
        """How often each fault of the configured mission really occurred."""
        return dict(self.world.faults.struck)

    def advance_to(self, mission_s: float) -> float:
        """Let the world run to the first tick at or after mission time `mission_s`; returns the time reached."""
        while self.world.at_s < mission_s - 1e-6:
            self._tick()
        return self.world.at_s

    def press_hardware_stop(self, *, engaged: bool) -> None:
        """The red button on the robot: independent of all software, it holds the body still while engaged."""
        self.world.hardware_stop = engaged

    def requests(self) -> Sequence[protocol.StartRequest]:
        """Everything that was asked of it, for an adjudicator."""
        return tuple(self._journal.requests.values())

    def rest(self, posture: Posture) -> None:
        """Lie down, or stand up: after a fall only if the legs can do it, and it stands only once it is seen to."""
        body = self.world.body
        if body.state.fallen and (posture == "lying" or not body.stand_up()):
            raise ProviderFailed(because("robot_fallen"), where=self.robot_id)
        self.lying = posture == "lying"

    def clear_way(self) -> None:
        """Somebody comes: takes away what stands in the robot's way, and sets a fallen robot on its feet."""
        self.world.clear_way()

    def save(self) -> None:
        """Write the world durably."""
        self.world.save(durable=True)

    def begin(self, card: CapabilityCard, request: protocol.StartRequest) -> protocol.InvocationReport:
        """Start once per request id. Raises ProviderFailed, FencingRefused, or ProviderUnreachable by a fault."""
        known = self.find(request.identity.request_id)
        if known is not None:
            self._same(card, request)
            return known
        self._check(card, request)
        if card.moves and self.world.body.state.fallen:
            raise ProviderFailed(because("robot_fallen"), where=card.provider_id)
        self.lying = self.lying and not card.moves
        world = self.world
        skill = skill_for(
            card,
            request,
            frame=world.site.frame,
            here=world.believed,
            site_map=self._map,
            reached_m=world.reached_m.get(_way(request)),
        )
        invocation = RunningSkill(card, request, skill, at_s=world.at_s)
        self.take_up(invocation, JournalEntry(report=invocation.report(), request=request))
        if card.capability == "navigate" and world.faults.strikes("duplicate-request"):
            self._repeats.append((world.at_s + DUPLICATE_AFTER_S, card, request))
            raise ProviderUnreachable(because("acknowledgement_lost"), where=card.provider_id)
        return invocation.report()

    def take_up(self, invocation: RunningSkill, entry: JournalEntry) -> None:
        """Starts physically: writes the journals first, then starts in the world with the next tick."""
        self._journal.write(entry)
        identity = invocation.request.identity
        self._starts.write(protocol.physical_start(identity, at_s=self.world.at_s, moves=invocation.card.moves))
        self._running[identity.request_id] = invocation
        self.world.invocation_starts(invocation, _way(invocation.request))

    def running(self, request: RequestId) -> RunningSkill | None:
        """The invocation of a request, while it is not terminal."""
        return self._running.get(request)

    def find(self, request: RequestId) -> protocol.InvocationReport | None:
        """The newest report on a request, or None if it never came here."""
        running = self._running.get(request)
        return running.report() if running is not None else self._journal.reports.get(request)

    def report(self, handle: str) -> protocol.InvocationReport:
        """Raises ProviderFailed for an unknown handle."""
        found = self.find(RequestId(handle.partition(":")[2]))
        if found is None or found.handle != handle:
            raise ProviderFailed(because("handle_unknown", handle=handle), where=self.robot_id)
        return found

    def invocation(self, handle: str) -> RunningSkill | None:
        """The invocation if it still runs; raises ProviderFailed for an unknown handle."""
        return self._running.get(self.report(handle).identity.request_id)

    def _tick(self) -> None:
        world = self.world
        world.body.state.lying = self.lying
        world.tick(tuple(self._running.values()))
        for request, invocation in list(self._running.items()):
            if invocation.terminal:
                del self._running[request]
                self._journal.write(JournalEntry(report=invocation.report()))
                world.invocation_ended(invocation, _way(invocation.request))
        while self._repeats and self._repeats[0][0] <= world.at_s:
            _, card, repeated = self._repeats.pop(0)
            self.begin(card, repeated)

    def _posture(self) -> protocol.BodyPosture:
        if self.world.body.state.fallen:
            return "fallen"
        return "moving" if not self.world.still else "lying" if self.lying else "standing"

    def _mover(self) -> RunningSkill | None:
        return next((invocation for invocation in self._running.values() if invocation.card.moves), None)

    def _same(self, card: CapabilityCard, request: protocol.StartRequest) -> None:
        first = self._journal.requests[request.identity.request_id]
        if _request_digest(first) != _request_digest(request):
            reason = because("request_changed", request_id=request.identity.request_id)
            raise ProviderFailed(reason, where=card.provider_id)

    def _check(self, card: CapabilityCard, request: protocol.StartRequest) -> None:
        named = f"{request.identity.provider_id} / {request.capability}"
        own = f"{card.provider_id} / {card.capability}"
        problems = (
            *([because("request_misdirected", named=named, own=own)] if named != own else []),
            *parameter_problems(card, request.parameters),
            *(
                because("fencing_token_missing", resource=name)
                for name in card.resources
                if name not in request.fencing
            ),
        )
        if problems:
            raise ProviderFailed(problems[0], where=card.provider_id)
        self.admit(request.fencing, where=card.provider_id, moves=card.moves)

    def admit(self, fencing: Mapping[str, int], *, where: str, moves: bool = True) -> None:
        """Raises FencingRefused for an old token, and ProviderFailed for a motion while something else moves."""
        for resource, token in fencing.items():
            newest = self._journal.tokens.get(resource, token)
            if token < newest:
                reason = because("fencing_token_old", token=token, resource=resource, newest=newest)
                raise FencingRefused(reason, where=where)
        mover = self._mover()
        if moves and mover is not None:
            raise ProviderFailed(because("base_held", handle=mover.handle), where=where)


class SimulatedProvider:
    """One provider of the simulated robot, in this process."""

    def __init__(self, robot: SimulatedRobot, card: CapabilityCard) -> None:
        self._robot, self._card = robot, card

    @property
    def card(self) -> CapabilityCard:
        return self._card

    def start(self, request: protocol.StartRequest) -> protocol.InvocationReport:
        return self._robot.begin(self._card, request)

    def report(self, handle: str) -> protocol.InvocationReport:
        return self._robot.report(handle)

    def find(self, request: RequestId) -> protocol.InvocationReport | None:
        return self._robot.find(request)

    def keepalive(self, handle: str) -> None:
        self._robot.attend()
        invocation = self._robot.invocation(handle)
        if invocation is not None:
            invocation.keepalive(self._robot.at_s)

    def resume(self, handle: str) -> protocol.InvocationReport:
        invocation = self._robot.invocation(handle)
        if invocation is not None:
            invocation.resume(self._robot.at_s)
        return self._robot.report(handle)

    def stop(self, handle: str) -> protocol.InvocationReport:
        invocation = self._robot.invocation(handle)
        if invocation is not None:
            invocation.stop()
        return self._robot.report(handle)


def _way(request: protocol.StartRequest) -> str:
    """Identifies a node's route, so that what an earlier attempt covered of it counts."""
    identity = request.identity
    return f"{identity.mission_id}/{identity.node_id}/{digest(request.parameters.get('route', ()))[:12]}"


def _request_digest(request: protocol.StartRequest) -> str:
    """What makes two requests the same: who asks for what. The state version may move between repeats (D1)."""
    return digest([request.identity, request.capability, request.parameters, request.blobs])
