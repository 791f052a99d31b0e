"""Tests of the installed package `rollwalk` against the command line and against itself.

    ROLLWALK=path/to/rollwalk python -m unittest discover apps/python/tests

`cargo xtask nightly --only wheel` builds the wheel, installs it in a separate environment and runs these tests there.
"""

import csv
import json
import os
import signal
import subprocess
import tempfile
import threading
import time
import unittest
from pathlib import Path

import numpy as np
import rollwalk

# A few seconds of work.
LONG = "table_2_1/creature3_fast_walk"

STAND = """
name = "stand"
robot = "pup.toml"
ends = "at_rest"
duration_s = {duration_s}
samples = 11
[footfalls]
all = "stance"
[goal]
forward_m = {forward_m}
left_m = 0.0
turn_rad = 0.0
"""


def move(forward_m: float = 0.05, duration_s: float = 1.0) -> rollwalk.Motion:
    """A short drive of Pup."""
    robot = rollwalk.Robot.shipped("pup")
    return rollwalk.Motion.from_toml(STAND.format(forward_m=forward_m, duration_s=duration_s), robot)


class CommandLine(unittest.TestCase):
    """Effects and messages equal those of the command line."""

    def setUp(self) -> None:
        self.rollwalk = os.environ["ROLLWALK"]
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        rollwalk.write_shipped(self.folder)

    def run_rollwalk(self, *words: object, status: int = 0) -> subprocess.CompletedProcess:
        words = [self.rollwalk, *map(str, words)]
        done = subprocess.run(words, cwd=self.folder, capture_output=True, text=True, encoding="utf-8")
        self.assertEqual(done.returncode, status, done.stderr)
        return done

    def test_plans_and_libraries_are_the_same_to_the_byte(self) -> None:
        path = self.folder / "motions" / "pup_walk.toml"
        self.run_rollwalk("plan", path, "-o", "theirs.json")
        plan = rollwalk.plan(rollwalk.Motion.from_file(path), threads=1)
        plan.save(self.folder / "ours.json")
        theirs = (self.folder / "theirs.json").read_bytes()
        self.assertEqual((self.folder / "ours.json").read_bytes(), theirs)

        library = self.folder / "motions" / "pup_library.toml"
        self.run_rollwalk("library", "build", library, "-o", "theirs.rwl")
        self.assertEqual(rollwalk.build_library(library), (self.folder / "theirs.rwl").read_bytes())

    def test_a_plan_from_another_one_is_the_same_to_the_byte(self) -> None:
        text = STAND.format(forward_m=0.06, duration_s=1.0).replace("pup.toml", "robots/pup.toml")
        (self.folder / "further.toml").write_text(text)
        plan = rollwalk.plan(move())
        plan.save(self.folder / "plan.json")
        words = ["plan", "further.toml", "--from", "plan.json", "-o", "theirs.json"]
        self.run_rollwalk(*words)
        plan.replan(rollwalk.Motion.from_file(self.folder / "further.toml")).save(self.folder / "ours.json")
        theirs = (self.folder / "theirs.json").read_bytes()
        self.assertEqual((self.folder / "ours.json").read_bytes(), theirs)

    def test_samples_are_the_columns_of_an_export(self) -> None:
        path = self.folder / "walk.json"
        plan = rollwalk.plan(rollwalk.Motion.shipped("pup_walk"))
        plan.save(path)
        self.run_rollwalk("export", path, "--rate", 50, "-o", "walk.csv")
        with open(self.folder / "walk.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        samples = plan.sample(50.0)
        column = lambda name: np.array([float(row[name]) for row in rows])  # noqa: E731
        np.testing.assert_array_equal(samples.time_s, column("time_s"))
        np.testing.assert_array_equal(samples.base_position_m[:, 2], column("base_z_m"))
        np.testing.assert_array_equal(samples.base_orientation_wxyz[:, 3], column("base_qz"))
        np.testing.assert_array_equal(samples.base_yaw_pitch_roll_rad[:, 1], column("base_pitch_rad"))
        np.testing.assert_array_equal(samples.com_m[:, 0], column("com_x_m"))
        np.testing.assert_array_equal(samples.base_velocity_m_s[:, 0], column("base_vx_m_s"))
        np.testing.assert_array_equal(samples.base_angular_velocity_rad_s[:, 2], column("base_wz_rad_s"))
        for k, joint in enumerate(samples.joint_names):
            np.testing.assert_array_equal(samples.joint_rad[:, k], column(f"{joint}_rad"))
            np.testing.assert_array_equal(samples.joint_speed_rad_s[:, k], column(f"{joint}_rad_s"))
            np.testing.assert_array_equal(samples.joint_torque_nm[:, k], column(f"{joint}_nm"))
        for j, foot in enumerate(samples.end_effector_names):
            np.testing.assert_array_equal(samples.contact[:, j], column(f"{foot}_contact") == 1.0)
            np.testing.assert_array_equal(samples.contact_point_m[:, j, 1], column(f"{foot}_y_m"))
            np.testing.assert_array_equal(samples.contact_force_n[:, j, 2], column(f"{foot}_fz_n"))
            np.testing.assert_array_equal(samples.wheel_speed_rad_s[:, j], column(f"{foot}_wheel_rad_s"))
            np.testing.assert_array_equal(samples.motor_speed_rad_s[:, j], column(f"{foot}_motor_rad_s"))
            np.testing.assert_array_equal(samples.motor_torque_nm[:, j], column(f"{foot}_motor_nm"))

    def test_reports_and_runs_are_the_same(self) -> None:
        plan = rollwalk.plan(move())
        plan.save(self.folder / "plan.json")
        report = plan.report()
        self.assertTrue(report.consistent)
        said = self.run_rollwalk("report", "plan.json").stdout
        self.assertIn(report.verdict, said)
        self.assertTrue(said.startswith(str(report).removesuffix(report.verdict)))
        theirs = json.loads(self.run_rollwalk("report", "plan.json", "--json").stdout)["rows"]
        ours = [(of.name, of.worst, of.unit, of.tolerance, of.equation) for of in report.residuals]
        keys = ("name", "worst", "unit", "level", "equation")
        self.assertEqual(ours, [tuple(row[key] for key in keys) for row in theirs])

        theirs = json.loads(self.run_rollwalk("simulate", "plan.json", "--mass", 1.2, "--json").stdout)
        run = rollwalk.simulate(plan, mass_ratio=1.2)
        self.assertEqual(run.holds, theirs["holds"])
        names = ("forward_m", "left_m", "turn_rad")
        cycles = [[cycle[name] for name in names] for cycle in theirs["cycles"]]
        np.testing.assert_array_equal(run.ways, cycles)
        np.testing.assert_array_equal(run.planned_way, [theirs["planned"][name] for name in names])
        self.assertEqual((run.slid_m, run.work_j), (theirs["slid_m"], theirs["work_j"]))

    def test_errors_have_the_same_words(self) -> None:
        path = self.folder / "robots" / "pup.toml"
        text = path.read_text(encoding="utf-8")
        broken = text.replace("speed_max_rad_s", "speed_limit_rad_s", 1)
        self.assertNotEqual(broken, text)
        path.write_text(broken, encoding="utf-8")
        said = self.run_rollwalk("robot", "check", path, status=1).stderr
        with self.assertRaises(rollwalk.RollwalkError) as raised:
            rollwalk.Robot.from_file(path)
        self.assertEqual(str(raised.exception).strip(), said.strip())
        self.assertIn("speed_limit_rad_s", said)
        # The same if another file names it.
        with self.assertRaises(rollwalk.RollwalkError) as again:
            rollwalk.build_library(self.folder / "motions" / "pup_library.toml")
        self.assertEqual(str(again.exception), str(raised.exception))

    def test_an_infeasible_request_has_the_same_words(self) -> None:
        text = STAND.format(forward_m=0.5, duration_s=1.0).replace("pup.toml", "robots/pup.toml")
        (self.folder / "far.toml").write_text(text)
        said = self.run_rollwalk("plan", "far.toml", "-o", "far.json", status=3).stdout
        with self.assertRaises(rollwalk.Infeasible) as raised:
            rollwalk.plan(rollwalk.Motion.from_file(self.folder / "far.toml"))
        why = raised.exception
        self.assertIn(str(why.diagnosis), said)
        self.assertIn(str(why).removeprefix("stand "), said)
        why.plan.save(self.folder / "ours.json")
        theirs = (self.folder / "far.json").read_bytes()
        self.assertEqual((self.folder / "ours.json").read_bytes(), theirs)


class Robots(unittest.TestCase):
    def test_links_are_where_joints_say(self) -> None:
        robot = rollwalk.Robot.shipped("pup")
        q = robot.nominal_joint_rad
        self.assertEqual(q.shape, (len(robot.joint_names),))
        self.assertTrue((robot.joint_min_rad <= q).all() and (q <= robot.joint_max_rad).all())
        position_m, orientation = robot.link_poses(q)
        self.assertEqual(position_m.shape, (len(robot.link_names), 3))
        np.testing.assert_allclose(np.linalg.norm(orientation, axis=1), 1.0, atol=1e-12)
        # A quarter turn to the left takes x to y.
        turned_m, _ = robot.link_poses(q, [1.0, 2.0, 3.0], [1.0, 0.0, 0.0, 1.0])
        x, y, z = position_m.T
        np.testing.assert_allclose(turned_m, np.stack([1.0 - y, 2.0 + x, 3.0 + z], axis=1), atol=1e-12)
        standing_m, _ = robot.standing_link_poses()
        np.testing.assert_allclose(standing_m[0, 2] - standing_m[1:, 2], -(position_m[1:, 2]), atol=1e-2)

    def test_wrong_poses_are_refused(self) -> None:
        robot = rollwalk.Robot.shipped("pup")
        q = robot.nominal_joint_rad
        for words, pose in [
            ("3 joint angles; expected [0-9]+, one for each joint of `pup`", ([0.0] * 3,)),
            ("NaN in a pose", (q, [np.nan, 0.0, 0.0])),
            ("base_orientation_wxyz is 0", (q, [0.0] * 3, [0.0] * 4)),
        ]:
            with self.assertRaisesRegex(rollwalk.RollwalkError, words):
                robot.link_poses(*pose)

    def test_files_that_cannot_be_read(self) -> None:
        with self.assertRaises(FileNotFoundError) as raised:
            rollwalk.Robot.from_file("nowhere/pup.toml")
        self.assertEqual(raised.exception.filename, "nowhere/pup.toml")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "bytes.toml"
            path.write_bytes(b"\xff")
            with self.assertRaisesRegex(rollwalk.RollwalkError, "is not a robot file: it is not UTF-8"):
                rollwalk.Robot.from_file(path)
            with self.assertRaises(OSError):
                rollwalk.Robot.from_file(folder)
            # A motion that names no file.
            path.write_text("robot = 'gone.toml'")
            with self.assertRaises(FileNotFoundError) as raised:
                rollwalk.Motion.from_file(path)
            self.assertEqual(Path(raised.exception.filename), Path(folder) / "gone.toml")
            with self.assertRaises(FileNotFoundError):
                rollwalk.plan(move()).save(Path(folder) / "gone" / "plan.json")

    def test_names_of_what_ships_are_listed(self) -> None:
        with self.assertRaisesRegex(rollwalk.RollwalkError, "no robot file `wolf` ships .*agilebot.*pup"):
            rollwalk.Robot.shipped("wolf")

    def test_files_that_are_there_are_not_touched(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            written = rollwalk.write_shipped(folder)
            mine = Path(folder) / "robots" / "pup.toml"
            self.assertIn(mine, written)
            mine.write_text("mine")
            self.assertEqual(rollwalk.write_shipped(folder), [])
            self.assertEqual(mine.read_text(), "mine")


class Plans(unittest.TestCase):
    def test_shapes_and_physics(self) -> None:
        motion = rollwalk.Motion.shipped("pup_walk")
        plan = rollwalk.plan(motion)
        samples = plan.sample(40.0)
        rows, joints, feet = len(samples.time_s), 8, 4
        self.assertEqual(rows, round(40.0 * plan.duration_s), "the row that repeats is left out")
        self.assertEqual(samples.joint_rad.shape, (rows, len(samples.joint_names)))
        self.assertEqual(len(samples.joint_names), joints)
        self.assertEqual(samples.contact.shape, (rows, feet))
        self.assertEqual(samples.contact.dtype, np.bool_)
        self.assertEqual(samples.contact_force_n.shape, (rows, feet, 3))
        # On average over a period, the ground carries the weight, and feet in swing carry nothing.
        weight_n = 9.80665 * plan.robot.mass_kg
        mean_n = samples.contact_force_n.sum(axis=1).mean(axis=0)
        np.testing.assert_allclose(mean_n, [0.0, 0.0, weight_n], atol=0.02 * weight_n)
        self.assertFalse(samples.contact.all())
        speed = np.gradient(samples.joint_rad, samples.time_s, axis=0)
        np.testing.assert_allclose(speed[1:-1], samples.joint_speed_rad_s[1:-1], atol=0.5)
        np.testing.assert_allclose(plan.reached, motion.goal, atol=1e-3)
        self.assertEqual(motion.stance.shape[1], feet)

    def test_arrays_are_copies(self) -> None:
        plan = rollwalk.plan(move())
        samples = plan.sample()
        samples.com_m[:] = 0.0
        self.assertTrue((plan.sample().com_m[:, 2] > 0.0).all())

    def test_rates_that_cannot_be(self) -> None:
        plan = rollwalk.plan(move())
        for rate_hz in [0.0, -1.0, np.nan, 1e9]:
            with self.assertRaisesRegex(rollwalk.RollwalkError, "expected a rate above 0"):
                plan.sample(rate_hz)

    def test_too_few_iterations_do_not_hold(self) -> None:
        with self.assertRaisesRegex(rollwalk.NotConsistent, "did not converge") as raised:
            rollwalk.plan(rollwalk.Motion.shipped(LONG), iterations=3)
        self.assertNotIsInstance(raised.exception, rollwalk.Infeasible)
        self.assertEqual(raised.exception.plan.status, "iteration limit reached")
        self.assertFalse(raised.exception.plan.report().consistent)

    def test_plans_of_other_robots_are_no_start(self) -> None:
        plan = rollwalk.plan(move())
        with self.assertRaisesRegex(rollwalk.RollwalkError, "is for robot `pup`, whose joints"):
            plan.replan(rollwalk.Motion.shipped("stand"))

    def test_a_diagnosis_says_what_would_do(self) -> None:
        with self.assertRaises(rollwalk.Infeasible) as raised:
            rollwalk.plan(move(forward_m=0.5))
        fields = {of.field: of for of in raised.exception.diagnosis.culprits if of.would_do is not None}
        goal = fields["forward_m"]
        self.assertEqual((goal.given, goal.unit), (0.5, "m"))
        rollwalk.plan(move(forward_m=goal.would_do))


class ManyPlans(unittest.TestCase):
    def test_plans_are_those_of_each_motion_alone(self) -> None:
        first = rollwalk.plan(move())
        motions = [move(0.05 + 0.01 * k) for k in range(4)]
        with tempfile.TemporaryDirectory() as folder:

            def text(plan: rollwalk.Plan) -> bytes:
                path = Path(folder) / "plan.json"
                plan.save(path)
                return path.read_bytes()

            for start, alone in [(None, rollwalk.plan), (first, first.replan)]:
                expected = [text(alone(motion)) for motion in motions]
                for threads in [1, 3]:
                    seen = []
                    plans = rollwalk.plan_many(motions, start=start, threads=threads, progress=seen.append)
                    self.assertEqual([text(plan) for plan in plans], expected)
                    self.assertEqual((seen[-1].done, seen[-1].total), (4, 4))
                    self.assertGreater(seen[-1].plans_per_s_and_core, 0.0)

    def test_exceptions_stand_in_place_of_plans(self) -> None:
        motions = [move(), move(forward_m=0.5), rollwalk.Motion.shipped("stand")]
        plan, far, other = rollwalk.plan_many(motions, start=rollwalk.plan(move()))
        self.assertIsInstance(plan, rollwalk.Plan)
        self.assertIsInstance(far, rollwalk.Infeasible)
        self.assertIn("forward_m is 0.5", str(far))
        self.assertRegex(str(other), "is for robot `pup`, whose joints")
        self.assertEqual(rollwalk.plan_many([]), [])

    def test_what_a_callback_raises_ends_the_work(self) -> None:
        class Enough(Exception):
            pass

        def enough(_: object) -> None:
            raise Enough

        with self.assertRaises(Enough):
            rollwalk.plan_many([rollwalk.Motion.shipped(LONG)] * 8, progress=enough)


class LongWork(unittest.TestCase):
    def test_progress_ends_with_the_last_iteration(self) -> None:
        seen = []
        plan = rollwalk.plan(move(), threads=1, samples_fixed=True, progress=seen.append)
        self.assertGreater(len(seen), 0)
        self.assertEqual({state.motion for state in seen}, {"stand"})
        self.assertEqual(seen[-1].iteration, plan.iterations)
        self.assertLess(seen[-1].worst_level, 0.2 + 1e-9)
        shares = []
        rollwalk.simulate(plan, progress=shares.append)
        self.assertEqual(shares[-1], 1.0)

    def test_what_a_callback_raises_ends_the_work(self) -> None:
        class Enough(Exception):
            pass

        def enough(_: object) -> None:
            raise Enough

        for work in [
            lambda: rollwalk.plan(rollwalk.Motion.shipped(LONG), progress=enough),
            lambda: rollwalk.simulate(rollwalk.plan(move()), progress=enough),
        ]:
            with self.assertRaises(Enough):
                work()

    def test_ctrl_c_ends_the_work(self) -> None:
        # Shells start background programs with SIGINT ignored, and Python keeps that.
        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        self.addCleanup(signal.signal, signal.SIGINT, before)
        begun = threading.Event()

        def interrupt() -> None:
            begun.wait()
            os.kill(os.getpid(), signal.SIGINT)

        threading.Thread(target=interrupt).start()
        ended = False
        with self.assertRaises(KeyboardInterrupt):
            rollwalk.plan(rollwalk.Motion.shipped(LONG), progress=lambda _: begun.set())
            ended = True
        self.assertFalse(ended, "the plan was interrupted, not what came after it")

    def test_other_threads_run_meanwhile(self) -> None:
        turns = 0
        done = threading.Event()

        def take_turns() -> None:
            nonlocal turns
            while not done.is_set():
                turns += 1
                time.sleep(1e-3)

        other = threading.Thread(target=take_turns)
        other.start()
        before = turns
        rollwalk.plan(rollwalk.Motion.shipped(LONG))
        during = turns - before
        done.set()
        other.join()
        # Ticks during a second or more. With the lock held, there would be at most one.
        self.assertGreater(during, 20)


class Runs(unittest.TestCase):
    def test_a_run_has_every_step(self) -> None:
        plan = rollwalk.plan(move())
        run = rollwalk.simulate(plan, rate_hz=100)
        self.assertTrue(run.holds)
        self.assertIsNone(run.fell_at_s)
        forward, left, turn = run.ratios
        self.assertAlmostEqual(forward, 1.0, delta=0.05)
        self.assertEqual((left, turn), (None, None))
        np.testing.assert_allclose(run.drift, run.ways - run.planned_way)
        rows = len(run.time_s)
        self.assertEqual(run.joint_rad.shape, (rows, len(plan.robot.joint_names)))
        self.assertEqual(run.contact_force_n.shape, (rows, 4, 3))
        self.assertEqual((run.motion_time_s[0], run.motion_time_s[-1]), (0.0, plan.duration_s))
        way_m = run.com_m[-1, 0] - run.com_m[0, 0]
        self.assertAlmostEqual(way_m, run.ways[0, 0], delta=5e-3)
        weight_n = 9.80665 * plan.robot.mass_kg
        self.assertAlmostEqual(run.contact_force_n[-1, :, 2].sum() / weight_n, 1.0, delta=0.02)

    def test_numbers_out_of_range_are_refused(self) -> None:
        plan = rollwalk.plan(move())
        for name, value in [("rate_hz", 1), ("cycles", 0), ("mass_ratio", 0.0), ("friction", np.nan)]:
            with self.assertRaisesRegex(rollwalk.RollwalkError, f"{name} is .*; expected"):
                rollwalk.simulate(plan, **{name: value})


class Designs(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        rollwalk.write_shipped(self.folder)
        path = self.folder / "design.toml"
        path.write_text(
            'name = "legs"\nrobot = "robots/pup.toml"\nmotions = [ { file = "motions/pup_drive.toml" } ]\n'
            '[[parameter]]\nname = "wheel"\nradius_of = "leg/*"\nmin_m = 0.02\nmax_m = 0.05\n'
        )
        self.design = rollwalk.Design.from_file(path)

    def test_gradients_are_differences_of_plans(self) -> None:
        [wheel] = self.design.parameters
        self.assertEqual((wheel.name, wheel.unit), ("wheel", "m"))
        features, objectives = ["height"], ["peak_joint_torque", "power"]
        at = lambda value: self.design.gradients(objectives, features, values={"wheel": value})[0]  # noqa: E731
        here, step = at(wheel.value), 1e-3
        ahead, behind = at(wheel.value + step), at(wheel.value - step)
        for name in objectives:
            difference = (ahead.objectives[name] - behind.objectives[name]) / (2.0 * step)
            np.testing.assert_allclose(here.gradients[name], [difference], rtol=0.02)
        difference = (ahead.features["height"] - behind.features["height"]) / (2.0 * step)
        scale = np.abs(difference).max()
        np.testing.assert_allclose(here.jacobians["height"][:, 0], difference, atol=0.02 * scale)
        self.assertEqual(here.plan.name, "drive")

    def test_names_that_there_are_not(self) -> None:
        for words, work in [
            ("no objective `speed`: give one of .*power", lambda: self.design.gradients(["speed"])),
            ("no feature `gait`: give one of .*height", lambda: self.design.gradients([], ["gait"])),
            ("no parameter `leg`: give one of wheel", lambda: self.design.robot_toml({"leg": 1.0})),
        ]:
            with self.assertRaisesRegex(rollwalk.RollwalkError, words):
                work()

    def test_the_robot_file_follows(self) -> None:
        text = self.design.robot_toml({"wheel": 0.035})
        rollwalk.Robot.from_toml(text)
        self.assertIn("0.035", text)


class Stubs(unittest.TestCase):
    def test_everything_public_is_documented(self) -> None:
        for name in rollwalk.__all__:
            thing = getattr(rollwalk, name)
            self.assertTrue(thing.__doc__, name)
            if not isinstance(thing, type) or issubclass(thing, Exception):
                continue
            for member, value in vars(thing).items():
                if not member.startswith("_"):
                    self.assertTrue(value.__doc__, f"{name}.{member}")


if __name__ == "__main__":
    unittest.main()
