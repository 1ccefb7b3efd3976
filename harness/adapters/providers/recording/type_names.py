"""Normalises message type names to the ROS 2 form."""


def ros2_name(name: str) -> str:
    """`pkg/Type` of ROS 1 and of older recorders becomes `pkg/msg/Type`; three-part names stay."""
    package, separator, rest = name.partition("/")
    return f"{package}/msg/{rest}" if separator and "/" not in rest else name
