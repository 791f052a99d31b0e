//! Motors of joints and wheels from the URDF, the side file and defaults (`docs/urdf-import.md`).

use super::draft::{DraftSheet, Motor, Sheet};
use super::loads::Load;
use super::model::{self, Joint};
use super::names::{Names, allowed};
use super::notes::Notes;
use super::side::{ActuatorSide, MotorSide, Side};
use crate::GRAVITY_M_S2;
use crate::document::Span;
use crate::rules::{MotorMaxima, SPEEDS_MAX_RAD_S};
use rollwalk_protocol::actuators::bus::MAX_BUSES;
use std::collections::HashSet;

/// Default speed limit, rad/s.
const SPEED_RAD_S: f64 = 10.0;
/// Lever of the robot's weight in the default torque limit, m.
const LEVER_M: f64 = 0.1;
/// Smallest position error at which a joint needs its torque limit, rad.
const SATURATION_RAD: f64 = 0.1;
/// Period of a control loop on the controller at its default rate, s.
const CONTROL_PERIOD_S: f64 = 1.0 / 120.0;
/// Smallest default stiffness of a joint, N·m/rad.
const KP_MIN_NM_RAD: f64 = 0.1;
/// Ratio of armature to torque limit, s². Full torque accelerates the rotor alone by 1000 rad/s².
const ARMATURE_PER_TORQUE: f64 = 1e-3;
/// Time constant of a wheel's speed on the rotor alone, s.
const WHEEL_TIME_S: f64 = 0.01;
/// Name of the table with defaults for limits that the URDF lacks.
const DEFAULT: &str = "default";

