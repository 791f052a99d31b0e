//! Traffic on the link, counted for a diagnosis.

use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::{
    ActuatorReadings, FaultReport, FromController, JointTelemetry, Status,
};
use std::collections::{BTreeMap, BTreeSet};

/// Number of consecutive reports without an answer after which an actuator counts as silent. Two servos with the same ID answer
/// more often.
const SILENT_REPORTS: u32 = 8;

/// Traffic on the link during a time span.
#[derive(Clone, Debug, Default)]
pub struct Traffic {
    /// Number of frames and of bits, by identifier.
    pub by_id: BTreeMap<u16, (u64, u64)>,
    /// Latest status.
    pub status: Option<Status>,
    /// Latest report of each fault, by code.
    pub faults: BTreeMap<u8, FaultReport>,
    /// Addresses of other controllers on the link.
    pub others: BTreeSet<u8>,
    /// Latest telemetry of each channel.
    pub joints: BTreeMap<u8, JointTelemetry>,
    /// Latest temperature and supply voltage of each actuator that reports them, by channel.
    pub readings: BTreeMap<u8, ActuatorReadings>,
    /// Answers of each actuator, by channel.
    pub answers: BTreeMap<u8, Answers>,
    /// Duration of the time span, µs.
    pub span_us: u64,
}

impl Traffic {
    /// Processes a frame of the link with controller `node`.
    pub fn take(&mut self, node: u8, frame: &Frame) {
        let Some(id) = frame.standard_id() else { return };
        let (frames, bits) = self.by_id.entry(id).or_default();
        *frames += 1;
        *bits += u64::from(frame.exact_bits());
        match FromController::decode(frame) {
            Ok((from, message)) if from.number() == node => match message {
                FromController::Status(status) => self.status = Some(status),
                FromController::FaultReport(report) => {
                    self.faults.insert(report.fault.code(), report);
                }
                FromController::JointTelemetry(joint) => {
                    let answers = self.answers.entry(joint.channel).or_default();
                    answers.count(joint.status.is_unanswered());
                    self.joints.insert(joint.channel, joint);
                }
                FromController::Readings(readings) => {
                    self.readings.insert(readings.channel, readings);
                }
                _ => {}
            },
            Ok((from, FromController::Status(_))) => {
                self.others.insert(from.number());
            }
            _ => {}
        }
    }

    /// Bus load, percent.
    pub fn load_percent(&self, bitrate: u32) -> f64 {
        let bits: u64 = self.by_id.values().map(|(_, bits)| bits).sum();
        100.0 * bits as f64 / (f64::from(bitrate) * self.span_us.max(1) as f64 * 1e-6)
    }
}

/// Answers of an actuator, according to its telemetry.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Answers {
    /// Number of reports according to which the actuator did not answer.
    pub missed: u32,
    /// Number of reports.
    pub reports: u32,
    /// Number of consecutive latest reports according to which the actuator did not answer.
    missed_last: u32,
}

impl Answers {
    fn count(&mut self, is_missed: bool) {
        self.reports += 1;
        self.missed += u32::from(is_missed);
        self.missed_last = if is_missed { self.missed_last + 1 } else { 0 };
    }

    /// Fraction of reports without an answer.
    pub fn missed_share(&self) -> f64 {
        f64::from(self.missed) / f64::from(self.reports.max(1))
    }

    /// True if the actuator has stopped answering.
    pub fn is_silent(&self) -> bool {
        self.missed_last >= SILENT_REPORTS
    }
}
