"""Acts on evidence: erase a photograph or a voice."""

from app.acts import base
from harness.contracts import erasure_events


class EraseBlobAct(base.Act):
    """Erase one photograph or voice. Its tombstone stays in the log with the reason; nothing brings the bytes back."""

    becomes = erasure_events.EraseBlob
    reason: base.Reason
