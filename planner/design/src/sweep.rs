//! Sweeps over designs: points on axes of parameters and of choices, in an order that does not depend on who computes them.
//!
//! Points are counted along the axes in the order of the file, the last axis of a parameter fastest. The points along it are a
//! **chain**: the first is planned from scratch, every other one from its neighbour. Chains know nothing of each other, so that
//! a sweep can be interrupted between them, and split, and gives the same rows.

pub mod figure;
mod file;
pub mod picture;
mod row;
pub mod table;

pub use file::{Axis, RobotChoice, Sweep, speed_of};
pub use row::Row;

use crate::catalog::Catalog;
use crate::designed::{Designed, NamedText};
use crate::goal::Goal;
use crate::plans::{Failed, Watch};
use rollwalk_robot::document::DocumentError;
use std::collections::BTreeMap;

/// The files that a sweep names, by the names that it has for them.
pub type Files = BTreeMap<String, NamedText>;

/// A sweep with everything that it needs.
#[derive(Clone, Debug)]
pub struct Ready {
    /// The sweep.
    pub sweep: Sweep,
    /// The design, if the sweep names one.
    design: Option<Designed>,
    files: Files,
    catalog: Catalog,
}

impl Ready {
    /// Joins a sweep with its design and its other files.
    ///
    /// # Errors
    /// Axes that do not fit the design or the catalogue, and files in which something is wrong.
    pub fn new(
        text: &NamedText,
        design: Option<Designed>,
        files: Files,
        catalog: Catalog,
    ) -> Result<Self, DocumentError> {
        let sweep = Sweep::checked(text, design.as_ref(), &catalog)?;
        Ok(Self { sweep, design, files, catalog })
    }

    /// Computes a chain.
    ///
    /// # Errors
    /// The caller stops it.
    pub fn chain(&self, chain: usize, watch: &mut Watch<'_>) -> Result<Vec<Row>, Failed> {
        row::chain(self, chain, watch)
    }

    /// Warnings of axes of servos whose mass the robot file does not have.
    pub fn without_mass(&self) -> impl Iterator<Item = String> + '_ {
        let actuators = self.sweep.axes.iter().filter_map(|axis| match axis {
            Axis::Servos { actuator, .. } => Some(actuator),
            _ => None,
        });
        let design = self.design.iter();
        design
            .flat_map(move |of| actuators.clone().filter_map(|actuator| of.mass_unknown(actuator)))
    }

    /// Name of an axis, with the unit of its values.
    fn axis_title(&self, axis: usize) -> String {
        let name = self.sweep.axes[axis].name();
        let parameters = self.design.iter().flat_map(|design| &design.file.parameters);
        let unit = parameters.filter(|of| of.name == name).map(|of| of.place.kind.unit().0).next();
        unit.map_or_else(|| name.to_owned(), |unit| format!("{name}, {unit}"))
    }

    /// Goal of the design.
    fn goal(&self) -> Option<&Goal> {
        self.design.as_ref()?.file.goal.as_ref()
    }

    /// The design of a chain's choices.
    fn designed(&self, chosen: &[usize]) -> Result<Designed, DocumentError> {
        let mut designed = self.design.clone();
        for (axis, &at) in self.sweep.axes.iter().zip(chosen) {
            match axis {
                Axis::Robots { choices, .. } => {
                    let RobotChoice { robot, motions, .. } = &choices[at];
                    let motions = motions.iter().map(|motion| self.file(motion)).collect();
                    designed = Some(Designed::fixed(self.file(robot), motions)?);
                }
                Axis::Motions { files, .. } => {
                    let motion = vec![self.file(&files[at])];
                    designed = designed.map(|of| of.with_motions(motion)).transpose()?;
                }
                Axis::Servos { actuator, names, .. } => {
                    let servo = self.catalog.get(&names[at]);
                    if let Some(servo) = servo {
                        designed = designed.map(|of| of.with_servo(actuator, servo)).transpose()?;
                    }
                }
                Axis::Parameter { .. } => {}
            }
        }
        Ok(designed.expect("a sweep has a design or robots"))
    }

    fn file(&self, name: &str) -> NamedText {
        self.files[name].clone()
    }
}

#[cfg(test)]
mod tests;
