//! Starts and re-planning on the shipped robots and motions.

use rollwalk_planner::motion::{Goal, Motion};
use rollwalk_planner::plan::{Plan, StartKind, Status};
use rollwalk_planner::sensitivity::Objective;
use rollwalk_planner::start::{Start, WarmStart};
use rollwalk_planner::{
    ACCEPTED_LEVEL, Options, Progress, ReplanError, Weights, candidates, optimise,
    optimise_solution, replan,
};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

fn agilebot() -> Robot {
    Robot::from_toml("agilebot.toml", include_str!("../../../shipped/robots/agilebot.toml"))
        .unwrap()
}

fn swizzlebot() -> Robot {
    Robot::from_toml("swizzlebot.toml", include_str!("../../../shipped/robots/swizzlebot.toml"))
        .unwrap()
}

fn motion(robot: &Robot, text: &str) -> Motion {
    Motion::from_toml("motion.toml", text, robot).unwrap()
}

const FORWARD: &str = include_str!("../../../shipped/motions/swizzlebot_forward.toml");
const TURN: &str = include_str!("../../../shipped/motions/swizzlebot_turn.toml");
const WALK: &str = include_str!("../../../shipped/motions/walk.toml");
const DRIVE: &str = include_str!("../../../shipped/motions/drive_1m.toml");

