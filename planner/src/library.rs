//! Motion libraries from plans. Plans are resampled at 60 Hz and checked against the limits of every channel. They are encoded
//! as `.rwl` bytes, decoded again and compared with the plans.
//!
//! The result can be flashed. [`rollwalk_protocol::library`] defines the byte format and validates the graph as a controller
//! does.

mod attitude;
mod error;
mod frames;

pub use error::LibraryError;

use crate::motion::Ends;
use crate::plan::Plan;
use crate::sample::{PlanSpline, Setpoints};
use frames::{Channels, Clip};
use rollwalk_protocol::config::{MAX_CHANNELS, RobotConfig};
use rollwalk_protocol::library::{
    self, Attitude, ClipCursor, ClipId, EncodeError, Library, LibrarySpec, MotionSpec, RATE_HZ,
    TransitionSpec,
};
use rollwalk_robot::Robot;
use serde::Serialize;

/// Content of a library.
#[derive(Clone, Debug)]
pub struct LibraryContent<'a> {
    /// Robot of the library.
    pub robot: &'a Robot,
    /// Motions: the nodes of the graph.
    pub motions: Vec<LibraryMotion<'a>>,
    /// Transitions: the edges of the graph.
    pub transitions: Vec<LibraryTransition<'a>>,
    /// Index of SAFE, a motion that stands still. Every motion has a path back to it.
    pub safe: usize,
    /// True if the library contains the torques of the motors ([`crate::torque`]).
    pub torques: bool,
}

/// Motion of a library.
#[derive(Clone, Copy, Debug)]
pub struct LibraryMotion<'a> {
    /// Name of the motion.
    pub name: &'a str,
    /// Command code that selects the motion.
    pub code: u8,
    /// Plan of the motion, periodic or at rest.
    pub plan: &'a Plan,
}

/// Transition of a library.
#[derive(Clone, Copy, Debug)]
pub struct LibraryTransition<'a> {
    /// Index of the motion that the transition leaves.
    pub from: usize,
    /// Time of the exit since the start of the motion that the transition leaves, s; a multiple of 1/60 s.
    pub exit_time_s: f64,
    /// Index of the motion that the transition enters.
    pub to: usize,
    /// Time of the entry since the start of the motion that the transition enters, s; a multiple of 1/60 s.
    pub entry_time_s: f64,
    /// Plan of the transition. Its prescribed ends are the states at exit and entry.
    pub plan: &'a Plan,
}

/// Motion library with statistics of every plan in it.
#[derive(Clone, Debug, PartialEq)]
pub struct BuiltLibrary {
    /// Bytes of the `.rwl` file.
    pub bytes: Vec<u8>,
    /// Statistics of motions, then of transitions.
    pub clips: Vec<ClipStats>,
}

/// Statistics of a clip.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClipStats {
    /// Name of the motion, or of the transition's plan.
    pub name: String,
    /// Number of frames at 60 Hz.
    pub frames: usize,
    /// Size of the frames, bytes.
    pub bytes: usize,
    /// Largest difference of a decoded joint angle from the plan, rad. The difference contains rounding and, at the ends of
    /// transitions, the step to the joined motion.
    pub worst_joint_error_rad: f64,
    /// Largest difference of a decoded wheel speed from the plan, rad/s.
    pub worst_wheel_error_rad_s: f64,
    /// Largest excess that was clamped to a limit, as a fraction of the tolerance.
    pub clamped: f64,
}

/// Set-points of a plan at every 60 Hz frame. A periodic motion gives one period without its end; other motions include both
/// ends.
///
/// # Errors
/// Returns an error if the duration is not a multiple of 1/60 s.
pub fn frames(plan: &Plan) -> Result<Vec<Setpoints>, LibraryError> {
    let last = frame_at(&plan.motion.name, "duration_s", plan.motion.duration_s)?;
    let count = if plan.motion.ends == Ends::Periodic { last } else { last + 1 };
    let spline = PlanSpline::new(plan);
    Ok((0..count).map(|k| spline.setpoints(k as f64 / f64::from(RATE_HZ))).collect())
}

