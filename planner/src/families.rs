//! Catalogue of residual families: name, equation, unit, tolerances, kind and advice of each.
//!
//! A family is one constraint, one cost or one check of a plan. Terms write rows of a family, the solver reports its worst
//! family, starts select families, and a diagnosis names them. The report has a row for each. Every plan contains the catalogue
//! ([`Formulation`]) for readers in other languages. All values are in SI units.

mod in_plans;

pub use in_plans::Formulation;

use rollwalk_robot::GRAVITY_M_S2;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

/// Clearance β between end effectors of different links, m (Eq. 2.10).
pub const CLEARANCE_M: f64 = 0.02;
/// Rolling velocity v₀ at which rolling resistance has nearly its full value, m/s. The sign of the velocity is smoothed to
/// tanh(v/v₀).
pub const ROLLING_SIGN_WIDTH_M_S: f64 = 0.05;
/// Tolerance for redundant values in a plan. It is far below any level that matters, and loose enough for files that other
/// programs write with nine digits.
pub const AGREEMENT: f64 = 1e-6;

/// Unit of a family's residuals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Metres.
    M,
    /// Metres per second.
    MPerS,
    /// Radians.
    Rad,
    /// Radians per second.
    RadPerS,
    /// Newtons.
    N,
    /// Newton metres.
    Nm,
    /// Seconds.
    S,
    /// Fraction of a torque-speed line.
    OfLine,
    /// Dimensionless.
    None,
    /// Several units, each the SI unit of its quantity.
    Mixed,
}

impl Unit {
    /// Symbol of the SI unit.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::M => "m",
            Self::MPerS => "m/s",
            Self::Rad => "rad",
            Self::RadPerS => "rad/s",
            Self::N => "N",
            Self::Nm => "N·m",
            Self::S => "s",
            Self::OfLine => "of the line",
            Self::None => "-",
            Self::Mixed => "SI",
        }
    }

    /// Symbol of the unit in tables, and the factor from the SI unit to it. Lengths are shown in millimetres.
    pub const fn shown(self) -> (&'static str, f64) {
        match self {
            Self::M => ("mm", 1000.0),
            Self::MPerS => ("mm/s", 1000.0),
            Self::OfLine => ("-", 1.0),
            other => (other.symbol(), 1.0),
        }
    }
}

/// Tolerance at the samples: the largest residual with which plans succeed in an independent rigid-body simulator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Level {
    /// Residual in the family's unit.
    Residual(f64),
    /// Fraction of the limit that the residual exceeds.
    OfLimit(f64),
    /// Absence of a tolerance, as for costs.
    None,
}

impl Level {
    /// Returns the tolerance as a residual. `limit` is the limit that the residual exceeds, if any.
    pub fn at(self, limit: f64) -> f64 {
        match self {
            Self::Residual(level) => level,
            Self::OfLimit(fraction) => fraction * limit,
            Self::None => f64::INFINITY,
        }
    }
}

/// Tolerance between the samples, as the motion is played: the largest residual with which motions succeed in an independent
/// rigid-body simulator. Tolerances scale with the robot, so that they are as strict for 1 kg as for 100 kg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PlayedTolerance {
    /// Multiple of the tolerance at the samples.
    TimesLevel(f64),
    /// Fraction of the robot's weight.
    OfWeight(f64),
    /// Fraction of the weight times the height of the centre of mass.
    OfMoment(f64),
    /// Fraction of the height of the centre of mass.
    OfHeight(f64),
    /// Fraction of √(g · height), the speed at which a leg of that height falls over.
    OfSpeed(f64),
    /// Absence of a tolerance: the residual is only printed.
    None,
}

/// Reference values for tolerances as played.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scales {
    /// Weight of the robot, N.
    pub weight_n: f64,
    /// Mean height of the centre of mass over the motion, m.
    pub height_m: f64,
}

impl PlayedTolerance {
    /// Returns the tolerance in the family's unit, if it follows from the robot.
    pub fn at(self, scales: &Scales) -> Option<f64> {
        let Scales { weight_n, height_m } = *scales;
        match self {
            Self::OfWeight(part) => Some(part * weight_n),
            Self::OfMoment(part) => Some(part * weight_n * height_m),
            Self::OfHeight(part) => Some(part * height_m),
            Self::OfSpeed(part) => Some(part * (GRAVITY_M_S2 * height_m).sqrt()),
            Self::TimesLevel(_) | Self::None => None,
        }
    }
}

/// Kind of a family.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Request of the motion.
    Request,
    /// Limit of motors, joints or the ground.
    Limit,
    /// Construction or kinematics of the robot.
    Build,
    /// Weighted objective, which cannot be violated.
    Cost,
    /// Check of plans only. The optimiser has no term for it.
    Check,
}

