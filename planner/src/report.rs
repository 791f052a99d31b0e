//! Deviation of a plan from its physical model, recomputed from the plan alone.
//!
//! The optimiser minimises rows with exact derivatives. This module implements the same equations a second time, from the
//! values in a [`Plan`] and its robot, and evaluates them on two grids:
//!
//! - **At the samples.** The constraints of the optimisation apply there. The dynamics apply to means over the intervals around
//!   a sample.
//! - **Between the samples**, on the motion as played. Servos follow the resampled motion, so that its slip, heights, dynamics
//!   and limits decide.
//!
//! Tolerances are the largest residuals with which motions succeed in an independent simulator. A [`Judgement`] summarises the
//! residuals. The planner uses it to refine the grid of a plan that fails between samples.

mod as_played;
mod choreography;
mod clearance;
mod conclusion;
mod costs;
mod distances;
mod grid;
mod judgement;
mod motors;
mod net;
mod residual;
mod rows;
mod sag;
#[cfg(test)]
mod second_opinion;
mod slipping;
mod table;
mod timing;

pub use crate::growth::Growth;
pub use as_played::{LargestTorque, MotorKind};
pub use conclusion::Conclusion;
pub use costs::FamilyCost;
pub use distances::{SmallestDistance, SmallestDistances};
pub use judgement::Judgement;
pub use net::UndoneGoal;
pub use residual::{Grid, ResidualLocation, Row};
pub use sag::Sag;
pub use timing::TimingChange;

use crate::families::Family;
use crate::growth;
use crate::plan::{Plan, SolveSummary};
use crate::sample::resample;
use serde::Serialize;

/// Rate of motion libraries, Hz.
const LIBRARY_RATE_HZ: f64 = 60.0;
/// Fastest control rate, Hz.
const CONTROL_RATE_HZ: f64 = 500.0;
/// Fraction of the tolerance up to which a residual at 60 Hz passes at 500 Hz too. Means over frames hide peaks: slip at 500 Hz
/// was up to three times as large.
const CLEAR_PART: f64 = 0.2;

/// Residuals of a plan, each with its worst case.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Name of the motion.
    pub motion: String,
    /// Name of the robot.
    pub robot: String,
    /// Reason from the motion file why the motion fails without feedback.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub needs_feedback: Option<String>,
    /// Verdict on the plan.
    pub judgement: Judgement,
    /// Residuals: those at the samples first, then those as played.
    pub rows: Vec<Row>,
    /// Largest torque of every motor as played at 60 Hz: joints, then wheels.
    pub torques: Vec<LargestTorque>,
    /// Smallest distances of the motion as played at 60 Hz.
    pub room: SmallestDistances,
    /// Costs by family, largest first. Empty for transitions.
    pub costs: Vec<FamilyCost>,
    /// Swing that loses the largest fraction of its height on servos without torque feed-forward; `None` if nothing swings.
    pub sag: Option<Sag>,
    /// Goal component that the net displacement of a motion at rest misses most. `None` for other motions and without goals.
    pub taken_back: Option<UndoneGoal>,
    /// Factor by which small errors grow per cycle without feedback. `None` for motions that are not periodic, and if legs
    /// buckle.
    pub growth_per_cycle: Option<Growth>,
    /// Chosen times compared with those of the request. `None` for a plan with given times.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub timing: Option<Box<TimingChange>>,
}

impl Report {
    /// Recomputes every residual of a validated plan. Residuals that do not occur in the plan have no row, such as the swing
    /// force if no foot swings.
    pub fn new(plan: &Plan) -> Self {
        let samples = grid::Timeline::new(plan);
        let mut rows = rows::at_samples(&samples);
        let frames = resample(plan, LIBRARY_RATE_HZ);
        let frames = grid::Timeline::new(&frames);
        let torques = in_frames(plan, &frames, &mut rows);
        in_ticks(plan, &mut rows);
        Self {
            room: SmallestDistances::of(&frames),
            costs: costs::costs(plan),
            sag: sag::sag(&samples),
            growth_per_cycle: growth::per_cycle(plan),
            ..Self::of(plan, rows, torques)
        }
    }

