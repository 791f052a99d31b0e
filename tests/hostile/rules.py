"""Rules that no frame on the link may break, checked in the simulator's log of all buses."""

import math
import re
import struct

import wire

LINE = re.compile(r"\((\d+\.\d+)\) (\S+) ([0-9A-F]{3})#([0-9A-F]*)")
# States in which the motors may have torque (docs/playback-and-safety.md).
TORQUE = {wire.STATES.index(state) for state in "Aligning Ready Playing Paused Returning Damped Streaming".split()}
CONTROL, JOINT, WHEEL, JOINT_TORQUE, WHEEL_TORQUE = 0x080, 0x100, 0x200, 0x280, 0x300
WIDE_JOINT, WIDE_WHEEL = 0x380, 0x400
# STATUS reports a change of state; the frame waits for the bus.
STATUS_LATE_S = 0.1
# The frame that enables a motor is shorter than the answer to ARM, and may complete first.
ANSWER_LATE_S = 0.002
# After ESTOP, the controller switches torque off before it reads its next frame. Only frames that have begun on the
# bus remain.
ESTOP_LATE_S = 0.02
# Rounding: half a step, and the error of short floats.
POSITION_STEP, SPEED_STEP, SHORT = 2e-4, 1e-4, 1.005


def entries(path):
    """(time in s, interface, identifier, data) of every frame of a log."""
    with open(path) as file:
        for line in file:
            match = LINE.match(line)
            if match:
                yield float(match[1]), match[2], int(match[3], 16), bytes.fromhex(match[4])


def _short(bits):
    mantissa, exponent = bits & 127, bits >> 7 & 15
    return mantissa if exponent == 0 else (128 + mantissa) << exponent - 1


def _signed(bits, width):
    return bits - (1 << width) if bits >> width - 1 else bits


def setpoint(identifier, data):
    """(address, value, kp, kd, maximum of torque and torque limit, True for a wheel) of a set-point; None for other
    frames."""
    kind, address = identifier & 0x780, identifier & 0x7F
    if len(data) != 8:
        return None
    if kind == JOINT:
        position, _, kp, kd = struct.unpack("<hhHH", data)
        return address, position * 2e-4, kp * 1e-2, kd * 1e-3, 0.0, False
    if kind == WHEEL:
        speed, kd, limit = struct.unpack("<iHH", data)
        return address, speed * 1e-4, 0.0, kd * 1e-3, limit * 5e-3, True
    bits = int.from_bytes(data, "little")
    wider = 16 if kind in (WIDE_JOINT, WIDE_WHEEL) else 1
    torque = _short(bits >> 52) * 1e-3 * wider
    if kind in (JOINT_TORQUE, WIDE_JOINT):
        kp, kd = _short(bits >> 30) * 1e-3 * wider, _short(bits >> 41) * 1e-4 * wider
        return address, _signed(bits & 0xFFFF, 16) * 2e-4, kp, kd, torque, False
    if kind in (WHEEL_TORQUE, WIDE_WHEEL):
        limit, kd = _short(bits >> 30) * 1e-3 * wider, _short(bits >> 41) * 1e-4 * wider
        return address, _signed(bits & (1 << 30) - 1, 30) * 1e-4, 0.0, kd, max(limit, torque), True
    return None


class Rules:
    """Checks every frame of a log. `broken` contains violations, `counts` the numbers of checks."""

    def __init__(self, motors, node):
        self.motors = motors
        self.node = node
        self.broken = []
        self.counts = {"frames": 0, "setpoints": 0, "estops": 0, "libraries": set()}
        self.torque_until = -math.inf
        self.state = None
        self.stopped = None
        # Torque before STATUS reports it is a violation, unless the acknowledgement of ARM follows at once.
        self.early = []

    def check(self, log):
        for at, interface, identifier, data in entries(log):
            self.counts["frames"] += 1
            bus = interface.removeprefix("act")
            if bus == interface:
                self._link(at, identifier, data)
            else:
                self._actuators(at, int(bus), identifier, data)
        self._settle(math.inf)
        return self

    def _settle(self, now):
        """Counts a violation for torque that came before an acknowledgement which never arrived."""
        while self.early and now > self.early[0][0] + ANSWER_LATE_S:
            self._break(*self.early.pop(0))

    def _link(self, at, identifier, data):
        if identifier >> 8 == 0 and identifier & 15 == 0 and identifier >> 4 & 15 in (self.node, 15):
            self.counts["estops"] += 1
            # Until the operator's second CLEAR is accepted.
            self.stopped = at if self.stopped is None else self.stopped
        if identifier == wire.STATUS | self.node << 4 and len(data) == 8:
            self.state = data[1] & 15
            if self.state in TORQUE:
                self.torque_until = at + STATUS_LATE_S
            self.counts["libraries"].add(data[7])
        if identifier == wire.COMMAND_ACK | self.node << 4 and len(data) == 7:
            ok = data[2] == 0
            if ok and data[1] >> 4 == wire.CLEAR_CONFIRM:
                self.stopped = None
            if ok and data[1] >> 4 == wire.ARM_CONFIRM:
                self._settle(at)
                self.early.clear()
                self.torque_until = at + STATUS_LATE_S

    def _actuators(self, at, bus, identifier, data):
        enable = identifier & 0x780 == CONTROL and data == b"\1"
        found = setpoint(identifier, data)
        if not enable and not found:
            return
        if self.state not in TORQUE and at > self.torque_until:
            self._settle(at)
            self.early.append((at, f"{identifier:03X}#{data.hex()} on bus {bus} in state {self.state}"))
        if self.stopped is not None and at > self.stopped + ESTOP_LATE_S:
            self._break(at, f"{identifier:03X}#{data.hex()} on bus {bus} after ESTOP at {self.stopped:.3f} s")
        if found:
            self._limits(at, bus, found)

    def _limits(self, at, bus, found):
        self.counts["setpoints"] += 1
        address, value, kp, kd, torque, wheel = found
        motor = self.motors.get((bus, address))
        if motor is None or motor.wheel != wheel:
            self._break(at, f"setpoint for bus {bus}, address {address}: the robot has no such motor")
            return
        step = SPEED_STEP if wheel else POSITION_STEP
        within = motor.least - step <= value <= motor.most + step
        gains = kp <= motor.kp_most * SHORT and kd <= motor.kd_most * SHORT
        if not within or not gains or torque > motor.torque_most * SHORT:
            self._break(at, f"{motor.name}: {value} (of {motor.least} to {motor.most}), gains {kp} and {kd}, torque {torque}")

    def _break(self, at, what):
        self.broken.append(f"{at:.6f} s: {what}")
