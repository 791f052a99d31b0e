"""Tests that the rules find violations, and that bytes match docs/formats/wire-format.md."""

import pathlib
import random
import struct
import tempfile
import unittest

import attacks
import wire
from libraries import hostile, resealed
from robot import Motor
from rules import Rules

KNEE = {(0, 1): Motor("knee", False, -1.0, 1.0, 100.0, 2.0, 3.0)}
STATES = wire.STATES.index


def status(state):
    return 0x310, wire.sealed(0x310, bytes([STATES(state), 0, 0, 0, 0, 0, 0]))[1]


def joint(position, kp=50.0):
    return 0x101, struct.pack("<hhHH", round(position / 2e-4), 0, round(kp * 100), 1000)


def broken(*frames):
    """Rules that frames (time, interface, frame) break."""
    with tempfile.TemporaryDirectory() as folder:
        log = pathlib.Path(folder) / "buses.log"
        line = "({:.6f}) {} {:03X}#{}\n".format
        log.write_text("".join(line(at, bus, i, d.hex().upper()) for at, bus, (i, d) in frames))
        return Rules(KNEE, 1).check(log).broken


def joint_with_torque(torque_nm):
    """Set-point at 0 rad without gains, with a torque of at least 128 mN·m."""
    exponent = 1
    while round(torque_nm * 1e3) >> exponent - 1 >= 256:
        exponent += 1
    mantissa = (round(torque_nm * 1e3) >> exponent - 1) - 128
    return 0x281, ((mantissa | exponent << 7) << 52).to_bytes(8, "little")


class TheRules(unittest.TestCase):
    def test_let_a_driven_robot_pass(self):
        self.assertEqual(broken((0, "link0", status("Playing")), (1, "act0", joint(0.5)), (1.1, "act0", joint(-1.0))), [])

    def test_find_setpoints_without_torque(self):
        self.assertEqual(len(broken((0, "link0", status("Disarmed")), (1, "act0", joint(0.5)))), 1)
        self.assertEqual(len(broken((0, "link0", status("Disarmed")), (1, "act0", (0x081, b"\1")))), 1)
        self.assertEqual(broken((0, "link0", status("Disarmed")), (1, "act0", (0x081, b"\0"))), [])

    def test_know_that_a_motor_may_be_on_before_the_answer_to_arm_is_complete(self):
        disarmed, on = (0, "link0", status("Disarmed")), (1, "act0", (0x081, b"\1"))
        answer = wire.sealed(0x312, bytes([wire.ARM_CONFIRM << 4, 0, 2, 255, 0, 0]))
        self.assertEqual(broken(disarmed, on, (1.00003, "link0", answer)), [])
        self.assertEqual(len(broken(disarmed, on, (1.01, "link0", answer))), 1)
        refused = wire.sealed(0x312, bytes([wire.ARM_CONFIRM << 4, 3, 2, 255, 0, 0]))
        self.assertEqual(len(broken(disarmed, on, (1.00003, "link0", refused))), 1)

    def test_find_what_is_beyond_a_limit(self):
        playing = (0, "link0", status("Playing"))
        for bad in [joint(1.01), joint(-1.01), joint(0, kp=201), (0x102, joint(0)[1]), (0x201, bytes(8)), joint_with_torque(3.1)]:
            self.assertEqual(len(broken(playing, (1, "act0", bad))), 1, bad)
        self.assertEqual(broken(playing, (1, "act0", joint_with_torque(2.9))), [])

    def test_find_setpoints_after_an_emergency_stop(self):
        frames = [(0, "link0", status("Playing")), (1, "link0", (0x010, b"")), (1.01, "act0", joint(0))]
        self.assertEqual(broken(*frames), [])
        self.assertEqual(len(broken(*frames, (1.05, "act0", joint(0)))), 1)
        cleared = (2, "link0", wire.sealed(0x312, bytes([wire.CLEAR_CONFIRM << 4, 0, 2, 255, 0, 0])))
        self.assertEqual(broken(*frames, cleared, (3, "act0", joint(0))), [])


class TheBytes(unittest.TestCase):
    def test_have_the_checksums_of_the_document(self):
        self.assertEqual(wire.crc8(b"123456789"), 0xDF)
        self.assertEqual(wire.crc32c(b"123456789"), 0xE3069283)
        self.assertEqual(wire.digest(b"123456789"), 0xCBF43926)

    def test_have_the_codes_of_the_document(self):
        session = 0x010203040506070B, 0x1112131415161718
        message = bytes.fromhex("2305144000001027")
        frame = wire.authenticator(3, bytes(range(32)), *session, 0x1FE, 0x230, message)
        self.assertEqual(frame, (0x032, bytes.fromhex("2BFEEF24036DBF3D")))

    def test_are_stuffed_and_found_again(self):
        rng = random.Random(0)
        for length in [0, 1, 253, 254, 255, 300]:
            for data in [rng.randbytes(length), bytes(length), b"\1" * length]:
                self.assertNotIn(0, wire.stuffed(data))
                self.assertEqual(wire.unstuffed(wire.stuffed(data)), data)

    def test_of_hostile_libraries_are_others(self):
        library = resealed(bytes(100) + struct.pack("<HHI", 1, 1, 400) + bytes(500))
        made = [data for data, _ in hostile(library, 50, random.Random(1))]
        self.assertEqual((len(made), library in made), (50, False))

    def test_of_attacks_stop_when_they_may(self):
        class Node:
            node, seq, nonce, sample, recent = 1, 0, None, 0, []

            def clock_ms(self):
                return 0

        for stops in [False, True]:
            lines = attacks.several(Node(), random.Random(2), 3000, stops)
            self.assertEqual(any(attacks.message(line) == wire.ESTOP for line in lines), stops)


if __name__ == "__main__":
    unittest.main()
