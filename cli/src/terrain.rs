//! Command-line options for the ground under a simulated robot, and for pushes.

use crate::cmd::standing::StandingReport;
use clap::ValueEnum;
use miette::miette;
use rollwalk_multibody::ground::file::SLOPE_MAX_DEG;
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::World;
use rollwalk_physics::push::Shove;
use rollwalk_physics::world::Parameters;
use rollwalk_planner::plan::Plan;
use rollwalk_robot::Robot;
use rollwalk_terminal::inputs::Source;
use std::path::PathBuf;
use std::sync::Arc;

/// Maximum force, N, and maximum duration, s, of a push.
const PUSH_MAX: f64 = 1e4;
/// Maximum initial penetration of a robot into the ground, m.
const DEEPEST_M: f64 = 5e-3;
/// Minimum number of feet and wheels for standing.
pub const FEET_MIN: usize = 3;

/// Support of a simulated robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Support {
    /// Ground with gravity, contact and friction.
    Ground,
    /// Stand: the body is fixed, and joints do not interact dynamically.
    Stand,
}

/// Options for the ground and for pushes.
#[derive(clap::Args, Debug)]
pub struct GroundArgs {
    /// Slope of the ground, degrees from -45 to 45, rising ahead of the robot [default: 0].
    #[arg(long, value_name = "DEGREES", conflicts_with = "terrain", value_parser = slope)]
    slope: Option<f64>,
    /// Terrain file: a slope, step, ramp, profile, rough ground or height field (docs/terrain-files.md).
    #[arg(long, value_name = "TERRAIN.toml")]
    terrain: Option<PathBuf>,
    /// Push the body from AT s after the start, for DURATION s, with a force in N ahead, left and up; may be given several
    /// times.
    #[arg(long, value_name = "AT:AHEAD,LEFT,UP:DURATION", allow_hyphen_values = true, value_parser = shove)]
    push: Vec<Shove>,
}

/// Returns level ground.
///
/// # Errors
/// Returns an error if a robot in its nominal pose reaches into the ground.
pub fn level_ground_for(robot: &Robot) -> miette::Result<Arc<dyn Ground>> {
    let level: Arc<dyn Ground> = Arc::new(Plane::level());
    let deep_m = depth_m(robot, &level);
    if deep_m <= DEEPEST_M {
        return Ok(level);
    }
    let shape = StandingReport::new(robot).and_then(|standing| standing.shape_in_ground());
    Err(match shape {
        Some(shape) => miette!(
            help = "`rollwalk robot check` prints the heights of all links",
            "{} does not stand on level ground: {shape}",
            robot.name
        ),
        None => {
            let help = "check the nominal pose with `rollwalk robot check`";
            inside(robot, "level ground", deep_m, help)
        }
    })
}

fn depth_m(robot: &Robot, ground: &Arc<dyn Ground>) -> f64 {
    World::standing(robot, ground, &Parameters::new(robot)).depth_m()
}

fn inside(robot: &Robot, ground: &str, deep_m: f64, help: &str) -> miette::Report {
    miette!(
        help = help,
        "{} does not stand on {ground}: part of the robot is {deep_m:.3} m below the surface",
        robot.name
    )
}

impl GroundArgs {
    /// True if any option of the ground was given.
    pub fn is_given(&self) -> bool {
        self.slope.is_some() || self.terrain.is_some() || !self.push.is_empty()
    }

    /// True if a terrain file was given.
    pub fn has_terrain(&self) -> bool {
        self.terrain.is_some()
    }

    /// Returns the ground.
    ///
    /// # Errors
    /// Returns an error if the terrain file is missing or wrong.
    fn ground(&self) -> miette::Result<Arc<dyn Ground>> {
        match &self.terrain {
            Some(path) => Ok(Source::Disk.terrain(path)?.solid()),
            None => Ok(Arc::new(Plane::rising(self.slope.unwrap_or(0.0).to_radians()))),
        }
    }

    /// Returns the ground of a run of a plan; `None` for the plan's own terrain, if no option replaces it.
    ///
    /// # Errors
    /// Returns the errors of [`ground_for`](Self::ground_for).
    pub fn for_plan(&self, plan: &Plan) -> miette::Result<Option<Arc<dyn Ground>>> {
        let given = self.slope.is_some() || self.terrain.is_some();
        let own = plan.motion.terrain.is_some() && !given;
        (!own).then(|| self.ground_for(&plan.robot)).transpose()
    }

    /// Returns the ground, after checking that the robot does not start inside it.
    ///
    /// # Errors
    /// Returns an error if the terrain file is missing or wrong, or if the robot would start inside the ground.
    pub fn ground_for(&self, robot: &Robot) -> miette::Result<Arc<dyn Ground>> {
        let ground = self.ground()?;
        let deep_m = depth_m(robot, &ground);
        if deep_m <= DEEPEST_M {
            return Ok(ground);
        }
        level_ground_for(robot)?;
        let help = if self.terrain.is_some() {
            "move steps, walls and obstacles away from the origin, where the robot starts"
        } else {
            "give a gentler slope"
        };
        Err(inside(robot, "this ground at the origin", deep_m, help))
    }

