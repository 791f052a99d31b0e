//! Receding horizon: repeated planning of the next seconds from a measured state, steered as by a joystick. This is
//! model-predictive control with the full planner, as real-time iteration (Diehl et al., 2005).
//!
//! A [`Horizon`] is created once for a robot, a [`Gait`] and a length. Each [`Horizon::plan`] takes the measured state and the
//! requested velocity, and returns a normal [`Plan`]. The plan begins in this state with its velocity, and does not end at
//! rest. The problem is that of `Problem::horizon`:
//!
//! * **Start.** The nearest state whose feet touch the ground without slip (`measured`) is given, with its velocity.
//! * **Contacts** are those of the gait at the index of the sample (`schedule`). End effectors in the air continue their swing
//!   from their height and rate. A foot that has landed early stands.
//! * **End.** The end has no constraints. Costs draw velocity and yaw rate to the requested ones in all intervals
//!   (`Family::Steering`), and the posture to that of the gait. The robot can thus continue or stop from there.
//! * **Ground** may be a terrain or a sensed map ([`HorizonGround`]), and may be exchanged between two plans. End effectors that
//!   stand keep their height, and swings in their second half keep their foothold (`footholds`). Plans on such ground are in
//!   world axes.
//! * **Time** is limited by the caller. The callback stops the solve, which returns the best samples so far.
//!
//! A [`Course`] plays horizons one after the other without feedback, as set-points.
//!
//! A solve starts from the gait plus the measured error, which fades (`start`). Only footfalls, and the landings of accepted
//! plans, are carried from one plan to the next, so that a failed plan does not affect later ones. Structure that does not depend
//! on values is kept for each footfall pattern, as in [`Editing`](crate::Editing).

mod course;
mod error;
mod footholds;
mod gait;
mod ground;
mod measured;
mod schedule;
mod start;
mod trim;

pub use course::{Course, CourseError, Frame, Stretch};
pub use error::HorizonError;
use gait::base_placement;
pub use gait::{Gait, GaitError};
pub use ground::HorizonGround;

use crate::families::Family;
use crate::formulation::rows::Rows;
use crate::formulation::{Selection, Structure, System};
use crate::motion::{Ends, Footing, Goal, Motion, Stand};
use crate::plan::{Placement, Plan, SolveStart, SolveSummary, StartKind, Status};
use crate::planning::write_plan;
use crate::problem::variables::Layout;
use crate::problem::{HorizonGoal, Problem, Unknowns, Weights};
use crate::solve::normal::NormalEquations;
use crate::solve::{ACCEPTED_LEVEL, Point, Progress, Settings, SolveMode, SolveOutcome, Solver};
use crate::start::guess;
use crate::torque;
use footholds::{Footholds, Landing};
use nalgebra::Isometry3;
use rollwalk_multibody::euler::Model;
use rollwalk_multibody::ground::FieldError;
use rollwalk_multibody::{Frames, Kinematics, RimContact, State, Tree};
use rollwalk_robot::Robot;
use schedule::{ContactState, Schedule};
use start::InitialState;
use std::collections::HashMap;
use std::fmt;
use std::ops::ControlFlow;

/// Requested velocity of the body, in the frame of its heading.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Steering {
    /// Velocity along the heading, m/s.
    pub forward_m_s: f64,
    /// Velocity to the left of the heading, m/s.
    pub left_m_s: f64,
    /// Yaw rate, rad/s, positive to the left.
    pub turn_rad_s: f64,
}

/// Measured state in the world. Level ground is its plane z = 0.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredState<'a> {
    /// Pose and velocity, in the coordinates of [`Horizon::tree`].
    pub state: &'a State,
    /// Contact flag of each end effector: true on the ground.
    pub touches: &'a [bool],
}

/// Options of a horizon.
#[derive(Clone, Debug, PartialEq)]
pub struct HorizonOptions {
    /// Length, s. At least a period of the gait, because the weight must shift to feet that stand later.
    pub duration_s: f64,
    /// Weights of the formulation.
    pub weights: Weights,
    /// Settings of the solver. A horizon is replaced before it ends, so that constraints need to be met only to the level at
    /// which plans are accepted.
    pub settings: Settings,
}

impl Default for HorizonOptions {
    fn default() -> Self {
        let settings = Settings {
            iterations: 60,
            target_level: ACCEPTED_LEVEL,
            flat: 0.01,
            ..Settings::default()
        };
        Self { duration_s: 1.0, weights: Weights::default(), settings }
    }
}

