//! Common parts of the experiments on manipulation (thesis 4.7.4.2): an effector moves bodies, and Gauss–Newton's method
//! optimises its coordinates at every step.
//!
//! | module | contents |
//! |---|---|
//! | `task` | path of the effector, optimisation and checks |
//! | [`gripper`] | effector in the form of a cube, and the cubes that it pulls |
//! | `handles` | effectors on particles |

pub(crate) mod gripper;
mod handles;
mod task;

pub(crate) use handles::Handles;
pub(crate) use task::{
    Effector, EffectorPath, STEP_S, Solution, Task, ThesisWork, at_place, at_pose, objective,
};
