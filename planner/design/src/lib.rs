//! Robot design (thesis 2.5): parameters of a robot file, and the motions that depend on them.
//!
//! A parameter changes values of the robot *file*, and the robot is parsed again from the changed text. A design is therefore
//! exactly the file that is finally written, with templates and mirrored sides. Comments stay.
//!
//! | module | content |
//! |---|---|
//! | [`catalog`] | servos on the market, and the limits that motions may use |
//! | [`designed`] | robot under design: its file at any values of the parameters, and its motions |
//! | [`duty`] | required speeds and torques of the motors, and the servos that suffice |
//! | [`file`](mod@file) | design files: parameters with their bounds |
//! | [`goal`] | goal of an optimisation |
//! | [`keep`](mod@keep) | semi-automatic changes: some parameters are given, the others keep a feature of the motions |
//! | [`rounding`] | rounding of a result to manufacturing steps |
//! | [`optimise`](mod@optimise) | optimisation of the parameters |
//! | [`parameter`] | kinds of parameters |
//! | [`plans`] | plans of all motions of a design |
//! | [`repair`](mod@repair) | smallest change that makes infeasible motions feasible |
//! | [`sweep`] | sweeps over designs, in independent chains |
//! | [`text`] | text of a robot file with changeable values |
//!
//! ```
//! use rollwalk_design::text::RobotText;
//!
//! let text = std::fs::read_to_string("../../shipped/robots/agilebot.toml")?;
//! let catalog = rollwalk_design::catalog::Catalog::shipped();
//! assert!(!catalog.servos().is_empty());
//! // Numbers change, comments stay.
//! let robot = RobotText::new(&text)?;
//! assert_eq!(robot.to_string(), text);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![warn(missing_docs)]

pub mod designed;
pub mod duty;
pub mod file;
pub mod goal;
pub mod keep;
pub mod optimise;
pub mod parameter;
pub mod plans;
mod quadratic;
pub mod repair;
pub mod rounding;
pub mod sweep;
pub mod text;

pub use rollwalk_robot::catalog;
