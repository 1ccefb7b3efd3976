"""Tests against foreign programs: robots, brokers, models, middleware. Only `make test-peers` runs them."""

from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
PEERS = HERE.parent.parent / ".peers"
"""What tools/peers.sh installs, one folder for each peer."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if HERE in item.path.parents:
            item.add_marker("peers")


@pytest.fixture(scope="session")
def peers() -> Path:
    """The folder with the installed peers."""
    return PEERS
