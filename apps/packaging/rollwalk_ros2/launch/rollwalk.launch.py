"""A robot and the transforms of its links: `ros2 launch rollwalk_ros2 rollwalk.launch.py bus:=sim robot:=robots/agilebot.toml`."""

import shlex

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import Command, LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

# After Ctrl-C the robot first returns to SAFE. A second signal would interrupt the return, and the robot would have to
# be cleared.
HOME_S = "30"
# Arguments of the launch file, with default, if any, and description.
ARGUMENTS = {
    "bus": (None, "sim, can:can0, serial:/dev/ttyUSB0 or slcan:/dev/ttyACM0"),
    "namespace": ("", "namespace of the nodes"),
    "robot": ("", "robot file; with one, transforms are published"),
    "library": ("", "motion library with the names of motions; with one, the robot can be driven by velocities"),
    "gait": ("", "periodic plan in whose gait a robot walks that is driven"),
    "use_stamped_vel": ("false", "whether velocities come as TwistStamped"),
}


def nodes(context):
    """The robot's node. With a robot file, also the publisher of transforms, which reads the URDF at its start."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    files = [word for name in ("robot", "library", "gait") if given[name] for word in (f"--{name}", given[name])]
    robot = Node(
        package="rollwalk_ros2",
        executable="rollwalk-ros2",
        name="rollwalk",
        namespace=given["namespace"] or None,
        arguments=["--bus", given["bus"], *files],
        ros_arguments=["-p", "use_stamped_vel:=" + given["use_stamped_vel"]],
        output="screen",
        sigterm_timeout=HOME_S,
    )
    if not given["robot"]:
        return [robot]
    urdf = Command(["rollwalk robot export ", shlex.quote(given["robot"]), " -o /dev/stdout"], on_stderr="ignore")
    transforms = Node(
        package="robot_state_publisher",
        executable="robot_state_publisher",
        namespace=given["namespace"] or None,
        parameters=[{"robot_description": ParameterValue(urdf, value_type=str)}],
        # The robot's node publishes the URDF on the usual topic.
        remappings=[("robot_description", "~/robot_description")],
    )
    return [robot, transforms]


def generate_launch_description():
    """The launch file's arguments and nodes."""
    return LaunchDescription(
        [
            *(DeclareLaunchArgument(name, default_value=default, description=text) for name, (default, text) in ARGUMENTS.items()),
            OpaqueFunction(function=nodes),
        ]
    )
