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
    /// Controllers at all addresses.
    All,
    /// Controller of one robot.
    One(Node, &'a RobotNames),
}

/// Sender of a message.
#[derive(Clone, Copy, PartialEq)]
enum Sender {
    Host,
    Controller,
    Anyone,
}

/// Definition of a message without its address.
struct Kind {
    schema: &'static str,
    class: u16,
    number: u16,
    len: u8,
    from: Sender,
    /// True if the message may be addressed to all controllers.
    to_all: bool,
    period_ms: u32,
    comment: &'static str,
    layout: Layout,
}

const HOST: &str = "host";

/// Names of the kinds of commands, as in the table of `docs/formats/wire-format.md`.
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
/// Names of the kinds of parameter requests.
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
            Sender::Host => (Some(HOST.to_owned()), controller),
            Sender::Controller => (controller, Some(HOST.to_owned())),
            Sender::Anyone => (None, controller),
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

fn kinds(names: Option<&RobotNames>) -> [Kind; 23] {
    let kind = |schema, class, number, len, from, comment, layout| {
        let (to_all, period_ms) = (false, 0);
        Kind { schema, class, number, len, from, to_all, period_ms, comment, layout }
    };
    let to = |schema, class, len, comment, layout| Kind {
        to_all: true,
        ..kind(schema, class, 0, len, Sender::Host, comment, layout)
    };
    let from = |schema, class, number, len, comment, layout| {
        kind(schema, class, number, len, Sender::Controller, comment, layout)
    };
    let state = Layout::sealed().unsigned("state", 8).names(coded(State::ALL, State::code));
    let host_ms = clocked("host_ms", "Clock of the host");
    let controller_ms = clocked("controller_ms", "Clock of the controller");
    [
        Kind {
            from: Sender::Anyone,
            ..to(
                "estop",
                0,
                0,
                "Emergency stop by the identifier alone; data bytes are ignored",
                Layout::new(),
            )
        },
        from("estop_ack", 0, 1, 2, "The controller has stopped", state),
        kind(
            "authenticator",
            0,
            2,
            8,
            Sender::Host,
            "Authenticates the next message of a class",
            authenticator(),
        ),
        Kind {
            period_ms: HEARTBEAT_PERIOD_MS,
            ..to("heartbeat", 1, 6, "Sent regularly by the host", host_ms)
        },
        Kind {
            period_ms: HEARTBEAT_PERIOD_MS,
            ..from("heartbeat_reply", 1, 1, 6, "Answer to each heartbeat", controller_ms)
        },
        to("command", 2, 8, "Command to the controller, executed once", command()),
        Kind {
            period_ms: STATUS_PERIOD_MS,
            ..from(
                "status",
                3,
                0,
                8,
                "State of the controller, sent regularly and on change",
                status(),
            )
        },
        from(
            "fault",
            3,
            1,
            8,
            "Details of a fault, when it appears and then once a second",
            fault(),
        ),
        from("command_ack", 3, 2, 7, "Answer to each command", command_ack()),
        from(
            "joint",
            4,
            0,
            8,
            "Measurements of one channel; channels alternate",
            joint(names, false),
        ),
        kind(
            "setpoint",
            4,
            1,
            8,
            Sender::Host,
            "Setpoint of one channel, streamed at 60 Hz or in answer to a sample",
            setpoint(names, 5e-3),
        ),
        from(
            "wide_joint",
            4,
            6,
            8,
            "Measurements of one channel beyond the scale of JOINT",
            joint(names, true),
        ),
        kind(
            "wide_setpoint",
            4,
            7,
            8,
            Sender::Host,
            "Setpoint of one channel with a torque beyond the scale of SETPOINT",
            setpoint(names, 0.5),
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
        from("sample", 4, 4, 8, "End of the measurements of one sample", sample()),
        from(
            "readings",
            4,
            5,
            6,
            "Temperature and supply voltage of one channel; channels alternate",
            readings(names),
        ),
        kind("transport_to_controller", 5, 0, 8, Sender::Host, "ISO-TP: requests", isotp()),
        from("transport_to_host", 5, 1, 8, "ISO-TP: responses", isotp()),
        to("parameter", 6, 8, "Reads or sets gains and limits at run time", parameter()),
        from("parameter_ack", 6, 1, 8, "Answer to each PARAMETER", parameter_ack()),
        to("discover", 7, 0, "Requests the addresses of all controllers", Layout::new()),
        from("discovered", 7, 1, 7, "Answer to DISCOVER", discovered()),
    ]
}

/// Codes and names of a protocol enumeration's values.
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
        .comment("PLAY: command code of the motion; TRACK: fraction of kp, %")
        .steps("speed", 8, 1.0 / 64.0)
        .comment(
            "PLAY: fraction of the planned speed; TRACK: 64 times this value is the fraction \
            of kd, %",
        )
        .range(-2.0, 127.0 / 64.0)
        .unsigned("arg", 16)
        .comment("Second step of ARM and CLEAR: nonce; TRACK: sample rate, Hz")
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
        .comment("Played clip: motions, then transitions, numbered as in the library")
        .unsigned("frame", 12)
        .comment("Frame of the clip, at 60 Hz")
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

/// Meaning of the value in a fault report, for each fault with a value.
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
        .comment("Nonce, number of frames until the motion starts, or sample rate in Hz")
}

