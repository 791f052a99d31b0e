#!/usr/bin/env python3
"""Tests of the replay harness against closed forms, and with every robot file.

    python3 tests/replay/test_replay.py

Needs Python 3.11, mujoco and numpy; no plan and no program of the project.
"""

import argparse
import copy
import json
import math
import struct
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import mujoco
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

import feedforward  # noqa: E402
import library  # noqa: E402
import logged  # noqa: E402
import measure  # noqa: E402
import motion  # noqa: E402
import player  # noqa: E402
import recorded  # noqa: E402
import robots  # noqa: E402
import tables  # noqa: E402
import terrain_cases  # noqa: E402
import world  # noqa: E402
from curves import Spline  # noqa: E402
from errors import Unusable  # noqa: E402
from falls import FallWatch  # noqa: E402
from model import Ground, Model, nominal_poses  # noqa: E402
from motion import Motion  # noqa: E402

ROBOTS = sorted((Path(__file__).resolve().parents[2] / "shipped/robots").glob("*.toml"))
G = 9.80665


def standing(robot, duration_s=1.0, motor_rad_s=0.0):
    """A plan of a robot that stands still in its nominal pose, or rolls with its wheels turning at one speed."""
    poses = nominal_poses(robot)
    contacts = []
    for foot in robot["end_effectors"]:
        rotation, origin = poses[foot["link"]]
        point = origin + rotation @ foot["center_in_link_m"]
        up = np.array([0.0, 0.0, 1.0])
        if "axis_in_link" in foot["contact"]:
            axis = rotation @ foot["contact"]["axis_in_link"]
            up = up - axis[2] * axis
            up /= np.linalg.norm(up)
        contacts.append(point - foot["radius_m"] * up)
    height = -min(point[2] for point in contacts)
    mass = sum(link["mass_kg"] for link in robot["links"])
    com = sum(
        link["mass_kg"] * (o + r @ link["com_in_link_m"]) for link, (r, o) in zip(robot["links"], poses)
    ) / mass
    stands = [point[2] < 1e-3 - height for point in contacts]
    feet = [p for p, s in zip(contacts, stands) if s]
    # Vertical forces of least norm that hold weight and moments.
    rows = np.array([[1.0] * len(feet), [p[0] - com[0] for p in feet], [p[1] - com[1] for p in feet]])
    forces = iter(np.linalg.lstsq(rows, [mass * G, 0.0, 0.0], rcond=1e-9)[0])
    sample = {
        "time_s": 0.0,
        "base_position_m": [0.0, 0.0, height],
        "base_yaw_pitch_roll_rad": [0.0, 0.0, 0.0],
        "joint_rad": [joint["nominal_rad"] for joint in robot["joints"]],
        "com_m": list(com + [0.0, 0.0, height]),
        "end_effectors": [
            {
                "contact": bool(s),
                "position_m": list(p + [0.0, 0.0, height]),
                "force_n": [0.0, 0.0, float(next(forces)) if s else 0.0],
                "motor_speed_rad_s": motor_rad_s if robots.spins(f) else 0.0,
            }
            for f, p, s in zip(robot["end_effectors"], contacts, stands)
        ],
    }
    return Motion({
        "robot": robot,
        "motion": {
            "name": "stand", "ends": "at_rest", "duration_s": duration_s,
            "goal": {"forward_m": 0.0, "left_m": 0.0, "turn_rad": 0.0},
        },
        "sample_interval_s": duration_s / 3,
        "samples": [dict(sample, time_s=k * duration_s / 3) for k in range(4)],
        "before": sample,
        "after": sample,
        "end_placement": {"offset_m": [0.0, 0.0], "yaw_rad": 0.0},
        "formulation": {"gravity_m_s2": G, "rolling_sign_width_m_s": 0.05},
    })


def named(name):
    return robots.from_file(next(path for path in ROBOTS if path.stem == name))


def block(contact):
    """A brick of 2 kg on four end effectors, without joints."""
    inertia = [0.02, 0.0, 0.0, 0.0, 0.03, 0.0, 0.0, 0.0, 0.04]
    feet = [
        {
            "name": f"foot{i}", "link": 0, "center_in_link_m": [x, y, 0.0], "radius_m": 0.05,
            "friction_coefficient": 0.6, "contact": dict(contact),
        }
        for i, (x, y) in enumerate([(0.2, 0.15), (0.2, -0.15), (-0.2, 0.15), (-0.2, -0.15)])
    ]
    link = {
        "name": "body", "mass_kg": 2.0, "com_in_link_m": [0.0, 0.0, 0.0],
        "inertia_in_link_kg_m2": inertia, "shapes": [],
    }
    return {"name": "block", "links": [link], "joints": [], "end_effectors": feet}


# A single leg, and a car whose front wheels hang above the ground.
CANNOT_STAND_LEVEL = ("test_leg", "car_tilted")


