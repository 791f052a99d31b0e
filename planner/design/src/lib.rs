//! Designs: what may change about a robot, and the robot file that comes of a change (thesis 2.5).
//!
//! A parameter changes numbers of the robot *file*, from which the robot is read again. So a design means exactly what the file
//! says that is written in the end, templates and mirrored sides included, and comments stay.
//!
//! | module | is |
//! |---|---|
//! | [`catalog`] | servos that can be bought, and what motions may use of them |
//! | [`designed`] | a robot under design: its file at any values of the parameters, with its motions |
//! | [`duty`] | what motors must do, and which servos would do it |
//! | [`file`](mod@file) | design files: parameters with their bounds, beside a robot file |
//! | [`goal`] | what a design is optimised for |
//! | [`keep`](mod@keep) | semi-automatic changes: some parameters are given, the others keep a feature of the motions |
//! | [`made`] | the design that can be made around one that was found |
//! | [`optimise`](mod@optimise) | parameters with which the motions are best |
//! | [`parameter`] | kinds of parameters |
//! | [`plans`] | plans of all motions of a design |
//! | [`repair`](mod@repair) | the least change after which motions can be done that cannot be done as it is |
//! | [`sweep`] | sweeps over designs, in parts that know nothing of each other |
//! | [`text`] | a robot file in which parameters change numbers |
//!
//! ```
//! use rollwalk_design::parameter::Place;
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

pub mod catalog;
pub mod designed;
pub mod duty;
pub mod file;
pub mod goal;
pub mod keep;
pub mod made;
pub mod optimise;
pub mod parameter;
pub mod plans;
mod quadratic;
pub mod repair;
pub mod sweep;
pub mod text;
