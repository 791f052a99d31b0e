//! A plan as an MCAP file: <https://mcap.dev>.
//!
//! | topic | schema | when |
//! |---|---|---|
//! | `/tf` | `foxglove.FrameTransforms` | every frame |
//! | `/robot` | `foxglove.SceneUpdate` | once: solids of all bodies |
//! | `/joint_states` | `foxglove.JointStates` | every frame: joints and driven wheels, with speed and torque |
//! | `/forces` | `foxglove.SceneUpdate` | every frame: arrows of the ground's forces |
//! | `/com` | `foxglove.Point3InFrame` | every frame: centre of mass |
//!
//! Times begin at 0.

use super::figure::{Figure, Posture, nanoseconds, timestamp};
use super::messages::{FrameTransforms, JointStates, Point3, Point3InFrame, SceneUpdate, Schema};
use crate::bodies::WORLD;
use mcap::records::MessageHeader;
use mcap::{McapError, McapResult, WriteOptions, Writer};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use rollwalk_planner::export::Rate;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::sample::PlanSpline;
use rollwalk_planner::whole_body::WholeBody;
use std::collections::BTreeMap;
use std::io::Cursor;
use thiserror::Error;

/// Colour of the planned robot.
const PLANNED: [f64; 4] = [0.36, 0.53, 0.78, 1.0];

/// Failure to write a recording.
#[derive(Debug, Error)]
#[error("cannot write the recording: {0}")]
pub struct RecordingError(#[from] McapError);

/// Writes a plan as an MCAP file, from beginning to end.
///
/// # Errors
/// Errors of the MCAP library; no validated plan is known to cause one.
pub fn recording(plan: &Plan, rate: Rate) -> Result<Vec<u8>, RecordingError> {
    let mut file = File::new()?;
    let frames = file.topic::<FrameTransforms>("/tf")?;
    let solids = file.topic::<SceneUpdate>("/robot")?;
    let joints = file.topic::<JointStates>("/joint_states")?;
    let forces = file.topic::<SceneUpdate>("/forces")?;
    let com = file.topic::<Point3InFrame>("/com")?;

    let figure = Figure::new(&plan.robot, &[], "", PLANNED);
    let (spline, mut whole) = (PlanSpline::new(plan), WholeBody::new(plan));
    for (number, time_s) in rate.times_s(plan.motion.duration_s).enumerate() {
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
        let speeds: Vec<_> = setpoints.speeds_rad_s(&plan.robot).collect();
        let feet = sample.end_effectors.iter().map(|foot| (foot.position_m, foot.force_n));
        let feet: Vec<_> = feet.collect();
        let [x, y, z] = sample.com_m;
        let point = Point3InFrame {
            timestamp: timestamp(time_s),
            frame_id: WORLD.to_owned(),
            point: Point3 { x, y, z },
        };
        file.write(frames, &figure.transforms(&posture, time_s), time_s)?;
        if number == 0 {
            file.write(solids, &figure.solids(time_s), time_s)?;
        }
        let states = figure.joint_states(&posture, &speeds, &torque_nm, time_s);
        file.write(joints, &states, time_s)?;
        file.write(forces, &figure.forces(&feet, time_s), time_s)?;
        file.write(com, &point, time_s)?;
    }
    Ok(file.finish()?)
}

/// File in memory with JSON messages.
struct File {
    writer: Writer<Cursor<Vec<u8>>>,
    sequence: u32,
}

impl File {
    fn new() -> McapResult<Self> {
        let library = concat!("rollwalk ", env!("CARGO_PKG_VERSION"));
        // Without compression, because every reader can read that, and a plan is small.
        let options = WriteOptions::new().compression(None).library(library);
        Ok(Self { writer: options.create(Cursor::new(Vec::new()))?, sequence: 0 })
    }

    fn topic<M: Schema>(&mut self, topic: &str) -> McapResult<u16> {
        let schema = M::schema().to_string();
        let schema = self.writer.add_schema(M::NAME, "jsonschema", schema.as_bytes())?;
        self.writer.add_channel(schema, topic, "json", &BTreeMap::new())
    }

    fn write(&mut self, topic: u16, message: &impl Schema, time_s: f64) -> McapResult<()> {
        let data = serde_json::to_vec(message).unwrap_or_default();
        let log_time = nanoseconds(time_s);
        let header = MessageHeader {
            channel_id: topic,
            sequence: self.sequence,
            log_time,
            publish_time: log_time,
        };
        self.sequence += 1;
        self.writer.write_to_known_channel(&header, &data)
    }

    fn finish(mut self) -> McapResult<Vec<u8>> {
        self.writer.finish()?;
        Ok(self.writer.into_inner().into_inner())
    }
}
