//! Conversion of the host's view of a robot to messages of ROS, as pure functions.

use crate::messages::{DiagnosticArray, DiagnosticStatus, Header, JointState, KeyValue, Level};
use rollwalk_host::actuators::{Actuators, ReadingWarning, UNKNOWN, reading_words};
use rollwalk_host::catalog::Catalog;
use rollwalk_host::describe::{condition, fault_report_on};
use rollwalk_host::operator::{FaultView, View};
use rollwalk_protocol::faults::Severity;
use rollwalk_protocol::wire::{JointTelemetry, State, Status, Torque};
use ros2_client::builtin_interfaces::Time;

/// States of joints and driven wheels as reported by their motors, with the names of the URDF.
pub fn joint_state<'a>(
    stamp: Time,
    joints: impl IntoIterator<Item = (&'a String, &'a JointTelemetry)>,
) -> JointState {
    let mut state = JointState {
        header: header(stamp),
        name: Vec::new(),
        position: Vec::new(),
        velocity: Vec::new(),
        effort: Vec::new(),
    };
    for (name, joint) in joints {
        state.name.push(name.clone());
        state.position.push(joint.position_rad.into());
        state.velocity.push(joint.velocity_rad_s.into());
        state.effort.push(joint.torque_nm.into());
    }
    state
}

/// Name of a state for programs, as in `rollwalk monitor --json`.
pub fn state(view: &View) -> String {
    latest_status(view).map_or_else(|| "Unknown".to_owned(), |status| format!("{:?}", status.state))
}

/// Most recent status of a controller in contact.
fn latest_status(view: &View) -> Option<Status> {
    view.status.filter(|_| view.link.contact)
}

/// Name of the playing motion or transition; empty if nothing plays, or without contact.
pub fn motion(view: &View, catalog: Option<&Catalog>) -> String {
    let playing = latest_status(view).filter(|status| status.state.torque() == Torque::Driven);
    let Some(clip) = playing.and_then(|status| status.clip) else { return String::new() };
    let name = catalog.and_then(|catalog| catalog.clip(clip));
    name.unwrap_or_else(|| format!("clip {clip}"))
}

/// Names of the playable motions of a library, one per line.
pub fn motions(catalog: Option<&Catalog>) -> String {
    let playable = catalog.into_iter().flat_map(|catalog| &catalog.motions);
    let names: Vec<_> =
        playable.filter(|motion| motion.code.is_some()).map(|motion| &*motion.name).collect();
    names.join("\n")
}

/// Inputs of the diagnostics of a robot.
pub struct DiagnosticInputs<'a> {
    /// State, faults and link.
    pub view: &'a View,
    /// Bus, as the user typed it.
    pub bus: &'a str,
    /// Name of the node, which prefixes the names of its parts.
    pub node: &'a str,
    /// Names of motions and channels.
    pub catalog: Option<&'a Catalog>,
}

/// Diagnostics of the controller, its link, and its actuators if they report temperature or supply voltage.
pub fn diagnostics(stamp: Time, of: &DiagnosticInputs<'_>) -> DiagnosticArray {
    let robot = of.catalog.map_or("robot", |catalog| &*catalog.robot);
    let hardware_id = format!("{robot}, node {}", of.view.node);
    let part = |name: &str, level, message: String, values: Vec<KeyValue>| {
        let (name, hardware_id) = (format!("{}: {name}", of.node), hardware_id.clone());
        DiagnosticStatus { level, name, message, hardware_id, values }
    };
    let (level, message, values) = controller(of);
    let controller = part("controller", level, message, values);
    let (level, message, values) = link(of);
    let link = part("link", level, message, values);
    let actuators = actuators(of);
    let actuators =
        actuators.map(|(level, message, values)| part("actuators", level, message, values));
    let status = [controller, link].into_iter().chain(actuators).collect();
    DiagnosticArray { header: header(stamp), status }
}

impl DiagnosticInputs<'_> {
    fn actuators(&self) -> &Actuators {
        self.catalog.map_or(&UNKNOWN, |catalog| &catalog.actuators)
    }

    fn channel(&self, channel: u8) -> String {
        let channels = self.catalog.map(|catalog| &catalog.channels);
        let name = channels.and_then(|names| names.get(usize::from(channel)));
        name.cloned().unwrap_or_else(|| format!("channel {channel}"))
    }
}

