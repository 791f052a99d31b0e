//! The firmware as a process on real buses: link and actuator buses with adapters, as on a board.

use super::{Kept, Reopen};
use crate::core::{Core, Local};
use crate::interface::Interface;
use rollwalk_bus::link::LinkError;
use rollwalk_bus::port::{Heard, Hub, Port};
use rollwalk_protocol::can::{AnyFrame, CanFrame};
use rollwalk_protocol::serial::BusState;
use rollwalk_protocol::tunnel::{Buses, Input, MAX_ACTUATOR_BUSES, Step, Stepped};
use std::time::{Duration, Instant};

/// Runs the controller until `goes_on` says no, which is asked once in every control period of `period`.
/// `actuators` are the actuator buses by number.
///
/// Neither a link nor an actuator bus that goes ends it: without its host the controller brings the robot home,
/// and an actuator bus that is gone is one that is off, which is opened again when an operator has cleared that.
///
/// # Errors
/// None: the controller is in this process.
pub fn run(
    core: &mut Local,
    period: Duration,
    port: Port,
    keeper: &mut dyn Reopen,
    actuators: Vec<Port>,
    mut goes_on: impl FnMut(&mut Local) -> bool,
) -> Result<(), LinkError> {
    assert!(actuators.len() <= usize::from(MAX_ACTUATOR_BUSES), "a controller has so many at most");
    let start = Instant::now();
    let mut hub = Hub::new(std::iter::once(port).chain(actuators));
    let mut link = Kept::new(Interface::Link, 0);
    let mut buses: Vec<_> = (1..hub.outlets.len())
        .map(|index| Kept::new(Interface::Actuator((index - 1) as u8), index))
        .collect();
    let mut next_tick = start;
    loop {
        // Time goes before frames: no bus is so full that it keeps the controller from its ticks.
        let is_due = Instant::now() >= next_tick;
        let heard = if is_due { None } else { hub.hear(next_tick) };
        let now_us = start.elapsed().as_micros() as u64;
        let input = match heard {
            None => {
                // After a stall one tick is late, and none is made up for.
                next_tick = (next_tick + period).max(Instant::now());
                if !goes_on(core) {
                    return Ok(());
                }
                for (number, bus) in (0..).zip(&mut buses) {
                    let is_cleared = core.controller_mut().take_bus_restart(number);
                    if bus.is_gone() && !(is_cleared && bus.reopen(&mut hub, keeper)) {
                        core.controller_mut().on_bus_state(now_us, number, BusState::Off);
                    }
                }
                Some(Input::Tick)
            }
            Some((0, heard)) => match heard {
                Ok(Heard::Frame(AnyFrame::Standard(frame))) => Some(Input::Link(frame)),
                Ok(_) => None,
                Err(error) => {
                    link.lose(&mut hub, keeper, &error);
                    None
                }
            },
            Some((index, heard)) => {
                let bus = (index - 1) as u8;
                match heard {
                    Ok(Heard::Frame(AnyFrame::Standard(frame))) => {
                        Some(Input::Actuator(bus, frame))
                    }
                    Ok(Heard::Frame(AnyFrame::Extended(frame))) => {
                        core.controller_mut().on_extended_frame(now_us, bus, &frame);
                        None
                    }
                    Ok(Heard::State(state)) => {
                        core.controller_mut().on_bus_state(now_us, bus, state);
                        None
                    }
                    Ok(Heard::Sent | Heard::Report(_) | Heard::Message(..)) => None,
                    Err(error) => {
                        buses[index - 1].lose(&mut hub, keeper, &error);
                        core.controller_mut().on_bus_state(now_us, bus, BusState::Off);
                        None
                    }
                }
            }
        };
        let has_link = link.is_there(&mut hub, keeper);
        let mut sent = core.step(Step { now_us, input, free: free(&hub, has_link) })?;
        loop {
            let (any, link_is) = send(&mut hub, core, &sent);
            if let Err(error) = link_is {
                link.lose(&mut hub, keeper, &error);
            }
            if !any {
                break;
            }
            sent = core.step(Step { now_us, input: None, free: free(&hub, has_link) })?;
        }
    }
}

/// Buses that would take a frame.
fn free(hub: &Hub, has_link: bool) -> Buses {
    let mut free = Buses::default();
    for (index, _) in hub.outlets.iter().enumerate().filter(|(_, outlet)| outlet.is_free()) {
        free = match index {
            0 if !has_link => free,
            0 => free.with_link(),
            _ => free.with_actuator((index - 1) as u8),
        };
    }
    free
}

/// Sends what the controller has for each bus; whether it had anything, and how the link is.
fn send(hub: &mut Hub, core: &mut Local, stepped: &Stepped) -> (bool, Result<(), LinkError>) {
    let mut any = false;
    let mut link = Ok(());
    if let Some(frame) = &stepped.link {
        any = true;
        link = match put(hub, 0, frame) {
            Err(LinkError::Busy) => Ok(()),
            put => put,
        };
    }
    for (bus, frame) in stepped.actuators.iter().enumerate() {
        if let Some(frame) = frame {
            any = true;
            // A bus that is gone says so itself, to whoever listens to it.
            let _ = put(hub, 1 + bus, frame);
        }
        if bus + 1 < hub.outlets.len() && hub.outlets[1 + bus].is_free() {
            let extended = core.controller_mut().poll_extended(bus as u8);
            if let Some(frame) = extended {
                any = true;
                let _ = hub.outlets[1 + bus].send(&frame.into());
            }
        }
    }
    (any, link)
}

fn put(hub: &mut Hub, outlet: usize, frame: &CanFrame) -> Result<(), LinkError> {
    hub.outlets.get_mut(outlet).map_or(Ok(()), |outlet| outlet.send(&(*frame).into()))
}