    /// Computes only the rows that decide whether a plan passes as played. The rows at 500 Hz are left out if those at 60 Hz
    /// are conclusive, which saves most of the time for most plans. Growth is left out too.
    pub(crate) fn as_played(plan: &Plan) -> Self {
        let mut rows = Vec::new();
        let frames = resample(plan, LIBRARY_RATE_HZ);
        let torques = in_frames(plan, &grid::Timeline::new(&frames), &mut rows);
        let part = rows.iter().map(Row::part_of_level).fold(0.0, f64::max);
        if (CLEAR_PART..=1.0).contains(&part) {
            in_ticks(plan, &mut rows);
        }
        Self::of(plan, rows, torques)
    }

    fn of(plan: &Plan, rows: Vec<Row>, torques: Vec<LargestTorque>) -> Self {
        Self {
            motion: plan.motion.name.clone(),
            robot: plan.robot.name.clone(),
            needs_feedback: plan.motion.needs_feedback.clone(),
            judgement: Judgement::new(plan, &rows),
            rows,
            torques,
            room: SmallestDistances::default(),
            costs: Vec::new(),
            sag: None,
            taken_back: UndoneGoal::of(plan),
            growth_per_cycle: None,
            timing: TimingChange::of(plan).map(Box::new),
        }
    }

    /// Returns the residual with the largest ratio to its tolerance.
    pub fn worst(&self) -> Option<&Row> {
        self.rows.iter().max_by(|a, b| a.part_of_level().total_cmp(&b.part_of_level()))
    }

    /// Returns the residual with the largest ratio to its tolerance: of those as played if `played` is true, else of those at
    /// the samples.
    pub fn worst_of(&self, played: bool) -> Option<&Row> {
        let rows = self.rows.iter().filter(|row| row.is_as_played() == played);
        rows.max_by(|a, b| a.part_of_level().total_cmp(&b.part_of_level()))
    }

    /// Returns the conclusion as text, for all programs: verdict, diagnosis, grids that were too coarse, changed times, and
    /// warnings. One warning is that soft servos need feed-forward. `solve` is the summary of the plan.
    pub fn words(&self, solve: &SolveSummary) -> String {
        let mut text = self.conclusion(solve).to_string();
        if let Some(why) = &solve.diagnosis {
            text += &format!("\n{why}");
        }
        for coarser in &solve.refinements {
            text += &format!("\n{coarser}");
        }
        if let Some(timing) = &self.timing {
            text += &format!("\n{timing}");
        }
        if solve.diagnosis.is_some() || solve.status == crate::plan::Status::Interrupted {
            // The prediction of playback adds nothing.
            return text;
        }
        if let Some(taken_back) = self.taken_back.filter(UndoneGoal::is_said)
            && self.judgement != Judgement::TakenBack
        {
            text += &format!("\n{taken_back}");
        }
        if let Some(sag) = self.sag.as_ref().filter(|sag| sag.is_much()) {
            text += &format!("\n{sag}");
        }
        if let Some(growth) = self.growth_per_cycle.filter(|growth| growth.is_much()) {
            text += &format!("\n{growth}");
        }
        text
    }

    /// Returns the row of a family on a grid.
    pub fn row(&self, family: Family, grid: Grid) -> Option<&Row> {
        self.rows.iter().find(|row| row.family == family && row.grid == grid)
    }
}

/// Adds the rows of the motion at 60 Hz, and returns its torques.
fn in_frames(plan: &Plan, frames: &grid::Timeline, rows: &mut Vec<Row>) -> Vec<LargestTorque> {
    rows.extend(rows::between(frames, Grid::Library60Hz));
    let (torques, of_torques) = as_played::as_played(plan, frames);
    rows.extend(of_torques);
    torques
}

