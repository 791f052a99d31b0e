"""Tests of exported plans, read by their tools: MuJoCo, MCAP readers, ROS messages.

Run by `cargo xtask test --only exports`, which sets ROLLWALK to the command line under test.
"""

import csv
import json
import os
import pathlib
import subprocess
import tempfile
import unittest

import mujoco
import numpy as np
from mcap.reader import make_reader

import replay

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Longest run of a command, on a busy computer.
COMMAND_S = 600.0
# Motions with a goal: a drive, a walk, a turn, and a motion on wheels without motors.
MOTIONS = ("drive_1m", "walk", "turn_in_place", "swizzlebot_forward")


class Exports(unittest.TestCase):
    """Files that one plan of each motion is exported to."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        for motion in MOTIONS:
            run("plan", ROOT / f"shipped/motions/{motion}.toml", "-o", cls.path(f"{motion}.plan.json"))
            for ending in ("xml", "mcap", "csv"):
                run("export", cls.path(f"{motion}.plan.json"), "-o", cls.path(f"{motion}.{ending}"))

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    @classmethod
    def path(cls, name):
        """A file of the test."""
        return pathlib.Path(cls.folder.name) / name

    def table(self, motion):
        """Columns of the exported table."""
        with open(self.path(f"{motion}.csv"), encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}

    def test_motions_come_to_their_goals_in_mujoco(self):
        for motion in MOTIONS:
            planned, played, height = replay.Motion(self.path(f"{motion}.xml")).play()
            goal = np.argmax(np.abs(planned))
            ratio = played[goal] / planned[goal]
            print(f"{motion}: {ratio:.4f} of the planned way, lowest body {height:.3f} of the plan's")
            self.assertTrue(0.95 <= ratio <= 1.05, f"{motion}: {played} of {planned}")
            self.assertGreater(height, 0.9, motion)

    def over(self, terrain, robot, duration_s, samples, forward_m):
        """A drive over a terrain, planned and exported."""
        self.path("over.toml").write_text(
            f"""name = "over"
            robot = "{ROOT}/shipped/robots/{robot}.toml"
            terrain = "{terrain}.toml"
            ends = "at_rest"
            duration_s = {duration_s}
            samples = {samples}
            footfalls = {{ all = "stance" }}
            goal = {{ forward_m = {forward_m}, left_m = 0.0, turn_rad = 0.0 }}
            """
        )
        run("plan", self.path("over.toml"), "-o", self.path("over.json"))
        run("export", self.path("over.json"), "-o", self.path("over.xml"))
        return replay.Motion(self.path("over.xml"))

    def test_terrain_is_crossed_in_mujoco(self):
        kerb = "[step]\nat_x_m = 0.6\nheight_m = 0.019\n"
        rough = "heading_deg = 30\n[rough]\nheight_m = 0.03\nspacing_m = 0.2\nhalf_m = 2\nseed = 1\n"
        slope = "[slope]\nangle_deg = 8\n"
        stairs = "[stairs]\nat_x_m = 0.6\ncount = 2\nriser_m = -0.015\ntread_m = 0.5\n"
        for name, terrain in {"kerb": kerb, "rough": rough, "slope": slope, "stairs": stairs}.items():
            self.path(f"{name}.toml").write_text(terrain)
            motion = self.over(name, "anymal_wheels", 5.0, 100, 1.3)
            planned, played, height = motion.play()
            print(f"{name}: {played[0] / planned[0]:.4f} of the planned way")
            self.assertTrue(0.95 <= played[0] / planned[0] <= 1.05, f"{name}: {played} of {planned}")
            self.assertGreater(height, 0.9, name)

    def test_obstacles_are_passed_in_mujoco(self):
        box = '[[obstacle]]\nname = "crate"\nbox_m = [0.1, 0.1, 0.4]\nat_m = [0.5, 0.05, 0.2]\n'
        bar = '[[obstacle]]\nname = "bar"\nfrom_m = [0.5, -0.5, 0.28]\nto_m = [0.5, 0.5, 0.28]\nradius_m = 0.02\n'
        for name, terrain in {"box": box, "bar": bar}.items():
            self.path(f"{name}.toml").write_text(terrain)
            motion = self.over(name, "agilebot", 4.0, 45, 1.0)
            planned, played, height = motion.play()
            print(f"{name}: {played[0] / planned[0]:.4f} of the planned way")
            self.assertTrue(0.95 <= played[0] / planned[0] <= 1.05, f"{name}: {played} of {planned}")
            self.assertEqual(motion.touched("obstacle_0"), 0, name)

    def test_keyframes_are_the_rows_of_the_table(self):
        for motion in MOTIONS:
            table, frames = self.table(motion), replay.Motion(self.path(f"{motion}.xml"))
            for row, state in enumerate(frames.states[: len(table["time_s"])]):
                self.assertAlmostEqual(frames.times_s[row], table["time_s"][row], delta=1e-9)
                for column, value in zip("xyz", state[:3]):
                    self.assertAlmostEqual(table[f"base_{column}_m"][row], value, delta=1e-9)
                for joint in range(1, frames.model.njnt):
                    name = frames.model.joint(joint).name
                    if f"{name}_nm" in table:
                        place = frames.model.jnt_qposadr[joint]
                        self.assertAlmostEqual(table[f"{name}_rad"][row], state[place], delta=1e-9)

    def test_velocities_of_keyframes_are_those_of_their_states(self):
        for motion in MOTIONS:
            frames = replay.Motion(self.path(f"{motion}.xml"))
            model = frames.model
            speeds = model.key_qvel.reshape(model.nkey, model.nv)
            for key in range(1, model.nkey - 1):
                mean = np.zeros(model.nv)
                span_s = frames.times_s[key + 1] - frames.times_s[key - 1]
                mujoco.mj_differentiatePos(model, mean, span_s, frames.states[key - 1], frames.states[key + 1])
                # Central differences over 33 ms, within which curves of swings bend.
                difference = np.abs(mean - speeds[key])
                allowed = 0.05 + 0.1 * np.abs(speeds).max(axis=0)
                self.assertTrue(np.all(difference < allowed), f"{motion} {key}: {difference}")

    def test_recordings_have_the_frames_of_the_models(self):
        for motion in MOTIONS:
            frames = replay.Motion(self.path(f"{motion}.xml"))
            model, data = frames.model, mujoco.MjData(frames.model)
            topics = {}
            with open(self.path(f"{motion}.mcap"), "rb") as file:
                for schema, channel, message in make_reader(file).iter_messages():
                    self.assertEqual((schema.encoding, channel.message_encoding), ("jsonschema", "json"))
                    content = json.loads(message.data)
                    self.assertEqual(json.loads(schema.data)["title"], schema.name)
                    topics.setdefault(channel.topic, []).append((message.log_time, content))
            counts = {topic: len(messages) for topic, messages in topics.items()}
            expected = {topic: model.nkey for topic in ("/tf", "/joint_states", "/forces", "/com")}
            self.assertEqual(counts, {**expected, "/robot": 1})
            seen = {entity["frame_id"] for entity in topics["/robot"][0][1]["entities"]}
            for key, (log_time, message) in enumerate(topics["/tf"]):
                self.assertAlmostEqual(log_time * 1e-9, frames.times_s[key], delta=1e-8)
                mujoco.mj_resetDataKeyframe(model, data, key)
                mujoco.mj_kinematics(model, data)
                places = world_frames(message["transforms"])
                self.assertEqual(seen, set(places) - {"world"})
                for body in range(1, model.nbody):
                    name = model.body(body).name
                    if name in places:
                        np.testing.assert_allclose(places[name][:3, 3], data.xpos[body], atol=1e-9)
                        turn = data.xmat[body].reshape(3, 3)
                        # A free wheel has no encoder: its angle is not in a plan.
                        if not is_free_wheel(model, body):
                            np.testing.assert_allclose(places[name][:3, :3], turn, atol=1e-9)

    def test_trajectories_fill_ros_messages(self):
        for motion in MOTIONS:
            plan, out = self.path(f"{motion}.plan.json"), self.path(f"{motion}.ros.json")
            run("export", plan, "--format", "ros", "-o", out)
            message = json.loads(out.read_text(encoding="utf-8"))
            joints, base = message["joint_trajectory"], message["multi_dof_joint_trajectory"]
            frames = replay.Motion(self.path(f"{motion}.xml"))
            self.assertEqual(len(joints["points"]), frames.model.nkey)
            self.assertEqual(len(joints["joint_names"]), frames.model.nu)
            for key, (joint, body) in enumerate(zip(joints["points"], base["points"])):
                time = joint["time_from_start"]
                self.assertAlmostEqual(time["sec"] + 1e-9 * time["nanosec"], frames.times_s[key], delta=1e-8)
                at = body["transforms"][0]["translation"]
                np.testing.assert_allclose([at["x"], at["y"], at["z"]], frames.states[key][:3], atol=1e-9)
                for field in ("positions", "velocities", "effort"):
                    self.assertEqual(len(joint[field]), len(joints["joint_names"]))

    def test_a_wrong_format_is_refused_with_what_would_be_right(self):
        plan = self.path("walk.plan.json")
        for arguments, expected in (
            (["-o", self.path("walk.bag")], ".csv, .json, .mcap, .npz or .xml"),
            (["--format", "mcap", "-o", self.path("walk.csv")], ".mcap"),
            (["--rate", "0", "-o", self.path("walk.mcap")], "above 0"),
        ):
            outcome = run("export", plan, *arguments, fails=True)
            self.assertIn(expected, " ".join(outcome.split()))


def is_free_wheel(model, body):
    """True if a body turns about a joint without a motor."""
    joint = model.body_jntadr[body]
    return joint > 0 and joint not in model.actuator_trnid[:, 0]


def world_frames(transforms):
    """World-from-frame matrices of a message, whose parents come before their children."""
    places = {"world": np.eye(4)}
    waiting = list(transforms)
    while waiting:
        transform = waiting.pop(0)
        if transform["parent_frame_id"] not in places:
            waiting.append(transform)
            continue
        place, q = np.eye(4), transform["rotation"]
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, np.array([q[of] for of in "wxyz"]))
        place[:3, :3] = turn.reshape(3, 3)
        place[:3, 3] = [transform["translation"][of] for of in "xyz"]
        places[transform["child_frame_id"]] = places[transform["parent_frame_id"]] @ place
    return places


def run(*arguments, fails=False):
    """Runs the command line; returns its stderr."""
    command = [os.environ["ROLLWALK"], *map(str, arguments)]
    outcome = subprocess.run(command, capture_output=True, text=True, check=False, timeout=COMMAND_S)
    if (outcome.returncode != 0) != fails:
        raise AssertionError(f"{command}: exit code {outcome.returncode}\n{outcome.stderr}")
    return outcome.stderr


if __name__ == "__main__":
    unittest.main()
