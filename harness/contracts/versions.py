"""A configuration version as the log keeps it: a record whose digest is the version's id."""

from harness.contracts.configuration import Configuration
from harness.contracts.ids import sha256
from harness.contracts.ports import Record
from harness.contracts.values import encode

CONFIGURATION = "configuration"
"""The kind of such a record."""


def configuration_record(configuration: Configuration) -> Record:
    """What to store with the decision that first names this version."""
    body = encode(configuration)
    return Record(digest=sha256(body), kind=CONFIGURATION, body=body)
