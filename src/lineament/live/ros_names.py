"""Names of ROS 2 on the wire, and the hashes of its types."""

from __future__ import annotations

__all__ = ["HASHES", "ros_type", "wire_topic", "wire_type"]

#: The types that are read and published here, with the hash by which ROS 2 tells their definition
#: from Iron on (REP 2016). Humble has the same definitions.
HASHES = {
    "diagnostic_msgs/msg/DiagnosticArray": (
        "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"
    ),
    "geometry_msgs/msg/PoseArray": (
        "RIHS01_af0cc36d190e104d546d168d6b39df04fa4b4ccecf59cb4c9ed328d3d5004aa0"
    ),
    "nav_msgs/msg/Odometry": (
        "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"
    ),
    "sensor_msgs/msg/LaserScan": (
        "RIHS01_64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828"
    ),
    "sensor_msgs/msg/MultiEchoLaserScan": (
        "RIHS01_ba5eac341cd5bbb2701527aa4568e8baec172b69cadb9a1945d6f149d087ee48"
    ),
    "sensor_msgs/msg/PointCloud2": (
        "RIHS01_9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5"
    ),
    "tf2_msgs/msg/TFMessage": (
        "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"
    ),
    "visualization_msgs/msg/MarkerArray": (
        "RIHS01_86cb8800b6fb05b5eff1abd7a56f62a5641d3ae9a1c29e78e67e704f1d067dcf"
    ),
}


def wire_topic(topic: str) -> str:
    """Write the name of a topic as DDS has it.

    Examples
    --------
    >>> wire_topic("/scan"), wire_topic("front/scan")
    ('rt/scan', 'rt/front/scan')
    """
    return "rt/" + topic.removeprefix("/")


def wire_type(kind: str) -> str:
    """Write the name of a type as DDS has it.

    Examples
    --------
    >>> wire_type("sensor_msgs/msg/LaserScan")
    'sensor_msgs::msg::dds_::LaserScan_'
    """
    return kind.replace("/msg/", "::msg::dds_::") + "_"


def ros_type(type_name: str) -> str:
    """Write the name of a type of DDS as ROS 2 has it; another name stays as it is.

    Examples
    --------
    >>> ros_type("sensor_msgs::msg::dds_::LaserScan_"), ros_type("Shape")
    ('sensor_msgs/msg/LaserScan', 'Shape')
    """
    name = type_name.replace("::msg::dds_::", "/msg/")
    return name if name == type_name else name.removesuffix("_")
