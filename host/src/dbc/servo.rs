//! Messages of the Rollwalk servo profile.

use super::layout::Layout;
use super::{Database, Message, RobotNames, Signal, identifier};
use rollwalk_protocol::actuator::{ActuatorStatus, MAX_ID};

/// Actuator, with its address, name and kind. The kind is `None` if it is unknown.
struct Actuator {
    id: u8,
    name: String,
    is_wheel: Option<bool>,
}

pub(super) fn database(of: Option<(u8, &RobotNames)>) -> Database {
    let actuators: Vec<_> = match of {
        None => {
            (0..=MAX_ID).map(|id| Actuator { id, name: id.to_string(), is_wheel: None }).collect()
        }
        Some((bus, names)) => names
            .identified()
            .into_iter()
            .filter(|(_, channel)| channel.bus == bus)
            .map(|(name, channel)| Actuator {
                id: channel.id,
                name,
                is_wheel: Some(channel.is_wheel),
            })
            .collect(),
    };
    let node = |actuator: &Actuator| match of {
        None => format!("actuator_{}", actuator.name),
        Some(_) => actuator.name.clone(),
    };
    let mut nodes = vec!["controller".to_owned()];
    nodes.extend(actuators.iter().map(node));
    let title = match of {
        None => "actuator bus, Rollwalk servo profile".to_owned(),
        Some((bus, names)) => format!("actuator bus {bus} of {}", identifier(&names.robot)),
    };
    let messages = actuators.iter().flat_map(|actuator| messages(actuator, &node(actuator)));
    Database { title, nodes, messages: messages.collect() }.sorted()
}

fn messages(actuator: &Actuator, node: &str) -> Vec<Message> {
    let message = |schema, base: u16, len, comment, layout: Layout| {
        let to = base != 0x180 && base != 0x480;
        let (sender, receiver) = if to { ("controller", node) } else { (node, "controller") };
        Message {
            schema,
            name: identifier(&format!("{}_{}", schema.to_uppercase(), actuator.name)),
            id: base + u16::from(actuator.id),
            len,
            sender: Some(sender.to_owned()),
            receiver: Some(receiver.to_owned()),
            period_ms: 0,
            comment,
            signals: layout.finish(),
        }
    };
    let mut messages = vec![
        message("control", 0x080, 1, "Switches torque off or on, or requests feedback", control()),
        message("feedback", 0x180, 8, "Answer to every CONTROL and setpoint", feedback()),
        message(
            "wide_feedback",
            0x480,
            8,
            "Feedback beyond the scale of FEEDBACK",
            wide_feedback(),
        ),
    ];
    if actuator.is_wheel != Some(true) {
        let text = "Torque = kp (position - measured) + kd (velocity - measured)";
        messages.push(message("joint_setpoint", 0x100, 8, text, joint_setpoint()));
        let text = "Torque = kp (position - measured) + kd (velocity - measured) + torque";
        messages.push(message("joint_torque_setpoint", 0x280, 8, text, joint_torque_setpoint(1)));
        let text = "Setpoint beyond the scales of the other frames";
        messages.push(message("wide_joint_setpoint", 0x380, 8, text, joint_torque_setpoint(16)));
    }
    if actuator.is_wheel != Some(false) {
        let text = "Torque = kd (speed - measured)";
        messages.push(message("wheel_setpoint", 0x200, 8, text, wheel_setpoint()));
        let text = "Torque = kd (speed - measured) + torque";
        messages.push(message("wheel_torque_setpoint", 0x300, 8, text, wheel_torque_setpoint(1)));
        let text = "Setpoint beyond the scales of the other frames";
        messages.push(message("wide_wheel_setpoint", 0x400, 8, text, wheel_torque_setpoint(16)));
    }
    messages
}

fn control() -> Layout {
    let commands = ["Disable", "Enable", "Query"];
    let named = (0..).zip(commands).map(|(code, name)| (code, name.to_owned()));
    Layout::new().unsigned("command", 8).range(0.0, 2.0).names(named)
}

fn joint_setpoint() -> Layout {
    pose(Layout::new())
        .steps_up("kp", 16, 1e-2)
        .unit("Nm/rad")
        .steps_up("kd", 16, 1e-3)
        .unit("Nms/rad")
}

fn feedback() -> Layout {
    let text = "Incremented with each feedback; an equal value marks a repeated frame";
    measured(Layout::new()).unsigned("counter", 8).comment(text)
}

fn wheel_setpoint() -> Layout {
    Layout::new()
        .steps("speed", 32, 1e-4)
        .unit("rad/s")
        .steps_up("kd", 16, 1e-3)
        .unit("Nms/rad")
        .steps_up("torque_limit", 16, 5e-3)
        .unit("Nm")
}

