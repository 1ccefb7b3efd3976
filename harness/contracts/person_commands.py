"""Commands that a person may give at a handoff; the handoff service adds the current state before the gate decides."""

from harness.contracts.commands import ApproveHandoff, AttestHandoff, RejectHandoff
from harness.contracts.handoff_commands import (
    ChooseAction,
    CloseQuestion,
    DropClaim,
    ExtendDeadline,
    LookAgain,
    ReturnControl,
    TakeClaim,
    TakeControl,
)

PersonCommand = (
    ApproveHandoff
    | RejectHandoff
    | AttestHandoff
    | TakeClaim
    | DropClaim
    | ExtendDeadline
    | TakeControl
    | ReturnControl
    | CloseQuestion
    | LookAgain
    | ChooseAction
)
