"""Selects the frames of a message (D37). The rule's name is stored with every receipt. Pure."""

from collections.abc import Sequence

from harness.contracts.ids import Digest

RULE = "cited-then-evenly-spaced"
MOST_IMAGES = 4


def cited_then_evenly_spaced(
    frames: Sequence[Digest], *, cited: Sequence[Digest] = (), most: int = MOST_IMAGES
) -> tuple[Digest, ...]:
    """At most `most` of `frames`: those the analysis cites first, in its order, then the others evenly spaced.

    Each frame comes at most once; a citation of a frame that is not among `frames` is passed over.
    """
    own = tuple(dict.fromkeys(frames))
    chosen = [frame for frame in dict.fromkeys(cited) if frame in own][:most]
    others = [frame for frame in own if frame not in chosen]
    room = min(most - len(chosen), len(others))
    return (*chosen, *(others[index * len(others) // room] for index in range(room)))
