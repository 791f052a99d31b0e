//! Motors of joints and wheels: from the URDF, the side file, and defaults.
//! The defaults are documented in `docs/urdf-import.md`.

use super::draft::{DraftSheet, Motor, Sheet};
use super::names::{Names, allowed};
use super::notes::Notes;
use super::side::{ActuatorSide, MotorSide, Side};
use super::xml::Joint;
use crate::document::Span;
use rollwalk_protocol::actuator::{MAX_KP_NM_RAD, MAX_SPEED_RAD_S, MAX_TORQUE_NM};
use rollwalk_protocol::actuators::bus::MAX_BUSES;
use std::collections::HashSet;

/// Default speed limit, rad/s.
const SPEED_RAD_S: f64 = 10.0;
/// Default torque limit: the robot's weight on this lever, m.
const LEVER_M: f64 = 0.1;
/// Stiffness per torque limit, 1/rad: full torque at 0.05 rad.
const KP_PER_TORQUE: f64 = 20.0;
/// Armature per torque limit, s²: full torque spins up the rotor alone by 1000 rad/s².
const ARMATURE_PER_TORQUE: f64 = 1e-3;
/// Damping of joints, times critical on the rotor alone.
const DAMPING: f64 = 1.5;
/// Time constant of a wheel's speed on the rotor alone, s.
const WHEEL_TIME_S: f64 = 0.01;
/// Name of the table with defaults for limits that the URDF lacks.
const DEFAULT: &str = "default";

/// Gives motors their data sheets and addresses.
pub(super) struct Motors<'s> {
    side: &'s Side,
    /// N.
    weight_n: f64,
    pub sheets: Vec<DraftSheet>,
    names: Names,
    /// Addresses in use.
    taken: HashSet<(u32, u32)>,
    /// Warnings with their joints, in order of appearance.
    remarks: Vec<(String, Vec<(Span, String)>)>,
}

impl<'s> Motors<'s> {
    pub fn new(side: &'s Side, weight_n: f64) -> Self {
        let motors = side.joints.iter().map(|joint| &joint.motor);
        let motors = motors.chain(side.end_effectors.iter().map(|end| &end.motor));
        let taken = motors.filter_map(|motor| motor.address).collect();
        let names = Names::default();
        Self { side, weight_n, sheets: vec![], names, taken, remarks: vec![] }
    }

    /// The motor of a joint or, for `wheel`, of a driven wheel. Motors without a joint in the URDF have
    /// their limits from the side file alone.
    pub fn motor(
        &mut self,
        given: &MotorSide,
        joint: Option<&Joint>,
        wheel: Option<&(String, Span)>,
        limb: usize,
    ) -> Motor {
        let find = |name: &str| self.side.actuators.iter().find(|table| table.name == name);
        let own = given.actuator.as_ref().and_then(|(name, _)| find(name));
        let sheet = self.sheet(own, find(DEFAULT), joint, wheel);
        let known = self.sheets.iter().position(|known| known.sheet == sheet);
        let sheet = known.unwrap_or_else(|| {
            let fallback = if wheel.is_some() { "drive" } else { "motor" };
            let name = own.map_or(fallback, |own| own.name.as_str());
            let name = self.names.unique(&allowed(name));
            let side = own.or_else(|| find(DEFAULT)).map_or(0..0, |table| table.span.clone());
            self.sheets.push(DraftSheet { name, sheet, side });
            self.sheets.len() - 1
        });
        let (bus, id) = given.address.unwrap_or_else(|| self.free_address(limb));
        Motor { sheet, bus, id }
    }

    /// Two limbs to a bus, as long as there are buses; numbers from 1.
    fn free_address(&mut self, limb: usize) -> (u32, u32) {
        let bus = (limb / 2).min(MAX_BUSES - 1) as u32;
        let free = (1..=127).find(|&id| self.taken.insert((bus, id)));
        // No controller has so many channels: the rules refuse such a robot.
        (bus, free.unwrap_or(127))
    }