/// Advice for motions beyond the reach of the legs.
const REACH: &str = "a motion within the legs' reach, with shorter strides and lower swings";

/// Advice on the change that would help to meet a constraint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Advice {
    /// Absence of advice.
    NoAdvice,
    /// Reason why no change helps.
    Nothing(&'static str),
    /// A change of the motion or the robot.
    Change(&'static str),
    /// A longer duration, or another change.
    LongerOr(&'static str),
}

impl Advice {
    /// True if the advice is a change.
    pub fn is_change(self) -> bool {
        matches!(self, Self::Change(_) | Self::LongerOr(_))
    }

    /// The same advice for a motion that has the longest duration.
    pub fn without_duration(self) -> Self {
        match self {
            Self::LongerOr(change) => Self::Change(change),
            other => other,
        }
    }
}

impl fmt::Display for Advice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoAdvice => Ok(()),
            Self::Nothing(why) => write!(f, "nothing ({why})"),
            Self::Change(change) => f.write_str(change),
            Self::LongerOr(change) => write!(f, "a longer duration or {change}"),
        }
    }
}

/// Entry of the catalogue.
struct Info {
    name: &'static str,
    equation: &'static str,
    unit: Unit,
    level: Level,
    kind: Kind,
    advice: Advice,
}

/// Declares [`Family`] and the table of its entries from one list.
macro_rules! catalogue {
    ($($family:ident: $name:literal, $equation:literal, $unit:ident, $level:expr, $kind:ident, $advice:expr;)*) => {
        /// Family of residuals.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Family {
            $(#[doc = $name] $family,)*
        }

        impl Family {
            /// Set of all families, in the order of the formulation.
            pub const ALL: &[Self] = &[$(Self::$family,)*];

            const INFO: &[Info] = &[$(Info {
                name: $name,
                equation: $equation,
                unit: Unit::$unit,
                level: $level,
                kind: Kind::$kind,
                advice: $advice,
            },)*];
        }
    };
}

use Advice::{Change, LongerOr, NoAdvice, Nothing};
use Level::{OfLimit, Residual};

