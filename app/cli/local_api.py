"""The API of whoever owns a data folder, else of this process: the whole application is imported only where it runs."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.cli.api_client import Api
from app.cli.owner_api import owner_api

if TYPE_CHECKING:
    from app.cli import in_process_api
    from harness.settings import HarnessSettings

    assert in_process_api
IN_PROCESS = "app.cli.in_process_api"


def _in_process() -> Any:
    return import_module(IN_PROCESS)


@contextmanager
def api_with_robots(data: Path, chosen: "HarnessSettings | None" = None) -> Iterator[Api]:
    """The owner's API; where nobody owns the folder, one of this process with robots until the block ends.

    Raises StoreOwned for an owner without an API.
    """
    owner = owner_api(data)
    if owner is not None:
        yield owner
        return
    with _in_process().with_robots(data, chosen) as api:
        yield api


@contextmanager
def api_without_robots(data: Path) -> Iterator[Api]:
    """The owner's API, or one of this process without robots, for acts that move none."""
    owner = owner_api(data)
    if owner is not None:
        yield owner
        return
    with _in_process().without_robots(data) as api:
        yield api
