"""Every event of every stream."""

from harness.contracts.events import MissionEvent
from harness.contracts.handoff_events import HandoffEvent
from harness.contracts.lease_events import LeaseEvent

AnyEvent = MissionEvent | LeaseEvent | HandoffEvent
