"""Commands that a person may give at a handoff; the handoff service adds the current state before the gate decides."""

from harness.contracts import handoff_commands
from harness.contracts.commands import ApproveHandoff, AttestHandoff, RejectHandoff

PersonCommand = (
    ApproveHandoff
    | RejectHandoff
    | AttestHandoff
    | handoff_commands.TakeClaim
    | handoff_commands.DropClaim
    | handoff_commands.ExtendDeadline
    | handoff_commands.TakeControl
    | handoff_commands.ReturnControl
    | handoff_commands.CloseQuestion
    | handoff_commands.LookAgain
    | handoff_commands.ChooseAction
)
