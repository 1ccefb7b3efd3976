"""Acts on leases: free what is in quarantine."""

from typing import Any

from app.acts import base
from harness.contracts import commands


class FreeLeaseAct(base.Act):
    """Free a resource whose holder nobody can account for: only while its robot is shown at rest."""

    becomes = commands.FreeLease
    reason: base.Reason

    def fields(self) -> dict[str, Any]:
        """What shows the robot at rest is measured by whoever frees it, never said."""
        return {"reason": self.reason, "static": {}}
