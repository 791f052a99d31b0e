//! Motors of a robot as a process on real buses.

use super::{FrameQueue, Reopen, RobotBus};
use crate::body::Body;
use crate::clock::{Periodic, SimTime};
use crate::interface::Interface;
use crate::rig::{MOTOR_RATE_HZ, Observer};
use rollwalk_bus::link::LinkError;
use rollwalk_bus::port::{Event, Hub, Port};
use rollwalk_physics::StepError;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Interval between updates of weight and inertia on the joints.
const LOAD_PERIOD: Duration = Duration::from_millis(10);

/// Runs the motors on `buses`, which are ordered by number, until `goes_on` returns `false`. `goes_on` is called every few
/// milliseconds. The motors of a lost bus are silent until it is reopened. The observer receives every step of the motors.
///
/// # Errors
/// Returns an error if a step of the robot's world has no solution.
pub fn run(
    body: &mut Body,
    buses: Vec<Port>,
    keeper: &mut dyn Reopen,
    observer: &mut dyn Observer,
    mut goes_on: impl FnMut(&Body) -> bool,
) -> Result<(), StepError> {
    let start = Instant::now();
    let mut hub = Hub::new(buses);
    let mut waiting: Vec<_> = hub.outlets.iter().map(|_| FrameQueue::default()).collect();
    let mut lines: Vec<_> = hub.outlets.iter().map(|_| Vec::new()).collect();
    let mut kept: Vec<_> = (0..hub.outlets.len())
        .map(|index| RobotBus::new(Interface::Actuator(index as u8), index))
        .collect();
    let mut steps = Periodic::new(MOTOR_RATE_HZ);
    let mut next_load = start;
    loop {
        // Even a full bus does not delay the update of the load.
        let is_due = Instant::now() >= next_load;
        let timer = body.next_timer().map(|at| start + Duration::from_micros(at.as_us()));
        let heard = if is_due {
            None
        } else {
            hub.next_event(timer.map_or(next_load, |at| at.min(next_load)))
        };
        let now = SimTime::from_us(start.elapsed().as_micros() as u64);
        while steps.next() <= now {
            let at = steps.next();
            body.step(at, 1.0 / f64::from(MOTOR_RATE_HZ))?;
            observer.on_motor_step(at, body);
            steps.advance();
        }
        while let Some((channel, frame)) = body.on_timer(now) {
            waiting[usize::from(body.addresses()[channel].0)].push(frame);
        }
        match heard {
            None if !is_due => {}
            None => {
                next_load = Instant::now() + LOAD_PERIOD;
                body.update_loads();
                if !goes_on(body) {
                    return Ok(());
                }
            }
            Some((bus, Err(error))) => kept[bus].lose(&mut hub, keeper, &error),
            Some((bus, Ok(Event::Frame(frame)))) => {
                for channel in 0..body.addresses().len() {
                    if usize::from(body.addresses()[channel].0) == bus
                        && let Some(answer) = body.on_frame(channel, now, &frame)
                    {
                        waiting[bus].push(answer);
                    }
                }
            }
            Some((bus, Ok(Event::Bytes(bytes)))) => {
                lines[bus].extend(bytes);
                for answers in answers(body, bus, now, &mut lines[bus]) {
                    match hub.outlets[bus].send_bytes(&answers) {
                        Ok(()) | Err(LinkError::Busy) => {}
                        Err(error) => kept[bus].lose(&mut hub, keeper, &error),
                    }
                }
            }
            Some((_, Ok(_))) => {}
        }
        for (waiting, bus) in waiting.iter_mut().zip(&mut kept) {
            if !bus.is_there(&mut hub, keeper) {
                *waiting = FrameQueue::default();
            } else if let Err(error) = waiting.send(hub.outlets[bus.index].as_mut()) {
                bus.lose(&mut hub, keeper, &error);
            }
        }
    }
}

/// Answers of the servos of a serial line to each packet in the received bytes. The servos answer in turn, but without their
/// return delays, which are shorter than the latency of this computer. A servo that is not here is silent, and so are those after
/// it, as on [`SerialLine`](crate::line::SerialLine).
fn answers(body: &mut Body, bus: usize, now: SimTime, line: &mut Vec<u8>) -> Vec<Vec<u8>> {
    let channels = body.addresses().iter().enumerate();
    let channels = channels.filter(|(_, address)| usize::from(address.0) == bus);
    let channels: Vec<_> = channels.map(|(channel, _)| channel).collect();
    let mut all = Vec::new();
    let Some(&first) = channels.first() else { return all };
    while let Some(packet) = body.take_packet(first, line) {
        // Drives behind one adapter share one answer.
        let mut turns = BTreeMap::new();
        for &channel in &channels {
            let (_, answer) = body.on_packet(channel, now, &packet);
            turns.extend(answer.map(|answer| (answer.turn, answer)));
        }
        let in_turn = (0..).map_while(|turn| turns.get(&turn));
        let said = in_turn.fold(Vec::new(), |mut said, answer| {
            said.extend(answer.line_answer(&said));
            said
        });
        if !said.is_empty() {
            all.push(said);
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::one_leg;
    use rollwalk_protocol::actuators::Codec;
    use rollwalk_protocol::actuators::bus::{Bus, Protocol};
    use rollwalk_protocol::actuators::dynamixel::{Dynamixel, fast_sync_read, sync_read};

    /// Hip and wheel have IDs 1 and 2, and a servo with ID 9 is missing.
    #[test]
    fn servos_after_a_missing_one_do_not_answer() {
        let protocol = Protocol::Dynamixel(Dynamixel::EXAMPLES[0]);
        let mut robot = one_leg::robot();
        robot.buses.insert(0, Bus { protocol, ..Bus::default() });
        let mut body = Body::new(&robot);
        for read in [sync_read, fast_sync_read] {
            let mut said = |ids: &[u8]| {
                let mut line = read(126, 10, ids).unwrap().to_vec();
                answers(&mut body, 0, SimTime::ZERO, &mut line).concat()
            };
            let both = said(&[1, 2]);
            let first = said(&[1, 9, 2]);
            assert!(!first.is_empty() && first.len() < both.len(), "{first:?} {both:?}");
            assert_eq!(first.len(), said(&[1, 9]).len());
            assert!(said(&[9, 1, 2]).is_empty());
        }
    }
}
