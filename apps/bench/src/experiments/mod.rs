//! Experiments of the thesis's differentiable simulator (ch. 4), as `rollwalk bench physics` runs them.
//!
//! An experiment is one file, and one line of [`ALL`]. It sets up bodies and contacts in [`rollwalk_physics`], then simulates,
//! optimises or estimates. The returned [`ExperimentOutcome`] contains measured values beside expected values and the values of
//! the thesis, and curves to draw. Experiments print and write nothing.
//!
//! | module | contents |
//! |---|---|
//! | [`outcome`] | results of an experiment |
//! | `bounce` | restitution and energy of a bouncing mass (Fig. 4.5) |
//! | `tori` | three soft tori thrown at a slope and a wall (Fig. 4.4) |
//! | `incline` | soft puck on an incline, with a reference without penalties (Fig. 4.1) |
//! | `ball_target` | soft ball tossed at a target (Fig. 4.12a) |
//! | `throwing`, `cma_es` | common parts of throws; optimiser without derivatives for comparison |
//! | `recovery` | parameters identified from a bounce (Fig. 4.9) |
//! | `landscape` | objective of a toss as a function of its velocity (Fig. 4.2) |
//! | `wall` | soft ball thrown at a target by way of wall and floor (Fig. 4.13a) |
//! | `bunny` | soft solid with a head and ears thrown so that it lands upright (Fig. 4.13b) |
//! | `backspin` | ball that backspin stops (Fig. 4.12b) |
//! | `restitution_points` | restitution as a function of the number of contact points (Fig. A.4) |
//! | `stiff_cube` | stiff cube thrown with ever stiffer contacts (Fig. A.5) |
//! | `sdf` | solids on a grid, and objects that fall on them (Fig. 4.6) |
//! | `parts`, `cloth` | parts of scenes: springs, contact points, cloth |
//! | `manipulation` | effector whose path is optimised step by step |
//! | `cube_drag` | cube that a gripper drags by strings (Fig. 4.14) |
//! | `coupled_cubes` | bodies that a gripper turns by springs (Fig. 4.15) |
//! | `cube_arc` | cube dragged along an arc, by Gauss–Newton's method and by CMA-ES (Fig. A.2) |
//! | `cube_tip` | cube that rubber bands tip over (Fig. 4.14c) |
//! | `catapult` | solid on a grid that a cloth throws (Fig. 4.16) |
//! | `sheet_flip` | sheet that is turned over by its corners (Fig. 4.17) |
//! | `throw_controller` | network that learns to throw (Fig. 4.19) |
//! | `chain` | computing time as a function of the number of bodies (Fig. A.3) |

mod backspin;
mod ball_target;
mod bounce;
mod bunny;
mod catapult;
mod chain;
mod cloth;
mod cma_es;
mod coupled_cubes;
mod cube_arc;
mod cube_drag;
mod cube_tip;
mod incline;
mod landscape;
mod manipulation;
pub mod outcome;
mod parts;
mod recovery;
mod restitution_points;
mod sdf;
mod sheet_flip;
mod stiff_cube;
mod throw_controller;
mod throwing;
mod tori;
mod wall;

pub use outcome::{Chart, Check, ExperimentOutcome};

/// Progress display and interruption of an experiment.
pub trait Watch {
    /// Shows a line of progress.
    fn report(&self, line: &str);

    /// True if the user has interrupted the experiment.
    fn interrupted(&self) -> bool;
}

#[derive(Clone, Copy)]
pub struct Experiment {
    /// Name on the command line.
    pub name: &'static str,
    /// Figure of the thesis.
    pub source: &'static str,
    /// Description of one line.
    pub about: &'static str,
    /// Function that runs the experiment; `None` after an interrupt before the first result.
    pub run: fn(&dyn Watch) -> Option<ExperimentOutcome>,
}

