//! Parameters of contacts: stiffness and damping, friction, rolling resistance.

use crate::contact::{ContactQuantity, GroundContact};
use crate::sensitivity::parameter::{Column, Constant, Parameter, SolvedStep};
use crate::system::System;

/// Parameter of several contacts. Unequal contacts keep their proportions, as the nodes of a soft surface require.
#[derive(Clone, Debug)]
pub struct ContactParameter {
    contacts: Vec<usize>,
    of: ContactQuantity,
    /// Ratio of each contact's value to that of the first contact.
    shares: Vec<f64>,
}

impl ContactParameter {
    /// Creates a parameter of contacts, given by force index. The value of the parameter is that of the first contact.
    ///
    /// # Panics
    /// If a force is not a contact, or the list is empty.
    pub fn new(
        system: &System,
        contacts: impl IntoIterator<Item = usize>,
        of: ContactQuantity,
    ) -> Self {
        let contacts: Vec<usize> = contacts.into_iter().collect();
        let number = |contact: usize| {
            let contact = system.force::<GroundContact>(contact).expect("the force is a contact");
            *of.value_mut(&mut contact.clone())
        };
        let first = number(contacts[0]);
        let share = |&contact: &usize| if first == 0.0 { 1.0 } else { number(contact) / first };
        Self { shares: contacts.iter().map(share).collect(), of, contacts }
    }
}

impl Parameter for ContactParameter {
    fn residual(&self, solved: &SolvedStep<'_>, column: &mut Column) {
        for (&number, &share) in self.contacts.iter().zip(&self.shares) {
            let contact: &GroundContact = solved.force(number);
            let wrench = solved.view(number, |view| contact.wrench_by(self.of, view));
            if let Some(mut wrench) = wrench {
                wrench.force *= share;
                wrench.moment *= share;
                column.add_force(&contact.body, &[wrench]);
            }
        }
    }
}

impl Constant for ContactParameter {
    fn value(&self, system: &System) -> f64 {
        let contact =
            system.force::<GroundContact>(self.contacts[0]).expect("the force is a contact");
        *self.of.value_mut(&mut contact.clone())
    }

    fn set(&self, system: &mut System, value: f64) {
        for (&number, share) in self.contacts.iter().zip(&self.shares) {
            let contact =
                system.force_mut::<GroundContact>(number).expect("the force is a contact");
            *self.of.value_mut(contact) = value * share;
        }
    }
}
