//! Host's end of a closed loop over the link: receives batches of measurements, and sends set-points that answer them
//! (`docs/formats/wire-format.md`, SAMPLE).
//!
//! This module is part of the [operator](crate::operator), which sends answers only to a controller that follows them.

use crate::stream::Target;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::MAX_CHANNELS;
use rollwalk_protocol::wire::{
    Accelerometer, Action, Gyro, JointTelemetry, Node, Sample, Setpoint,
};

/// Parameters of a closed loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tracking {
    /// Rate of samples, Hz. The controller uses this rate, or the next higher rate that is possible.
    pub rate_hz: u16,
    /// Fraction of the robot file's kp that acts around set-points without the stiff flag, %.
    pub kp_percent: u8,
    /// Fraction of the robot file's kd that acts around set-points that are not stiff, %.
    pub kd_percent: u8,
}

impl Tracking {
    /// Command that begins tracking.
    pub fn action(self) -> Action {
        let Self { rate_hz, kp_percent, kd_percent } = self;
        Action::Track { rate_hz, kp_percent, kd_percent }
    }
}

/// Measurements of an instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurements {
    /// Number of the sample, counted from the number of the first received sample.
    pub number: u64,
    /// Time from the measurements of a sample until its answer took effect, for the answer in force, s; `None` before the first
    /// answer.
    pub delay_s: Option<f32>,
    /// Number of samples taken since the one whose answer was in force; `None` before the first answer.
    pub late: Option<u8>,
    /// Latest measurements of each channel; `None` for a channel that has not reported yet.
    pub joints: Vec<Option<JointTelemetry>>,
    /// Number of channels whose measurements did not arrive with this sample, and are older.
    pub stale: usize,
    /// Angular velocity of the root link in its axes, rad/s; `None` without an IMU.
    pub gyro_rad_s: Option<[f32; 3]>,
    /// Specific force at the origin of the root link, mean since the previous sample, m/s²; `None` without an IMU.
    pub force_m_s2: Option<[f32; 3]>,
    /// Contact of each end effector with the ground, one bit each; `None` without contact switches.
    pub contacts: Option<u32>,
}

/// Collects batches of measurements as they arrive.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    joints: Vec<Option<JointTelemetry>>,
    /// Channels that have reported since the latest sample, a bit each.
    heard: u32,
    gyro: Option<Gyro>,
    accelerometer: Option<Accelerometer>,
    last: Option<u64>,
    /// Number of skipped sample numbers.
    lost: u64,
}

impl Samples {
    /// Records the measurements of a channel.
    pub fn on_joint(&mut self, joint: JointTelemetry) {
        let channel = usize::from(joint.channel);
        if channel < MAX_CHANNELS {
            self.joints.resize(self.joints.len().max(channel + 1), None);
            self.joints[channel] = Some(joint);
            self.heard |= 1 << channel;
        }
    }

    /// Records an angular velocity.
    pub fn on_gyro(&mut self, gyro: Gyro) {
        self.gyro = Some(gyro);
    }

    /// Records a specific force.
    pub fn on_accelerometer(&mut self, accelerometer: Accelerometer) {
        self.accelerometer = Some(accelerometer);
    }

    /// Ends a batch. Returns `None` for a repeated or outdated sample.
    pub fn on_sample(&mut self, sample: Sample) -> Option<Measurements> {
        let number = match self.last {
            None => u64::from(sample.number),
            Some(last) => {
                let ahead = sample.number.wrapping_sub(last as u8);
                if ahead == 0 || ahead > i8::MAX as u8 {
                    return None;
                }
                self.lost += u64::from(ahead) - 1;
                last + u64::from(ahead)
            }
        };
        self.last = Some(number);
        let heard = std::mem::take(&mut self.heard).count_ones() as usize;
        Some(Measurements {
            number,
            delay_s: sample.answered.map(|of| of.delay_s),
            late: sample.answered.map(|of| sample.number.wrapping_sub(of.number)),
            joints: self.joints.clone(),
            stale: self.joints.len().saturating_sub(heard),
            gyro_rad_s: self.gyro.take().map(|gyro| gyro.rad_s),
            force_m_s2: self.accelerometer.take().map(|of| of.m_s2),
            contacts: sample.contacts,
        })
    }

