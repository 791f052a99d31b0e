//! Cost of authentication and signatures on an emulated Cortex-M4F whose controller requires keys.
//!
//! The program measures a command without, with a correct and with a wrong authenticator, and the signature check of a short
//! and of a longer library. It writes the SysTick counts of each and the deepest stack to the emulator's console, then ends the
//! emulator. A test program may panic.
#![no_std]
#![no_main]

#[expect(dead_code, reason = "no control period is counted")]
mod cost;
mod public_keys;
mod semihosting;
mod stack;
mod store;

// Module `robot` with configuration and buses.
include!(concat!(env!("OUT_DIR"), "/robot.rs"));

use core::panic::PanicInfo;
use cortex_m_rt::entry;
use cost::Cost;
use rollwalk_firmware::store::{BootCounter, LibraryStore, RamStore, Signed};
use rollwalk_firmware::{Controller, Settings};
use rollwalk_protocol::library::{SIGNATURE_BLOCK_LEN, signature_head};
use rollwalk_protocol::wire::authentication::{
    Authenticator, LinkSession, SessionOffer, SessionRequest, Subject,
};
use rollwalk_protocol::wire::isotp::{Output, Timing};
use rollwalk_protocol::wire::transport::{Endpoint, frame_to_controller};
use rollwalk_protocol::wire::{Action, Command, CommandResult, FromController, Node};
use semihosting::{FAILURE, SUCCESS, exit};
use static_cell::StaticCell;
use store::Stores;

type Core = Controller<Signed<store::Libraries>>;

static CONTROLLER: StaticCell<Core> = StaticCell::new();

const NONCE: u64 = 7;
/// Length of the short library, bytes, equal to that in the firmware's test of OpenSSL's signature.
const SHORT: usize = 100;
/// Number of additional bytes of the longer library.
const MORE: usize = 1024;
const FINGERPRINT: [u8; 8] = [0xFD, 0x11, 0x0D, 0x30, 0x1D, 0x2F, 0x07, 0x7D];
const SIGNATURE: [u8; 64] = [
    0xCB, 0x8B, 0x2C, 0x55, 0x16, 0x6E, 0x85, 0xE5, 0xA9, 0x4C, 0xE6, 0xED, 0x45, 0xB1, 0x87, 0x08, 0xA5, 0x4C, 0xF5, 0x73, 0xC8, 0x0C, 0x88, 0xB9, 0x13, 0x12, 0x7C, 0x27, 0x0C, 0x61, 0x9B, 0x09, 0x5E, 0x21, 0x20, 0xFE, 0x9E, 0x01, 0xB5, 0xF2, 0x38, 0x22, 0xBC, 0x62, 0x07, 0x93, 0xFF, 0x20, 0x45, 0x34, 0x86, 0x3D, 0xDB, 0xF0, 0xE2, 0x65, 0x9C, 0xCD, 0x56, 0x7F, 0xDD, 0xE9, 0xB7, 0x03
];

#[entry]
fn main() -> ! {
    stack::paint();
    let Some(report) = measured() else { exit(FAILURE) };
    for number in report {
        number.to_le_bytes().into_iter().for_each(semihosting::write);
    }
    exit(SUCCESS)
}

/// Counts of three commands and two signature checks, and depth of the stack, bytes.
fn measured() -> Option<[u32; 6]> {
    let mut cost = Cost::new(cortex_m::Peripherals::take()?.SYST);
    let [plain, proven, forged] = commands(&mut cost)?;
    let [short, long] = [0, MORE].map(|more| signature(&mut cost, more));
    Some([plain, proven, forged, short?, long?, stack::deepest()])
}

/// Counts of a command without authenticator, with a correct one, and with a wrong one.
fn commands(cost: &mut Cost) -> Option<[u32; 3]> {
    let settings = Settings::default();
    let Stores { libraries, boots } = store::mount()?;
    let store = Signed::new(libraries, public_keys::library()?);
    let buses = robot::buses()?;
    let build = || Controller::with_buses(robot::config(), buses, store, settings);
    let controller = CONTROLLER.try_init_with(build)?;
    controller.require_key(public_keys::link(), BootCounter::mount(boots).ok()?.count().ok());
    let node = Node::new(settings.node)?;
    let session = LinkSession { number: offer(controller, node)?.number, nonce: NONCE };
    let mut sent = |counter: Option<u8>, forge: u8| {
        let frame = Command { seq: 1, action: Action::Disarm, valid_until_ms: 100 }.encode(node);
        let authenticator = counter.and_then(|counter| {
            let id = frame.standard_id()?;
            let mut tag = public_keys::link().tag(&session, counter.into(), id, frame.data());
            tag[0] ^= forge;
            let session = session.short();
            Some(Authenticator { session, subject: Subject::Command, counter, tag }.encode(node))
        });
        let ((), counts) = cost.counted(|| {
            if let Some(authenticator) = &authenticator {
                controller.on_link_frame(0, authenticator);
            }
            controller.on_link_frame(0, &frame);
        });
        (answer(controller), counts)
    };
    let required = Some(CommandResult::AuthenticationRequired);
    let (refused, plain) = sent(None, 0);
    let (obeyed, proven) = sent(Some(1), 0);
    let (found_out, forged) = sent(Some(2), 1);
    let is_right =
        refused == required && obeyed.is_some() && obeyed != required && found_out == required;
    is_right.then_some([plain, proven, forged])
}

/// Counts of the signature check of a library at power-on. If `more` unsigned bytes follow the signed ones, the check must fail.
fn signature(cost: &mut Cost, more: usize) -> Option<u32> {
    let mut file = [7; SHORT + MORE + SIGNATURE_BLOCK_LEN];
    let file = file.get_mut(..SHORT + more + SIGNATURE_BLOCK_LEN)?;
    let end = signature_head(FINGERPRINT).into_iter().chain(SIGNATURE);
    file.iter_mut().skip(SHORT + more).zip(end).for_each(|(place, byte)| *place = byte);
    let key = public_keys::library()?;
    let store = RamStore::<{ SHORT + MORE + SIGNATURE_BLOCK_LEN }>::holding(file).ok()?;
    let (store, counts) = cost.counted(|| Signed::new(store, key));
    ((more == 0) == (store.bytes().len() == SHORT)).then_some(counts)
}

/// Answer of the controller to the latest command.
fn answer(controller: &mut Core) -> Option<CommandResult> {
    let frames = core::iter::from_fn(|| controller.poll_link(0));
    let answers = frames.filter_map(|frame| match FromController::decode(&frame) {
        Ok((_, FromController::CommandAck(ack))) => Some(ack.result),
        _ => None,
    });
    answers.last()
}

/// Requests a session.
fn offer(controller: &mut Core, node: Node) -> Option<SessionOffer> {
    let mut endpoint = Endpoint::new(Timing::default());
    endpoint.send(&SessionRequest { nonce: NONCE }.encode()).ok()?;
    for _ in 0..20 {
        if let Output::Send(pdu) = endpoint.poll(0) {
            controller.on_link_frame(0, &frame_to_controller(node, &pdu));
        }
        while let Some(frame) = controller.poll_link(0) {
            if let Ok((_, FromController::Transport)) = FromController::decode(&frame) {
                endpoint.on_frame(frame.data(), 0);
            }
        }
        if let Ok(offer) = SessionOffer::decode(endpoint.received()) {
            return Some(offer);
        }
    }
    None
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    exit(FAILURE)
}
