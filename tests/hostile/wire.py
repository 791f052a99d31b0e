"""The link of a controller, written from docs/formats/wire-format.md alone: checksums, packets of the serial line, messages."""

import hashlib
import hmac
import struct
import zlib

ESTOP, HEARTBEAT, COMMAND, SETPOINT, PARAMETER, DISCOVER = 0x000, 0x100, 0x200, 0x401, 0x600, 0x700
STATUS, COMMAND_ACK, HEARTBEAT_REPLY, SAMPLE, PARAMETER_ACK, DISCOVERED = 0x300, 0x302, 0x101, 0x404, 0x601, 0x701
TO_CONTROLLER, TO_HOST = 0x500, 0x501
PLAY, PAUSE, RESUME, RETURN, DISARM, ARM, ARM_CONFIRM, CLEAR, CLEAR_CONFIRM, STREAM, TRACK = range(11)
STATES = "Boot SelfTest Disarmed Aligning Ready Playing Paused Returning Damped TorqueOff EStopped Streaming".split()
# Kind of PARAMETER.
RESET = 2
AUTHENTICATOR, SESSION_REQUEST, SESSION = 0x002, 0x03, 0x83
KIND_FRAME, KIND_MESSAGE = 16, 19


def _table(polynomial, bits, reflected):
    table = []
    for byte in range(256):
        crc = byte if reflected else byte << (bits - 8)
        for _ in range(8):
            if reflected:
                crc = crc >> 1 ^ (polynomial if crc & 1 else 0)
            else:
                crc = (crc << 1 ^ (polynomial if crc >> bits - 1 else 0)) & (1 << bits) - 1
        table.append(crc)
    return table


_CRC8 = _table(0x2F, 8, False)
_CRC32C = _table(0x82F63B78, 32, True)


def crc8(data):
    crc = 0xFF
    for byte in data:
        crc = _CRC8[crc ^ byte]
    return crc ^ 0xFF


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc = crc >> 8 ^ _CRC32C[(crc ^ byte) & 0xFF]
    return crc ^ 0xFFFFFFFF


def digest(data):
    """CRC-32/ISO-HDLC."""
    return zlib.crc32(data)


def sealed(identifier, body):
    """A frame of the link with its crc8."""
    return identifier, bytes([crc8(struct.pack("<H", identifier) + body)]) + body


def command(node, seq, kind, valid_until_ms, code=0, speed=0, arg=0):
    body = struct.pack("<BBbHH", seq & 15 | (kind & 15) << 4, code, speed, arg, valid_until_ms & 0xFFFF)
    return sealed(COMMAND | node << 4, body)


def parameter(node, seq, kind, which, channel, value):
    body = bytes([seq & 15 | (kind & 15) << 4, which, channel]) + value
    return sealed(PARAMETER | node << 4, body)


def setpoint(node, frame, channel, stiff, value, torque):
    """Value in 0.1 mrad or 0.1 mrad/s, torque in 5 mN·m."""
    body = bytes([frame & 255, channel & 127 | stiff << 7]) + value.to_bytes(3, "little", signed=True) + struct.pack("<h", torque)
    return sealed(SETPOINT | node << 4, body)


def heartbeat(node, seq, host_ms):
    return sealed(HEARTBEAT | node << 4, struct.pack("<BI", seq & 255, host_ms & 0xFFFFFFFF))


def code(key, number, nonce, counter, identifier, message):
    """Authentication code of a host's message."""
    head = struct.pack("<BQQIH", 1, number, nonce, counter, identifier)
    return hmac.digest(key, head + message, hashlib.sha256)


def session_code(key, number, nonce, identifier):
    """Authentication code of the controller's offer of a session."""
    return hmac.digest(key, struct.pack("<BQQH", 2, number, nonce, identifier), hashlib.sha256)


def authenticator(node, key, number, nonce, counter, identifier, message):
    """Authenticator frame, which precedes a message."""
    tag = code(key, number, nonce, counter, identifier, message)[:6]
    head = bytes([number & 15 | (identifier >> 8) << 4, counter & 255])
    return AUTHENTICATOR | node << 4, head + tag


def stuffed(data):
    """COBS."""
    out, block = bytearray(), bytearray()
    for byte in data:
        if byte == 0:
            out += bytes([len(block) + 1]) + block
            block.clear()
        else:
            block.append(byte)
            if len(block) == 254:
                out += b"\xff" + block
                block.clear()
    return bytes(out + bytes([len(block) + 1]) + block)


def unstuffed(data):
    """The bytes before stuffing, or None."""
    out, at = bytearray(), 0
    while at < len(data):
        code = data[at]
        if code == 0 or at + code > len(data):
            return None
        out += data[at + 1 : at + code]
        at += code
        if code < 255 and at < len(data):
            out.append(0)
    return bytes(out)


def packet(body):
    return stuffed(body + struct.pack("<I", crc32c(body))) + b"\0"


def of_frame(frame):
    identifier, data = frame
    return packet(struct.pack("<BHB", KIND_FRAME, identifier, len(data)) + data)


def of_message(node, message):
    return packet(struct.pack("<BH", KIND_MESSAGE, TO_CONTROLLER | node << 4) + message)


def received(line):
    """Returns (identifier, data) of a received packet without its final zero; None if the packet is no frame."""
    body = unstuffed(line)
    if body is None or len(body) < 8 or struct.unpack("<I", body[-4:])[0] != crc32c(body[:-4]):
        return None
    kind, identifier = struct.unpack("<BH", body[:3])
    return (identifier, body[4:-4]) if kind == KIND_FRAME else None
