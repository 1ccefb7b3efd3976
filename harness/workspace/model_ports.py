"""Opens the models of a site's folder: one port for each model, shared by the roles that use it."""

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from harness.adapters.models.chat import ChatModel
from harness.adapters.models.http_transport import HttpChatTransport
from harness.adapters.secret_values import secret
from harness.contracts.errors import BlobDamaged, ContractInvalid, ProviderUnreachable
from harness.contracts.ids import Digest, sha256
from harness.contracts.models import ModelEndpoint, ModelPort, Models
from harness.contracts.reasons import because
from harness.workspace.files import ModelEntry, ModelsFile


def no_image(digest: Digest) -> bytes:
    """The blob reader of a model that is shown no images. Raises BlobDamaged."""
    raise BlobDamaged(because("blob_missing", digest=digest), where=digest[:12])


def open_models(
    file: ModelsFile,
    folder: Path,
    *,
    stack: ExitStack,
    keep: Callable[[bytes], Digest],
    read: Callable[[Digest], bytes],
) -> Models:
    """The port of each role that has a model. Nothing is sent yet; the stack closes the connections.

    One endpoint has one port however many roles use it, so that its cost limit counts them together. Raises
    ContractInvalid where a key is missing or an address is invalid.
    """
    used = {one.name: one for one in file.models if one.name in file.roles.values()}
    ports = {
        name: open_model(entry, _key(entry, folder), stack=stack, keep=keep, read=read) for name, entry in used.items()
    }
    return {role: ports[name] for role, name in file.roles.items()}


def open_model(
    endpoint: ModelEndpoint,
    key: str,
    *,
    stack: ExitStack,
    keep: Callable[[bytes], Digest] = sha256,
    read: Callable[[Digest], bytes] = no_image,
) -> ModelPort:
    """One model with its key, empty where it needs none; without `keep` only digests of its exchanges are left.

    Raises ContractInvalid for an invalid address.
    """
    try:
        transport = HttpChatTransport(endpoint.base_url, key, endpoint.timeout_s)
    except ProviderUnreachable as error:
        raise ContractInvalid(error.reason, where=endpoint.name) from error
    stack.callback(transport.close)
    return ChatModel(endpoint, transport, keep=keep, read=read)


def _key(entry: ModelEntry, folder: Path) -> str:
    return secret(variable=entry.key.environment, file=entry.key.file, folder=folder) if entry.key else ""
