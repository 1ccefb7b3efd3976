"""Says why a part of a mission is unverified; pages, documents and terminals share these words."""

from app.i18n.catalogues import N_
from harness.projections.unverified import WhyUnverified

UNVERIFIED: dict[WhyUnverified, str] = {
    "declared": N_("declared by its provider alone"),
    "rests_on_declared": N_("rests on what is only declared"),
    "failed": N_("failed, and the mission went on"),
}
