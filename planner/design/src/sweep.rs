//! Sweeps over designs: a grid of parameters and choices, in a fixed order.
//!
//! Points are counted along the axes in the order of the file; the last numeric axis varies fastest. The points along this
//! axis form a **chain**: the first point is planned from scratch, and every other one from its neighbour. Chains are
//! independent of each other. A sweep can therefore be interrupted between chains or split, and gives the same rows.

pub mod figure;
mod file;
pub mod picture;
mod row;
pub mod table;

pub use file::{Axis, Dataset, RobotChoice, Sweep, speed_of};
pub use row::{Keep, Row};

use crate::catalog::Catalog;
use crate::designed::{Designed, MotionFile, NamedText};
use crate::goal::Goal;
use crate::plans::{PlansError, Watch};
use rollwalk_planner::Structures;
use rollwalk_robot::document::DocumentError;
use std::collections::BTreeMap;

/// Files of a sweep, by the names that the sweep uses.
#[derive(Clone, Debug, Default)]
pub struct Files {
    /// Robot files.
    pub robots: BTreeMap<String, NamedText>,
    /// Motion files.
    pub motions: BTreeMap<String, MotionFile>,
}

/// Sweep with all of its files.
#[derive(Clone, Debug)]
pub struct LoadedSweep {
    /// The sweep.
    pub sweep: Sweep,
    /// Design of the sweep; `None` if an axis lists robots instead.
    design: Option<Designed>,
    files: Files,
    catalog: Catalog,
}

impl LoadedSweep {
    /// Combines a sweep with its design and its other files.
    ///
    /// # Errors
    /// If the sweep file has faults, or its axes do not fit the design or the catalogue.
    pub fn new(
        text: &NamedText,
        design: Option<Designed>,
        files: Files,
        catalog: Catalog,
    ) -> Result<Self, DocumentError> {
        let sweep = Sweep::checked(text, design.as_ref(), &files, &catalog)?;
        Ok(Self { sweep, design, files, catalog })
    }

    /// Computes the rows of a chain. `keep` receives every plan.
    ///
    /// # Errors
    /// If the caller stops the work.
    pub fn chain(
        &self,
        chain: usize,
        watch: &mut Watch<'_>,
        keep: &mut Keep<'_>,
    ) -> Result<Vec<Row>, PlansError> {
        row::chain(self, chain, watch, keep)
    }

    /// Warnings for the servo axes whose actuator has no mass in the robot file.
    pub fn without_mass(&self) -> impl Iterator<Item = String> + '_ {
        let actuators = self.sweep.axes.iter().filter_map(|axis| match axis {
            Axis::Servos { actuator, .. } => Some(actuator),
            _ => None,
        });
        let design = self.design.iter();
        design
            .flat_map(move |of| actuators.clone().filter_map(|actuator| of.mass_unknown(actuator)))
    }

    /// Title of an axis: its name and the unit of its values.
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

    /// Builds the design for the choices of a chain.
    fn designed(&self, chosen: &[usize]) -> Result<Designed, DocumentError> {
        let mut designed = self.design.clone();
        for (axis, &at) in self.sweep.axes.iter().zip(chosen) {
            match axis {
                Axis::Robots { choices, .. } => {
                    let RobotChoice { robot, motions, .. } = &choices[at];
                    let motions = motions.iter().map(|motion| self.motion(motion)).collect();
                    let robot = self.files.robots[robot].clone();
                    designed = Some(Designed::fixed(robot, motions)?);
                }
                Axis::Motions { files, .. } => {
                    let motion = vec![self.motion(&files[at])];
                    designed = designed.map(|of| of.with_motions(motion)).transpose()?;
                }
                Axis::Servos { actuator, names, .. } => {
                    let servo = self.catalog.get(&names[at]);
                    if let Some(servo) = servo {
                        designed = designed.map(|of| of.with_servo(actuator, servo)).transpose()?;
                    }
                }
                Axis::Parameter { .. } | Axis::MotionValue { .. } => {}
            }
        }
        let mut designed = designed.expect("a sweep has a design or robots");
        // Chains run on different threads, which would take structures from each other.
        designed.structures = Structures::default();
        Ok(designed)
    }

    fn motion(&self, name: &str) -> MotionFile {
        self.files.motions[name].clone()
    }
}

#[cfg(test)]
mod tests;