/// Builds a library.
///
/// Joint positions, joint speeds and wheel speeds are clamped to their limits if the excess is within the tolerance of a played
/// motion (`Family::as_played`). A larger excess is an error. Torques are clamped regardless of their excess, because motors
/// cannot produce more and position control corrects the rest.
///
/// # Errors
/// Returns an error if a plan does not fit into a library. The error names motion, channel, time and value.
pub fn build(content: &LibraryContent) -> Result<BuiltLibrary, LibraryError> {
    let config = content.robot.controller_config()?;
    let channels = Channels { robot: content.robot, config: &config };
    let plans = content.motions.iter().map(|m| (m.name, m.plan));
    let transitions = content.transitions.iter().map(|t| (t.plan.motion.name.as_str(), t.plan));
    let clips: Vec<Clip> = plans
        .chain(transitions)
        .map(|(name, plan)| channels.clip(name, plan, content.torques))
        .collect::<Result<_, _>>()?;
    let (nodes, edges) = clips.split_at(content.motions.len());
    let motions: Vec<MotionSpec> = content
        .motions
        .iter()
        .zip(nodes)
        .map(|(motion, clip)| MotionSpec {
            name: motion.name,
            code: motion.code,
            looping: motion.plan.motion.ends == Ends::Periodic,
            frames: &clip.values,
            torques: &clip.torques_nm,
        })
        .collect();
    let transitions: Vec<TransitionSpec> = content
        .transitions
        .iter()
        .zip(edges)
        .map(|(transition, clip)| {
            Ok(TransitionSpec {
                from: transition.from,
                exit_frame: frame_of(
                    content,
                    transition.from,
                    clip,
                    "exit",
                    transition.exit_time_s,
                )?,
                to: transition.to,
                entry_frame: frame_of(
                    content,
                    transition.to,
                    clip,
                    "entry",
                    transition.entry_time_s,
                )?,
                frames: &clip.values,
                torques: &clip.torques_nm,
            })
        })
        .collect::<Result<_, LibraryError>>()?;
    let spec = LibrarySpec {
        config: &config,
        motions: &motions,
        transitions: &transitions,
        safe: content.safe,
    };
    let plans = content.motions.iter().map(|m| m.plan);
    let plans = plans.chain(content.transitions.iter().map(|t| t.plan));
    let attitudes = plans.map(attitude::attitude).collect::<Result<Vec<_>, _>>()?;
    let bytes = encoded(&spec, &attitudes, &clips).map_err(|error| LibraryError::Encode {
        clips: clips.iter().map(|c| c.name.clone()).collect(),
        error,
    })?;
    let stats = decoded_stats(&bytes, &config, &clips)?;
    Ok(BuiltLibrary { bytes, clips: stats })
}

/// Frame of a motion at `time_s`, modulo the period if the motion is periodic.
fn frame_of(
    content: &LibraryContent,
    motion: usize,
    clip: &Clip,
    end: &'static str,
    time_s: f64,
) -> Result<u16, LibraryError> {
    let plan = content.motions.get(motion).map(|m| m.plan);
    let plan = plan.ok_or(LibraryError::NoSuchMotion { transition: clip.name.clone(), motion })?;
    let frame = frame_at(&clip.name, end, time_s)?;
    let period = frame_at(&plan.motion.name, "duration_s", plan.motion.duration_s)?;
    let frame = if plan.motion.ends == Ends::Periodic { frame % period.max(1) } else { frame };
    // The encoder refuses a frame beyond the clip.
    Ok(u16::try_from(frame).unwrap_or(u16::MAX))
}

/// Index of the frame at `time_s`.
fn frame_at(motion: &str, field: &'static str, time_s: f64) -> Result<usize, LibraryError> {
    /// Tolerance within which a time counts as that of a frame, as a fraction of a frame.
    const ON_FRAME: f64 = 1e-6;
    let frame = time_s * f64::from(RATE_HZ);
    if !frame.is_finite() || frame < -ON_FRAME || (frame - frame.round()).abs() > ON_FRAME {
        return Err(LibraryError::NotOnFrame { motion: motion.to_owned(), field, time_s });
    }
    Ok(frame.round() as usize)
}

