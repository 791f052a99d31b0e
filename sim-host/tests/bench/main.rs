//! End-to-end tests of the simulated robot: a library is flashed over the bus and played by code.

mod agilebot;
mod authenticated;
mod flashing;
mod grounded;
mod large;
mod leaving;
mod operating;
mod playing;
mod protocols;
mod refusing;
mod serial_line;
mod servo_lines;
mod standing;
mod stopping;
mod transfer_time;
mod tuning;

use rollwalk_bus::link::LinkBus;
use rollwalk_host::session::Session;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::{Node, ToController};
use rollwalk_sim_host::interface::Interface;
use rollwalk_sim_host::one_leg as robot;
use rollwalk_sim_host::rig::Rig;

/// Duration of a second, µs.
const S: u64 = 1_000_000;

fn rig() -> Rig {
    Rig::new(&robot::robot()).unwrap()
}

fn connect<B: LinkBus>(bus: B) -> Session<B> {
    Session::connect(bus, Node::new(1).unwrap()).unwrap()
}

/// Transport frames of the host on the link.
fn transport_frames(rig: &Rig) -> impl Iterator<Item = &Frame> {
    let on_link = rig.log().iter().filter(|entry| entry.interface == Interface::Link);
    let frames = on_link.map(|entry| &entry.frame);
    frames.filter(|frame| matches!(ToController::decode(frame), Ok((_, ToController::Transport))))
}

/// Robot with its library, standing in SAFE with torque on.
fn armed() -> Session<Rig> {
    let mut session = connect(rig());
    session.flash(&robot::library(), |_| {}).unwrap();
    session.arm().unwrap();
    session
}
