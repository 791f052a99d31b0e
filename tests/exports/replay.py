"""Plays an exported motion in MuJoCo. States and controls are keyframes of the file; no other input is used.

Usage: replay.py MOTION.xml
"""

import sys

import mujoco
import numpy as np


class Motion:
    """A model with the keyframes of a motion."""

    def __init__(self, path):
        self.model = mujoco.MjModel.from_xml_path(str(path))
        model = self.model
        self.times_s = model.key_time[:]
        self.controls = model.key_ctrl.reshape(model.nkey, model.nu)
        self.states = model.key_qpos.reshape(model.nkey, model.nq)
        self.duration_s = self.times_s[-1]

    def controls_at(self, time_s):
        """Controls: linear between keyframes, constant before and after."""
        return [np.interp(time_s, self.times_s, of) for of in self.controls.T]

    def touched(self, name):
        """1 if something touched a geom when the motion was played, otherwise 0."""
        return int(self.model.geom(name).id in self.contacts)

    def play(self, settle_s=1.0):
        """Planned and played displacement of the body, (forward m, left m, turn rad), and its lowest height as a fraction of the plan's."""
        model, data = self.model, mujoco.MjData(self.model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        # A motion that begins at rest first settles; a moving motion begins at once.
        moves = np.any(np.abs(data.qvel) > 1e-3)
        start_s = 0.0 if moves else settle_s
        end_s = start_s + self.duration_s + (0.0 if moves else settle_s)
        data.time = 0.0
        began, lowest = None, np.inf
        self.contacts = set()
        while data.time < end_s:
            if began is None and data.time >= start_s:
                began = data.qpos[:7].copy()
            data.ctrl[:] = self.controls_at(data.time - start_s)
            mujoco.mj_step(model, data)
            lowest = min(lowest, data.qpos[2])
            self.contacts.update(data.contact.geom.flatten().tolist())
        planned = way(self.states[0], self.states[-1])
        return planned, way(began, data.qpos), lowest / self.states[:, 2].min()


def way(start, end):
    """Displacement in the heading of the start, and turn."""
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, start[3:7])
    yaw = np.arctan2(turn[3], turn[0])
    mujoco.mju_quat2Mat(turn, end[3:7])
    turned = np.arctan2(turn[3], turn[0]) - yaw
    x, y = end[:2] - start[:2]
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([c * x + s * y, c * y - s * x, (turned + np.pi) % (2 * np.pi) - np.pi])


if __name__ == "__main__":
    planned, played, height = Motion(sys.argv[1]).play()
    for name, plan, play in zip(("forward m", "left m", "turn rad"), planned, played):
        print(f"{name}: planned {plan:.4f}, played {play:.4f}")
    print(f"lowest body, of the plan's: {height:.3f}")
