"""Compiles the state each role is shown, from one state version, and records it."""

from collections.abc import Sequence
from typing import Any

from harness.contexts.view import StateView
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.contexts import Context, ContextRecord
from harness.contracts.ids import NodeId, sha256
from harness.contracts.observations import Pose
from harness.contracts.ports import Record
from harness.contracts.values import Point, encode
from harness.projections.memory import place_of
from harness.projections.mission import Mission, required_contract, required_policy
from harness.routing.history import RoutingHistory, SettingHistory
from harness.runtime import Runtime
from harness.supervisor.observations import ObservationBuffer
from harness.supervisor.robot_connection import RobotConnection


def record(kind: str, value: Any) -> Record:
    """An artefact of a decision, addressed by its content and stored with it (R77, R146)."""
    body = encode(value)
    return Record(digest=sha256(body), kind=kind, body=body)


def context_record(context: Context) -> Record:
    return Record(digest=context.digest, kind=f"context/{context.role}", body=context.body)


class RoleContexts:
    """Compiles the view that all four contexts are selected from."""

    def __init__(self, *, runtime: Runtime, connection: RobotConnection, observations: ObservationBuffer) -> None:
        self.runtime = runtime
        self.connection = connection
        self.observations = observations

    def view(self, mission: Mission) -> StateView:
        return StateView(
            mission=mission,
            at_s=self.connection.clock.now().mission_s,
            rules=self.runtime.configuration_of(mission).context_rules,
            site=self.runtime.site_of(mission),
            status=self.observations.status,
            recent=self.observations.recent,
            recovery=required_policy(mission),
            origins=dict(self.connection.origins),
        )

    def position(self) -> Point | None:
        """Where the localiser last saw the body, which is at rest between two stages; None if it has not recently."""
        poses = [one for one in self.observations.recent if isinstance(one, Pose)]
        return (poses[-1].x_m, poses[-1].y_m) if poses else None

    def place(self, mission: Mission, node_id: NodeId) -> str:
        """The id of the place a node works at; empty where none is known."""
        return place_of(required_contract(mission), node_id)

    def history(self, mission: Mission, node_id: NodeId, cards: Sequence[CapabilityCard]) -> RoutingHistory:
        """What memory holds of these providers in the node's setting: verified outcomes only (R60, D23)."""
        half_life, place = self._half_life(mission), self.place(mission, node_id)
        known = [
            (
                card,
                self.runtime.memory.history(
                    card, place=place, configuration=mission.configuration, half_life=half_life
                ),
            )
            for card in cards
        ]
        return RoutingHistory(
            settings=tuple(
                SettingHistory(
                    provider_id=card.provider_id,
                    capability=card.capability,
                    place=place,
                    configuration=mission.configuration,
                    sums=one.sums,
                    position=one.position,
                )
                for card, one in known
            )
        )

    def examples(self, mission: Mission, node_id: NodeId, card: CapabilityCard) -> tuple[ContextRecord, ...]:
        """Verified operational examples for C2, newest first (R139)."""
        return self.runtime.memory.examples(
            card,
            place=self.place(mission, node_id),
            configuration=mission.configuration,
            half_life=self._half_life(mission),
            limit=self.runtime.configuration_of(mission).context_rules.c2_examples,
        )

    def _half_life(self, mission: Mission) -> float:
        return self.runtime.configuration_of(mission).routing.history_half_life
