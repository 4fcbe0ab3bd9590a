"""One scanner: ros2 launch lineament_ros lineament.launch.py topic:=/front/scan."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = {
    "topic": ("scan", str, "Topic of the scans; what is found goes to topics below it."),
    "method": ("optimal", str, "Name of the method."),
    "deskew": ("off", str, "off, scans, or a topic of nav_msgs/Odometry."),
    "track": ("false", bool, "Whether features are recognised from scan to scan."),
}


def generate_launch_description():
    """Describe what is to be launched."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=text)
                for name, (default, _, text) in ARGUMENTS.items()
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
        ]
    )
