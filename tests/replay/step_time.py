#!/usr/bin/env python3
"""Time of a step of chains of boxes on the ground, in MuJoCo and in `rollwalk-physics`, one after the other on one core.

    python3 tests/replay/step_time.py

The chains are those of `physics/examples/step_time.rs`, which this script runs: boxes in a row that slide over the
ground, each connected to the next at two points. In MuJoCo, the connection is a hinge.
"""

import subprocess
import time

import mujoco

STEP_S, STEPS = 1 / 500, 500
BOXES = (10, 20, 40)


def chain(count):
    """Model of the example's chain: boxes of 0.1 kg with edges of 0.1 m, a pitch of 0.12 m, friction 0.5."""
    box = '<geom type="box" size="0.05 0.05 0.05" mass="0.1"/>'
    inner = ""
    for _ in range(count - 1):
        inner = f'<body pos="0.12 0 0"><joint type="hinge" axis="0 1 0" pos="-0.06 0 0.05"/>{box}{inner}</body>'
    return (
        f'<mujoco><option timestep="{STEP_S}" cone="elliptic" integrator="implicitfast"/>'
        '<default><geom friction="0.5" contype="0" conaffinity="1"/></default>'
        '<worldbody><geom type="plane" size="0 0 1" contype="1" conaffinity="0"/>'
        f'<body pos="0 0 0.0498"><freejoint/>{box}{inner}</body></worldbody></mujoco>'
    )


def main():
    example = ["cargo", "run", "--quiet", "--release", "-p", "rollwalk-physics", "--example", "step_time"]
    ours = subprocess.run(example, check=True, capture_output=True, text=True).stdout
    print("\n".join(line for line in ours.splitlines() if line.startswith("chain")))
    for count in BOXES:
        model = mujoco.MjModel.from_xml_string(chain(count))
        for name in ("dense", "sparse"):
            model.opt.jacobian = getattr(mujoco.mjtJacobian, f"mjJAC_{name.upper()}")
            data = mujoco.MjData(model)
            data.qvel[1] = 1.0
            start = time.process_time()
            for _ in range(STEPS):
                mujoco.mj_step(model, data)
            each_s = (time.process_time() - start) / STEPS
            print(f"MuJoCo {mujoco.__version__}, {name}: chain of {count} boxes, {1e3 * each_s:.3f} ms/step")


if __name__ == "__main__":
    main()
