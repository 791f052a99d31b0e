//! Recovery from a push, and displacement of the plan.
//!
//! A robot recovers if its capture point, c + v √(h/g), is far from the planned one. A robot that is only slow does not recover.
//! During recovery, end effectors on the ground stay there, those in the air land, and separate tasks bring centre of mass and
//! body back. If the push was too strong for these tasks, servos play the plan, whose steps may catch the robot. Recovery ends
//! when the capture point is back, or when the robot has stood still for √(h/g). In the second case the plan is moved to the
//! position of the robot. A robot that repeatedly has to recover right after resuming its plan stumbles. The plan moves along
//! with a robot that is far off, so that the robot does not sprint after it.

use nalgebra::{Rotation2, Vector2};
use rollwalk_robot::GRAVITY_M_S2;

/// Error of the capture point at which recovery begins, as a fraction of the height of the centre of mass.
const RECOVERS: f64 = 0.2;
/// Error of the capture point at which recovery ends, as a fraction of the height of the centre of mass.
const RECOVERED: f64 = 0.1;
/// Error of the capture point above which steps catch the robot more often than standing still does, as a fraction of the
/// height of the centre of mass.
const STEPS: f64 = 0.4;
/// Smallest cosine of the angle between the error and the planned direction of travel at which the steps of the plan lead
/// towards the capture point.
const ONWARD: f64 = 0.7;
/// Time constant of the mean planned velocity, as a multiple of √(h/g). Within a step the velocity may even reverse.
const AVERAGED: f64 = 5.0;
/// Largest displacement of the capture point by the velocity of a standing robot, as a fraction of the height of the centre of
/// mass.
const STANDS: f64 = 0.1;
/// Time that a robot needs to catch up with its resumed plan, as a multiple of √(h/g).
const COMES_ALONG: f64 = 5.0;
/// Number of consecutive recoveries, each begun within [`COMES_ALONG`] after the plan was resumed, that count as stumbling. One
/// such recovery may be due to another push.
const STUMBLES: u32 = 2;
/// Position error above which the plan moves along with the robot, as a fraction of the height of the centre of mass.
const ANCHOR: f64 = 0.2;

/// Errors of the centre of mass along the ground.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Errors {
    /// Deviation from the planned position, m.
    pub from_plan_m: Vector2<f64>,
    /// Measured velocity, m/s.
    pub velocity_m_s: Vector2<f64>,
    /// Planned velocity, m/s.
    pub planned_m_s: Vector2<f64>,
    /// Planned height of the centre of mass above the ground, m.
    pub height_m: f64,
    /// Planned heading of the body, rad.
    pub heading_rad: f64,
}

impl Errors {
    /// Vector from the planned capture point to the measured one, m.
    ///
    /// A speed between zero and the planned one is not an error: a slow robot does not fall, and standing still would delay it
    /// more.
    fn off_m(&self, pendulum_s: f64) -> Vector2<f64> {
        let planned_m_s = self.planned_m_s;
        let along = self.velocity_m_s.dot(&planned_m_s);
        let part = along / planned_m_s.norm_squared().max(f64::MIN_POSITIVE);
        self.from_plan_m + (self.velocity_m_s - planned_m_s * part.clamp(0.0, 1.0)) * pendulum_s
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    #[default]
    OnPlan,
    Recovers {
        /// True if the steps of the plan, which continues during recovery, should catch the robot.
        by_steps: bool,
    },
    /// Robot that has stood still. In this tick the plan is moved to the robot's position.
    Resumes,
}

/// State of the recovery.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Recovery {
    stage: Stage,
    /// True if the robot has driven wheels, which move under a robot that is pushed forward or backward.
    drives: bool,
    /// Mean planned velocity, m/s.
    mean_planned_m_s: Vector2<f64>,
    /// Time for which a recovering robot has stood, s.
    stood_s: f64,
    /// Remaining time until the robot has caught up with its resumed plan, s.
    comes_along_s: f64,
    /// Number of consecutive recoveries that began before the robot had caught up with its plan.
    stumbles: u32,
    /// Displacement of the plan with the robot, m.
    pub anchor_m: Vector2<f64>,
}

