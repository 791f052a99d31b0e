//! Refinement: plans that fail as played are planned again with more samples.

use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::report::{Judgement, Report};
use rollwalk_planner::{Options, Progress, optimise};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

const BRAINBOT: &str = include_str!("../../../shipped/robots/brainbot.toml");
/// Turn of BrainBot. With 12 samples, its wheels creep.
const TURN: &str = include_str!("../../../shipped/motions/table_2_1/brainbot_turn.toml");

fn turn(extra: &str) -> (Robot, Motion) {
    let robot = Robot::from_toml("brainbot.toml", BRAINBOT).unwrap();
    let few = TURN.replacen("samples = 24", &format!("samples = 12\n{extra}"), 1);
    assert_ne!(few, TURN);
    let motion = Motion::from_toml("brainbot_turn.toml", &few, &robot).unwrap();
    (robot, motion)
}

fn plan(extra: &str, refine: bool, progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>) -> Plan {
    let (robot, motion) = turn(extra);
    optimise(&robot, &motion, &Options { refine, ..Options::default() }, progress)
}

fn go(_: &Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

#[test]
fn a_grid_that_is_too_coarse_is_refined_until_the_plan_holds() {
    let coarse = plan("", false, &mut go);
    assert_eq!((coarse.samples.len(), coarse.solve.status), (12, Status::Converged));
    let report = Report::new(&coarse);
    assert_eq!(report.judgement, Judgement::FailsAsPlayed, "{report}");

    let mut iterations = 0;
    let fine = plan("", true, &mut |progress| {
        assert_eq!(progress.iteration, iterations + 1, "one count for all grids");
        iterations = progress.iteration;
        ControlFlow::Continue(())
    });
    assert_eq!((fine.samples.len(), fine.solve.status), (24, Status::Converged));
    assert_eq!(Report::new(&fine).judgement, Judgement::Consistent);
    assert_eq!(fine.solve.iterations, iterations);
    let [coarser] = &fine.solve.refinements[..] else { panic!("{:?}", fine.solve.refinements) };
    assert_eq!(coarser.samples, 12);
    let row = report.worst().expect("a row");
    assert_eq!(coarser.residual, row.family);
    assert!(coarser.worst > coarser.tolerance);
    // Both are unchanged after a round trip through a file.
    assert_eq!(Plan::from_json("fine.json", &fine.to_json()).unwrap(), fine);
}

#[test]
fn an_interrupted_refinement_keeps_the_plan_that_converged() {
    let coarse = plan("", false, &mut go);
    let kept = plan("", true, &mut |progress| match progress.iteration > coarse.solve.iterations {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    });
    assert_eq!((kept.samples.len(), kept.solve.status), (12, Status::FailsAsPlayed));
    assert_eq!(kept.samples, coarse.samples);
    assert_eq!(Report::new(&kept).judgement, Judgement::FailsAsPlayed);
}

#[test]
fn motions_that_need_feedback_keep_their_samples() {
    let plan = plan("needs_feedback = \"wheels creep\"", true, &mut go);
    assert_eq!((plan.samples.len(), plan.solve.status), (12, Status::Converged));
    let report = Report::new(&plan);
    assert_eq!(report.judgement, Judgement::NeedsFeedback);
    let words = report.conclusion(&plan.solve).to_string();
    assert!(words.starts_with("needs feedback when played: wheels creep"), "{words}");
}

#[test]
fn every_status_and_residual_has_one_verdict() {
    let good = plan("", true, &mut go);
    let judged = |change: &dyn Fn(&mut Plan)| {
        let mut changed = good.clone();
        change(&mut changed);
        let report = Report::new(&changed);
        (report.judgement, report.conclusion(&changed.solve).to_string())
    };
    let far = |plan: &mut Plan| plan.samples[5].com_m[0] += 0.1;
    for status in [Status::Infeasible, Status::Stalled, Status::IterationLimit, Status::Interrupted]
    {
        // Independent of the residuals.
        for moved in [false, true] {
            let (judgement, words) = judged(&|plan| {
                plan.solve.status = status;
                if moved {
                    far(plan);
                }
            });
            assert_eq!(judgement, Judgement::NotConverged);
            assert!(words.starts_with(&format!("did not converge ({status}): ")), "{words}");
        }
    }
    for status in [Status::Converged, Status::FailsAsPlayed] {
        let (judgement, words) = judged(&|plan| plan.solve.status = status);
        assert_eq!(judgement, Judgement::Consistent);
        assert!(words.starts_with("consistent: "), "{words}");
        let (judgement, words) = judged(&|plan| {
            plan.solve.status = status;
            far(plan);
        });
        assert_eq!(judgement, Judgement::BeyondTolerance);
        assert!(words.starts_with("not consistent, because the plan was changed"), "{words}");
    }
}
