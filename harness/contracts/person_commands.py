"""What a person may say at a handoff. The desk adds what the harness knows before the gate decides it."""

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