class Standing(unittest.TestCase):
    def test_every_robot_file_stays_where_it_stands(self):
        for path in ROBOTS:
            robot = robots.from_file(path)
            if robot["name"] in CANNOT_STAND_LEVEL:
                continue
            motion = standing(robot)
            with self.subTest(robot=robot["name"]):
                track = world.run(motion, robot, "torque")
                result = measure.summary(motion, track, 1)
                self.assertIsNone(result["fell_at_s"])
                self.assertLess(abs(result["cycles"][0]["forward_m"]), 1e-3)
                self.assertLess(abs(result["cycles"][0]["turn_rad"]), 1e-3)
                # The feed-forward holds the weight, so the body sags only by the depth in the ground.
                self.assertLess(abs(result["sag_mean_m"]), 5e-4)
                # The ground carries the weight. Contacts settle to 1e-3 within the second before.
                load = np.array(track.load_n)[-500:].sum(axis=1).mean()
                self.assertAlmostEqual(load / (Model(robot, G).mass_kg * G), 1.0, delta=1e-3)

    def test_torques_at_rest_are_those_of_virtual_work(self):
        for path in ROBOTS:
            robot = robots.from_file(path)
            if robot["name"] in CANNOT_STAND_LEVEL:
                continue
            motion = standing(robot)
            model = Model(robot, G)
            inverse = feedforward.InverseDynamics(model)
            torques, base = inverse.torques(motion, 0.5)
            forces = motion.forces(0.5)

            def potential(joint, angle):
                """Potential of the weight minus the work of the ground forces, with the base at rest."""
                position, turn = motion.base(0.5)
                joints, _ = motion.joints(0.5)
                joints[joint] += angle
                inverse.d.qpos[:] = model.place(position, turn, joints, motion.motors(0.5)[0])
                mujoco.mj_forward(model.m, inverse.d)
                work = sum(
                    force @ inverse.lowest_point(j, foot)
                    for j, (foot, force) in enumerate(zip(robot["end_effectors"], forces))
                )
                return model.mass_kg * G * inverse.d.subtree_com[1][2] - work

            with self.subTest(robot=robot["name"]):
                for joint in range(len(robot["joints"])):
                    slope = (potential(joint, 1e-5) - potential(joint, -1e-5)) / 2e-5
                    # Differences of energies of 100 J at 1e-5 rad.
                    self.assertAlmostEqual(torques[joint], slope, delta=1e-6 * (1 + abs(slope)))
                np.testing.assert_allclose(base[0:3], 0.0, atol=1e-6)


