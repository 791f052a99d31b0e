//! Parameters of contacts: stiffness and damping, friction, rolling resistance.

use crate::contact::{Contact, OfContact};
use crate::sensitivity::parameter::{Column, Constant, Parameter, Solved};
use crate::system::System;

/// Parameter of several contacts. Unequal contacts keep their proportions, as the nodes of a soft surface require.
#[derive(Clone, Debug)]
pub struct Touching {
    contacts: Vec<usize>,
    of: OfContact,
    /// Ratio of each contact's value to that of the first contact.
    shares: Vec<f64>,
}

impl Touching {
    /// Creates a parameter of contacts, given by force index. The value of the parameter is that of the first contact.
    ///
    /// # Panics
    /// If a force is not a contact, or the list is empty.
    pub fn new(system: &System, contacts: impl IntoIterator<Item = usize>, of: OfContact) -> Self {
        let contacts: Vec<usize> = contacts.into_iter().collect();
        let number = |contact: usize| {
            let contact = system.force::<Contact>(contact).expect("the force is a contact");
            *of.place(&mut contact.clone())
        };
        let first = number(contacts[0]);
        let share = |&contact: &usize| if first == 0.0 { 1.0 } else { number(contact) / first };
        Self { shares: contacts.iter().map(share).collect(), of, contacts }
    }
}

impl Parameter for Touching {
    fn residual(&self, solved: &Solved<'_>, column: &mut Column) {
        for (&number, &share) in self.contacts.iter().zip(&self.shares) {
            let contact: &Contact = solved.force(number);
            let wrench = solved.view(number, |view| contact.wrench_by(self.of, view));
            if let Some(mut wrench) = wrench {
                wrench.force *= share;
                wrench.moment *= share;
                column.add_force(&contact.body, &[wrench]);
            }
        }
    }
}

impl Constant for Touching {
    fn value(&self, system: &System) -> f64 {
        let contact = system.force::<Contact>(self.contacts[0]).expect("the force is a contact");
        *self.of.place(&mut contact.clone())
    }

    fn set(&self, system: &mut System, value: f64) {
        for (&number, share) in self.contacts.iter().zip(&self.shares) {
            let contact = system.force_mut::<Contact>(number).expect("the force is a contact");
            *self.of.place(contact) = value * share;
        }
    }
}
