//! States of a robot's joints and wheels over time, from the frames of its link: measured, and as planned by the library that
//! it plays.

use crate::catalog::Catalog;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::{ChannelKind, RobotConfig};
use rollwalk_protocol::library::{ClipCursor, ClipId, Library};
use rollwalk_protocol::wire::{FromController, JointTelemetry, Node, State, Status, Torque};
use std::collections::BTreeMap;

/// Additional knowledge of the robot, which frames do not contain.
#[derive(Clone, Copy)]
pub struct RobotContext<'a> {
    /// Names of the robot's channels.
    pub catalog: &'a Catalog,
    /// Library that the controller plays, and configuration of its robot; planned values require both.
    pub library: Option<(Library<'a>, &'a RobotConfig)>,
}

/// State of a joint or driven wheel at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Channel number.
    pub channel: u8,
    /// Name of the joint, or `channel_N` if the name is unknown.
    pub name: String,
    /// Angle, rad.
    pub position_rad: Option<f64>,
    /// Speed, rad/s.
    pub speed_rad_s: Option<f64>,
    /// Torque, N·m.
    pub torque_nm: Option<f64>,
}

/// States of all joints and driven wheels at one time, by channel.
#[derive(Clone, Debug, PartialEq)]
pub enum Joints {
    /// Measured states, each time that all channels have reported.
    Measured(Vec<Joint>),
    /// Planned states, at every status while a known library is played.
    Planned(Vec<Joint>),
}

/// Extracts states of joints from frames.
pub struct Reader<'a> {
    node: Node,
    known: Option<RobotContext<'a>>,
    /// Latest telemetry of each channel.
    measured: BTreeMap<u8, JointTelemetry>,
    last_channel: Option<u8>,
}

impl<'a> Reader<'a> {
    /// Creates a reader for controller `node`.
    pub fn new(node: Node, known: Option<RobotContext<'a>>) -> Self {
        Self { node, known, measured: BTreeMap::new(), last_channel: None }
    }

    /// Processes a frame of the link. Returns the states that it completes.
    pub fn on_frame(&mut self, frame: &Frame) -> Option<Joints> {
        match FromController::decode(frame).ok()? {
            (node, FromController::JointTelemetry(joint)) if node == self.node => {
                self.on_joint(joint).map(Joints::Measured)
            }
            (node, FromController::Status(status)) if node == self.node => {
                self.on_status(&status).map(Joints::Planned)
            }
            _ => None,
        }
    }

    /// Records the telemetry of a channel. Returns the states of all channels when a new round of the channels begins.
    fn on_joint(&mut self, joint: JointTelemetry) -> Option<Vec<Joint>> {
        let is_round = self.last_channel.is_some_and(|last| joint.channel <= last);
        let joints = is_round.then(|| {
            let joint = |(&channel, joint): (&u8, &JointTelemetry)| Joint {
                channel,
                name: self.channel_name(channel),
                position_rad: Some(joint.position_rad.into()),
                speed_rad_s: Some(joint.velocity_rad_s.into()),
                torque_nm: Some(joint.torque_nm.into()),
            };
            self.measured.iter().map(joint).collect()
        });
        self.last_channel = Some(joint.channel);
        self.measured.insert(joint.channel, joint);
        joints
    }

    fn on_status(&self, status: &Status) -> Option<Vec<Joint>> {
        let plays = status.state != State::Aligning && status.state.torque() == Torque::Driven;
        let clip = status.clip.filter(|_| plays)?;
        let (library, config) = self.known.as_ref()?.library.as_ref()?;
        let mut values = vec![0.0; library.channel_count()];
        // If the library is not the controller's, it may lack this frame.
        ClipCursor::new(library, ClipId(clip), status.frame)
            .and_then(|cursor| cursor.frame_into(library, &mut values))
            .ok()?;
        let joints = (0..).zip(&config.channels).zip(values).map(|((channel, kind), value)| {
            let value = Some(f64::from(value));
            let (position_rad, speed_rad_s) = match kind.kind {
                ChannelKind::JointPosition => (value, None),
                ChannelKind::WheelSpeed => (None, value),
            };
            let name = self.channel_name(channel);
            Joint { channel, name, position_rad, speed_rad_s, torque_nm: None }
        });
        Some(joints.collect())
    }

    /// Name of a channel, or `channel_N` if it is unknown.
    pub fn channel_name(&self, channel: u8) -> String {
        let names = self.known.as_ref().map(|known| &known.catalog.channels);
        let name = names.and_then(|names| names.get(usize::from(channel)));
        name.cloned().unwrap_or_else(|| format!("channel_{channel}"))
    }
}
