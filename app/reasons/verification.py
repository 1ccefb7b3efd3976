"""What the verifier found, by code."""

from collections.abc import Mapping

from app.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "too_far_from_target": N_("{distance_m:.2f} m from the target, at most {bound_m:.2f} m allowed"),
}
