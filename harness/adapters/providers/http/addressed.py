"""A robot at an address, with those of its providers that were admitted, each with exactly the card that was tried."""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from msgspec.structs import replace

from harness.adapters.providers.http.clocks import clock_of
from harness.adapters.providers.http.robot import HttpRobot
from harness.contracts import protocol
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import Digest, ProviderId
from harness.contracts.observations import Camera
from harness.contracts.ports import Clock, LiveCamera, Provider, Robot, Teleoperable
from harness.contracts.reasons import Reason, because
from harness.provider_protocol.delegation import DelegatingProvider

SPEED_CAP = "speed_cap_mps"
ANY_BODY = "any"
Refusal = Callable[[CapabilityCard], Reason | None]


class CardedRobot(Robot, Protocol):
    """A robot that says what its cards are now, not only what they were when it was connected."""

    def cards(self) -> Sequence[CapabilityCard]: ...


class AddressedRobot:
    """Implements `contracts.ports.Robot`. `refusal` says why a card is not used.

    `speed_limit_mps` lowers the bound of every card's speed cap; `camera` is used where the robot declares none.
    `witness` is another program at the same robot: condition, samples and blobs are then read there, and nowhere else.
    Raises ProviderUnreachable if nobody answers, ProviderFailed if another robot does, or what answers is no robot.
    """

    def __init__(
        self,
        client: CardedRobot,
        *,
        name: str,
        refusal: Refusal,
        clock: Clock,
        live_camera: LiveCamera | None = None,
        hand: Teleoperable | None = None,
        speed_limit_mps: float | None = None,
        camera: Camera | None = None,
        witness: Robot | None = None,
    ) -> None:
        self._client, self._camera = client, camera
        self._evidence: Robot = client if witness is None else witness
        for one in (client, self._evidence):
            status = one.status()
            if status.robot_id != name:
                raise ProviderFailed(because("another_robot_answers", found=status.robot_id[:80], expected=name))
        found = {one.card.provider_id: (one, refusal(one.card)) for one in client.providers()}
        self.unused: Mapping[ProviderId, Reason] = {
            name: reason for name, (_, reason) in found.items() if reason is not None
        }
        self._providers = tuple(
            AdmittedProvider(one, self._card, limit_mps=speed_limit_mps) for one, reason in found.values() if not reason
        )
        self.clock, self.live_camera, self.hand = clock, live_camera, hand

    @property
    def embodiment(self) -> str:
        """The body that its admitted cards are made for; empty where they fit any."""
        named = (one for provider in self._providers for one in provider.card.embodiments)
        return next((one for one in named if one != ANY_BODY), "")

    def providers(self) -> Sequence[Provider]:
        """Those that were admitted when the robot was connected."""
        return self._providers

    def status(self) -> protocol.RobotStatus:
        """The robot's own word, with the camera of the site's folder where it names none."""
        status = self._evidence.status()
        return status if status.camera is not None else replace(status, camera=self._camera)

    def observations(self, after: int, limit: int = 5000) -> protocol.Observations:
        return self._evidence.observations(after, limit)

    def blob(self, digest: Digest) -> bytes:
        return self._evidence.blob(digest)

    def starts(self) -> Sequence[protocol.PhysicalStart]:
        return self._client.starts()

    def _card(self, provider_id: ProviderId) -> CapabilityCard | None:
        return next((card for card in self._client.cards() if card.provider_id == provider_id), None)


class AdmittedProvider(DelegatingProvider):
    """One provider that was tried. Nothing is started under another card than the one that was admitted (D55)."""

    def __init__(
        self,
        provider: Provider,
        current: Callable[[ProviderId], CapabilityCard | None],
        *,
        limit_mps: float | None = None,
    ) -> None:
        super().__init__(provider)
        self._current, self._tried = current, provider.card
        self._card = _limited(provider.card, limit_mps)

    @property
    def card(self) -> CapabilityCard:
        return self._card

    def start(self, request: protocol.StartRequest) -> protocol.InvocationReport:
        """Raises ProviderFailed, with nothing sent, where the provider's card is another one by now."""
        name = self._tried.provider_id
        current = self._current(name)
        if current is None:
            raise ProviderFailed(because("provider_gone", provider_id=name))
        if current != self._tried:
            raise ProviderFailed(
                because("provider_card_changed", provider_id=name, version=self._tried.version, now=current.version)
            )
        return super().start(request)


def _limited(card: CapabilityCard, limit_mps: float | None) -> CapabilityCard:
    if limit_mps is None:
        return card
    parameters = tuple(
        replace(one, maximum=min(limit_mps, one.maximum if one.maximum is not None else limit_mps))
        if one.name == SPEED_CAP
        else one
        for one in card.parameters
    )
    return replace(card, parameters=parameters)


def addressed_over_http(
    client: HttpRobot,
    *,
    name: str,
    refusal: Refusal,
    speed_limit_mps: float | None = None,
    camera: Camera | None = None,
    witness: Callable[[Robot, Clock], Robot] | None = None,
) -> AddressedRobot:
    """A robot that serves the HTTP provider protocol; `witness` is made with it and its clock. Raises as
    AddressedRobot does."""
    clock = clock_of(client)
    return AddressedRobot(
        client,
        name=name,
        refusal=refusal,
        clock=clock,
        live_camera=client if _shows(client) else None,
        hand=client,
        speed_limit_mps=speed_limit_mps,
        camera=camera,
        witness=witness(client, clock) if witness is not None else None,
    )


def _shows(client: HttpRobot) -> bool:
    """Whether it serves a live picture, which the protocol leaves to it."""
    try:
        client.picture()
    except ProviderFailed:
        return False
    return True
