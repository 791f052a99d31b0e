"""A node on the link of a simulated controller. It receives all frames, and can send any."""

import collections
import socket
import struct
import threading
import time

import wire

# Default address of a controller.
NODE = 1
HEARTBEAT_S = 0.05


# Longest wait for the end of a thread or of a program.
END_S = 20.0


class Broken(Exception):
    """Violated requirement of the test."""


def expect(condition, what):
    if not condition:
        raise Broken(what)


def ended(process):
    """Ends a program as Ctrl-C does, or kills it, and returns the exit code."""
    process.terminate()
    try:
        return process.wait(END_S)
    finally:
        process.kill()


class Client:
    """Connects to the socket; a thread listens."""

    def __init__(self, path, node):
        self.node = node
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.socket.connect(str(path))
        self.recent = collections.deque(maxlen=500)
        self.state = None
        self.library = None
        self.nonce = None
        self.acknowledgements = collections.Counter()
        self.parameters = collections.Counter()
        self.answers = collections.Counter()
        self.states = set()
        # Number of the last sample of a closed loop over the link.
        self.sample = 0
        self.heard = 0
        self.seq = 0
        self.beat = 0
        self._clock = None
        self._message = None
        self._expected = 0
        # Consecutive frames that the controller takes.
        self._room = 0
        self.replies = collections.deque(maxlen=100)
        threading.Thread(target=self._listen, daemon=True).start()

    def send(self, *lines):
        self.socket.sendall(b"".join(lines))

    def frames(self, *frames):
        self.send(*map(wire.of_frame, frames))

    def clock_ms(self):
        """The controller's clock, None before its first HEARTBEAT_REPLY."""
        if self._clock is None:
            return None
        told, at = self._clock
        return told + int((time.monotonic() - at) * 1e3)

    def heartbeat(self):
        self.beat += 1
        self.frames(wire.heartbeat(self.node, self.beat, self.beat * 50))

    def command(self, kind, *values, **fields):
        """Sends a new command, valid for 0.4 s; `values` are code, speed and arg."""
        self.seq += 1
        self.frames(wire.command(self.node, self.seq, kind, (self.clock_ms() or 0) + 400, *values, **fields))

    def request(self, message, answered=0x90, timeout_s=6.0):
        """A request of the transport and its answer; None without an answer."""
        self.replies.clear()
        self._send_message(message)
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            if self.replies:
                reply = self.replies.popleft()
                if reply[0] == answered and (answered != 0x90 or reply[1] == message[0]):
                    return reply
            time.sleep(0.002)
        return None

    def _send_message(self, message):
        """ISO-TP: a single frame, or a first frame and the number of frames that the flow control requests."""
        identifier = wire.TO_CONTROLLER | self.node << 4
        if len(message) < 8:
            self.frames((identifier, bytes([len(message)]) + message))
            return
        self._room = 0
        self.frames((identifier, (0x1000 | len(message)).to_bytes(2, "big") + message[:6]))
        for number, at in enumerate(range(6, len(message), 7), 1):
            if not self.until(lambda: self._room > 0, 1):
                return
            self._room -= 1
            self.frames((identifier, bytes([0x20 | number & 15]) + message[at : at + 7]))

    def until(self, condition, timeout_s):
        end = time.monotonic() + timeout_s
        while not condition() and time.monotonic() < end:
            time.sleep(0.001)
        return condition()

    def _listen(self):
        rest = b""
        while True:
            try:
                data = self.socket.recv(65536)
            except OSError:
                return
            if not data:
                return
            *lines, rest = (rest + data).split(b"\0")
            for line in lines:
                found = wire.received(line) if line else None
                if found:
                    self._hear(*found)

    def _hear(self, identifier, data):
        self.heard += 1
        self.recent.append((identifier, data))
        identifier ^= self.node << 4
        if identifier == wire.STATUS and len(data) == 8:
            self.state, self.library = wire.STATES[data[1] & 15], data[7]
            self.states.add(self.state)
        elif identifier == wire.SAMPLE and len(data) == 8:
            self.sample = data[1]
        elif identifier == wire.HEARTBEAT_REPLY and len(data) == 6:
            self._clock = struct.unpack("<I", data[2:])[0], time.monotonic()
        elif identifier == wire.COMMAND_ACK and len(data) == 7:
            kind, result = data[1] >> 4, data[2]
            self.acknowledgements[kind, result] += 1
            if result == 0 and kind in (wire.ARM, wire.CLEAR):
                self.nonce = struct.unpack("<H", data[5:])[0]
        elif identifier == wire.PARAMETER_ACK and len(data) >= 3:
            self.parameters[data[2] >> 4] += 1
        elif identifier == wire.TO_HOST and data:
            self._segment(data)

    def _segment(self, data):
        """ISO-TP: message of the controller."""
        kind = data[0] >> 4
        if kind == 0:
            self.replies.append(data[1 : 1 + (data[0] & 15)])
            if data[1:2] == b"\x90":
                self.answers[data[2:4]] += 1
        elif kind == 1 and len(data) == 8:
            self._expected = (data[0] & 15) << 8 | data[1]
            self._message = data[2:]
            self.frames((wire.TO_CONTROLLER | self.node << 4, bytes([0x30, 0, 0])))
        elif kind == 2 and self._message is not None:
            self._message += data[1:]
            if len(self._message) >= self._expected:
                self.replies.append(self._message[: self._expected])
                self._message = None
        elif kind == 3 and data[0] & 15 == 0:
            # Block size 0: no more flow control follows.
            self._room = data[1] or 1 << 20


def transfer(client, library):
    """Transfers a library. Returns the refused step and the answer, or None if the library is active."""
    digest = wire.digest(library)
    head = len(library).to_bytes(4, "little") + digest.to_bytes(4, "little")
    steps = [b"\x10" + head]
    for at in range(0, len(library), 512):
        block = library[at : at + 512]
        steps.append(b"\x11" + at.to_bytes(4, "little") + wire.crc32c(block).to_bytes(4, "little") + block)
    steps += [b"\x12", b"\x13" + digest.to_bytes(4, "little")]
    for step in steps:
        answer = client.request(step)
        expect(answer is not None, f"no answer to request {step[0]:02x} of a transfer")
        if answer[2] != 0:
            return step[0], answer
    return None


def alive(client, what):
    """The controller still answers."""
    # Ends an incomplete packet of an attack.
    client.send(b"\0")
    time.sleep(0.6)
    before = client.heard
    answer = client.request(b"\x01\x02\x00", answered=0x81, timeout_s=5)
    expect(answer is not None, f"no answer to HELLO_REQUEST {what}")
    expect(client.heard > before and client.state is not None, f"no STATUS {what}")
