//! Springs of joints, cloth, cables, bolts and handles.

use crate::anchor::Anchor;
use crate::force::{Force, Wrench};
use crate::joint::{Ball, ParallelAxes};
use crate::sensitivity::parameter::{Column, Constant, Parameter, SolvedStep};
use crate::spring::Spring;
use crate::system::System;
use std::fmt::Debug;
use std::marker::PhantomData;

/// Parameter with one common value for several springs of one type.
#[derive(Clone, Debug)]
pub struct Elastic<F> {
    forces: Vec<usize>,
    of: SpringQuantity,
    kind: PhantomData<F>,
}

/// Parameter of a spring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpringQuantity {
    /// Stiffness, N/m; for parallel axes N·m/rad.
    Stiffness,
    /// Damping, N·s/m; for parallel axes N·m·s/rad.
    Damping,
}

/// Spring type: [`Spring`], [`Ball`], [`ParallelAxes`] or [`Anchor`].
pub trait SpringForce: Force + Clone {
    /// Reference to a parameter of the spring. Wrenches are linear in the parameters.
    fn number(&mut self, of: SpringQuantity) -> &mut f64;
}

impl SpringForce for Spring {
    fn number(&mut self, of: SpringQuantity) -> &mut f64 {
        match of {
            SpringQuantity::Stiffness => &mut self.stiffness_n_m,
            SpringQuantity::Damping => &mut self.damping_n_s_m,
        }
    }
}

impl SpringForce for Ball {
    fn number(&mut self, of: SpringQuantity) -> &mut f64 {
        match of {
            SpringQuantity::Stiffness => &mut self.stiffness_n_m,
            SpringQuantity::Damping => &mut self.damping_n_s_m,
        }
    }
}

impl SpringForce for Anchor {
    fn number(&mut self, of: SpringQuantity) -> &mut f64 {
        match of {
            SpringQuantity::Stiffness => &mut self.stiffness_n_m,
            SpringQuantity::Damping => &mut self.damping_n_s_m,
        }
    }
}

impl SpringForce for ParallelAxes {
    fn number(&mut self, of: SpringQuantity) -> &mut f64 {
        match of {
            SpringQuantity::Stiffness => &mut self.stiffness_nm_rad,
            SpringQuantity::Damping => &mut self.damping_nm_s_rad,
        }
    }
}

impl<F: SpringForce> Elastic<F> {
    /// Creates a parameter of springs, given by force index.
    pub fn new(forces: impl IntoIterator<Item = usize>, of: SpringQuantity) -> Self {
        Self { forces: forces.into_iter().collect(), of, kind: PhantomData }
    }
}

impl<F: SpringForce> Parameter for Elastic<F> {
    fn residual(&self, solved: &SolvedStep<'_>, column: &mut Column) {
        for &number in &self.forces {
            let spring: &F = solved.force(number);
            let mut unit = spring.clone();
            for of in [SpringQuantity::Stiffness, SpringQuantity::Damping] {
                *unit.number(of) = f64::from(u8::from(of == self.of));
            }
            let mut wrenches = vec![Wrench::default(); spring.bodies().len()];
            solved.view(number, |view| unit.wrenches(view, &mut wrenches));
            column.add_force(spring.bodies(), &wrenches);
        }
    }
}

impl<F: SpringForce> Constant for Elastic<F> {
    fn value(&self, system: &System) -> f64 {
        let spring = self.forces.first().and_then(|&force| system.force::<F>(force));
        *spring.expect("the force is of its kind").clone().number(self.of)
    }

    fn set(&self, system: &mut System, value: f64) {
        for &force in &self.forces {
            *system.force_mut::<F>(force).expect("the force is of its kind").number(self.of) =
                value;
        }
    }
}
