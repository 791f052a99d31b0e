//! Reference values of manual designs: accuracy of predictions, and equal effect of mirrored parameters.

use rollwalk_design::designed::{Designed, NamedText};
use rollwalk_design::plans::optimal;
use rollwalk_planner::sensitivity::{Change, Design, Feature, Optimal};
use rollwalk_planner::{Options, Progress};
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

/// Design of AgileBot for one motion, with the thighs of limb pairs as parameters.
fn thighs(limbs: &[[&str; 2]], motion: &str) -> Designed {
    let parameter = |(k, [one, other]): (usize, &[&str; 2])| {
        format!(
            "[[parameter]]\nname = \"thigh{k}\"\nlength_of = \"leg/*_thigh\"\nlimbs = [\"{one}\", \"{other}\"]\nmin_m = 0.09\nmax_m = 0.16\n"
        )
    };
    let parameters: String = limbs.iter().enumerate().map(parameter).collect();
    let text = format!("name = \"thighs\"\nrobot = \"agilebot.toml\"\n{parameters}");
    let design = NamedText { name: "thighs.toml".into(), text };
    Designed::new(&design, read("robots/agilebot.toml"), vec![read(motion)]).unwrap()
}

/// Optimum of the motion, and its change with respect to every parameter.
fn linear(designed: &Designed) -> (Optimal, Vec<Change>) {
    let plans = designed.plan(designed.original(), &mut on).unwrap();
    let solution = &plans.solutions[0];
    let mut optimal = optimal(solution, &mut on).unwrap();
    let planned = &solution.plan.motion;
    let around = (0..designed.original().len())
        .map(|k| designed.around(designed.original(), k).unwrap())
        .collect::<Vec<_>>();
    let motions: Vec<_> = around.iter().map(|beside| beside.motions(0, planned)).collect();
    let parameters: Vec<_> =
        around.iter().zip(&motions).map(|(beside, motions)| beside.of_motion(motions)).collect();
    let changes = optimal.changes(&parameters).unwrap();
    (optimal, changes)
}

fn norm(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().map(|value| value * value).sum::<f64>().sqrt()
}

#[test]
fn predictions_of_two_centimetres_take_few_iterations_and_their_error_falls_with_the_square() {
    for motion in ["drive_1m", "turn_in_place", "trot"] {
        let designed = thighs(&[["front_left", "front_right"]], &format!("motions/{motion}.toml"));
        let (optimum, changes) = linear(&designed);
        let before = optimum.feature(Feature::Joints);
        let predicted = optimum.feature_change(Feature::Joints, &changes[0]);
        let error = |by_m: f64| {
            let variant = designed.at(&[designed.original()[0] + by_m]).unwrap();
            let motion = &variant.motions[0];
            let design = Design { robot: &variant.robot, motion };
            let options = Options { refine: false, ..Options::default() };
            let progress = &mut |_: &Progress| ControlFlow::Continue(());
            let found = optimum.replan(design, &[(by_m, &changes[0])], &options, progress).unwrap();
            // Design note, section 9: a median of five over the shipped motions.
            let iterations = found.plan.solve.iterations;
            assert!(iterations <= 5, "{}: {iterations} iterations for {by_m} m", motion.name);
            let after = optimal(&found, &mut on).unwrap().feature(Feature::Joints);
            norm((0..after.len()).map(|k| after[k] - before[k] - by_m * predicted[k]))
        };
        let [coarse, fine] = [0.02, 0.01].map(error);
        // A quarter except for third-order terms.
        assert!((2.5..6.5).contains(&(coarse / fine)), "{motion}: {coarse} and {fine}");
    }
}

#[test]
fn thighs_of_either_side_change_a_symmetric_motion_by_the_same() {
    let left_and_right = [["front_left", "rear_left"], ["front_right", "rear_right"]];
    let (_, changes) = linear(&thighs(&left_and_right, "motions/drive_1m.toml"));
    let [left, right] = [0, 1].map(|k: usize| norm(changes[k].unknowns.iter().copied()));
    assert!((left / right - 1.0).abs() < 1e-3, "{left} and {right}");
}
