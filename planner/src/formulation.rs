//! The formulation: which constraints and objectives make up E(m). Read this file first.
//!
//! With multipliers s, penalty ρ and ψ_ε of Eq. 2.16, over all rows r (divided by their scales):
//!
//! ```text
//! E(m) = Σ_equalities ρ (r + s)²  +  Σ_inequalities ρ ψ_ε(r + s)  +  Σ_costs w r²
//! ```
//!
//! | constraint | equation | term |
//! |---|---|---|
//! | linear dynamics | 2.3 | [`DynamicsLinear`] |
//! | angular dynamics | 2.4 | [`DynamicsAngular`] |
//! | friction cone, unilateral contact | 2.5 | [`Friction`] |
//! | traction of free wheels | 2.6 | [`Traction`] |
//! | no force in swing | 2.7 | [`SwingForce`] |
//! | no slip | 2.8, at the midpoint | [`NoSlip`] |
//! | contact height | 2.9, with a profile | [`ContactHeight`] |
//! | end effectors apart | 2.10 | [`Collision`] |
//! | wheel axis | 2.13 | [`WheelAxis`] |
//! | contact point | 2.14 | [`ContactPoint`] |
//! | contact between the ends of a blade | | [`BladeContact`] |
//! | welded wheels, held wheels | in place of 2.15 | [`WheelHeld`] |
//! | joint angle, joint speed, wheel speed limits | "physical hardware constraints" | [`JointLimit`], [`JointSpeed`], [`WheelSpeed`] |
//! | motor torque limits from planned forces | quasi-static | [`JointTorque`], [`WheelTorque`] |
//! | torque-speed lines of motors | quasi-static | [`TorqueSpeed`] |
//! | anchor of the start, displacement, turn | "boundary conditions", "functional objectives" | [`Anchor`], [`Displacement`], [`Turn`] |
//! | targets at chosen times | "functional objectives" | [`TargetPosition`], [`TargetVelocity`], [`TargetHeading`] |
//! | heights to keep between | sec. 3.5.2 | [`HeightBound`] |
//!
//! Equations 2.11 and 2.12 (centre of mass, body orientation) hold by elimination; periodic, at-rest
//! and prescribed ends by construction of the timeline ([`crate::variables`]).
//!
//! | cost | what it does | term |
//! |---|---|---|
//! | smoothness | thesis: weight 0.1 on second differences of q | [`Smoothness`] |
//! | even forces | decides transfer to soft servos | [`EvenForce`] |
//! | posture | near the nominal pose | [`Posture`] |
//! | wheel speed, wheel smoothness | fixes free speeds; no jumps | [`WheelEffort`], [`WheelSmoothness`] |

use crate::families::Family;
use crate::problem::{Problem, Unknowns};
use crate::rows::{Columns, RowWriter, Rows, Window};
use crate::state::State;
use crate::terms::{
    Anchor, BladeContact, Collision, ContactHeight, ContactPoint, Displacement, DynamicsAngular,
    DynamicsLinear, EvenForce, Friction, HeightBound, JointLimit, JointSpeed, JointTorque, NoSlip,
    Posture, Smoothness, SwingForce, TargetHeading, TargetPosition, TargetVelocity, TorqueSpeed,
    Traction, Turn, WheelAxis, WheelEffort, WheelHeld, WheelSmoothness, WheelSpeed, WheelTorque,
};

/// Which samples a term looks at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Span {
    /// Every sample of the motion with its neighbours.
    Samples,
    /// Every interval of the motion: samples 1 and 2 of the window are its ends.
    Intervals,
    /// Once: samples 1 and 2 of the window are the first sample and the one at which the
    /// displacement is measured.
    Ends,
}

/// What a term writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TermInfo {
    /// Family of its rows.
    pub family: Family,
    /// Which samples it looks at.
    pub span: Span,
}

/// Writer of one family of residuals.
pub trait Term: Sync {
    /// What it writes.
    fn info(&self) -> TermInfo;
    /// Writes its rows for one window, with derivatives.
    fn write(&self, window: &Window, out: &mut RowWriter);
}

/// All terms of the formulation.
pub static TERMS: &[&dyn Term] = &[
    &DynamicsLinear,
    &DynamicsAngular,
    &Friction,
    &Traction,
    &SwingForce,
    &NoSlip,
    &ContactHeight,
    &Collision,
    &WheelAxis,
    &ContactPoint,
    &BladeContact,
    &WheelHeld,
    &JointLimit,
    &JointSpeed,
    &WheelSpeed,
    &JointTorque,
    &WheelTorque,
    &TorqueSpeed,
    &Anchor,
    &Displacement,
    &Turn,
    &TargetPosition,
    &TargetVelocity,
    &TargetHeading,
    &HeightBound,
    &Smoothness,
    &EvenForce,
    &Posture,
    &WheelEffort,
    &WheelSmoothness,
];

/// Whether a term with this span looks at the window whose middle is timeline sample `t`.
fn covers(problem: &Problem, span: Span, t: usize) -> bool {
    match span {
        Span::Samples => t <= problem.samples,
        Span::Intervals => t < problem.last(),
        Span::Ends => false,
    }
}

/// Residuals and Jacobian of every term.
pub fn evaluate(
    problem: &Problem,
    columns: &Columns,
    unknowns: &Unknowns,
    states: &[State],
    reuse: Rows,
) -> Rows {
    let mut out = RowWriter::new(problem, columns, unknowns, states, reuse);
    let mut write = |term: &dyn Term, at: [usize; 3]| {
        out.enter(term.info().family, at);
        term.write(&Window { problem, at, states: at.map(|t| &states[t]) }, &mut out);
    };
    let active = || TERMS.iter().filter(|term| problem.only.contains(term.info().family));
    // Window by window: what the rows of one window touch of the normal equations stays in cache.
    for t in 1..states.len() - 1 {
        for term in active().filter(|term| covers(problem, term.info().span, t)) {
            write(*term, [t - 1, t, t + 1]);
        }
    }
    for term in active().filter(|term| term.info().span == Span::Ends) {
        write(*term, [0, 1, problem.last()]);
    }
    out.finish()
}
