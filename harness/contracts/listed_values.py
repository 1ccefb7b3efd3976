"""Says which values a field may have that takes one of a list, by the path that msgspec names in an error."""

import re

import msgspec

from harness.contracts.reasons import Reason, because

NOT_LISTED = "Invalid enum value "


def why_invalid(error: msgspec.DecodeError | UnicodeDecodeError, kind: type) -> tuple[Reason | str, str]:
    """What is wrong, and the path where: a value outside a field's list is answered with the list."""
    what, _, path = str(error).partition(" - at `")
    allowed = values_at(kind, path.rstrip("`")) if NOT_LISTED in what else ()
    if not allowed:
        return what, path.rstrip("`") or "$"
    value = what.removeprefix(NOT_LISTED).strip("'")
    return because("value_not_listed", value=value, values=allowed), path.rstrip("`") or "$"


def values_at(kind: type, path: str) -> tuple[str, ...]:
    """The values that a field of this type may have, sorted; none where it is no list of values.

    `path` as msgspec writes it: `$.author.kind`, `$.recovery.ladders[...][0]`, ``key` in `$.recovery.ladders``.
    """
    of_key, _, place = path.rpartition("` in `")
    found = msgspec.inspect.type_info(kind)
    for step in re.findall(r"\.\w+|\[[^\]]*\]", place):
        found = _bare(_part_of(found, step))
    if of_key and isinstance(found, msgspec.inspect.DictType):
        found = _bare(found.key_type)
    if isinstance(found, msgspec.inspect.LiteralType):
        return tuple(sorted(str(one) for one in found.values))
    return ()


def _bare(found: msgspec.inspect.Type) -> msgspec.inspect.Type:
    return _bare(found.type) if isinstance(found, msgspec.inspect.Metadata) else found


def _part_of(whole: msgspec.inspect.Type, step: str) -> msgspec.inspect.Type:
    """One step down a path: a field of a struct, or an item of a list, tuple or mapping; itself where there is none."""
    match whole:
        case msgspec.inspect.StructType() if step.startswith("."):
            return next((field.type for field in whole.fields if field.encode_name == step[1:]), whole)
        case msgspec.inspect.VarTupleType() | msgspec.inspect.ListType():
            return whole.item_type
        case msgspec.inspect.DictType():
            return whole.value_type
        case _:
            return whole
