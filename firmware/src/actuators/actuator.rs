//! State of an actuator: its feedback, merged from frames, and its pending requests.

use rollwalk_protocol::actuator::{ActuatorStatus, Feedback};
use rollwalk_protocol::actuators::{self, Command, Faults, Gains};

use super::orders::PendingRequests;

/// Age up to which feedback counts as fresh, ticks. The answer to a query arrives in the next tick, or one tick later if the
/// bus is busy.
pub const FRESH_TICKS: u16 = 2;

/// Slow measurements of an actuator.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Readings {
    /// Temperature, °C; `None` if it was never reported.
    pub temperature_c: Option<f32>,
    /// Supply voltage, V; `None` if it was never reported.
    pub voltage_v: Option<f32>,
}

/// Torque command sent most recently.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum TorqueCommand {
    #[default]
    Never,
    Off,
    On,
}

/// An actuator.
#[derive(Clone, Debug, Default)]
pub struct Actuator {
    reported: Feedback,
    pub readings: Readings,
    has_reported_pose: bool,
    has_reported_state: bool,
    /// True if a fault was reported in this control period. Further faults are then added, so a later frame without them does
    /// not clear them.
    faults_are_new: bool,
    /// Ticks since the latest new pose.
    pub silent_ticks: u16,
    /// True if a query is still unanswered.
    asked: bool,
    /// True if a query was sent while the previous one was unanswered; cleared by [`Self::take_unanswered`].
    unanswered: bool,
    /// True if the actuator has confirmed the most recent torque-off command.
    pub known_off: bool,
    switched: TorqueCommand,
    switched_ticks: u16,
    /// Latest gains sent to a drive that stores them; `None` until the first set-point after torque on.
    pub gains: Option<Gains>,
    /// Latest torque limit sent to a drive that stores it; `None` until the first set-point after torque on.
    pub torque_limit_nm: Option<f32>,
    pub pending: PendingRequests,
    pub setpoint: Option<Command>,
}

impl Actuator {
    /// Latest feedback; `None` before its pose and state are known.
    pub fn feedback(&self) -> Option<Feedback> {
        self.is_known().then_some(self.reported)
    }

    /// True if pose and state are known.
    pub fn is_known(&self) -> bool {
        self.has_reported_pose && self.has_reported_state
    }

    /// True if the actuator has reported that its torque is on.
    pub fn enabled(&self) -> bool {
        self.is_known() && self.reported.status.enabled()
    }

    /// True if the actuator reports a fault, even if its pose is unknown.
    pub fn faulty(&self) -> bool {
        self.reported.status.faulty()
    }

    /// Accepts feedback of the Rollwalk profile, which is complete and counted.
    ///
    /// A frame with a repeated counter is a repetition and does not reset the silence.
    pub fn on_counted_feedback(&mut self, feedback: Feedback) {
        if self.feedback().is_none_or(|last| last.counter != feedback.counter) {
            self.silent_ticks = 0;
            // Only the latest report counts: an earlier "off" may have been sent before the actuator received "on".
            self.known_off = !feedback.status.enabled();
            self.reported = feedback;
            (self.has_reported_pose, self.has_reported_state) = (true, true);
        }
    }

    /// Accepts feedback of another protocol, which is partial and not counted.
    ///
    /// Every frame counts as new. Only a frame with the pose resets the silence.
    pub fn on_feedback(&mut self, news: &actuators::Feedback, reports_enabled: bool) {
        let reported = &mut self.reported;
        if let Some(position_rad) = news.position_rad {
            reported.position_rad = position_rad;
            reported.counter = reported.counter.wrapping_add(1);
            self.has_reported_pose = true;
            self.silent_ticks = 0;
            self.asked = false;
        }
        reported.velocity_rad_s = news.speed_rad_s.unwrap_or(reported.velocity_rad_s);
        reported.torque_nm = news.torque_nm.unwrap_or(reported.torque_nm);
        self.readings.temperature_c = news.temperature_c.or(self.readings.temperature_c);
        self.readings.voltage_v = news.voltage_v.or(self.readings.voltage_v);
        if let Some(faults) = news.faults {
            let before = if self.faults_are_new { reported.status.0 } else { 0 };
            let enabled = reported.status.0 & ActuatorStatus::ENABLED;
            reported.status.0 = enabled | before & ActuatorStatus::FAULTS | status_of(faults);
            self.faults_are_new = true;
        }
        // If an actuator does not report its state, an answer since the last switch counts as confirmation.
        let (enabled, off) = match self.switched {
            _ if reports_enabled => (news.enabled, news.enabled.map(|on| !on)),
            switched => (Some(switched == TorqueCommand::On), Some(switched == TorqueCommand::Off)),
        };
        if let (Some(enabled), Some(off)) = (enabled, off) {
            let bit = if enabled { ActuatorStatus::ENABLED } else { 0 };
            reported.status.0 = reported.status.0 & !ActuatorStatus::ENABLED | bit;
            self.has_reported_state = true;
            self.known_off = off;
        }
    }

    /// Accepts an answer from the adapter of the actuator's line, which contains no pose.
    pub fn on_adapter_answer(&mut self, news: &actuators::Feedback) {
        self.silent_ticks = 0;
        self.asked = false;
        self.on_feedback(news, false);
    }

    /// Sets an assumed position, for actuators that do not measure their position.
    pub fn assume(&mut self, position_rad: f32) {
        self.reported.position_rad = position_rad;
        self.has_reported_pose = true;
    }

    /// Records that the final frame of a torque-off command was sent.
    pub fn switched_off(&mut self) {
        self.switched = TorqueCommand::Off;
    }

    /// Records that the final frame of a torque-on command was sent.
    pub fn switched_on(&mut self) {
        (self.switched, self.switched_ticks) = (TorqueCommand::On, 0);
    }

    /// True if the torque-on command was sent less than `patience_ticks` ago, so that a missing confirmation is not an error
    /// yet.
    pub fn waits_for_enable(&self, patience_ticks: u16) -> bool {
        self.switched == TorqueCommand::On && self.switched_ticks < patience_ticks
    }

    /// Records a query, and a missed answer if the previous query is unanswered. Call it for each query.
    pub fn record_query(&mut self) {
        self.unanswered |= self.asked && self.is_known();
        self.asked = true;
    }

    /// Returns true if an answer was missed since the previous call.
    pub fn take_unanswered(&mut self) -> bool {
        core::mem::take(&mut self.unanswered)
    }

    /// Advances by a control period.
    pub fn age(&mut self) {
        self.silent_ticks = self.silent_ticks.saturating_add(1);
        self.switched_ticks = self.switched_ticks.saturating_add(1);
        self.faults_are_new = false;
    }
}

/// Status bits for faults that a drive reports.
fn status_of(faults: Faults) -> u8 {
    let bit = |fault, bit| if faults.contains(fault) { bit } else { 0 };
    let named = Faults(Faults::TIMED_OUT.0 | Faults::OVERHEATED.0 | Faults::BAD_VOLTAGE.0);
    let others = if faults.0 & !named.0 != 0 { ActuatorStatus::HARDWARE } else { 0 };
    bit(Faults::TIMED_OUT, ActuatorStatus::TIMED_OUT)
        | bit(Faults::OVERHEATED, ActuatorStatus::OVERHEATED)
        | bit(Faults::BAD_VOLTAGE, ActuatorStatus::BAD_VOLTAGE)
        | others
}
