"""The union of the events of all streams."""

from harness.contracts.admissions import RobotChecked
from harness.contracts.alert_events import AlertEvent
from harness.contracts.control import ControlEvent
from harness.contracts.erasure_events import BlobErased
from harness.contracts.events import MissionEvent
from harness.contracts.goal_proposals import GoalProposalEvent
from harness.contracts.handoff_events import HandoffEvent
from harness.contracts.lease_events import LeaseEvent
from harness.contracts.maps import CloudAttached
from harness.contracts.place_events import PlaceEvent
from harness.contracts.shadow import ShadowEvent
from harness.contracts.site_events import SiteEvent

AnyEvent = (
    MissionEvent
    | LeaseEvent
    | HandoffEvent
    | ControlEvent
    | CloudAttached
    | AlertEvent
    | PlaceEvent
    | RobotChecked
    | GoalProposalEvent
    | BlobErased
    | ShadowEvent
    | SiteEvent
)
