//! Inputs of benchmarks: shipped files, by their path in the checkout, and the user's motions.

use miette::miette;
use rollwalk_design::designed::Designed;
use rollwalk_planner::library::BuiltLibrary;
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::Plan;
use rollwalk_robot::Robot;
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::planning::plan_all;
use std::path::Path;

/// Library with the plans that it was packed from.
pub struct PlannedLibrary {
    /// Name of the library.
    pub name: String,
    pub robot: Robot,
    /// Plans of the clips: motions, then transitions.
    pub plans: Vec<Plan>,
    /// Library packed without torques, for comparisons of the format by frames.
    pub built: BuiltLibrary,
    /// Library packed with torques, as flashed to a controller.
    pub with_torques: Vec<u8>,
}

/// Reads a shipped motion and its robot.
pub fn motion(file: &str) -> miette::Result<(Robot, Motion)> {
    Source::Shipped.motion(Path::new(file))
}

/// Reads a motion of the user and its robot.
pub fn own_motion(file: &Path) -> miette::Result<(Robot, Motion)> {
    Source::Disk.motion(file)
}

/// Reads a shipped design with its robot and motions.
pub fn design(file: &str) -> miette::Result<Designed> {
    Source::Shipped.design(Path::new(file))
}

/// Plans and packs a shipped library; `None` after an interrupt.
pub fn library(file: &str) -> miette::Result<Option<PlannedLibrary>> {
    let mut library = Source::Shipped.library(Path::new(file))?;
    let Some(plans) = plan_all(&library, false)? else { return Ok(None) };
    if let Some(failure) = plans.failures().first() {
        return Err(miette!("{file}: {failure}"));
    }
    let with_torques = plans.pack(&library)?.bytes;
    library.file.torques = false;
    let built = plans.pack(&library)?;
    let plans = plans.all().map(|planned| planned.plan.clone()).collect();
    let name = library.file.name.clone();
    let robot = library.robot;
    Ok(Some(PlannedLibrary { name, robot, plans, built, with_torques }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_binary_carries_every_motion_design_and_library() {
        for file in crate::motions() {
            motion(&file).unwrap();
        }
        for file in crate::designs() {
            design(file).unwrap();
        }
        for file in crate::libraries() {
            Source::Shipped.library(Path::new(file)).unwrap();
        }
    }
}
