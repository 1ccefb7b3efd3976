"""Serves static files: cached for ever under an address with the content's digest, revalidated otherwise."""

import os
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from urllib.parse import parse_qs

from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

STAMP = "v"
SIGNS = 8
FOR_EVER = "public, max-age=31536000, immutable"
ASKED_ANEW = "no-cache"
"""The Cache-Control of a file that must be revalidated by its ETag."""


def stamp(file: Path) -> str:
    """The first characters of the digest of a file's present content. Raises OSError."""
    found = file.stat()
    return _stamp(file, found.st_mtime_ns, found.st_size)


@lru_cache(maxsize=1024)
def _stamp(file: Path, mtime_ns: int, size: int) -> str:
    return sha256(file.read_bytes()).hexdigest()[:SIGNS]


class StampedFiles(StaticFiles):
    """Serves a folder. An address with an outdated digest is answered without a caching promise."""

    def file_response(
        self, full_path: str | os.PathLike[str], stat_result: os.stat_result, scope: Scope, status_code: int = 200
    ) -> Response:
        """The file, or 304 for a browser that has it."""
        answer = super().file_response(full_path, stat_result, scope, status_code)
        named = parse_qs(scope["query_string"].decode("latin-1")).get(STAMP)
        answer.headers["cache-control"] = FOR_EVER if named == [stamp(Path(full_path))] else ASKED_ANEW
        return answer
