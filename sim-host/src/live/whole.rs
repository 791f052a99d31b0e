//! Whole simulated robot in real time, of which only the link leaves the process.

use super::{FrameQueue, Reopen, RobotBus};
use crate::clock::SimTime;
use crate::interface::{Interface, LogEntry};
use crate::rig::Rig;
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_bus::port::{Event, Hub, Port};
use std::time::{Duration, Instant};

/// Maximum lag of the simulation behind real time while no frame arrives.
const STEP: Duration = Duration::from_millis(1);
/// Maximum lag that the simulation catches up with, µs. If the computer is busy for longer, the robot's time stops as well.
/// Otherwise the robot would time out its host before it reads the frames that the host sent meanwhile.
const MOST_LAG_US: u64 = 20_000;

/// Maximum number of the host's frames that wait for the link. On a busy bus a host has to wait, but loses no frame. A host
/// sends up to ten set-points for each of 64 channels at once.
const MOST_INWARD: usize = 1024;

/// Time of the robot, which follows the computer's.
struct Clock {
    now_us: u64,
    /// Time of the computer since the start, µs.
    elapsed_us: u64,
}

impl Clock {
    /// Time of the robot when the computer's clock shows `elapsed_us` since the start.
    fn now_us(&mut self, elapsed_us: u64) -> u64 {
        let since_us = elapsed_us.saturating_sub(self.elapsed_us);
        self.elapsed_us = elapsed_us;
        self.now_us += since_us.min(MOST_LAG_US);
        self.now_us
    }
}

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
    let start = Instant::now();
    let mut clock = Clock { now_us: rig.now_us(), elapsed_us: 0 };
    let (mut hub, mut link) = (Hub::new([port]), RobotBus::new(Interface::Link, 0));
    // Frames that wait, by direction, because the next bus has no room for them.
    let (mut inward, mut outward) = (FrameQueue::default(), FrameQueue::default());
    loop {
        let now_us = clock.now_us(start.elapsed().as_micros() as u64);
        rig.run_until(SimTime::from_us(now_us));
        while let Some(frame) = inward.0.front()
            && rig.send(frame).is_ok()
        {
            inward.0.pop_front();
        }
        while let Some(frame) = rig.receive(now_us)? {
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

    #[test]
    fn a_computer_that_stands_still_halts_the_robot() {
        let mut clock = Clock { now_us: 5_000, elapsed_us: 0 };
        assert_eq!(clock.now_us(1_000), 6_000);
        assert_eq!(clock.now_us(20_000), 25_000);
        // Two seconds without a poll.
        assert_eq!(clock.now_us(2_020_000), 25_000 + MOST_LAG_US);
        assert_eq!(clock.now_us(2_021_000), 26_000 + MOST_LAG_US);
    }
}