/// Plan of a horizon.
#[derive(Clone, Debug)]
pub struct HorizonPlan {
    /// Plan. On level ground it begins at the origin of its world with heading 0. The plan's solve summary contains the status
    /// and the worst constraint.
    pub plan: Plan,
    /// Pose of the plan's world in the world.
    pub world_from_plan: Isometry3<f64>,
    /// End effector without a steppable position near its landing. Such a plan is not accepted.
    pub without_foothold: Option<usize>,
}

impl HorizonPlan {
    /// Returns true if all end effectors have footholds, and all constraints are met within the tolerances of plans.
    /// [`SolveSummary::worst_constraint`] names the worst constraint.
    pub fn is_accepted(&self) -> bool {
        self.without_foothold.is_none() && self.plan.solve.worst_level <= ACCEPTED_LEVEL
    }
}

/// Minimum number of samples of a horizon.
const LEAST_SAMPLES: usize = 5;
/// Maximum number of footfall patterns with kept structure. A walk has fewer.
const MOST_KEPT: usize = 64;

/// Planner of horizons of one robot.
pub struct Horizon {
    model: Model,
    tree: Tree,
    options: HorizonOptions,
    samples: usize,
    interval_s: f64,
    schedule: Schedule,
    ground: HorizonGround,
    /// Ground for the present gait.
    footing: Footing,
    /// Planned landing of each end effector.
    landings: Vec<Option<Landing>>,
    kept: HashMap<RowPattern, ReusedSolve>,
}

/// Rows of a problem: number of borders of each contact in stance, `[sample][end effector]`; `None` in swing.
type RowPattern = Vec<Vec<Option<usize>>>;

impl fmt::Debug for Horizon {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Horizon").field("options", &self.options).finish_non_exhaustive()
    }
}

/// Results of one solve that the next one with the same footfalls reuses.
struct ReusedSolve {
    structure: Structure,
    normal: NormalEquations,
    rows: Rows,
}

impl Horizon {
    /// Creates a planner for a robot whose gait begins at sample 0. Before that, all end effectors are on the ground.
    ///
    /// # Errors
    /// Returns an error if the horizon has too few samples, or if the gait belongs to another robot.
    pub fn new(robot: &Robot, gait: Gait, options: HorizonOptions) -> Result<Self, HorizonError> {
        let interval_s = gait.interval_s();
        let intervals = (options.duration_s / interval_s).round();
        let samples = if intervals.is_finite() { intervals as usize + 1 } else { 0 };
        if samples < LEAST_SAMPLES {
            let duration_s = options.duration_s;
            return Err(HorizonError::TooShort {
                duration_s,
                samples,
                interval_s,
                least: LEAST_SAMPLES,
            });
        }
        check_gait(&gait, robot, interval_s)?;
        Ok(Self {
            model: Model::new(robot),
            tree: torque::tree(robot),
            options,
            samples,
            interval_s,
            ground: HorizonGround::Level,
            footing: Footing::default(),
            landings: vec![None; robot.end_effectors.len()],
            schedule: Schedule::new(gait, 0),
            kept: HashMap::new(),
        })
    }

    /// Returns the robot with its wheels and rotors as bodies. States have the generalised velocities of this tree.
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// Sample spacing, s. Successive plans begin a whole number of samples apart.
    pub fn interval_s(&self) -> f64 {
        self.interval_s
    }

    /// Changes to another gait at a sample. End effectors in the air finish their swing first.
    ///
    /// # Errors
    /// Returns an error if the gait belongs to another robot or has another sample spacing.
    pub fn change_gait(&mut self, gait: Gait, at: u64) -> Result<(), HorizonError> {
        check_gait(&gait, self.model.robot(), self.interval_s)?;
        self.schedule.change(gait, at as i64);
        let ground = self.ground.clone();
        self.change_ground(ground)
    }

    /// Exchanges the ground for the plans to come. The initial ground is level. A map without known heights has no effect.
    ///
    /// # Errors
    /// Returns an error if a map is not valid.
    pub fn change_ground(&mut self, ground: HorizonGround) -> Result<(), HorizonError> {
        let footing = match ground.footing(self.model.robot(), &self.schedule.gait.motion) {
            Err(FieldError::Unknown) => return Ok(()),
            footing => footing?,
        };
        if footing.has_edges() != self.footing.has_edges() || footing.is_level() != self.is_level()
        {
            self.kept.clear();
        }
        (self.ground, self.footing) = (ground, footing);
        Ok(())
    }

