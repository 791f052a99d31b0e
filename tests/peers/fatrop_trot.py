#!/usr/bin/env python3
"""Single-rigid-body trot, optimised by fatrop through CasADi: a yardstick for the CPU times of the planner.

    python3 tests/peers/fatrop_trot.py

The state is the position, velocity, roll-pitch-yaw and angular momentum of the trunk, and the positions of the feet on the floor. The
inputs are the forces of the feet in stance and the velocities of the feet in swing. A foot in stance has a friction pyramid and a
largest force; every foot stays within a box below its hip. The trot starts and ends at rest. Each line of the output has the number of
intervals, and the medians of the iterations and of the CPU time, ms per second of motion, over ten disturbed starts.
"""

import statistics
import sys
import time

import casadi as ca
import numpy as np

MASS_KG = 12.0
WEIGHT_N = 9.81 * MASS_KG
INERTIA_KG_M2 = ca.DM(np.diag([0.08, 0.30, 0.34]))
HEIGHT_M = 0.30
FRICTION = 0.6
FORCE_MAX_N = 150.0
HIPS_M = ((0.19, 0.13), (0.19, -0.13), (-0.19, 0.13), (-0.19, -0.13))
REACH_M = (0.12, 0.08, 0.06)
DURATION_S = 1.0
GOAL_M = 0.5
STEPS = 4
PAIRS = ((0, 3), (1, 2))
STATES = 20


def rotation(angles):
    """Rotation matrix from roll, pitch and yaw."""
    cr, cp, cy = ca.vertsplit(ca.cos(angles))
    sr, sp, sy = ca.vertsplit(ca.sin(angles))
    return ca.blockcat(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def angle_rates(angles, spin):
    """Derivatives of roll, pitch and yaw from the angular velocity in the world frame."""
    cp, cy = ca.cos(angles[1]), ca.cos(angles[2])
    sp, sy = ca.sin(angles[1]), ca.sin(angles[2])
    across = cy * spin[0] + sy * spin[1]
    return ca.vertcat(across / cp, cy * spin[1] - sy * spin[0], spin[2] + across * sp / cp)


def derivative(state, inputs, stance):
    """Time derivative of the state."""
    position, velocity = state[0:3], state[3:6]
    angles, momentum = state[6:9], state[9:12]
    body = rotation(angles)
    spin = body @ ca.solve(INERTIA_KG_M2, body.T @ momentum)
    force, torque = ca.SX([0, 0, -WEIGHT_N]), ca.SX.zeros(3)
    feet = []
    next_input = 0
    for foot in range(4):
        at = ca.vertcat(state[12 + 2 * foot : 14 + 2 * foot], 0)
        if foot in stance:
            push = inputs[next_input : next_input + 3]
            force += push
            torque += ca.cross(at - position, push)
            feet.append(ca.SX.zeros(2))
            next_input += 3
        else:
            feet.append(inputs[next_input : next_input + 2])
            next_input += 2
    return ca.vertcat(velocity, force / MASS_KG, angle_rates(angles, spin), torque, *feet)


def trot(intervals):
    """Nonlinear program: a dictionary for `nlpsol`, flags of equalities, bounds, and a start at which the trunk glides."""
    dt = DURATION_S / intervals
    x, start, g, lower, upper, equal = [], [], [], [], [], []
    cost = 0

    def require(expression, low, high):
        count = expression.numel()
        g.append(expression)
        lower.extend(np.broadcast_to(low, count))
        upper.extend(np.broadcast_to(high, count))
        equal.extend([bool(np.all(np.equal(low, high)))] * count)

    standing = [0, 0, HEIGHT_M] + [0] * 9 + [c for hip in HIPS_M for c in hip]
    at_rest = np.array(standing, dtype=float)

    def glide(share):
        guess = at_rest.copy()
        guess[0] += share * GOAL_M
        guess[12::2] += share * GOAL_M
        return guess

    state = ca.SX.sym("x0", STATES)
    x.append(state)
    start.append(glide(0.0))
    for k in range(intervals):
        stance = PAIRS[k * STEPS // intervals % 2]
        inputs = ca.SX.sym(f"u{k}", 10)
        x.append(inputs)
        guess = []
        for foot in range(4):
            guess += [0, 0, WEIGHT_N / 2] if foot in stance else [2 * GOAL_M / DURATION_S, 0]
        start.append(np.array(guess, dtype=float))
        middle = state + 0.5 * dt * derivative(state, inputs, stance)
        after = ca.SX.sym(f"x{k + 1}", STATES)
        require(after - (state + dt * derivative(middle, inputs, stance)), 0, 0)
        if k == 0:
            require(state - at_rest, 0, 0)
        next_input = 0
        for foot in range(4):
            if foot in stance:
                fx, fy, fz = ca.vertsplit(inputs[next_input : next_input + 3])
                sides = ca.vertcat(*(FRICTION * fz + s * f for f in (fx, fy) for s in (1, -1)))
                require(sides, 0, np.inf)
                require(fz, 0, FORCE_MAX_N)
                cost += dt * 1e-4 * ca.sumsqr(ca.vertcat(fx, fy, fz - WEIGHT_N / 2))
                next_input += 3
            else:
                cost += dt * 1e-2 * ca.sumsqr(inputs[next_input : next_input + 2])
                next_input += 2
        if k > 0:
            body = rotation(state[6:9])
            for foot, hip in enumerate(HIPS_M):
                ground = ca.vertcat(state[12 + 2 * foot : 14 + 2 * foot], 0)
                below = body.T @ (ground - state[0:3]) - ca.DM([*hip, -HEIGHT_M])
                require(below, [-r for r in REACH_M], REACH_M)
        cost += dt * (ca.sumsqr(state[6:9]) + 1e-1 * ca.sumsqr(state[3:6]))
        state = after
        x.append(state)
        start.append(glide((k + 1) / intervals))
    goal = glide(1.0)
    require(state[:12] - goal[:12], 0, 0)
    program = {"x": ca.vertcat(*x), "f": cost, "g": ca.vertcat(*g)}
    return program, equal, np.array(lower), np.array(upper), np.concatenate(start)


def measure(intervals, seeds):
    """Iterations and CPU times of the solves from disturbed starts, s."""
    program, equal, lower, upper, start = trot(intervals)
    options = {
        "structure_detection": "auto",
        "equality": equal,
        "expand": True,
        "print_time": False,
        "fatrop": {"print_level": 0, "tol": 1e-6, "max_iter": 300},
    }
    solver = ca.nlpsol("trot", "fatrop", program, options)
    runs = []
    for seed in range(seeds):
        noise = np.random.default_rng(seed).normal(0.0, 0.01, start.size)
        began = time.process_time()
        solution = solver(x0=start + noise, lbg=lower, ubg=upper)
        cpu_s = time.process_time() - began
        stats = solver.stats()
        if not stats["success"]:
            sys.exit(f"fatrop: {stats['return_status']} with {intervals} intervals, seed {seed}")
        reached = float(solution["x"][-STATES])
        if abs(reached - GOAL_M) > 1e-4:
            sys.exit(f"fatrop: {reached} of {GOAL_M} m with {intervals} intervals, seed {seed}")
        runs.append((stats["iter_count"], cpu_s))
    return runs


def main():
    for intervals in (24, 48):
        runs = measure(intervals, 10)
        iterations = statistics.median(count for count, _ in runs)
        cpu_ms = 1e3 * statistics.median(cpu for _, cpu in runs)
        print(f"{intervals} {iterations:.0f} {cpu_ms / DURATION_S:.2f}")


if __name__ == "__main__":
    main()