    fn sheet(
        &mut self,
        own: Option<&ActuatorSide>,
        default: Option<&ActuatorSide>,
        joint: Option<&Joint>,
        wheel: Option<&(String, Span)>,
    ) -> Sheet {
        let mut remark = |message: String| {
            let about = joint
                .map(|joint| (joint.span.clone(), joint.name.clone()))
                .or_else(|| wheel.map(|(name, _)| (0..0, name.clone())));
            let Some(about) = about else { return };
            match self.remarks.iter_mut().find(|(known, _)| *known == message) {
                Some((_, joints)) => joints.push(about),
                None => self.remarks.push((message, vec![about])),
            }
        };
        let side = |index: usize| own.and_then(|own| own.numbers[index]);
        let fallback = |index: usize| default.and_then(|default| default.numbers[index]);
        let mut limit = |index,
                         key: &str,
                         field: &str,
                         unit: &str,
                         written: Option<f64>,
                         max: f64,
                         value: f64| {
            if let Some(given) = side(index) {
                return given;
            }
            let sensible = written.filter(|written| *written > 0.0 && *written <= max);
            if let Some(sensible) = sensible {
                return sensible;
            }
            let (taken, from) =
                fallback(index).map_or((value, "a default"), |given| (given, "[actuator.default]"));
            let problem = match written {
                Some(0.0) | None => format!("has no <limit {key}>"),
                Some(bad) => format!("has {key}=\"{bad}\", outside 0 to {max} {unit}"),
            };
            // A value of the side file needs no remark unless it overrides one of the URDF.
            if from == "a default" || written.is_some_and(|written| written != 0.0) {
                remark(format!(
                    "{problem}: `{field}` is {taken:.3} {unit}, {from}; say what is right in an [actuator.NAME] of the side file"
                ));
            }
            taken
        };
        let limits = joint.map(|joint| joint.limit).unwrap_or_default();
        let speed = limit(
            0,
            "velocity",
            "speed_max_rad_s",
            "rad/s",
            limits.velocity,
            MAX_SPEED_RAD_S.into(),
            SPEED_RAD_S,
        );
        let torque_max: f64 = MAX_TORQUE_NM.into();
        let usual = (self.weight_n * LEVER_M).min(torque_max);
        let torque = limit(1, "effort", "torque_max_nm", "N·m", limits.effort, torque_max, usual);
        let or = |index, value: f64| side(index).or(fallback(index)).unwrap_or(value);
        let armature = or(4, (ARMATURE_PER_TORQUE * torque).min(10.0));
        let (kp, kd) = if wheel.is_some() {
            // The defaults are for joints: a wheel holds no angle.
            (side(2).unwrap_or(0.0), side(3).unwrap_or(armature / WHEEL_TIME_S))
        } else {
            let kp = or(2, (KP_PER_TORQUE * torque).min(MAX_KP_NM_RAD.into()));
            (kp, or(3, DAMPING * 2.0 * (kp * armature).max(0.0).sqrt()))
        };
        let model =
            own.and_then(|own| own.model.clone()).or_else(|| default.and_then(|d| d.model.clone()));
        let model = model.unwrap_or_else(|| "from URDF limits".to_owned());
        let line = [5, 6].map(|index| side(index).or(fallback(index)));
        Sheet {
            model,
            numbers: [
                Some(speed),
                Some(torque),
                Some(kp),
                Some(kd),
                Some(armature),
                line[0],
                line[1],
            ],
        }
    }

    /// Warns of every remark once, with its joints.
    pub fn remark(self, notes: &mut Notes<'_>) {
        for (message, about) in self.remarks {
            let names: Vec<_> = about.iter().take(4).map(|(_, name)| format!("`{name}`")).collect();
            let more = about.len() - names.len();
            let and = if more > 0 { format!(" and {more} more") } else { String::new() };
            notes.warn(&about[0].0, format_args!("motor of {}{and} {message}", names.join(", ")));
        }
    }
}
