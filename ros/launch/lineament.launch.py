"""One scanner: ros2 launch lineament_ros lineament.launch.py topic:=/front/scan rviz:=true."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

ARGUMENTS = {
    "topic": ("scan", str, "Topic of the scans; what is found goes to topics below it."),
    "method": ("optimal", str, "Name of the method."),
    "deskew": ("off", str, "off, scans, or a topic of nav_msgs/Odometry."),
    "track": (
        "false",
        bool,
        "Whether features are tracked, for odometry too.",
    ),
}
#: Of RViz, not of the node.
OF_RVIZ = {
    "rviz": ("false", "Whether to open RViz."),
    "frame": ("laser", "Frame of RViz: that of the scans, or odom, if /tf leads there."),
}
#: Topics of the configuration of RViz, below /scan.
SHOWN = ("", "/markers", "/corners", "/dock", "/odometry")


def generate_launch_description():
    """Describe what is to be launched."""
    topic = LaunchConfiguration("topic")
    configuration = [FindPackageShare("lineament_ros"), "rviz", "lineament.rviz"]
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=text)
                for name, (default, *_, text) in (ARGUMENTS | OF_RVIZ).items()
            ),
            Node(
                package="lineament_ros",
                executable="lineament",
                name="lineament",
                output="screen",
                parameters=[
                    {
                        # With its type: YAML takes "off" for false.
                        name: ParameterValue(LaunchConfiguration(name), value_type=kind)
                        for name, (_, kind, _) in ARGUMENTS.items()
                    }
                ],
            ),
            Node(
                package="rviz2",
                executable="rviz2",
                arguments=[
                    *("-d", PathJoinSubstitution(configuration)),
                    *("-f", LaunchConfiguration("frame")),
                ],
                remappings=[(f"/scan{below}", [topic, below]) for below in SHOWN],
                condition=IfCondition(LaunchConfiguration("rviz")),
            ),
        ]
    )
