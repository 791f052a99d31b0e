//! Measurements of every played clip: deviation of the bus commands from the plan, deviation of the motors from the commands,
//! and load of the buses.

use rollwalk_firmware::Settings;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::sample::PlanSpline;
use rollwalk_protocol::library::{ClipId, RATE_HZ};
use rollwalk_robot::Robot;
use rollwalk_sim_host::bus::DEFAULT_BITRATE;
use rollwalk_sim_host::interface::Interface;
use rollwalk_sim_host::record::{TickRecord, TrackingError, tracking_errors};
use rollwalk_sim_host::rig::Rig;
use std::collections::BTreeMap;

/// Measurements of one clip.
#[derive(Clone, Debug, Default)]
pub struct Score {
    /// Playing time of the clip, s.
    pub played_s: f64,
    /// Worst difference between plan and commanded set-point of a joint, rad.
    pub command_joint_rad: f64,
    /// Worst difference between plan and commanded set-point of a wheel, rad/s.
    pub command_wheel_rad_s: f64,
    /// Worst differences between commands and motors.
    pub tracking: TrackingError,
    /// Number of set-points that arrived after their control period.
    pub late_setpoints: usize,
    /// Load of the busiest bus, 0 to 1.
    pub bus_load: f64,
}

/// Scores every played clip. `plans` are in the order of the clips; `robot` is the robot of the rig.
pub fn scores(plans: &[&Plan], rig: &Rig, robot: &Robot) -> BTreeMap<ClipId, Score> {
    let (records, period_us) =
        (rig.records(), 1_000_000 / u64::from(Settings::default().control_hz));
    let splines: Vec<PlanSpline> = plans.iter().map(|plan| PlanSpline::new(plan)).collect();
    let tracking = tracking_errors(rig.config(), records);
    let mut scores = BTreeMap::<ClipId, Score>::new();
    for (index, record) in records.iter().enumerate() {
        let score = scores.entry(record.clip).or_default();
        score.played_s += period_us as f64 * 1e-6;
        score.late_setpoints += record.missed;

        let (clip, phase_frames) = planned_place(&records[index..]);
        let Some(spline) = splines.get(usize::from(clip.0)) else { continue };
        let score = scores.entry(clip).or_default();
        let planned = spline.setpoints(phase_frames / f64::from(RATE_HZ));
        let joints = robot.driven_joints().count();
        let both = record.targets().zip(planned.channels(robot)).enumerate();
        for (channel, (commanded, planned)) in both {
            let worst = match channel < joints {
                true => &mut score.command_joint_rad,
                false => &mut score.command_wheel_rad_s,
            };
            *worst = worst.max((f64::from(commanded) - planned).abs());
        }
    }
    let loads = bus_loads(records, &traffic(rig, robot), period_us);
    for (clip, score) in &mut scores {
        score.tracking = tracking.get(clip).copied().unwrap_or_default();
        score.bus_load = loads.get(clip).copied().unwrap_or_default();
    }
    scores
}

/// Returns the planned clip and its frame at the first of these records.
///
/// They equal those of the record, except in the step from a motion to a transition. The exit frame of the motion is also frame
/// 0 of the transition, so the step to frame 1 belongs to the transition.
fn planned_place(records: &[TickRecord]) -> (ClipId, f64) {
    let here = &records[0];
    let frame = here.phase_frames.floor();
    let next = records.iter().find(|r| r.clip != here.clip || r.phase_frames.floor() != frame);
    match next {
        Some(next) if next.clip != here.clip && next.phase_frames.floor() == 1.0 => {
            (next.clip, here.phase_frames - frame)
        }
        _ => (here.clip, here.phase_frames),
    }
}

/// Frame or packet: its end time, and the duration of its bits.
struct Traffic {
    at_us: u64,
    interface: Interface,
    busy_s: f64,
}

/// Traffic of all buses, sorted by time.
fn traffic(rig: &Rig, robot: &Robot) -> Vec<Traffic> {
    let rate = |interface| match interface {
        Interface::Link => DEFAULT_BITRATE,
        Interface::Actuator(bus) => robot.buses.get(&bus).copied().unwrap_or_default().bit_rate,
    };
    let entry = |at_us, interface, bits| {
        let busy_s = f64::from(bits) / f64::from(rate(interface));
        Traffic { at_us, interface, busy_s }
    };
    let frames = rig.log().iter().map(|of| entry(of.at_us, of.interface, of.frame.exact_bits()));
    let packets = rig.packets().iter();
    let packets = packets.map(|of| entry(of.at_us, of.interface, 10 * of.bytes.len() as u32));
    let mut all: Vec<_> = frames.chain(packets).collect();
    all.sort_by_key(|entry| entry.at_us);
    all
}

/// Fraction of time in which the busiest bus carried bits, for each clip.
fn bus_loads(records: &[TickRecord], traffic: &[Traffic], period_us: u64) -> BTreeMap<ClipId, f64> {
    let mut busy_s = BTreeMap::<(ClipId, Interface), f64>::new();
    let mut periods = BTreeMap::<ClipId, u64>::new();
    let mut traffic = traffic.iter().peekable();
    for record in records {
        *periods.entry(record.clip).or_default() += 1;
        let (start, end) = (record.time_us, record.time_us + period_us);
        while traffic.next_if(|entry| entry.at_us < start).is_some() {}
        while let Some(entry) = traffic.next_if(|entry| entry.at_us < end) {
            *busy_s.entry((record.clip, entry.interface)).or_default() += entry.busy_s;
        }
    }
    let mut loads = BTreeMap::<ClipId, f64>::new();
    for ((clip, _), busy_s) in busy_s {
        let seconds = (periods[&clip] * period_us) as f64 * 1e-6;
        let load = busy_s / seconds;
        let fullest = loads.entry(clip).or_default();
        *fullest = fullest.max(load);
    }
    loads
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(clip: u8, phase_frames: f64) -> TickRecord {
        let [commanded, torque_offsets, measured] = [const { Vec::new() }; 3];
        let clip = ClipId(clip);
        TickRecord {
            time_us: 0,
            clip,
            phase_frames,
            commanded,
            torque_offsets,
            measured,
            missed: 0,
        }
    }

    #[test]
    fn the_step_out_of_a_motion_is_the_transitions() {
        let records = [record(2, 143.5), record(2, 0.0), record(2, 0.5), record(5, 1.0)];
        assert_eq!(planned_place(&records[0..]), (ClipId(2), 143.5));
        assert_eq!(planned_place(&records[1..]), (ClipId(5), 0.0));
        assert_eq!(planned_place(&records[2..]), (ClipId(5), 0.5));
        assert_eq!(planned_place(&records[3..]), (ClipId(5), 1.0));
    }

    #[test]
    fn the_step_into_a_motion_is_the_transitions() {
        let records = [record(8, 71.5), record(2, 0.0), record(2, 0.5), record(2, 1.0)];
        assert_eq!(planned_place(&records[0..]), (ClipId(8), 71.5));
        assert_eq!(planned_place(&records[1..]), (ClipId(2), 0.0));
        assert_eq!(planned_place(&records[2..]), (ClipId(2), 0.5));
    }
}