fn controller(of: &DiagnosticInputs<'_>) -> (Level, String, Vec<KeyValue>) {
    let view = of.view;
    let actuators = of.actuators();
    let mut values = vec![entry("state", state(view))];
    if latest_status(view).is_some() {
        values.push(entry("motion", motion(view, of.catalog)));
        values.push(entry("next", view.advice.to_owned()));
    }
    if let Some(library) = view.hello.and_then(|hello| hello.library) {
        values.push(entry("library", format!("{library:08x}")));
    }
    for fault in &view.faults {
        let name = fault.channel.map(|channel| of.channel(channel));
        let FaultView { fault, channel, value, .. } = *fault;
        values.push(entry("fault", fault_report_on(fault, channel, name, value, actuators)));
    }
    let Some(status) = latest_status(view) else {
        return (Level::Stale, "no contact with the controller".to_owned(), values);
    };
    if let Some(mismatch) = &view.mismatch {
        return (Level::Error, mismatch.clone(), values);
    }
    let stopped = matches!(status.state, State::Damped | State::TorqueOff | State::EStopped);
    let level = match status.severity {
        _ if stopped => Level::Error,
        Severity::None if status.faults.is_empty() => Level::Ok,
        Severity::None | Severity::Notice => Level::Warn,
        _ => Level::Error,
    };
    (level, condition(&status, actuators), values)
}

fn link(of: &DiagnosticInputs<'_>) -> (Level, String, Vec<KeyValue>) {
    let link = of.view.link;
    let ms =
        |us: Option<u64>| us.map_or("none yet".into(), |us| format!("{:.1}", us as f64 * 1e-3));
    let values = vec![
        entry("bus", of.bus.to_owned()),
        entry("round trip of the last heartbeat, ms", ms(link.round_trip_us)),
        entry("age of the last status, ms", ms(link.status_age_us)),
        entry("status frames received", link.received.to_string()),
        entry("status frames lost", link.lost.to_string()),
    ];
    let (level, message) = match (&of.view.bus_lost, &of.view.complaint) {
        (Some(why), _) => (Level::Error, format!("the bus is lost: {why}")),
        (None, Some(why)) => (Level::Warn, why.clone()),
        (None, None) if link.contact => (Level::Ok, "in contact".to_owned()),
        (None, None) => (Level::Error, "no contact".to_owned()),
    };
    (level, message, values)
}

/// Temperatures and supply voltages; `None` if no actuator reports them.
fn actuators(of: &DiagnosticInputs<'_>) -> Option<(Level, String, Vec<KeyValue>)> {
    let (mut values, mut warnings) = (Vec::new(), Vec::new());
    for (&channel, joint) in &of.view.joints {
        let Some(readings) = joint.readings else { continue };
        let name = of.channel(channel);
        values.push(entry(&name, reading_words(&readings)));
        if let Some(limits) = of.actuators().limits(channel) {
            let all = ReadingWarning::all(&readings, limits).into_iter();
            warnings
                .extend(all.map(|warning| format!("{name}: {}", warning.words(&readings, limits))));
        }
    }
    if values.is_empty() {
        return None;
    }
    Some(match warnings.is_empty() {
        true => (Level::Ok, "no warning".to_owned(), values),
        false => (Level::Warn, warnings.join("; "), values),
    })
}

fn header(stamp: Time) -> Header {
    Header { stamp, frame_id: String::new() }
}

