//! Firmware as a process on real buses: its link and actuator buses have adapters, as on a board.

use super::{Reopen, RobotBus};
use crate::core::{Core, LocalController};
use crate::interface::Interface;
use rollwalk_bus::link::LinkError;
use rollwalk_bus::port::{Event, Hub, Port};
use rollwalk_protocol::actuators::traffic::MAX_LOAD;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::serial::BusState;
use rollwalk_protocol::tunnel::{Buses, Input, MAX_ACTUATOR_BUSES, Step, StepResult};
use rollwalk_protocol::wire::Torque;
use std::iter;
use std::time::{Duration, Instant};

/// Runs the controller until `goes_on` returns `false`. `goes_on` is called once in every control period, which lasts `period`.
/// `actuators` contains the actuator buses by number.
///
/// A run that ends with torque on stops the robot first: its drives receive the order to switch torque off for
/// [`OFF_PERIODS`]. Drives without a watchdog would keep their last set-points.
///
/// The loss of a bus does not end the run. Without the link the controller returns the robot to SAFE. A lost actuator bus
/// counts as bus-off, and is reopened after an operator has cleared that fault.
///
/// # Errors
/// Returns no error, since the controller runs in this process.
pub fn run(
    core: &mut LocalController,
    period: Duration,
    port: Port,
    keeper: &mut dyn Reopen,
    actuators: Vec<Port>,
    mut goes_on: impl FnMut(&mut LocalController) -> bool,
) -> Result<(), LinkError> {
    let start = Instant::now();
    let mut board = Board::new(core, port, keeper, actuators);
    let mut next_tick = start;
    let mut periods_left = None;
    loop {
        // A due tick comes before further frames, so that a full bus does not delay it. Frames that have already arrived are
        // processed first.
        let is_due = Instant::now() >= next_tick;
        if is_due {
            board.catch_up(start)?;
        }
        let heard = if is_due { None } else { board.hub.next_event(next_tick) };
        let now_us = start.elapsed().as_micros() as u64;
        let input = match heard {
            Some((index, heard)) => board.handle_event(now_us, index, heard),
            None => {
                // After a stall, one tick is late. Missed ticks are not repeated, and the next tick leaves time for answers of
                // servos on serial lines.
                next_tick = (next_tick + period).max(Instant::now() + period.mul_f32(MAX_LOAD));
                match &mut periods_left {
                    Some(0) => return Ok(()),
                    Some(left) => *left -= 1,
                    None if goes_on(board.core) => {}
                    None if board.core.controller_mut().state().torque() == Torque::Off => {
                        return Ok(());
                    }
                    None => {
                        board.core.controller_mut().estop(now_us);
                        periods_left = Some(OFF_PERIODS);
                    }
                }
                board.watch_actuator_buses(now_us);
                Some(Input::Tick)
            }
        };
        board.step(now_us, input)?;
    }
}

/// Control periods between an emergency stop and the end of a run: a quarter of a second at 120 Hz. Every drive of a full serial
/// line receives the order several times meanwhile. Not measured on hardware.
const OFF_PERIODS: u32 = 30;

/// Maximum number of events that are processed between the due time of a tick and the tick.
const CATCH_UP: usize = 64;

/// Controller with its buses.
struct Board<'a> {
    core: &'a mut LocalController,
    keeper: &'a mut dyn Reopen,
    hub: Hub,
    /// Buses by port of the hub: first the link, then the actuator buses.
    buses: Vec<Bus>,
}

struct Bus {
    kept: RobotBus,
    /// Previous reported state.
    state: BusState,
}

/// Number of a port's actuator bus; `None` for the link.
fn number(index: usize) -> Option<u8> {
    index.checked_sub(1).map(|number| number as u8)
}

impl<'a> Board<'a> {
    fn new(
        core: &'a mut LocalController,
        link: Port,
        keeper: &'a mut dyn Reopen,
        actuators: Vec<Port>,
    ) -> Self {
        let most = usize::from(MAX_ACTUATOR_BUSES);
        assert!(actuators.len() <= most, "at most as many as a controller supports");
        let hub = Hub::new(iter::once(link).chain(actuators));
        let bus = |index| {
            let interface = number(index).map_or(Interface::Link, Interface::Actuator);
            Bus { kept: RobotBus::new(interface, index), state: BusState::Active }
        };
        let buses = (0..hub.outlets.len()).map(bus).collect();
        Self { core, keeper, hub, buses }
    }

