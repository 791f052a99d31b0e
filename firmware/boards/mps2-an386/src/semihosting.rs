//! Arm semihosting calls: output to the emulator's console, and the end of the program.

use core::arch::asm;

const WRITE_BYTE: usize = 0x03;
const EXIT: usize = 0x18;
/// Exit reason `ADP_Stopped_ApplicationExit`, for exit code 0.
pub const SUCCESS: usize = 0x2_0026;
/// Exit reason `ADP_Stopped_RunTimeErrorUnknown`, for exit code 1.
pub const FAILURE: usize = 0x2_0023;

/// Writes a byte to the console.
pub fn write(byte: u8) {
    call(WRITE_BYTE, &raw const byte as usize);
}

pub fn exit(reason: usize) -> ! {
    call(EXIT, reason);
    loop {
        cortex_m::asm::wfi();
    }
}

fn call(operation: usize, argument: usize) {
    // SAFETY: the two calls above; they change the register of the result, and read at most what `argument` points to.
    unsafe {
        asm!("bkpt #0xAB", inout("r0") operation => _, in("r1") argument, options(nostack));
    }
}
