"""The API that answers a command: the console's that owns the data folder, else one of this process."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from app.cli.api_client import Api
from app.cli.owner_api import owner_api
from harness.settings import HarnessSettings


@contextmanager
def api_with_robots(data: Path, chosen: HarnessSettings | None = None) -> Iterator[Api]:
    """The owner's API; where nobody owns the folder, one of this process with robots (as fast as possible if not told
    otherwise) until the block ends. Raises StoreOwned for an owner without an API."""
    owner = owner_api(data)
    if owner is not None:
        yield owner
        return
    from app.cli.local_api import local_api_with_robots  # noqa: PLC0415  the whole console loads for half a second

    with local_api_with_robots(data, chosen) as api:
        yield api


@contextmanager
def api_without_robots(data: Path) -> Iterator[Api]:
    """The owner's API, or one of this process without robots, for acts that move none."""
    owner = owner_api(data)
    if owner is not None:
        yield owner
        return
    from app.cli.local_api import local_api_without_robots  # noqa: PLC0415  as above

    with local_api_without_robots(data) as api:
        yield api
