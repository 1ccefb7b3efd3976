"""Reads where a person wanted to go before signing in; only pages of this console are accepted."""

import re

OVERVIEW, LONGEST = "/", 500
_PATH = re.compile(r"/(?![/\\])[!#-\[\]-~]*")
_ELSEWHERE = ("/account/sign-in", "/account/sign-out", "/account/oidc", "/api/", "/live", "/static/", "/metrics")
"""Paths that are no page, or that would sign in again."""


def safe_next_url(text: str) -> str:
    """The path and query as asked for, if it is a page of this console; else the overview."""
    page = _PATH.fullmatch(text) is not None and len(text) <= LONGEST and not text.startswith(_ELSEWHERE)
    return text if page else OVERVIEW
