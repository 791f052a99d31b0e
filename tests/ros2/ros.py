"""A client of ROS 2 without ROS: messages, topics and services over Cyclone DDS, which shares no code with the node.

Topics and services have the names of rmw_cyclonedds_cpp: `rt/NAME`, `rq/NAMERequest` and `rr/NAMEReply`, with the
client and the number of the request at the beginning of both (docs/ros2.md).
"""

import dataclasses
import itertools
import time

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32, int64, sequence, uint8, uint32, uint64
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

# Only on this computer, and without multicast, because the loopback interface may lack it.
CONFIG = """<CycloneDDS><Domain><General>
  <Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces><AllowMulticast>false</AllowMulticast>
</General><Discovery>
  <ParticipantIndex>auto</ParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers>
</Discovery></Domain></CycloneDDS>"""

RELIABLE = Policy.Reliability.Reliable(duration(seconds=1))
STREAMED = Qos(RELIABLE, Policy.Durability.Volatile, Policy.History.KeepLast(10))
LATCHED = Qos(RELIABLE, Policy.Durability.TransientLocal, Policy.History.KeepLast(1))


@dataclasses.dataclass
class String(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    data: str


@dataclasses.dataclass
class Broken(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    """Malformed string whose length exceeds the message."""

    length: uint32


@dataclasses.dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclasses.dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclasses.dataclass
class JointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@dataclasses.dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    x: float64
    y: float64
    z: float64


@dataclasses.dataclass
class Twist(IdlStruct, typename="geometry_msgs::msg::dds_::Twist_"):
    linear: Vector3
    angular: Vector3


@dataclasses.dataclass
class TwistStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TwistStamped_"):
    header: Header
    twist: Twist


@dataclasses.dataclass
class KeyValue(IdlStruct, typename="diagnostic_msgs::msg::dds_::KeyValue_"):
    key: str
    value: str


@dataclasses.dataclass
class DiagnosticStatus(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticStatus_"):
    level: uint8
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue]


@dataclasses.dataclass
class DiagnosticArray(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticArray_"):
    header: Header
    status: sequence[DiagnosticStatus]


@dataclasses.dataclass
class Log(IdlStruct, typename="rcl_interfaces::msg::dds_::Log_"):
    stamp: Time
    level: uint8
    name: str
    msg: str
    file: str
    function: str
    line: uint32


@dataclasses.dataclass
class TriggerRequest(IdlStruct, typename="std_srvs::srv::dds_::Trigger_Request_"):
    client: uint64
    number: int64
    structure_needs_at_least_one_member: uint8


@dataclasses.dataclass
class TriggerResponse(IdlStruct, typename="std_srvs::srv::dds_::Trigger_Response_"):
    client: uint64
    number: int64
    success: bool
    message: str


def on_this_computer(domain):
    """A domain for participants of this process; it lasts as long as the value."""
    return Domain(domain, CONFIG)


class Client:
    """A participant of a domain."""

    def __init__(self, domain):
        self.participant = DomainParticipant(domain)
        self.numbers = itertools.count(1)

    def reader(self, name, kind, qos=STREAMED):
        """A subscription of a topic."""
        return DataReader(self.participant, Topic(self.participant, "rt" + name, kind), qos)

    def writer(self, name, kind):
        """A publisher of a topic."""
        return DataWriter(self.participant, Topic(self.participant, "rt" + name, kind), STREAMED)

    def service(self, name):
        """A client of a std_srvs/Trigger."""
        return Trigger(self, name)


class Trigger:
    """A client of a service."""

    def __init__(self, client, name):
        participant = client.participant
        request = Topic(participant, f"rq{name}Request", TriggerRequest)
        reply = Topic(participant, f"rr{name}Reply", TriggerResponse)
        self.name, self.numbers = name, client.numbers
        self.writer = DataWriter(participant, request, STREAMED)
        self.reader = DataReader(participant, reply, STREAMED)

    def call(self, seconds=5.0):
        """Answer: success, and a message."""
        return self.answer(self.begin(), seconds)

    def begin(self):
        """Calls without waiting for the answer; returns the number of the call."""
        wait_for(lambda: self.writer.get_matched_subscriptions(), f"{self.name} is offered")
        wait_for(lambda: self.reader.get_matched_publications(), f"{self.name} answers")
        client, number = 0x0123456789ABCDEF, next(self.numbers)
        self.writer.write(TriggerRequest(client, number, 0))
        return client, number

    def answer(self, call, seconds=5.0):
        """Answer to a call."""

        def answer():
            answers = [one for one in self.reader.take(10) if isinstance(one, TriggerResponse)]
            return [one for one in answers if (one.client, one.number) == call]

        found = wait_for(answer, f"an answer of {self.name}", seconds)
        return found[0].success, found[0].message


def wait_for(condition, what, seconds=10.0):
    """First true value of a condition."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.02)
    raise AssertionError(f"not within {seconds} s: {what}")
