//! Motors of a robot as a process on real buses.

use super::clock::Clock;
use super::{FrameQueue, Reopen, RobotBus};
use crate::body::Body;
use crate::clock::{Periodic, SimTime};
use crate::interface::Interface;
use crate::rig::{MOTOR_RATE_HZ, Observer};
use rollwalk_bus::link::LinkError;
use rollwalk_bus::port::{Event, Hub, Outlet, Port};
use rollwalk_physics::StepError;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Interval between updates of weight and inertia on the joints.
const LOAD_PERIOD: Duration = Duration::from_millis(10);
/// Maximum number of events that are processed at one time of the motors.
const MOST_EVENTS: usize = 64;

/// Runs the motors on `buses`, which are ordered by number, until `goes_on` returns `false`. `goes_on` is called about every 10
/// ms. The motors of a lost bus are silent until it is reopened. The observer receives every step of the motors.
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
    let mut clock = Clock::new(SimTime::ZERO, start);
    let mut hub = Hub::new(buses);
    let mut waiting: Vec<_> = hub.outlets.iter().map(|_| FrameQueue::default()).collect();
    let mut lines: Vec<_> = hub.outlets.iter().map(|_| Vec::new()).collect();
    let mut kept: Vec<_> = (0..hub.outlets.len())
        .map(|index| RobotBus::new(Interface::Actuator(index as u8), index))
        .collect();
    let mut steps = Periodic::new(MOTOR_RATE_HZ);
    let mut next_load = start;
    loop {
        let timer = body.next_timer().map_or(next_load, |at| clock.due(at).min(next_load));
        let mut heard = hub.next_event(timer);
        let now = clock.read(Instant::now());
        while steps.next() <= now {
            let at = steps.next();
            body.step(at, 1.0 / f64::from(MOTOR_RATE_HZ))?;
            observer.on_motor_step(at, body);
            steps.advance();
        }
        while let Some((channel, frame)) = body.on_timer(now) {
            waiting[usize::from(body.addresses()[channel].0)].push(frame);
        }
        // All events that have arrived, because motors that are slower than real time would otherwise fall behind their bus.
        let mut left = MOST_EVENTS;
        while let Some((bus, event)) = heard.take() {
            let outlet = hub.outlets[bus].as_mut();
            let handled =
                on_event(body, (bus, now), event, outlet, &mut lines[bus], &mut waiting[bus]);
            if let Err(error) = handled {
                kept[bus].lose(&mut hub, keeper, &error);
            }
            left -= 1;
            if left > 0 {
                heard = hub.next_event(Instant::now());
            }
        }
        for (waiting, bus) in waiting.iter_mut().zip(&mut kept) {
            if !bus.is_there(&mut hub, keeper) {
                *waiting = FrameQueue::default();
            } else if let Err(error) = waiting.send(hub.outlets[bus.index].as_mut()) {
                bus.lose(&mut hub, keeper, &error);
            }
        }
        // Even a full bus does not delay this.
        if Instant::now() >= next_load {
            next_load = Instant::now() + LOAD_PERIOD;
            body.update_loads();
            if !goes_on(body) {
                return Ok(());
            }
        }
    }
}

/// Passes an event of a bus to the motors on it. Queues their frames, and sends the answers of servos on a serial line. `line`
/// contains received bytes that are not a complete packet yet.
///
/// # Errors
/// Returns the reason why the bus is lost.
fn on_event(
    body: &mut Body,
    (bus, now): (usize, SimTime),
    event: Result<Event, LinkError>,
    outlet: &mut dyn Outlet,
    line: &mut Vec<u8>,
    waiting: &mut FrameQueue,
) -> Result<(), LinkError> {
    match event? {
        Event::Frame(frame) => {
            for channel in 0..body.addresses().len() {
                if usize::from(body.addresses()[channel].0) == bus
                    && let Some(answer) = body.on_frame(channel, now, &frame)
                {
                    waiting.push(answer);
                }
            }
        }
        Event::Bytes(bytes) => {
            line.extend(bytes);
            for answers in answers(body, bus, now, line) {
                match outlet.send_bytes(&answers) {
                    Ok(()) | Err(LinkError::Busy) => {}
                    Err(error) => return Err(error),
                }
            }
        }
        Event::Sent | Event::State(_) | Event::Message(..) | Event::Report(_) => {}
    }
    Ok(())
}

/// Answers of the servos of a serial line to each packet in the received bytes. The servos answer in turn, but without their
/// return delays, which are shorter than the latency of this computer. A servo that this process does not simulate is silent, and
/// so are the servos after it, as on [`SerialLine`](crate::line::SerialLine).
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
    use std::cell::Cell;
    use std::thread;

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

    /// Keeper of no buses.
    struct NoBuses;

    impl Reopen for NoBuses {
        fn lost(&mut self, _bus: Interface, _why: &LinkError) {}

        fn reopen(&mut self, _bus: Interface) -> Option<Port> {
            None
        }
    }

    /// Computer that stops the program for 0.2 s in the step at [`STOP`].
    struct BusyComputer<'a>(&'a Cell<SimTime>);

    const STOP: SimTime = SimTime::from_ms(10);

    impl Observer for BusyComputer<'_> {
        fn on_motor_step(&mut self, at: SimTime, _body: &Body) {
            self.0.set(at);
            if at == STOP {
                thread::sleep(Duration::from_millis(200));
            }
        }
    }

    /// Watchdogs of drives would otherwise expire before the motors read the set-points that arrived meanwhile.
    #[test]
    fn a_busy_computer_halts_the_motors() {
        let mut body = Body::new(&one_leg::robot());
        let (now, mut calls) = (Cell::new(SimTime::ZERO), 0);
        let goes_on = |_: &Body| {
            calls += u32::from(now.get() >= STOP);
            calls < 2
        };
        run(&mut body, Vec::new(), &mut NoBuses, &mut BusyComputer(&now), goes_on).unwrap();
        // Two readings of the clock since the stop, each of at most 20 ms.
        assert!(now.get() <= STOP + SimTime::from_ms(40), "{:?}", now.get());
    }
}
