"""Acts on alerts: acknowledge, shelve, suppress, restore, assign."""

from collections.abc import Mapping
from typing import Annotated, ClassVar, Self

from pydantic import Field

from app.acts.base import Act, Count, Reason, Text
from app.i18n.catalogues import N_
from app.views.alerts import SHELF
from app.views.forms import Wrong
from harness.contracts import alert_commands
from harness.contracts.alert_events import LONGEST_SHELF_S


class AcknowledgeAlertAct(Act):
    """Acknowledge an alert. `seen` is the `total` that was shown; what happened since is not acknowledged."""

    becomes = alert_commands.AcknowledgeAlert
    seen: Count
    note: Text = ""


class ShelveAlertAct(Act):
    """Shelve an alert for a while; it returns by itself."""

    becomes = alert_commands.ShelveAlert
    sentences: ClassVar[Mapping[str, str]] = {"for_s": N_("Choose how long it is shelved for.")}
    reason: Reason
    for_s: Annotated[float, Field(gt=0, le=LONGEST_SHELF_S)]

    @classmethod
    def from_form(cls, typed: Mapping[str, str]) -> Self | tuple[Wrong, ...]:
        """A form chooses one of the times that the page offers."""
        offered = typed.get("for_s", "") in {str(seconds) for seconds, _ in SHELF}
        return super().from_form(typed if offered else {**typed, "for_s": ""})


class SuppressAlertAct(Act):
    """Suppress an alert until somebody restores it."""

    becomes = alert_commands.SuppressAlert
    reason: Reason


class RestoreAlertAct(Act):
    """Unshelve or unsuppress an alert."""

    becomes = alert_commands.RestoreAlert
    reason: Text = ""


class AssignAlertAct(Act):
    """Assign an alert to somebody; empty: to nobody."""

    becomes = alert_commands.AssignAlert
    assignee: Text = ""


ACTS: Mapping[str, type[Act]] = {
    "acknowledge": AcknowledgeAlertAct,
    "shelve": ShelveAlertAct,
    "suppress": SuppressAlertAct,
    "restore": RestoreAlertAct,
    "assign": AssignAlertAct,
}
"""By the word in the address."""
