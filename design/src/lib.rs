//! Designs: what may change about a robot, and the robot file that comes of a change (thesis 2.5).
//!
//! A parameter changes numbers of the robot *file*, from which the robot is read again. So a design means exactly what the file says
//! that is written in the end, templates and mirrored sides included, and comments stay.
//!
//! | module | is |
//! |---|---|
//! | [`file`](mod@file) | design files: parameters with their bounds, beside a robot file |
//! | [`parameter`] | kinds of parameters |
//! | [`text`] | a robot file in which parameters change numbers |

pub mod file;
pub mod parameter;
pub mod text;
