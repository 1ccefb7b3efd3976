"""Acts on maps: attach a point cloud."""

from typing import Annotated, Any

import msgspec
from pydantic import Field

from app.acts import base
from harness.contracts.errors import ContractInvalid
from harness.contracts.maps import AttachCloud, MapCloud
from harness.contracts.reasons import because


class AttachCloudAct(base.Act):
    """Attach a MapCloud as `regen map import --json` prints it; its chunks are stored already.

    `replace`: show it instead of the cloud that the map has; without it a map that has another cloud keeps it.
    """

    becomes = AttachCloud
    cloud: Annotated[dict[str, Any], Field(max_length=20)]
    reason: base.Reason
    replace: bool = False

    def fields(self) -> dict[str, Any]:
        """Raises ContractInvalid for what is no cloud."""
        try:
            return {"cloud": msgspec.convert(self.cloud, MapCloud), "reason": self.reason}
        except msgspec.ValidationError as error:
            raise ContractInvalid(because("map_cloud_invalid", error=str(error)), where="cloud") from error
