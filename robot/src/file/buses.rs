//! `[[bus]]` tables of a robot file: protocol and settings of each actuator bus. [`crate::rules`] checks
//! whether they suit the robot.

use super::fields::byte;
use crate::document::Table;
use crate::rules::buses::{
    DEVICES, ESTIMATES_HZ, MASTER_IDS, RETURN_DELAYS_US, WATCHDOG_STEP_MS, WATCHDOGS_MS,
};
use rollwalk_protocol::actuators::bus::{Bus, ControlLoop, Pose, Protocol};
use rollwalk_protocol::actuators::cybergear::CyberGear;
use rollwalk_protocol::actuators::dynamixel::{Dynamixels, table as dynamixel};
use rollwalk_protocol::actuators::maestro::{Maestro, Pulse};
use rollwalk_protocol::actuators::mit::{self, AnswerId, Mit};
use rollwalk_protocol::actuators::odrive::{Odrive, Version};

/// Protocols as files name them.
const PROTOCOLS: [&str; 6] = ["rollwalk", "mit", "odrive", "cybergear", "dynamixel", "maestro"];

/// Number and settings of a bus, with its table; `None` without a number or a protocol.
pub(super) fn read(mut table: Table<'_>) -> Option<(u8, Bus, Table<'_>)> {
    let number = table.integer("number", 0..=255);
    if let Some(number) = number {
        table.call(format!("bus {number}"));
    }
    let kind = table.choice("protocol", &PROTOCOLS).map(|choice| PROTOCOLS[choice]);
    let protocol = kind.map(|kind| protocol(&table, kind));
    let is_serial = protocol.as_ref().is_some_and(Protocol::is_serial);
    // CAN has a rate that everybody uses; a serial line has that of its servos' settings.
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

/// Whether an optional key has the second of two values; the first is the default.
fn second(table: &Table<'_>, key: &'static str, values: [&'static str; 2]) -> bool {
    table.given(key, |table, key| table.choice(key, &values)) == Some(1)
}

/// Reads the keys that belong to a protocol.
fn protocol(table: &Table<'_>, kind: &str) -> Protocol {
    let number = |key| table.number(key).unwrap_or_default() as f32;
    let integer = |key, range| table.integer(key, range).unwrap_or_default();
    match kind {
        "rollwalk" => Protocol::Rollwalk,
        "mit" => Protocol::Mit(Mit {
            model: model(table, mit::MODELS, |model| model.name),
            answers_from: table
                .given("master_id", |table, key| table.integer(key, MASTER_IDS))
                .and_then(|id| u16::try_from(id).ok())
                .map_or(AnswerId::Own, AnswerId::Master),
        }),
        "odrive" => {
            let version = table.choice("firmware", &["0.5", "0.6"]);
            Protocol::Odrive(Odrive {
                version: if version == Some(0) { Version::V05 } else { Version::V06 },
                reduction: number("reduction"),
                torque_constant_nm_a: number("torque_constant_nm_a"),
                estimates_hz: integer("estimates_hz", ESTIMATES_HZ),
            })
        }
        "cybergear" => Protocol::CyberGear(CyberGear {
            host: byte(table, "host_id"),
            max_position_rad: number("max_position_rad"),
        }),
        "dynamixel" => {
            let model = model(table, dynamixel::MODELS, |model| model.name);
            let watchdog_ms = integer("watchdog_ms", WATCHDOGS_MS);
            if !watchdog_ms.is_multiple_of(WATCHDOG_STEP_MS) {
                let help = "its unit is 20 ms: give a multiple of that, or 0 for none";
                table.fault("watchdog_ms", "is no whole number of units", "a multiple of 20", help);
            }
            Protocol::Dynamixel(Dynamixels {
                model,
                watchdog_20ms: u8::try_from(watchdog_ms / WATCHDOG_STEP_MS).unwrap_or_default(),
                return_delay_us: integer("return_delay_us", RETURN_DELAYS_US),
            })
        }
        _ => Protocol::Maestro(Maestro {
            device: table
                .given("device", |table, key| table.integer(key, DEVICES))
                .and_then(|device| u8::try_from(device).ok()),
            crc: table.given("crc", Table::boolean).unwrap_or(false),
            set_multiple: table.given("set_multiple", Table::boolean).unwrap_or(true),
            pulse: pulse(table),
        }),
    }
}

fn model<M: Copy, const N: usize>(
    table: &Table<'_>,
    models: [M; N],
    name: fn(&M) -> &'static str,
) -> M {
    let names = models.each_ref().map(name);
    models[table.choice("model", &names).unwrap_or_default()]
}

/// Pulses of a Maestro's servos; the defaults are those of most servos.
fn pulse(table: &Table<'_>) -> Pulse {
    let usual = Pulse::default();
    let number = |key| table.given(key, Table::number).map(|given| given as f32);
    let limits_us = table.given("pulse_us", Table::numbers::<2>);
    Pulse {
        centre_us: number("centre_us").unwrap_or(usual.centre_us),
        us_per_rad: number("us_per_rad").unwrap_or(usual.us_per_rad),
        limits_us: limits_us.map_or(usual.limits_us, |us| us.map(|us| us as f32).into()),
    }
}
