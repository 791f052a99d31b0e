//! Whole simulated robot in real time. Only its link leaves the process.

use super::clock::Clock;
use super::{FrameQueue, Reopen, RobotBus};
use crate::interface::{Interface, LogEntry};
use crate::rig::Rig;
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_bus::port::{Event, Hub, Port};
use std::time::{Duration, Instant};

/// Maximum lag of the simulation behind real time while no frame arrives.
const STEP: Duration = Duration::from_millis(1);

/// Maximum number of the host's frames that wait for the link. On a busy bus a host has to wait, but loses no frame. A host
/// sends up to ten set-points for each of 64 channels at once.
const MOST_INWARD: usize = 1024;

/// Runs the robot until `goes_on` returns `false`. `goes_on` is called at least once a millisecond, with the frames of all
/// buses since the previous call.
///
/// # Errors
/// Returns an error if the controller is out of reach, which cannot happen to a controller in this process.
pub fn run(
    rig: &mut Rig,
    port: Port,
    keeper: &mut dyn Reopen,
    mut goes_on: impl FnMut(&mut Rig, &[LogEntry]) -> bool,
) -> Result<(), LinkError> {
    let mut clock = Clock::new(rig.now(), Instant::now());
    let (mut hub, mut link) = (Hub::new([port]), RobotBus::new(Interface::Link, 0));
    // Frames that wait, by direction, because the next bus has no room for them.
    let (mut inward, mut outward) = (FrameQueue::default(), FrameQueue::default());
    loop {
        let now = clock.read(Instant::now());
        rig.run_until(now);
        while let Some(frame) = inward.0.front()
            && rig.send(frame).is_ok()
        {
            inward.0.pop_front();
        }
        while let Some(frame) = rig.receive(now.as_us())? {
            outward.push(frame);
        }
        if !link.is_there(&mut hub, keeper) {
            outward = FrameQueue::default();
        } else if let Err(error) = outward.send(hub.outlets[0].as_mut()) {
            link.lose(&mut hub, keeper, &error);
        }
        let log = rig.take_log();
        if !goes_on(rig, &log) {
            return Ok(());
        }
        let mut deadline = Instant::now() + STEP;
        while let Some((_, heard)) = hub.next_event(deadline) {
            match heard {
                Ok(Event::Frame(frame)) if frame.standard_id().is_some() => {
                    inward.push_within(frame, MOST_INWARD);
                }
                Ok(_) => {}
                Err(error) => link.lose(&mut hub, keeper, &error),
            }
            // Takes the other frames that have arrived, without waiting.
            deadline = Instant::now();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::config::MAX_CHANNELS;
    use rollwalk_protocol::wire::{Node, Setpoint};

    #[test]
    fn setpoints_that_come_at_once_all_wait() {
        let mut inward = FrameQueue::default();
        let of =
            |frame, channel| Setpoint { frame, channel, stiff: false, value: 0.0, torque_nm: 0.0 };
        for frame in 0..10 {
            for channel in 0..MAX_CHANNELS as u8 {
                let setpoint = of(frame, channel).encode(Node::new(1).unwrap());
                inward.push_within(setpoint, MOST_INWARD);
            }
        }
        assert_eq!(inward.0.len(), 10 * MAX_CHANNELS);
    }
}