/// Encodes into a buffer that grows until the library fits.
fn encoded(
    spec: &LibrarySpec,
    attitudes: &[Attitude],
    clips: &[Clip],
) -> Result<Vec<u8>, EncodeError> {
    let values: usize = clips.iter().map(|c| c.values.len() + c.torques_nm.len()).sum();
    // Packed frames take less than two bytes per value; tables take a few kilobytes.
    let mut room = 4096 + 2 * values;
    loop {
        let mut bytes = vec![0; room];
        match library::encode_with_attitudes(spec, attitudes, &mut bytes) {
            Ok(len) => {
                bytes.truncate(len);
                return Ok(bytes);
            }
            // No clip takes more than eight bytes per value.
            Err(EncodeError::Full { .. }) if room < 65536 + 8 * values => room *= 2,
            Err(error) => return Err(error),
        }
    }
}

/// Decodes the library as a controller does and compares it with the plans.
fn decoded_stats(
    bytes: &[u8],
    config: &RobotConfig,
    clips: &[Clip],
) -> Result<Vec<ClipStats>, LibraryError> {
    let index = library::validate(bytes, config)?;
    let library = Library::open(bytes, &index).ok_or(LibraryError::Unreadable)?;
    (0u8..)
        .zip(clips)
        .map(|(id, clip)| {
            let info = library.clip(ClipId(id)).ok_or(LibraryError::Unreadable)?;
            let mut stats = ClipStats {
                name: clip.name.clone(),
                frames: usize::from(info.frames),
                bytes: info.bytes as usize,
                worst_joint_error_rad: 0.0,
                worst_wheel_error_rad_s: 0.0,
                clamped: clip.clamped,
            };
            let unreadable = |_| LibraryError::Unreadable;
            let mut cursor = ClipCursor::new(&library, ClipId(id), 0).map_err(unreadable)?;
            for setpoints in &clip.setpoints {
                let mut frame = [0.0; MAX_CHANNELS];
                cursor.frame_into(&library, &mut frame).map_err(unreadable)?;
                let (joints, wheels) = frame.split_at(setpoints.joint_rad.len());
                stats.worst_joint_error_rad =
                    worst_error(stats.worst_joint_error_rad, joints, &setpoints.joint_rad);
                stats.worst_wheel_error_rad_s = worst_error(
                    stats.worst_wheel_error_rad_s,
                    wheels,
                    &setpoints.motor_speed_rad_s,
                );
                cursor.advance(&library).map_err(unreadable)?;
            }
            Ok(stats)
        })
        .collect()
}

