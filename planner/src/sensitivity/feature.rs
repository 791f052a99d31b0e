//! Features that a design change can keep (thesis 2.5.2): curves of a plan, and their changes.

use super::Optimal;
use crate::formulation::rows::Columns;
use crate::plan::Plan;
use crate::problem::variables::Layout;
use crate::solve::optimum::Change;
use nalgebra::DVector;
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, JOINTS, Model};

/// Curves of a motion that can be kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// Pitch of the body, rad.
    Pitch,
    /// Roll and pitch of the body, rad.
    Tilt,
    /// Height of the body's origin, m.
    Height,
    /// Height of the body's origin, m, and roll and pitch times its mean height, m.
    Body,
    /// Angles of all joints, rad.
    Joints,
    /// Contact points of all end effectors, m in the world.
    Feet,
}

impl Feature {
    /// List of all features, with their names in commands.
    pub const ALL: [(&'static str, Self); 6] = [
        ("pitch", Self::Pitch),
        ("tilt", Self::Tilt),
        ("height", Self::Height),
        ("body", Self::Body),
        ("joints", Self::Joints),
        ("feet", Self::Feet),
    ];

    /// Returns the name in commands.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, feature)| *feature == self).map_or("", |(name, _)| name)
    }

    /// Returns the symbol of the unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Pitch | Self::Tilt | Self::Joints => "rad",
            Self::Height | Self::Body | Self::Feet => "m",
        }
    }
}

const HEIGHT: usize = BASE_POSITION + 2;
const PITCH: usize = BASE_YAW + 1;
const ROLL: usize = BASE_YAW + 2;

impl Feature {
    /// Values of the feature at all samples of a plan, in their order.
    pub fn of_plan(self, plan: &Plan) -> Vec<f64> {
        let layout = Layout::new(&Model::new(&plan.robot));
        let samples: Vec<_> =
            plan.samples.iter().map(|sample| layout.variables_of(sample)).collect();
        self.values(&layout, &samples)
    }

    fn values(self, layout: &Layout, samples: &[DVector<f64>]) -> Vec<f64> {
        let variables = self.variables(layout, samples);
        let of =
            |sample: &DVector<f64>| variables.iter().map(|(at, by)| sample[*at] * by).collect();
        samples.iter().flat_map(|sample| -> Vec<f64> { of(sample) }).collect()
    }

    /// Variables of a sample that make up the feature, with their factors.
    fn variables(self, layout: &Layout, samples: &[DVector<f64>]) -> Vec<(usize, f64)> {
        match self {
            Self::Pitch => vec![(PITCH, 1.0)],
            Self::Tilt => vec![(ROLL, 1.0), (PITCH, 1.0)],
            Self::Height => vec![(HEIGHT, 1.0)],
            Self::Body => {
                let sum_m: f64 = samples.iter().map(|sample| sample[HEIGHT]).sum();
                let mean_m = sum_m / samples.len() as f64;
                vec![(HEIGHT, 1.0), (ROLL, mean_m), (PITCH, mean_m)]
            }
            Self::Joints => (JOINTS..layout.dofs).map(|at| (at, 1.0)).collect(),
            Self::Feet => {
                let points = layout.end_effectors.iter().map(|of| of.position);
                points.flat_map(|at| (at..at + 3).map(|at| (at, 1.0))).collect()
            }
        }
    }
}

impl Optimal {
    /// Values of a feature at all samples, in their order.
    pub fn feature(&self, feature: Feature) -> Vec<f64> {
        feature.values(&self.problem.layout, &self.unknowns.slots)
    }

    /// Change of a feature with a change of the optimum, in the order of [`feature`](Self::feature).
    pub fn feature_change(&self, feature: Feature, change: &Change) -> Vec<f64> {
        let layout = &self.problem.layout;
        let variables = feature.variables(layout, &self.unknowns.slots);
        let at = |slot: &[Option<usize>], &(variable, by): &(usize, f64)| {
            let step = slot[variable].map_or(0.0, |column| change.unknowns[column]);
            step * layout.scale[variable] * by
        };
        let of = |slot: &Vec<Option<usize>>| -> Vec<f64> {
            variables.iter().map(|variable| at(slot, variable)).collect()
        };
        Columns::new(&self.problem).of_slot.iter().flat_map(of).collect()
    }
}
