//! Commanded and measured values of every control period.
//!
//! The commanded values are decoded from the frames on the actuator buses, not taken from the firmware's memory. A lost, late
//! or wrongly rounded set-point is therefore visible. If the controller closes the loop
//! ([`ControlLoop::OnController`](rollwalk_protocol::actuators::bus::ControlLoop)), the bus carries torques, and the commanded
//! values are unknown.

use crate::clock::SimTime;
use rollwalk_firmware::player::PlaybackPosition;
use rollwalk_protocol::config::{ChannelKind, RobotConfig};
use rollwalk_protocol::library::ClipId;
use std::collections::BTreeMap;

/// Record of a control period in which a library was played.
#[derive(Clone, Debug, PartialEq)]
pub struct TickRecord {
    /// Start of the period, which is the time of its set-points, µs.
    pub time_us: u64,
    /// Clip that was played.
    pub clip: ClipId,
    /// Position in the clip, in 60 Hz frames from its start.
    pub phase_frames: f64,
    /// Set-points in force at the end of the period, in channel order: rad for a joint, rad/s for a wheel. NaN for a channel
    /// without a set-point, as on buses with torque set-points.
    pub commanded: Vec<f32>,
    /// Offsets that replace torques in the set-points of this period, in the units of `commanded`. A drive without a torque
    /// field applies the torque through its own gain.
    pub torque_offsets: Vec<f32>,
    /// True values of the motors at `time_us`, in the units of `commanded`.
    pub measured: Vec<f32>,
    /// Number of set-points that did not arrive within the period, so that an older one stayed in force. Channels with torque
    /// set-points do not count.
    pub missed: usize,
}

impl TickRecord {
    /// Set-points without the offsets that replace torques, for comparison with the measured values.
    pub fn targets(&self) -> impl Iterator<Item = f32> {
        self.commanded.iter().zip(&self.torque_offsets).map(|(value, offset)| value - offset)
    }
}

/// Recorder that decodes the set-points on the actuator buses, and stores a record of each period.
#[derive(Clone, Debug)]
pub struct Recorder {
    /// True for channels that accept set-points of position or speed.
    takes_setpoints: Vec<bool>,
    in_force: Vec<f32>,
    fresh: Vec<bool>,
    /// Current period, without commanded values.
    under_way: Option<TickRecord>,
    records: Vec<TickRecord>,
}

impl Recorder {
    /// Creates a recorder. `takes_setpoints` is true for channels that accept set-points of position or speed instead of
    /// torque.
    pub fn new(takes_setpoints: Vec<bool>) -> Self {
        let (in_force, fresh) =
            (vec![f32::NAN; takes_setpoints.len()], vec![false; takes_setpoints.len()]);
        Self { takes_setpoints, in_force, fresh, under_way: None, records: Vec::new() }
    }

    /// Records a set-point for `channel` that has crossed its bus, rad or rad/s. Channels with torque set-points are ignored,
    /// since position and speed in their frames have no meaning.
    pub fn on_setpoint(&mut self, channel: usize, value: f32) {
        if !self.takes_setpoints[channel] {
            return;
        }
        self.in_force[channel] = value;
        self.fresh[channel] = true;
    }

    /// Begins a period in which the controller plays a library.
    pub fn begin_period(
        &mut self,
        at: SimTime,
        playing: PlaybackPosition,
        measured: Vec<f32>,
        torque_offsets: Vec<f32>,
    ) {
        self.under_way = Some(TickRecord {
            time_us: at.as_us(),
            clip: playing.clip,
            phase_frames: f64::from(playing.frame) + f64::from(playing.phase),
            commanded: Vec::new(),
            torque_offsets,
            measured,
            missed: 0,
        });
    }

    /// Ends the current period.
    pub fn end_period(&mut self) {
        if let Some(mut record) = self.under_way.take() {
            record.commanded.clone_from(&self.in_force);
            let came = self.takes_setpoints.iter().zip(&self.fresh);
            record.missed = came.filter(|&(&expected, &fresh)| expected && !fresh).count();
            self.records.push(record);
        }
        self.fresh.fill(false);
    }

    /// Drops all records so far.
    pub fn forget(&mut self) {
        self.records.clear();
    }

    /// Records so far, oldest first.
    pub fn records(&self) -> &[TickRecord] {
        &self.records
    }
}

/// Largest differences between intended and measured values over the periods of a clip.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrackingError {
    /// Error of a joint, rad.
    pub joint_rad: f64,
    /// Error of a wheel, rad/s.
    pub wheel_rad_s: f64,
}

