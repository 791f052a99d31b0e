"""Motions on terrain: for each robot, requests that suit its kind and scale with its size."""

from dataclasses import dataclass
import math

# Duration of a cycle of a walk in units of √(height / g), as for imported robots in `cargo xtask measured replay`.
CYCLE, GRAVITY_M_S2 = 8.0, 9.80665
DUTY = 0.8


@dataclass(frozen=True)
class Size:
    """Measures of the standing robot: height of the body's origin, distance of front and rear feet, wheel radius, m."""

    height_m: float
    length_m: float
    radius_m: float


@dataclass(frozen=True)
class Case:
    """A motion file without its first keys, and a terrain file. `terrain` is empty on level ground."""

    name: str
    terrain: str
    motion: str


def of_robot(robot, size):
    """Cases of a robot, by its name or kind."""
    if robot == "agilebot":
        held = [_renamed(case, 'wheels = "held"\n') for case in _stairs(size)]
        return held + _drives(size) + _among_obstacles(size) + _standing_up()
    if robot == "pup":
        return _drives(size) + [_kerb(size, 0.3)]
    if size.radius_m > 0.04:
        kerbs = [_kerb(size, share) for share in (0.2, 0.3, 0.45)] + [_step(size, share) for share in (0.6, 0.9, 1.2)]
        return kerbs + _drives(size) + (_standing_up() if robot == "anymal_wheels" else [])
    return _stairs(size) + _slopes(size) + _footholds(size)


def _stairs(size):
    cases = []
    for share in (0.3, 0.4):
        for word, sign in (("up", 1), ("down", -1)):
            riser_m, tread_m = share * size.height_m, size.height_m
            terrain = f"[stairs]\nat_x_m = {0.5 * size.length_m + 0.5 * size.height_m:.3f}\ncount = 3\n"
            terrain += f"riser_m = {sign * riser_m:.3f}\ntread_m = {tread_m:.3f}\n"
            # All feet reach the landing.
            way_m = size.length_m + 0.7 * size.height_m + 2 * tread_m
            cases.append(Case(f"stairs_{word}_{round(100 * share)}", terrain, _walk(size, way_m, 0.5, 0.2)))
    return cases


def _slopes(size):
    slope = "[slope]\nangle_deg = {}\n"
    walks = [Case(f"walk_slope_{angle}", slope.format(angle), _walk(size, 1.5 * size.height_m, 0.35)) for angle in (5, 10, 20)]
    return walks + [
        Case("trot_slope_10", slope.format(10), _trot(size)),
        Case("walk_cross_slope_10", f"heading_deg = 90\n\n{slope.format(10)}", _walk(size, 1.5 * size.height_m, 0.35)),
    ]


def _footholds(size):
    h, gap_m = size.height_m, 0.5 * size.length_m
    ditches = [(1.0 * h, 0.2 * h), (1.6 * h, 0.2 * h), (2.2 * h, 0.2 * h)]
    walk = _walk(size, 3.0 * h, 0.5, 0.2)
    return [
        Case("stones", _ditches(ditches), walk),
        Case("rough_20", _rough(0.02, size), walk),
        Case("rough_40", _rough(0.04, size), walk),
        Case("gap_half_body", _ditches([(0.5 * size.length_m + 0.6 * h, gap_m)]), _walk(size, 3.0 * h, 0.5, 0.2)),
    ]


def _drives(size):
    way_m = 3.0 * size.height_m
    drives = [Case(f"drive_slope_{angle}", f"[slope]\nangle_deg = {angle}\n", _drive(size, way_m)) for angle in (10, 20)]
    return drives + [Case(f"drive_rough_{mm}", _rough(1e-3 * mm, size), _drive(size, way_m)) for mm in (20, 40)]


def _kerb(size, share):
    return Case(f"kerb_{share}_r_rolled", _edge(size, share), _drive(size, 2.5 * size.height_m))


def _step(size, share):
    walk = _walk(size, 2.0 * size.height_m, 0.5, 0.2, 9)
    return Case(f"kerb_{share}_r_stepped", _edge(size, share), 'wheels = "held"\ntorque_use = 0.6\n' + walk)


