//! Chip: clocks, resets, pins, cause of the reset, serial number. Names of registers are those of the RP2350 datasheet.

use crate::watchdog;
use embassy_rp::pac::clocks::vals::{
    ClkPeriCtrlAuxsrc, ClkRefCtrlSrc, ClkSysCtrlAuxsrc, ClkSysCtrlSrc, ClkUsbCtrlAuxsrc,
};
use embassy_rp::pac::pll::Pll;
use embassy_rp::pac::xosc::vals::{CtrlFreqRange, Enable};
use embassy_rp::pac::{
    CLOCKS, IO_BANK0, OTP_DATA_RAW, PADS_BANK0, PLL_SYS, PLL_USB, POWMAN, RESETS, TICKS, WATCHDOG,
    XOSC,
};
use rollwalk_protocol::serial::Reset;

/// Frequency of the Pico 2's crystal, Hz.
const CRYSTAL_HZ: u32 = 12_000_000;
/// Clock of processor, UART and PIO, Hz.
pub const CORE_HZ: u32 = 150_000_000;
/// Frequency of the system PLL's VCO, Hz, within 750 to 1600 MHz (8.6.2).
const VCO_HZ: u32 = 1_500_000_000;
/// Post-dividers of the system PLL.
const POST_DIVIDERS: (u8, u8) = (5, 2);
const _: () = assert!(VCO_HZ / (POST_DIVIDERS.0 as u32 * POST_DIVIDERS.1 as u32) == CORE_HZ);

/// Pin function for the UART (9.4).
pub const FUNCTION_UART: u8 = 2;
const FUNCTION_SIO: u8 = 5;
pub const FUNCTION_PIO0: u8 = 6;

/// Frequency of the VCO of the 48 MHz USB PLL, Hz.
const USB_VCO_HZ: u32 = 1_200_000_000;
const USB_POST_DIVIDERS: (u8, u8) = (5, 5);

/// Switches clocks and peripherals on.
///
/// Waits for the crystal, forever if there is none: the board then drives and sends nothing.
pub fn start() {
    XOSC.ctrl().write(|w| w.set_freq_range(CtrlFreqRange::_1_15MHZ));
    // 1 ms, in units of 256 periods (8.2.4).
    XOSC.startup().write(|w| w.set_delay((CRYSTAL_HZ / 1000 / 256 + 1) as u16));
    XOSC.ctrl().modify(|w| w.set_enable(Enable::ENABLE));
    while !XOSC.status().read().stable() {}
    CLOCKS.clk_ref_ctrl().modify(|w| w.set_src(ClkRefCtrlSrc::XOSC_CLKSRC));
    while CLOCKS.clk_ref_selected().read().0 != 1 << ClkRefCtrlSrc::XOSC_CLKSRC as u32 {}
    // After a reset by the watchdog the processor may still run from the PLL.
    CLOCKS.clk_sys_ctrl().modify(|w| w.set_src(ClkSysCtrlSrc::CLK_REF));
    while CLOCKS.clk_sys_selected().read().0 != 1 << ClkSysCtrlSrc::CLK_REF as u32 {}

    RESETS.reset().modify(|w| {
        w.set_pll_sys(true);
        w.set_pll_usb(true);
    });
    release(|w| {
        w.set_pll_sys(false);
        w.set_pll_usb(false);
    });
    lock(PLL_SYS, VCO_HZ, POST_DIVIDERS);
    lock(PLL_USB, USB_VCO_HZ, USB_POST_DIVIDERS);
    CLOCKS.clk_sys_ctrl().modify(|w| w.set_auxsrc(ClkSysCtrlAuxsrc::CLKSRC_PLL_SYS));
    CLOCKS.clk_sys_ctrl().modify(|w| w.set_src(ClkSysCtrlSrc::CLKSRC_CLK_SYS_AUX));
    while CLOCKS.clk_sys_selected().read().0 != 1 << ClkSysCtrlSrc::CLKSRC_CLK_SYS_AUX as u32 {}
    CLOCKS.clk_peri_ctrl().write(|w| {
        w.set_auxsrc(ClkPeriCtrlAuxsrc::CLK_SYS);
        w.set_enable(true);
    });

    CLOCKS.clk_usb_ctrl().write(|w| {
        w.set_auxsrc(ClkUsbCtrlAuxsrc::CLKSRC_PLL_USB);
        w.set_enable(true);
    });

    // Timer and watchdog count microseconds of the crystal.
    const CYCLES: u16 = (CRYSTAL_HZ / 1_000_000) as u16;
    TICKS.timer0_cycles().write(|w| w.set_timer0_cycles(CYCLES));
    TICKS.timer0_ctrl().write(|w| w.set_enable(true));
    TICKS.watchdog_cycles().write(|w| w.set_watchdog_cycles(CYCLES));
    TICKS.watchdog_ctrl().write(|w| w.set_enable(true));

    // Puts these blocks into the state after power-on, whatever program ran before.
    RESETS.reset().modify(|w| {
        w.set_pio0(true);
        w.set_uart0(true);
        w.set_usbctrl(true);
        w.set_timer0(true);
    });
    release(|w| {
        w.set_io_bank0(false);
        w.set_pads_bank0(false);
        w.set_pio0(false);
        w.set_uart0(false);
        w.set_usbctrl(false);
        w.set_timer0(false);
    });
}

