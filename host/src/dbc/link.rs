//! Messages of the link.

use super::layout::Layout;
use super::{Database, Message, RobotNames, identifier, servo};
use rollwalk_protocol::faults::{Fault, Severity};
use rollwalk_protocol::wire::{
    CommandResult, HEARTBEAT_PERIOD_MS, Node, PROTOCOL_MAJOR, PROTOCOL_MINOR, Parameter,
    ParameterResult, SCHEMA, SCHEMA_HASH, STATUS_PERIOD_MS, State,
};
use std::fmt::Debug;

/// Controllers on the link.
#[derive(Clone, Copy)]
pub(super) enum Controllers<'a> {
    /// A controller at each address.
    All,
    /// The controller of a robot.
    One(Node, &'a RobotNames),
}

/// Sender of a message.
#[derive(Clone, Copy, PartialEq)]
enum From {
    Host,
    Controller,
    Anyone,
}

/// A message without its address.
struct Kind {
    schema: &'static str,
    class: u16,
    number: u16,
    len: u8,
    from: From,
    /// True if the message may be addressed to all controllers.
    to_all: bool,
    period_ms: u32,
    comment: &'static str,
    layout: Layout,
}

const HOST: &str = "host";

/// Kinds of commands, as in the table of `docs/formats/wire-format.md`.
const COMMAND_KINDS: [&str; 11] = [
    "Play",
    "Pause",
    "Resume",
    "Return",
    "Disarm",
    "ArmRequest",
    "ArmConfirm",
    "ClearRequest",
    "ClearConfirm",
    "Stream",
    "Track",
];
/// Kinds of requests about parameters.
const PARAMETER_KINDS: [&str; 5] = ["Get", "Set", "Reset", "Save", "Origin"];

pub(super) fn database(controllers: Controllers<'_>) -> Database {
    let (addresses, names) = match controllers {
        Controllers::All => ((0..15).collect(), None),
        Controllers::One(node, names) => (vec![u16::from(node.number())], Some(names)),
    };
    let controller = |address: u16| match names {
        None => format!("controller_{address}"),
        Some(names) => identifier(&names.robot),
    };
    let mut nodes = vec![HOST.to_owned()];
    nodes.extend(addresses.iter().map(|&address| controller(address)));
    let mut messages = Vec::new();
    for kind in kinds(names) {
        let to_all = kind.to_all.then_some(None);
        for address in addresses.iter().copied().map(Some).chain(to_all) {
            messages.push(kind.message(address, address.map(controller)));
        }
    }
    let of = names.map_or(String::new(), |names| format!(" of {}", identifier(&names.robot)));
    let version = format!("protocol {PROTOCOL_MAJOR}.{PROTOCOL_MINOR}, schema {SCHEMA_HASH:08x}");
    Database { title: format!("link{of}, {version}"), nodes, messages }.sorted()
}

impl Kind {
    fn message(&self, address: Option<u16>, controller: Option<String>) -> Message {
        let suffix = address.map_or("all".into(), |address| address.to_string());
        let (sender, receiver) = match self.from {
            From::Host => (Some(HOST.to_owned()), controller),
            From::Controller => (controller, Some(HOST.to_owned())),
            From::Anyone => (None, controller),
        };
        Message {
            schema: self.schema,
            name: identifier(&format!("{}_{suffix}", self.schema.to_uppercase())),
            id: self.class << 8 | address.unwrap_or(0xF) << 4 | self.number,
            len: self.len,
            sender,
            receiver,
            period_ms: self.period_ms as u16,
            comment: self.comment,
            signals: self.layout.clone().finish(),
        }
    }
}