catalogue! {
    LinearDynamics: "linear dynamics", "Eq. 2.3, mean", N, Residual(0.3), Request,
        Change("footfalls with more feet on the ground, or shorter flights");
    AngularDynamics: "angular dynamics", "Eq. 2.4, mean", Nm, Residual(0.03), Request,
        Change("footfalls whose stance feet surround the centre of mass");
    Friction: "friction", "Eq. 2.5", N, Residual(0.2), Limit,
        Change("a motion with lower accelerations, or a higher friction_coefficient");
    FreeWheelTraction: "free-wheel traction", "Eq. 2.6", N, Residual(0.2), Limit,
        Change("a slower motion, or an actuated wheel to push with");
    SwingForce: "swing force", "Eq. 2.7", N, Residual(0.2), Request,
        Change("footfalls with more feet on the ground");
    Slip: "slip", "Eq. 2.8, midpoint", MPerS, Residual(0.005), Build,
        Change("a goal along the rolling directions of the wheels, or footfalls in which each displaced \
         foot takes a step");
    ContactHeight: "contact height", "Eq. 2.9", M, Residual(0.001), Request,
        Change("a lower swing_height_m or a longer swing");
    EndEffectorClearance: "end-effector clearance", "Eq. 2.10", M, Residual(0.001), Limit,
        Change("a posture with feet further apart");
    LinkClearance: "link clearance", "shapes", M, Residual(0.001), Limit,
        Change("a posture with limbs further apart, shorter strides, or smaller shapes in the robot file");
    GroundClearance: "ground clearance", "shapes", M, Residual(0.001), Limit,
        Change("a higher body, or a posture with knees further from the ground");
    WheelAxis: "wheel axis", "Eq. 2.13", Rad, Residual(0.5 * std::f64::consts::PI / 180.0), Build,
        Change("a motion in directions to which the joints can steer the wheel");
    ContactPoint: "contact point", "Eq. 2.14", M, Residual(0.001), Build, Change(REACH);
    BladeContact: "contact on the blade", "sec. 3.5.2", M, Residual(0.001), Build,
        Change("a smaller pitch of the skates");
    HeldWheel: "held wheel", "Eq. 2.15, about the axis", MPerS, Residual(0.005), Build,
        Change("a nearer goal, footfalls with steps, or wheels that turn");
    JointLimit: "joint limit", "sec. 2.4.1", Rad, Residual(0.05), Limit,
        Change("shorter strides, or wider limits in the robot file");
    JointSpeed: "joint speed", "sec. 2.4.1", RadPerS, OfLimit(0.1), Limit,
        LongerOr("shorter strides");
    WheelMotorSpeed: "wheel motor speed", "sec. 2.4.1", RadPerS, OfLimit(0.1), Limit, LongerOr("a nearer goal");
    JointTorque: "joint torque", "limb dynamics, mean", Nm, OfLimit(0.1), Limit,
        Change("straighter legs in [posture], or stronger motors");
    PassiveJoint: "passive joint", "limb dynamics, mean", Nm, Residual(0.03), Build,
        Change("a stiffer spring, a rest_rad nearer to the loaded angle, or wider limits of the joint");
    WheelTorque: "wheel torque", "radius × traction", Nm, OfLimit(0.1), Limit,
        Change("a motion with lower accelerations, or stronger wheel motors");
    TorqueSpeedLine: "torque-speed line", "torque and speed, mean", OfLine, Residual(0.1), Limit,
        LongerOr("stronger motors");
    Anchor: "anchor", "sec. 2.4.1", M, Residual(0.001), Build,
        Nothing("this constraint only fixes the start of the motion");
    DisplacementGoal: "displacement goal", "sec. 2.4.1", M, Residual(0.001), Request, LongerOr("a nearer goal");
    TurningGoal: "turning goal", "sec. 2.4.1", Rad, Residual(0.001), Request,
        LongerOr("a smaller turn");
    TargetPosition: "target position", "sec. 2.4.1", M, Residual(0.001), Request,
        Change("a target nearer to where the motion passes, or a target at another time");
    TargetVelocity: "target velocity", "sec. 2.4.1", MPerS, Residual(0.005), Request,
        Change("a slower target, or a target at another time");
    TargetHeading: "target heading", "sec. 2.4.1", Rad, Residual(0.001), Request,
        Change("a heading nearer to the headings of the rest of the motion, or a target at another time");
    HeightLimit: "height limit", "sec. 3.5.2", M, Residual(0.001), Request,
        Change("a height within the legs' reach, or other height limits at that time");
    Smoothness: "smoothness", "sec. 2.4.1", Mixed, Level::None, Cost, NoAdvice;
    EvenForce: "even force", "sec. 2.4.1", N, Level::None, Cost, NoAdvice;
    Posture: "posture", "sec. 2.4.1", Mixed, Level::None, Cost, NoAdvice;
    EndLean: "lean at the end", "net displacement", Mixed, Level::None, Cost, NoAdvice;
    WheelEffort: "wheel effort", "sec. 2.4.1", MPerS, Level::None, Cost, NoAdvice;
    WheelSmoothness: "wheel smoothness", "sec. 2.4.1", MPerS, Level::None, Cost, NoAdvice;
    Steering: "steering", "velocity in the heading's frame", Mixed, Level::None, Cost, NoAdvice;
    LiftOffSlip: "slip at lift-off", "sec. 2.4.1", MPerS, Level::None, Cost, NoAdvice;
    // Wheels that land are rows of the slip in a solve, feet in swing follow their profile there.
    LandingSlip: "landing slip", "Eq. 2.8, midpoint", MPerS, Residual(0.005), Check, NoAdvice;
    MeanSlip: "mean slip", "mean in stance", MPerS, Residual(0.005), Check, NoAdvice;
    Creep: "slip in a stance", "sum in stance", M, Residual(0.001), Check, NoAdvice;
    JointTorqueAsPlayed: "joint torque as played", "inverse dynamics", Nm, OfLimit(0.1), Check, NoAdvice;
    WheelTorqueAsPlayed: "wheel torque as played", "inverse dynamics", Nm, OfLimit(0.1), Check, NoAdvice;
    UnmetForce: "unmet force", "inverse dynamics", N, Residual(0.3), Check, NoAdvice;
    UnmetMoment: "unmet moment", "inverse dynamics", Nm, Residual(0.03), Check, NoAdvice;
    SwingDepth: "depth in swing", "Eq. 2.9", M, Residual(0.001), Check, NoAdvice;
    CentreOfMass: "centre of mass", "Eq. 2.11", M, Residual(0.001), Check, NoAdvice;
    MotorAgainstWheel: "motor against wheel", "conventions", MPerS, Residual(0.005), Check, NoAdvice;
    BaseOrientation: "base orientation", "Eq. 2.12", None, Residual(AGREEMENT), Check, NoAdvice;
    Duration: "duration", "plan format", S, Residual(AGREEMENT), Check, NoAdvice;
    Time: "time", "plan format", S, Residual(AGREEMENT), Check, NoAdvice;
    Ends: "ends", "plan format", Mixed, Residual(AGREEMENT), Check, NoAdvice;
    ContactFlag: "contact flag", "plan format", None, Residual(0.5), Check, NoAdvice;
    Foothold: "foothold", "terrain", M, Residual(0.001), Request,
        Change("strides that end on the treads (goal, cycles), or a smaller margin_m");
    SwingClearance: "swing clearance", "terrain, half-way", M, Residual(0.001), Request,
        Change("a higher swing_height_m, or swings of more samples");
    ObstacleClearance: "obstacle clearance", "shapes", M, Residual(0.001), Limit,
        Change("a wider gap, a farther goal, a lower posture, or a smaller margin_m of the obstacle");
}

