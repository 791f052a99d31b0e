"""A simulated robot and `rollwalk-ros2` for it, as the tests of this folder use them.

ROLLWALK, ROLLWALK_SIM and ROLLWALK_ROS2 are the programs under test. The robot plays in real time.
"""

import dataclasses
import itertools
import os
import pathlib
import subprocess
import tempfile
import unittest

from rosbags.typesys import Stores

import ros

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Separate domains, so that they contain neither other tests nor nodes of ROS on this computer. Linux assigns ports of
# domains above 100 to other programs.
DOMAINS = itertools.count(1 + os.getpid() % 99)
# Longest wait for a motion of a few seconds on a busy computer.
PLAYED_S = 30.0
# Longest wait for a command that plans.
COMMAND_S = 600.0
# Rosbags contains their message definitions.
DISTRIBUTIONS = (Stores.ROS2_HUMBLE, Stores.ROS2_JAZZY, Stores.ROS2_KILTED, Stores.ROS2_LYRICAL)


class Bench(unittest.TestCase):
    """A simulated robot and a node for all tests of a class, which names the robot. Each test begins in the final
    state of the previous test."""

    ROBOT = None
    LIBRARY = None

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.processes = []
        cls.library, cls.bus = cls.path("library.rwl"), f"sim:{cls.path('robot.sock')}"
        cls.rollwalk("library", "build", ROOT / cls.LIBRARY, "-o", cls.library)
        cls.start(os.environ["ROLLWALK_SIM"], ROOT / cls.ROBOT, "--bus", cls.bus, *cls.simulator_args())
        ros.wait_for(cls.path("robot.sock").exists, "the simulator's socket")
        cls.rollwalk("flash", cls.library, "--robot", ROOT / cls.ROBOT, "--bus", cls.bus)
        cls.number = next(DOMAINS)
        cls.node = cls.start_node()
        cls.domain = ros.on_this_computer(cls.number)
        cls.client = ros.Client(cls.number)
        cls.state = cls.client.reader("/rollwalk/state", ros.String, ros.LATCHED)
        cls.motion = cls.client.reader("/rollwalk/motion", ros.String, ros.LATCHED)
        cls.logs = cls.client.reader("/rosout", ros.Log, ros.LATCHED)
        cls.play = cls.client.writer("/rollwalk/play", ros.String)
        names = ("arm", "drive", "disarm", "return", "pause", "resume", "estop", "clear")
        cls.services = {name: cls.client.service(f"/rollwalk/{name}") for name in names}

    @classmethod
    def simulator_args(cls):
        """Arguments of the simulator besides the robot and its bus."""
        return ()

    @classmethod
    def tearDownClass(cls):
        try:
            for process in reversed(cls.processes):
                process.terminate()
                process.wait(timeout=PLAYED_S)
        finally:
            for process in cls.processes:
                process.kill()
            cls.folder.cleanup()

    @classmethod
    def path(cls, name):
        """A file of the test."""
        return pathlib.Path(cls.folder.name) / name

    @classmethod
    def rollwalk(cls, *args):
        """Runs the command line."""
        cls.run_to_its_end([os.environ["ROLLWALK"], *map(str, args)])

    @staticmethod
    def run_to_its_end(command):
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=COMMAND_S)
        if done.returncode != 0:
            raise AssertionError(f"{command}: {done.stderr}")

    @classmethod
    def start(cls, *command, **environment):
        """Starts a program that runs until a signal."""
        environment = {**os.environ, **environment}
        process = subprocess.Popen([str(part) for part in command], env=environment)
        cls.processes.append(process)
        return process

    @classmethod
    def start_node(cls, *args):
        """Starts a node on the bus."""
        return cls.start(
            os.environ["ROLLWALK_ROS2"], "--bus", cls.bus, "--robot", ROOT / cls.ROBOT, "--library", cls.library, *args,
            ROS_DOMAIN_ID=str(cls.number), ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST", RMW_IMPLEMENTATION="rmw_cyclonedds_cpp",
        )

    def done(self, name):
        """Calls a service that succeeds."""
        success, message = self.services[name].call()
        self.assertTrue(success, f"{name}: {message}")
        return message

    def refused(self, name):
        """Calls a service that refuses."""
        success, message = self.services[name].call()
        self.assertFalse(success, f"{name}: {message}")
        return message

    def await_text(self, reader, wanted, seconds=PLAYED_S):
        """Reads texts until one matches; returns the texts before it."""
        seen = []

        def is_there():
            seen.extend(one.data for one in reader.take(100) if isinstance(one, ros.String))
            return wanted in seen

        ros.wait_for(is_there, f"{wanted!r}, seen {seen}", seconds)
        return seen

    def await_log(self, words):
        """Reads /rosout until a line has the given words."""
        lines = []

        def is_there():
            lines.extend(one.msg for one in self.logs.take(100) if isinstance(one, ros.Log))
            return any(words in line for line in lines)

        ros.wait_for(is_there, f"a line with {words!r}: {lines}")


def plain(message):
    """Message of either library as dictionaries, lists, numbers and texts."""
    if dataclasses.is_dataclass(message):
        # Constants of a message are upper case, and the name of its type cannot be a field.
        names = (field.name for field in dataclasses.fields(message))
        return {name: plain(getattr(message, name)) for name in names if name.islower() and name[0] != "_"}
    if isinstance(message, (str, int, float)):
        return message
    return [plain(one) for one in message]
