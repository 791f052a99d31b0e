//! Latest reports of the controller: status, fault reports, joints, and the quality of the link.

use super::log::{Log, Weight};
use super::view::{FaultView, JointView, LinkView};
use crate::actuators::{Actuators, BusKind, fault_names_on, fault_words};
use crate::client::Client;
use crate::describe::{LEFT_ALONE, condition, state_words};
use rollwalk_protocol::faults::{Fault, FaultBits};
use rollwalk_protocol::wire::{
    ActuatorReadings, FaultReport, JointTelemetry, State, Status, Torque,
};
use std::collections::BTreeMap;

/// Age of the latest STATUS at which contact is lost, µs.
const CONTACT_US: u64 = 500_000;
/// Time in which the 4-bit counter of STATUS wraps, µs. After a longer gap, losses cannot be counted.
const COUNTED_US: u64 = 16 * 45_000;
/// Time for which a fault that refused ARM but is not latched is shown, µs.
const SHOWN_US: u64 = 5_000_000;

/// Age from which temperature and voltage are not shown, µs. A controller sends those of 24 actuators in 2.4 s.
const READINGS_US: u64 = 5_000_000;

/// Latest reports of the controller.
#[derive(Clone, Debug, Default)]
pub struct LinkStatus {
    /// Latest status, and its time of arrival, µs.
    status: Option<(u64, Status)>,
    /// True if contact was last reported to the operator, false if its loss was; `None` before the first contact.
    contact: Option<bool>,
    reports: BTreeMap<u8, (u64, FaultReport)>,
    joints: BTreeMap<u8, (u64, JointTelemetry)>,
    readings: BTreeMap<u8, (u64, ActuatorReadings)>,
    actuators: Actuators,
    received: u64,
    lost: u64,
}

impl LinkStatus {
    /// Latest status.
    pub fn status(&self) -> Option<Status> {
        self.status.map(|(_, status)| status)
    }

    /// Sets the actuators of the robot.
    pub fn set_actuators(&mut self, actuators: Actuators) {
        self.actuators = actuators;
    }

    /// Kind of the actuator bus that a latched fault concerns, or otherwise the common kind of all buses.
    pub fn bus_kind(&self) -> Option<BusKind> {
        let first = self.status().and_then(|status| status.faults.first());
        let report = first.and_then(|fault| self.reports.get(&fault.code())).map(|(_, of)| of);
        match report {
            Some(of) => self.actuators.kind_for(of.fault, of.channel, Some(of.value)),
            None => self.actuators.kind(),
        }
    }

    /// Description of the latest status, to follow "the robot is".
    pub fn condition(&self) -> Option<String> {
        self.status().map(|status| condition(&status, &self.actuators))
    }

    /// State according to the latest status.
    pub fn state(&self) -> Option<State> {
        self.status().map(|status| status.state)
    }

    /// True if the latest status is recent.
    pub fn in_contact(&self, now_us: u64) -> bool {
        self.status.is_some_and(|(at_us, _)| now_us.saturating_sub(at_us) < CONTACT_US)
    }

    /// Processes a status, and reports changes to the operator.
    pub fn on_status(&mut self, now_us: u64, status: Status, log: &mut Log) {
        let before = self.status.replace((now_us, status));
        self.received += 1;
        if let Some((at_us, last)) = before
            && now_us.saturating_sub(at_us) < COUNTED_US
        {
            self.lost += u64::from(status.counter.wrapping_sub(last.counter + 1) & 0xF);
        }
        if self.contact != Some(true) {
            let text = if self.contact.is_some() { "contact again" } else { "contact" };
            log.notify(
                now_us,
                Weight::Note,
                format!("{text}: the robot is {}", condition(&status, &self.actuators)),
            );
        } else if before.is_some_and(|(_, last)| last.state != status.state) {
            let weight = match status.state {
                State::Damped | State::TorqueOff | State::EStopped => Weight::Warning,
                _ => Weight::Note,
            };
            // The causing fault follows as a separate message.
            let words = state_words(&status, &self.actuators);
            log.notify(now_us, weight, format!("the robot is {words}"));
        }
        self.contact = Some(true);
        let old = before.map_or(FaultBits::default(), |(_, last)| last.faults);
        let new = FaultBits(status.faults.0 & !old.0);
        let gone = FaultBits(old.0 & !status.faults.0);
        if !new.is_empty() {
            let names = fault_names_on(new, &self.actuators);
            log.notify(now_us, Weight::Warning, format!("fault: {names}"));
        }
        if !gone.is_empty() {
            let names = fault_names_on(gone, &self.actuators);
            log.notify(now_us, Weight::Note, format!("fault cleared: {names}"));
            self.reports.retain(|&code, _| gone.iter().all(|fault| fault.code() != code));
        }
    }