fn kinds(names: Option<&RobotNames>) -> [Kind; 20] {
    let kind = |schema, class, number, len, from, comment, layout| {
        let (to_all, period_ms) = (false, 0);
        Kind { schema, class, number, len, from, to_all, period_ms, comment, layout }
    };
    let to = |schema, class, len, comment, layout| Kind {
        to_all: true,
        ..kind(schema, class, 0, len, From::Host, comment, layout)
    };
    let from = |schema, class, number, len, comment, layout| {
        kind(schema, class, number, len, From::Controller, comment, layout)
    };
    let state = Layout::sealed().unsigned("state", 8).names(coded(State::ALL, State::code));
    let host_ms = clocked("host_ms", "Clock of the host");
    let controller_ms = clocked("controller_ms", "Clock of the controller");
    [
        Kind {
            from: From::Anyone,
            ..to(
                "estop",
                0,
                0,
                "Stop: the identifier alone says it, any bytes may follow",
                Layout::new(),
            )
        },
        from("estop_ack", 0, 1, 2, "The controller has stopped", state),
        kind(
            "authenticator",
            0,
            2,
            8,
            From::Host,
            "Proof that the next message of a class is from a host with the key",
            authenticator(),
        ),
        Kind {
            period_ms: HEARTBEAT_PERIOD_MS,
            ..to("heartbeat", 1, 6, "The host is there", host_ms)
        },
        Kind {
            period_ms: HEARTBEAT_PERIOD_MS,
            ..from("heartbeat_reply", 1, 1, 6, "Answer to each heartbeat", controller_ms)
        },
        to("command", 2, 8, "What the controller shall do, once", command()),
        Kind {
            period_ms: STATUS_PERIOD_MS,
            ..from("status", 3, 0, 8, "How the controller is; also on change", status())
        },
        from("fault", 3, 1, 8, "A fault in detail: when it appears, then once a second", fault()),
        from("command_ack", 3, 2, 7, "Answer to each command", command_ack()),
        from("joint", 4, 0, 8, "Measurements of one channel after the other", joint(names)),
        kind(
            "setpoint",
            4,
            1,
            8,
            From::Host,
            "Setpoint of one channel: streamed, 60 a second, or in answer to a sample",
            setpoint(names),
        ),
        from("gyro", 4, 2, 7, "Angular velocity of the root link, in its axes", imu(2e-3, "rad/s")),
        from(
            "accelerometer",
            4,
            3,
            7,
            "Specific force at the root link, in its axes, mean since the last sample",
            imu(5e-3, "m/s2"),
        ),
        from("sample", 4, 4, 8, "End of the measurements of an instant", sample()),
        kind("transport_to_controller", 5, 0, 8, From::Host, "ISO-TP: requests", isotp()),
        from("transport_to_host", 5, 1, 8, "ISO-TP: responses", isotp()),
        to("parameter", 6, 8, "Gains and limits at run time", parameter()),
        from("parameter_ack", 6, 1, 8, "Answer to each PARAMETER", parameter_ack()),
        to("discover", 7, 0, "Who is there?", Layout::new()),
        from("discovered", 7, 1, 7, "Answer to DISCOVER", discovered()),
    ]
}

/// Numbers and names of an enumeration of the protocol.
fn coded<T: Copy + Debug>(all: &[T], code: fn(T) -> u8) -> Vec<(u64, String)> {
    all.iter().map(|&value| (u64::from(code(value)), format!("{value:?}"))).collect()
}

fn listed(names: &[&str]) -> Vec<(u64, String)> {
    (0..).zip(names).map(|(number, name)| (number, (*name).to_owned())).collect()
}

fn clocked(name: &str, text: &'static str) -> Layout {
    Layout::sealed().unsigned("seq", 8).unsigned(name, 32).unit("ms").comment(text)
}

/// Fields `seq` and `kind` of a command or its answer.
fn numbered(kinds: &[&str]) -> Layout {
    let layout = Layout::sealed().unsigned("seq", 4);
    layout.unsigned("kind", 4).names(listed(kinds))
}

fn authenticator() -> Layout {
    let classes = [(1, "heartbeat"), (2, "command"), (5, "transfer"), (6, "parameter")];
    Layout::new()
        .unsigned("session", 4)
        .comment("Low bits of the session's number")
        .unsigned("class", 4)
        .names(classes.map(|(class, name)| (class, name.to_owned())).to_vec())
        .unsigned("counter", 8)
        .comment("Low bits of the message's counter")
        .unsigned("tag", 48)
        .motorola()
        .comment("Authentication code")
}