    /// Number of samples that did not arrive.
    pub fn lost(&self) -> u64 {
        self.lost
    }
}

/// Answer that is being sent.
#[derive(Clone, Debug, Default)]
pub struct Answer {
    number: u8,
    stiff: bool,
    targets: Vec<Target>,
    next: usize,
}

impl Answer {
    /// Creates the answer to a sample: set-points of all channels.
    pub fn new(number: u64, stiff: bool, targets: Vec<Target>) -> Self {
        Self { number: number as u8, stiff, targets, next: 0 }
    }

    /// Returns the next message; `None` once all are sent.
    pub fn poll(&mut self, to: Node) -> Option<Frame> {
        let Target { value, torque_nm } = *self.targets.get(self.next)?;
        let channel = u8::try_from(self.next).ok()?;
        self.next += 1;
        let (frame, stiff) = (self.number, self.stiff);
        Some(Setpoint { frame, channel, stiff, value, torque_nm }.encode(to))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::wire::SampleAnswer;

    fn joint(channel: u8, position_rad: f32) -> JointTelemetry {
        let (velocity_rad_s, torque_nm, status) = (0.0, 0.0, Default::default());
        JointTelemetry { channel, position_rad, velocity_rad_s, torque_nm, status }
    }

    fn sample(number: u8, answered: Option<u8>) -> Sample {
        let answered = answered.map(|number| SampleAnswer { number, delay_s: 0.02 });
        Sample { number, answered, contacts: Some(3) }
    }

    #[test]
    fn a_batch_is_what_came_since_the_one_before() {
        let mut samples = Samples::default();
        samples.on_gyro(Gyro { rad_s: [1.0, 0.0, 0.0] });
        samples.on_joint(joint(0, 0.1));
        samples.on_joint(joint(1, 0.2));
        let first = samples.on_sample(sample(254, None)).unwrap();
        assert_eq!(
            (first.number, first.late, first.stale, first.contacts),
            (254, None, 0, Some(3))
        );
        assert_eq!(first.gyro_rad_s, Some([1.0, 0.0, 0.0]));
        // The numbers wrap. A missing channel has an older value or none.
        samples.on_joint(joint(1, 0.3));
        let next = samples.on_sample(sample(1, Some(254))).unwrap();
        assert_eq!((next.number, next.late, next.stale, next.gyro_rad_s), (257, Some(3), 1, None));
        assert_eq!(next.joints[0].unwrap().position_rad, 0.1);
        assert_eq!(next.joints[1].unwrap().position_rad, 0.3);
        assert_eq!(samples.lost(), 2);
        // A repeated sample, and an overtaken sample.
        assert_eq!(samples.on_sample(sample(1, None)), None);
        assert_eq!(samples.on_sample(sample(0, None)), None);
        // A channel beyond the last.
        samples.on_joint(joint(255, 0.0));
        assert_eq!(samples.on_sample(sample(2, None)).unwrap().joints.len(), 2);
    }

    #[test]
    fn an_answer_is_a_setpoint_for_each_channel() {
        let node = Node::new(1).unwrap();
        let targets = vec![Target { value: 0.5, torque_nm: 1.0 }, Target::default()];
        let mut answer = Answer::new(257, true, targets);
        let sent: Vec<_> = std::iter::from_fn(|| answer.poll(node)).collect();
        let read = sent.iter().map(|frame| Setpoint::decode(frame).unwrap().1);
        let read: Vec<_> = read.map(|of| (of.frame, of.channel, of.stiff, of.value)).collect();
        assert_eq!(read, [(1, 0, true, 0.5), (1, 1, true, 0.0)]);
    }
}
