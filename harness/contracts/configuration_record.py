"""Makes the log record of a configuration version; the record's digest is the version's id."""

from harness.contracts.configuration import Configuration
from harness.contracts.ids import sha256
from harness.contracts.ports import Record
from harness.contracts.values import encode

CONFIGURATION = "configuration"
"""The kind of such a record."""


def configuration_record(configuration: Configuration) -> Record:
    """The record to store with the decision that first names this version."""
    body = encode(configuration)
    return Record(digest=sha256(body), kind=CONFIGURATION, body=body)
