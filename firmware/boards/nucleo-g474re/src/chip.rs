//! Chip: clocks, supply, cause of the reset, serial number. Names of registers are those of the reference manual, RM0440.

use embassy_stm32::Peripherals;
use embassy_stm32::pac;
use embassy_stm32::rcc;
use embassy_stm32::time::Hertz;
use rollwalk_protocol::serial::Reset;

/// Frequency of the Nucleo's crystal X3, Hz. CAN needs a crystal: the RC oscillator is off by up to 1 %.
pub const CRYSTAL_HZ: u32 = 24_000_000;
pub const CORE_HZ: u32 = 170_000_000;
/// Threshold of the supply detector, in PWR_CR2: 5 is about 2.8 V.
const SUPPLY_THRESHOLD: u8 = 5;

/// Switches clocks, ports and the supply detector on.
///
/// Waits for the crystal, forever if there is none: the board then drives and sends nothing.
pub fn start(peripherals: &mut Peripherals) {
    // Power interface, before the regulator learns the speed; SYSCFG for the interrupt of a pin.
    pac::RCC.apb1enr1().modify(|w| w.set_pwren(true));
    pac::RCC.apb2enr().modify(|w| w.set_syscfgen(true));

    let mut config = rcc::Config::new();
    config.hse = Some(rcc::Hse { freq: Hertz(CRYSTAL_HZ), mode: rcc::HseMode::Oscillator });
    // 24 MHz / 6 * 85 / 2 = 170 MHz, in range 1 boost mode (RM0440, 6.1.5).
    config.pll = Some(rcc::Pll {
        source: rcc::PllSource::HSE,
        prediv: rcc::PllPreDiv::DIV6,
        mul: rcc::PllMul::MUL85,
        divp: None,
        divq: None,
        divr: Some(rcc::PllRDiv::DIV2),
    });
    config.sys = rcc::Sysclk::PLL1_R;
    config.boost = true;
    config.hsi48 = None;
    config.ls = rcc::LsConfig::off();
    // The crystal instead of the PLL: no jitter, and whole time quanta at 1 Mbit/s.
    config.mux.fdcansel = rcc::mux::Fdcansel::HSE;
    rcc::reinit(config, &mut peripherals.RCC);
    // If the crystal fails later, an NMI occurs, and `fault` halts the program.
    pac::RCC.cr().modify(|w| w.set_csson(true));

    pac::RCC.ahb2enr().modify(|w| {
        w.set_gpioaen(true);
        w.set_gpioben(true);
    });
    pac::RCC.apb1enr1().modify(|w| {
        w.set_fdcanen(true);
        w.set_usart3en(true);
        w.set_tim5en(true);
    });
    pac::RCC.apb1enr2().modify(|w| w.set_lpuart1en(true));
    // A clock takes two cycles to arrive; the read waits for the write before it.
    let _ = pac::RCC.apb1enr2().read();

    // The programmable voltage detector.
    pac::PWR.cr2().modify(|w| {
        w.set_pls(SUPPLY_THRESHOLD);
        w.set_pvde(true);
    });
}

/// True if the supply is below 2.8 V, which is too low to write flash or to drive a robot.
pub fn supply_is_low() -> bool {
    pac::PWR.sr2().read().pvdo()
}

/// Brown-out reset level, an option byte (RM0440, 3.4.1): 0 is 1.7 V, 4 is 2.8 V.
pub fn brown_out_level() -> u8 {
    pac::FLASH.optr().read().bor_lev()
}

/// Returns the cause of the most recent reset (RCC_CSR), and clears the record, so that the next reset reports its own cause.
pub fn take_reset_cause() -> Reset {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    pac::RCC.csr().modify(|w| w.set_rmvf(false));
    // The flag of the pin is set after every reset, because the chip pulls the pin itself.
    if flags.iwdgrstf() {
        Reset::Watchdog
    } else if flags.sftrstf() {
        Reset::Software
    } else if flags.borrstf() {
        Reset::PowerOn
    } else if flags.pinrstf() {
        Reset::Pin
    } else {
        Reset::Other
    }
}

/// Identifier of this chip with 48 bits, folded from its unique 96 bits.
pub fn uid() -> [u8; 6] {
    let [a, b, c, d, e, f, g, h, i, j, k, l] = embassy_stm32::uid::uid();
    [a ^ g, b ^ h, c ^ i, d ^ j, e ^ k, f ^ l]
}