fn go(_: &Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn seeded(seed: u64) -> Options {
    Options { seed, ..Options::default() }
}

/// Largest difference of the joint angles of two plans, rad.
fn apart(one: &Plan, other: &Plan) -> f64 {
    let angles = |plan: &Plan| plan.samples.iter().flat_map(|s| s.joint_rad.clone()).collect();
    let (a, b): (Vec<f64>, Vec<f64>) = (angles(one), angles(other));
    a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn swizzlebot_swizzles_from_ten_seeds_of_ten() {
    let robot = swizzlebot();
    for text in [FORWARD, TURN] {
        let wanted = motion(&robot, text);
        for seed in 0..10 {
            let plan = optimise(&robot, &wanted, &seeded(seed), &mut go);
            let solve = &plan.solve;
            assert_eq!(solve.status, Status::Converged, "{} seed {seed}", wanted.name);
            assert!(solve.worst_level <= ACCEPTED_LEVEL, "{} seed {seed}", wanted.name);
            assert_eq!((solve.start.kind, solve.start.seed), (StartKind::Sinusoid, seed));
        }
    }
}

#[test]
fn robots_on_free_wheels_start_swinging_and_others_standing() {
    let first = |robot: &Robot, text: &str| {
        candidates(robot, &motion(robot, text), &Options::default())[0].start
    };
    assert_eq!(first(&swizzlebot(), FORWARD), Start::Sinusoid);
    assert_eq!(first(&agilebot(), WALK), Start::Standing);
    // For many samples, strokes are first sought with few samples; walks still start standing.
    let many = |robot: &Robot, text: &str| {
        let text =
            text.replace("samples = 24", "samples = 48").replace("samples = 32", "samples = 64");
        candidates(robot, &motion(robot, &text), &Options::default())
    };
    assert_eq!(many(&swizzlebot(), FORWARD)[0].start, Start::Coarse);
    let walk = many(&agilebot(), WALK);
    assert_eq!((walk[0].start, walk[1].start), (Start::Standing, Start::Coarse));
    // A chosen start is the only one.
    let chosen = Options { start: Start::Standing, seed: 4, ..Options::default() };
    let robot = swizzlebot();
    assert_eq!(candidates(&robot, &motion(&robot, FORWARD), &chosen), [chosen]);
}

#[test]
fn many_samples_start_from_half_as_many() {
    let robot = agilebot();
    let wanted = motion(&robot, &WALK.replace("samples = 32", "samples = 100"));
    let options = Options { start: Start::Coarse, seed: 3, ..Options::default() };
    let mut steps = Vec::new();
    let plan = optimise(&robot, &wanted, &options, &mut |progress| {
        steps.push(progress.iteration);
        ControlFlow::Continue(())
    });
    assert_eq!(plan.solve.status, Status::Converged);
    assert_eq!(plan.samples.len(), 100);
    assert_eq!((plan.solve.start.kind, plan.solve.start.seed), (StartKind::Coarse, 3));
    // Iterations of all levels are counted continuously.
    assert_eq!(steps, (1..=plan.solve.iterations).collect::<Vec<_>>());
    // With few samples, this start is the suitable one.
    let few = optimise(&robot, &motion(&robot, WALK), &options, &mut go);
    assert_eq!(few.solve.start.kind, StartKind::Standing);

    let mut left = 9;
    let stopped = optimise(&robot, &wanted, &options, &mut |_| {
        left -= 1;
        if left == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert_eq!(stopped.solve.status, Status::Interrupted);
    assert_eq!(stopped.samples.len(), 100, "an interrupted plan is one of the motion asked for");
}

#[test]
fn a_seed_is_a_plan_and_another_seed_another_start() {
    let robot = agilebot();
    let wanted = motion(&robot, WALK);
    let plan = |seed| optimise(&robot, &wanted, &seeded(seed), &mut go);
    assert_eq!(plan(1), plan(1));
    let first = |seed| {
        let mut energy = None;
        optimise(&robot, &wanted, &seeded(seed), &mut |progress| {
            energy = Some(progress.energy);
            ControlFlow::Break(())
        });
        energy.unwrap()
    };
    let energies: Vec<f64> = (0..4).map(first).collect();
    for pair in energies.windows(2) {
        assert_ne!(pair[0], pair[1], "{energies:?}");
    }
}

#[test]
fn planning_the_same_motion_again_stays_where_it_is() {
    let robot = agilebot();
    for text in [WALK, DRIVE] {
        let wanted = motion(&robot, text);
        let solution = optimise_solution(&robot, &wanted, &Options::default(), &mut go);
        let again = solution.replan(&robot, &wanted, &Options::default(), &mut go).unwrap().plan;
        let from_file = replan(&solution.plan, &robot, &wanted, &Options::default(), &mut go);
        for plan in [again, from_file.unwrap()] {
            assert!(plan.solve.iterations <= 2, "{:?}", plan.solve);
            assert_eq!(plan.solve.status, Status::Converged);
            assert_eq!(plan.solve.start.kind, StartKind::Neighbour);
            // The solve ends when a step gains less than a thousandth; angles have that accuracy.
            assert!(apart(&plan, &solution.plan) < 5e-3, "{}", apart(&plan, &solution.plan));
        }
    }
}

#[test]
fn a_plan_after_an_edit_is_as_good_as_one_from_scratch_and_cheaper() {
    let robot = agilebot();
    let wanted = motion(&robot, WALK);
    let previous = optimise(&robot, &wanted, &Options::default(), &mut go);
    let goal = Goal { forward_m: wanted.goal.forward_m.map(|x| 1.1 * x), ..wanted.goal };
    let mut resampled = wanted.clone();
    resampled.stance = (0..40).map(|i| wanted.stance[i * 32 / 40].clone()).collect();
    let edits = [
        Motion { goal, ..wanted.clone() },
        Motion { duration_s: 1.1 * wanted.duration_s, ..wanted.clone() },
        Motion { swing_height_m: 0.025, ..wanted.clone() },
        resampled,
    ];
    for edited in edits {
        let cold = optimise(&robot, &edited, &Options::default(), &mut go);
        let plan = replan(&previous, &robot, &edited, &Options::default(), &mut go).unwrap();
        plan.validate("plan").unwrap();
        assert_eq!(plan.solve.status, Status::Converged, "{:?}", plan.solve);
        // Both are minima within a few thousandths of their costs, but may be different minima.
        let costs =
            [&plan, &cold].map(|plan| Objective::PlanCost.of_plan(plan, &Weights::default()));
        assert!(costs[0] < 1.02 * costs[1], "{costs:?}");
        let (edited, cold) = (plan.solve, cold.solve);
        assert!(edited.iterations <= cold.iterations, "{edited:?} {cold:?}");
    }
}

#[test]
fn an_edited_robot_may_start_from_the_plan_before_the_edit() {
    let robot = agilebot();
    let wanted = motion(&robot, DRIVE);
    let previous = optimise(&robot, &wanted, &Options::default(), &mut go);
    let mut longer = robot.clone();
    for end_effector in &mut longer.end_effectors {
        end_effector.radius_m *= 1.05;
    }
    let plan = replan(&previous, &longer, &wanted, &Options::default(), &mut go).unwrap();
    assert_eq!(plan.solve.status, Status::Converged);
    assert_eq!(plan.robot, longer);
}

/// Checks a goal from which the first solve, from the plan of 1 m, ends infeasible.
#[test]
fn what_one_plan_does_not_lead_to_is_not_called_infeasible() {
    let robot = agilebot();
    let metre = motion(&robot, DRIVE);
    let previous = optimise(&robot, &metre, &Options::default(), &mut go);
    let goal = Goal { forward_m: Some(1.5), ..metre.goal };
    let further = Motion { goal, ..metre };
    let plan = replan(&previous, &robot, &further, &Options::default(), &mut go).unwrap();
    assert_eq!(plan.solve.status, Status::Converged, "{:?}", plan.solve);
}

#[test]
fn plans_that_cannot_be_played_are_refused() {
    let robot = agilebot();
    let drive = optimise(&robot, &motion(&robot, DRIVE), &Options::default(), &mut go);
    let walk = motion(&robot, WALK);
    let refused = replan(&drive, &robot, &walk, &Options::default(), &mut go).unwrap_err();
    assert!(matches!(refused, ReplanError::OtherEnds { .. }), "{refused}");
    let other = swizzlebot();
    let refused = replan(&drive, &other, &walk, &Options::default(), &mut go).unwrap_err();
    let message = refused.to_string();
    assert!(message.contains("`agilebot`") && message.contains("`swizzlebot`"), "{message}");
}

/// Checks a flying trot, where all feet are in the air between the pairs.
#[test]
#[ignore = "ten seconds and more: cargo xtask nightly --only long"]
fn the_warm_start_finds_a_flying_trot() {
    let robot = agilebot();
    let wanted = motion(&robot, include_str!("../../../shipped/motions/flying_trot.toml"));
    let from = |start| {
        let options = Options { start, ..Options::default() };
        let mut seen = 0;
        let plan = optimise(&robot, &wanted, &options, &mut |progress| {
            assert_eq!(progress.iteration, seen + 1, "iterations are counted through all steps");
            seen = progress.iteration;
            ControlFlow::Continue(())
        });
        assert_eq!(plan.solve.iterations, seen);
        plan
    };
    let warm = from(Start::Warm(WarmStart::default()));
    assert_eq!(warm.solve.status, Status::Converged);
    assert_eq!(warm.solve.start.kind, StartKind::Warm);
    assert!(warm.solve.worst_level <= ACCEPTED_LEVEL);
    let last = candidates(&robot, &wanted, &Options::default()).pop().map(|last| last.start);
    assert_eq!(last, Some(Start::Warm(WarmStart::default())));
}

#[test]
fn the_warm_start_can_be_interrupted() {
    let robot = agilebot();
    let wanted = motion(&robot, WALK);
    let options = Options { start: Start::Warm(WarmStart::default()), ..Options::default() };
    let mut iterations = 0;
    let plan = optimise(&robot, &wanted, &options, &mut |_| {
        iterations += 1;
        if iterations >= 20 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert_eq!(plan.solve.status, Status::Interrupted);
    assert_eq!(iterations, 20, "the steps after an interrupt do not run");
}
