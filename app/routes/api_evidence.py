"""/api/v1/evidence: the tombstone of a blob, and erasing one."""

from typing import Any

from app.acts.erasures import EraseBlobAct
from app.console import ConsoleDep
from app.routes import api_requests
from app.routes.evidence import DigestPath
from harness.contracts.decisions import Refused
from harness.contracts.erasure_events import BlobErased
from harness.contracts.errors import UnknownName
from harness.contracts.ids import Digest
from harness.contracts.reasons import because

router = api_requests.router("evidence", under="/evidence")


@router.get("/{digest}/erasure", responses=api_requests.answers(BlobErased))
def erasure(console: ConsoleDep, digest: DigestPath) -> Any:
    """Who erased a blob, when and why. 404 for one that was not erased."""
    found = console.runtime.erasure(Digest(digest))
    if found is None:
        raise UnknownName(because("blob_not_erased", digest=digest))
    return api_requests.plain(found)


@router.post("/{digest}/erase", responses=api_requests.answers(BlobErased))
def erase(console: ConsoleDep, digest: DigestPath, body: EraseBlobAct) -> Any:
    """Erase a photograph or a voice for good. What is erased already keeps its first tombstone."""
    decision = console.runtime.erase(Digest(digest), reason=body.reason)
    if isinstance(decision, Refused):
        return api_requests.refusal(decision)
    return api_requests.plain(console.runtime.erasure(Digest(digest)))
