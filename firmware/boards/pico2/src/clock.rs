//! Time: TIMER0 counts microseconds in 64 bits.

use embassy_rp::pac::TIMER0;

/// Time since the reset, µs. The two halves are read without the latch, because an interrupt could disturb it.
pub fn now_us() -> u64 {
    loop {
        let high = TIMER0.timerawh().read();
        let low = TIMER0.timerawl().read();
        if TIMER0.timerawh().read() == high {
            return u64::from(high) << 32 | u64::from(low);
        }
    }
}
