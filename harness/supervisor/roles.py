"""The state each role is shown, compiled from one state version, and the records of what it was shown."""

from typing import Any

from harness.contexts.view import StateView
from harness.contracts.contexts import Context
from harness.contracts.ports import Record
from harness.contracts.values import digest, encode
from harness.projections.mission import Mission, required_policy
from harness.runtime import Runtime
from harness.supervisor.crew import Crew
from harness.supervisor.senses import Senses


def record(kind: str, value: Any) -> Record:
    """An artefact of a decision, addressed by its content and stored with it (R77, R146)."""
    return Record(digest=digest(value), kind=kind, body=encode(value))


def context_record(context: Context) -> Record:
    return record(f"context/{context.role}", context)


class Roles:
    """Compiles the view that all four contexts are selected from."""

    def __init__(self, *, runtime: Runtime, crew: Crew, senses: Senses) -> None:
        self.runtime = runtime
        self.crew = crew
        self.senses = senses

    def view(self, mission: Mission) -> StateView:
        return StateView(
            mission=mission,
            at_s=self.crew.clock.now().mission_s,
            rules=self.runtime.configuration.context_rules,
            site=self.runtime.site,
            status=self.senses.status,
            recent=self.senses.recent,
            recovery=required_policy(mission),
        )
