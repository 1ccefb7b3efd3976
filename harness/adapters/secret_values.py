"""Reads a secret from where a reference leads: a variable of the environment, or a file. It is never shown."""

import os
from pathlib import Path

from harness.adapters.plain_files import plain_text
from harness.contracts.errors import ContractInvalid
from harness.contracts.reasons import because

LONGEST = 4096


def secret(*, variable: str, file: str, folder: Path) -> str:
    """The secret without the white space around it. `file` counts from `folder`. Raises ContractInvalid."""
    if bool(variable) == bool(file):
        raise ContractInvalid(because("secret_needs_one_place"), where=str(folder))
    if variable:
        found = os.environ.get(variable, "").strip()
        if not found:
            raise ContractInvalid(because("secret_not_set", variable=variable))
        return found
    path = folder / file
    try:
        found = plain_text(path, most_bytes=4 * LONGEST)[:LONGEST].strip()
    except (OSError, UnicodeError) as error:
        raise ContractInvalid(because("secret_unreadable"), where=str(path)) from error
    if not found:
        raise ContractInvalid(because("secret_unreadable"), where=str(path))
    return found
