//! Checks of the actuators' feedback: age, plausibility, and lag of the joints.

use rollwalk_protocol::config::ChannelKind;
use rollwalk_protocol::faults::{Event, Fault};

use super::{Motion, QUERY_HZ, Setup, Stage};
use crate::actuators::FRESH_TICKS;
use crate::safety::EventSet;

impl Motion {
    /// Age of feedback beyond which it counts as missing, ticks.
    pub fn patience_ticks(&self, setup: &Setup) -> u16 {
        match self.stage {
            // While torque is off, actuators are queried at a low rate. When enabling starts, the last answer may be one query
            // interval old.
            Stage::Off | Stage::Enabling { .. } => {
                let query_ticks = setup.settings.control_hz / QUERY_HZ;
                query_ticks.saturating_mul(2).saturating_add(FRESH_TICKS)
            }
            _ => setup.settings.silent_ticks,
        }
    }

    /// True if every actuator has sent fresh feedback.
    pub fn actuators_are_fresh(&self, setup: &Setup) -> bool {
        self.actuators.health().fresh_within(self.patience_ticks(setup))
    }

    /// Finds a joint whose measured position is missing or far outside its range.
    pub fn implausible(&self, setup: &Setup) -> Option<usize> {
        let slack = setup.settings.out_of_range_rad;
        setup.config.channels.iter().enumerate().position(|(i, channel)| {
            let measured = self.actuators.measured(&setup.config, i);
            let plausible =
                measured.is_some_and(|q| q >= channel.min - slack && q <= channel.max + slack);
            channel.kind == ChannelKind::JointPosition && !plausible
        })
    }

    /// Channel and value for the report of a fault.
    pub fn details(&self, setup: &Setup, fault: Fault) -> Option<(u8, f32)> {
        let mut channels = 0..setup.config.channels.len();
        let (channel, value) = match fault {
            Fault::ActuatorSilent => {
                let (channel, ticks) = self.actuators.most_silent()?;
                (channel, f32::from(ticks) * setup.settings.period_s())
            }
            Fault::ActuatorFault => {
                let status = |i| self.actuators.feedback(i).map(|f| f.status);
                let faulty = |&i: &usize| status(i).is_some_and(|s| s.faulty());
                // After torque-off, a disabled actuator is no sign of a fault.
                let off = |&i: &usize| {
                    !matches!(self.stage, Stage::Off) && status(i).is_some_and(|s| !s.enabled())
                };
                let channel = channels.clone().find(faulty).or_else(|| channels.find(off))?;
                (channel, f32::from(status(channel)?.0))
            }
            Fault::OutOfLimits => {
                let channel = self.implausible(setup)?;
                (channel, self.actuators.measured(&setup.config, channel)?)
            }
            Fault::TrackingError => {
                let size = |i: usize| self.lag_rad(setup, i).unwrap_or(0.0);
                let worst = channels.max_by(|&a, &b| size(a).total_cmp(&size(b)))?;
                (worst, self.lag_rad(setup, worst)?)
            }
            _ => return None,
        };
        Some((u8::try_from(channel).ok()?, value))
    }

    /// Distance between a joint's measured position and its latest set-point without a torque offset, rad.
    fn lag_rad(&self, setup: &Setup, channel: usize) -> Option<f32> {
        let joint = setup.config.channels.get(channel)?.kind == ChannelKind::JointPosition;
        let setpoint = self.limiter.without_offset(channel).filter(|_| joint)?;
        Some((setpoint - self.actuators.measured(&setup.config, channel)?).abs())
    }

    /// Checks feedback once per control period.
    pub fn watch(&mut self, setup: &Setup, events: &mut EventSet) {
        self.actuators.age();
        self.parameters.advance(&setup.config);
        let torque_must_be_on = match self.stage {
            Stage::Off => return,
            // Some actuators that are damped during enabling were never enabled.
            Stage::Enabling { .. } | Stage::Damped => false,
            Stage::Ramping { .. }
            | Stage::Playing(_)
            | Stage::Streaming(_)
            | Stage::Tracking(_) => true,
        };
        let health = self.actuators.health();
        if !health.fresh_within(self.patience_ticks(setup)) {
            events.insert(Event::FeedbackLost);
        }
        let dropped = torque_must_be_on && !health.enabled;
        if dropped || health.faulty {
            events.insert(Event::ActuatorFault);
        }
        self.watch_following(setup, events);
    }

    /// Raises `NotFollowing` if a joint has been far from its set-point for too long.
    fn watch_following(&mut self, setup: &Setup, events: &mut EventSet) {
        let Setup { config, settings, .. } = setup;
        let far = |i| self.lag_rad(setup, i).is_some_and(|lag| lag > settings.follow_tolerance_rad);
        let plays =
            matches!(self.stage, Stage::Playing(_) | Stage::Streaming(_) | Stage::Tracking(_));
        let behind = plays && (0..config.channels.len()).any(far);
        self.behind_ticks = if behind { self.behind_ticks.saturating_add(1) } else { 0 };
        if behind && self.behind_ticks > settings.ticks(settings.follow_patience_us) {
            events.insert(Event::NotFollowing);
        }
    }
}
