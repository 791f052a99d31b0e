//! A server of Foxglove's live protocol on loopback: <https://docs.foxglove.dev/docs/visualization/connecting/live-data>.
//!
//! It only tells: clients can neither command nor change anything.

use foxglove::messages::{FrameTransforms, JointStates, SceneUpdate};
use foxglove::{Channel, ChannelBuilder, Context, FoxgloveError, WebSocketServerHandle};
use std::sync::Arc;
use thiserror::Error;

/// The address that other computers cannot reach.
const LOOPBACK: &str = "127.0.0.1";

/// A server that could not be started.
#[derive(Debug, Error)]
#[error("cannot serve Foxglove on {LOOPBACK}:{port}: {why}")]
pub struct LiveError {
    port: u16,
    why: FoxgloveError,
}

/// A server with the topics of a robot.
pub struct Live {
    server: WebSocketServerHandle,
    /// Frames of all robots.
    pub frames: Channel<FrameTransforms>,
    /// Solids, to be sent again from time to time: clients come at any time.
    pub robot: Channel<SceneUpdate>,
    /// Joints as they are measured.
    pub measured: Channel<JointStates>,
    /// Joints as they are planned or commanded.
    pub planned: Channel<JointStates>,
    /// Forces of the ground.
    pub forces: Channel<SceneUpdate>,
    _context: Arc<Context>,
}

impl Live {
    /// Starts a server of a robot on a port of loopback; port 0 is any that is free.
    ///
    /// # Errors
    /// The port is taken.
    pub fn start(robot: &str, port: u16) -> Result<Self, LiveError> {
        let context = Context::new();
        let build = |topic: &str| ChannelBuilder::new(topic).context(&context);
        let (frames, solids) = (build("/tf").build(), build("/robot").build());
        let (measured, planned) =
            (build("/joint_states").build(), build("/planned_joint_states").build());
        let forces = build("/forces").build();
        let server = context.websocket_server().name(robot).bind(LOOPBACK, port).start_blocking();
        let server = server.map_err(|why| LiveError { port, why })?;
        Ok(Self { server, frames, robot: solids, measured, planned, forces, _context: context })
    }

    /// What clients connect to.
    pub fn address(&self) -> String {
        format!("ws://{LOOPBACK}:{}", self.server.port())
    }

    /// Whether a program is connected.
    pub fn has_clients(&self) -> bool {
        self.server.client_count() > 0
    }
}
