"""Shows that a machine has working SocketCAN, and measures how well it keeps time."""

import os
import pty
import subprocess
import sys
import time
import tty

import can

PERIOD_S = 1 / 120
PERIODS = 240
SERVOS = 20


def candump_sees_cansend():
    dump = subprocess.Popen(
        ["candump", "-L", "-n", "1", "-T", "5000", "vcan0"], stdout=subprocess.PIPE, text=True
    )
    # There is no sign that it listens; so a frame is sent until it has seen one.
    while dump.poll() is None:
        subprocess.run(["cansend", "vcan0", "123#AABB"], check=True)
        time.sleep(0.1)
    seen = dump.stdout.read().split()
    assert seen[1:] == ["vcan0", "123#AABB"], seen


def robot_load():
    """20 requests every 1/120 s and an answer to each, as a robot's bus has them."""
    host = can.Bus("vcan1", interface="socketcan")
    servos = can.Bus("vcan1", interface="socketcan")
    start = time.monotonic()
    latest = longest = 0.0
    for period in range(1, PERIODS + 1):
        due = start + period * PERIOD_S
        time.sleep(max(0.0, due - time.monotonic()))
        latest = max(latest, time.monotonic() - due)
        for servo in range(SERVOS):
            host.send(can.Message(arbitration_id=servo, data=bytes(8), is_extended_id=False))
            assert servos.recv(1.0).arbitration_id == servo
            answer = can.Message(arbitration_id=0x100 + servo, data=bytes(8), is_extended_id=False)
            servos.send(answer)
            assert host.recv(1.0).arbitration_id == 0x100 + servo
        longest = max(longest, time.monotonic() - due)
    host.shutdown()
    servos.shutdown()
    rate = 2 * SERVOS * PERIODS / (time.monotonic() - start)
    return f"{rate:.0f} frames/s, woken {1e3 * latest:.2f} ms late, done after {1e3 * longest:.2f} ms at worst"


def slcan_is_an_interface():
    adapter, line = pty.openpty()
    tty.setraw(adapter)
    tty.setraw(line)
    subprocess.run(["slcand", "-o", "-c", "-s8", os.ttyname(line), "slcan0"], check=True)
    # slcand goes on in the background, and names the interface when it is there.
    while not os.path.exists("/sys/class/net/slcan0"):
        time.sleep(0.01)
    subprocess.run(["ip", "link", "set", "slcan0", "up"], check=True)
    bus = can.Bus("slcan0", interface="socketcan")
    bus.send(can.Message(arbitration_id=0x123, data=b"\xaa\xbb", is_extended_id=False))
    sent = b""
    while not sent.endswith(b"t1232AABB\r"):
        sent += os.read(adapter, 100)
    os.write(adapter, b"t4563112233\r")
    received = bus.recv(5.0)
    assert (received.arbitration_id, received.data) == (0x456, b"\x11\x22\x33"), received
    bus.shutdown()
    return "opened with " + repr(sent[: -len(b"t1232AABB\r")].decode())


def clock():
    """How many seconds a sleep of one takes by this machine's own clock."""
    start = time.monotonic()
    time.sleep(1.0)
    return f"a second's sleep takes {time.monotonic() - start:.4f} s"


def clock_source():
    with open("/sys/devices/system/clocksource/clocksource0/current_clocksource") as file:
        return file.read().strip()


print(f"kernel {os.uname().release}, clock source {clock_source()}, python-can {can.__version__}")
for check in [candump_sees_cansend, robot_load, slcan_is_an_interface, clock]:
    if check is slcan_is_an_interface and os.geteuid() != 0:
        print("slcan: NOT CHECKED, only root can make an interface of a terminal")
        continue
    print(f"{check.__name__}: {check() or 'yes'}")
    sys.stdout.flush()
