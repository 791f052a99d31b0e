"""Tests of `rollwalk-ros2` on a simulated Pup from other nodes of ROS 2: topics, services, and the robot after the
node's end.

Run by `cargo xtask nightly --only ros2`, which sets ROLLWALK, ROLLWALK_SIM and ROLLWALK_ROS2 to the programs under test.
"""

import os
import pathlib
import signal
import subprocess
import tempfile
import time
import unittest

from rosbags.typesys import get_typestore
from urdf_parser_py.urdf import URDF

import bench
import ros
from bench import PLAYED_S, plain


class Node(bench.Bench):
    """Pup and its node."""

    ROBOT = "shipped/robots/pup.toml"
    LIBRARY = "shipped/motions/pup_library.toml"

    def test_1_joints_and_urdf_have_the_same_names(self):
        description = self.client.reader("/robot_description", ros.String, ros.LATCHED)
        urdf = ros.wait_for(lambda: description.take(1), "a description of the robot")[0].data
        robot = URDF.from_xml_string(urdf)
        self.assertEqual(robot.name, "pup")
        joints = self.client.reader("/joint_states", ros.JointState)
        state = ros.wait_for(lambda: joints.take(1), "joint states")[0]
        moving = {joint.name: joint for joint in robot.joints if joint.type != "fixed"}
        self.assertEqual(set(state.name), set(moving))
        for values in (state.position, state.velocity, state.effort):
            self.assertEqual(len(values), len(state.name))
        for name, angle in zip(state.name, state.position):
            limit = moving[name].limit
            if moving[name].type == "revolute":
                self.assertTrue(limit.lower - 0.1 <= angle <= limit.upper + 0.1, f"{name}: {angle}")
        self.assertLess(abs(state.header.stamp.sec - time.time()), 10)
        self.assertEqual(state.header.frame_id, "")

    def test_2_late_subscribers_get_what_is_latched(self):
        motions = self.client.reader("/rollwalk/motions", ros.String, ros.LATCHED)
        self.await_text(motions, "stand\ndrive\nwalk")
        self.await_text(self.client.reader("/rollwalk/state", ros.String, ros.LATCHED), "Disarmed")

    def test_3_diagnostics_say_how_the_robot_is(self):
        reader = self.client.reader("/diagnostics", ros.DiagnosticArray)
        controller, link = ros.wait_for(lambda: reader.take(1), "diagnostics")[0].status
        self.assertEqual((controller.name, controller.level), ("rollwalk: controller", 0), controller)
        self.assertEqual((controller.message, controller.hardware_id), ("disarmed", "pup, node 1"))
        self.assertEqual((link.name, link.level, link.message), ("rollwalk: link", 0, "in contact"), link)

    def test_3_messages_are_those_of_every_distribution(self):
        for name, kind, of_ros, qos in (
            ("/joint_states", ros.JointState, "sensor_msgs/msg/JointState", ros.STREAMED),
            ("/diagnostics", ros.DiagnosticArray, "diagnostic_msgs/msg/DiagnosticArray", ros.STREAMED),
            ("/rollwalk/motions", ros.String, "std_msgs/msg/String", ros.LATCHED),
            ("/rosout", ros.Log, "rcl_interfaces/msg/Log", ros.LATCHED),
        ):
            reader = self.client.reader(name, kind, qos)
            message = ros.wait_for(lambda reader=reader: reader.take(1), name)[0]
            for distribution in bench.DISTRIBUTIONS:
                read = get_typestore(distribution).deserialize_cdr(message.serialize(), of_ros)
                self.assertEqual(plain(read), plain(message), f"{of_ros} of {distribution}")

    def test_4_nothing_moves_before_the_robot_is_armed(self):
        ros.wait_for(lambda: self.play.get_matched_subscriptions(), "the node listens")
        self.play.write(ros.String("walk"))
        self.await_log("refused to play walk")
        self.play.write(ros.String("wlak"))
        self.await_log("the library has no motion `wlak`; give one of stand, drive, walk")
        self.assertIn("no motion is paused", self.refused("resume"))
        self.assertIn("refused to pause", self.refused("pause"))

    def test_4_what_is_no_text_is_ignored(self):
        other = ros.Client(self.number)
        writer = other.writer("/rollwalk/play", ros.Broken)
        ros.wait_for(lambda: writer.get_matched_subscriptions(), "the node listens")
        writer.write(ros.Broken(0xFFFFFFFF))
        self.await_log("ignored a malformed message on ~/play")
        self.assertIn("no motion is paused", self.refused("resume"))

    def test_5_an_armed_robot_plays_a_motion_to_its_end_and_comes_home(self):
        joints = self.client.reader("/joint_states", ros.JointState)
        self.assertIn("armed", self.done("arm"))
        self.await_text(self.state, "Ready")
        self.play.write(ros.String("drive"))
        self.await_text(self.motion, "drive")
        speeds = []
        wheels = []

        def is_home():
            for state in joints.take(100):
                wheels[:] = [k for k, name in enumerate(state.name) if not name.endswith(("_hip", "_knee"))]
                speeds.append(max(abs(state.velocity[k]) for k in wheels))
            seen = [one.data for one in self.motion.take(100) if isinstance(one, ros.String)]
            return "stand" in seen

        ros.wait_for(is_home, "the end of the motion", PLAYED_S)
        self.assertEqual(len(wheels), 4)
        self.assertGreater(max(speeds), 0.5, "its wheels turned, rad/s")
        self.done("disarm")
        self.await_text(self.state, "Disarmed")

    def test_6_an_emergency_stop_bars_motion_until_it_is_cleared(self):
        self.done("arm")
        self.await_text(self.state, "Ready")
        self.assertIn("torque is off", self.done("estop"))
        self.await_text(self.state, "EStopped")
        self.assertIn("clear the stop first", self.refused("arm"))
        self.done("clear")
        self.await_text(self.state, "Disarmed")

    def test_6_each_call_has_its_own_outcome_and_a_stop_is_the_last_word(self):
        arm, resume = (self.services[name].begin() for name in ("arm", "resume"))
        self.assertEqual(self.services["resume"].answer(resume), (False, "no motion is paused"))
        self.assertEqual(self.services["arm"].answer(arm), (True, "armed: the robot moves to SAFE"))
        self.await_text(self.state, "Ready")
        disarm = self.services["disarm"].begin()
        self.play.write(ros.String("walk"))
        success, message = self.services["disarm"].answer(disarm)
        self.assertTrue(success, message)
        self.assertNotIn("Playing", self.await_text(self.state, "Disarmed"))

    def test_7_a_second_host_is_refused(self):
        second = self.start_node("--ros-args", "-r", "__node:=second")
        self.assertEqual(second.wait(timeout=30), 5)

    def test_8_sigterm_takes_an_armed_robot_home(self):
        self.done("arm")
        self.await_text(self.state, "Ready")
        self.play.write(ros.String("walk"))
        self.await_text(self.motion, "walk")
        self.node.send_signal(signal.SIGTERM)
        self.assertEqual(self.node.wait(timeout=PLAYED_S), 0)
        self.await_text(self.state, "Disarmed")
        # The robot is disarmed properly. A robot that lost its host would have to be cleared.
        self.rollwalk("send", "--arm", "stand:0.2", "--bus", self.bus)

    def test_9_a_killed_node_leaves_a_robot_that_stops_by_itself(self):
        node = self.start_node()
        self.await_text(self.state, "Disarmed")
        self.done("arm")
        self.await_text(self.state, "Ready")
        node.kill()
        node.wait(timeout=10)

        def is_stopped():
            monitor = [os.environ["ROLLWALK"], "monitor", "--bus", self.bus, "--json", "--for", "0.3"]
            heard = subprocess.run(monitor, capture_output=True, text=True, check=True, timeout=PLAYED_S).stdout
            return '"TorqueOff"' in heard and '"HostLost"' in heard

        ros.wait_for(is_stopped, "the robot without its host", PLAYED_S)


class Feet(bench.Bench):
    """LegBot, whose wheels are fixed to its links, and its node without a gait."""

    ROBOT = "shipped/robots/legbot.toml"

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.LIBRARY = pathlib.Path(folder.name) / "library.toml"
        robot = bench.ROOT / cls.ROBOT
        motion = f'name = "stand"\nrobot = "{robot}"\nends = "at_rest"\nduration_s = 0.5\n[footfalls]\nall = "stance"\n'
        cls.LIBRARY.with_name("stand.toml").write_text(motion)
        cls.LIBRARY.write_text(
            f'name = "legbot"\nrobot = "{robot}"\nsafe = "stand"\n'
            '[[motion]]\nname = "stand"\nfile = "stand.toml"\ncode = 1\n'
        )
        super().setUpClass()

    def test_what_cannot_be_driven_plays_its_motions(self):
        self.await_text(self.state, "Disarmed")
        self.done("arm")
        self.await_text(self.state, "Ready")
        ros.wait_for(lambda: self.play.get_matched_subscriptions(), "the node listens")
        self.play.write(ros.String("stand"))
        self.await_text(self.motion, "stand")
        self.done("disarm")


if __name__ == "__main__":
    unittest.main()
