//! Effect of each slider on a plan: derivatives of all quantities of design files with respect to all parameters of the robot,
//! with the motion replanned (thesis 2.5.1).

use crate::documents::{DocumentText, Documents, Project, faults};
use crate::messages::{Answer, QuantitySlopes, Slope};
use crate::sliders::{Slider, sliders};
use rollwalk_design::designed::{Designed, NamedText};
use rollwalk_design::file::Parameter;
use rollwalk_design::goal::Quantity;
use rollwalk_design::plans::{self, PlansError};
use rollwalk_planner::Solution;
use rollwalk_planner::sensitivity::{self, Curvature, NotOptimal, Objective};
use std::ops::ControlFlow;

/// Computes the slopes of every quantity that is defined for the motion.
///
/// # Errors
/// Returns an error if the plan has no optimum, or if the caller stops the search for it.
pub fn slopes(
    documents: &Documents<'_>,
    project: &Project<'_>,
    solution: &Solution,
    progress: &mut dyn FnMut(&Answer) -> ControlFlow<()>,
) -> Result<Vec<QuantitySlopes>, Answer> {
    let named = |DocumentText { path, text }: DocumentText<'_>| NamedText {
        name: path.into(),
        text: text.into(),
    };
    let robot = project.robot_file;
    let parameters =
        sliders(documents, robot.path, robot.text).into_iter().map(parameter).collect();
    let motions = vec![named(project.motion_file).into()];
    let designed = Designed::with_parameters(named(robot), motions, parameters);
    let designed = designed.map_err(|error| faults(robot.text, &error))?;
    let watch = &mut |motion: &str, state: &_| progress(&Answer::progress(state, motion));
    let mut optimal = plans::optimal(solution, watch).map_err(|failed| answer(&failed))?;

    // A parameter at a limit of robot files has no slope, because one neighbour breaks a rule. The others have slopes.
    let motion = &solution.plan.motion;
    let around = |k| Some((k, designed.around(designed.original(), k).ok()?));
    let around: Vec<_> = (0..designed.original().len()).filter_map(around).collect();
    let motions: Vec<_> = around.iter().map(|(_, of)| of.motions(0, motion)).collect();
    let both = around.iter().zip(&motions);
    let mut known: Vec<_> = both.map(|((k, of), motions)| (*k, of.of_motion(motions))).collect();

    let quantities = Quantity::ALL.into_iter().filter(|of| of.objective.is_defined(motion));
    let quantities: Vec<Quantity> = quantities.collect();
    let objectives: Vec<Objective> = quantities.iter().map(|of| of.objective).collect();
    let mut gradients = |objectives: &[Objective], of: &[(usize, sensitivity::Parameter<'_>)]| {
        let parameters: Vec<_> = of.iter().map(|(_, parameter)| *parameter).collect();
        optimal.gradients(objectives, &parameters)
    };
    let mut found = gradients(&objectives, &known);
    if let Err(NotOptimal::OtherRows { .. } | NotOptimal::OtherProblem(_)) = found {
        known.retain(|one| gradients(&[], &[*one]).is_ok());
        found = gradients(&objectives, &known);
    }
    let of_quantity = |(of, (value, slopes)): (Quantity, (f64, Vec<f64>))| {
        let slope = |((k, _), slope): (&(usize, _), f64)| {
            let (name, step) = (designed.file.parameters[*k].name.clone(), designed.unit(*k));
            Slope { name, step, by_step: slope * step }
        };
        let slopes = known.iter().zip(slopes).map(slope).collect();
        QuantitySlopes { name: of.name, unit: of.unit, value, little: of.little, slopes }
    };
    let found = found.map_err(|why| answer(&why.into()))?;
    // Sliders show slopes without an explanation.
    if optimal.curvature() == Curvature::GaussNewton {
        let (motion, reason) =
            (motion.name.clone(), "the second derivatives are not positive there");
        return Err(answer(&NotOptimal::NoOptimum { motion, reason }.into()));
    }
    Ok(quantities.into_iter().zip(found).map(of_quantity).collect())
}

fn parameter(Slider { shown, place }: Slider) -> Parameter {
    let (min, max, step) = (shown.min, shown.max, Some(shown.step));
    Parameter { name: shown.name, place, min, max, step }
}

fn answer(failed: &PlansError) -> Answer {
    let help = match failed {
        PlansError::Interrupted => "request the slopes again",
        _ => {
            "change the motion until its plan meets its constraints and is near an optimum; only such plans have slopes"
        }
    };
    Answer::Error { message: failed.to_string(), help: help.into() }
}