fn worst_error(so_far: f64, decoded: &[f32], planned: &[f64]) -> f64 {
    let errors = decoded.iter().zip(planned).map(|(d, p)| (f64::from(*d) - p).abs());
    errors.fold(so_far, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_plans;
    use crate::torque::InverseDynamics;
    use rollwalk_protocol::library::NodeId;

    /// Plan at rest in the pose in which `start_stop` begins and ends.
    fn stand() -> Plan {
        test_plans::BoxMotion {
            ends: Ends::AtRest,
            duration_s: 0.5,
            samples: 6,
            x_m: |_| 0.0,
            leg_rad: |_| 0.3,
        }
        .plan("stand")
    }

    fn motions<'a>(stand: &'a Plan, drive: &'a Plan) -> Vec<LibraryMotion<'a>> {
        vec![
            LibraryMotion { name: "stand", code: 1, plan: stand },
            LibraryMotion { name: "drive", code: 7, plan: drive },
        ]
    }

    /// Transitions in both directions. Both motions rest in the same pose, so that a stand joins them.
    fn transitions<'a>(stand: &'a Plan, drive_end_s: f64) -> Vec<LibraryTransition<'a>> {
        vec![
            LibraryTransition { from: 0, exit_time_s: 0.5, to: 1, entry_time_s: 0.0, plan: stand },
            LibraryTransition {
                from: 1,
                exit_time_s: drive_end_s,
                to: 0,
                entry_time_s: 0.0,
                plan: stand,
            },
        ]
    }

    fn built(drive: &Plan) -> Result<BuiltLibrary, LibraryError> {
        let stand = stand();
        let transitions = transitions(&stand, drive.motion.duration_s);
        let robot = test_plans::robot();
        build(&LibraryContent {
            robot: &robot,
            motions: motions(&stand, drive),
            transitions,
            safe: 0,
            torques: true,
        })
    }

    #[test]
    fn a_library_holds_its_plans_to_half_a_quantum() {
        let drive = test_plans::start_stop();
        let library = built(&drive).expect("a library");
        assert_eq!(library.clips.iter().map(|c| c.frames).collect::<Vec<_>>(), [31, 121, 31, 31]);
        for clip in &library.clips {
            // Values are rounded to quanta of 2⁻¹⁰; the margin is for the rounding of f32.
            assert!(clip.worst_joint_error_rad < 0.5 / 1024.0 + 1e-6, "{clip:?}");
            assert!(clip.worst_wheel_error_rad_s < 0.5 / 1024.0 + 1e-6, "{clip:?}");
            assert_eq!(clip.clamped, 0.0);
        }
        let config = test_plans::robot().controller_config().expect("a valid robot");
        let index = library::validate(&library.bytes, &config).expect("valid for its robot");
        let read = Library::open(&library.bytes, &index).expect("the same bytes");
        assert_eq!(read.node_for_code(7), Some(NodeId(1)));
        assert_eq!(read.name(NodeId(1)), Some("drive"));
        assert_eq!(built(&drive).expect("a library").bytes, library.bytes, "deterministic");
    }

    #[test]
    fn a_library_holds_the_torques_of_its_plans() {
        let drive = test_plans::start_stop();
        let bytes = built(&drive).expect("a library").bytes;
        let config = test_plans::robot().controller_config().expect("a valid robot");
        let index = library::validate(&bytes, &config).expect("valid for its robot");
        let read = Library::open(&bytes, &index).expect("the same bytes");
        assert!(read.has_torques());
        let mut cursor = ClipCursor::new(&read, ClipId(1), 0).expect("the second clip");
        let mut inverse = InverseDynamics::new(&drive);
        for frame in 0..121 {
            let mut torques_nm = [0.0; MAX_CHANNELS];
            cursor.torques_into(&read, &mut torques_nm).expect("torques");
            let planned = inverse.at(f64::from(frame) / f64::from(RATE_HZ));
            for (channel, planned_nm) in planned.channels_nm(&drive.robot).enumerate() {
                let quantum_nm = read.torque_quantum(channel).expect("a channel");
                let error = f64::from(torques_nm[channel]) - planned_nm;
                assert!(error.abs() < 0.501 * f64::from(quantum_nm), "{frame} {channel}: {error}");
            }
            cursor.advance(&read).expect("the next frame");
        }
    }

    #[test]
    fn torques_beyond_a_limit_are_moved_onto_it() {
        let mut robot = test_plans::robot();
        robot.joints[2].actuator.torque_max_nm = 0.2;
        let mut stand = stand();
        stand.robot = robot.clone();
        let config = robot.controller_config().expect("a valid robot");
        let channels = Channels { robot: &robot, config: &config };
        let clip = channels.clip("stand", &stand, true).expect("a clip");
        let mut hips = clip.torques_nm.chunks(8).map(|frame| frame[2]);
        assert!(stand.samples[0].joint_torque_nm[2] < -0.21 && hips.all(|torque| torque == -0.2));
    }

    #[test]
    fn values_beyond_limits_are_named_and_small_excesses_are_moved_onto_the_limit() {
        let with_limit = |max_rad: f64| {
            let mut robot = test_plans::robot();
            robot.joints[1].position_max_rad = max_rad;
            let (mut stand, mut drive) = (stand(), test_plans::start_stop());
            stand.robot = robot.clone();
            drive.robot = robot.clone();
            let transitions = transitions(&stand, drive.motion.duration_s);
            build(&LibraryContent {
                robot: &robot,
                motions: motions(&stand, &drive),
                transitions,
                safe: 0,
                torques: false,
            })
        };
        // The legs reach 0.6 rad after one second; the tolerance of joints is 0.05 rad.
        let message = with_limit(0.54).expect_err("beyond its limit").to_string();
        assert!(message.starts_with("drive: fr-hip is at 0.59"), "{message}");
        assert!(message.ends_with("expected -1.000 to 0.540 rad"), "{message}");
        let library = with_limit(0.57).expect("moved onto the limit");
        assert!((library.clips[1].clamped - 0.6).abs() < 1e-6, "{:?}", library.clips[1]);
    }

    #[test]
    fn what_is_too_fast_off_the_frames_or_for_another_robot_is_named() {
        let drive = |duration_s: f64, x_m: fn(f64) -> f64, leg_rad: fn(f64) -> f64| {
            test_plans::BoxMotion { ends: Ends::AtRest, duration_s, samples: 31, x_m, leg_rad }
                .plan("drive")
        };
        let message = built(&drive(1.01, |_| 0.0, |_| 0.3)).expect_err("off the grid").to_string();
        assert_eq!(message, "drive: duration_s is 1.01 s; expected a multiple of 1/60 s");

        // The legs swing by 0.6 rad around the middle at up to 7.8 and 6.3 rad/s; the wheels do not turn.
        fn leg(t: f64) -> f64 {
            0.3 + 0.3 * (26.0 * (t - 0.5)).tanh()
        }
        fn slower_leg(t: f64) -> f64 {
            0.3 + 0.3 * (22.5 * (t - 0.5)).tanh()
        }
        let quick = drive(1.0, |t| 0.2 * leg(t).sin(), leg);
        let message = built(&quick).expect_err("too fast").to_string();
        assert!(message.starts_with("drive: fl-hip changes by"), "{message}");
        assert!(message.contains("the limit is 6.00 rad per second"), "{message}");

        // The excess speed of a plan that holds is spread over more frames.
        let less_quick = drive(1.0, |t| 0.2 * slower_leg(t).sin(), slower_leg);
        let (robot, config) =
            (test_plans::robot(), test_plans::robot().controller_config().unwrap());
        let clip = Channels { robot: &robot, config: &config }.clip("drive", &less_quick, false);
        let clip = clip.expect("within the tolerance");
        let changes = |planned: bool| {
            let of = |k: usize| {
                if planned { clip.setpoints[k].joint_rad[0] } else { f64::from(clip.values[8 * k]) }
            };
            (1..clip.setpoints.len()).map(|k| 60.0 * (of(k) - of(k - 1))).fold(0.0, f64::max)
        };
        assert!(
            changes(true) > 6.1 && changes(false) < 6.06,
            "{} {}",
            changes(true),
            changes(false)
        );
        assert_eq!(clip.values[8 * 60], clip.setpoints[60].joint_rad[0] as f32, "it arrives");

        let mut other = test_plans::start_stop();
        other.robot.links[0].mass_kg = 3.0;
        let message = built(&other).expect_err("another robot").to_string();
        assert!(message.starts_with("drive is planned for robot `box`"), "{message}");
    }

    #[test]
    fn what_the_encoder_refuses_is_told_with_the_names_of_clips() {
        let (stand, drive) = (stand(), test_plans::start_stop());
        let mut motions = motions(&stand, &drive);
        motions[1].code = 1;
        let transitions = transitions(&stand, drive.motion.duration_s);
        let robot = test_plans::robot();
        let content =
            LibraryContent { robot: &robot, motions, transitions, safe: 0, torques: false };
        let message = build(&content).expect_err("one code twice").to_string();
        assert!(
            message.contains("same command code 1") && message.contains("stand, drive"),
            "{message}"
        );
        let mut content = content;
        content.transitions[0].to = 5;
        let message = build(&content).expect_err("no such motion").to_string();
        assert_eq!(message, "stand joins motion number 5, but this motion does not exist");
    }
}
