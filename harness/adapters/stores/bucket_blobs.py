"""Stores content-addressed blobs in an S3-compatible bucket: PREFIX/ab/cd/abcd..., named by the SHA-256 of their bytes.

Every blob is one PUT, which the service applies whole or not at all. What is read is compared with its digest.
"""

import re
from collections.abc import Callable, Iterator
from datetime import timedelta
from typing import TypeVar
from urllib.parse import parse_qs, urlsplit

import obstore
from obstore.exceptions import BaseError
from obstore.store import S3Store

from harness.contracts.errors import BlobDamaged, ContractInvalid, StoreUnavailable
from harness.contracts.ids import Digest, sha256
from harness.contracts.reasons import because

T = TypeVar("T")
EraseCopies = Callable[[Digest], object]
_DIGEST = re.compile("[0-9a-f]{64}")
_NO_BUCKET = "NoSuchBucket"
_OPTIONS = frozenset({"endpoint", "region"})
_CONNECT_S, _EXCHANGE_S, _RETRIES, _RETRIES_S = 3, 20, 3, 10
LONGEST_ERROR = 300


class BucketBlobStore:
    """Implements the BlobStore port at s3://BUCKET/PREFIX?endpoint=URL&region=NAME. Safe between threads and hosts.

    Keys are taken from the environment as every S3 client takes them (AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, an
    instance's role). `copies` removes what else holds a blob's bytes, when it is erased. Raises ContractInvalid for an
    address of another kind, StoreUnavailable where the service does not answer or refuses, or there is no such bucket.
    """

    def __init__(self, address: str, *, copies: EraseCopies) -> None:
        self._where, self._copies = address.partition("?")[0], copies
        self._store = _opened(address)
        self._asked(lambda: next(iter(obstore.list(self._store, chunk_size=1)), None))

    def put(self, body: bytes) -> Digest:
        """Durable on return. Writing the same bytes again changes nothing, and repairs a damaged object."""
        digest = sha256(body)
        self._asked(lambda: obstore.put(self._store, _key(digest), body, use_multipart=False))
        return digest

    def get(self, digest: Digest) -> bytes:
        """Bytes that match the digest; raises BlobDamaged if they are missing or changed."""
        key = self._key(digest)
        body = self._asked(lambda: _found(lambda: bytes(obstore.get(self._store, key).bytes())))
        if body is None:
            raise BlobDamaged(because("blob_missing", digest=digest), where=f"{self._where}/{key}")
        if sha256(body) != digest:
            raise BlobDamaged(because("blob_differs", digest=digest), where=f"{self._where}/{key}")
        return body

    def has(self, digest: Digest) -> bool:
        """Whether there is an object of that digest. Only `get` looks inside."""
        if not _DIGEST.fullmatch(digest):
            return False
        return self._asked(lambda: _found(lambda: obstore.head(self._store, _key(digest)))) is not None

    def digests(self) -> Iterator[Digest]:
        """All digests, in ascending order, as the service lists them."""
        pages = iter(obstore.list(self._store))
        while (page := self._asked(lambda: next(pages, None))) is not None:
            for one in page:
                name = one["path"].rpartition("/")[2]
                if _DIGEST.fullmatch(name):
                    yield Digest(name)

    def erase(self, digest: Digest) -> None:
        """Delete the object, and the copies. A bucket that keeps old versions keeps the bytes until it expires them."""
        key = self._key(digest)
        self._asked(lambda: _found(lambda: obstore.delete(self._store, key)))
        self._asked(lambda: self._copies(digest))

    def _key(self, digest: Digest) -> str:
        if not _DIGEST.fullmatch(digest):
            raise BlobDamaged(because("digest_invalid", digest=digest[:80]), where=self._where)
        return _key(digest)

    def _asked(self, ask: Callable[[], T]) -> T:
        try:
            return ask()
        except (BaseError, OSError) as error:
            first = str(error).partition("\n")[0][:LONGEST_ERROR]
            raise StoreUnavailable(because("blob_service_unavailable", error=first), where=self._where) from error


def _opened(address: str) -> S3Store:
    parts = urlsplit(address)
    given = parse_qs(parts.query)
    if parts.scheme != "s3" or not parts.hostname or parts.username or not _OPTIONS.issuperset(given):
        raise ContractInvalid(because("blob_address_invalid"), where="REGEN_BLOBS")
    endpoint, region = (given.get(name, [""])[0] for name in ("endpoint", "region"))
    return S3Store(
        parts.hostname,
        prefix=parts.path.strip("/") or None,
        config={"region": region or "us-east-1", **({"endpoint": endpoint} if endpoint else {})},
        client_options={
            "allow_http": endpoint.startswith("http://"),
            "connect_timeout": f"{_CONNECT_S}s",
            "timeout": f"{_EXCHANGE_S}s",
        },
        retry_config={"max_retries": _RETRIES, "retry_timeout": timedelta(seconds=_RETRIES_S)},
    )


def _key(digest: Digest) -> str:
    return f"{digest[:2]}/{digest[2:4]}/{digest}"


def _found(ask: Callable[[], T]) -> T | None:
    """None where the object is not there; a bucket that is not there is the service's failure."""
    try:
        return ask()
    except FileNotFoundError as error:
        if _NO_BUCKET in str(error):
            raise
        return None