/// Starts a PLL and waits until it has locked. The order is that of 8.6.3: loop divider, power, lock, post-dividers.
fn lock(pll: Pll, vco_hz: u32, (first, second): (u8, u8)) {
    pll.cs().write(|w| w.set_refdiv(1));
    pll.fbdiv_int().write(|w| w.set_fbdiv_int((vco_hz / CRYSTAL_HZ) as u16));
    pll.pwr().modify(|w| {
        w.set_pd(false);
        w.set_vcopd(false);
    });
    while !pll.cs().read().lock() {}
    pll.prim().write(|w| {
        w.set_postdiv1(first);
        w.set_postdiv2(second);
    });
    pll.pwr().modify(|w| w.set_postdivpd(false));
}

/// Releases peripherals from reset, and waits until the release is complete.
fn release(which: impl Fn(&mut embassy_rp::pac::resets::regs::Peripherals)) {
    let mut all = embassy_rp::pac::resets::regs::Peripherals(u32::MAX);
    which(&mut all);
    let mask = !all.0;
    RESETS.reset().modify(|w| w.0 &= !mask);
    while RESETS.reset_done().read().0 & mask != mask {}
}

/// Connects a pin to a peripheral, pulled up. [`input`] connects one to the processor.
pub fn connect<const PIN: usize>(function: u8) {
    const { assert!(PIN < 30) };
    PADS_BANK0.gpio(PIN).write(|w| {
        w.set_ie(true);
        w.set_schmitt(true);
        w.set_pue(true);
        // After a reset, isolation is on (9.7) and disconnects the pin from its pad.
        w.set_iso(false);
    });
    IO_BANK0.gpio(PIN).ctrl().write(|w| w.set_funcsel(function));
}

/// Makes a pin an input of the processor, pulled up.
pub fn input<const PIN: usize>() {
    connect::<PIN>(FUNCTION_SIO);
}

/// Makes a pin an output of the processor, at low level.
pub fn output<const PIN: usize>() {
    connect::<PIN>(FUNCTION_SIO);
    embassy_rp::pac::SIO.gpio_out(0).value_clr().write_value(1 << PIN);
    embassy_rp::pac::SIO.gpio_oe(0).value_set().write_value(1 << PIN);
}

/// Returns the cause of the most recent reset, and clears the watchdog's record, so that the next reset reports its own cause.
pub fn take_reset_cause() -> Reset {
    let chip = POWMAN.chip_reset().read();
    if watchdog::take_expired() {
        Reset::Watchdog
    } else if WATCHDOG.reason().read().0 != 0 {
        Reset::Software
    } else if chip.had_por() || chip.had_bor() {
        Reset::PowerOn
    } else if chip.had_run_low() {
        Reset::Pin
    } else {
        Reset::Other
    }
}

/// Identifier of this chip with 48 bits, folded from the 64 bits in its one-time memory (rows 0 to 3).
pub fn uid() -> [u8; 6] {
    let row = |n: usize| {
        // A row has 16 bits, and 8 of its ECC above them.
        OTP_DATA_RAW.chipid0().as_ptr().cast_const().wrapping_add(n).cast::<u32>()
    };
    // SAFETY: four rows of the one-time memory's read-only view.
    let words = [0, 1, 2, 3].map(|n| unsafe { row(n).read_volatile() } as u16);
    let [a, b, c, d] = words.map(u16::to_le_bytes);
    [a[0], a[1], b[0], b[1], c[0] ^ d[0], c[1] ^ d[1]]
}
