"""An ament_python package: colcon builds it, in a workspace of ROS 2."""

from setuptools import setup

NAME = "lineament_ros"

setup(
    name=NAME,
    version="0.1.0",
    description="Lines, corners and arcs from laser scans: lineament as a node of rclpy.",
    maintainer="The lineament developers",
    maintainer_email="lineament@example.org",
    license="BSD-3-Clause",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/lineament.launch.py"]),
        (f"share/{NAME}/rviz", ["rviz/lineament.rviz"]),
    ],
    install_requires=["setuptools", "lineament"],
    zip_safe=True,
    entry_points={"console_scripts": [f"lineament = {NAME}.node:main"]},
)
