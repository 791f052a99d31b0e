//! Controller on an emulated Cortex-M4F, with its requests and the expected answers in the board's memory.
//!
//! The program runs until an answer differs from the expected one, reports the result on the emulator's console and ends the
//! emulator. This test program can panic, and `cargo xtask sizes` checks that its symbols show the panics.
#![no_std]
#![no_main]

mod board;
mod cost;
#[path = "../../image_keys.rs"]
mod image_keys;
mod semihosting;
mod stack;
mod store;

// Module `robot` with configuration and buses.
include!(concat!(env!("OUT_DIR"), "/robot.rs"));

use board::Board;
use core::panic::PanicInfo;
use cortex_m_rt::entry;
use rollwalk_protocol::tunnel::{Deframer, Line, Request};
use semihosting::{FAILURE, SUCCESS, exit};

#[entry]
fn main() -> ! {
    stack::paint();
    let Some(peripherals) = cortex_m::Peripherals::take() else { exit(FAILURE) };
    let Some(mut board) = Board::start(peripherals) else { exit(FAILURE) };
    let wrong = replay(&mut board, script());

    let report = [Request::Hello, Request::Figures].map(|request| board.answer(request).encode(0));
    for line in report.iter().chain([&wrong]).flatten() {
        line.iter().copied().for_each(semihosting::write);
    }
    exit(SUCCESS)
}

/// Answers the requests of the script, each followed by its expected answer. Returns the first answer that differs.
fn replay(board: &mut Board, script: &[u8]) -> Option<Line> {
    let mut deframer = Deframer::default();
    let mut at = 0;
    while at < script.len() {
        let packet = deframer.push(script[at]);
        at += 1;
        let Some((sequence, request)) = packet.and_then(Request::decode) else { continue };
        let answer = board.answer(request).encode(sequence)?;
        let expected = at..at + answer.len();
        if script[expected.clone()] != answer[..] {
            return Some(answer);
        }
        at = expected.end;
    }
    None
}

/// Script that the emulator has loaded, as a length followed by that many bytes.
fn script() -> &'static [u8] {
    unsafe extern "C" {
        // Symbols of the linker script.
        static _script_start: u32;
        static _script_end: u32;
    }
    let (start, end) = (&raw const _script_start, &raw const _script_end);
    // SAFETY: memory that nothing on this board writes to; the length is limited to its end.
    unsafe {
        let room = end.byte_offset_from_unsigned(start) - size_of::<u32>();
        let length = (start.read_volatile() as usize).min(room);
        core::slice::from_raw_parts(start.add(1).cast(), length)
    }
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    exit(FAILURE)
}
