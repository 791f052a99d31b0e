//! Tests of AgileBot's design: changed by hand, with its pitch kept, and optimised.

use rollwalk_design::catalog::Catalog;
use rollwalk_design::designed::{Designed, NamedText};
use rollwalk_design::duty::{self, Duty};
use rollwalk_design::goal::Goal;
use rollwalk_design::keep::keep;
use rollwalk_design::optimise::{is_better, merit_of, optimise};
use rollwalk_design::plans::{Plans, PlansError, optimal};
use rollwalk_planner::Progress;
use rollwalk_planner::families::Family;
use rollwalk_planner::plan::Status;
use rollwalk_planner::sensitivity::{Feature, Objective, Optimal};
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

fn read(path: &str) -> NamedText {
    let at = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shipped").join(path);
    NamedText { name: path.to_owned(), text: fs::read_to_string(at).unwrap() }
}

fn on(_: &str, _: &Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Shipped design with some of its motions.
fn legs(motions: &[&str]) -> Designed {
    let mut design = read("designs/agilebot_legs.toml");
    let list: Vec<String> =
        motions.iter().map(|motion| format!("{{ file = \"../{motion}\" }}")).collect();
    let start = design.text.find("motions = [").unwrap();
    let end = start + design.text[start..].find("\n]").unwrap() + 2;
    design.text.replace_range(start..end, &format!("motions = [ {} ]", list.join(", ")));
    let motions = motions.iter().map(|motion| read(motion));
    Designed::new(&design, read("robots/agilebot.toml"), motions).unwrap()
}

fn planned(designed: &Designed) -> Plans {
    let plans = designed.plan(designed.original(), &mut on).unwrap();
    plans.all_solved().unwrap();
    plans
}

/// Mean and largest change of the pitch, degrees.
fn pitched(before: &Plans, after: &Plans) -> [f64; 2] {
    let curve = |plans: &Plans| Feature::Pitch.of_plan(&plans.solutions[0].plan);
    let (before, after) = (curve(before), curve(after));
    assert_eq!(before.len(), after.len());
    let off: Vec<f64> =
        before.iter().zip(&after).map(|(a, b)| (a - b).abs().to_degrees()).collect();
    [off.iter().sum::<f64>() / off.len() as f64, off.iter().copied().fold(0.0, f64::max)]
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn longer_front_legs_pitch_the_body_by_hand_and_not_with_the_others_following() {
    let designed = legs(&["motions/trot.toml"]);
    let before = planned(&designed);
    let mut values = designed.original().to_vec();
    values[0] += 0.02;
    let by_hand = designed.plan_from(&before, &values, false, &mut on).unwrap();
    assert_eq!(by_hand.solutions[0].plan.solve.status, Status::Converged);
    let kept = keep(&designed, &before, &[(0, values[0])], Feature::Pitch, &mut on).unwrap();
    let [by_hand, kept_at] = [&by_hand, &kept].map(|after| pitched(&before, after));
    assert!(by_hand[0] > 1.0 && kept_at[1] < 0.1, "{by_hand:?} {kept_at:?}");
    let parameters = &designed.file.parameters;
    for (value, of) in kept.variant.values.iter().zip(parameters) {
        assert!((of.min..=of.max).contains(value), "{} = {value}", of.name);
    }
    assert!((kept.variant.values[0] - values[0]).abs() < 1e-9, "what is given is given");
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn optimised_legs_are_better_within_their_bounds_and_what_is_kept() {
    let designed = legs(&["motions/trot.toml", "motions/drive_1m.toml"]);
    let before = planned(&designed);
    let bound = 1.5;
    let goal = Goal {
        minimise: vec![(Objective::CostOfTransport, 1.0)],
        parameters: Vec::new(),
        keep: vec![(Objective::PeakJointTorque, bound)],
        pull: 1e-3,
    };
    let mut seen = 0;
    let found = optimise(&designed, &before, &goal, &mut on, &mut |_| seen += 1).unwrap();
    assert!(found.steps.len() == seen && seen > 2, "{seen} steps");
    let merits = found.steps.windows(2).all(|pair| pair[1].merit < pair[0].merit);
    assert!(merits, "{:?}", found.steps);
    let (first, last) = (&found.steps[0], &found.steps[seen - 1]);
    assert!(first.quantities[0][1] > bound, "the trot begins above its bound");
    for (motion, quantities) in last.quantities.iter().enumerate() {
        assert!(quantities[1] < 1.005 * bound, "{motion}: {quantities:?}");
    }
    let share = |step: &rollwalk_design::optimise::Step| -> f64 {
        step.quantities.iter().zip(&first.quantities).map(|(now, then)| now[0] / then[0]).sum()
    };
    assert!(share(last) < 0.95 * share(first), "{:?}", last.quantities);
    for (value, of) in last.values.iter().zip(&designed.file.parameters) {
        assert!((of.min..=of.max).contains(value), "{} = {value}", of.name);
    }
}

#[test]
fn the_caller_ends_it() {
    let designed = legs(&["motions/trot.toml"]);
    let stop = &mut |_: &str, _: &Progress| ControlFlow::Break(());
    let stopped = designed.plan(designed.original(), stop);
    assert!(matches!(stopped, Err(PlansError::Interrupted)));
    let before = planned(&designed);
    let stopped = keep(&designed, &before, &[(0, 0.13)], Feature::Pitch, stop);
    assert!(matches!(stopped, Err(PlansError::Interrupted)), "{stopped:?}");
}

#[test]
fn results_are_multiples_of_what_can_be_made() {
    let designed = legs(&["motions/trot.toml"]);
    let rounded = designed.rounded(&[0.12349, 0.0899999, 0.16, 0.1, 0.0704, 0.19]);
    assert_eq!(rounded, [0.123, 0.09, 0.16, 0.1, 0.07, 0.19]);
    // Other rounded designs, the nearest first. The first two parameters are between multiples.
    let others = designed.roundings(&[0.1234, 0.1003, 0.16, 0.1, 0.07, 0.19]);
    let two: Vec<[f64; 2]> = others.iter().map(|values| [values[0], values[1]]).collect();
    assert_eq!(two, [[0.123, 0.1], [0.124, 0.1], [0.123, 0.101], [0.124, 0.101]]);
    assert!(others.iter().all(|values| values[2..] == [0.16, 0.1, 0.07, 0.19]));
    let variant = designed.at(&rounded).unwrap();
    assert!(variant.text.contains("origin_in_parent_m = [0.19, 0.07, 0.0]"), "{}", variant.text);
}

#[test]
fn plans_at_their_optimum_have_the_quantities_that_were_optimised() {
    let designed = legs(&["motions/trot.toml"]);
    let solved = planned(&designed);
    let objective = Objective::PeakJointTorque;
    let mut optimum = optimal(&solved.solutions[0], &mut on).unwrap();
    let (at_optimum, _) = optimum.gradients(&[objective], &[]).unwrap()[0];
    let of = |plans: &Plans| {
        objective.of_plan(&plans.solutions[0].plan, &Default::default()) / at_optimum - 1.0
    };
    let there = solved.clone().at_optimum(&mut on).unwrap();
    let (of_solve, of_optimum) = (of(&solved), of(&there));
    assert!(of_optimum.abs() < 1e-4, "{of_optimum}");
    assert!(of_solve.abs() > 10.0 * of_optimum.abs(), "a solve leaves more: {of_solve}");
}

#[test]
fn designs_that_can_be_made_are_within_their_bounds_or_say_by_how_much_they_are_not() {
    let mut designed = legs(&["motions/trot.toml"]);
    let before = planned(&designed);
    let mut values = designed.original().to_vec();
    values[1] += 0.0104;
    let found = designed.plan_from(&before, &values, false, &mut on).unwrap();
    let up = |values: &[f64]| -values[1];
    let beyond = |bound: f64| {
        let goal = designed.file.goal.as_mut().unwrap();
        goal.keep = vec![(Objective::PeakJointTorque, bound)];
        let made = designed.round_to_steps(&found, &up, &mut on).unwrap();
        let kept = designed.kept(&made);
        assert!(made.all_hold() && kept.len() == 1);
        (made.variant.values[1], kept[0].clone())
    };
    let mut beyond = beyond;
    // The design with the better prediction comes first, although it is further away.
    let (longer, kept) = beyond(10.0);
    assert!((longer - 0.131).abs() < 1e-12 && kept.is_within());
    // A bound between both values decides.
    let (either, kept) = beyond(0.5);
    assert!(!kept.is_within() && kept.excess() > 1.0, "{kept:?}");
    let torques = [0.13, 0.131].map(|length| {
        let mut values = designed.original().to_vec();
        values[1] = length;
        let plans = designed.plan_from(&found, &values, true, &mut on).unwrap();
        designed.kept(&plans.at_optimum(&mut on).unwrap())[0].value
    });
    let least = if torques[0] < torques[1] { 0.13 } else { 0.131 };
    assert!((either - least).abs() < 1e-12, "{either} of {torques:?}");
}

#[test]
fn a_walk_whose_optimum_is_out_of_reach_is_optimised_with_estimates() {
    let design = NamedText {
        name: "pup".to_owned(),
        text: "name = \"pup\"\nrobot = \"../robots/pup.toml\"\nmotions = [ { file = \"../motions/pup_walk.toml\" } ]\n\
               [[parameter]]\nname = \"thigh\"\nlength_of = \"leg/*_thigh\"\nmin_m = 0.056\nmax_m = 0.091\n\
               [goal]\nminimise = { peak_joint_speed = 1.0 }\n"
            .to_owned(),
    };
    let walk = vec![read("motions/pup_walk.toml")];
    let designed = Designed::new(&design, read("robots/pup.toml"), walk).unwrap();
    let goal = designed.file.goal.clone().unwrap();
    let before = planned(&designed);
    let found = optimise(&designed, &before, &goal, &mut on, &mut |_| ()).unwrap();
    assert_eq!(found.estimated, ["walk"]);
    assert!(found.gain_of_predicted() > Some(0.5), "{:?}", found.steps);
    let after = designed.round_to_steps(&found.plans, &|_| 0.0, &mut on).unwrap();
    let gain = 1.0 - merit_of(&designed, &goal, &after, &before);
    assert!(gain > 0.03 && after.all_hold(), "{gain}");
    let better = |one, other| is_better(&designed, &goal, one, other);
    assert!(better(&after, &before) && !better(&before, &after));
    assert!(!better(&after, &after), "the same robot");
    let mut lost = after.clone();
    lost.solutions[0].plan.solve.status = Status::Infeasible;
    assert!(!better(&lost, &before) && better(&before, &lost) && !better(&lost, &lost));
}

#[test]
fn prices_say_what_a_stronger_servo_is_worth() {
    let mut design = read("designs/agilebot_legs.toml");
    let first = design.text.find("[[parameter]]").unwrap();
    design.text.truncate(first);
    design.text +=
        "[[parameter]]\nname = \"torque\"\ntorque_of = \"xm540\"\nmin_nm = 1.0\nmax_nm = 3.0\n";
    let motions = ["motions/trot.toml", "motions/walk.toml", "motions/turn_in_place.toml"];
    let mut robot = read("robots/agilebot.toml");
    robot.text = robot.text.replace("torque_max_nm = 4.38", "torque_max_nm = 1.79");
    let designed = Designed::new(&design, robot, motions.map(read).to_vec()).unwrap();
    let before = planned(&designed);
    let solution = &before.solutions[0];
    let on = &mut |_: &Progress| ControlFlow::Continue(());
    let mut optimal = Optimal::of(solution, &Default::default(), on).unwrap();
    let prices = optimal.prices();
    let torque = prices.iter().find(|price| price.family == Family::JointTorque).unwrap();
    assert_eq!(torque.given, Some(("torque_max_nm", 1.79)));
    assert!(torque.subjects.iter().all(|joint| joint.contains("knee") || joint.contains("pitch")));
    let around = designed.around(designed.original(), 0).unwrap();
    let motions = around.motions(0, &solution.plan.motion);
    let parameters = [around.of_motion(&motions)];
    let (_, slopes) = &optimal.gradients(&[Objective::PlanCost], &parameters).unwrap()[0];
    // Inside the band of a limit, the multiplier is partly due to smoothing.
    let ratio = torque.per_unit / slopes[0];
    assert!((0.8..1.25).contains(&ratio), "{ratio}: {prices:?}");
}

#[test]
fn numbers_of_motions_are_parameters_and_parameters_are_goals() {
    let read_fast = |from: &str, to: &str| {
        let mut design = read("designs/agilebot_fast_trot.toml");
        design.text = design.text.replace(from, to);
        Designed::new(&design, read("robots/agilebot.toml"), vec![read("motions/trot.toml")])
    };
    let designed = read_fast("", "").unwrap();
    assert_eq!(designed.original()[0], 0.16);
    assert_eq!(designed.file.goal.as_ref().unwrap().parameters, [(0, -1.0)]);
    let variant = designed.at(&[0.2, 0.12, 0.12, 0.08]).unwrap();
    assert_eq!(variant.motions[0].goal.forward_m, Some(0.2));
    assert!(variant.motion_texts[0].contains("forward_m = 0.2\n"), "{}", variant.motion_texts[0]);
    assert!(variant.motion_texts[0].starts_with("# AgileBot trots"), "comments stay");
    for (from, to, problem, help) in [
        (
            "trot/goal",
            "walk/goal",
            "the design has no motion file `walk`",
            "give one of the motion files trot",
        ),
        ("goal.forward_m", "goal.way_m", "has no `way_m`", "forward_m, left_m, turn_rad"),
        ("trot/goal.forward_m", "trot/name", "`name` is not a number", "name a number"),
        ("{ way", "{ road", "`road` is neither a quantity nor a parameter", "way, thigh, shank"),
    ] {
        let error = read_fast(from, to).unwrap_err();
        let fault = error.faults().next().unwrap();
        let found = format!("{fault} {}", fault.help);
        assert!(found.contains(problem) && found.contains(help), "{to}: {found}");
    }
}

#[test]
fn motors_have_duties_and_the_catalogue_has_servos_for_them() {
    let designed = legs(&["motions/trot.toml"]);
    let duties = duty::duties(&planned(&designed));
    let named = |duty: &Duty| (duty.model.clone(), duty.wheels, duty.motors.len());
    let expected =
        [("XM430-W210-T", false, 8), ("XM540-W150-T", false, 8), ("XM430-W210-T", true, 4)];
    let expected = expected.map(|(model, wheels, count)| (model.to_owned(), wheels, count));
    assert_eq!(duties.iter().map(named).collect::<Vec<_>>(), expected);
    let catalog = Catalog::shipped();
    for duty in &duties {
        let servos = duty.servos(&catalog);
        assert!(servos.iter().any(|servo| servo.name == duty.model), "its own does it: {duty:?}");
        assert!(servos.windows(2).all(|pair| pair[0].mass_kg <= pair[1].mass_kg));
        let weak = servos.iter().find(|servo| servo.torque_max_nm < duty.torque_nm);
        assert_eq!(weak, None);
    }
}