/// Set-point of a joint with torque. Steps of gains and torque are `wider` times those of a narrow frame.
fn joint_torque_setpoint(wider: u32) -> Layout {
    let layout = Layout::new().steps("position", 16, 2e-4).unit("rad");
    let layout = layout.steps("velocity", 14, 8e-3).unit("rad/s");
    torque(short(layout, "kp", &format!("{wider} mNm/rad")), wider)
}

fn wheel_torque_setpoint(wider: u32) -> Layout {
    let layout = Layout::new().steps("speed", 30, 1e-4).unit("rad/s");
    torque(short(layout, "torque_limit", &format!("{wider} mNm")), wider)
}

/// Adds the final fields of set-points with a torque.
fn torque(layout: Layout, wider: u32) -> Layout {
    let kd = format!("{} mNms/rad", f64::from(wider) / 10.0);
    short_torque(short(layout, "kd", &kd), wider)
}

/// Adds a torque with a sign in steps of `mnm` mN·m.
fn short_torque(layout: Layout, mnm: u32) -> Layout {
    let layout = short(layout, "torque", &format!("{mnm} mNm"));
    layout.unsigned("torque_sign", 1).comment("1: negative")
}

fn wide_feedback() -> Layout {
    let layout = short_torque(wide_pose(Layout::new()), 16);
    let text = "Incremented with each feedback; an equal value marks a repeated frame";
    layout.flags(8, status_flags(&[])).unsigned("counter", 8).comment(text)
}

/// Adds a floating-point number in steps of `unit`. Mantissa and exponent are two fields, because the value is not a multiple
/// of the raw bits.
fn short(layout: Layout, name: &str, unit: &str) -> Layout {
    let text = format!(
        "In steps of {unit}; with an exponent e above 0, the value is (128 + mantissa) \
            2^(e-1) steps"
    );
    layout
        .unsigned(&format!("{name}_mantissa"), 7)
        .comment(text)
        .unsigned(&format!("{name}_exponent"), 4)
}

/// Adds position and velocity.
fn pose(layout: Layout) -> Layout {
    position(layout).steps("velocity", 16, 2e-3).unit("rad/s")
}

/// Adds position and velocity of a wide measurement.
fn wide_pose(layout: Layout) -> Layout {
    position(layout).steps("velocity", 20, 2e-3).unit("rad/s")
}

fn position(layout: Layout) -> Layout {
    layout.steps("position", 16, 2e-4).unit("rad").comment("For a wheel from -pi to pi")
}

/// Adds the measurements of an actuator and its status.
fn measured(layout: Layout) -> Layout {
    pose(layout).steps("torque", 16, 5e-3).unit("Nm").flags(8, status_flags(&[]))
}

/// Status bit that JOINT has in addition to the status bits of an actuator.
const UNANSWERED: [(u8, &str, &str); 1] =
    [(ActuatorStatus::UNANSWERED, "unanswered", "No answer; the other values are older")];

/// Adds the telemetry fields of an actuator.
fn telemetry(layout: Layout) -> Layout {
    let flags = status_flags(&UNANSWERED);
    pose(layout).steps("torque", 16, 5e-3).unit("Nm").flags(8, flags)
}

/// Adds the telemetry fields of an actuator beyond the scale of [`telemetry`].
fn wide_telemetry(layout: Layout) -> Layout {
    short_torque(wide_pose(layout), 16).flags(8, status_flags(&UNANSWERED))
}

fn status_flags(more: &[(u8, &'static str, &'static str)]) -> Vec<(u16, String, &'static str)> {
    let flags = [
        (ActuatorStatus::ENABLED, "enabled", "Torque is on"),
        (ActuatorStatus::TORQUE_LIMITED, "torque_limited", "The torque is at its limit"),
        (ActuatorStatus::POSITION_LIMITED, "position_limited", "At the actuator's own limit"),
        (ActuatorStatus::TIMED_OUT, "timed_out", "No setpoint for too long: torque off"),
        (ActuatorStatus::OVERHEATED, "overheated", "Too hot: torque off"),
        (ActuatorStatus::BAD_VOLTAGE, "bad_voltage", "Supply out of range: torque off"),
        (ActuatorStatus::HARDWARE, "hardware", "Sensor or other hardware failed: torque off"),
    ];
    let flags = flags.iter().chain(more);
    flags
        .map(|&(mask, name, text)| (mask.trailing_zeros() as u16, format!("status_{name}"), text))
        .collect()
}

/// Fields of a channel's telemetry, narrow or wide, which begin at the second byte. `prefix` begins the names of the signals.
pub(super) fn telemetry_of(prefix: &str, is_wide: bool) -> Vec<Signal> {
    let renamed = |signal: Signal| {
        let name = format!("{prefix}{}", signal.name);
        Signal { name, ..signal }
    };
    let layout = Layout::new().at(8);
    let layout = if is_wide { wide_telemetry(layout) } else { telemetry(layout) };
    layout.finish().into_iter().map(renamed).collect()
}