impl Recovery {
    /// Creates the state of a robot that is on its plan; `drives` is true for a robot with driven wheels.
    pub fn new(drives: bool) -> Self {
        Self { drives, ..Self::default() }
    }

    /// True if the robot recovers.
    pub fn is_active(&self) -> bool {
        matches!(self.stage, Stage::Recovers { .. })
    }

    /// True if the robot recovers from a push beyond the edge of its support.
    ///
    /// A robot that stands still would tip over, while the steps of its plan may catch it. The result is true for sideways
    /// pushes, because support is narrow. Without driven wheels it is also true for pushes in the planned direction of travel.
    pub fn is_by_steps(&self) -> bool {
        self.stage == Stage::Recovers { by_steps: true }
    }

    /// True if the robot repeatedly recovers right after resuming its plan.
    pub fn stumbles(&self) -> bool {
        self.stumbles >= STUMBLES && self.is_active()
    }

    /// Updates the state a tick later, from position and velocity of the centre of mass.
    ///
    /// An inverted pendulum comes to rest over its capture point.
    pub fn update(&mut self, errors: &Errors, tick_s: f64) {
        let height_m = errors.height_m.max(0.0);
        let pendulum_s = (height_m / GRAVITY_M_S2).sqrt();
        let way_m = errors.off_m(pendulum_s);
        let off_m = way_m.norm();
        let of_body_m = Rotation2::new(-errors.heading_rad) * way_m;
        let [ahead_m, side_m] = [of_body_m.x.abs(), of_body_m.y.abs()];
        let beside = side_m > ahead_m.max(STEPS * height_m);
        let averaged_s = (AVERAGED * pendulum_s + tick_s).max(f64::MIN_POSITIVE);
        self.mean_planned_m_s +=
            (errors.planned_m_s - self.mean_planned_m_s) * (tick_s / averaged_s);
        let onward = off_m > STEPS * height_m
            && way_m.dot(&self.mean_planned_m_s) > ONWARD * off_m * self.mean_planned_m_s.norm();
        let by_steps = beside || onward && !self.drives;
        let stands = errors.velocity_m_s.norm() * pendulum_s < STANDS * height_m;
        self.stood_s = if self.is_active() && stands { self.stood_s + tick_s } else { 0.0 };
        let most_m = RECOVERS * height_m;
        let recovered = self.is_active();
        self.stage = match self.stage {
            Stage::OnPlan | Stage::Resumes if off_m > most_m => Stage::Recovers { by_steps },
            Stage::Recovers { .. } if off_m < RECOVERED * height_m => Stage::OnPlan,
            Stage::Recovers { .. } if self.stood_s > pendulum_s => Stage::Resumes,
            Stage::Resumes => Stage::OnPlan,
            Stage::Recovers { by_steps: false } if by_steps => Stage::Recovers { by_steps: true },
            same => same,
        };
        self.comes_along_s -= tick_s;
        if self.stage == Stage::Resumes {
            self.comes_along_s = COMES_ALONG * pendulum_s;
        } else if self.is_active() && !recovered {
            self.stumbles = if self.comes_along_s > 0.0 { self.stumbles + 1 } else { 0 };
        }
    }

