"""Output of `rollwalk robot export` for `ros2_control`, read by a YAML parser.

Run by `cargo xtask nightly --only ros2`, which sets ROLLWALK to the program under test.
"""

import os
import pathlib
import subprocess
import tempfile
import unittest
from xml.etree import ElementTree

from ruamel.yaml import YAML

ROBOTS = pathlib.Path(__file__).resolve().parents[2] / "shipped/robots"


class Control(unittest.TestCase):
    """Files of every shipped robot."""

    def test_controllers_have_the_interfaces_of_the_urdf(self):
        files = sorted(ROBOTS.glob("*.toml"))
        self.assertGreater(len(files), 10)
        with tempfile.TemporaryDirectory() as folder:
            for file in files:
                with self.subTest(file.stem):
                    self.check(file, pathlib.Path(folder))

    def check(self, file, folder):
        """Checks that each motor of a robot has exactly one controller that commands its interface."""
        urdf, yaml = folder / f"{file.stem}.urdf", folder / f"{file.stem}.yaml"
        for args in (["--ros2-control", "-o", urdf], ["-o", yaml]):
            subprocess.run([os.environ["ROLLWALK"], "robot", "export", file, *args], check=True, capture_output=True, timeout=60)
        robot = ElementTree.parse(urdf).getroot()
        kinds = {joint.get("name"): joint.get("type") for joint in robot.findall("joint")}
        system = robot.find("ros2_control")
        commands = {joint.get("name"): joint.find("command_interface").get("name") for joint in system.iter("joint")}
        for name, command in commands.items():
            self.assertEqual(command, "position" if kinds[name] == "revolute" else "velocity", name)
        parameters = YAML(typ="safe").load(yaml.read_text(encoding="utf-8"))
        managed = parameters["controller_manager"]["ros__parameters"]
        controlled = {}
        for name, interface in (("joint_trajectory_controller", "position"), ("wheel_velocity_controller", "velocity")):
            self.assertEqual(name in managed, name in parameters)
            if name in managed:
                controlled.update({joint: interface for joint in parameters[name]["ros__parameters"]["joints"]})
        self.assertEqual(controlled, commands)
        self.assertIn("joint_state_broadcaster", managed)


if __name__ == "__main__":
    unittest.main()
