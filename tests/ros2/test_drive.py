"""Tests of `rollwalk-ros2` on a simulated AgileBot that is driven by velocities: its distance in the simulated world,
and when it stops.

Run by `cargo xtask nightly --only ros2`, as test_node.py is. The position of the robot is in the log of its world
(docs/formats/world-log.md), which the node does not read.
"""

import csv
import dataclasses
import math
import signal
import time

from rosbags.typesys import get_typestore

import bench
import ros
from bench import PLAYED_S

# Displacement of a standing robot, smaller than its sway.
AT_REST_M_S = 0.01


@dataclasses.dataclass
class Step:
    """A step of the simulated world."""

    time_s: float
    x_m: float
    y_m: float
    speed_m_s: float
    held: bool
    fell: bool


class World:
    """The log of a simulated world while it grows."""

    def __init__(self, path):
        self.log, self.begun, self.steps = open(path, newline=""), "", []
        self.names = None

    def read(self):
        """Reads new steps; returns all steps so far."""
        *lines, self.begun = (self.begun + self.log.read()).split("\n")
        rows = csv.reader(lines)
        self.names = self.names or next(rows, None)
        for row in rows:
            of = dict(zip(self.names, row))
            speed = math.hypot(float(of["com_vx_m_s"]), float(of["com_vy_m_s"]))
            place = float(of["base_x_m"]), float(of["base_y_m"])
            self.steps.append(Step(float(of["time_s"]), *place, speed, of["held"] == "1", of["fell"] == "1"))
        return self.steps