    /// Pushes of the command line.
    pub fn shoves(&self) -> Vec<Shove> {
        self.push.clone()
    }

    /// Returns the ground for a robot on the ground; `None` for a stand.
    ///
    /// # Errors
    /// Returns an error if the terrain file is missing or wrong, if the robot cannot stand, or if these options are used with a
    /// stand.
    pub fn under(
        &self,
        support: Support,
        robot: &Robot,
    ) -> miette::Result<Option<Arc<dyn Ground>>> {
        match support {
            Support::Stand if self.is_given() => Err(miette!(
                help = "leave out these options, or --on stand; with --actuators, add --on ground",
                "--slope, --terrain and --push are for a robot on the ground, but this robot is on \
                 a stand"
            )),
            Support::Stand => Ok(None),
            Support::Ground if robot.end_effectors.len() < FEET_MIN => Err(miette!(
                help = "add --on stand, so that the robot hangs on a stand",
                "{} cannot stand on the ground: it has {} feet and wheels, but at least {FEET_MIN} \
                 are required",
                robot.name,
                robot.end_effectors.len()
            )),
            Support::Ground => self.ground_for(robot).map(Some),
        }
    }
}

fn slope(text: &str) -> Result<f64, String> {
    let slope = text.parse().map_err(|_| "give a number in degrees".to_owned())?;
    let range = -SLOPE_MAX_DEG..=SLOPE_MAX_DEG;
    let wrong = || format!("give -{SLOPE_MAX_DEG} to {SLOPE_MAX_DEG} degrees");
    range.contains(&slope).then_some(slope).ok_or_else(wrong)
}

fn shove(text: &str) -> Result<Shove, String> {
    let number = |text: &str| match text.trim().parse::<f64>() {
        Ok(value) if value.abs() <= PUSH_MAX => Ok(value),
        Ok(_) => Err(format!("`{text}` is not within ±{PUSH_MAX}")),
        Err(_) => Err(format!("`{text}` is not a number")),
    };
    let parts: Vec<_> = text.split(':').collect();
    let [at, force, duration] = parts[..] else {
        return Err(
            "give time, force and duration, such as 3:20,0,0:0.1 (after 3 s, 20 N ahead, for 0.1 \
             s)"
            .into(),
        );
    };
    let force: Vec<_> = force.split(',').map(number).collect::<Result<_, _>>()?;
    let [ahead, left, up] = force[..] else {
        return Err(format!(
            "give 3 numbers for the force (N ahead, to the left and up), not {}",
            force.len()
        ));
    };
    let (from_s, duration_s) = (number(at)?, number(duration)?);
    if from_s < 0.0 || duration_s <= 0.0 {
        return Err("give a time of at least 0 s and a duration above 0 s".into());
    }
    Ok(Shove::new(from_s, duration_s, [ahead, left, up]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pushes_are_read() {
        let expected = Shove::new(2.5, 0.1, [20.0, -5.0, 0.0]);
        assert_eq!(shove("2.5:20,-5,0:0.1"), Ok(expected));
        for (text, why) in [
            ("2.5", "give time, force and duration"),
            ("2.5:20:0.1", "not 1"),
            ("2.5:20,x,0:0.1", "`x` is not a number"),
            ("-1:20,0,0:0.1", "a time of at least 0 s"),
            ("1:20,0,0:0", "a duration above 0 s"),
            ("1:20,0,inf:1", "`inf` is not within"),
            ("1:1000000,0,0:1", "`1000000` is not within ±10000"),
        ] {
            assert!(shove(text).unwrap_err().contains(why), "{text}: {:?}", shove(text));
        }
    }

    #[test]
    fn advice_is_about_the_ground_that_was_asked_for() {
        let text = include_str!("../../shipped/robots/agilebot.toml");
        let mut robot = Robot::from_toml("agilebot.toml", text).unwrap();
        // The legs are too short for the body.
        for end in &mut robot.end_effectors {
            end.center_in_link_m.z += 0.2;
        }
        let help = |slope| {
            let args = GroundArgs { slope, terrain: None, push: Vec::new() };
            let report = args.ground_for(&robot).map(drop).unwrap_err();
            report.help().map(|help| help.to_string()).unwrap_or_default()
        };
        assert!(level_ground_for(&robot).is_err());
        for slope in [None, Some(0.0), Some(5.0)] {
            assert!(help(slope).contains("rollwalk robot check"), "{slope:?}: {}", help(slope));
        }
    }

    #[test]
    fn slopes_are_bounded() {
        assert_eq!(slope("-45"), Ok(-45.0));
        assert!(slope("46").unwrap_err().contains("-45 to 45"));
        assert!(slope("NaN").is_err() && slope("steep").is_err());
    }
}
