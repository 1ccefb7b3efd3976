"""Opens the blob store at an address: files in the data folder, or an S3-compatible bucket that several hosts share."""

from importlib.util import find_spec
from pathlib import Path

from harness.adapters.stores.blobs import EraseCopies, FileBlobStore, no_copies, owned_blobs
from harness.contracts.errors import ContractInvalid
from harness.contracts.ports import BlobStore
from harness.contracts.reasons import because


def open_blobs(address: str, folder: Path, *, copies: EraseCopies = no_copies) -> BlobStore:
    """The store at s3://BUCKET/PREFIX?endpoint=URL&region=NAME; below `folder` where the address is empty.

    Raises ContractInvalid for an address of another kind and where the S3 library is not installed, StoreUnavailable
    for a store that cannot be used.
    """
    return _bucket(address, copies) if address else FileBlobStore(folder, copies=copies)


def open_owned_blobs(address: str, folder: Path, *, copies: EraseCopies = no_copies) -> BlobStore:
    """The same for the owner of the data folder: what a killed writer left unfinished there is removed."""
    return _bucket(address, copies) if address else owned_blobs(folder, copies=copies)


def _bucket(address: str, copies: EraseCopies) -> BlobStore:
    if find_spec("obstore") is None:
        raise ContractInvalid(because("blob_library_missing"))
    from harness.adapters.stores.bucket_blobs import BucketBlobStore  # noqa: PLC0415  loaded by those who use it

    return BucketBlobStore(address, copies=copies)