class Drive(bench.Bench):
    """AgileBot and its node."""

    ROBOT = "shipped/robots/agilebot.toml"
    LIBRARY = "shipped/motions/agilebot_library.toml"

    @classmethod
    def simulator_args(cls):
        return ("--world-log", cls.path("world.csv"))

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.world = World(cls.path("world.csv"))
        cls.velocity = cls.client.writer("/cmd_vel", ros.Twist)

    def drive_for(self, seconds, forward=0.0, turn=0.0, write=None):
        """Commands a velocity 20 times a second, as Nav2 does."""
        write = write or (lambda twist: self.velocity.write(twist))
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            write(twist(forward, turn))
            time.sleep(0.05)

    def await_rest(self):
        """Waits until the robot has not moved for a second of its world."""

        def rests():
            return all(step.speed_m_s < AT_REST_M_S for step in self.world.read()[-240:])

        ros.wait_for(rests, "the robot rests", PLAYED_S)

    def test_1_velocities_are_those_of_every_distribution(self):
        header = ros.Header(ros.Time(7, 8), "base_link")
        for message, of_ros in (
            (twist(0.5, -0.25), "geometry_msgs/msg/Twist"),
            (ros.TwistStamped(header, twist(0.5, -0.25)), "geometry_msgs/msg/TwistStamped"),
        ):
            for distribution in bench.DISTRIBUTIONS:
                read = get_typestore(distribution).deserialize_cdr(message.serialize(), of_ros)
                self.assertEqual(bench.plain(read), bench.plain(message), f"{of_ros} of {distribution}")

    def test_2_no_robot_is_driven_that_was_not_asked_to_be(self):
        self.await_text(self.state, "Disarmed")
        ros.wait_for(lambda: self.velocity.get_matched_subscriptions(), "the node listens")
        self.assertIn("the robot is disarmed: driving begins at SAFE", self.refused("drive"))
        self.done("arm")
        self.await_text(self.state, "Ready")
        self.drive_for(2.0, forward=0.2)
        seen = [one.data for one in self.state.take(100) if isinstance(one, ros.String)]
        self.assertEqual(seen, [])

    def test_3_a_driven_robot_goes_as_far_as_commanded_and_stops_when_no_velocity_comes(self):
        self.assertEqual(self.done("drive"), "it follows geometry_msgs/msg/Twist on /cmd_vel")
        self.await_text(self.state, "Streaming")
        self.await_rest()
        before = self.world.read()[-1]
        self.drive_for(6.0, forward=0.15)
        self.await_rest()
        steps = since(self.world.read(), before)
        # 6 s, and half a second in which the last velocity is valid. The robot starts as late as it stops.
        self.assertAlmostEqual(way(before, steps[-1]), 0.15 * 6.5, delta=0.15)
        cruising = [step.speed_m_s for step in steps if way(before, step) > 0.2 and way(step, steps[-1]) > 0.3]
        self.assertAlmostEqual(sum(cruising) / len(cruising), 0.15, delta=0.015)
        self.await_state_stays("Streaming")

    def test_4_no_velocity_is_faster_than_the_robot_may_be(self):
        before = self.world.read()[-1]
        self.drive_for(5.0, forward=7.0)
        self.await_rest()
        steps = since(self.world.read(), before)
        self.assertAlmostEqual(fastest(steps, 120), 0.2, delta=0.02)

    def test_4_a_velocity_that_is_no_number_stops_it(self):
        self.velocity.write(twist(math.nan, 0.0))
        self.await_log("a velocity is ignored, and the robot stops: a component is not a finite number")

    def test_5_a_driven_robot_plays_no_motion_and_returns_when_asked(self):
        self.play.write(ros.String("walk"))
        self.await_log("the robot is driven: end driving with ~/return")
        self.drive_for(1.0, forward=0.2)
        success, message = self.services["return"].call(PLAYED_S)
        self.assertTrue(success, message)
        self.await_text(self.state, "Ready")
        # The robot does not start again without a command.
        self.drive_for(2.0, forward=0.2)
        self.await_state_stays("Ready")

    def test_6_the_emergency_stop_of_a_driven_robot_is_the_last_word(self):
        self.done("drive")
        self.await_text(self.state, "Streaming")
        self.drive_for(2.0, forward=0.2)
        call = self.services["estop"].begin()
        self.drive_for(2.0, forward=0.2)
        success, message = self.services["estop"].answer(call)
        self.assertTrue(success, message)
        self.await_text(self.state, "EStopped")
        self.drive_for(1.0, forward=0.2)
        self.assertIn("emergency stop", self.refused("drive"))
        self.await_state_stays("EStopped")
        # The hoist picks the robot up after 3 s without torque.
        ros.wait_for(lambda: self.world.read()[-1].held, "the hoist holds the robot", PLAYED_S)
        self.done("clear")
        self.await_text(self.state, "Disarmed")

    def test_7_sigterm_stops_a_driven_robot_and_takes_it_home(self):
        self.arm_and_drive()
        self.drive_for(2.0, forward=0.2)
        self.node.send_signal(signal.SIGTERM)
        self.drive_for(1.0, forward=0.2)
        self.assertEqual(self.node.wait(timeout=PLAYED_S), 0)
        self.await_text(self.state, "Disarmed")
        self.assertFalse(self.world.read()[-1].fell)

    def test_8_stamped_velocities_count_from_their_stamps_on(self):
        self.__class__.node = self.start_node("--ros-args", "-p", "use_stamped_vel:=true")
        # In DDS, a topic of a participant has one type.
        other = ros.Client(self.number)
        stamped = other.writer("/cmd_vel", ros.TwistStamped)
        ros.wait_for(lambda: stamped.get_matched_subscriptions(), "the node listens")
        self.await_text(self.state, "Disarmed")
        self.arm_and_drive()
        self.await_rest()
        before = self.world.read()[-1]
        self.drive_for(3.0, forward=0.2, write=lambda one: stamped.write(ros.TwistStamped(header(0.0), one)))
        self.await_rest()
        self.assertAlmostEqual(way(before, self.world.read()[-1]), 0.2 * 3.5, delta=0.2)
        before = self.world.read()[-1]
        self.drive_for(2.0, forward=0.2, write=lambda one: stamped.write(ros.TwistStamped(header(1.0), one)))
        self.await_log("its stamp is 1.0 s old")
        self.await_rest()
        self.assertLess(way(before, self.world.read()[-1]), 0.02)
        success, message = self.services["disarm"].call(PLAYED_S)
        self.assertTrue(success, message)
        self.await_text(self.state, "Disarmed")

    def arm_and_drive(self):
        """Arms a robot and drives it."""
        self.done("arm")
        self.await_text(self.state, "Ready")
        self.done("drive")
        self.await_text(self.state, "Streaming")

    def await_state_stays(self, state):
        """Asserts that this is the last state that the node published."""
        late = self.client.reader("/rollwalk/state", ros.String, ros.LATCHED)
        self.assertEqual(ros.wait_for(lambda: late.take(1), "a state")[0].data, state)


def twist(forward, turn):
    """A forward velocity, m/s, and a turn to the left, rad/s."""
    return ros.Twist(ros.Vector3(forward, 0.0, 0.0), ros.Vector3(0.0, 0.0, turn))


def header(age_s):
    """Header of a message that is `age_s` old."""
    at_s = time.time() - age_s
    return ros.Header(ros.Time(int(at_s), int(at_s % 1.0 * 1e9)), "base_link")


def way(one, other):
    """Distance between the body's positions at two steps, m."""
    return math.hypot(other.x_m - one.x_m, other.y_m - one.y_m)


def since(steps, before):
    """Steps after the step `before`."""
    return [step for step in steps if step.time_s > before.time_s]


def fastest(steps, count):
    """Greatest mean speed over `count` consecutive steps, m/s."""
    speeds = [step.speed_m_s for step in steps]
    return max(sum(speeds[k : k + count]) / count for k in range(len(speeds) - count))
