# SPDX-License-Identifier: Apache-2.0
"""Starts the controllers of COMAN's left arm beside a run of coman-hil (README.md). The arguments
fill in the tag of the URDF: table, ready, period_ticks."""
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

ARGUMENTS = {"table": "", "ready": "", "period_ticks": "0"}


def nodes(context):
    share = Path(get_package_share_directory("coman_hil_ros2"))
    description = (share / "urdf" / "left_arm.urdf").read_text()
    for name in ARGUMENTS:
        description = description.replace(f"@{name}@", LaunchConfiguration(name).perform(context))
    robot = {"robot_description": description}
    controllers = str(share / "config" / "controllers.yaml")
    return [
        Node(package="robot_state_publisher", executable="robot_state_publisher",
             parameters=[robot]),
        Node(package="controller_manager", executable="ros2_control_node", output="both",
             parameters=[robot, controllers]),
        *(Node(package="controller_manager", executable="spawner", arguments=[name])
          for name in ("joint_state_broadcaster", "voltages")),
    ]


def generate_launch_description():
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=value) for name, value in ARGUMENTS.items()),
        OpaqueFunction(function=nodes),
    ])