class Physics(unittest.TestCase):
    def test_momentum_in_free_fall(self):
        """Free fall without torques: m v = m g t, angular momentum is constant, energy is constant to first order in the step."""
        lost = []
        for step_s in (0.001, 0.0005):
            robot = named("agilebot")
            model = Model(robot, G, Ground(step_s=step_s))
            m, d = model.m, mujoco.MjData(model.m)
            m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION | mujoco.mjtDisableBit.mjDSBL_CONTACT
            m.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
            d.qpos[:] = model.place_in_motion(standing(robot), 0.0)
            d.qvel[:] = np.random.default_rng(1).uniform(-1, 1, m.nv)
            momentum, energy = [], []
            for _ in range(round(0.4 / step_s)):
                mujoco.mj_step(m, d)
                mujoco.mj_subtreeVel(m, d)
                momentum.append(np.concatenate([d.subtree_linvel[1], d.subtree_angmom[1]]))
                energy.append(d.energy.sum())
            momentum = np.array(momentum)
            fallen = momentum[-1] - momentum[0]
            np.testing.assert_allclose(fallen[0:3], [0.0, 0.0, -G * step_s * (len(momentum) - 1)], atol=2e-3)
            np.testing.assert_allclose(fallen[3:6], 0.0, atol=2e-3 * np.linalg.norm(momentum[0][3:6]) + 1e-4)
            lost.append(abs(energy[-1] - energy[0]))
        self.assertLess(lost[1], 0.7 * lost[0] + 1e-6)

    def test_a_block_slides_to_a_stop_by_its_friction(self):
        robot = block({"kind": "point_foot"})
        way = self._coast(robot, 0.6)
        # v^2 / (2 mu g); friction starts within a few steps.
        self.assertAlmostEqual(way / (0.36 / (2 * 0.6 * G)), 1.0, delta=0.03)

    def test_a_cart_rolls_out_by_its_drag(self):
        drag = {"rolling_resistance": 0.05, "rolling_drag_s_m": 0.1}
        robot = block({"kind": "passive_wheel", "axis_in_link": [0.0, 1.0, 0.0], "drag": drag})
        speed, way, inertia = 0.6, 0.0, 2.0
        wheel_kg = 0.1 * 2.0 / 4
        inertia += 4 * 0.5 * wheel_kg
        for _ in range(100000):
            slowing = 0.05 * math.tanh(speed / 0.05) + 0.1 * speed
            way += speed * 1e-5
            speed -= 2.0 * G * slowing / inertia * 1e-5
        self.assertAlmostEqual(self._coast(robot, 0.6, 1.0) / way, 1.0, delta=0.01)

    def _coast(self, robot, speed_m_s, time_s=0.5):
        motion = standing(robot)
        simulation = world.Simulation(Model(robot, G), motion, world.Case())
        simulation.start(moving=False)
        points = player.hold(robot, np.zeros(0), np.zeros(0), "none")
        simulation.play(points, 0.5, measured=False)
        simulation.d.qvel[0] = speed_m_s
        for j, foot in enumerate(robot["end_effectors"]):
            if robots.spins(foot):
                simulation.d.qvel[simulation.model.wheel_dofs[j]] = speed_m_s / foot["radius_m"]
        begin = simulation.d.subtree_com[1][0]
        simulation.play(points, time_s, measured=False)
        return simulation.d.subtree_com[1][0] - begin

    def test_wheels_roll_their_circumference(self):
        robot = named("agilebot")
        motion = standing(robot, duration_s=2.0, motor_rad_s=3.0)
        frames = motion.frames()
        track = world.run(motion, robot, "none", frames=frames)
        driven = np.array([joint is None for _, _, joint, _ in robots.channels(robot)])
        turned = frames[:-1, driven].mean() * motion.duration_s
        way = measure.summary(motion, track, 1)["cycles"][0]["forward_m"]
        # Speeds of frames to one quantum of 2^-10 rad/s; the rim sinks in by 0.04 mm.
        self.assertAlmostEqual(way / (0.05 * turned), 1.0, delta=3e-3)


    def test_a_robot_on_its_trunk_has_fallen_and_an_impact_is_none(self):
        watch = FallWatch()
        fell = lambda share, steps: [watch.fell(0.0, 1.0, share, 0.001) for _ in range(steps)]
        # 1 − exp(−0.05 / 0.5) = 0.095 of the weight, below a quarter.
        self.assertNotIn(True, fell(1.0, 50) + fell(0.0, 500))
        # Then half of the weight from 0.095 / e = 0.035 reaches a quarter after 0.5 ln(0.465 / 0.25) = 0.31 s.
        self.assertAlmostEqual(fell(0.5, 500).index(True), 310, delta=2)
        lying = FallWatch(may_lie=True)
        self.assertFalse(any(lying.fell(0.0, 1.0, 1.0, 0.001) for _ in range(5000)))
        self.assertTrue(lying.fell(1.1, 1.0, 0.0, 0.001))
        self.assertTrue(lying.fell(0.0, math.nan, 0.0, 0.001))

    def test_a_trunk_is_what_carries_no_foot(self):
        model = Model(named("agilebot"), G)
        names = {mujoco.mj_id2name(model.m, mujoco.mjtObj.mjOBJ_GEOM, geom) for geom in model.trunk_geoms}
        self.assertIn("shape:body:0", names)
        self.assertIn("shape:front_left_thigh:0", names)
        self.assertFalse(any("fork" in name for name in names))


