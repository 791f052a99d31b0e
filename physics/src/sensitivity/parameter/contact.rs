//! Contacts: stiffness and damping, friction, rolling resistance.

use crate::contact::Contact;
use crate::sensitivity::parameter::{Column, Constant, Parameter, Solved};
use crate::system::System;

/// A number of contacts. Where they differ they keep their proportions, as the nodes of a soft surface must.
#[derive(Clone, Debug)]
pub struct Touching {
    contacts: Vec<usize>,
    of: OfContact,
    /// Of each contact, its share of the first one's number.
    shares: Vec<f64>,
}

/// A number of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OfContact {
    /// Stiffness along the normal, N/m.
    Stiffness,
    /// Damping along the normal, N·s/m.
    Damping,
    /// Depth over which the damping comes in, m.
    Ramp,
    /// Coefficient of friction.
    Friction,
    /// Friction over sliding velocity while it sticks, N·s/m.
    Stick,
    /// Rolling resistance at any speed, as a share of the load.
    Resistance,
    /// What is added to it per speed, s/m.
    ResistancePerSpeed,
}

impl OfContact {
    fn place(self, contact: &mut Contact) -> &mut f64 {
        match self {
            Self::Stiffness => &mut contact.normal.stiffness_n_m,
            Self::Damping => &mut contact.normal.damping_n_s_m,
            Self::Ramp => &mut contact.normal.ramp_m,
            Self::Friction => &mut contact.friction.coefficient,
            Self::Stick => &mut contact.friction.stick_n_s_m,
            Self::Resistance => &mut contact.resistance.constant,
            Self::ResistancePerSpeed => &mut contact.resistance.per_speed_s_m,
        }
    }
}

impl Touching {
    /// Of forces of a system that are contacts; the value is that of the first.
    ///
    /// # Panics
    /// One is not, or there is none.
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