fn entry(key: &str, value: String) -> KeyValue {
    KeyValue { key: key.to_owned(), value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_host::actuators::ChannelActuator;
    use rollwalk_host::operator::Operator;
    use rollwalk_protocol::actuator::ActuatorStatus;
    use rollwalk_protocol::faults::{Fault, FaultBits};
    use rollwalk_protocol::wire::{ActuatorReadings, Node};

    fn node() -> Node {
        Node::new(1).unwrap()
    }

    fn view(state: State, faults: FaultBits, severity: Severity) -> View {
        operator(state, faults, severity).view(2_000)
    }

    fn operator(state: State, faults: FaultBits, severity: Severity) -> Operator {
        let mut operator = Operator::new(node(), None);
        let status =
            Status { state, severity, faults, clip: Some(1), frame: 0, counter: 0, library: 0 };
        operator.on_frame(1_000, &status.encode(node()));
        operator
    }

    fn catalog() -> Catalog {
        let motion = |name: &str, code| rollwalk_host::catalog::CatalogMotion {
            name: name.into(),
            code,
            frames: 60,
            looping: false,
        };
        let mut catalog = Catalog::of_robot("pup", 7, vec!["hip".into(), "wheel".into()]);
        catalog.motions =
            vec![motion("stand", Some(1)), motion("walk", Some(2)), motion("x", None)];
        catalog.actuators.channels =
            vec![ChannelActuator { bus: 0, id: 1, model: "XL330-M288-T".into() }];
        catalog
    }

    fn find<'a>(of: &'a DiagnosticStatus, key: &str) -> &'a str {
        &of.values.iter().find(|value| value.key == key).unwrap().value
    }

    #[test]
    fn a_round_of_telemetry_becomes_a_joint_state_with_the_names_of_the_urdf() {
        let joint = |channel, position_rad, velocity_rad_s, torque_nm| JointTelemetry {
            channel,
            position_rad,
            velocity_rad_s,
            torque_nm,
            status: ActuatorStatus(0),
        };
        let round = [joint(0, 0.5, -0.25, 1.5), joint(1, -3.0, 4.0, -0.5)];
        let stamp = Time::new(12, 34);
        let names = ["hip".to_owned(), "wheel_axle".to_owned()];
        let message = joint_state(stamp, names.iter().zip(&round));
        assert_eq!(message.header, Header { stamp, frame_id: String::new() });
        assert_eq!(message.name, ["hip", "wheel_axle"]);
        assert_eq!(message.position, [0.5, -3.0]);
        assert_eq!(message.velocity, [-0.25, 4.0]);
        assert_eq!(message.effort, [1.5, -0.5]);
    }

    #[test]
    fn states_and_motions_have_names() {
        let (none, catalog) = (FaultBits::default(), catalog());
        let playing = view(State::Playing, none, Severity::None);
        assert_eq!(state(&playing), "Playing");
        assert_eq!(motion(&playing, Some(&catalog)), "walk");
        assert_eq!(motion(&playing, None), "clip 1");
        let later = operator(State::Playing, none, Severity::None).view(2_000_000);
        assert_eq!((state(&later), motion(&later, Some(&catalog))), ("Unknown".into(), "".into()));
        let off = view(State::Disarmed, none, Severity::None);
        assert_eq!(motion(&off, Some(&catalog)), "");
        assert_eq!(motions(Some(&catalog)), "stand\nwalk");
        assert_eq!(state(&Operator::new(node(), None).view(0)), "Unknown");
    }

    #[test]
    fn diagnostics_say_how_bad_it_is_and_why() {
        let catalog = catalog();
        let of = |view: &View| {
            let of =
                DiagnosticInputs { view, bus: "sim", node: "rollwalk", catalog: Some(&catalog) };
            diagnostics(Time::ZERO, &of).status
        };
        let (none, tilt) = (FaultBits::default(), FaultBits::default().with(Fault::Tilt));
        let off = none.with(Fault::BusOff);
        for (state, faults, severity, level, message) in [
            (State::Playing, none, Severity::None, Level::Ok, "playing"),
            (State::Playing, tilt, Severity::Notice, Level::Warn, "playing: the body is tilted"),
            (
                State::Returning,
                tilt,
                Severity::Return,
                Level::Error,
                "returning to SAFE: the body is tilted",
            ),
            (State::EStopped, none, Severity::EStop, Level::Error, "stopped"),
            (
                State::EStopped,
                off,
                Severity::EStop,
                Level::Error,
                "stopped: an actuator bus is lost",
            ),
        ] {
            let status = of(&view(state, faults, severity));
            assert_eq!(status[0].level, level, "{:?}", status[0]);
            assert!(status[0].message.starts_with(message), "{:?}", status[0]);
            assert_eq!(status[0].name, "rollwalk: controller");
            assert_eq!(status[0].hardware_id, "pup, node 1");
            assert_eq!(find(&status[0], "state"), format!("{state:?}"));
            assert_eq!(status[1].level, Level::Ok, "{:?}", status[1]);
            assert_eq!(find(&status[1], "bus"), "sim");
        }
        // Servos report readings and have limits.
        let mut warm = operator(State::Playing, none, Severity::None);
        let joint = JointTelemetry {
            channel: 0,
            position_rad: 0.0,
            velocity_rad_s: 0.0,
            torque_nm: 0.0,
            status: ActuatorStatus(0),
        };
        warm.on_frame(1_000, &joint.encode(node()));
        assert_eq!(of(&warm.view(2_000)).len(), 2);
        for (temperature_c, level, message) in [
            (40.0, Level::Ok, "no warning"),
            (66.0, Level::Warn, "hip: 66 °C; its torque goes off at 70 °C"),
        ] {
            let (temperature_c, voltage_v) = (Some(temperature_c), Some(5.0));
            let readings = ActuatorReadings { channel: 0, temperature_c, voltage_v };
            warm.on_frame(1_000, &readings.encode(node()));
            let status = &of(&warm.view(2_000))[2];
            assert_eq!((status.level, &*status.message), (level, message));
            assert_eq!(find(status, "hip"), reading_words(&readings));
        }
        let mut lost = Operator::new(node(), None);
        lost.on_bus_lost(0, "can0 is down");
        let status = of(&lost.view(0));
        assert_eq!((status[0].level, status[1].level), (Level::Stale, Level::Error));
        assert_eq!(status[1].message, "the bus is lost: can0 is down");
        // The present state and its remedy are unknown.
        let (none, severity) = (FaultBits::default(), Severity::None);
        let status = of(&operator(State::Playing, none, severity).view(2_000_000));
        assert_eq!(status[0].level, Level::Stale);
        let known = |key: &str| status[0].values.iter().any(|value| value.key == key);
        assert_eq!(["state", "motion", "next"].map(known), [true, false, false]);
    }
}
