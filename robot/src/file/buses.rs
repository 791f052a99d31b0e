//! `[[bus]]` tables of a robot file: protocol and settings of each actuator bus. [`crate::rules`] checks them against the
//! robot.

use crate::document::Table;
use rollwalk_protocol::actuators::bus::{Bus, ControlLoop, Pose, Protocol};
use rollwalk_protocol::actuators::settings::Keys;
use std::ops::RangeInclusive;

/// Reads number and settings of a bus, and returns them with the table. `None` if number or protocol is missing.
pub(super) fn read(mut table: Table<'_>) -> Option<(u8, Bus, Table<'_>)> {
    let number = table.integer("number", 0..=255);
    if let Some(number) = number {
        table.call(format!("bus {number}"));
    }
    let kind = table.choice("protocol", Protocol::KEYS);
    let protocol = kind.map(|kind| Protocol::read(kind, &table));
    let is_serial = protocol.as_ref().is_some_and(Protocol::is_serial);
    // CAN has a usual bit rate; the rate of a serial line depends on the settings of its servos.
    let bit_rate = if table.has("bit_rate") || is_serial {
        table.integer("bit_rate", 1..=100_000_000).unwrap_or_default()
    } else {
        Bus::default().bit_rate
    };
    let on_controller = second(&table, "control", ["in_drive", "on_controller"]);
    let assumed_safe = second(&table, "pose", ["measured", "assumed_safe"]);
    // Which keys are allowed depends on the protocol.
    if protocol.is_some() {
        table.done();
    }
    let control = if on_controller { ControlLoop::OnController } else { ControlLoop::InDrive };
    let pose = if assumed_safe { Pose::AssumedSafe } else { Pose::Measured };
    let bus = Bus { protocol: protocol?, bit_rate, control, pose };
    Some((u8::try_from(number?).ok()?, bus, table))
}

/// Returns true if an optional key has the second of two values. The first is the default.
fn second(table: &Table<'_>, key: &'static str, values: [&'static str; 2]) -> bool {
    table.given(key, |table, key| table.choice(key, &values)) == Some(1)
}

/// Source of the settings for protocol codecs.
impl Keys for Table<'_> {
    fn has(&self, key: &'static str) -> bool {
        self.has(key)
    }

    fn number(&self, key: &'static str) -> f32 {
        self.number(key).unwrap_or_default() as f32
    }

    fn integer(&self, key: &'static str, range: RangeInclusive<u32>) -> u32 {
        self.integer(key, range).unwrap_or_default()
    }

    fn boolean(&self, key: &'static str) -> bool {
        self.boolean(key).unwrap_or_default()
    }

    fn pair(&self, key: &'static str) -> (f32, f32) {
        let [first, second] = self.numbers::<2>(key).unwrap_or_default();
        (first as f32, second as f32)
    }

    fn choice(&self, key: &'static str, words: &[&'static str]) -> usize {
        self.choice(key, words).unwrap_or_default()
    }

    fn refuse(&self, key: &'static str, problem: &str, label: &str, help: &str) {
        self.fault(key, problem, label, help);
    }
}
