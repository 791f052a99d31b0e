//! Depth of the stack. Free memory is painted at the start; bytes without the paint were used by the stack.

use core::arch::asm;
use core::ptr::{read_volatile, write_volatile};

const PAINT: u32 = 0xA5A5_5A5A;
/// Margin below the stack pointer that is not painted, bytes: the frame of the painting function.
const MARGIN_BYTES: usize = 256;

unsafe extern "C" {
    // Symbols of the linker script: end of the static variables, down to which the stack may grow, and start of the stack.
    static mut __sheap: u32;
    static mut _stack_start: u32;
}

/// Paints the memory between the static variables and the stack.
pub fn paint() {
    let pointer: usize;
    // SAFETY: reads a register.
    unsafe { asm!("mov {}, sp", out(reg) pointer, options(nomem, nostack, preserves_flags)) };
    let mut word = &raw mut __sheap;
    while (word as usize) < pointer.saturating_sub(MARGIN_BYTES) {
        // SAFETY: RAM between the static variables and the stack, which nothing uses.
        unsafe { write_volatile(word, PAINT) };
        word = word.wrapping_add(1);
    }
}

/// Largest depth of the stack so far, bytes.
pub fn deepest() -> u32 {
    let mut word = &raw const __sheap;
    let start = &raw const _stack_start;
    // SAFETY: RAM, up to the beginning of the stack.
    while word < start && unsafe { read_volatile(word) } == PAINT {
        word = word.wrapping_add(1);
    }
    (start as usize).saturating_sub(word as usize) as u32
}