fn channel(layout: Layout) -> Layout {
    layout.unsigned("channel", 8).or_none().comment("Numbered as in the robot's configuration")
}

/// Telemetry of a joint.
///
/// Without a robot file, the channel number is a field next to the measurements, which any tool can read. With a robot file,
/// the channel selects signals named after the joint, which tools plot by name.
fn joint(names: Option<&RobotNames>, is_wide: bool) -> Layout {
    let layout = Layout::new().unsigned("channel", 8);
    let Some(names) = names else {
        let layout = layout.comment("Numbered as in the robot's configuration");
        return layout.followed_by(servo::telemetry_of("", is_wide));
    };
    let names: Vec<_> = (0..).zip(names.identified()).map(|(i, (name, _))| (i, name)).collect();
    let mut layout = layout.names(names.clone()).selects();
    for (i, name) in names {
        layout = layout.when(i, servo::telemetry_of(&format!("{name}_"), is_wide));
    }
    layout
}

/// Slow readings of an actuator; signals as in [`joint`].
fn readings(names: Option<&RobotNames>) -> Layout {
    let values = |layout: Layout, prefix: &str| {
        layout
            .steps(&format!("{prefix}temperature"), 16, 0.1)
            .unit("degC")
            .steps(&format!("{prefix}voltage"), 16, 0.01)
            .unit("V")
            .comment("Supply voltage")
    };
    let layout = Layout::sealed().unsigned("channel", 8);
    let Some(names) = names else {
        return values(layout.comment("Numbered as in the robot's configuration"), "");
    };
    let names: Vec<_> = (0..).zip(names.identified()).map(|(i, (name, _))| (i, name)).collect();
    let mut layout = layout.names(names.clone()).selects();
    for (i, name) in names {
        layout = layout.when(i, values(Layout::new().at(16), &format!("{name}_")).finish());
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
        .comment("Number of the sample modulo 256, repeated as frame of its setpoints")
        .unsigned("answered", 8)
        .comment("Sample whose setpoints were in force")
        .steps_up("delay", 8, 2e-4)
        .unit("s")
        .comment("From the measurements of the answered sample until the answer came into force")
        .unsigned("contacts", 24)
        .comment("One bit for each end effector that touches the ground")
        .unsigned("has_contacts", 1)
        .unsigned("has_answered", 1)
}

/// Set-point of the host. With a robot file, the channel selects signals named after the joint.
fn setpoint(names: Option<&RobotNames>, torque_step_nm: f64) -> Layout {
    let layout = Layout::sealed()
        .unsigned("frame", 8)
        .comment(
            "After STREAM, counter from 0, modulo 256; after TRACK, number of the answered sample",
        )
        .unsigned("channel", 7);
    let stiff = |layout: Layout| {
        layout
            .unsigned("stiff", 1)
            .comment("1: full gains; 0: fractions of the gains given with TRACK")
    };
    let values = |layout: Layout, prefix: &str, unit| {
        layout
            .steps(&format!("{prefix}value"), 24, 1e-4)
            .unit(unit)
            .steps(&format!("{prefix}torque"), 16, torque_step_nm)
            .unit("Nm")
            .comment("Feed-forward torque")
    };
    let Some(names) = names else {
        let layout = stiff(layout.comment("Numbered as in the robot's configuration"));
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

/// Layout of the four kinds of ISO-TP frames, distinguished by the high half of the first byte. A signal beyond the end of a
/// short frame has no value.
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

/// Types of the messages in ISO-TP frames, from lines of the schema such as `isotp 10 begin ...`.
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