/// Data sheets and addresses of all motors.
pub(super) struct Motors<'s> {
    side: &'s Side,
    weight_n: f64,
    maxima: MotorMaxima,
    pub sheets: Vec<DraftSheet>,
    names: Names,
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
        let maxima = MotorMaxima::of(weight_n / GRAVITY_M_S2);
        Self { side, weight_n, maxima, sheets: vec![], names, taken, remarks: vec![] }
    }

    /// Motor of a joint. A prismatic joint has a displacement per radian, m/rad.
    pub fn joint(
        &mut self,
        given: &MotorSide,
        joint: &Joint,
        load: &Load,
        travel_m_per_rad: Option<f64>,
        limb: usize,
    ) -> Motor {
        let about = (joint.span.clone(), joint.name.as_str());
        let travel = travel_m_per_rad.unwrap_or(1.0);
        self.motor(given, (joint.limit, travel), Some(&load.at_pinion(travel)), about, limb)
    }

    /// Motor of an actuated wheel. Without a joint in the URDF its limits come from the side file.
    pub fn wheel(
        &mut self,
        given: &MotorSide,
        axle: Option<&Joint>,
        name: &str,
        limb: usize,
    ) -> Motor {
        let about = axle.map_or((0..0, name), |axle| (axle.span.clone(), axle.name.as_str()));
        self.motor(given, (axle.map(|axle| axle.limit).unwrap_or_default(), 1.0), None, about, limb)
    }

    /// Motor of a joint with its load, or of a wheel without one. `limits` are those of the file, in m and N for a joint that
    /// slides by the number after them, m/rad; 1 for joints that turn.
    fn motor(
        &mut self,
        given: &MotorSide,
        limits: (model::Limit, f64),
        load: Option<&Load>,
        about: (Span, &str),
        limb: usize,
    ) -> Motor {
        let find = |name: &str| self.side.actuators.iter().find(|table| table.name == name);
        let own = given.actuator.as_ref().and_then(|(name, _)| find(name));
        let sheet = self.sheet(own, find(DEFAULT), limits, load, about);
        let known = self.sheets.iter().position(|known| known.sheet == sheet);
        let sheet = known.unwrap_or_else(|| {
            let fallback = if load.is_some() { "motor" } else { "drive" };
            let name = own.map_or(fallback, |own| own.name.as_str());
            let name = self.names.unique(&allowed(name));
            let side = own.or_else(|| find(DEFAULT)).map_or(0..0, |table| table.span.clone());
            self.sheets.push(DraftSheet { name, sheet, side });
            self.sheets.len() - 1
        });
        let (bus, id) = given.address.unwrap_or_else(|| self.free_address(limb));
        Motor { sheet, bus, id }
    }

    /// Next free address. Two limbs share a bus while there are buses; numbers begin at 1.
    fn free_address(&mut self, limb: usize) -> (u32, u32) {
        let bus = (limb / 2).min(MAX_BUSES - 1) as u32;
        let free = (1..=127).find(|&id| self.taken.insert((bus, id)));
        // The rules refuse robots with that many channels.
        (bus, free.unwrap_or(127))
    }

    fn sheet(
        &mut self,
        own: Option<&ActuatorSide>,
        default: Option<&ActuatorSide>,
        (limits, per_rad): (model::Limit, f64),
        load: Option<&Load>,
        about: (Span, &str),
    ) -> Sheet {
        let side = |index: usize| own.and_then(|own| own.numbers[index]);
        let fallback = |index: usize| default.and_then(|default| default.numbers[index]);
        let MotorMaxima {
            torque_nm: torque_most,
            kp_nm_rad: kp_most,
            kd_nm_s_rad: kd_most,
            armature_kg_m2: armature_most,
        } = self.maxima;
        let speed_most = SPEEDS_MAX_RAD_S[usize::from(load.is_none())];
        let usual = (self.weight_n * LEVER_M).min(torque_most);
        let mut limit = |limit: &Limit, most: f64, written: Option<f64>, scale: f64, usual: f64| {
            if let Some(given) = side(limit.index) {
                return given;
            }
            let (taken, remark) = limit.settle(written, scale, fallback(limit.index), usual, most);
            if let Some(remark) = remark {
                self.remark_on(&about, remark);
            }
            taken
        };
        let speed = limit(&SPEED, speed_most, limits.velocity, 1.0 / per_rad, SPEED_RAD_S);
        let torque = limit(&TORQUE, torque_most, limits.effort, per_rad, usual);
        let or = |index, value: f64| side(index).or(fallback(index)).unwrap_or(value);
        // An effort beyond all drives is a placeholder value.
        let placeholder = limits.effort.is_some_and(|effort| effort * per_rad > torque_most);
        let strength = if placeholder { torque.min(usual) } else { torque };
        let armature = side(4).or(limits
            .armature_kg_m2
            .map(|of| of * per_rad * per_rad)
            .filter(|armature| *armature <= armature_most));
        let armature =
            armature.unwrap_or_else(|| or(4, (ARMATURE_PER_TORQUE * strength).min(armature_most)));
        let (kp, kd) = match load {
            // Default gains are for joints, because a wheel holds no angle.
            None => (side(2).unwrap_or(0.0), side(3).unwrap_or(armature / WHEEL_TIME_S)),
            Some(load) => {
                let inertia = load.inertia_kg_m2 + armature;
                let kp =
                    or(2, stiffness(load.holds_nm / load.yields_rad, torque, inertia, kp_most));
                (kp, or(3, damping(kp, inertia, kd_most)))
            }
        };
        let model =
            own.and_then(|own| own.model.clone()).or_else(|| default.and_then(|d| d.model.clone()));
        let model = model.unwrap_or_else(|| {
            let sound = |written: Option<f64>, max| written.is_some_and(|w| w > 0.0 && w <= max);
            let read = [
                sound(limits.velocity.map(|of| of / per_rad), speed_most),
                sound(limits.effort.map(|of| of * per_rad), torque_most),
            ];
            match read {
                [true, true] => "limits of the model",
                [false, false] => "default of the import",
                _ => "limits of the model and defaults",
            }
            .to_owned()
        });
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

    fn remark_on(&mut self, (span, name): &(Span, &str), message: String) {
        let about = (span.clone(), (*name).to_owned());
        match self.remarks.iter_mut().find(|(known, _)| *known == message) {
            Some((_, joints)) => joints.push(about),
            None => self.remarks.push((message, vec![about])),
        }
    }

    /// Prints each remark once, with the names of all joints that it concerns.
    pub fn remark(self, notes: &mut Notes<'_>) {
        for (message, about) in self.remarks {
            let names: Vec<_> = about.iter().take(4).map(|(_, name)| format!("`{name}`")).collect();
            let more = about.len() - names.len();
            let and = if more > 0 { format!(" and {more} more") } else { String::new() };
            notes.warn(&about[0].0, format_args!("motor of {}{and} {message}", names.join(", ")));
        }
    }
}

/// Limit of a motor that URDF has.
struct Limit {
    /// Index in [`super::side::NUMBERS`].
    index: usize,
    /// Attribute of `<limit>`.
    attribute: &'static str,
    quantity: &'static str,
    field: &'static str,
    unit: &'static str,
}

const SPEED: Limit = Limit {
    index: 0,
    attribute: "velocity",
    quantity: "speed",
    field: "speed_max_rad_s",
    unit: "rad/s",
};

const TORQUE: Limit = Limit {
    index: 1,
    attribute: "effort",
    quantity: "torque",
    field: "torque_max_nm",
    unit: "N·m",
};

impl Limit {
    /// Limit from the URDF, the side file's default or the usual value, with a remark if the URDF's cannot be used. `max` is the
    /// largest value of any drive. `scale` converts the limit of the URDF to the unit of the motor.
    fn settle(
        &self,
        written: Option<f64>,
        scale: f64,
        default: Option<f64>,
        usual: f64,
        max: f64,
    ) -> (f64, Option<String>) {
        let Self { attribute, quantity, field, unit, .. } = self;
        let help = "give the right value in an [actuator.NAME] of the side file";
        match written {
            Some(written) if written > 0.0 && written * scale <= max => (written * scale, None),
            Some(written) if written * scale > max => {
                let (most, of) = match default {
                    Some(most) if most <= max => (most, "from [actuator.default]"),
                    // Rounded down, because the digits of a robot file could round it up.
                    _ => ((max * 1e3).floor() / 1e3, "the largest value of a drive"),
                };
                let remark = format!(
                    "has {attribute}=\"{written}\": `{field}` is {most:.3} {unit}, {of}; {help}"
                );
                (most, Some(remark))
            }
            _ => {
                let problem = match written {
                    Some(bad) => format!("has {attribute}=\"{bad}\"; expected a value above 0"),
                    None => format!("has no limit of {quantity}"),
                };
                let (taken, from) =
                    default.map_or((usual, "a default"), |given| (given, "[actuator.default]"));
                // A value of the side file needs a remark only if it overrides one of the URDF.
                let silent = default.is_some() && written.is_none_or(|written| written == 0.0);
                let remark = format!("{problem}: `{field}` is {taken:.3} {unit}, {from}; {help}");
                (taken, (!silent).then_some(remark))
            }
        }
    }
}

