"""Finds what a photograph is to show: "the sign that says B-12", "the chair", "写着B-12的标牌". Pure.

What is found is a subject, whether or not anything here could recognise it; that is told before a mission starts.
"""

import re
from collections.abc import Iterator, Sequence

from harness.contracts.readings import PictureSubject
from harness.goals.tokens import TextToken

_WRITTEN = r"[A-Za-z0-9\u4e00-\u9fff][A-Za-z0-9\u4e00-\u9fff./-]{0,30}"
_QUOTED = rf"[\"“「](?P<quoted>[^\"”」\n]{{1,40}})[\"”」]|(?P<bare>{_WRITTEN})"
_SIGN_EN = re.compile(
    rf"\b(?:the|a|an)\s+(?:sign|label|plate|placard|notice|tag)\s+(?:that|which)\s+(?:says|reads|shows)\s+(?:{_QUOTED})",
    re.IGNORECASE,
)
_SIGN_ZH = re.compile(
    r"写着\s*[\"“「]?(?P<bare>[^\"”」的，。\n]{1,30})[\"”」]?\s*的\s*(?:标牌|牌子|标志牌|标志|标签|门牌)"
)
OBJECTS: dict[str, tuple[str, ...]] = {
    "chair": ("chair", "椅子"),
    "couch": ("couch", "sofa", "沙发"),
    "dining table": ("dining table", "餐桌"),
    "potted plant": ("potted plant", "盆栽"),
    "refrigerator": ("refrigerator", "fridge", "冰箱"),
    "tv": ("television", "tv", "电视", "电视机"),
    "laptop": ("laptop", "笔记本电脑"),
    "microwave": ("microwave", "微波炉"),
    "sink": ("sink", "水槽"),
    "bottle": ("bottle", "瓶子"),
    "suitcase": ("suitcase", "行李箱"),
    "bicycle": ("bicycle", "自行车"),
    "car": ("car", "汽车"),
    "clock": ("clock", "时钟", "挂钟"),
    "fire extinguisher": ("fire extinguisher", "灭火器"),
    "fire hydrant": ("fire hydrant", "消防栓"),
    "forklift": ("forklift", "叉车"),
    "pallet": ("pallet", "托盘"),
}
"""Names of things that can be asked for, by the class that a detector would have to know."""
_NAMES = {name: label for label, names in OBJECTS.items() for name in names}
_THING = re.compile(
    r"\b(?:the|a|an)\s+(?P<en>" + "|".join(sorted((n for n in _NAMES if n.isascii()), key=len, reverse=True)) + r")\b"
    r"|(?P<zh>" + "|".join(sorted((n for n in _NAMES if not n.isascii()), key=len, reverse=True)) + r")",
    re.IGNORECASE,
)


def with_subjects(text: str, found: Sequence[TextToken]) -> tuple[tuple[TextToken, ...], dict[int, PictureSubject]]:
    """The tokens with each subject as one token of kind `subject`, and the subjects by where they begin.

    Only after a verb of photographing is a subject looked for: "go to the sink" may be a place.
    """
    subjects: dict[int, PictureSubject] = {}
    tokens = list(found)
    for start, end, subject in _subjects(text):
        inside = [one for one in tokens if start <= one.start and one.end <= end]
        if not inside or any(one.start < end < one.end for one in tokens):
            continue
        at = tokens.index(inside[0])
        joined = TextToken("subject", subject.name, text[start:end], start, end)
        tokens[at : at + len(inside)] = [joined]
        subjects[start] = subject
    return tuple(tokens), subjects


def _subjects(text: str) -> Iterator[tuple[int, int, PictureSubject]]:
    """Places and subjects, signs first; a thing within a sign's words is no subject of its own."""
    taken: list[tuple[int, int]] = []
    for pattern in (_SIGN_EN, _SIGN_ZH):
        for match in pattern.finditer(text):
            groups = match.groupdict()
            written = (groups.get("quoted") or groups.get("bare") or "").strip().rstrip(".")
            end = match.end() - (1 if match.group().endswith(".") else 0)
            taken.append((match.start(), end))
            yield match.start(), end, PictureSubject(kind="text", name=written)
    for match in _THING.finditer(text):
        if not any(start < match.end() and match.start() < end for start, end in taken):
            name = (match.group("en") or match.group("zh")).casefold()
            yield match.start(), match.end(), PictureSubject(kind="object", name=_NAMES[name])