def _among_obstacles(size):
    h = size.height_m
    bar = f"[ramp]\nfrom_x_m = {1.2 * h:.3f}\nlength_m = {6 * h:.3f}\nheight_m = {0.6 * h:.3f}\n\n[[obstacle]]\n"
    bar += f"from_m = [{4 * h:.3f}, -0.6, {1.24 * h:.3f}]\nto_m = [{4 * h:.3f}, 0.6, {1.24 * h:.3f}]\nradius_m = 0.02\n"
    boxes = "\n".join(
        f'[[obstacle]]\nname = "box {k + 1}"\nbox_m = [0.1, 0.1, 0.4]\nat_m = [{(2.5 + 3 * k) * h:.3f}, {0.15 * (-1) ** k:.3f}, 0.2]\n'
        for k in range(3)
    )
    return [Case("bar_on_ramp", bar, _drive(size, 7 * h)), Case("slalom", boxes, _drive(size, 11 * h))]


def _standing_up():
    motion = f'ends = "at_rest"\nduration_s = 3.0\nlying = "start"\n\n[footfalls]\nall = "stance"\n\n{_goal(0.0)}'
    return [Case("stand_up", "", motion), Case("lie_down", "", motion.replace('"start"', '"end"'))]


def _walk(size, way_m, stride, swing=0.15, swing_samples=6):
    """A walk with strides of at most `stride` heights."""
    cycles = math.ceil(way_m / (stride * size.height_m))
    samples = math.ceil(swing_samples * (cycles + 0.5) / (1 - DUTY))
    return _motion(size, "walk", DUTY, CYCLE, cycles, samples, way_m, swing)


def _trot(size):
    return _motion(size, "trot", 0.6, 3.5, 6, 0, 1.2 * size.height_m, 0.15)


def _motion(size, gait, duty, cycle, cycles, samples, way_m, swing):
    duration_s = math.ceil(60 * cycle * math.sqrt(size.height_m / GRAVITY_M_S2) * (cycles + 0.5)) / 60
    counted = f"samples = {samples}\n" if samples else ""
    return (
        f'ends = "at_rest"\nduration_s = {duration_s:.4f}\n{counted}swing_height_m = {swing * size.height_m:.3f}\n\n'
        f'[footfalls]\ngait = "{gait}"\nduty = {duty}\ncycles = {cycles}\n\n{_goal(way_m)}'
    )


def _drive(size, way_m):
    """A drive of a height in 5 √(height / g), with two heights for starting and stopping, and 20 samples a second."""
    duration_s = math.ceil(60 * (2 + way_m / size.height_m) * 5 * math.sqrt(size.height_m / GRAVITY_M_S2)) / 60
    samples = min(math.ceil(20 * duration_s), 300)
    times = f'ends = "at_rest"\nduration_s = {duration_s:.4f}\nsamples = {samples}\n'
    return f'{times}\n[footfalls]\nall = "stance"\n\n{_goal(way_m)}'


def _goal(way_m):
    return f"[goal]\nforward_m = {way_m:.3f}\nleft_m = 0.0\nturn_rad = 0.0\n"


def _edge(size, share):
    return f"[step]\nat_x_m = {0.5 * size.length_m + 0.7 * size.height_m:.3f}\nheight_m = {share * size.radius_m:.4f}\n"


def _rough(height_m, size):
    return f"[rough]\nheight_m = {height_m}\nspacing_m = {0.5 * size.height_m:.3f}\nhalf_m = 4\nseed = 1\n"


def _ditches(ditches):
    """Level ground with ditches, each with its beginning and width, m."""
    x, z = [], []
    for begin, width in ditches:
        x += [begin, begin, begin + width, begin + width]
        z += [0.0, -0.2, -0.2, 0.0]
    return f"[profile]\nx_m = [{', '.join(f'{value:.3f}' for value in x)}]\nz_m = {z}\n"


def _renamed(case, first):
    return Case(case.name, case.terrain, first + case.motion)
