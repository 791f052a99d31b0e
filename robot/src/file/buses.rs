//! Reads the `[[bus]]` tables of a robot file: what the actuators of a bus speak. Whether a robot can use
//! them is up to [`crate::rules`].

use super::read::Spans;
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

/// A bus with its number.
#[derive(Clone, Debug)]
pub(super) struct BusItem {
    pub number: u8,
    pub bus: Bus,
    pub spans: Spans,
}

/// Protocols as files name them.
const PROTOCOLS: [&str; 6] = ["rollwalk", "mit", "odrive", "cybergear", "dynamixel", "maestro"];

/// Fields that rules may find fault with.
const FIELDS: [&str; 14] = [
    "number",
    "bit_rate",
    "control",
    "pose",
    "master_id",
    "reduction",
    "torque_constant_nm_a",
    "estimates_hz",
    "max_position_rad",
    "watchdog_ms",
    "return_delay_us",
    "device",
    "us_per_rad",
    "pulse_us",
];

pub(super) fn bus(mut table: Table<'_>) -> Option<BusItem> {
    let number = table.integer("number", 0..=255);
    if let Some(number) = number {
        table.call(format!("bus {number}"));
    }
    let kind = table.choice("protocol", &PROTOCOLS).map(|choice| PROTOCOLS[choice]);
    let protocol = kind.and_then(|kind| protocol(&table, kind));
    let is_serial = matches!(kind, Some("dynamixel" | "maestro"));
    // CAN has a rate that everybody uses; a serial line has that of its servos' settings.
    let bit_rate = if table.has("bit_rate") || is_serial {
        table.integer("bit_rate", 1..=100_000_000)
    } else {
        Some(Bus::default().bit_rate)
    };
    let control = either(&table, "control", ["in_drive", "on_controller"]);
    let pose = either(&table, "pose", ["measured", "assumed_safe"]);
    let spans = Spans::of(&table, &FIELDS);
    // Without a protocol, nobody knows which keys belong here.
    if kind.is_some() {
        table.done();
    }
    Some(BusItem {
        number: u8::try_from(number?).ok()?,
        bus: Bus {
            protocol: protocol?,
            bit_rate: bit_rate?,
            control: if control? { ControlLoop::OnController } else { ControlLoop::InDrive },
            pose: if pose? { Pose::AssumedSafe } else { Pose::Measured },
        },
        spans,
    })
}

/// Whether the second of two words is given; the first is the default. `None` for a fault.
fn either(table: &Table<'_>, key: &'static str, words: [&'static str; 2]) -> Option<bool> {
    if table.has(key) { table.choice(key, &words).map(|choice| choice == 1) } else { Some(false) }
}

/// Reads the keys that belong to a protocol.
fn protocol(table: &Table<'_>, kind: &str) -> Option<Protocol> {
    Some(match kind {
        "rollwalk" => Protocol::Rollwalk,
        "mit" => {
            let model = model(table, mit::MODELS, |model| model.name);
            let answers_from = if table.has("master_id") {
                let id = table.integer("master_id", MASTER_IDS);
                id.and_then(|id| u16::try_from(id).ok()).map(AnswerId::Master)
            } else {
                Some(AnswerId::Own)
            };
            Protocol::Mit(Mit { model: model?, answers_from: answers_from? })
        }
        "odrive" => {
            let version = table.choice("firmware", &["0.5", "0.6"]);
            let reduction = table.number("reduction");
            let torque_constant = table.number("torque_constant_nm_a");
            let estimates_hz = table.integer("estimates_hz", ESTIMATES_HZ);
            Protocol::Odrive(Odrive {
                version: if version? == 0 { Version::V05 } else { Version::V06 },
                reduction: reduction? as f32,
                torque_constant_nm_a: torque_constant? as f32,
                estimates_hz: estimates_hz?,
            })
        }
        "cybergear" => {
            let host = table.integer("host_id", 0..=255);
            let max_position = table.number("max_position_rad");
            Protocol::CyberGear(CyberGear {
                host: u8::try_from(host?).ok()?,
                max_position_rad: max_position? as f32,
            })
        }
        "dynamixel" => {
            let model = model(table, dynamixel::MODELS, |model| model.name);
            let watchdog_ms = table.integer("watchdog_ms", WATCHDOGS_MS);
            let return_delay_us = table.integer("return_delay_us", RETURN_DELAYS_US);
            if watchdog_ms.is_some_and(|ms| !ms.is_multiple_of(WATCHDOG_STEP_MS)) {
                let help = "its unit is 20 ms: give a multiple of that, or 0 for none";
                table.fault("watchdog_ms", "is no whole number of units", "a multiple of 20", help);
                return None;
            }
            Protocol::Dynamixel(Dynamixels {
                model: model?,
                watchdog_20ms: u8::try_from(watchdog_ms? / WATCHDOG_STEP_MS).ok()?,
                return_delay_us: return_delay_us?,
            })
        }
        _ => {
            let device = if table.has("device") {
                table.integer("device", DEVICES).map(Some)
            } else {
                Some(None)
            };
            let crc = boolean(table, "crc", false);
            let set_multiple = boolean(table, "set_multiple", true);
            let pulse = pulse(table);
            Protocol::Maestro(Maestro {
                device: device?.and_then(|device| u8::try_from(device).ok()),
                crc: crc?,
                set_multiple: set_multiple?,
                pulse: pulse?,
            })
        }
    })
}

fn boolean(table: &Table<'_>, key: &'static str, unless: bool) -> Option<bool> {
    if table.has(key) { table.boolean(key) } else { Some(unless) }
}

fn model<M: Copy, const N: usize>(
    table: &Table<'_>,
    models: [M; N],
    name: fn(&M) -> &'static str,
) -> Option<M> {
    let names = models.each_ref().map(name);
    table.choice("model", &names).map(|choice| models[choice])
}

/// The pulses of a Maestro's servos; what is not given is as most servos have it.
fn pulse(table: &Table<'_>) -> Option<Pulse> {
    let usual = Pulse::default();
    let number = |key, unless: f32| {
        if table.has(key) { table.number(key).map(|given| given as f32) } else { Some(unless) }
    };
    let centre_us = number("centre_us", usual.centre_us);
    let us_per_rad = number("us_per_rad", usual.us_per_rad);
    let limits_us = if table.has("pulse_us") {
        table.numbers::<2>("pulse_us").map(|[least, most]| (least as f32, most as f32))
    } else {
        Some(usual.limits_us)
    };
    Some(Pulse { centre_us: centre_us?, us_per_rad: us_per_rad?, limits_us: limits_us? })
}
