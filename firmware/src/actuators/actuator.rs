//! State of an actuator: its feedback, merged from frames, and its pending requests.

use rollwalk_protocol::actuator::{ActuatorStatus, Feedback};
use rollwalk_protocol::actuators::{self, Command, Faults, Gains};

use super::orders::PendingRequests;

/// Age up to which feedback counts as fresh, ticks. The answer to a query arrives in the next tick, or in the one after when the
/// bus is busy.
pub const FRESH_TICKS: u16 = 2;

/// The torque switch that was sent last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Switched {
    #[default]
    Never,
    Off,
    On,
}

/// An actuator.
#[derive(Clone, Debug, Default)]
pub struct Actuator {
    reported: Feedback,
    has_reported_pose: bool,
    has_reported_state: bool,
    /// Faults in this control period add up: a later frame without them does not take them back.
    faults_are_new: bool,
    /// Ticks since the last new pose.
    pub silent_ticks: u16,
    /// True if a query is still unanswered.
    asked: bool,
    /// True if a query was sent before the last one was answered, since [`Self::take_unanswered`].
    unanswered: bool,
    /// True if torque off was sent, and the last feedback since then confirms it.
    pub known_off: bool,
    switched: Switched,
    switched_ticks: u16,
    /// Gains that the drive keeps, where they differ from the configuration.
    pub gains: Option<Gains>,
    /// The torque limit sent since it was enabled, where the drive stores one.
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

    /// Takes feedback of the Rollwalk profile, which is complete and counted. A repeated counter is a
    /// repeated frame: not a sign of life.
    pub fn on_counted_feedback(&mut self, feedback: Feedback) {
        if self.feedback().is_none_or(|last| last.counter != feedback.counter) {
            self.silent_ticks = 0;
            // It may have sent "off" before it received "on", and report otherwise now.
            self.known_off = !feedback.status.enabled();
            self.reported = feedback;
            (self.has_reported_pose, self.has_reported_state) = (true, true);
        }
    }

    /// Takes feedback of another protocol, which is partial and not counted: every frame is new. Only the
    /// pose is a sign of life.
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
        if let Some(faults) = news.faults {
            let before = if self.faults_are_new { reported.status.0 } else { 0 };
            let enabled = reported.status.0 & ActuatorStatus::ENABLED;
            reported.status.0 = enabled | before & ActuatorStatus::FAULTS | status_of(faults);
            self.faults_are_new = true;
        }
        // Of an actuator that does not report it, an answer since the last switch counts as confirmation.
        let (enabled, off) = match self.switched {
            _ if reports_enabled => (news.enabled, news.enabled.map(|on| !on)),
            switched => (Some(switched == Switched::On), Some(switched == Switched::Off)),
        };
        if let (Some(enabled), Some(off)) = (enabled, off) {
            let bit = if enabled { ActuatorStatus::ENABLED } else { 0 };
            reported.status.0 = reported.status.0 & !ActuatorStatus::ENABLED | bit;
            self.has_reported_state = true;
            self.known_off = off;
        }
    }

    /// Takes an answer of the adapter on the actuator's line, which has no pose.
    pub fn on_adapter_answer(&mut self, news: &actuators::Feedback) {
        self.silent_ticks = 0;
        self.asked = false;
        self.on_feedback(news, false);
    }

    /// Assumes a position, for actuators that do not measure theirs.
    pub fn assume(&mut self, position_rad: f32) {
        self.reported.position_rad = position_rad;
        self.has_reported_pose = true;
    }

    /// Records that the last frame of "off" was sent.
    pub fn switched_off(&mut self) {
        self.switched = Switched::Off;
    }

    /// Records that the last frame of "on" was sent.
    pub fn switched_on(&mut self) {
        (self.switched, self.switched_ticks) = (Switched::On, 0);
    }

    /// True if enabling was sent less than `patience_ticks` ago and may not be confirmed yet.
    pub fn waits_for_enable(&self, patience_ticks: u16) -> bool {
        self.switched == Switched::On && self.switched_ticks < patience_ticks
    }

    /// Call at each request: records a missed answer if the request before was not answered.
    pub fn note_request(&mut self) {
        self.unanswered |= self.asked && self.is_known();
        self.asked = true;
    }

    /// True if an answer has been missed since the last call.
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

/// Status bits of the faults.
fn status_of(faults: Faults) -> u8 {
    let bit = |fault, bit| if faults.contains(fault) { bit } else { 0 };
    let named = Faults(Faults::TIMED_OUT.0 | Faults::OVERHEATED.0 | Faults::BAD_VOLTAGE.0);
    let others = if faults.0 & !named.0 != 0 { ActuatorStatus::HARDWARE } else { 0 };
    bit(Faults::TIMED_OUT, ActuatorStatus::TIMED_OUT)
        | bit(Faults::OVERHEATED, ActuatorStatus::OVERHEATED)
        | bit(Faults::BAD_VOLTAGE, ActuatorStatus::BAD_VOLTAGE)
        | others
}
