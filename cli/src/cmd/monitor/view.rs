//! Text output of a monitor: changes, and the joints.

use rollwalk_host::actuators::{
    Actuators, ReadingWarning, conditions, fault_names_on, new_faults, reading_words,
};
use rollwalk_host::catalog::{Catalog, channel_name};
use rollwalk_host::describe::{fault_report_on, state_words};
use rollwalk_host::refusal::command_refusal;
use rollwalk_protocol::actuator::ActuatorStatus;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::faults::{Fault, FaultBits};
use rollwalk_protocol::wire::{
    Action, ActuatorReadings, CommandResult, FaultReport, FromController, JointTelemetry, Node,
    State, Status, ToController,
};
use rollwalk_terminal::output;
use std::collections::BTreeMap;

/// Interval between printed lines of the joints, µs.
const JOINTS_PERIOD_US: u64 = 1_000_000;

/// Time without an emergency stop after which the next one is printed, µs. Hosts send several until one is acknowledged.
const STOPS_US: u64 = 1_000_000;

/// Text output that prints changes.
pub struct View<'a> {
    catalog: Option<&'a Catalog>,
    joints: bool,
    quiet: bool,
    /// Start of the monitor, µs since 1970 like all times here.
    start_us: u64,
    state: Option<State>,
    faults: FaultBits,
    /// Faults whose reports were printed, with their channels. Controllers repeat reports once a second.
    reported: Vec<(Fault, Option<u8>)>,
    /// Times of the latest emergency stop and of its latest acknowledgement; `None` before.
    stops_us: [Option<u64>; 2],
    clip: Option<u8>,
    /// Sequence number of the unanswered command, and the command.
    asked: Option<(u8, Action)>,
    measured: BTreeMap<u8, JointTelemetry>,
    readings: BTreeMap<u8, ActuatorReadings>,
    shown_us: u64,
    actuators: Actuators,
}

impl<'a> View<'a> {
    /// Creates a view before the first frame; with `quiet` it prints nothing.
    pub fn new(catalog: Option<&'a Catalog>, joints: bool, quiet: bool, start_us: u64) -> Self {
        Self {
            catalog,
            joints,
            quiet,
            start_us,
            state: None,
            faults: FaultBits::default(),
            reported: Vec::new(),
            stops_us: [None; 2],
            clip: None,
            asked: None,
            measured: BTreeMap::new(),
            readings: BTreeMap::new(),
            shown_us: start_us,
            actuators: catalog.map_or_else(Actuators::default, |of| of.actuators.clone()),
        }
    }

    /// Processes a frame and prints changes.
    ///
    /// # Errors
    /// Returns an error if standard output is closed.
    pub fn take(&mut self, at_us: u64, node: u8, frame: &Frame) -> miette::Result<()> {
        if self.quiet {
            return Ok(());
        }
        if let Ok((to, message)) = ToController::decode(frame)
            && (to.number() == node || to == Node::BROADCAST)
        {
            match message {
                ToController::Estop => self.stop(at_us, 0, "EMERGENCY STOP is sent")?,
                // The command is printed together with its answer.
                ToController::Command(command) => {
                    self.asked = Some((command.seq, command.action));
                }
                _ => {}
            }
            return Ok(());
        }
        let Ok((from, message)) = FromController::decode(frame) else { return Ok(()) };
        if from.number() != node {
            return Ok(());
        }
        match message {
            FromController::Status(status) => self.status(at_us, &status),
            FromController::FaultReport(report) => self.fault(at_us, &report),
            FromController::EstopAck(_) => {
                self.stop(at_us, 1, "the emergency stop is acknowledged")
            }
            FromController::CommandAck(ack) => {
                let asked = self.asked.take().filter(|(seq, _)| *seq == ack.seq);
                match asked {
                    Some((_, action)) => self.command(at_us, action, ack.result),
                    None => Ok(()),
                }
            }
            FromController::JointTelemetry(joint) => {
                self.conditions(at_us, joint)?;
                self.measured.insert(joint.channel, joint);
                self.show_joints(at_us)
            }
            FromController::Readings(readings) => {
                let words = self.new_warnings(readings);
                self.readings.insert(readings.channel, readings);
                self.warn(at_us, readings.channel, &words)
            }
            _ => Ok(()),
        }
    }

    fn print_event(&self, at_us: u64, what: &str) -> miette::Result<()> {
        let seconds = at_us.saturating_sub(self.start_us) as f64 * 1e-6;
        output::line(&format!("{seconds:9.3} s  {what}"))
    }

    fn status(&mut self, at_us: u64, status: &Status) -> miette::Result<()> {
        let clip = status.clip.filter(|_| status.state != State::Disarmed);
        let is_new = self.state.replace(status.state) != Some(status.state);
        let is_other = std::mem::replace(&mut self.clip, clip) != clip;
        if is_new || is_other && clip.is_some() {
            let clip = clip.map_or_else(String::new, |clip| format!(": {}", self.clip_name(clip)));
            // Other faults are printed on their own line.
            let state = state_words(status, &self.actuators);
            self.print_event(at_us, &format!("{state}{clip}"))?;
        }
        let is_over = |fault: Fault| !status.faults.iter().any(|latched| latched == fault);
        self.reported.retain(|(fault, _)| !is_over(*fault));
        if std::mem::replace(&mut self.faults, status.faults) != status.faults {
            self.print_event(
                at_us,
                &format!("faults: {}", fault_names_on(status.faults, &self.actuators)),
            )?;
        }
        Ok(())
    }