    /// Plans from a measured state at sample `at`. Samples count from 0 at the creation of the horizon.
    ///
    /// `progress` is called after every iteration and may stop the solve. The plan then has the best samples so far.
    ///
    /// # Errors
    /// Returns an error if the state belongs to another robot, or if a value is not finite.
    pub fn plan(
        &mut self,
        measured: MeasuredState<'_>,
        at: u64,
        steering: Steering,
        progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<HorizonPlan, HorizonError> {
        self.check(measured, steering)?;
        let at = at as i64;
        let ground = self.footing.with_stands(self.stands(measured));
        let schedule = &self.schedule;
        let places = self.contact_states(&ground, measured, at);
        let stands = &schedule.from(at, self.samples, &places, !self.is_level()).stance[0];
        let state = measured::on_contacts(&self.tree, &ground, measured.state, stands);
        // On its contacts, the robot holds a swing foot a little higher or lower.
        let on_contacts = MeasuredState { state: &state, touches: stands };
        let places = self.contact_states(&ground, on_contacts, at);
        let footfalls = schedule.from(at, self.samples, &places, !self.is_level());
        let place = measured::over_ground(&state);
        // Terrain is in world axes, and plans on it are, too.
        let (world_from_plan, from) = match self.is_level() {
            true => (measured::isometry(&place), Placement::default()),
            false => (Isometry3::identity(), place),
        };
        let wanted = [steering.forward_m_s, steering.left_m_s, steering.turn_rad_s];
        let of_interval = |i: usize| {
            let sway = self.sway(at + i as i64);
            [0, 1, 2].map(|c| wanted[c] + sway[c])
        };
        let steering: Vec<_> = (0..self.samples - 1).map(of_interval).collect();
        let (interval_s, samples) = (self.interval_s, self.samples);
        let path = |velocity| start::path(&steering, velocity, from, interval_s, samples + 1);
        let (contacts, landings, without_foothold) = match self.is_level() {
            true => (None, self.landings.clone(), None),
            false => {
                let footholds = Footholds {
                    tree: &self.tree,
                    layout: &Layout::new(&self.model),
                    gait: &schedule.gait,
                    ground: &ground,
                    path: &path(measured::heading_velocity(&state)),
                    at,
                    phase: schedule.phase(at),
                    landings: &self.landings,
                };
                let assigned = footholds.assign(&state, &footfalls);
                (Some(assigned.contacts), assigned.landings, assigned.without_foothold)
            }
        };
        let motion = Motion {
            name: "horizon".into(),
            duration_s: (self.samples - 1) as f64 * self.interval_s,
            ends: Ends::Prescribed,
            goal: Goal::default(),
            targets: Vec::new(),
            heights: Vec::new(),
            stance: footfalls.stance,
            ground,
            ..schedule.gait.motion.clone()
        };
        let (height_m, steering) = (footfalls.height_m, steering.clone());
        let goal = HorizonGoal { start: from, height_m, steering, contacts };
        let mut problem =
            Problem::horizon(self.model.clone(), &motion, goal, self.options.weights.clone());
        let state = state.moved(&world_from_plan.inverse());
        let beginning = measured::beginning(&problem, &self.tree, state);
        if !self.is_level() {
            begin_swings(&mut problem, &beginning);
        }
        let path = path(beginning.heading_velocity(interval_s, &from));
        let gait = &schedule.gait;
        let start = start::from_gait(&problem, gait, schedule.phase(at), &path, &beginning);
        let (unknowns, solve) = self.solve(&problem, start, progress);
        let plan = write_plan(&problem, &motion, &unknowns, solve);
        let found = HorizonPlan { plan, world_from_plan, without_foothold };
        if found.is_accepted() {
            self.landings = landings;
        }
        Ok(found)
    }

    fn is_level(&self) -> bool {
        self.footing.is_level()
    }

    /// Ground maps corrected to pass through the contact points of end effectors on the ground.
    fn stands(&self, MeasuredState { state, touches }: MeasuredState<'_>) -> Vec<Option<Stand>> {
        if self.is_level() {
            return Vec::new();
        }
        let frames = Frames::new(&self.tree, &state.configuration());
        let stand = |(j, &touches): (usize, &bool)| {
            let end = &self.tree.robot().end_effectors[j];
            let center = frames.point(end.link, &end.center_in_link_m);
            let map = self.footing.contact(j, true, &center);
            let contact = RimContact::on(&self.tree, &frames, j, &map).filter(|_| touches)?;
            Some(Stand::new(map, contact.position(), end.radius_m))
        };
        touches.iter().enumerate().map(stand).collect()
    }

    /// Sway of the gait in the interval after a sample ([`Gait`]).
    fn sway(&self, at: i64) -> [f64; 3] {
        self.schedule.gait.sway[self.schedule.phase(at)]
    }

    /// Mean sway over `intervals` intervals from a sample.
    fn mean_sway(&self, at: u64, intervals: u64) -> [f64; 3] {
        let all: Vec<_> = (at..at + intervals).map(|at| self.sway(at as i64)).collect();
        [0, 1, 2].map(|c| all.iter().map(|sway| sway[c]).sum::<f64>() / intervals as f64)
    }

    /// Solves the problem and returns its best point with a summary.
    fn solve(
        &mut self,
        problem: &Problem,
        mut unknowns: Unknowns,
        progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> (Unknowns, SolveSummary) {
        let Self { options, kept, samples, .. } = self;
        problem.add_up(&mut unknowns);
        let pattern = row_pattern(problem);
        let known = kept.remove(&pattern).and_then(|ReusedSolve { structure, normal, rows }| {
            let (system, rows) = System::again(problem, &unknowns, structure, rows)?;
            Some((system, rows, normal))
        });
        let (system, rows, normal) = known.unwrap_or_else(|| {
            let system = System::selected(problem, Selection::default());
            let rows = system.rows(&unknowns, Rows::default());
            let normal = NormalEquations::new(&rows, system.columns());
            (system, rows, normal)
        });
        let point = Point { unknowns, rows };
        let solver = Solver::at(&system, point, normal, SolveMode::Cold, &options.settings);
        let (best, outcome, normal, rows) = iterate(solver, &options.settings, progress);
        let Best { mut unknowns, worst_level, worst_constraint } = best;
        let after = &mut unknowns.slots[*samples + 1];
        guess::follow_contacts(problem, *samples + 1, after);
        unknowns.placement = base_placement(&unknowns.slots[*samples - 1]);
        if system.fits() {
            if kept.len() >= MOST_KEPT {
                kept.clear();
            }
            let structure = system.into_structure();
            kept.insert(pattern, ReusedSolve { structure, normal, rows });
        }
        let summary = SolveSummary {
            status: outcome.status,
            iterations: outcome.iterations,
            energy: outcome.energy,
            worst_level,
            worst_constraint,
            start: SolveStart { kind: StartKind::Neighbour, seed: 0 },
            diagnosis: None,
            refinements: Vec::new(),
            timing: None,
        };
        (unknowns, summary)
    }

    /// Heights of the contact points above the ground at sample `at`, with their rates. End effectors in swing have heights above
    /// the envelope of swings.
    fn contact_states(
        &self,
        ground: &Footing,
        MeasuredState { state, touches }: MeasuredState<'_>,
        at: i64,
    ) -> Vec<ContactState> {
        let mut kinematics = Kinematics::new(&self.tree, &state.configuration());
        kinematics.update(&self.tree, &state.configuration(), &state.velocity);
        let place = |(j, &touches): (usize, &bool)| {
            let end = &self.tree.robot().end_effectors[j];
            let center = kinematics.frames.point(end.link, &end.center_in_link_m);
            let map = ground.contact(j, touches || self.schedule.stands(at, j), &center);
            let contact = RimContact::on(&self.tree, &kinematics.frames, j, &map);
            // A wheel whose axis is vertical has no lowest point, and touches nothing.
            let at = contact.map(|of| {
                let (position, velocity) =
                    (of.position(), of.motion(&kinematics).geometric_velocity);
                let rises_m_s = map.at(&position).upward().dot(&velocity);
                [map.height_above_m(&position), rises_m_s]
            });
            let [height_m, rises_m_s] = at.unwrap_or_default();
            ContactState { touches: touches && at.is_some(), height_m, rises_m_s }
        };
        touches.iter().enumerate().map(place).collect()
    }

    fn check(&self, measured: MeasuredState<'_>, steering: Steering) -> Result<(), HorizonError> {
        let MeasuredState { state, touches } = measured;
        let robot = self.model.robot();
        for (what, found, expected) in [
            ("state.joint_rad", state.joint_rad.len(), robot.joints.len()),
            ("state.velocity", state.velocity.len(), self.tree.dofs()),
            ("touches", touches.len(), robot.end_effectors.len()),
        ] {
            if found != expected {
                return Err(HorizonError::OtherRobot { what, found, expected });
            }
        }
        let Steering { forward_m_s, left_m_s, turn_rad_s } = steering;
        let all_finite = |numbers: &[f64]| numbers.iter().all(|number| number.is_finite());
        for (what, finite) in [
            ("state.base_position_m", all_finite(state.base_position_m.as_slice())),
            ("state.world_from_body", all_finite(state.world_from_body.as_slice())),
            ("state.joint_rad", all_finite(&state.joint_rad)),
            ("state.velocity", all_finite(&state.velocity)),
            ("steering.forward_m_s", forward_m_s.is_finite()),
            ("steering.left_m_s", left_m_s.is_finite()),
            ("steering.turn_rad_s", turn_rad_s.is_finite()),
        ] {
            if !finite {
                return Err(HorizonError::NotFinite { what });
            }
        }
        Ok(())
    }
}

/// Sets the heights of swings at the first sample, which is given, to the heights of their end effectors.
fn begin_swings(problem: &mut Problem, beginning: &InitialState) {
    for (j, ee) in problem.layout.end_effectors.iter().enumerate() {
        if !problem.stance[1][j] {
            let contact = beginning.at.fixed_rows::<3>(ee.position).into();
            let height_m = problem.contacts[1][j].map.height_above_m(&contact);
            (problem.height_m[0][j], problem.height_m[1][j]) = (height_m, height_m);
        }
    }
}

fn row_pattern(problem: &Problem) -> RowPattern {
    let row = |t: usize| {
        let contacts = problem.stance[t].iter().zip(&problem.contacts[t]);
        contacts.map(|(stands, contact)| stands.then_some(contact.borders.len())).collect()
    };
    (1..=problem.samples).map(row).collect()
}

/// Checks that a gait has the feet and joints of the robot and the spacing of the horizon.
fn check_gait(gait: &Gait, robot: &Robot, interval_s: f64) -> Result<(), HorizonError> {
    let count = |number: usize| number as f64;
    for (what, found, expected) in [
        (
            "count of end effectors",
            count(gait.motion.held_wheels.len()),
            count(robot.end_effectors.len()),
        ),
        ("count of joints", count(gait.motion.posture_rad.len()), count(robot.joints.len())),
        ("sample spacing in s", gait.interval_s(), interval_s),
    ] {
        if (found - expected).abs() > 1e-9 * expected {
            let gait = gait.motion.name.clone();
            return Err(HorizonError::OtherGait { gait, what, found, expected });
        }
    }
    Ok(())
}

/// Unknowns with the family and the residual-to-tolerance ratio of their worst constraint.
struct Best {
    unknowns: Unknowns,
    worst_level: f64,
    worst_constraint: Family,
}

impl Best {
    fn of(
        solver: &mut Solver<'_>,
        Progress { worst_level, worst_constraint, .. }: &Progress,
    ) -> Self {
        let unknowns = solver.lend().1.clone();
        Self { unknowns, worst_level: *worst_level, worst_constraint: *worst_constraint }
    }
}

/// Iterates until the constraints are met and the costs are flat, until `progress` stops the solve, until no step helps, or to
/// the iteration limit.
///
/// The returned point is the latest one with all constraints met, or otherwise the one with the smallest violation.
fn iterate(
    mut solver: Solver<'_>,
    settings: &Settings,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> (Best, SolveOutcome, NormalEquations, Rows) {
    let first = solver.present();
    let mut best = Best::of(&mut solver, &first);
    let mut cost = f64::INFINITY;
    let status = loop {
        if solver.iteration() >= settings.iterations {
            break Status::IterationLimit;
        }
        let iteration = solver.iterate();
        let state = iteration.progress;
        if !solver.fits() {
            break Status::Stalled;
        }
        if state.worst_level <= best.worst_level.max(ACCEPTED_LEVEL) {
            best = Best::of(&mut solver, &state);
        }
        if progress(&state).is_break() {
            break Status::Interrupted;
        }
        if let Some(status) = iteration.ended {
            break status;
        }
        let before = std::mem::replace(&mut cost, state.cost);
        let change = iteration.mismatch.min((state.cost - before).abs());
        if change < settings.flat * state.cost && state.worst_level <= settings.target_level {
            break Status::Converged;
        }
        if iteration.nearly_flat {
            solver.shift_multipliers();
        }
    };
    let (outcome, normal, rows) = solver.finish_with_parts(status);
    (best, outcome, normal, rows)
}