class Playing(unittest.TestCase):
    def test_a_periodic_spline_goes_on_with_two_derivatives(self):
        turn, shift = complex(math.cos(0.7), math.sin(0.7)), 0.4 - 0.2j
        values = np.array([[complex(i * i % 5, i * 3 % 7)] for i in range(7)])
        spline = Spline.periodic(0.25, values, turn, shift)
        (v0, s0), (v1, s1) = spline.at(0.0), spline.at(7 * 0.25)
        self.assertAlmostEqual(abs(v1[0] - (turn * v0[0] + shift)), 0, delta=1e-12)
        self.assertAlmostEqual(abs(s1[0] - turn * s0[0]), 0, delta=1e-11)

        def second(t):
            return (spline.at(t + 1e-5)[1] - spline.at(t - 1e-5)[1])[0] / 2e-5

        for knot in range(1, 7):
            jump = second(knot * 0.25 + 2e-5) - second(knot * 0.25 - 2e-5)
            # Third derivatives of 1e4 between two times 4e-5 s apart.
            self.assertLess(abs(jump), 1.0)

    def test_a_clamped_spline_reproduces_a_cubic(self):
        cubic = lambda t: 0.3 - 1.2 * t + 0.7 * t**2 - 0.4 * t**3
        times = np.linspace(0, 1.5, 7)
        spline = Spline.clamped(0.25, cubic(times)[:, None], -1.2, -1.2 + 1.4 * 1.5 - 1.2 * 1.5**2)
        for t in np.linspace(0, 1.5, 40):
            self.assertAlmostEqual(spline.at(t)[0][0].real, cubic(t), delta=1e-12)

    def test_setpoints_meet_frames_and_reproduce_parabolas(self):
        robot = named("agilebot")
        motion = standing(robot, duration_s=0.5)
        frames = np.tile(motion.frames()[0], (31, 1))
        times = np.arange(31) / 60
        frames[:, 0] = 0.3 * times + 0.4 * times**2
        points = player.setpoints(robot, frames, np.zeros_like(frames), motion, 1, "none", 240)
        at = np.arange(len(points.position_rad)) / 240
        inside = slice(4, -5)
        np.testing.assert_allclose(points.position_rad[inside, 0], (0.3 * at + 0.4 * at**2)[inside], atol=1e-12)
        np.testing.assert_allclose(points.speed_rad_s[inside, 0], (0.3 + 0.8 * at)[inside], atol=1e-11)

    def test_the_limiter_bounds_change_and_range(self):
        robot = named("agilebot")
        motion = standing(robot, duration_s=0.5)
        frames = np.tile(motion.frames()[0], (31, 1))
        frames[10:, 0] += 5.0
        points = player.setpoints(robot, frames, np.zeros_like(frames), motion, 1, "none")
        joint = robot["joints"][0]
        steps = np.abs(np.diff(points.position_rad[:, 0]))
        self.assertLessEqual(steps.max(), joint["actuator"]["speed_max_rad_s"] / 120 + 1e-12)
        self.assertLessEqual(points.position_rad[:, 0].max(), joint["position_max_rad"])

    def test_an_offset_is_torque_by_stiffness(self):
        robot = named("agilebot")
        motion = standing(robot, duration_s=0.5)
        frames = motion.frames()
        torques = np.full_like(frames, 0.4)
        without, offset = (
            player.setpoints(robot, frames, torques, motion, 1, kind) for kind in ("none", "offset")
        )
        gains = [a["kp_nm_rad"] for _, a, joint, _ in robots.channels(robot) if joint is not None]
        added = (offset.position_rad - without.position_rad)[-1, : len(gains)]
        np.testing.assert_allclose(added, 0.4 / np.array(gains), atol=1e-12)
        self.assertEqual(np.abs(offset.torque_nm).max(), 0.0)

    def test_torques_take_their_time_and_offsets_end(self):
        robot = named("agilebot")
        motion = standing(robot, duration_s=0.5)
        frames, most = motion.frames(), [a["torque_max_nm"] for _, a, _, _ in robots.channels(robot)]
        torques = np.zeros_like(frames)
        torques[10:] = 10.0
        points = player.setpoints(robot, frames, torques, motion, 1, "torque")
        # A third of the limit in each of the 120 periods per second, and at most the limit.
        steps = np.diff(points.torque_nm, axis=0) / most
        self.assertAlmostEqual(steps.max(), 1 / 3, delta=1e-12)
        np.testing.assert_allclose(points.torque_nm[-1], most)
        without, offset = (
            player.setpoints(robot, frames, torques, motion, 1, kind) for kind in ("none", "offset")
        )
        added = (offset.position_rad - without.position_rad)[-1]
        wheel = [joint is None for _, _, joint, _ in robots.channels(robot)]
        # Torque / stiffness: 1.8 N·m / 80 or 4.38 N·m / 100; torque / damping: 1.8 N·m / 0.5.
        self.assertLess(added.max(), 1.0 + 1e-12)
        np.testing.assert_allclose(added[wheel], 1.0)

    def test_torques_are_whole_quanta_of_the_limit(self):
        robot = named("agilebot")
        most = np.array([a["torque_max_nm"] for _, a, _, _ in robots.channels(robot)])
        torques = np.vstack([0.37 * most, -0.9 * most, 2.0 * most])
        held = motion.quantised_torques(torques, robot)
        self.assertLess((np.abs(held - torques) / most)[:2].max(), 1 / 2048)
        self.assertLess((most - held[2]).max() / most.max(), 1 / 1024)
        # Of 1.8 N·m: 2^0 / 1024.
        self.assertEqual(held[0, 0], round(0.37 * 1.8 * 1024) / 1024)

    def test_torques_that_a_plan_carries_are_used(self):
        robot = named("agilebot")
        plan = copy.deepcopy(standing(robot).plan)
        for sample in plan["samples"]:
            sample["joint_torque_nm"] = [0.1] * len(robot["joints"])
            for foot in sample["end_effectors"]:
                foot["motor_torque_nm"] = 0.2
        torques, _ = feedforward.frames(Model(robot, G), Motion(plan))
        np.testing.assert_allclose(torques[:, :16], 0.1)
        np.testing.assert_allclose(torques[:, 16:], 0.2)


