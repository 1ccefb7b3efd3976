"""Moves the event log from one database to another: the same events, positions and digests.

Blobs, spool and robots stay where they are, in the data folder. The log that is moved from is left as it was.
"""

from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

from harness.adapters.stores.log_address import is_server, open_log
from harness.adapters.stores.owner import OwnerLock
from harness.adapters.stores.sql_engine import file_url
from harness.adapters.stores.sql_log import SqlLog
from harness.contracts.errors import LogDamaged, StoreUnavailable
from harness.contracts.ports import LogHead
from harness.contracts.reasons import because


def move_log(source: str, target: str) -> LogHead:
    """Copy every event and record of `source` into the empty log at `target`, verified at both ends.

    Raises LogDamaged if either does not verify, StoreOwned if a supervisor runs on either, StoreUnavailable if the
    source is not there, the target is not empty, or somebody appends meanwhile. The target then stays empty.
    """
    if source == target:
        raise StoreUnavailable(because("log_moved_onto_itself"), where="--to")
    if not is_server(source) and not Path(file_url(source).database or "").is_file():
        raise StoreUnavailable(because("no_log_to_move"), where=str(file_url(source).database))
    with ExitStack() as stack:
        old, new = (stack.enter_context(_owned(url)) for url in (source, target))
        head = new.fill_from(old)
        verified = new.verify()
        if verified != head:
            raise LogDamaged(
                because("copy_incomplete", position=verified.position, expected=head.position), where=new.where
            )
    return head


@contextmanager
def _owned(url: str) -> Iterator[SqlLog]:
    """The open log, and for a file the ownership of its data folder: no supervisor runs on it meanwhile."""
    with ExitStack() as stack:
        if not is_server(url):
            folder = Path(file_url(url).database or "").absolute().parent
            stack.enter_context(OwnerLock(folder)).take(token="")
        yield stack.enter_context(closing(open_log(url)))
