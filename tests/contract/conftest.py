"""One PostgreSQL server for the contract tests of a test process, started when the first of them asks for it."""

from collections.abc import Iterator

import pytest

from tools.postgres import PostgresServer, running_server


@pytest.fixture(scope="session")
def postgres() -> Iterator[PostgresServer]:
    """The server; a test takes a database of its own from it. A test that restarts it must start it again."""
    with running_server() as server:
        yield server
