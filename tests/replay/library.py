"""Frames of a motion in a library file (docs/formats/motion-library.md)."""

import struct

import numpy as np

from errors import Unusable
import robots

HEADER, FOOTER, BLOCK_HEADER, GROUP = 24, 24, 10, 16
MANIFEST, CHANNELS, CLIPS, FRAMES, NAMES, TORQUE_QUANTA, TORQUE_CLIPS, TORQUES = 1, 2, 3, 4, 9, 10, 11, 12


def frames_of(path, motion):
    """Set-points of the clip with the motion's name, one row for each frame, and its torques, or None if the library
    has no torques."""
    try:
        with open(path, "rb") as file:
            data = file.read()
    except OSError as error:
        raise Unusable(f"{path}: {error}") from error
    try:
        return _frames(data, motion)
    except (IndexError, KeyError, struct.error, UnicodeDecodeError, ValueError) as error:
        raise Unusable(f"{path}: {error}") from error


def _frames(data, motion):
    if data[:8] != b"ROLLWALK" or struct.unpack_from("<H", data, 8)[0] != 1:
        raise ValueError("field magic or major is not that of a motion library, version 1")
    sections, at = {}, HEADER
    while at < len(data) - FOOTER:
        tag, stride, length = struct.unpack_from("<HHI", data, at)
        sections[tag] = (stride, data[at + 8 : at + 8 + length])
        at += 8 + length
    rate, channels, motions = struct.unpack_from("<HBB", sections[MANIFEST][1], 4)
    wanted = robots.channels(motion.robot)
    if channels != len(wanted):
        raise ValueError(f"field channels is {channels}; robot {motion.robot['name']} has {len(wanted)}")
    names = _names(sections[NAMES][1], motions)
    if motion.name not in names:
        raise ValueError(f"field names: no motion {motion.name}; there are {', '.join(names)}")
    stride, clips = sections[CLIPS]
    clip = names.index(motion.name)
    _, count, offset, length = struct.unpack_from("<BHII", clips, stride * clip)
    if abs(count - motion.duration_s * rate) > 1.5:
        raise ValueError(f"field frames of {motion.name} is {count}; the plan lasts {motion.duration_s} s")
    stride, records = sections[CHANNELS]
    exponents = [struct.unpack_from("<Bb", records, stride * c)[1] for c in range(channels)]
    values = _values(sections[FRAMES][1][offset : offset + length], exponents, count, motion)
    if TORQUES not in sections:
        return values, None
    stride, records = sections[TORQUE_CLIPS]
    offset, length = struct.unpack_from("<II", records, stride * clip)
    exponents = struct.unpack_from(f"<{channels}b", sections[TORQUE_QUANTA][1])
    return values, _values(sections[TORQUES][1][offset : offset + length], exponents, count, motion)


def _values(blocks, exponents, count, motion):
    """The frames of a clip's blocks, one row each."""
    quanta = _clip(blocks, len(exponents))
    if len(quanta) != count:
        raise ValueError(f"field frames of {motion.name} is {count}; its blocks have {len(quanta)}")
    return np.array(quanta, dtype=float) * 2.0 ** np.array(exponents, dtype=float)


def _names(data, count):
    names, at = [], 0
    for _ in range(count):
        # Lengths are at most 32, one byte of a varint.
        length = data[at]
        names.append(data[at + 1 : at + 1 + length].decode())
        at += 1 + length
    return names


def _clip(data, channels):
    """Quanta of all frames: keyframes and second differences in groups of bits."""
    rows, at = [], 0
    while at < len(data):
        _, frames, _, length = struct.unpack_from("<BBHH", data, at)
        payload = data[at + BLOCK_HEADER : at + BLOCK_HEADER + length]
        value = list(struct.unpack_from(f"<{channels}h", payload, 0))
        step = list(struct.unpack_from(f"<{channels}h", payload, 2 * channels))
        bits = _Bits(payload[4 * channels :])
        rows.append(value[:])
        widths = []
        for k in range(frames - 1):
            if k % GROUP == 0:
                codes = [bits.read(4) for _ in range(channels)]
                widths = [18 if code == 15 else code for code in codes]
            for c in range(channels):
                zigzag = bits.read(widths[c])
                step[c] += (zigzag >> 1) ^ -(zigzag & 1)
                value[c] += step[c]
            rows.append(value[:])
        at += BLOCK_HEADER + length
    return rows


class _Bits:
    """Fields of bits, from the least significant end of each byte."""

    def __init__(self, data):
        self.number, self.left = int.from_bytes(data, "little"), 8 * len(data)

    def read(self, width):
        if width > self.left:
            raise ValueError("field frames: a block ends within a frame")
        field = self.number & ((1 << width) - 1)
        self.number >>= width
        self.left -= width
        return field