    /// Processes an event of a bus. Returns the controller's input, if any.
    fn handle_event(
        &mut self,
        now_us: u64,
        index: usize,
        heard: Result<Event, LinkError>,
    ) -> Option<Input> {
        let heard = match heard {
            Ok(heard) => heard,
            Err(error) => {
                self.lose(now_us, index, &error);
                return None;
            }
        };
        let Some(bus) = number(index) else {
            let Event::Frame(frame) = heard else { return None };
            return Some(Input::Link(frame));
        };
        match heard {
            Event::Frame(frame) => return Some(Input::Actuator(bus, frame)),
            Event::State(state) => {
                self.buses[index].state = state;
                self.core.controller_mut().on_bus_state(now_us, bus, state);
            }
            Event::Bytes(bytes) => self.core.controller_mut().on_serial(now_us, bus, &bytes),
            Event::Sent | Event::Report(_) | Event::Message(..) => {}
        }
        None
    }

    /// Processes events that arrived while this computer was busy.
    fn catch_up(&mut self, start: Instant) -> Result<(), LinkError> {
        for _ in 0..CATCH_UP {
            let Some((index, heard)) = self.hub.next_event(Instant::now()) else { return Ok(()) };
            let now_us = start.elapsed().as_micros() as u64;
            let input = self.handle_event(now_us, index, heard);
            self.step(now_us, input)?;
        }
        Ok(())
    }

    /// Reports the state of the actuator buses to the controller; called in every control period. When an operator clears a
    /// bus-off, the controller assumes a healthy bus until the next report. A lost bus is then reopened.
    fn watch_actuator_buses(&mut self, now_us: u64) {
        let buses = self.buses.iter_mut().enumerate();
        for (number, bus) in buses.filter_map(|(index, bus)| Some((number(index)?, bus))) {
            let controller = self.core.controller_mut();
            let is_cleared = controller.take_bus_restart(number);
            if is_cleared && bus.kept.is_gone() && bus.kept.reopen(&mut self.hub, self.keeper) {
                bus.state = BusState::Active;
            }
            controller.on_bus_state(now_us, number, bus.state);
        }
    }

    /// Passes an input to the controller and sends its frames on the buses that are ready.
    fn step(&mut self, now_us: u64, mut input: Option<Input>) -> Result<(), LinkError> {
        // A lost link is opened again periodically, without an operator.
        self.buses[0].kept.is_there(&mut self.hub, self.keeper);
        loop {
            let step = Step { now_us, input: input.take(), free: self.free() };
            let stepped = self.core.step(step)?;
            let frames = self.send(now_us, &stepped);
            if !self.send_packets(now_us) && !frames {
                return Ok(());
            }
        }
    }

    /// Buses that can accept a frame, without lost ones.
    fn free(&self) -> Buses {
        let outlets = self.hub.outlets.iter().enumerate();
        let outlets = outlets.filter(|(_, outlet)| outlet.is_free() && !outlet.carries_bytes());
        outlets.fold(Buses::default(), |free, (index, _)| match number(index) {
            None => free.with_link(),
            Some(number) => free.with_actuator(number),
        })
    }

    /// Sends the controller's frame for each bus. Returns true if there was any.
    fn send(&mut self, now_us: u64, stepped: &StepResult) -> bool {
        let mut any = false;
        for (index, frame) in iter::once(&stepped.link).chain(&stepped.actuators).enumerate() {
            if let Some(frame) = frame {
                any = true;
                self.put(now_us, index, frame);
            }
        }
        any
    }

    fn put(&mut self, now_us: u64, index: usize, frame: &Frame) {
        let Some(outlet) = self.hub.outlets.get_mut(index) else { return };
        match outlet.send(frame) {
            Ok(()) | Err(LinkError::Busy) => {}
            Err(error) => self.lose(now_us, index, &error),
        }
    }

    /// Sends the controller's next packet on each serial line. Returns true if there was any.
    fn send_packets(&mut self, now_us: u64) -> bool {
        let mut any = false;
        for index in 0..self.hub.outlets.len() {
            let outlet = &mut self.hub.outlets[index];
            let Some(bus) = number(index).filter(|_| outlet.carries_bytes() && outlet.is_free())
            else {
                continue;
            };
            let Some(packet) = self.core.controller_mut().poll_serial(bus) else { continue };
            any = true;
            match outlet.send_bytes(&packet) {
                Ok(()) | Err(LinkError::Busy) => {}
                Err(error) => self.lose(now_us, index, &error),
            }
        }
        any
    }