/// Largest tracking errors of every clip in the records.
pub fn tracking_errors(
    config: &RobotConfig,
    records: &[TickRecord],
) -> BTreeMap<ClipId, TrackingError> {
    let mut errors = BTreeMap::<ClipId, TrackingError>::new();
    for record in records {
        let worst = errors.entry(record.clip).or_default();
        for (channel, (commanded, measured)) in
            config.channels.iter().zip(record.targets().zip(&record.measured))
        {
            let error = f64::from((commanded - measured).abs());
            let slot = match channel.kind {
                ChannelKind::JointPosition => &mut worst.joint_rad,
                ChannelKind::WheelSpeed => &mut worst.wheel_rad_s,
            };
            *slot = slot.max(error);
        }
    }
    errors
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::one_leg;

    /// Recorder for the hip, knee and wheel of the leg.
    fn recorder() -> Recorder {
        Recorder::new(vec![true; 3])
    }

    fn period(recorder: &mut Recorder, frame: u16, measured: [f32; 3], setpoints: &[(usize, f32)]) {
        let playing = PlaybackPosition { clip: ClipId(4), frame, phase: 0.5 };
        recorder.begin_period(SimTime::from_us(1000), playing, measured.to_vec(), vec![0.0; 3]);
        for (channel, value) in setpoints {
            recorder.on_setpoint(*channel, *value);
        }
        recorder.end_period();
    }

    #[test]
    fn a_setpoint_that_does_not_come_is_counted_and_the_older_one_stays_in_force() {
        let mut recorder = recorder();
        period(&mut recorder, 7, [0.0; 3], &[(0, 0.5), (1, 1.0), (2, -0.25)]);
        period(&mut recorder, 8, [0.0; 3], &[(1, 1.0), (2, 0.5)]);
        let [first, second] = recorder.records() else { panic!("two periods") };
        assert_eq!((first.phase_frames, first.missed), (7.5, 0));
        assert_eq!(first.commanded, [0.5, 1.0, -0.25]);
        assert_eq!((second.phase_frames, second.missed), (8.5, 1));
        assert_eq!(second.commanded, [0.5, 1.0, 0.5]);
    }

    #[test]
    fn a_channel_that_is_told_torques_has_no_setpoint_and_misses_none() {
        let mut recorder = Recorder::new(vec![true, false, true]);
        period(&mut recorder, 0, [0.5, 0.25, 0.0], &[(0, 0.5), (1, 0.0), (2, 0.0)]);
        period(&mut recorder, 1, [0.5, 0.25, 0.0], &[(2, 0.0)]);
        let missed: Vec<_> = recorder.records().iter().map(|record| record.missed).collect();
        assert_eq!(missed, [0, 1]);
        for record in recorder.records() {
            assert!(record.commanded[1].is_nan(), "{record:?}");
            assert_eq!((record.commanded[0], record.commanded[2]), (0.5, 0.0));
        }
        let errors = tracking_errors(&one_leg::config(), recorder.records());
        assert_eq!(errors, BTreeMap::from([(ClipId(4), TrackingError::default())]));
    }

    #[test]
    fn an_offset_in_place_of_a_torque_is_no_error() {
        let mut recorder = recorder();
        let playing = PlaybackPosition { clip: ClipId(4), frame: 0, phase: 0.0 };
        recorder.begin_period(SimTime::ZERO, playing, vec![0.5, 1.0, 0.0], vec![0.25, 0.0, 0.5]);
        for (channel, value) in [(0, 0.75), (1, 1.25), (2, 0.5)] {
            recorder.on_setpoint(channel, value);
        }
        recorder.end_period();
        let errors = tracking_errors(&one_leg::config(), recorder.records());
        let worst = TrackingError { joint_rad: 0.25, wheel_rad_s: 0.0 };
        assert_eq!(errors, BTreeMap::from([(ClipId(4), worst)]));
    }

    #[test]
    fn a_period_without_playback_leaves_no_record() {
        let mut recorder = recorder();
        recorder.on_setpoint(0, 0.5);
        recorder.end_period();
        assert!(recorder.records().is_empty());
    }

    #[test]
    fn the_worst_error_is_kept_for_joints_and_wheels_apart() {
        let mut recorder = recorder();
        let setpoints = [(0, 0.5), (1, 1.0), (2, -0.25)];
        for measured in
            [[0.5, 1.0, -0.25], [0.375, 1.0, -0.25], [0.5, 1.0625, -1.0], [0.5625, 1.0, 0.0]]
        {
            period(&mut recorder, 0, measured, &setpoints);
        }
        let errors = tracking_errors(&one_leg::config(), recorder.records());
        let worst = TrackingError { joint_rad: 0.125, wheel_rad_s: 0.75 };
        assert_eq!(errors, BTreeMap::from([(ClipId(4), worst)]));
    }
}
