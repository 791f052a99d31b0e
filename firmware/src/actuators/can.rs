//! CAN buses: sends the frames of a command in sequence.
//!
//! A command of several frames is not stored as frames: it is encoded again for each frame. Set-points are a single frame, so
//! they are encoded once.

use rollwalk_protocol::actuators::ActuatorCommand;
use rollwalk_protocol::actuators::bus::Protocol;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::RobotConfig;

use super::Actuators;
use super::driver::order;

impl Actuators {
    /// Returns the next frame for a bus, torque commands first.
    pub fn poll(&mut self, config: &RobotConfig, bus: u8) -> Option<Frame> {
        // Every iteration completes an order, or returns.
        loop {
            let driver = self.drivers.get_mut(usize::from(bus))?;
            // A board polls for frames far more often than frames exist.
            if driver.idle || driver.bus.protocol.is_serial() {
                return None;
            }
            let Some(transmission) = driver.due(&self.list) else {
                driver.idle = true;
                return None;
            };
            let channel = transmission.channels.trailing_zeros() as usize;
            let order =
                order(&self.list, config, &driver.bus, &driver.can, transmission.content, channel);
            let (frame, frames) = match order {
                Some(order) => nth(&driver.bus.protocol, &order, transmission.sent),
                None => (None, 0),
            };
            driver.frame_sent(&mut self.list, transmission, frames);
            if frame.is_some() {
                return frame;
            }
        }
    }
}

/// Returns frame `n` of a command, and its number of frames.
///
/// The number is zero if the protocol cannot carry the command.
fn nth(protocol: &Protocol, order: &ActuatorCommand, n: u8) -> (Option<Frame>, u8) {
    let (mut frame, mut count) = (None, 0u8);
    let result = protocol.emit(order, &mut |sent| {
        if count == n {
            frame = Some(sent);
        }
        count = count.saturating_add(1);
    });
    if result.is_ok() { (frame, count) } else { (None, 0) }
}