fn command() -> Layout {
    numbered(&COMMAND_KINDS)
        .unsigned("code", 8)
        .comment("Of PLAY: command code of the motion; of TRACK: part of kp, %")
        .steps("speed", 8, 1.0 / 64.0)
        .comment("Of PLAY: part of the planned speed; of TRACK: 64ths are the part of kd, %")
        .range(-2.0, 127.0 / 64.0)
        .unsigned("arg", 16)
        .comment("Of ARM and CLEAR, second step: the nonce; of TRACK: samples a second")
        .unsigned("valid_until_ms", 16)
        .unit("ms")
        .comment("Clock of the controller, low 16 bits")
}

fn status() -> Layout {
    let fault = |&fault: &Fault| {
        (u16::from(fault.code()), format!("fault_{}", snake(&format!("{fault:?}"))), "")
    };
    Layout::sealed()
        .unsigned("state", 4)
        .names(coded(State::ALL, State::code))
        .unsigned("severity", 4)
        .names(coded(Severity::ALL, Severity::code))
        .flags(16, Fault::ALL.iter().map(fault))
        .unsigned("clip", 8)
        .or_none()
        .comment("What is played: motions, then transitions, numbered as in the library")
        .unsigned("frame", 12)
        .comment("Frame of the clip, 60 a second")
        .unsigned("counter", 4)
        .unsigned("library", 8)
        .comment("Low byte of the active library's identity, 0 without library")
}

fn fault() -> Layout {
    channel(
        Layout::sealed()
            .unsigned("counter", 8)
            .unsigned("fault", 8)
            .names(coded(Fault::ALL, Fault::code)),
    )
    .float("value")
    .comment(fault_values())
}

/// Meaning of the value in a fault report, for each fault.
fn fault_values() -> String {
    let of = |fault: &Fault| Some(format!("{fault:?}: {}", fault.description().value?));
    Fault::ALL.iter().filter_map(of).collect::<Vec<_>>().join("; ")
}

fn command_ack() -> Layout {
    numbered(&COMMAND_KINDS)
        .unsigned("result", 8)
        .names(coded(CommandResult::ALL, CommandResult::code))
        .unsigned("state", 8)
        .names(coded(State::ALL, State::code))
        .unsigned("motion", 8)
        .or_none()
        .unsigned("value", 16)
        .comment("A nonce, the frames until the motion starts, or samples a second")
}

fn channel(layout: Layout) -> Layout {
    layout.unsigned("channel", 8).or_none().comment("As in the robot's configuration")
}

/// Telemetry of a joint. Without a robot file the channel number is a field next to the measurements, which any tool
/// reads; with one, the channel selects signals named after the joint, which tools plot by name.
fn joint(names: Option<&RobotNames>) -> Layout {
    let layout = Layout::new().unsigned("channel", 8);
    let Some(names) = names else {
        return servo::telemetry(layout.comment("As in the robot's configuration"));
    };
    let names: Vec<_> = (0..).zip(names.identified()).map(|(i, (name, _))| (i, name)).collect();
    let mut layout = layout.names(names.clone()).selects();
    for (i, name) in names {
        layout = layout.when(i, servo::telemetry_of(&name, 8));
    }
    layout
}

/// Three components along the axes of the root link.
fn imu(scale: f64, unit: &'static str) -> Layout {
    ["x", "y", "z"]
        .into_iter()
        .fold(Layout::sealed(), |layout, axis| layout.steps(axis, 16, scale).unit(unit))
}

fn sample() -> Layout {
    Layout::sealed()
        .unsigned("number", 8)
        .comment("Modulo 256: its setpoints have it as their frame")
        .unsigned("answered", 8)
        .comment("Sample whose setpoints were in force")
        .steps_up("delay", 8, 2e-4)
        .unit("s")
        .comment("From the measurements of the answered sample until the answer came into force")
        .unsigned("contacts", 24)
        .comment("End effectors that touch the ground, a bit each")
        .unsigned("has_contacts", 1)
        .unsigned("has_answered", 1)
}

