//! Complete solves of small problems.

use super::super::structures::Structures;
use super::*;
use crate::motion::{Ends, Goal, Motion};
use crate::problem::Weights;
use crate::start::guess;
use crate::test_robots;
use rollwalk_multibody::euler::Model;
use std::ops::ControlFlow;

/// Solves 0.1 m of rolling of AgileBot, from rest to rest. The penalty alone is far too low to meet the constraints.
fn solved(settings: &Settings) -> (SolveOutcome, Vec<f64>) {
    let robot = &test_robots::all()[0];
    let motion = Motion {
        duration_s: 1.0,
        stance: vec![vec![true; robot.end_effectors.len()]; 8],
        goal: Goal { forward_m: Some(0.1), ..Goal::default() },
        ..test_robots::motion(robot, Ends::AtRest)
    };
    let weights = Weights { penalty: 10.0, ..Weights::default() };
    let problem = Problem::new(Model::new(robot), &motion, weights);
    let unknowns = guess::from_standing(&problem);
    let mut energies = Vec::new();
    let progress = &mut |progress: &Progress| {
        energies.push(progress.energy);
        ControlFlow::Continue(())
    };
    let solved = solve(
        &problem,
        unknowns,
        SolveMode::Cold,
        settings,
        &mut Effort::new(&Structures::default(), progress),
    );
    (solved.outcome, energies)
}

#[test]
fn multipliers_meet_constraints_that_the_penalty_alone_does_not() {
    let settings = Settings::default();
    // The level does not matter, because the solve ends before the first shift of multipliers.
    let (penalty, _) = solved(&Settings { target_level: f64::INFINITY, ..settings.clone() });
    assert!(penalty.worst_level > 10.0 * settings.target_level, "{penalty:?}");
    let (exact, _) = solved(&settings);
    assert_eq!(exact.status, Status::Converged);
    assert!(exact.worst_level <= settings.target_level, "{exact:?}");
}

#[test]
fn the_energy_never_rises_while_multipliers_stay() {
    // Never flat, so multipliers do not shift.
    let settings = Settings { flat: 0.0, nearly_flat: 0.0, iterations: 20, ..Settings::default() };
    let (_, energies) = solved(&settings);
    assert_eq!(energies.len(), 20);
    assert!(energies.windows(2).all(|pair| pair[1] <= pair[0]), "{energies:?}");
    assert!(energies[4] < energies[0], "{energies:?}");
}

#[test]
fn the_iteration_limit_is_kept_and_told() {
    let (summary, energies) = solved(&Settings { iterations: 1, ..Settings::default() });
    assert_eq!((summary.status, summary.iterations), (Status::IterationLimit, 1));
    assert_eq!(energies.len(), 1);
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn methods_agree_on_the_optimum() {
    let robot = &test_robots::all()[0];
    let motion = Motion {
        duration_s: 1.0,
        stance: vec![vec![true; robot.end_effectors.len()]; 5],
        goal: Goal { forward_m: Some(0.1), ..Goal::default() },
        ..test_robots::motion(robot, Ends::AtRest)
    };
    let problem = Problem::new(Model::new(robot), &motion, Weights::default());
    let solved = |method| {
        let unknowns = guess::from_standing(&problem);
        let settings = Settings { method, iterations: 60, ..Settings::default() };
        let go_on = &mut |_: &_| ControlFlow::Continue(());
        let go_on = &mut Effort::new(&Structures::default(), go_on);
        let outcome = solve(&problem, unknowns, SolveMode::Cold, &settings, go_on).outcome;
        (outcome.energy, outcome.unknowns)
    };
    let (filtered, at_filtered) = solved(Method::NewtonFiltered);
    let (exact, at_exact) = solved(Method::NewtonTrue);
    let relative = (filtered - exact).abs() / exact;
    assert!(relative < 1e-6, "{filtered:?} {exact:?}"); // both end flat to 1e-8 a step
    let (_, at_multipliers) = solved(Method::GaussNewton);
    let scale = &problem.layout.scale;
    // The same energy ends at the same point. The penalty compromises a little with the costs, the multipliers do not. Only a
    // weak cost determines wheel speeds after the last interval.
    for (a, b, tolerance) in [(&at_filtered, &at_exact, 1e-6), (&at_multipliers, &at_exact, 1e-3)] {
        for (slot, (a, b)) in a.slots.iter().zip(&b.slots).enumerate() {
            let mut apart = (a - b).component_div(scale);
            if slot + 1 == problem.samples {
                for wheel in problem.layout.end_effectors.iter().filter_map(|ee| ee.wheel) {
                    apart[wheel.speed] = 0.0;
                }
            }
            assert!(apart.amax() < tolerance, "slot {slot}: {}", apart.amax());
        }
    }
}
