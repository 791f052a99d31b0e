"""Frames and bytes that an attacker or a broken program may send. Each function returns bytes for the line."""

import math
import struct

import wire

WORST = [math.nan, math.inf, -math.inf, -1.0, 0.0, 1e-30, 1e9, 3.4e38, 0.5, 1.0]


def random_frame(client, rng):
    identifier = rng.randrange(0x800)
    return wire.of_frame((identifier, rng.randbytes(rng.randrange(9))))


def forged_frame(client, rng):
    """A frame of the protocol with a valid crc8 and random content."""
    identifier = rng.choice([0x100, 0x200, 0x600]) | client.node << 4
    if rng.random() < 0.1:
        identifier |= 0xF0
    length = {0x100: 5, 0x200: 7, 0x600: 7}.get(identifier & 0x70F, 7)
    if rng.random() < 0.05:
        length = rng.randrange(8)
    return wire.of_frame(wire.sealed(identifier, rng.randbytes(length)))


def command(client, rng):
    """A command with a valid crc8, a random number and time of expiry, and never the current nonce."""
    until = (client.clock_ms() or 0) + rng.choice([-5, 0, 200, 500, 999, 1001, 32000])
    kind = rng.choice([wire.PLAY, wire.PAUSE, wire.RESUME, wire.RETURN, wire.ARM, wire.ARM_CONFIRM, wire.CLEAR, wire.CLEAR_CONFIRM, wire.STREAM, wire.TRACK, 15])
    seq = client.seq + rng.choice([0, 1, 1, 2, 8, 9])
    client.seq = seq
    if kind == wire.PLAY:
        return wire.of_frame(wire.command(client.node, seq, kind, until, rng.randrange(8), rng.choice([0, 1, 32, 64, 65, 127, -1, -128])))
    if kind == wire.TRACK:
        rate_hz = rng.choice([0, 19, 20, 60, 120, 0xFFFF])
        parts = [rng.choice([0, 10, 100, -1, 127]) for _ in range(2)]
        return wire.of_frame(wire.command(client.node, seq, kind, until, parts[0] & 255, parts[1], rate_hz))
    argument = rng.randrange(0x10000) if kind in (wire.ARM_CONFIRM, wire.CLEAR_CONFIRM) else 0
    if argument == client.nonce:
        argument ^= 1
    return wire.of_frame(wire.command(client.node, seq, kind, until, arg=argument))


def parameter(client, rng):
    value = rng.choice(WORST) if rng.random() < 0.8 else rng.uniform(0, 200)
    channel = rng.choice([rng.randrange(24), 0, 255])
    value = struct.pack("<f", value)
    return wire.of_frame(wire.parameter(client.node, rng.randrange(16), rng.randrange(6), rng.randrange(5), channel, value))


def setpoint(client, rng):
    """Frames of set-points for all channels, few of which are near the robot's pose."""
    first = rng.choice([0, client.sample, rng.randrange(256)])
    jump = rng.choice([0, 1, 100, 10_000, 2**23 - 1])
    frames = []
    for channel in range(rng.choice([1, 1, 20, 24])):
        value = rng.choice([0, jump, -jump, rng.randint(-jump, jump), -2**23])
        torque = rng.choice([0, 0, 200, -200, 2**15 - 1, -2**15])
        frames.append(wire.setpoint(client.node, first, channel, rng.randrange(2), value, torque))
    return b"".join(wire.of_frame(frame) for frame in frames)


def heartbeat(client, rng):
    return wire.of_frame(wire.heartbeat(client.node, rng.randrange(256), rng.getrandbits(32)))


def replayed(client, rng):
    """Replays a received frame."""
    # A copy, because the reading thread still appends frames.
    heard = [frame for frame in list(client.recent) if frame[0] & 0x70F not in FROM_CONTROLLER]
    return wire.of_frame(rng.choice(heard)) if heard else random_frame(client, rng)


def transport_frame(client, rng):
    """A frame of ISO-TP out of order."""
    first = rng.choice([0x00, 0x07, 0x10, 0x1F, 0x20, 0x2F, 0x30, 0x31, 0x32, 0x3F, rng.randrange(256)])
    identifier = wire.TO_CONTROLLER | client.node << 4
    return wire.of_frame((identifier, bytes([first]) + rng.randbytes(rng.randrange(8))))


def transport_message(client, rng):
    kind = rng.choice([0x01, 0x02, 0x10, 0x11, 0x12, 0x13, 0x14, 0x90, rng.randrange(256)])
    if kind == 0x10:
        body = struct.pack("<II", rng.choice([0, 1, 16, 4096, 10**6, 2**32 - 1]), rng.getrandbits(32))
    elif kind == 0x11:
        block = rng.randbytes(rng.randrange(1, 512))
        body = struct.pack("<II", rng.choice([0, 512, 2**31, 2**32 - 1]), wire.crc32c(block)) + block
    elif kind in (0x12, 0x13):
        body = b"" if kind == 0x12 else struct.pack("<I", rng.getrandbits(32))
    else:
        body = rng.randbytes(rng.randrange(60))
    return wire.of_message(client.node, bytes([kind]) + body)


def garbage(client, rng):
    """Bytes that are no packet, a cut packet, or a packet with a flipped bit."""
    line = bytearray(forged_frame(client, rng))
    way = rng.randrange(4)
    if way == 0:
        return rng.randbytes(rng.randrange(600))
    if way == 1:
        return bytes(line[: rng.randrange(len(line))])
    if way == 2:
        line[rng.randrange(len(line))] ^= 1 << rng.randrange(8)
        return bytes(line)
    return bytes(rng.randrange(1, 256) for _ in range(rng.randrange(2000)))


def stop(client, rng):
    """ESTOP: any length, to this node or to all."""
    node = rng.choice([client.node, 15])
    return wire.of_frame((wire.ESTOP | node << 4, rng.randbytes(rng.randrange(9))))


# Attacks and their weights.
MIX = [
    (random_frame, 20),
    (forged_frame, 20),
    (command, 20),
    (parameter, 10),
    (setpoint, 5),
    (heartbeat, 5),
    (replayed, 10),
    (transport_frame, 5),
    (transport_message, 5),
    (garbage, 5),
    (stop, 0.5),
]


# Classes and numbers of messages that a controller sends. A forged message deceives hosts and the rules, which read
# STATUS, but never reaches the controller.
FROM_CONTROLLER = {0x001, 0x101, 0x300, 0x301, 0x302, 0x400, 0x402, 0x403, 0x404, 0x406, 0x501, 0x601, 0x701}


def message(line):
    """Class and number of the message of a line; None if it is no frame."""
    found = wire.received(line[:-1]) if line.endswith(b"\0") else None
    return found and found[0] & 0x70F


def several(client, rng, count, stops):
    """`count` attacks; without emergency stops unless `stops`."""
    kinds, weights = zip(*MIX)
    lines = []
    while len(lines) < count:
        line = rng.choices(kinds, weights)[0](client, rng)
        sent = message(line)
        if sent not in FROM_CONTROLLER and (stops or sent != wire.ESTOP):
            lines.append(line)
    return lines
