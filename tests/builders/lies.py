"""Builds whole missions of the new rules in which one provider, channel, room or sensor lies."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field

from msgspec.structs import replace

from harness.adapters.clock import LockstepClock
from harness.adapters.ids import SeededIds
from harness.adapters.providers.messaging.channels import MessageChannel, SiteChannels
from harness.adapters.providers.messaging.memory import MemoryOutbox
from harness.adapters.providers.messaging.read_back import MemoryReader
from harness.adapters.stores.memory import MemoryBlobStore, MemoryEventStore, MemorySpool
from harness.assembly import local_services
from harness.bootstrap import NullSignals, Parts, assemble
from harness.contracts.observations import Scan
from harness.contracts.ports import BlobStore, Provider, Room
from harness.contracts.protocol import Observations
from harness.contracts.rules import RulesVersion
from harness.contracts.simulation import Fidelity
from harness.settings import HarnessSettings
from simulator.camera import CAMERA
from simulator.robot import SimulatedRobot
from simulator.site import TROLLEY, storage_site
from simulator.solids import SiteModel
from simulator.world import WorldSettings
from tests.builders.connections import CrewRobot, Stage
from tests.builders.missions_run import ROBOT

Liar = Callable[[Provider, BlobStore], Provider]
STRICT = 2
"""The rules under which nothing is committed on its provider's word."""


def honest(provider: Provider, blobs: BlobStore) -> Provider:
    """Every provider as it is."""
    return provider


@dataclass(frozen=True)
class Lie:
    """One lie: who tells it, and how. `seen` is the site as the camera sees it, the true one without it."""

    capability: str = ""
    tell: Liar = honest
    outbox: Callable[[], MemoryOutbox] = MemoryOutbox
    room: Callable[[Room], Room] = field(default=lambda room: room)
    seen: SiteModel | None = None
    old_sweeps: bool = False
    true_site: SiteModel | None = None


@contextmanager
def lied_to(
    lie: Lie, *, seed: int = 3, fidelity: Fidelity = "kinematic", rules: RulesVersion = STRICT
) -> Iterator[Stage]:
    """A harness on the simulated robot with this lie in it; everything else is as shipped."""
    with ExitStack() as stack:
        robot = SimulatedRobot(WorldSettings(fidelity=fidelity, seed=seed), robot_id=ROBOT)
        if lie.true_site is not None:
            robot.world.site = lie.true_site
            robot.world.body.furnish(lie.true_site)
        parts = Parts(
            store=MemoryEventStore(),
            blobs=MemoryBlobStore(),
            spool=MemorySpool(),
            ids=SeededIds(seed),
            clock=LockstepClock(robot.advance_to, at_s=robot.at_s),
            signals=NullSignals(),
            rules=rules,
        )
        outbox = lie.outbox()
        beside = local_services(
            parts,
            camera=CAMERA,
            folder=None,
            room=lie.room(robot.room),
            channels=SiteChannels(MessageChannel(outbox, MemoryReader(outbox))),
        )

        def told(provider: Provider) -> Provider:
            return lie.tell(provider, parts.blobs) if provider.card.capability == lie.capability else provider

        crew = CrewRobot(robot, told)
        crew.retouch = _old_sweeps() if lie.old_sweeps else crew.retouch

        def configure(mission: object) -> None:
            if lie.seen is not None:
                robot.world.site = lie.seen

        harness = assemble(
            stack,
            HarnessSettings(speed=0, fidelity=fidelity),
            parts,
            robot=crew,
            local=[told(provider) for provider in beside.providers],
            sources=beside.sources,
            configure=configure,
        )
        yield Stage(harness, robot, parts)


def emptied() -> SiteModel:
    """The site without anything in its passage."""
    site = storage_site()
    return replace(site, solids=tuple(one for one in site.solids if not one.name.startswith("box-passage")))


def hidden(*, everywhere: bool = False) -> SiteModel:
    """The empty passage behind a trolley: its floor is out of sight from the place of inspection, or from all sides."""
    _, half_y, half_z = TROLLEY.half_m
    return emptied().with_solids(replace(TROLLEY, half_m=(3.0, half_y, half_z)) if everywhere else TROLLEY)


def turned_round() -> SiteModel:
    """The site turned by half a circle around the place of inspection: what a camera sees that looks the other way."""
    site, (x, y) = storage_site(), (11.0, 8.557)
    return replace(
        site,
        solids=tuple(
            replace(one, centre_m=(2 * x - one.centre_m[0], 2 * y - one.centre_m[1], one.centre_m[2]))
            for one in site.solids
        ),
    )


def _old_sweeps() -> Callable[[Observations], Observations]:
    """The robot gives out its first sweep again and again, with a fresh stamp."""
    first: list[Scan] = []

    def retouch(seen: Observations) -> Observations:
        scans = [one for one in seen.samples if isinstance(one, Scan)]
        first.extend(scans[: 1 - len(first)])
        samples = tuple(
            replace(one, blob=first[0].blob, points=first[0].points) if isinstance(one, Scan) else one
            for one in seen.samples
        )
        return replace(seen, samples=samples)

    return retouch
