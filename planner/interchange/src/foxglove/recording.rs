//! A plan as an MCAP file: <https://mcap.dev>.
//!
//! | topic | schema | when |
//! |---|---|---|
//! | `/tf` | `foxglove.FrameTransforms` | every frame |
//! | `/robot` | `foxglove.SceneUpdate` | once: solids of all bodies |
//! | `/joint_states` | `foxglove.JointStates` | every frame: joints and driven wheels, with speed and torque |
//! | `/forces` | `foxglove.SceneUpdate` | every frame: arrows of the ground's forces |
//! | `/com` | `foxglove.PointInFrame` | every frame: centre of mass |
//!
//! Times begin at 0.

use super::{Figure, Posture, nanoseconds, timestamp};
use crate::bodies::WORLD;
use foxglove::messages::{FrameTransforms, JointStates, Point3, Point3InFrame, SceneUpdate};
use foxglove::{ChannelBuilder, Context, FoxgloveError, McapWriteOptions, PartialMetadata};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use rollwalk_planner::export::Rate;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::sample::PlanSpline;
use rollwalk_planner::whole_body::WholeBody;
use std::io::Cursor;
use thiserror::Error;

/// The colour of a plan's robot.
const PLANNED: [f64; 4] = [0.36, 0.53, 0.78, 1.0];

/// A recording that could not be made.
#[derive(Debug, Error)]
#[error("cannot make the recording: {0}")]
pub struct RecordingError(#[from] FoxgloveError);

/// A plan as an MCAP file, from its beginning to its end.
///
/// # Errors
/// The library's, of which none is known for a validated plan.
pub fn recording(plan: &Plan, rate: Rate) -> Result<Vec<u8>, RecordingError> {
    let context = Context::new();
    // Chunks are compressed by nothing: a plan is small, and every reader can.
    let options = McapWriteOptions::new().compression(None);
    let writer = context.mcap_writer_with_options(options).create(Cursor::new(Vec::new()))?;
    let build = |topic: &str| ChannelBuilder::new(topic).context(&context);
    let frames = build("/tf").build::<FrameTransforms>();
    let solids = build("/robot").build::<SceneUpdate>();
    let joints = build("/joint_states").build::<JointStates>();
    let forces = build("/forces").build::<SceneUpdate>();
    let com = build("/com").build::<Point3InFrame>();

    let figure = Figure::new(&plan.robot, &[], "", PLANNED);
    let (spline, mut whole) = (PlanSpline::new(plan), WholeBody::new(plan));
    for (number, time_s) in rate.times_s(plan.motion.duration_s).enumerate() {
        let at = PartialMetadata::with_log_time(nanoseconds(time_s));
        let sample = spline.sample(time_s);
        let [w, x, y, z] = sample.base_orientation_wxyz;
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        let [x, y, z] = sample.base_position_m;
        let posture = Posture {
            world_from_body: Isometry3::from_parts(Translation3::new(x, y, z), turn),
            joint_rad: &sample.joint_rad,
            wheel_rad: &spline.motor_angles_rad(time_s),
        };
        let (setpoints, torque_nm) = whole.setpoints(time_s);
        let speeds = [setpoints.joint_speed_rad_s, setpoints.motor_speed_rad_s].concat();
        let feet = sample.end_effectors.iter().map(|foot| (foot.position_m, foot.force_n));
        let feet: Vec<_> = feet.collect();
        let [x, y, z] = sample.com_m;
        let point = Point3InFrame {
            timestamp: Some(timestamp(time_s)),
            frame_id: WORLD.to_owned(),
            point: Some(Point3 { x, y, z }),
        };
        frames.log_with_meta(&figure.transforms(&posture, time_s), at);
        if number == 0 {
            solids.log_with_meta(&figure.solids(time_s), at);
        }
        joints.log_with_meta(&figure.joint_states(&posture, &speeds, &torque_nm, time_s), at);
        forces.log_with_meta(&figure.forces(&feet, time_s), at);
        com.log_with_meta(&point, at);
    }
    Ok(writer.close()?.into_inner())
}