/// Experiments in the order of the thesis.
pub const ALL: &[Experiment] = &[
    Experiment {
        name: "tori",
        source: "Fig. 4.4",
        about: "soft tori thrown at a slope and a wall, compared by friction model",
        run: tori::run,
    },
    Experiment {
        name: "bounce",
        source: "Fig. 4.5",
        about: "restitution and energy of a bouncing mass, by scheme, step and damping",
        run: bounce::run,
    },
    Experiment {
        name: "sdf",
        source: "Fig. 4.6",
        about: "solids on a grid: errors by spacing, and the fall of a string and a cloth",
        run: sdf::run,
    },
    Experiment {
        name: "cube-drag",
        source: "Fig. 4.14",
        about: "poses of a gripper that drags a cube by strings to a target",
        run: cube_drag::run,
    },
    Experiment {
        name: "cube-tip",
        source: "Fig. 4.14c",
        about: "poses of a gripper that tips a cube over by rubber bands",
        run: cube_tip::run,
    },
    Experiment {
        name: "incline",
        source: "Fig. 4.1",
        about: "a soft puck that slides on an incline and sticks, with each model of friction",
        run: incline::run,
    },
    Experiment {
        name: "ball-target",
        source: "Fig. 4.12a",
        about: "a soft ball tossed at a target with up to two bounces, by L-BFGS and by CMA-ES",
        run: ball_target::run,
    },
    Experiment {
        name: "recovery",
        source: "Fig. 4.9",
        about: "material, friction and initial state of a soft ball, identified from a bounce",
        run: recovery::run,
    },
    Experiment {
        name: "landscape",
        source: "Fig. 4.2",
        about: "objective of a toss as a function of its velocity, with soft and stiff contacts",
        run: landscape::run,
    },
    Experiment {
        name: "backspin",
        source: "Fig. 4.12b",
        about: "a soft ball thrown so that backspin stops it after the bounce",
        run: backspin::run,
    },
    Experiment {
        name: "wall",
        source: "Fig. 4.13a",
        about: "a soft ball thrown at a target via wall and floor",
        run: wall::run,
    },
    Experiment {
        name: "bunny",
        source: "Figs. 4.3, 4.13b, A.1",
        about: "a soft solid with a head and ears thrown so that it lands upright, with and without a wall",
        run: bunny::run,
    },
    Experiment {
        name: "restitution-points",
        source: "Fig. A.4",
        about: "restitution of a cube as a function of the number of its contact points",
        run: restitution_points::run,
    },
    Experiment {
        name: "coupled-cubes",
        source: "Fig. 4.15",
        about: "poses of a gripper that turns the lowest of three bodies on springs",
        run: coupled_cubes::run,
    },
    Experiment {
        name: "catapult",
        source: "Fig. 4.16",
        about: "a solid on a grid thrown at a target by a cloth",
        run: catapult::run,
    },
    Experiment {
        name: "sheet-flip",
        source: "Fig. 4.17",
        about: "a sheet turned over and back by two of its corners",
        run: sheet_flip::run,
    },
    Experiment {
        name: "throw-controller",
        source: "Fig. 4.19",
        about: "a network that learns to throw, trained through the simulator",
        run: throw_controller::run,
    },
    Experiment {
        name: "cube-arc",
        source: "Fig. A.2",
        about: "a cube dragged along an arc, by Gauss-Newton's method and by CMA-ES",
        run: cube_arc::run,
    },
    Experiment {
        name: "chain",
        source: "Fig. A.3",
        about: "computing time by the number of bodies",
        run: chain::run,
    },
    Experiment {
        name: "stiff-cube",
        source: "Fig. A.5",
        about: "a stiff cube that slides to a target, with ever stiffer contacts",
        run: stiff_cube::run,
    },
];

/// Silent progress display that never interrupts.
#[cfg(test)]
struct NoProgress;

#[cfg(test)]
impl Watch for NoProgress {
    fn report(&self, _: &str) {}

    fn interrupted(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use super::ALL;

    #[test]
    fn names_are_unique() {
        let mut names: Vec<_> = ALL.iter().map(|experiment| experiment.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), ALL.len());
    }
}