/// Adds the rows of the motion at 500 Hz.
fn in_ticks(plan: &Plan, rows: &mut Vec<Row>) {
    let ticks = resample(plan, CONTROL_RATE_HZ);
    rows.extend(rows::between(&grid::Timeline::new(&ticks), Grid::Control500Hz));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_plans;

    /// Report of a plan after `change`.
    fn changed(mut plan: Plan, change: impl FnOnce(&mut Plan)) -> Report {
        change(&mut plan);
        Report::new(&plan)
    }

    fn at_samples(report: &Report, family: Family) -> &Row {
        report.row(family, Grid::Samples).unwrap_or_else(|| panic!("no row {family}"))
    }

    #[test]
    fn plans_in_closed_form_have_no_residual_at_their_samples() {
        for plan in [test_plans::start_stop(), test_plans::cruise(), test_plans::cruise_middle()] {
            let report = Report::new(&plan);
            for row in report.rows.iter().filter(|row| row.grid == Grid::Samples) {
                // Rounding: positions of 1e-16 m over h² of 2.5e-3 s² times 3 kg, in N; and in mm/s.
                assert!(row.worst < 1e-9, "{report}");
            }
            assert_eq!(report.judgement, Judgement::Consistent, "{report}");
        }
    }

    #[test]
    fn between_samples_the_splines_stay_close_to_the_equations() {
        let report = Report::new(&test_plans::cruise());
        for grid in [Grid::Library60Hz, Grid::Control500Hz] {
            // Spline error of leg sines of 0.2 rad at 5.2 rad/s with h = 0.05 s, times 0.2 m of leg:
            // in height (5/384)·h⁴·0.2·5.2⁴·0.2 m = 2.4e-6 m; in speed (1/24)·h³ for the wheel's angle
            // instead of (5/384)·h⁴: 3e-4 m/s.
            assert!(report.row(Family::ContactHeight, grid).expect("row").worst < 0.01, "{report}");
            assert!(report.row(Family::Slip, grid).expect("row").worst < 1.0, "{report}");
            // Linear forces against a smooth acceleration: h²/8 · |f''| = 0.003 · 3 kg · 1.5 · 27.
            assert!(report.row(Family::LinearDynamics, grid).expect("row").worst < 0.4, "{report}");
        }
    }

    #[test]
    fn every_disturbance_shows_with_its_size_place_and_name() {
        let name = |row: &Row| row.place.as_ref().expect("a place").subject.clone();
        let sample = |row: &Row| row.place.as_ref().expect("a place").sample;

        let report =
            changed(test_plans::cruise(), |p| p.samples[7].end_effectors[2].force_n[0] += 1.0);
        let row = at_samples(&report, Family::LinearDynamics);
        // The force of a sample is two thirds of the mean around it.
        assert!((row.worst - 2.0 / 3.0).abs() < 1e-9 && sample(row) == 7, "{report}");
        // For a force along x the lever is the height and lateral offset of the contact point.
        let lever = test_plans::cruise().samples[7].com_m[2].hypot(0.15);
        assert!(
            (at_samples(&report, Family::AngularDynamics).worst - lever * 2.0 / 3.0).abs() < 1e-9,
            "{report}"
        );
        assert_eq!(report.judgement, Judgement::BeyondTolerance);

        let report =
            changed(test_plans::cruise(), |p| p.samples[4].end_effectors[1].position_m[2] = -0.003);
        let row = at_samples(&report, Family::ContactHeight);
        assert!(
            (row.worst - 3.0).abs() < 1e-9 && name(row).as_deref() == Some("fr-wheel"),
            "{report}"
        );
        assert!((at_samples(&report, Family::ContactPoint).worst - 3.0).abs() < 1e-9, "{report}");

        let report = changed(test_plans::cruise(), |p| {
            p.samples[3].end_effectors[0].wheel_speed_rad_s += 0.2
        });
        assert!((at_samples(&report, Family::Slip).worst - 0.2 * 50.0).abs() < 1e-9, "{report}");
        assert!(
            (at_samples(&report, Family::MotorAgainstWheel).worst - 0.2 * 50.0).abs() < 1e-9,
            "{report}"
        );

        let report = changed(test_plans::cruise(), |p| p.samples[9].com_m[1] += 0.002);
        assert!((at_samples(&report, Family::CentreOfMass).worst - 2.0).abs() < 1e-9, "{report}");

        let report =
            changed(test_plans::cruise(), |p| p.samples[9].end_effectors[3].tilt_rad = 0.01);
        // A chord of the unit circle: 2 sin(0.005).
        assert!((at_samples(&report, Family::WheelAxis).worst - 0.01).abs() < 1e-6, "{report}");

        let report = changed(test_plans::cruise(), |p| p.samples[9].joint_rad[2] = 1.04);
        let row = at_samples(&report, Family::JointLimit);
        assert!(
            (row.worst - 0.04).abs() < 1e-9 && name(row).as_deref() == Some("rl-hip"),
            "{report}"
        );
        assert!(at_samples(&report, Family::JointSpeed).worst > 5.0, "{report}");

        let report =
            changed(test_plans::cruise(), |p| p.robot.end_effectors[0].friction_coefficient = 0.0);
        let f = test_plans::cruise()
            .samples
            .iter()
            .map(|s| s.end_effectors[0].force_n[0].abs())
            .fold(0.0, f64::max);
        assert!((at_samples(&report, Family::Friction).worst - f).abs() < 1e-9, "{report}");

        let report = changed(test_plans::cruise(), |p| {
            p.samples[6].end_effectors[0].contact = false;
            p.samples[6].end_effectors[0].position_m[2] = -0.004;
        });
        let f = nalgebra::Vector3::from(test_plans::cruise().samples[6].end_effectors[0].force_n)
            .norm();
        assert!((at_samples(&report, Family::SwingForce).worst - f).abs() < 1e-9, "{report}");
        assert!((at_samples(&report, Family::SwingDepth).worst - 4.0).abs() < 1e-9, "{report}");

        let report = changed(test_plans::cruise(), |p| p.robot.end_effectors[1].radius_m = 0.3);
        // Wheels 0.3 m apart, radii 0.05 and 0.3, clearance 0.02.
        assert!(
            (at_samples(&report, Family::EndEffectorClearance).worst - 70.0).abs() < 1e-6,
            "{report}"
        );
    }

    #[test]
    fn goals_are_measured_at_the_centre_of_mass() {
        let report = changed(test_plans::start_stop(), |p| {
            p.motion.goal.forward_m = Some(0.502);
            p.motion.goal.turn_rad = Some(0.0);
        });
        assert!(
            (at_samples(&report, Family::DisplacementGoal).worst - 2.0).abs() < 1e-9,
            "{report}"
        );
        assert_eq!(at_samples(&report, Family::TurningGoal).worst, 0.0);
        // A motion at rest reaches its goal at its last of 41 samples.
        let place = at_samples(&report, Family::DisplacementGoal).place.as_ref().unwrap();
        assert_eq!(place.sample, 40);
        assert_eq!(report.worst().map(|row| row.family), Some(Family::DisplacementGoal));
    }

    #[test]
    fn a_free_wheel_pushes_with_its_rolling_resistance_only() {
        let passive = rollwalk_robot::Contact::PassiveWheel {
            axis_in_link: nalgebra::Vector3::y(),
            drag: rollwalk_robot::RollingDrag { rolling_resistance: 0.02, rolling_drag_s_m: 0.1 },
        };
        let report = changed(test_plans::cruise(), |p| {
            p.robot.end_effectors[0].contact = passive;
            for s in &mut p.samples {
                let e = &mut s.end_effectors[0];
                let speed_m_s = e.wheel_speed_rad_s * 0.05;
                e.force_n[0] = -e.force_n[2] * (0.02 * speed_m_s.signum() + 0.1 * speed_m_s);
            }
        });
        // tanh(v/0.05) is 1 within 1e-5 from v = 0.3 m/s on; the cruise is never slower.
        assert!(at_samples(&report, Family::FreeWheelTraction).worst < 1e-5, "{report}");
    }

    #[test]
    fn weak_motors_show_with_their_torque() {
        let report = changed(test_plans::cruise(), |p| {
            for joint in &mut p.robot.joints {
                joint.actuator.torque_max_nm = 1e-6;
            }
            for s in &mut p.samples {
                s.end_effectors[0].force_n = [0.0; 3];
            }
            // At rest from sample 4 to 6: no inertia.
            for i in [4, 6] {
                p.samples[i].base_position_m = p.samples[5].base_position_m;
                p.samples[i].joint_rad = p.samples[5].joint_rad.clone();
            }
            // The heaviest load of all feet: 100 N upwards at the front right wheel, a leg's length behind the hip.
            p.samples[5].end_effectors[1].force_n = [0.0, 0.0, 100.0];
        });
        let sample = &test_plans::cruise().samples[5];
        let sin = sample.joint_rad[1].sin();
        // Minus the leg's own weight: 0.2 kg at half its length.
        let expected = (100.0 - 0.2 * 9.806_65 / 2.0) * 0.2 * sin - 1e-6;
        let row = at_samples(&report, Family::JointTorque);
        assert!((row.worst - expected).abs() < 1e-9, "{report}");
        assert_eq!(row.place.as_ref().and_then(|p| p.subject.as_deref()), Some("fr-hip"));
    }

    #[test]
    fn errors_grow_where_the_robot_stands_on_a_line_and_servos_are_soft() {
        let growth = |change: fn(&mut Plan)| changed(test_plans::cruise(), change).growth_per_cycle;
        let stands = growth(|_| ()).expect("a periodic motion");
        assert!(!stands.is_much() && stands.0 < 1.1, "{stands}");
        let falls = growth(|plan| {
            plan.motion.stance.fill(vec![true, false, false, true]);
            for sample in &mut plan.samples {
                let [a, b, c, d] = &mut sample.end_effectors[..] else { panic!("four wheels") };
                for (stands, lifted) in [(a, b), (d, c)] {
                    lifted.contact = false;
                    stands.force_n[2] += lifted.force_n[2];
                }
            }
        });
        assert!(falls.is_some_and(|falls| falls.is_much() && falls.0 > 3.0), "{falls:?}");
        let words = Growth(48_541_773_683.0).to_string();
        assert!(words.contains("more than 10-fold per cycle"), "{words}");
        let report = changed(test_plans::start_stop(), |_| ());
        assert_eq!(report.growth_per_cycle, None, "it does not repeat");
    }

    #[test]
    fn the_table_is_aligned_and_the_json_is_complete() {
        let report =
            changed(test_plans::cruise(), |p| p.samples[7].end_effectors[2].force_n[0] += 1.0);
        let table = report.to_string();
        let unit_column =
            |name: &str| table.lines().find(|l| l.contains(name)).and_then(|l| l.find(" mm"));
        assert_eq!(unit_column("slip"), unit_column("centre of mass"), "{table}");
        assert!(table.contains("!0.667") && table.contains("sample 7 (0.350 s)"), "{table}");
        assert!(table.contains("residuals are beyond their tolerance"), "{table}");
        let json = serde_json::to_value(&report).expect("a report is JSON");
        assert_eq!(json["rows"][0]["grid"], "samples");
        assert_eq!(json["rows"][0]["place"]["sample"], 7);
        assert_eq!(json["rows"].as_array().map(Vec::len), Some(report.rows.len()));
    }
}
