"""The hostile provider kit: missions against a robot whose answers lie, flood, hang or break the protocol."""
