//! Controller on an emulated Cortex-M4F, with its buses and its time tunnelled over UART 0.
//!
//! The program answers each packet with one packet ([`rollwalk_protocol::tunnel`]) and does nothing between requests.
#![no_std]
#![no_main]

mod board;
mod cost;
mod halt;
#[path = "../../image_keys.rs"]
mod image_keys;
mod registers;
mod stack;
mod store;
mod uart;

// Module `robot` with configuration and buses.
include!(concat!(env!("OUT_DIR"), "/robot.rs"));

use board::Board;
use cortex_m_rt::entry;
use rollwalk_protocol::tunnel::{Deframer, Request};
use uart::Uart;

#[entry]
fn main() -> ! {
    stack::paint();
    let Some(peripherals) = cortex_m::Peripherals::take() else { halt::halt() };
    let Some(mut board) = Board::start(peripherals) else { halt::halt() };
    let mut uart = Uart::new();
    let mut deframer = Deframer::default();
    loop {
        let Some(packet) = deframer.push(uart.read()) else { continue };
        // Other packets get no answer. The host asks again or gives up.
        let Some((sequence, request)) = Request::decode(packet) else { continue };
        #[cfg(feature = "planted-panic")]
        let sequence = packet[usize::from(sequence)];
        if let Some(line) = board.answer(request).encode(sequence) {
            line.iter().for_each(|&byte| uart.write(byte));
        }
    }
}
