"""Sends to any service that Apprise knows. Nothing is read back, and the outcome of a failed attempt stays unknown."""

from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import urlsplit

from harness.adapters.connection_guard import guarded, not_of_this_link
from harness.adapters.notify.services import added
from harness.adapters.providers.messaging.dingtalk import TITLE, marked
from harness.adapters.providers.messaging.recorded import Note
from harness.contracts.channels import AppriseChannel
from harness.contracts.errors import ChannelRefused, DeliveryUnknown
from harness.contracts.ids import Digest
from harness.contracts.ports import BlobStore
from harness.contracts.reasons import because
from harness.contracts.secret_references import SecretReference


class AppriseService:
    """MessageService by an Apprise address, with the pictures as attachments where the service takes them."""

    def __init__(self, entry: AppriseChannel, *, secret: Callable[[SecretReference], str], blobs: BlobStore) -> None:
        self._entry, self._secret, self._blobs = entry, secret, blobs

    def send(self, key: str, text: str, images: Sequence[Digest], *, sent: Sequence[str], note: Note) -> None:
        if sent:
            return
        import apprise  # noqa: PLC0415  loads for a quarter of a second, and every command would wait for it

        name, address = self._entry.name, self._secret(self._entry.url)
        asset = apprise.AppriseAsset(app_id="RegenHarness", http_redirects=False, image_url_mask="")
        asset.async_mode = False  # the guard holds in this thread alone
        services = apprise.Apprise(asset=asset)
        if not urlsplit(address).scheme or not added(services, address):
            raise ChannelRefused(because("channel_address_unknown", channel=name))
        with TemporaryDirectory() as folder, guarded(not_of_this_link):
            files = [self._file(Path(folder), number, image) for number, image in enumerate(images, start=1)]
            try:
                taken = services.notify(title=TITLE, body=marked(text, key), attach=files or None)
            except (OSError, RuntimeError, TypeError, ValueError) as error:
                raise self._unknown(type(error).__name__) from error
        if not taken:
            raise self._unknown("the service did not report success")
        note("accepted")

    def state(self, ids: Sequence[str]) -> str:
        """Nothing can be asked."""
        return ""

    def _file(self, folder: Path, number: int, image: Digest) -> str:
        body = self._blobs.get(image)
        suffix = "png" if body.startswith(b"\x89PNG") else "jpg"
        file = folder / f"image-{number}.{suffix}"
        file.write_bytes(body)
        return str(file)

    def _unknown(self, why: str) -> DeliveryUnknown:
        return DeliveryUnknown(because("delivery_unknown", channel=self._entry.name, error=why))