    /// Prints a stop or its acknowledgement, unless it repeats an earlier one.
    fn stop(&mut self, at_us: u64, which: usize, what: &str) -> miette::Result<()> {
        let before_us = self.stops_us[which].replace(at_us);
        match before_us.is_some_and(|before_us| at_us.saturating_sub(before_us) < STOPS_US) {
            true => Ok(()),
            false => self.print_event(at_us, what),
        }
    }

    /// Prints a report that is not a repetition.
    fn fault(&mut self, at_us: u64, report: &FaultReport) -> miette::Result<()> {
        if self.repeats(report) {
            return Ok(());
        }
        let channel = report.channel.map(|channel| self.channel_name(channel));
        let FaultReport { fault, channel: number, value, .. } = *report;
        let described = fault_report_on(fault, number, channel, Some(value), &self.actuators);
        // The line of all faults has the name already.
        let is_named = self.faults.iter().any(|latched| latched == fault);
        let name = fault_names_on(FaultBits::default().with(fault), &self.actuators);
        if is_named && described == name {
            return Ok(());
        }
        self.print_event(at_us, &format!("fault: {described}"))
    }

    /// True if a report of this fault and channel was printed since the fault arose.
    fn repeats(&mut self, report: &FaultReport) -> bool {
        let of_report = (report.fault, report.channel);
        let repeats = self.reported.contains(&of_report);
        if !repeats {
            self.reported.push(of_report);
        }
        repeats
    }

    /// Prints a warning when an actuator becomes too hot, has a wrong supply voltage, or fails otherwise.
    fn conditions(&self, at_us: u64, joint: JointTelemetry) -> miette::Result<()> {
        let before = self.measured.get(&joint.channel).map(|before| before.status);
        let words = new_faults(before, joint.status, self.actuators.limits(joint.channel));
        self.warn(at_us, joint.channel, &words)
    }

    /// Warnings about temperature and supply voltage that do not follow from the previous readings.
    fn new_warnings(&self, readings: ActuatorReadings) -> Vec<String> {
        let Some(limits) = self.actuators.limits(readings.channel) else { return Vec::new() };
        let before = self.readings.get(&readings.channel);
        let known = before.map_or_else(Vec::new, |before| ReadingWarning::all(before, limits));
        let all = ReadingWarning::all(&readings, limits).into_iter();
        let new = all.filter(|warning| !known.contains(warning));
        new.map(|warning| warning.words(&readings, limits)).collect()
    }

    fn warn(&self, at_us: u64, channel: u8, words: &[String]) -> miette::Result<()> {
        if words.is_empty() {
            return Ok(());
        }
        let name = self.channel_name(channel);
        self.print_event(at_us, &format!("warning: {name}: {}", words.join(", ")))
    }

    fn command(&self, at_us: u64, action: Action, result: CommandResult) -> miette::Result<()> {
        let what = match action {
            Action::Play { code, speed_64ths } | Action::PlayAt { code, speed_64ths, .. } => {
                let motions = self.catalog.into_iter().flat_map(|catalog| &catalog.motions);
                let name = motions.filter(|motion| motion.code == Some(code)).map(|m| &m.name);
                let name = name.map(|name| format!(" ({name})")).next().unwrap_or_default();
                match speed_64ths {
                    64 => format!("play {code}{name}"),
                    _ => {
                        let percent = f64::from(speed_64ths) / 0.64;
                        format!("play {code}{name} at {percent:.0} % of its speed")
                    }
                }
            }
            Action::Pause => "pause".into(),
            Action::Resume => "resume".into(),
            Action::Return => "return".into(),
            Action::Disarm => "disarm".into(),
            Action::ArmRequest => "arm".into(),
            Action::ArmConfirm { .. } => "arm, confirmed".into(),
            Action::ClearRequest => "clear".into(),
            Action::ClearConfirm { .. } => "clear, confirmed".into(),
            Action::Stream => "follow streamed setpoints".into(),
            Action::Track { rate_hz, .. } => {
                format!("follow setpoints in closed loop at {rate_hz} samples/s")
            }
            Action::Unknown { kind, .. } => format!("of unknown kind {kind}"),
        };
        match result {
            // A new host continues the count of the previous host: it sends the command again with the next number.
            CommandResult::OutOfOrder => Ok(()),
            CommandResult::Ok => self.print_event(at_us, &format!("command: {what}")),
            _ => self.print_event(
                at_us,
                &format!("command: {what}: refused, {}", command_refusal(result)),
            ),
        }
    }