/// Default stiffness of a joint, N·m/rad: `carrying`, with which the joint carries its load, within bounds.
fn stiffness(carrying: f64, torque_nm: f64, inertia_kg_m2: f64, largest: f64) -> f64 {
    let most =
        (torque_nm / SATURATION_RAD).min(inertia_kg_m2 / CONTROL_PERIOD_S.powi(2)).min(largest);
    two_digits(carrying.min(most).max(KP_MIN_NM_RAD))
}

/// Default damping: critical on limb and rotor, or what is stable in the control period, N·m·s/rad.
fn damping(kp_nm_rad: f64, inertia_kg_m2: f64, largest: f64) -> f64 {
    let critical = 2.0 * (kp_nm_rad.max(0.0) * inertia_kg_m2).sqrt();
    two_digits(critical.min(inertia_kg_m2 / CONTROL_PERIOD_S).min(largest))
}

/// Rounds down to two digits, so that limbs which differ by rounding share a data sheet.
fn two_digits(value: f64) -> f64 {
    if value <= 0.0 || !value.is_finite() {
        return 0.0;
    }
    let unit = 10_f64.powi(value.log10().floor() as i32 - 1);
    // Compensates for rounding of the quotient, and shortens the decimals.
    let rounded = (value / unit + 1e-6).floor() * unit;
    format!("{rounded:.12}").parse().unwrap_or(rounded)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::urdf::loads::LEG_YIELDS_RAD;

    #[test]
    fn gains_follow_from_load_and_inertia_within_bounds() {
        // 12 kg on four legs of 0.4 m: 11.8 N·m at the longest lever.
        let holds_nm = 12.0 * 9.81 / 4.0 * 0.4;
        assert_eq!(stiffness(holds_nm / LEG_YIELDS_RAD, 30.0, 0.1, 655.0), 39.0);
        // 2 √(39 · 0.1) = 3.9.
        assert_eq!(damping(39.0, 0.1, 65.0), 3.9);
        // A weak motor would saturate, a light limb would be unstable, and a giant exceeds the largest gain.
        assert_eq!(stiffness(holds_nm / LEG_YIELDS_RAD, 2.0, 0.1, 655.0), 20.0);
        assert_eq!(stiffness(holds_nm / LEG_YIELDS_RAD, 30.0, 0.001, 655.0), 14.0);
        assert_eq!(damping(39.0, 0.001, 65.0), 0.12);
        assert_eq!(stiffness(1e4, 1e4, 1e3, 655.0), 650.0);
        assert_eq!(stiffness(0.0, 1.0, 1e-6, 655.0), 0.1);
        assert_eq!(damping(600.0, 100.0, 65.0), 65.0);
    }

    /// Eigenvalues of a double integrator under sampled feedback with the largest gains are inside the unit circle (Jury's
    /// criterion).
    #[test]
    fn the_largest_gains_are_stable_at_the_control_rate() {
        for inertia_kg_m2 in [1e-4, 0.01, 0.3] {
            let kp = stiffness(1e6, 1e6, inertia_kg_m2, 655.0);
            let kd = damping(kp, inertia_kg_m2, 65.0);
            let a = kp * CONTROL_PERIOD_S.powi(2) / inertia_kg_m2;
            let b = kd * CONTROL_PERIOD_S / inertia_kg_m2;
            let (trace, det) =
                (2.0 - 0.5 * a - b, (1.0 - 0.5 * a) * (1.0 - b) + a * (1.0 - 0.5 * b));
            assert!(det.abs() < 1.0 && trace.abs() < 1.0 + det, "{inertia_kg_m2}: {trace} {det}");
        }
    }

    #[test]
    fn a_limit_beyond_all_drives_stays_below_the_largest_when_written() {
        for (max, expected) in [(160.0, 160.0), (4_324.851_387_999_997, 4_324.851)] {
            let (taken, remark) = TORQUE.settle(Some(1e6), 1.0, None, 1.0, max);
            assert_eq!(taken, expected);
            assert!(remark.unwrap().contains("the largest value of a drive"));
        }
    }

    #[test]
    fn two_digits_are_kept() {
        let rounded = [0.0123, 9.99, 123.4, 650.0, 0.1, 0.3].map(two_digits);
        assert_eq!(rounded, [0.012, 9.9, 120.0, 650.0, 0.1, 0.3]);
    }
}
