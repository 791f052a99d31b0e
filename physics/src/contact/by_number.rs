//! Parameters of a contact, and derivatives of its wrench with respect to each.

use super::contact_point::{Tip, across};
use super::{GroundContact, RESISTANCE_SPEED_M_S};
use crate::force::{View, Wrench};
use nalgebra::Vector3;
use rollwalk_multibody::ground::Surface;

/// Parameter of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContactQuantity {
    /// Stiffness along the normal, N/m.
    Stiffness,
    /// Damping along the normal, N·s/m.
    Damping,
    /// Depth over which the damping rises to its full value, m.
    Ramp,
    /// Coefficient of friction.
    Friction,
    /// Ratio of friction to sliding velocity of a sticking contact, N·s/m.
    Stick,
    /// Speed-independent rolling resistance, as a fraction of the load.
    Resistance,
    /// Increase of the rolling resistance per speed, s/m.
    ResistancePerSpeed,
}

impl ContactQuantity {
    /// Reference to the parameter in a contact.
    pub(crate) fn value_mut(self, contact: &mut GroundContact) -> &mut f64 {
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

impl GroundContact {
    /// Derivative of the wrench with respect to a parameter; `None` if the contact is open.
    pub(crate) fn wrench_by(&self, number: ContactQuantity, view: &View<'_>) -> Option<Wrench> {
        let body = &view.now[0];
        let place = self.contact_point(body);
        let Surface { gap_m, normal, .. } = place.surface;
        if gap_m >= 0.0 {
            return None;
        }
        let velocity = body.velocity + body.spin.cross(&place.arm);
        let opening = normal.dot(&velocity);
        let press = self.normal.press(gap_m, opening);
        let spring = press.spring_n;
        let mut sliding = velocity - normal * opening;
        // Directions, and the derivative of the resistance along a blade or about a rim with respect to its share of the load.
        let (mut ahead, mut axis, mut speed) = (Vector3::zeros(), Vector3::zeros(), 0.0);
        match (self.tip, place.axis) {
            (Tip::Blade { .. }, Some(of_blade)) => {
                let (across, _, _) = across(&of_blade, &normal);
                sliding = across * across.dot(&velocity);
                ahead = across.cross(&normal);
                speed = ahead.dot(&velocity);
            }
            (Tip::Rim { .. }, Some(of_rim)) => {
                axis = of_rim;
                speed = self.radius_m * axis.dot(&body.spin);
            }
            _ => {}
        }
        let friction = self.friction.held_force(view.held.as_ref(), &sliding, spring);
        let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
        let mut resist = |by: f64| {
            force = ahead * -by;
            moment = axis * -(self.radius_m * by);
        };
        let [by_stiffness, by_damping, by_ramp] = self.normal.press_by(gap_m, opening);
        match number {
            ContactQuantity::Stiffness => {
                resist(-gap_m * self.resistance(speed).0);
                force += normal * by_stiffness - friction.by_normal * gap_m;
            }
            ContactQuantity::Damping => force = normal * by_damping,
            ContactQuantity::Ramp => force = normal * by_ramp,
            ContactQuantity::Friction => force = friction.by_coefficient,
            ContactQuantity::Stick => force = friction.by_stick,
            ContactQuantity::Resistance => resist(spring * (speed / RESISTANCE_SPEED_M_S).tanh()),
            ContactQuantity::ResistancePerSpeed => resist(spring * speed),
        }
        Some(Wrench { force, moment: moment + place.arm.cross(&force) })
    }
}
