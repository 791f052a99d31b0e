"""Tests of motion data for learning, with NumPy and MuJoCo: arrays of the layout, poses and velocities of the model, repeats.

Run by `cargo xtask test --only exports`, which sets ROLLWALK to the command line under test.
"""

import pathlib
import tempfile
import unittest

import mujoco
import numpy as np

from test_exports import ROOT, run

# A motion at rest, a gait, a motion on free wheels, one on blades, and joints with crank and rod.
MOTIONS = ("drive_1m", "walk", "swizzlebot_forward", "skate", "pup_five_bar_walk")
# Frames a second, and lengths of periodic motions and of the one at rest, s.
RATE_HZ, LENGTH_S, DRIVE_S = 500, 5.0, 4.0
WEIGHT_M_S2 = 9.80665


class MotionData(unittest.TestCase):
    """Motion data of one plan of each motion."""

    @classmethod
    def setUpClass(cls):
        with tempfile.TemporaryDirectory() as folder:
            cls.data = {motion: cls.exported(pathlib.Path(folder), motion) for motion in MOTIONS}

    @staticmethod
    def exported(folder, motion):
        plan, out = folder / "plan.json", folder / "motion.npz"
        run("plan", ROOT / f"shipped/motions/{motion}.toml", "-o", plan)
        run("export", plan, "--rate", RATE_HZ, "--length", LENGTH_S, "-o", out)
        with np.load(out, allow_pickle=False) as data:
            return dict(data)

    def models(self):
        for motion, data in self.data.items():
            model = mujoco.MjModel.from_xml_string(data["mjcf"].item())
            yield motion, data, model, mujoco.MjData(model)

    def test_arrays_have_the_layout_of_tracking_tasks(self):
        for motion, data, model, _ in self.models():
            frames, bodies, joints = len(data["joint_pos"]), model.nbody - 1, model.njnt - 1
            feet = len(data["end_effector_names"])
            shapes = {
                "fps": (1,),
                "joint_pos": (frames, joints),
                "joint_vel": (frames, joints),
                "body_pos_w": (frames, bodies, 3),
                "body_quat_w": (frames, bodies, 4),
                "body_lin_vel_w": (frames, bodies, 3),
                "body_ang_vel_w": (frames, bodies, 3),
                "motor_torque_nm": (frames, model.nu),
                "contact": (frames, feet),
                "contact_force_n": (frames, feet, 3),
            }
            self.assertEqual({name: data[name].shape for name in shapes}, shapes, motion)
            for name in shapes:
                self.assertEqual(data[name].dtype, bool if name == "contact" else np.float32, name)
                self.assertTrue(np.all(np.isfinite(data[name])), name)
            self.assertEqual(data["fps"].item(), RATE_HZ)
            names = {
                "body_names": [model.body(number).name for number in range(1, model.nbody)],
                "joint_names": [model.joint(number).name for number in range(1, model.njnt)],
                "motor_names": [model.actuator(number).name for number in range(model.nu)],
            }
            for name, expected in names.items():
                self.assertEqual(list(data[name]), expected, motion)

    def test_poses_and_velocities_are_those_of_the_model(self):
        for motion, data, model, state in self.models():
            worst = np.zeros(4)
            for frame in range(0, len(data["joint_pos"]), 20):
                position, turn = data["body_pos_w"][frame], data["body_quat_w"][frame]
                linear, angular = data["body_lin_vel_w"][frame], data["body_ang_vel_w"][frame]
                state.qpos[:] = [*position[0], *turn[0], *data["joint_pos"][frame]]
                world_from_base = np.zeros(9)
                mujoco.mju_quat2Mat(world_from_base, turn[0].astype(float))
                spin_in_base = world_from_base.reshape(3, 3).T @ angular[0]
                state.qvel[:] = [*linear[0], *spin_in_base, *data["joint_vel"][frame]]
                mujoco.mj_forward(model, state)
                signs = np.sign(np.sum(state.xquat[1:] * turn, axis=1, keepdims=True))
                velocity = np.zeros((model.nbody - 1, 6))
                for body in range(1, model.nbody):
                    kind = mujoco.mjtObj.mjOBJ_XBODY
                    mujoco.mj_objectVelocity(model, state, kind, body, velocity[body - 1], 0)
                differences = (
                    position - state.xpos[1:],
                    signs * turn - state.xquat[1:],
                    linear - velocity[:, 3:],
                    angular - velocity[:, :3],
                )
                worst = np.maximum(worst, [np.abs(of).max() for of in differences])
            print(f"{motion}: {worst[0]:.1e} m, {worst[1]:.1e}, {worst[2]:.1e} m/s, {worst[3]:.1e} rad/s")
            # Numbers of 32 bits have seven digits.
            self.assertTrue(np.all(worst < [1e-5, 1e-5, 1e-4, 1e-4]), f"{motion}: {worst}")

    def test_velocities_are_differences_of_positions(self):
        for motion, data, model, _ in self.models():
            span_s = 2.0 / RATE_HZ
            for position, velocity in (("joint_pos", "joint_vel"), ("body_pos_w", "body_lin_vel_w")):
                mean = (data[position][2:] - data[position][:-2]) / span_s
                # Error of central differences: 2⁻²³ × 1 m / 4 ms by rounding, the rest by curvature.
                allowed = 2e-3 + 2e-3 * np.abs(data[velocity]).max()
                worst = np.abs(mean - data[velocity][1:-1]).max()
                print(f"{motion} {velocity}: {worst:.1e} of {allowed:.1e}")
                self.assertLess(worst, allowed, f"{motion} {velocity}")
            turn = data["body_quat_w"].astype(float)
            self.assertTrue(np.all(np.sum(turn[1:] * turn[:-1], axis=2) > 0.9), "signs change")
            for body in range(model.nbody - 1):
                for frame in range(1, len(turn) - 1, 20):
                    mean = np.zeros(3)
                    before, after = turn[frame - 1, body], turn[frame + 1, body]
                    mujoco.mju_subQuat(mean, after, before)
                    world, velocity = np.zeros(3), data["body_ang_vel_w"][frame, body]
                    mujoco.mju_rotVecQuat(world, mean / span_s, before)
                    self.assertLess(np.abs(world - velocity).max(), 5e-3 + 5e-3 * np.abs(velocity).max())

    def test_periodic_motions_repeat_to_the_length(self):
        for motion, data in self.data.items():
            length_s = DRIVE_S if motion == "drive_1m" else LENGTH_S
            self.assertEqual(len(data["joint_pos"]), round(length_s * RATE_HZ) + 1, motion)
            self.assertTrue(np.all(np.linalg.norm(np.diff(data["body_pos_w"], axis=0), axis=2) < 0.02))

    def test_forces_bear_the_weight_in_contact(self):
        data = self.data["walk"]
        model = mujoco.MjModel.from_xml_string(data["mjcf"].item())
        weight_n = model.body_mass.sum() * WEIGHT_M_S2
        vertical = data["contact_force_n"][:, :, 2]
        self.assertAlmostEqual(vertical.sum(axis=1).mean() / weight_n, 1.0, delta=0.02)
        self.assertTrue(np.all(vertical[~data["contact"]] < 0.6 * weight_n))
        self.assertTrue(np.any(~data["contact"]))


if __name__ == "__main__":
    unittest.main()