    /// Applies the state of an acknowledged emergency stop, which is newer than the latest status.
    pub fn on_stopped(&mut self, state: State) {
        if let Some((_, status)) = &mut self.status {
            status.state = state;
        }
    }

    /// Processes a fault report.
    pub fn on_fault(&mut self, now_us: u64, report: FaultReport, log: &mut Log) {
        let known = self.reports.insert(report.fault.code(), (now_us, report));
        let latched = self.status().is_some_and(|status| status.faults.contains(report.fault));
        let recent = known.is_some_and(|(at_us, _)| now_us.saturating_sub(at_us) < SHOWN_US);
        if !latched && !recent {
            let kind = self.actuators.kind_for(report.fault, report.channel, Some(report.value));
            let name = fault_words(report.fault, kind).name;
            log.notify(now_us, Weight::Warning, format!("fault report: {name}"));
        }
    }

    /// Processes the telemetry of a joint or wheel.
    pub fn on_joint(&mut self, now_us: u64, joint: JointTelemetry) {
        self.joints.insert(joint.channel, (now_us, joint));
    }

    /// Processes temperature and supply voltage of an actuator.
    pub fn on_readings(&mut self, now_us: u64, readings: ActuatorReadings) {
        self.readings.insert(readings.channel, (now_us, readings));
    }

    /// Records the loss of contact after a loss of the bus, which was reported already.
    pub fn lose_contact(&mut self) {
        self.contact = self.contact.map(|_| false);
    }

    /// Reports a loss of contact; returns true if contact was lost since the previous call.
    ///
    /// `way_out` is the action by which a person can stop a robot with torque; `None` if no person watches it.
    pub fn watch(&mut self, now_us: u64, way_out: Option<&str>, log: &mut Log) -> bool {
        if self.contact == Some(true) && !self.in_contact(now_us) {
            self.contact = Some(false);
            let mut text = "no contact: no frame arrived for 0.5 s".to_owned();
            let has_torque = self.state().is_some_and(|state| state.torque() != Torque::Off);
            if let Some(way_out) = way_out.filter(|_| has_torque) {
                text += &format!(
                    "; press the robot's own emergency stop if it moves, or {way_out}: {LEFT_ALONE}"
                );
            }
            log.notify(now_us, Weight::Warning, text);
            return true;
        }
        false
    }

    /// Faults that are present or have recently refused ARM.
    pub fn faults(&self, now_us: u64) -> Vec<FaultView> {
        let latched = self.status().map_or(FaultBits::default(), |status| status.faults);
        let view = |&fault: &Fault| {
            let report = self.reports.get(&fault.code()).filter(|(at_us, _)| {
                latched.contains(fault) || now_us.saturating_sub(*at_us) < SHOWN_US
            });
            let present = latched.contains(fault);
            (present || report.is_some()).then(|| FaultView {
                fault,
                present,
                channel: report.and_then(|(_, report)| report.channel),
                value: report.map(|(_, report)| report.value),
            })
        };
        Fault::ALL.iter().filter_map(view).collect()
    }

    /// Joints and wheels by channel.
    pub fn joints(&self, now_us: u64) -> BTreeMap<u8, JointView> {
        let view = |(&channel, &(at_us, telemetry)): (&u8, &(u64, JointTelemetry))| {
            let age_us = now_us.saturating_sub(at_us);
            let readings = self
                .readings
                .get(&channel)
                .filter(|(at_us, _)| now_us.saturating_sub(*at_us) < READINGS_US);
            (channel, JointView { telemetry, age_us, readings: readings.map(|(_, of)| *of) })
        };
        self.joints.iter().map(view).collect()
    }

    /// Quality of the link.
    pub fn link(&self, now_us: u64, client: &Client) -> LinkView {
        LinkView {
            contact: self.in_contact(now_us),
            round_trip_us: client.round_trip_us(),
            status_age_us: self.status.map(|(at_us, _)| now_us.saturating_sub(at_us)),
            received: self.received,
            lost: self.lost,
        }
    }
}
