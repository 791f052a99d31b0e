//! Objectives of a design, as functions of the rows of its plan. Their derivatives follow from those of the rows.

use crate::families::Family;
use crate::formulation::System;
use crate::formulation::rows::{Role, Row, Rows, Subject};
use crate::motion::{Ends, Motion};
use crate::plan::Plan;
use crate::problem::{Problem, Weights};
use crate::start;
use rollwalk_robot::GRAVITY_M_S2;
use std::collections::HashMap;

/// Exponent of the power mean that approximates a largest value. A maximum has no derivative where two values are equal.
const PEAK: i32 = 8;
/// Speed below which a motor's power grows with the square of its speed, rad/s. The absolute value has a kink at 0, where
/// motors of symmetrical motions are.
const NEARLY_STILL_RAD_S: f64 = 0.05;
/// Fraction of the largest torque below which a motor's power grows with the square of its torque.
const NEARLY_NOTHING: f64 = 0.01;
/// Smallest displacement of a motion with a cost of transport, m.
const WAY_MIN_M: f64 = 1e-3;

/// Quantity to minimise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Objective {
    /// Costs in the energy of the plan.
    PlanCost,
    /// Joint speed, rad/s: eighth-power mean over all joints and samples, close to the largest value.
    PeakJointSpeed,
    /// Joint torque, N·m: root mean square over all joints and samples.
    JointTorque,
    /// Joint torque, N·m: eighth-power mean over all joints and samples, close to the largest value.
    PeakJointTorque,
    /// Mechanical power, W: mean of |torque × speed| over the motion, summed over all motors. Braking recovers no energy.
    Power,
    /// Cost of transport: power over weight and speed, which is energy over weight and distance.
    CostOfTransport,
}

/// Value of an objective at the rows of a plan, with derivatives.
pub(super) struct ObjectiveValue {
    /// Value of the objective.
    pub value: f64,
    /// Derivatives with respect to the values of rows, each with the row's index.
    slopes: Vec<(usize, f64)>,
}

impl ObjectiveValue {
    /// Gradient with respect to the scaled unknowns.
    pub fn gradient(&self, rows: &Rows, columns: usize) -> Vec<f64> {
        let mut gradient = vec![0.0; columns];
        for &(row, slope) in &self.slopes {
            for k in rows.rows[row].entries.clone() {
                gradient[rows.columns[k]] += slope * rows.derivatives[k];
            }
        }
        gradient
    }

    fn times(mut self, factor: f64) -> Self {
        self.value *= factor;
        self.slopes.iter_mut().for_each(|(_, slope)| *slope *= factor);
        self
    }
}

impl Objective {
    /// Objectives of a design.
    pub const ALL: [Self; 6] = [
        Self::PlanCost,
        Self::PeakJointSpeed,
        Self::JointTorque,
        Self::PeakJointTorque,
        Self::Power,
        Self::CostOfTransport,
    ];

    /// Returns true if the objective is defined for a motion. A motion without displacement has no cost of transport.
    pub fn is_defined(self, motion: &Motion) -> bool {
        self != Self::CostOfTransport || goal_distance_m(motion) > WAY_MIN_M
    }

    /// Returns the value at a plan. NaN for transitions, and for motions on which the objective is not defined.
    pub fn of_plan(self, plan: &Plan, weights: &Weights) -> f64 {
        let motion = &plan.motion;
        if !self.is_defined(motion) || motion.ends == Ends::Prescribed {
            return f64::NAN;
        }
        let problem = Problem::new(motion.model(&plan.robot), motion, weights.clone());
        let mut unknowns = start::neighbour(&problem, plan);
        problem.add_up(&mut unknowns);
        let system = System::selected(&problem, Default::default());
        self.at(&problem, motion, &system.values(&unknowns, Rows::default())).value
    }

    /// Value and derivatives of the objective at the rows of a problem.
    pub(super) fn at(self, problem: &Problem, motion: &Motion, rows: &Rows) -> ObjectiveValue {
        match self {
            Self::PlanCost => plan_cost(rows),
            Self::PeakJointSpeed => norm(rows, Family::JointSpeed, PEAK),
            Self::JointTorque => norm(rows, Family::JointTorque, 2),
            Self::PeakJointTorque => norm(rows, Family::JointTorque, PEAK),
            Self::Power => power(rows),
            Self::CostOfTransport => {
                let weight_n = problem.model.total_mass_kg() * GRAVITY_M_S2;
                power(rows).times(motion.duration_s / (weight_n * goal_distance_m(motion)))
            }
        }
    }
}