class Files(unittest.TestCase):
    def test_points_of_a_lying_body_are_added_to_the_robot_of_the_file(self):
        robot = named("agilebot")
        point = dict(robot["end_effectors"][0], name="body_1", link=0, contact={"kind": "body_point"})
        planned = robot | {"end_effectors": robot["end_effectors"] + [point]}
        self.assertTrue(robots.lies(planned) and not robots.lies(robot))
        self.assertIsNone(robots.difference(robots.with_body_points(robot, planned), planned))
        self.assertIsNone(robots.difference(robots.with_body_points(robot, robot), robot))

    def test_errors_name_file_and_field(self):
        good = json.loads(json.dumps(standing(named("swizzlebot")).plan, default=list))
        good |= {"format": "rollwalk-plan", "version": 3}
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "plan.json"

            def why(change):
                plan = copy.deepcopy(good)
                change(plan)
                path.write_text(json.dumps(plan))
                with self.assertRaises(Unusable) as error:
                    motion.load(path)
                self.assertIn(str(path), str(error.exception))
                return str(error.exception)

            path.write_text(json.dumps(good))
            motion.load(path)
            self.assertIn("field version is 2", why(lambda p: p.update(version=2)))
            self.assertIn("field motion.goal is missing", why(lambda p: p["motion"].pop("goal")))
            self.assertIn("samples[1].joint_rad has 11", why(lambda p: p["samples"][1]["joint_rad"].pop()))
            bad = lambda p: p["samples"][2]["end_effectors"][0]["force_n"].__setitem__(1, math.nan)
            self.assertIn("samples[2].end_effectors[0].force_n[1] is nan", why(bad))

    def test_a_robot_that_differs_is_found(self):
        robot = named("legbot")
        other = copy.deepcopy(robot)
        self.assertIsNone(robots.difference(robot, other))
        other["joints"][3]["actuator"]["kp_nm_rad"] *= 1.01
        self.assertIn("robot.joints[3].actuator.kp_nm_rad", robots.difference(robot, other))