    /// Handles the loss of a bus.
    fn lose(&mut self, now_us: u64, index: usize, error: &LinkError) {
        let bus = &mut self.buses[index];
        bus.kept.lose(&mut self.hub, self.keeper, error);
        if let Some(number) = number(index) {
            bus.state = BusState::Off;
            self.core.controller_mut().on_bus_state(now_us, number, BusState::Off);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::one_leg;
    use rollwalk_bus::port::{Inlet, Outlet};
    use rollwalk_firmware::Settings;
    use rollwalk_protocol::can::Frame;
    use rollwalk_protocol::faults::Fault;
    use rollwalk_protocol::wire::{
        Action, Command, CommandAck, CommandResult, FromController, Node, State,
    };
    use std::sync::mpsc::{Receiver, Sender, channel};
    use std::thread;

    /// Outlet that passes frames to the test.
    struct TestOutlet(Sender<Frame>);

    impl Outlet for TestOutlet {
        fn is_free(&self) -> bool {
            true
        }

        fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
            self.0.send(*frame).map_err(|_| LinkError::Down("it takes nothing any more".into()))
        }
    }

    /// Receives only frames that the test injects.
    struct TestInlet;

    impl Inlet for TestInlet {
        fn next_event(&mut self) -> Result<Option<Event>, LinkError> {
            thread::sleep(Duration::from_millis(10));
            Ok(None)
        }
    }

    /// Bus with the receiver of its frames. Once the receiver is dropped, the bus accepts no frame.
    fn bus() -> (Port, Receiver<Frame>) {
        let (to, sent) = channel();
        (Port { outlet: Box::new(TestOutlet(to)), inlet: Box::new(TestInlet) }, sent)
    }

    /// Records lost buses, and reopens none of them.
    #[derive(Default)]
    struct LossRecord(Vec<Interface>);

    impl Reopen for LossRecord {
        fn lost(&mut self, bus: Interface, _why: &LinkError) {
            self.0.push(bus);
        }

        fn reopen(&mut self, _bus: Interface) -> Option<Port> {
            None
        }
    }

    fn core() -> LocalController {
        LocalController::new(
            one_leg::config(),
            one_leg::robot().controller_buses(),
            Settings::default(),
        )
    }

    /// Runs control periods from `now_us` on, and returns the time at which they end.
    fn periods(board: &mut Board<'_>, now_us: u64, count: u64) -> u64 {
        for k in 0..count {
            board.watch_actuator_buses(now_us + 10_000 * k);
            board.step(now_us + 10_000 * k, Some(Input::Tick)).unwrap();
        }
        now_us + 10_000 * count
    }

    /// Sends a command and returns its acknowledgement.
    fn command(
        board: &mut Board<'_>,
        link: &Receiver<Frame>,
        now_us: u64,
        (seq, action): (u8, Action),
    ) -> CommandAck {
        let valid_until_ms = (now_us / 1000) as u16 + 500;
        let frame = Command { seq, action, valid_until_ms }.encode(Node::new(1).unwrap());
        board.step(now_us, Some(Input::Link(frame))).unwrap();
        let acks = link.try_iter().filter_map(|frame| match FromController::decode(&frame) {
            Ok((_, FromController::CommandAck(ack))) => Some(ack),
            _ => None,
        });
        let ack = acks.last().unwrap();
        assert_eq!((ack.seq, ack.result), (seq, CommandResult::Ok));
        ack
    }

    #[test]
    fn an_actuator_bus_that_takes_nothing_any_more_is_lost() {
        let ((link, _host), (first, _motors), (second, gone)) = (bus(), bus(), bus());
        let (mut core, mut lost) = (core(), LossRecord::default());
        let mut board = Board::new(&mut core, link, &mut lost, vec![first, second]);
        let now_us = periods(&mut board, 0, 10);
        assert!(!board.core.controller_mut().faults().contains(Fault::BusOff));
        drop(gone);
        periods(&mut board, now_us, 100);
        assert!(board.core.controller_mut().faults().contains(Fault::BusOff));
        drop(board);
        assert_eq!(lost.0, [Interface::Actuator(1)]);
    }

    #[test]
    fn to_clear_a_bus_that_is_off_does_not_make_it_well() {
        let ((link, host), (first, _motors), (second, _more)) = (bus(), bus(), bus());
        let (mut core, mut lost) = (core(), LossRecord::default());
        let mut board = Board::new(&mut core, link, &mut lost, vec![first, second]);
        let mut now_us = periods(&mut board, 0, 10);
        assert_eq!(board.core.controller_mut().state(), State::Disarmed);
        board.handle_event(now_us, 2, Ok(Event::State(BusState::Off)));
        for (state, seq) in [(State::EStopped, 1), (State::Disarmed, 3)] {
            now_us = periods(&mut board, now_us, 10);
            assert_eq!(board.core.controller_mut().state(), State::EStopped);
            let ack = command(&mut board, &host, now_us, (seq, Action::ClearRequest));
            let confirm = Action::ClearConfirm { nonce: ack.value };
            command(&mut board, &host, now_us, (seq + 1, confirm));
            now_us = periods(&mut board, now_us, 10);
            let controller = board.core.controller_mut();
            assert_eq!(controller.state(), state);
            let is_off = controller.faults().contains(Fault::BusOff);
            assert_eq!(is_off, state == State::EStopped);
            // Before the second round the bus reports that it is active.
            board.handle_event(now_us, 2, Ok(Event::State(BusState::Active)));
        }
        drop(board);
        assert!(lost.0.is_empty(), "an interface that is off is still there");
    }
}