/// A setpoint of the host. With a robot file the channel selects signals named after the joint.
fn setpoint(names: Option<&RobotNames>) -> Layout {
    let layout = Layout::sealed()
        .unsigned("frame", 8)
        .comment("From 0 after STREAM, modulo 256; number of the sample that is answered")
        .unsigned("channel", 7);
    let stiff = |layout: Layout| {
        layout.unsigned("stiff", 1).comment("With all of the gains, not the parts that TRACK named")
    };
    let values = |layout: Layout, prefix: &str, unit| {
        layout
            .steps(&format!("{prefix}value"), 24, 1e-4)
            .unit(unit)
            .steps(&format!("{prefix}torque"), 16, 5e-3)
            .unit("Nm")
            .comment("Torque that is fed forward")
    };
    let Some(names) = names else {
        let layout = stiff(layout.comment("As in the robot's configuration"));
        return values(layout, "", "rad|rad/s");
    };
    let channels: Vec<_> = (0..).zip(names.identified()).collect();
    let of_channel = channels.iter().map(|(i, (name, _))| (*i, name.clone()));
    let mut layout = stiff(layout.names(of_channel).selects());
    for (i, (name, channel)) in channels {
        let unit = if channel.is_wheel { "rad/s" } else { "rad" };
        let prefix = format!("{name}_");
        layout = layout.when(i, values(Layout::new().at(24), &prefix, unit).finish());
    }
    layout
}

/// The four kinds of ISO-TP frames, distinguished by the high half of the first byte. Frames may be shorter: a signal
/// beyond the end has no value.
fn isotp() -> Layout {
    let bytes = |mut layout: Layout, prefix: &str, count: u16| {
        for i in 0..count {
            layout = layout.unsigned(&format!("{prefix}_byte_{i}"), 8);
        }
        layout
    };
    let typed = |layout: Layout, name: &str| layout.unsigned(name, 8).names(isotp_types());
    let single = typed(Layout::new().unsigned("single_length", 4).at(8), "single_type");
    let first = Layout::new().at(4).unsigned("first_length", 12).motorola();
    let first = typed(first.at(16), "first_type");
    let next = Layout::new().unsigned("next_number", 4).at(8);
    let flow = Layout::new().unsigned("flow_status", 4).names(listed(&["Go", "Wait", "Overflow"]));
    let flow = flow
        .at(8)
        .unsigned("flow_block_size", 8)
        .comment("Frames until the next flow control, 0: all")
        .unsigned("flow_separation", 8)
        .comment("Least time between frames: 0 to 127 ms; 241 to 249: 100 to 900 us");
    Layout::new()
        .at(4)
        .unsigned("pci", 4)
        .names(listed(&["Single", "First", "Next", "FlowControl"]))
        .range(0.0, 3.0)
        .selects()
        .when(0, bytes(single, "single", 6).finish())
        .when(1, bytes(first, "first", 5).finish())
        .when(2, bytes(next, "next", 7).finish())
        .when(3, flow.finish())
}

/// Types of the messages that ISO-TP carries, as the schema lists them: `isotp 10 begin ...`.
pub(super) fn isotp_types() -> Vec<(u64, String)> {
    SCHEMA
        .lines()
        .filter_map(|line| {
            let mut words = line.strip_prefix("isotp ")?.split(' ');
            Some((u64::from_str_radix(words.next()?, 16).ok()?, words.next()?.to_owned()))
        })
        .collect()
}

fn parameter() -> Layout {
    channel(about(numbered(&PARAMETER_KINDS)).zero(4)).float("value")
}

fn parameter_ack() -> Layout {
    let layout = about(numbered(&PARAMETER_KINDS)).unsigned("result", 4);
    channel(layout.names(coded(ParameterResult::ALL, ParameterResult::code))).float("value")
}

fn about(layout: Layout) -> Layout {
    layout.unsigned("parameter", 4).names(coded(Parameter::ALL, Parameter::code))
}

fn discovered() -> Layout {
    let layout = Layout::new().unsigned("uid", 48).motorola().comment("Serial number");
    layout.unsigned("protocol_major", 8)
}

/// Converts a name like `HostLost` to `host_lost`.
fn snake(name: &str) -> String {
    let mut text = String::new();
    let mut before = ' ';
    for c in name.chars() {
        if c.is_ascii_uppercase() && before.is_ascii_lowercase() {
            text.push('_');
        }
        text.push(c.to_ascii_lowercase());
        before = c;
    }
    text
}