class Libraries(unittest.TestCase):
    def test_a_clip_of_the_format_is_decoded(self):
        """A block written by hand after docs/formats/motion-library.md: two channels, three frames."""
        rows = [[100, -5], [103, -5], [104, 2]]
        payload = np.array(rows[0] + [3, 0], dtype="<i2").tobytes()
        # Widths 3 and 4. Second differences: 0, 0; then -2, +7 as zigzag 3 and 14.
        bits, at = 0, 0
        for value, width in [(3, 4), (4, 4), (0, 3), (0, 4), (3, 3), (14, 4)]:
            bits |= value << at
            at += width
        payload += bits.to_bytes((at + 7) // 8, "little")
        header = bytes([0, 3, 0, 0]) + len(payload).to_bytes(2, "little") + bytes(4)
        self.assertEqual(library._clip(header + payload, 2), rows)

    def test_a_library_holds_torques_beside_its_frames(self):
        robot = block({"kind": "actuated_wheel", "axis_in_link": [0.0, 1.0, 0.0], "actuator": {"torque_max_nm": 2.0}})
        plan = type("Plan", (), {"robot": robot, "name": "stand", "duration_s": 2 / 60})

        def clip(values):
            """Three frames that grow by the same step: no second differences."""
            first, step = np.array(values), np.array([1, 0, -1, 2])
            payload = np.concatenate([first, step]).astype("<i2").tobytes() + bytes(4)
            return bytes([0, 3, 0, 0]) + len(payload).to_bytes(2, "little") + bytes(4) + payload

        def section(tag, stride, data):
            return struct.pack("<HHI", tag, stride, len(data)) + data

        def file(*torques):
            return b"ROLLWALK" + struct.pack("<HH", 1, 2) + bytes(12) + b"".join([
                section(1, 10, struct.pack("<IHBBBB", 0, 60, 4, 1, 0, 0)),
                section(2, 8, b"".join(struct.pack("<BbhhH", 1, -10, -9, 9, 9) for _ in range(4))),
                section(3, 11, struct.pack("<BHII", 0, 3, 0, len(clip([5, 6, 7, 8])))),
                section(4, 1, clip([5, 6, 7, 8])),
                section(9, 1, bytes([5]) + b"stand"),
                *torques,
            ]) + bytes(24)

        values, torques = library._frames(file(), plan)
        np.testing.assert_array_equal(values[2] * 1024, [7, 6, 5, 12])
        self.assertIsNone(torques)
        held = clip([-5, 600, 0, 1])
        sections = [
            section(10, 1, struct.pack("<4b", -9, -9, -10, -9)),
            section(11, 8, struct.pack("<II", 0, len(held))),
            section(12, 1, held),
        ]
        _, torques = library._frames(file(*sections), plan)
        np.testing.assert_array_equal(torques[1] * 512, [-4, 600, -0.5, 3])


class Logs(unittest.TestCase):
    """A log of a car whose wheels have a constant commanded speed, played as by `logged`."""

    def setUp(self):
        self.robot = robots.from_file(next(path for path in ROBOTS if path.stem == "car"))
        poses = nominal_poses(self.robot)
        wheels = self.robot["end_effectors"]
        lowest = min((poses[f["link"]][1] + poses[f["link"]][0] @ f["center_in_link_m"])[2] - f["radius_m"] for f in wheels)
        self.radius_m = wheels[0]["radius_m"]
        self.rows = []
        for k in range(1, 481):
            place = {"x_m": 0, "y_m": 0, "z_m": -lowest, "qw": 1, "qx": 0, "qy": 0, "qz": 0}
            row = {"time_s": k / 240, "motion": "roll" if k > 240 else "", "held": int(k < 4), "fell": 0}
            row |= {f"base_{key}": value for key, value in place.items()} | {f"com_{axis}_m": 0.0 for axis in "xyz"}
            for name, actuator, joint, _ in robots.channels(self.robot):
                law = {"rad": 0, "target_rad": 0, "target_rad_s": 0, "feedforward_nm": 0}
                law |= {"kp_nm_rad": actuator["kp_nm_rad"], "kd_nm_s_rad": actuator["kd_nm_s_rad"]}
                law["limit_nm"] = actuator["torque_max_nm"]
                if joint is None:
                    name, law["kp_nm_rad"], law["target_rad_s"] = f"{name}_motor", 0, 2.0
                else:
                    law["rad"] = law["target_rad"] = joint["nominal_rad"]
                row |= {f"{name}_{key}": value for key, value in law.items()}
            row |= {f"{wheel['name']}_normal_n": 0.0 for wheel in wheels}
            self.rows.append(row)

    def written(self, folder):
        path = Path(folder) / "run.csv"
        lines = [",".join(self.rows[0])] + [",".join(map(str, row.values())) for row in self.rows]
        path.write_text("\n".join(lines) + "\n")
        return path

    def compared(self):
        with tempfile.TemporaryDirectory() as folder:
            return logged.compare(self.robot, logged.Log(self.written(folder), self.robot), {})

    def test_wheels_that_are_commanded_a_speed_roll_their_way(self):
        result = self.compared()
        (piece,) = result["pieces"]
        self.assertEqual((piece["motion"], result["fell_at_s"]), ("roll", {"ours": None, "mujoco": None}))
        # Only damping holds a wheel at its speed, and the load is almost zero.
        self.assertAlmostEqual(piece["mujoco"]["forward_m"] / (2.0 * self.radius_m * 239 / 240), 1.0, delta=0.01)
        self.assertEqual(piece["ours"]["forward_m"], 0.0)

    def test_motors_are_recorded_at_the_end_of_a_row(self):
        """Rows of a single step of MuJoCo: quantities derived from the state, such as actuator lengths, are those of
        the previous step."""
        options = argparse.Namespace(angle_noise=0.0, place_noise=0.0, seed=0)
        with tempfile.TemporaryDirectory() as folder, mock.patch.object(recorded, "PARTS", 1):
            heading, *rows = recorded.record(logged.Log(self.written(folder), self.robot), self.robot, options)
        rows = np.array(rows, dtype=float)
        wheel = next(name for name in heading if name.endswith("_motor_rad"))
        angle, speed = rows[:, heading.index(wheel)], rows[:, heading.index(f"{wheel}_s")]
        self.assertGreater(angle[1], 1e-3)
        np.testing.assert_allclose(np.diff(angle), speed[1:] / 240, rtol=0, atol=1e-9)

    def test_a_drive_without_power_stands_still(self):
        for row in self.rows:
            row.update({key: 0 for key in row if key.endswith("limit_nm")})
        self.assertLess(abs(self.compared()["pieces"][0]["mujoco"]["forward_m"]), 1e-3)

    def test_logs_that_say_nothing_of_this_robot_are_refused(self):
        rows = self.rows
        for changed, why in [
            ([dict(row, held=1) for row in rows], "the hoist holds the robot all the time"),
            (rows[:1], "the hoist holds the robot all the time"),
            (rows[4:], "no hoist holds the robot at its beginning"),
            ([dict(row, knee_limit_nm=1) for row in rows], "columns .*knee.*expected the log of a car"),
            ([{key: row[key] for key in row if "rear" not in key} for row in rows], "expected the log of a car"),
            (rows[:4], "one row without the hoist"),
        ]:
            self.rows = changed
            with self.assertRaisesRegex(Unusable, why):
                self.compared()

    def test_it_ends_where_the_hoist_picks_the_robot_up(self):
        for row in self.rows[400:]:
            row["held"] = 1
        (piece,) = self.compared()["pieces"]
        self.assertAlmostEqual(piece["mujoco"]["forward_m"] / (2.0 * self.radius_m * 159 / 240), 1.0, delta=0.01)


class Words(unittest.TestCase):
    def test_motions_on_terrain_are_compared_with_level_ground(self):
        run = {"fell_at_s": None, "cycles": [{"forward_m": 0.9, "left_m": 0.0}], "planned": {"forward_m": 1.0, "left_m": 0.0}}
        run |= {"goals": [True, False], "holds": False, "slid_m": 0.125}
        played = {"fell_at_s": 2.0, "planned": [1.0, 0.0, 0.0], "played": [0.5, 0.0, 0.0], "slid_m": 0.1, "height_ratio": None}
        result = {
            "robot": "r", "motion": "kerb", "level": {"iterations": 4, "cpu_s": 0.5}, "status": "converged", "iterations": 9,
            "cpu_s": 1.0, "judgement": "consistent", "simulation": {"verdict": "fails"},
            "room": {"swing": None, "links": {"distance_m": 0.02}, "ground": {"distance_m": 0.01}},
            "open": run, "tracked": run | {"holds": True}, "mujoco_open": played, "mujoco_tracked": played | {"fell_at_s": None},
        }
        refused = {"robot": "r", "motion": "gap", "refused": "too wide\nhelp"}
        rows = tables.terrain([result, refused]).splitlines()[2:]
        expected = "| `kerb` of r | fails in simulation | 9 (4) | 2.0 | **0.900** | 0.900 | falls 2.0 s | 0.500 | 10.0 | 0.12 |"
        self.assertEqual(rows[0], expected)
        self.assertTrue(rows[1].startswith("| `gap` of r | refused: too wide | – |"))

    def test_cases_of_a_robot_have_different_names(self):
        size = terrain_cases.Size(0.3, 0.4, 0.05)
        for robot in ("agilebot", "pup", "anymal_wheels", "other"):
            names = [case.name for case in terrain_cases.of_robot(robot, size)]
            self.assertEqual(len(names), len(set(names)))
            self.assertGreaterEqual(len(names), 5)

    @staticmethod
    def result(motion, kind, ratio, marked=None, fell=None):
        drift = {"forward_m": 0.0, "left_m": 0.001, "turn_rad": 0.0}
        return {
            "motion": motion, "robot": "pup", "plan": f"motions-{motion}.json", "feed_forward": kind, "case": "nominal",
            "ratio": {"forward_m": ratio}, "ratio_late": {"forward_m": ratio}, "drift": drift, "drift_late": drift,
            "fell_at_s": fell, "links_on_ground": {}, "slip_mean_m_s": 0.002, "needs_feedback": marked,
            "holds": fell is None and 0.95 <= ratio <= 1.05,
        }

    def test_drives_decide_with_which_feed_forward_a_motion_must_hold(self):
        runs = [dict(self.result("walk", kind, ratio), drives_take="torque") for kind, ratio in
                [("none", 0.4), ("torque", 1.0), ("offset", 0.9)]]
        self.assertEqual([run["feed_forward"] for run in measure.deciding(runs)], ["torque"])
        of_servos = [dict(run, drives_take="offset") for run in runs]
        self.assertEqual([run["feed_forward"] for run in measure.deciding(of_servos)], ["offset"])
        self.assertEqual(len(list(measure.deciding(of_servos[:2]))), 2)

    def test_a_retargeted_motion_has_its_row_without_a_plan_file(self):
        run = {"planned": {"forward_m": 0.1}, "goals": ["forward_m"], "ours": {"forward_m": 0.09}, "mujoco": {"forward_m": 0.1}, "fell_at_s": {"ours": None, "mujoco": None}}
        result = {"motion": "pace", "robot": "agilebot", "stiffness": 0.2, "before": run, "after": run}
        self.assertIn("| `pace` of agilebot | 0.2 of it | 0.900 | 0.900 | 1.000 | 1.000 |", tables.retargeted([result]))

    def test_what_is_identified_has_a_column_for_each_motion_and_for_all(self):
        number = lambda value, deviation: [{"name": "friction", "before": 0.8, "fitted": value, "deviation": deviation}]
        alone = {"walk": number(0.31, 0.005), "trot": number(0.8, None)}
        results = {"true": {"friction": 0.3}, "seeds": [{"seed": 1, "alone": alone, "together": number(0.302, 0.01)}]}
        heading, _, row = tables.identified(results).splitlines()
        self.assertEqual(heading, "|  | true | file | `walk` 1 | `trot` 1 | together 1 |")
        self.assertEqual(row, "| `friction` | 0.3 | 0.8 | 0.31 ± 0.005 (+2.0) | not told | 0.302 ± 0.01 (+0.2) |")

    def test_runs_and_pushes_of_controllers_have_rows(self):
        of = {"motion": "walk", "robot": "a1", "plan": "walk.json", "control": "servos"}
        run = {"fell_at_s": None, "ratio": {"forward_m": 0.5}, "drift": {"left_m": 0.001, "turn_rad": 0.0}, "path_rms_m": 0.002, "untracked": 0}
        results = [of | run | {"case": case} for case in tables.DRIFTS]
        results[1] |= {"untracked": 3}
        results[2] |= {"fell_at_s": 1.25}
        results += [of | {"push": push, "direction": way} for push, way in ((0.4, (1.0, 0.0)), (0.8, (0.0, -1.0)))]
        ratios, drifts, pushes = (block.splitlines()[-1] for block in tables.tracked(results).split("\n\n"))
        self.assertEqual(ratios, "| `walk` of a1 | servos | 0.500 | 0.500 * | falls 1.2 s |")
        self.assertEqual(drifts, "| `walk` of a1 | servos | 2, 1, 0 | 2, 1, 0 | – |")
        self.assertEqual(pushes, "| `walk` of a1 | servos | 0.60 | 0.4 | 0.80 |")

    def test_tables_and_words_count_what_passes(self):
        results = []
        for motion, fed, bare, marked, fell in [
            ("walk", 1.0, 0.99, None, None), ("turn", 0.99, 0.4, None, None), ("run", 0.2, 0.1, "yes", 1.5),
            ("hop", 0.96, 0.9, None, None),
        ]:
            results.append(self.result(motion, "torque", fed, marked, fell))
            results.append(self.result(motion, "none", bare, marked, fell))
        words = " ".join(tables.in_words(results).split())
        self.assertEqual(tables.verdict(results), "passed")
        self.assertIn("3 of 4 motions reach", words)
        self.assertIn("need feedback: `run` of pup.", words)
        self.assertIn("2 more fail, worst `turn` of pup (0.40), `hop` of pup (0.90).", words)
        self.assertNotIn("do not mark them", words)
        rows = tables.both(results).splitlines()
        self.assertEqual(len(rows), 6)
        self.assertIn("| `turn` of pup | 0.990 | 0.990 | 1.0 | 0.0 | 2.0 | 0.400 | 0.400 | 2.0 | without: no |", rows)
        self.assertTrue(rows[4].endswith("fell at 1.50 s, needs feedback, without: falls |"), rows[4])

    def test_both_worlds_are_compared_over_the_same_cycles(self):
        def ours(ratios, fell=None):
            cycles = [{"forward_m": ratio, "left_m": 0.0, "turn_rad": 0.0} for ratio in ratios]
            return {"240": {"cycles": cycles, "fell_at_s": fell}, "60": {"cycles": cycles, "fell_at_s": None}}

        level, ground = [], []
        for motion, ratio, ratios, fell in [
            ("walk", 1.0, [0.5, 1.01, 1.01, 1.01, 1.01, 3.0], None), ("turn", 1.0, [0.9], None), ("run", 1.0, [], 0.5),
        ]:
            planned = {"forward_m": 1.0, "left_m": 0.0, "turn_rad": 0.0}
            level.append(dict(self.result(motion, "torque", ratio), planned=planned))
            level.append(dict(self.result(motion, "none", 0.3), planned=planned))
            ground.append({"plan": f"motions-{motion}.json", "rates": ours(ratios, fell)})
        rows = tables.compared(level, ground).splitlines()
        self.assertEqual(rows[2], "| `walk` of pup | 1.000 | 1.010 | 1.010 | 0.010 |  |")
        self.assertEqual(rows[3], "| `turn` of pup | 1.000 | 0.900 | 0.900 | 0.100 | **differs** |")
        self.assertEqual(rows[4], "| `run` of pup | 1.000 | – | – | – | falls in ours only |")
        words = " ".join(tables.compared_in_words(level, ground).split())
        self.assertIn("Of 3 motions 2 stay on their feet in both worlds", words)
        self.assertIn("and 1 of these agree within 0.03 of the plan at 1/240 s. Apart: `turn` of pup (0.100).", words)
        self.assertTrue(words.endswith("A fall in only one world: `run` of pup."), words)

    def test_the_same_commands_are_compared_goal_by_goal(self):
        def result(motion, ours, mujoco, fell=None):
            way = lambda ahead: {"forward_m": ahead, "left_m": 0.001, "turn_rad": 0.0}
            return {
                "motion": motion, "robot": "pup", "plan": f"motions-{motion}.json", "planned": way(0.5), "goals": ["forward_m"],
                "ours": way(ours), "mujoco": way(mujoco), "fell_at_s": {"ours": None, "mujoco": fell},
            }

        results = [
            result("walk", 0.5, 0.51), result("trot", 0.5, 0.4), result("run", 0.5, 0.5, 2.0),
            {"motion": "fly", "robot": "pup", "plan": "motions-fly.json", "refused": "too fast"},
        ]
        rows = tables.behind_firmware(results).splitlines()
        self.assertEqual(rows[2:], [
            "| `walk` of pup | 1.000 | 1.020 | 0.020 |  |", "| `trot` of pup | 1.000 | 0.800 | 0.200 | **differs** |",
            "| `run` of pup | 1.000 | 1.000 | 0.000 | falls in MuJoCo |", "| `fly` of pup | – | – | – | too fast |",
        ])
        results.append(dict(result("hop", 0.5, 0.5), ours=None, mujoco=None, planned=None, goals=None))
        self.assertTrue(tables.behind_firmware(results).splitlines()[-1].endswith("| – | – | – | **not played** |"))
        words = " ".join(tables.behind_firmware_in_words(results).split())
        self.assertIn("4 of 5 motions go into a library", words)
        self.assertIn("Of these 2 stay on their feet in both worlds; 2 of them go or turn", words)
        self.assertIn("and 1 of those agree within 0.03 of the plan. Apart: `trot`", words)
        self.assertTrue(words.endswith("A fall in only one world: `run` of pup."), words)


if __name__ == "__main__":
    unittest.main()
