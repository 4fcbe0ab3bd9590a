"""One scanner: ros2 launch lineament_ros lineament.launch.py topic:=/front/scan rviz:=true."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import LifecycleNode, Node
from launch_ros.substitutions import FindPackageShare
from lineament_ros.parameters import DESCRIPTIONS, value_of

#: Of RViz and of ROS, not of lineament: default, and what it is.
OTHERS = {
    "rviz": ("false", "Whether to open RViz."),
    "frame": ("laser", "Frame of RViz: that of the scans, or odom, if /tf leads there."),
    "namespace": ("", "Namespace of the node."),
    "autostart": ("true", "Whether the node starts by itself; a lifecycle manager does else."),
    "params_file": ("", "YAML with parameters, of the method too; arguments precede it."),
}
#: Topics of the configuration of RViz, below /scan.
SHOWN = ("", "/markers", "/corners", "/dock", "/odometry")


def generate_launch_description():
    """Describe what is to be launched."""
    topic = LaunchConfiguration("topic", default="scan")
    configuration = [FindPackageShare("lineament_ros"), "rviz", "lineament.rviz"]
    arguments = {name: ("", text) for name, text in DESCRIPTIONS.items()} | OTHERS
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=text)
                for name, (default, text) in arguments.items()
            ),
            OpaqueFunction(function=scanner),
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


def scanner(context):
    """Describe the node: with the arguments that were given, all others as it has them."""
    given = context.launch_configurations
    own = {name: value_of(name, given[name]) for name in DESCRIPTIONS if given.get(name)}
    own["autostart"] = given["autostart"].lower() == "true"
    files = [given["params_file"]] if given["params_file"] else []
    return [
        LifecycleNode(
            package="lineament_ros",
            executable="lineament",
            name="lineament",
            namespace=given["namespace"],
            output="screen",
            parameters=[*files, own],
        )
    ]
