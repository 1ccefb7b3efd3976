"""Describes one picture by the objects and words that a detector and a text reader find, and proposes what it shows."""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from msgspec.structs import replace

from harness.adapters.pictures import PICTURES
from harness.adapters.providers.local import LocalProvider, Outcome, ReceiptDraft, Result
from harness.adapters.providers.models.description import CARD as DESCRIPTION_CARD
from harness.adapters.providers.models.description import described, only_image
from harness.contracts import capabilities, pictures, values
from harness.contracts.effects import Relational, Symbolic
from harness.contracts.ids import Digest, ProviderId
from harness.contracts.ports import BlobStore, Clock, PictureObserver
from harness.contracts.protocol import Parameters, ProposedFact, StartRequest
from harness.provider_protocol.proposals import claims, intended

METHOD = "vision-description-1"
CARD = replace(
    DESCRIPTION_CARD,
    provider_id=ProviderId("vision-description"),
    estimates=capabilities.Estimates(success=0.99, risk=0.0, uncertainty=0.05, cost=0.0),
    software=METHOD,
)


class PictureDescription(values.Value):
    """The stored report: what the models found in the picture with checksum `image`, and which models they are.

    `light` is the measured description of light, sharpness and colours, which needs no model.
    """

    method: str
    image: Digest
    width_px: values.Count
    height_px: values.Count
    objects: tuple[pictures.DetectedObject, ...]
    texts: tuple[pictures.ReadText, ...]
    models: tuple[pictures.VisionModel, ...]
    light: str
    text: str


class VisionDescription(LocalProvider):
    """describe_image by detector and text reader. Parameter `images`: the digest of one picture.

    Receipt `analysis`: blob = the stored PictureDescription as JSON, text = the description in words, with the models.
    """

    def __init__(self, observer: PictureObserver, *, clock: Clock, blobs: BlobStore, journal: Path | None) -> None:
        super().__init__(CARD, clock=clock, blobs=blobs, journal=journal)
        self._observer = observer

    def check(self, request: StartRequest) -> None:
        only_image(request)

    def work(self, request: StartRequest, now_s: float) -> Outcome:
        image = only_image(request)
        description = described_content(self._observer, image, self._blobs.get(image))
        blob = self._blobs.put(values.encode(description))
        declared = {"objects": float(len(description.objects)), "texts": float(len(description.texts))}
        return Result(
            message=description.text,
            drafts=(ReceiptDraft(kind="analysis", text=description.text, blob=blob, values=declared),),
            declared=declared,
            blobs=(blob, image),
            proposes=(
                *claims(request, Relational, {"images": (image,), "report": blob}),
                *_subject_proposals(request, description, blob),
            ),
        )


def _subject_proposals(
    request: StartRequest, description: PictureDescription, report: Digest
) -> Iterator[ProposedFact]:
    """A proposal for what the request wants the picture to show, where the models found it."""
    labels = {one.label for one in description.objects}
    letters = [_letters(one.text) for one in description.texts]
    for one in intended(request):
        if isinstance(one.effect, Symbolic) and one.effect.predicate == "shows":
            kind, name = one.effect.arguments.get("kind"), str(one.effect.arguments.get("name", ""))
            if name in labels if kind == "object" else any(_letters(name) in line for line in letters):
                arguments: Parameters = {"images": (description.image,), "report": report, "name": name}
                yield ProposedFact(name=one.effect.predicate, arguments=arguments)


def _letters(text: str) -> str:
    return "".join(sign for sign in text.casefold() if sign.isalnum())


def described_content(observer: PictureObserver, image: Digest, body: bytes) -> PictureDescription:
    """The description of one picture. Raises ProviderFailed."""
    content = observer.observe(image, body)
    light = described(image, PICTURES.pixels(body)).text
    return PictureDescription(
        method=METHOD,
        image=image,
        width_px=content.width_px,
        height_px=content.height_px,
        objects=content.objects,
        texts=content.texts,
        models=content.models,
        light=light,
        text=f"{_objects(content.objects)} {_texts(content.texts)} {light} {_models(content.models)}",
    )


def _objects(objects: Sequence[pictures.DetectedObject]) -> str:
    counts = Counter(one.label for one in objects)
    best = {label: max(one.score for one in objects if one.label == label) for label in counts}
    named = [f"{label} ({count}, best score {best[label]:.2f})" for label, count in counts.most_common()]
    return f"Objects: {', '.join(named)}." if named else "No object that the detector knows was found."


def _texts(texts: Sequence[pictures.ReadText]) -> str:
    listed_texts = ", ".join(f"“{one.text}” ({one.score:.2f})" for one in texts)
    return f"Text: {listed_texts}." if listed_texts else "No text was read."


def _models(models: Sequence[pictures.VisionModel]) -> str:
    return "Found by " + ", ".join(f"{one.name} {one.version} sha256 {one.digest[:12]}" for one in models) + "."