/// Distance between start and end of a motion according to its goal, m.
fn goal_distance_m(motion: &Motion) -> f64 {
    let part = |goal: Option<f64>| goal.unwrap_or(0.0);
    part(motion.goal.forward_m).hypot(part(motion.goal.left_m))
}

fn plan_cost(rows: &Rows) -> ObjectiveValue {
    let terms = rows.iter().enumerate().filter_map(|(index, (row, value))| match row.role {
        Role::Cost { weight } => Some((weight * value.powi(2), (index, 2.0 * weight * value))),
        _ => None,
    });
    let (values, slopes): (Vec<f64>, _) = terms.unzip();
    ObjectiveValue { value: values.iter().sum(), slopes }
}

/// Power mean `(Σ xⁿ / N)^(1/n)` over the N rows of a family, where x is the quantity that the row compares with its limit. A
/// speed has two rows with opposite signs, which give the same even power.
fn norm(rows: &Rows, family: Family, n: i32) -> ObjectiveValue {
    let of_family = || rows.rows.iter().enumerate().filter(|(_, row)| row.family == family);
    let count = of_family().count() as f64;
    let sum: f64 = of_family().map(|(index, _)| compared(rows, index).powi(n)).sum();
    if sum <= 0.0 {
        return ObjectiveValue { value: 0.0, slopes: Vec::new() };
    }
    let value = (sum / count).powf(1.0 / f64::from(n));
    let slope = |(index, row): (usize, &Row)| {
        (index, compared(rows, index).powi(n - 1) * row.scale * value / sum)
    };
    ObjectiveValue { value, slopes: of_family().map(slope).collect() }
}

/// Mean over all samples of |torque × speed|, summed over joints and driven wheels.
fn power(rows: &Rows) -> ObjectiveValue {
    const MOTORS: [[Family; 2]; 2] =
        [[Family::JointTorque, Family::JointSpeed], [Family::WheelTorque, Family::WheelMotorSpeed]];
    let mut evaluated = ObjectiveValue { value: 0.0, slopes: Vec::new() };
    let mut samples = 0.0_f64;
    for [torque, speed] in MOTORS {
        let key = |row: &Row| (row.at, subject(row.subject));
        let of = |family: Family| {
            rows.rows.iter().enumerate().filter(move |(_, row)| row.family == family)
        };
        // Either of the two rows of a speed; the sign does not matter.
        let speeds: HashMap<_, _> = of(speed)
            .map(|(index, row)| (key(row), (index, compared(rows, index), row.scale)))
            .collect();
        let mut of_subject: HashMap<_, f64> = HashMap::new();
        for (index, row) in of(torque) {
            let Some((other, speed, scale)) = speeds.get(&key(row)) else { continue };
            let largest = rows.given(index).map_or(0.0, |given| given.value);
            let [torque, per_torque] = smooth(compared(rows, index), NEARLY_NOTHING * largest);
            let [speed, per_speed] = smooth(*speed, NEARLY_STILL_RAD_S);
            evaluated.value += torque * speed;
            evaluated.slopes.push((index, row.scale * per_torque * speed));
            evaluated.slopes.push((*other, scale * per_speed * torque));
            *of_subject.entry(subject(row.subject)).or_default() += 1.0;
        }
        // Wheels have torque in stance only; joints at every sample.
        samples = of_subject.into_values().fold(samples, f64::max);
    }
    if samples > 0.0 { evaluated.times(1.0 / samples) } else { evaluated }
}

/// Smooth approximation of |x|, and its derivative.
fn smooth(x: f64, width: f64) -> [f64; 2] {
    let length = x.hypot(width);
    [length - width, x / length]
}

fn subject(subject: Subject) -> (u8, usize) {
    match subject {
        Subject::Joint(j) => (0, j),
        Subject::EndEffector(j) => (1, j),
        _ => (2, 0),
    }
}

/// Quantity that a row compares with its limit.
fn compared(rows: &Rows, row: usize) -> f64 {
    let limit = rows.given(row).map_or(0.0, |given| -given.slope * given.value);
    rows.values[row] * rows.rows[row].scale + limit
}
