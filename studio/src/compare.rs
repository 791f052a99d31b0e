//! Comparison of the shown plan with a motion of a library. If they match, a robot that plays the motion is shown beside the
//! plan.
//!
//! Equal names are not sufficient, because the motion may have been edited after the library was built. Therefore the frames of
//! the library are compared with the frames that a library of the shown plan would have.

use crate::documents::Documents;
use crate::library::name_of;
use crate::messages::ClipComparison;
use rollwalk_planner::library::frames;
use rollwalk_planner::motion::Ends;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::sample::Setpoints;
use rollwalk_protocol::config::MAX_CHANNELS;
use rollwalk_protocol::library::{ClipCursor, Library, NodeId, validate};
use rollwalk_robot::Robot;

/// Maximum difference between matching frames, rad and rad/s. Rounding in the library causes 0.0005 of it. The rest allows for
/// an optimum reached from another start, after an edit that was undone.
const SAME: f64 = 0.005;

/// Compares the shown plan of the motion file `motion` with the motion's entry in the library file.
pub fn compared(
    documents: &Documents<'_>,
    plan: &Plan,
    motion: &str,
    library: &str,
    bytes: &[u8],
) -> ClipComparison {
    let name = name_of(documents, library, &plan.robot, motion);
    let name = name.unwrap_or_else(|| plan.motion.name.clone());
    let (clip, why) = match verdict(plan, &name, bytes) {
        Ok(clip) => (Some(clip), String::new()),
        Err(why) => (None, why),
    };
    ClipComparison { name, clip, why }
}

/// Returns the clip that matches the plan.
///
/// # Errors
/// Returns the reason if no clip matches.
fn verdict(plan: &Plan, name: &str, bytes: &[u8]) -> Result<u8, String> {
    let another = |_| "the library and the plan are for different robots".to_owned();
    let config = plan.robot.controller_config().map_err(|why| why.to_string())?;
    let index = validate(bytes, &config).map_err(another)?;
    let unreadable = || "the library cannot be read".to_owned();
    let library = Library::open(bytes, &index).ok_or_else(unreadable)?;
    let node = library.nodes().find(|&node| library.name(node) == Some(name));
    let node = node.ok_or_else(|| format!("the library has no motion `{name}`"))?;
    let setpoints = frames(plan).map_err(|why| why.to_string())?;
    let clip = library.clip(node.clip()).ok_or_else(unreadable)?;
    let looping = plan.motion.ends == Ends::Periodic;
    if (usize::from(clip.frames), clip.looping) != (setpoints.len(), looping) {
        return Err(format!("the duration of `{name}` differs between library and plan"));
    }
    let [joint_rad, wheel_rad_s] =
        largest_difference(&plan.robot, &library, node, &setpoints).ok_or_else(unreadable)?;
    if joint_rad > SAME {
        return Err(format!(
            "a joint of `{name}` in the library differs by {joint_rad:.3} rad from the plan"
        ));
    }
    if wheel_rad_s > SAME {
        return Err(format!(
            "a wheel of `{name}` in the library differs by {wheel_rad_s:.3} rad/s from the plan"
        ));
    }
    Ok(node.clip().0)
}

/// Maximum difference between the frames of the library and of the plan: joints, rad, and driven wheels, rad/s.
fn largest_difference(
    robot: &Robot,
    library: &Library<'_>,
    node: NodeId,
    setpoints: &[Setpoints],
) -> Option<[f64; 2]> {
    let mut cursor = ClipCursor::new(library, node.clip(), 0).ok()?;
    let mut worst = [0.0; 2];
    for frame in setpoints {
        let mut values = [0.0; MAX_CHANNELS];
        cursor.frame_into(library, &mut values).ok()?;
        let joints = robot.driven_joints().count();
        let both = values.iter().zip(frame.channels(robot)).enumerate();
        for (channel, (stored, planned)) in both {
            let worst = &mut worst[usize::from(channel >= joints)];
            *worst = f64::max(*worst, (f64::from(*stored) - planned).abs());
        }
        cursor.advance(library).ok()?;
    }
    Some(worst)
}