    /// Moves the plan along with the robot, and returns the displacement, m.
    pub fn follow(&mut self, errors: &Errors) -> Vector2<f64> {
        let most_m = match self.stage {
            // While servos play the plan, no feedback leads the robot back to its position.
            Stage::Resumes | Stage::Recovers { by_steps: true } => 0.0,
            Stage::OnPlan | Stage::Recovers { by_steps: false } => {
                ANCHOR * errors.height_m.max(0.0)
            }
        };
        let off_m = errors.from_plan_m;
        let shift_m = off_m * (1.0 - most_m / off_m.norm().max(most_m).max(f64::MIN_POSITIVE));
        self.anchor_m += shift_m;
        shift_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Robot exactly on its plan, with its centre of mass at a height of 0.5 m.
    const STILL: Errors = Errors {
        from_plan_m: Vector2::new(0.0, 0.0),
        velocity_m_s: Vector2::new(0.0, 0.0),
        planned_m_s: Vector2::new(0.0, 0.0),
        height_m: 0.5,
        heading_rad: 0.0,
    };

    /// Speed that moves the capture point by a fraction of the height, m/s.
    fn speed_m_s(part: f64) -> Vector2<f64> {
        Vector2::new(0.0, part * (0.5 * GRAVITY_M_S2).sqrt())
    }

    /// Time longer than √(h/g), s.
    const LONG_S: f64 = 0.3;

    #[test]
    fn recovery_begins_late_and_ends_early() {
        let mut recovery = Recovery::default();
        let mut at = |part: f64| {
            recovery.update(&Errors { velocity_m_s: speed_m_s(part), ..STILL }, 0.0);
            recovery.is_active()
        };
        assert_eq!(
            [0.0, 0.15, 0.21, 0.15, 0.11, 0.09, 0.15].map(&mut at),
            [false, false, true, true, true, false, false]
        );
        // A robot that returns to its plan has no error of its capture point.
        let from_plan_m = -speed_m_s(0.3) * (0.5 / GRAVITY_M_S2).sqrt();
        let back = Errors { from_plan_m, velocity_m_s: speed_m_s(0.3), ..STILL };
        recovery.update(&back, LONG_S);
        assert!(!recovery.is_active());
    }

    /// Tests a robot at rest, which is far from a fast plan. It resumes the plan from its present position.
    #[test]
    fn a_robot_that_stands_resumes_a_fast_plan() {
        let mut recovery = Recovery::default();
        let heading_rad = std::f64::consts::FRAC_PI_2;
        let fast = Errors { planned_m_s: speed_m_s(0.5), heading_rad, ..STILL };
        let mut at = |(part, tick_s): (f64, f64)| {
            let from_plan_m = Vector2::new(0.05, 0.0);
            let errors = Errors { velocity_m_s: speed_m_s(part), from_plan_m, ..fast };
            recovery.update(&errors, tick_s);
            (recovery.is_active(), recovery.follow(&errors).x)
        };
        // Pushed; turning point, which is no rest; standing; increasing error; pushed back.
        let pushed = [(0.8, 0.002), (0.0, 0.1), (0.2, 0.1), (0.0, LONG_S)];
        let seen = pushed.map(&mut at);
        assert_eq!(seen, [(true, 0.0), (true, 0.0), (true, 0.0), (false, 0.05)]);
        let later = [(0.0, 0.1), (0.2, 0.1), (0.4, 0.1), (0.5, 0.1), (-0.3, 0.1)].map(&mut at);
        assert_eq!(later, [(false, 0.0), (false, 0.0), (false, 0.0), (false, 0.0), (true, 0.0)]);
    }

    /// Tests pushes in body axes. The plan continues to step until the robot has recovered.
    #[test]
    fn a_push_to_the_side_lets_the_plan_step_on() {
        let off = |ahead: f64, left: f64| Errors {
            from_plan_m: Rotation2::new(1.0) * Vector2::new(0.5 * ahead, 0.5 * left),
            heading_rad: 1.0,
            ..STILL
        };
        let seen = |way: &[[f64; 2]]| {
            let mut recovery = Recovery::default();
            let step = |[ahead, left]: &[f64; 2]| {
                recovery.update(&off(*ahead, *left), 0.0);
                (recovery.is_active(), recovery.is_by_steps())
            };
            way.iter().map(step).collect::<Vec<_>>()
        };
        assert_eq!(seen(&[[0.6, 0.5], [0.0, -0.3]]), [(true, false); 2]);
        assert_eq!(
            seen(&[[0.0, 0.3], [0.3, -0.5], [0.3, 0.0], [0.05, 0.0]]),
            [(true, false), (true, true), (true, true), (false, false)]
        );
    }

    /// Tests that a robot slower than its plan continues the plan: it does not fall, and catches up sooner than after a recovery.
    #[test]
    fn a_robot_that_is_slower_than_its_plan_does_not_recover() {
        let fast = Errors { planned_m_s: speed_m_s(0.5), ..STILL };
        let recovers = |part: f64| {
            let mut recovery = Recovery::default();
            recovery.update(&Errors { velocity_m_s: speed_m_s(part), ..fast }, 0.002);
            recovery.is_active()
        };
        assert_eq!(
            [0.8, 0.5, 0.2, 0.0, -0.15, -0.25].map(recovers),
            [true, false, false, false, false, true]
        );
    }

    /// Tests pushes along the planned direction of travel, averaged over the steps. Only robots without driven wheels continue
    /// to step.
    #[test]
    fn a_push_along_the_way_lets_a_plan_on_feet_step_on() {
        let walks = Errors { velocity_m_s: speed_m_s(0.2), planned_m_s: speed_m_s(0.2), ..STILL };
        let steps_on = |drives: bool, along_m: f64, across_m: f64| {
            let mut recovery = Recovery::new(drives);
            for _ in 0..1000 {
                recovery.update(&walks, 0.002);
            }
            // The body turns back within a step.
            let back =
                Errors { velocity_m_s: speed_m_s(-0.1), planned_m_s: speed_m_s(-0.1), ..walks };
            let from_plan_m = Vector2::new(across_m, along_m);
            let heading_rad = std::f64::consts::FRAC_PI_2;
            recovery.update(&Errors { from_plan_m, heading_rad, ..back }, 0.002);
            assert!(recovery.is_active());
            recovery.is_by_steps()
        };
        for (along_m, across_m, expected) in [
            (0.3, 0.0, true),
            (0.2, 0.0, false),
            (-0.25, 0.0, false),
            (0.3, 0.24, true),
            (-0.15, 0.19, false),
        ] {
            assert_eq!(steps_on(false, along_m, across_m), expected, "{along_m} {across_m}");
            assert!(!steps_on(true, along_m, across_m), "{along_m} {across_m}");
        }
    }

    /// Tests stumbling: two recoveries right after resuming the plan. Late recoveries do not count, nor does a robot that was
    /// back on its plan in between.
    #[test]
    fn a_robot_that_recovers_as_soon_as_it_resumes_stumbles() {
        let stumbles = |resumes: bool, later_s: f64| {
            let mut recovery = Recovery::default();
            let mut at = |part: f64, tick_s: f64| {
                let beside_m = if resumes && part == 0.0 { 0.1 } else { 0.0 };
                let from_plan_m = Vector2::new(beside_m, 0.0);
                let errors = Errors { from_plan_m, velocity_m_s: speed_m_s(part), ..STILL };
                recovery.update(&errors, tick_s);
                (recovery.is_active(), recovery.stumbles())
            };
            // Pushed; standing, beside the plan or on it; moving with the plan; pushed; and so on.
            let mut again = || {
                assert_eq!([at(0.3, 0.002).0, at(0.0, LONG_S).0], [true, false]);
                at(0.15, 0.002);
                at(0.15, later_s);
                at(0.3, 0.002).1
            };
            let seen = [again(), again(), again()];
            // Until the robot has recovered.
            assert_eq!(at(0.09, 0.002), (false, false));
            seen
        };
        assert_eq!(stumbles(true, 1.0), [false, true, true]);
        assert_eq!(stumbles(true, 1.2), [false; 3]);
        assert_eq!(stumbles(false, 0.1), [false; 3]);
    }

    /// Tests that recovery by steps ends at any speed of the plan.
    #[test]
    fn a_robot_that_steps_on_is_tracked_again_when_it_is_as_fast_as_its_plan() {
        let fast = speed_m_s(0.5);
        let on_plan = Errors { planned_m_s: fast, velocity_m_s: fast, ..STILL };
        let mut recovery = Recovery::default();
        for _ in 0..2 {
            recovery.update(&Errors { velocity_m_s: 2.0 * fast, ..on_plan }, 0.002);
        }
        assert!(recovery.is_by_steps());
        let mut off = Errors { from_plan_m: Vector2::new(0.0, 0.1), ..on_plan };
        off.from_plan_m -= recovery.follow(&off);
        recovery.update(&off, 0.002);
        assert!(!recovery.is_active());
    }

    #[test]
    fn a_plan_moves_along_with_a_robot_that_is_far_off() {
        let mut recovery = Recovery::default();
        let off = |m: f64| Errors { from_plan_m: Vector2::new(m, 0.0), ..STILL };
        assert_eq!(recovery.follow(&STILL), Vector2::zeros());
        assert_eq!(recovery.follow(&off(0.1)), Vector2::zeros());
        assert!((recovery.follow(&off(0.15)).x - 0.05).abs() < 1e-12);
        assert!((recovery.anchor_m.x - 0.05).abs() < 1e-12);
    }
}
