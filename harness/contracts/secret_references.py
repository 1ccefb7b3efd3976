"""Names where a secret stands, so that files and records never hold it."""

from typing import Annotated

import msgspec

from harness.contracts.values import Value


class SecretReference(Value):
    """Where a secret stands: a variable of the environment, or a file by its path from the folder. Never the secret."""

    environment: Annotated[str, msgspec.Meta(pattern=r"^[A-Z_][A-Z0-9_]*$")] = ""
    file: str = ""

    @property
    def place(self) -> str:
        """The variable or the file, whichever is named."""
        return self.environment or self.file

    @property
    def has_one_place(self) -> bool:
        """Whether exactly one of the two is named."""
        return bool(self.environment) != bool(self.file)
