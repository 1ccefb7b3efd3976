"""/evidence: blobs by digest, verified each time, with a type that no upload can choose."""

from typing import Annotated

from fastapi import APIRouter, Path
from starlette.responses import Response

from app.console import ConsoleDep
from harness.contracts.ids import Digest, sha256

router = APIRouter(prefix="/evidence")
MAGIC: tuple[tuple[bytes, str, str], ...] = (
    (b"\xff\xd8\xff", "image/jpeg", "jpg"),
    (b"\x89PNG\r\n\x1a\n", "image/png", "png"),
)


@router.get("/{digest}")
def show(console: ConsoleDep, digest: Annotated[str, Path(pattern="^[0-9a-f]{64}$")]) -> Response:
    """Pictures inline, WAV to listen to, everything else as a download. 404 if the bytes do not match."""
    body = console.runtime.blob(Digest(digest))
    media_type, suffix, inline = kind_of(body)
    disposition = "inline" if inline else "attachment"
    headers = {
        "Content-Disposition": f'{disposition}; filename="{digest[:16]}.{suffix}"',
        "Content-Security-Policy": "default-src 'none'; sandbox",
        "X-Verified-SHA256": sha256(body),
    }
    return Response(body, media_type=media_type, headers=headers)


def kind_of(body: bytes) -> tuple[str, str, bool]:
    """(media type, suffix, may be shown inline), from the first bytes alone."""
    for magic, media_type, suffix in MAGIC:
        if body.startswith(magic):
            return media_type, suffix, True
    if body[:4] == b"RIFF" and body[8:12] == b"WAVE":
        return "audio/wav", "wav", True
    return (
        ("application/json", "json", False) if body[:1] in (b"{", b"[") else ("application/octet-stream", "bin", False)
    )
