"""The log of a shift in the shared database, which says of each append that it was answered."""

from collections.abc import Callable, Sequence

from harness.adapters.stores.postgres import PostgresEventStore
from harness.contracts.ports import Batch, LogHead, Record
from harness.contracts.values import Moment


class AcknowledgedStore(PostgresEventStore):
    """The store of the harness; `acknowledged` is told the log's head after each append that was answered."""

    def __init__(self, url: str, acknowledged: Callable[[LogHead], object]) -> None:
        super().__init__(url)
        self._acknowledged = acknowledged

    def append(self, batches: Sequence[Batch], records: Sequence[Record], now: Moment) -> LogHead:
        """The store's append."""
        head = super().append(batches, records, now)
        self._acknowledged(head)
        return head
