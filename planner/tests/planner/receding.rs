//! Horizons from states along earlier horizons, in stance and in swing, with and without a push.

use nalgebra::{Isometry3, Vector2, Vector3};
use rollwalk_multibody::euler::{JOINTS, Model};
use rollwalk_multibody::ground::file::from_toml;
use rollwalk_multibody::ground::{ElevationGrid, FieldError, Terrain};
use rollwalk_multibody::{Frames, RimContact, State};
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::receding::{
    Gait, GaitError, Horizon, HorizonError, HorizonGround, HorizonOptions, HorizonPlan,
    MeasuredState, Steering,
};
use rollwalk_planner::whole_body::WholeBody;
use rollwalk_planner::{Options, Progress, optimise};
use rollwalk_robot::Robot;
use std::fs;
use std::ops::ControlFlow;
use std::sync::Arc;

fn read(path: &str) -> String {
    fs::read_to_string(format!("{}/../shipped/{path}.toml", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

fn robot(name: &str) -> Robot {
    Robot::from_toml(name, &read(&format!("robots/{name}"))).unwrap()
}

fn planned(robot: &Robot, motion: &str) -> Plan {
    let motion = Motion::from_toml(motion, &read(&format!("motions/{motion}")), robot).unwrap();
    let options = Options { refine: false, ..Options::default() };
    optimise(robot, &motion, &options, &mut go)
}

fn go(_: &Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn forward(forward_m_s: f64) -> Steering {
    Steering { forward_m_s, ..Steering::default() }
}

/// Simulated robot that follows its horizons exactly.
struct Walker {
    horizon: Horizon,
    state: State,
    touches: Vec<bool>,
    at: u64,
}

impl Walker {
    /// Begins standing, at the start of the gait.
    fn new(robot: &Robot, gait: Gait, duration_s: f64) -> Self {
        let options = HorizonOptions { duration_s, ..HorizonOptions::default() };
        let horizon = Horizon::new(robot, gait, options).unwrap();
        let mut state = State::nominal(horizon.tree());
        // A robot on its contacts stands, whatever its measured height.
        state.base_position_m.z = 0.0;
        let touches = vec![true; robot.end_effectors.len()];
        Self { horizon, state, touches, at: 0 }
    }

    fn plan(&mut self, steering: Steering) -> HorizonPlan {
        self.plan_pushed(steering, Vector3::zeros())
    }

    /// Plans from the present state with `push` added to the velocity of the body, m/s.
    fn plan_pushed(&mut self, steering: Steering, push: Vector3<f64>) -> HorizonPlan {
        let mut state = self.state.clone();
        (0..3).for_each(|k| state.velocity[k] += push[k]);
        let measured = MeasuredState { state: &state, touches: &self.touches };
        self.horizon.plan(measured, self.at, steering, &mut go).unwrap()
    }

    /// Follows a plan for `samples` samples.
    fn follow(&mut self, found: &HorizonPlan, samples: u64) {
        let time_s = samples as f64 * self.horizon.interval_s();
        let there = WholeBody::new(&found.plan).at(time_s, &found.world_from_plan);
        (self.state, self.touches) = (there.state, there.stands);
        self.at += samples;
    }
}

/// Checks that horizons from ten states, `every` samples apart, are accepted undisturbed and with pushes of 0.2 m/s in various
/// directions. Returns the number of accepted horizons with pushes of 0.5 m/s.
fn is_planned_from_everywhere(robot: &Robot, gait: Gait, duration_s: f64, every: u64) -> usize {
    let mut walker = Walker::new(robot, gait, duration_s);
    let mut accepted = 0;
    for k in 0..10 {
        let steering = Steering { turn_rad_s: 0.1, ..forward(0.1) };
        let found = walker.plan(steering);
        found.plan.validate("horizon").unwrap();
        let solve = &found.plan.solve;
        assert!(found.is_accepted() && solve.status == Status::Converged, "{k}: {solve:?}");
        let (sin, cos) = (f64::from(k) * 2.4).sin_cos();
        let push = Vector3::new(cos, sin, 0.0);
        let pushed = walker.plan_pushed(steering, push * 0.2);
        assert!(pushed.is_accepted(), "{k}, pushed: {:?}", pushed.plan.solve);
        accepted += usize::from(walker.plan_pushed(steering, push * 0.5).is_accepted());
        walker.follow(&found, every);
    }
    accepted
}

#[test]
fn agilebot_is_planned_from_everywhere_in_its_gaits() {
    let robot = robot("agilebot");
    let [walk, trot] = ["walk", "trot"].map(|name| Gait::of(&planned(&robot, name)).unwrap());
    let stand = Gait::standing(&robot, 0.1).unwrap();
    assert_eq!(is_planned_from_everywhere(&robot, stand, 1.0, 1), 10);
    assert!(is_planned_from_everywhere(&robot, walk, 1.6, 3) >= 9);
    // On two feet, half a metre per second across their line takes most of the capability of steps.
    assert!(is_planned_from_everywhere(&robot, trot, 0.8, 3) >= 7);
}

#[test]
fn anymal_is_planned_from_everywhere_in_its_gaits() {
    let robot = robot("anymal_wheels");
    let turn = Gait::of(&planned(&robot, "anymal_turn")).unwrap();
    let stand = Gait::standing(&robot, 0.1).unwrap();
    assert_eq!(is_planned_from_everywhere(&robot, stand, 1.0, 1), 10);
    assert!(is_planned_from_everywhere(&robot, turn, 1.2, 3) >= 9);
}

#[test]
fn a_plan_begins_where_the_robot_is_and_as_it_moves() {
    let robot = robot("agilebot");
    let mut walker = Walker::new(&robot, Gait::of(&planned(&robot, "trot")).unwrap(), 0.8);
    for _ in 0..6 {
        let found = walker.plan(forward(0.1));
        walker.follow(&found, 3);
    }
    walker.state =
        walker.state.moved(&Isometry3::new(Vector3::new(3.0, -2.0, 0.0), Vector3::z() * 2.0));
    let found = walker.plan(forward(0.1));
    let begins = WholeBody::new(&found.plan).at(0.0, &found.world_from_plan);
    let (there, here) = (&begins.state, &walker.state);
    // Feet in stance slip and sink by some millimetres (per second) between the samples of the previous plan.
    assert!((there.base_position_m - here.base_position_m).norm() < 1e-3);
    assert!((there.world_from_body - here.world_from_body).norm() < 2e-3);
    let off = there.velocity.iter().zip(&here.velocity).take(6).map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f64::max) < 0.02, "{:?} {:?}", there.velocity, here.velocity);
    assert_eq!(begins.stands, walker.touches);
}

#[test]
fn a_plan_that_is_stopped_is_the_best_so_far() {
    let robot = robot("agilebot");
    let mut walker = Walker::new(&robot, Gait::of(&planned(&robot, "walk")).unwrap(), 1.6);
    let measured = MeasuredState { state: &walker.state, touches: &walker.touches };
    let mut levels = Vec::new();
    let stop = &mut |progress: &Progress| {
        levels.push(progress.worst_level);
        if levels.len() < 2 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    };
    let found = walker.horizon.plan(measured, 0, forward(0.1), stop).unwrap();
    found.plan.validate("horizon").unwrap();
    let solve = &found.plan.solve;
    assert_eq!((solve.status, solve.iterations), (Status::Interrupted, 2));
    assert!(levels.iter().all(|level| solve.worst_level <= *level), "{solve:?} {levels:?}");
    // A plan that was stopped has no effect.
    assert!(walker.plan(forward(0.1)).is_accepted());
}

#[test]
fn a_robot_walks_as_it_is_steered_and_stops() {
    let robot = robot("agilebot");
    let stand = Gait::standing(&robot, 0.05).unwrap();
    let mut walker = Walker::new(&robot, Gait::of(&planned(&robot, "walk")).unwrap(), 1.6);
    let go_on = |walker: &mut Walker, steering: Steering, samples: u64| {
        let from = walker.state.base_position_m;
        for _ in 0..samples / 4 {
            let found = walker.plan(steering);
            assert!(found.is_accepted(), "{:?}", found.plan.solve);
            walker.follow(&found, 4);
        }
        walker.state.base_position_m - from
    };
    go_on(&mut walker, forward(0.1), 32);
    // A period of 1.6 s at 0.1 m/s: 0.16 m minus the effect of the costs of force and posture.
    let way = go_on(&mut walker, forward(0.1), 32);
    assert!((way.x / 0.16 - 1.0).abs() < 0.1 && way.y.abs() < 0.01, "{way:?}");
    walker.horizon.change_gait(stand, walker.at).unwrap();
    go_on(&mut walker, Steering::default(), 32);
    let fastest = |part: &[f64]| part.iter().fold(0.0f64, |fastest, v| fastest.max(v.abs()));
    let (body, joints) = walker.state.velocity.as_slice().split_at(JOINTS);
    // Joints return to their posture more slowly than the body stops: at 0.026 rad/s here, and at 0.008 rad/s 0.8 s later.
    assert!(fastest(body) < 0.002 && fastest(joints) < 0.03, "{body:?} {joints:?}");
    assert!(walker.touches.iter().all(|touches| *touches));
}

#[test]
fn what_cannot_be_planned_is_refused_with_its_value() {
    let agilebot = robot("agilebot");
    let stand = || Gait::standing(&agilebot, 0.1).unwrap();
    let short = HorizonOptions { duration_s: 0.2, ..HorizonOptions::default() };
    let error = Horizon::new(&agilebot, stand(), short).unwrap_err();
    assert!(matches!(error, HorizonError::TooShort { samples: 3, .. }), "{error}");
    let error = Gait::of(&planned(&agilebot, "drive_1m")).unwrap_err();
    assert!(matches!(error, GaitError::DoesNotRepeat { .. }), "{error}");
    assert!(Gait::standing(&agilebot, f64::NAN).is_err());

    let mut walker = Walker::new(&agilebot, stand(), 1.0);
    let other = Gait::standing(&agilebot, 0.05).unwrap();
    let error = walker.horizon.change_gait(other, 0).unwrap_err();
    assert_eq!(
        error.to_string(),
        "gait `stand`: sample spacing in s is 0.05; expected 0.1, as in the horizon"
    );
    let touches = [true; 3];
    let measured = MeasuredState { state: &walker.state, touches: &touches };
    let error = walker.horizon.plan(measured, 0, forward(0.0), &mut go).unwrap_err();
    assert_eq!(error.to_string(), "measured touches has 3 entries; expected 4");
    let measured = MeasuredState { state: &walker.state, touches: &walker.touches };
    let error = walker.horizon.plan(measured, 0, forward(f64::NAN), &mut go).unwrap_err();
    assert_eq!(error, HorizonError::NotFinite { what: "steering.forward_m_s" });
}

/// Ramp up, kerb up and kerb down.
const RAMP_AND_KERBS: &str = "[profile]\nx_m = [0.3, 0.7, 1.1, 1.1, 1.5, 1.5]\n\
    z_m = [0.0, 0.06, 0.06, 0.078, 0.078, 0.06]";

impl Walker {
    /// Begins standing on the level part of a terrain.
    fn on(robot: &Robot, gait: Gait, duration_s: f64, terrain: &Terrain) -> Self {
        let mut walker = Self::new(robot, gait, duration_s);
        walker.state.base_position_m.z = Model::new(robot).nominal_q()[2];
        walker.horizon.change_ground(HorizonGround::Terrain(terrain.clone())).unwrap();
        walker
    }

    /// Lowest points of all end effectors, m.
    fn contacts_m(state: &State, horizon: &Horizon) -> Vec<Vector3<f64>> {
        let tree = horizon.tree();
        let frames = Frames::new(tree, &state.configuration());
        let lowest = |j| RimContact::new(tree, &frames, j, &Vector3::z()).unwrap().position();
        (0..tree.robot().end_effectors.len()).map(lowest).collect()
    }
}

/// Follows horizons over ramp and kerbs, and returns the fraction that was rejected. The previous plan then continues.
/// `exchange` may exchange the map before each plan.
fn goes_over_ramp_and_kerbs(
    robot: &Robot,
    gait: Gait,
    [duration_s, speed_m_s]: [f64; 2],
    every: u64,
    mut exchange: impl FnMut(&mut Horizon, &Vector3<f64>),
) -> f64 {
    let terrain = from_toml("terrain.toml", RAMP_AND_KERBS).unwrap();
    let mut walker = Walker::on(robot, gait, duration_s, &terrain);
    let standing_m = walker.state.base_position_m.z;
    let (mut highest_m, mut plans, mut rejected) = (0.0_f64, 0, 0);
    let mut followed: Option<(HorizonPlan, u64)> = None;
    while walker.state.base_position_m.x < 2.0 {
        exchange(&mut walker.horizon, &walker.state.base_position_m);
        let found = walker.plan(forward(speed_m_s));
        let at_m = walker.state.base_position_m;
        plans += 1;
        assert!(plans < 400, "{at_m:?}");
        if !found.is_accepted() {
            rejected += 1;
            let (before, played) = followed.as_mut().expect("the first plan is accepted");
            *played += every;
            let time_s = *played as f64 * walker.horizon.interval_s();
            assert!(time_s < duration_s, "{at_m:?}: {:?}", found.plan.solve);
            let there = WholeBody::new(&before.plan).at(time_s, &before.world_from_plan);
            (walker.state, walker.touches) = (there.state, there.stands);
            walker.at += every;
            continue;
        }
        let begins = WholeBody::new(&found.plan).at(0.0, &found.world_from_plan).state;
        let [before, after] =
            [&walker.state, &begins].map(|state| Walker::contacts_m(state, &walker.horizon));
        for (j, _) in walker.touches.iter().enumerate().filter(|(_, touches)| **touches) {
            let moved_m = (after[j] - before[j]).norm();
            assert!(moved_m < 1e-3, "end effector {j} moves by {moved_m} m at {at_m:?}");
        }
        walker.follow(&found, every);
        highest_m = highest_m.max(walker.state.base_position_m.z - standing_m);
        followed = Some((found, every));
    }
    // Both ends of the robot are over both edges of the upper kerb.
    assert!((highest_m - 0.078).abs() < 0.01, "{highest_m}");
    let end_m = walker.state.base_position_m.z - standing_m;
    assert!((end_m - 0.06).abs() < 0.006, "{end_m}");
    f64::from(rejected) / f64::from(plans)
}

#[test]
fn a_robot_drives_over_a_ramp_and_kerbs_in_horizons() {
    let robot = robot("agilebot");
    let stand = Gait::standing(&robot, 0.1).unwrap();
    assert_eq!(goes_over_ramp_and_kerbs(&robot, stand, [1.0, 0.2], 2, |_, _| {}), 0.0);
}

#[test]
#[ignore = "ten seconds and more: cargo xtask nightly --only long"]
fn a_robot_walks_over_a_ramp_and_kerbs_in_horizons() {
    let robot = robot("agilebot");
    let walk = Gait::of(&planned(&robot, "walk")).unwrap();
    let rejected = goes_over_ramp_and_kerbs(&robot, walk, [1.6, 0.1], 4, |_, _| {});
    assert!(rejected < 0.15, "{rejected}");
}

/// Exchanges a noisy map before each plan.
#[test]
fn footholds_stay_while_maps_are_exchanged() {
    let robot = robot("agilebot");
    let terrain = from_toml("terrain.toml", RAMP_AND_KERBS).unwrap();
    let mut random = fastrand::Rng::with_seed(4);
    let stand = Gait::standing(&robot, 0.1).unwrap();
    let rejected = goes_over_ramp_and_kerbs(&robot, stand, [1.0, 0.2], 2, |horizon, body_m| {
        let center_m = Vector2::new(body_m.x, body_m.y);
        let grid = ElevationGrid::around(center_m, 0.8, 0.02, |at| {
            terrain.height_m(&at) + 0.006 * (random.f64() - 0.5)
        });
        horizon.change_ground(HorizonGround::Map(Arc::new(grid))).unwrap();
    });
    assert!(rejected < 0.05, "{rejected}");
}

/// Map 0.8 m around the origin.
fn map(height_m: impl FnMut(Vector2<f64>) -> f64) -> ElevationGrid {
    ElevationGrid::around(Vector2::zeros(), 0.8, 0.02, height_m)
}

#[test]
fn maps_that_are_invalid_are_refused_and_unknown_ones_keep_the_ground() {
    let robot = robot("agilebot");
    let mut walker = Walker::new(&robot, Gait::standing(&robot, 0.1).unwrap(), 1.0);
    let change = |walker: &mut Walker, grid: ElevationGrid| {
        walker.horizon.change_ground(HorizonGround::Map(Arc::new(grid)))
    };
    // A lidar without return. Its cells are as high as their neighbours.
    let holes = map(|at| if at.x > 0.3 && at.y.abs() < 0.1 { f64::INFINITY } else { 1.0 });
    change(&mut walker, holes).unwrap();
    walker.state.base_position_m.z = 1.0 + Model::new(&robot).nominal_q()[2];
    let standing = |walker: &mut Walker| {
        let found = walker.plan(forward(0.0));
        assert!(found.is_accepted(), "{:?}", found.plan.solve);
        found.plan.samples[0].base_position_m[2]
    };
    let before_m = standing(&mut walker);
    assert!(before_m > 1.0, "{before_m}");
    change(&mut walker, map(|_| f64::NAN)).unwrap();
    assert_eq!(standing(&mut walker), before_m);
    let mut short = map(|_| 0.0);
    short.heights_m.pop();
    let (found, wanted) = (short.heights_m.len(), short.heights_m.len() + 1);
    let error = change(&mut walker, short).unwrap_err();
    assert_eq!(error, HorizonError::Map(FieldError::Length { found, wanted }));
    assert_eq!(standing(&mut walker), before_m);
}

#[test]
fn plans_without_steppable_cells_near_a_landing_are_rejected() {
    let robot = robot("agilebot");
    let walk = Gait::of(&planned(&robot, "walk")).unwrap();
    // Pits in all directions leave only flat strips that are narrower than feet need.
    let ripples = |at: Vector2<f64>| 0.03 * ((30.0 * at.x).sin() + (30.0 * at.y).sin());
    for (grid, is_steppable) in [(map(|_| 0.0), true), (map(ripples), false)] {
        let mut walker = Walker::new(&robot, walk.clone(), 1.6);
        walker.state.base_position_m.z = Model::new(&robot).nominal_q()[2];
        walker.horizon.change_ground(HorizonGround::Map(Arc::new(grid))).unwrap();
        let found = walker.plan(forward(0.0));
        assert_eq!(found.without_foothold.is_none(), is_steppable, "{:?}", found.plan.solve);
        assert_eq!(found.is_accepted(), is_steppable);
    }
}