impl Family {
    const fn info(self) -> &'static Info {
        &Self::INFO[self as usize]
    }

    /// Returns the family with the given name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|family| family.name() == name)
    }

    /// Name in progress messages, outcomes, diagnoses and reports.
    pub const fn name(self) -> &'static str {
        self.info().name
    }

    /// Number of the equation in the thesis, or a description.
    pub const fn equation(self) -> &'static str {
        self.info().equation
    }

    /// Unit of the residuals.
    pub const fn unit(self) -> Unit {
        self.info().unit
    }

    /// Tolerance at the samples.
    pub const fn level(self) -> Level {
        self.info().level
    }

    /// Tolerance between the samples.
    pub const fn as_played(self) -> PlayedTolerance {
        use PlayedTolerance::{OfHeight, OfMoment, OfSpeed, OfWeight, TimesLevel};
        match self {
            // 1.15 times the most of a motion that holds, and less than of any that missed its way by more than 8 %.
            Self::MeanSlip => OfSpeed(0.0035),
            // Of robots that were not tuned, walks with up to 1.33 % of the height held. From 1.37 % on, some reached 0.95 of
            // the distance or less.
            Self::Creep => OfHeight(0.014),
            // Peaks of some milliseconds, the highest where passive wheels land.
            Self::Slip | Self::LandingSlip => OfSpeed(0.15),
            // 1 mm for a robot of 0.25 m. A foot that stands higher carries nothing; a foot that stands lower carries all.
            Self::ContactHeight => OfHeight(0.004),
            Self::SwingDepth => OfHeight(0.015),
            Self::UnmetForce => OfWeight(0.06),
            Self::UnmetMoment => OfMoment(0.05),
            Self::LinearDynamics => OfWeight(0.07),
            Self::AngularDynamics => OfMoment(0.05),
            Self::JointLimit | Self::JointSpeed | Self::WheelMotorSpeed => TimesLevel(1.0),
            Self::LinkClearance | Self::GroundClearance | Self::ObstacleClearance => {
                TimesLevel(1.0)
            }
            Self::JointTorqueAsPlayed | Self::WheelTorqueAsPlayed => TimesLevel(1.0),
            _ => PlayedTolerance::None,
        }
    }

    /// Kind of the family.
    pub const fn kind(self) -> Kind {
        self.info().kind
    }

    /// Returns true if the family requires a displacement or a turn over the whole motion.
    pub fn is_goal(self) -> bool {
        matches!(self, Self::DisplacementGoal | Self::TurningGoal)
    }

    /// Advice on the change that would help.
    pub fn advice(self) -> Advice {
        self.info().advice
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl Serialize for Family {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for Family {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Self::by_name(&name).ok_or_else(|| {
            let name = name.escape_debug();
            serde::de::Error::custom(format!("\"{name}\"; expected the name of a constraint"))
        })
    }
}

/// Set of families.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FamilySet(u64);

const _: () = assert!(Family::ALL.len() <= 64, "a set holds 64 families");

impl FamilySet {
    /// Set of all families.
    pub const ALL: Self = Self(u64::MAX);
    /// Limits due to shapes that obstruct a motion. A stronger motor does not remove them.
    pub const OBSTACLES: Self =
        Self::of(&[Family::LinkClearance, Family::GroundClearance, Family::ObstacleClearance]);

    /// Families of joints without a motor. Plans of other robots do not list them.
    pub const PASSIVE: Self = Self::of(&[Family::PassiveJoint]);

    /// Families of motions at rest. Plans of other motions do not list them.
    pub const AT_REST: Self = Self::of(&[Family::EndLean]);

    /// Families of terrain with edges or obstacles. Plans on other ground do not list them.
    pub const TERRAIN: Self =
        Self::of(&[Family::Foothold, Family::SwingClearance, Family::ObstacleClearance]);

    /// Returns the set of the given families.
    pub const fn of(families: &[Family]) -> Self {
        Self(0).with(families)
    }

    /// Returns the set with the given families added.
    pub const fn with(self, families: &[Family]) -> Self {
        let mut bits = self.0;
        let mut next = 0;
        while next < families.len() {
            bits |= 1 << families[next] as u64;
            next += 1;
        }
        Self(bits)
    }

    /// Returns true if the set contains the family.
    pub const fn contains(self, family: Family) -> bool {
        self.0 >> family as u64 & 1 == 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_lead_back_to_their_family() {
        for &family in Family::ALL {
            assert_eq!(Family::by_name(family.name()), Some(family));
        }
    }

    #[test]
    fn sets_hold_what_they_were_made_of() {
        let set = FamilySet::of(&[Family::Slip]).with(&[Family::Ends]);
        for &family in Family::ALL {
            let wanted = matches!(family, Family::Slip | Family::Ends);
            assert_eq!((set.contains(family), FamilySet::ALL.contains(family)), (wanted, true));
        }
    }

    #[test]
    fn what_can_be_diagnosed_has_advice_and_a_level() {
        for &family in Family::ALL {
            let diagnosed = !matches!(family.kind(), Kind::Cost | Kind::Check);
            assert_eq!(family.advice() != NoAdvice, diagnosed, "{family}");
            assert_eq!(family.level() == Level::None, family.kind() == Kind::Cost, "{family}");
        }
    }

    /// Checks that the table in `docs/formats/plan-format.md` has all reported families with their levels.
    #[test]
    fn the_plan_format_lists_every_family_with_its_level() {
        let text = include_str!("../../docs/formats/plan-format.md");
        let (_, text) = text.split_once("## Residuals and their levels").expect("its section");
        for &family in Family::ALL.iter().filter(|family| family.kind() != Kind::Cost) {
            let (unit, factor) = family.unit().shown();
            let level = match family.level() {
                // Rounded as in the table: 0.5° in mrad.
                Residual(level) => {
                    format!("{} {unit}", (level * factor * 1e7).round() / 1e7)
                }
                OfLimit(fraction) => format!("{} % of the limit", fraction * 100.0),
                Level::None => unreachable!("costs have no level"),
            };
            let line = text.lines().find(|line| line.starts_with(&format!("| {family} |")));
            let line = line.unwrap_or_else(|| panic!("no row `| {family} |`"));
            let level = level.trim_end_matches(" -");
            assert!(line.ends_with(&format!("| {level} |")), "{line}\nexpected level {level}");
        }
    }

    /// Checks that the table of tolerances as played agrees with the catalogue.
    #[test]
    fn the_plan_format_lists_every_tolerance_as_played() {
        let text = include_str!("../../docs/formats/plan-format.md");
        let (_, text) = text.split_once("## Between the samples").expect("its section");
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        for &family in Family::ALL {
            let percent = |part: f64, of: &str| format!("{} % of {of}", (part * 1e6).round() / 1e4);
            let tolerance = match family.as_played() {
                PlayedTolerance::TimesLevel(times) => format!("{times} times the level"),
                PlayedTolerance::OfWeight(part) => percent(part, "W"),
                PlayedTolerance::OfMoment(part) => percent(part, "W h"),
                PlayedTolerance::OfHeight(part) => percent(part, "h"),
                PlayedTolerance::OfSpeed(part) => percent(part, "√(g h)"),
                PlayedTolerance::None => continue,
            };
            let items =
                text.split(" - ").map(|item| item.split(" `rollwalk report").next().unwrap());
            let parts = items.filter_map(|item| {
                let number = item.find(|c: char| c.is_ascii_digit())?;
                Some((item[..number].strip_suffix(' ')?, item[number..].trim_end()))
            });
            let mut listed =
                parts.filter(|(names, _)| names.split(", ").any(|name| name == family.name()));
            assert_eq!(listed.next().map(|(_, of)| of), Some(tolerance.as_str()), "{family}");
        }
    }

    #[test]
    fn tolerances_as_played_grow_with_the_robot() {
        let robot = |weight_n, height_m| Scales { weight_n, height_m };
        let of = |family: Family, robot| family.as_played().at(&robot).expect("of the robot");
        let (small, large) = (robot(10.0, 0.1), robot(1000.0, 0.9));
        for (family, times) in [
            (Family::UnmetForce, 100.0),
            (Family::UnmetMoment, 900.0),
            (Family::ContactHeight, 9.0),
            (Family::MeanSlip, 3.0),
        ] {
            let ratio: f64 = of(family, large) / of(family, small);
            assert!((ratio / times - 1.0).abs() < 1e-12, "{family}: {ratio}");
        }
    }
}