    fn show_joints(&mut self, at_us: u64) -> miette::Result<()> {
        if !self.joints || at_us.saturating_sub(self.shown_us) < JOINTS_PERIOD_US {
            return Ok(());
        }
        self.shown_us = at_us;
        let mut table = output::Table::new(["", "rad", "rad/s", "N·m", "readings", "condition"]);
        for (&channel, joint) in &self.measured {
            table.row([
                self.channel_name(channel),
                format!("{:.3}", joint.position_rad),
                format!("{:.2}", joint.velocity_rad_s),
                format!("{:.2}", joint.torque_nm),
                self.readings.get(&channel).map_or_else(String::new, reading_words),
                self.condition(joint).join(", "),
            ]);
        }
        output::line(&table.render())
    }

    /// Conditions of an actuator. A servo that is silent only because an earlier servo on its line does not answer has no such
    /// condition.
    fn condition(&self, joint: &JointTelemetry) -> Vec<String> {
        let is_silent = |channel: u8| {
            self.measured.get(&channel).is_some_and(|joint| joint.status.is_unanswered())
        };
        let limits = self.actuators.limits(joint.channel);
        let ahead = self.actuators.waits_for(joint.channel, is_silent);
        let Some(ahead) = ahead.filter(|_| joint.status.is_unanswered()) else {
            return conditions(joint.status, limits);
        };
        let others = ActuatorStatus(joint.status.0 & !ActuatorStatus::UNANSWERED);
        let mut words = conditions(others, limits);
        words.push(format!("waits for {}", self.channel_name(ahead)));
        words
    }

    fn clip_name(&self, clip: u8) -> String {
        let name = self.catalog.and_then(|catalog| catalog.clip(clip));
        name.unwrap_or_else(|| format!("clip {clip}"))
    }

    fn channel_name(&self, channel: u8) -> String {
        channel_name(self.catalog.map_or(&[], |catalog| &catalog.channels), channel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_host::actuators::{ActuatorBus, BusKind, ChannelActuator};

    #[test]
    fn one_silent_servo_of_a_line_is_blamed() {
        let bus = ActuatorBus {
            kind: BusKind::ServoLine,
            protocol: "Dynamixel".into(),
            bit_rate: 1_000_000,
        };
        let of = |id| ChannelActuator { bus: 0, id, model: "XL330-M288-T".into() };
        let actuators = Actuators { buses: vec![bus], channels: vec![of(1), of(2), of(3)] };
        let names = ["hip", "knee", "ankle"].map(str::to_owned).to_vec();
        let catalog = Catalog::of_robot("pup", 7, names).with_actuators(actuators);
        let mut view = View::new(Some(&catalog), true, false, 0);
        let joint = |channel, bits| JointTelemetry {
            channel,
            position_rad: 0.0,
            velocity_rad_s: 0.0,
            torque_nm: 0.0,
            status: ActuatorStatus(bits),
        };
        for channel in 0..3 {
            let bits = if channel == 0 { 0 } else { ActuatorStatus::UNANSWERED };
            view.measured.insert(channel, joint(channel, bits));
        }
        let words = |channel| view.condition(&view.measured[&channel]).join(", ");
        assert_eq!([words(0), words(1), words(2)], ["", "did not answer", "waits for knee"]);
    }

    /// Controllers repeat the reports of a fault once a second until it is cleared.
    #[test]
    fn a_fault_is_reported_once_until_it_is_cleared() {
        let mut view = View::new(None, false, false, 0);
        let report = |channel| FaultReport {
            counter: 0,
            fault: Fault::ActuatorSilent,
            channel: Some(channel),
            value: 0.5,
        };
        let faults = |of: FaultBits| Status {
            state: State::Damped,
            severity: State::Damped.severity(of),
            faults: of,
            clip: None,
            frame: 0,
            counter: 0,
            library: 0,
        };
        let silent = FaultBits::default().with(Fault::ActuatorSilent);
        let [new, other] = [report(1), report(2)];
        assert_eq!(
            [&new, &new, &other, &new].map(|of| view.repeats(of)),
            [false, true, false, true]
        );
        view.status(0, &faults(silent)).unwrap();
        assert!(view.repeats(&new), "the fault is latched");
        view.status(1, &faults(FaultBits::default())).unwrap();
        assert!(!view.repeats(&new), "the fault was cleared");
    }

    /// A servo that becomes hot is reported once, and again after it has cooled.
    #[test]
    fn a_hot_servo_is_reported_when_it_becomes_hot() {
        let (names, actuators) = (vec!["hip".to_owned()], Actuators::default());
        let of = ChannelActuator { bus: 0, id: 1, model: "XL330-M288-T".into() };
        let actuators = Actuators { channels: vec![of], ..actuators };
        let catalog = Catalog::of_robot("pup", 7, names).with_actuators(actuators);
        let mut view = View::new(Some(&catalog), true, false, 0);
        let told = [40.0, 65.0, 66.0, 50.0, 65.0].map(|temperature_c| {
            let temperature_c = Some(temperature_c);
            let readings = ActuatorReadings { channel: 0, temperature_c, voltage_v: Some(5.0) };
            let words = view.new_warnings(readings);
            view.readings.insert(0, readings);
            words.join(", ")
        });
        let hot = "65 °C; its torque goes off at 70 °C";
        assert_eq!(told, ["", hot, "", "", hot]);
    }
}
