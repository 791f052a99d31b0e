//! Rules of end effectors: feet, wheels and blades with their materials and drag.

use super::Check;
use super::check::{Bound, LENGTH_MAX_M, show};
use super::joints::SPEEDS_MAX_RAD_S;
use crate::contact::{Contact, RollingDrag};
use crate::model::{EndEffector, SoftMaterial};

/// Largest fraction of a link's mass in the ball of its soft foot. The rest carries the ball.
pub(super) const SOFT_SHARE: f64 = 0.75;

impl Check<'_> {
    pub(super) fn end_effector(&mut self, end_effector: &EndEffector) {
        let robot = self.robot;
        if end_effector.link >= robot.links.len() {
            let help = format!("the robot has links 0 to {}", robot.links.len().saturating_sub(1));
            self.violated("link", format_args!("is link {}", end_effector.link), help);
        }
        self.vector("center_in_link_m", &end_effector.center_in_link_m);
        let mm = "; divide millimetres by 1000";
        let contact = &end_effector.contact;
        let blade_length_m = contact.blade_length_m();
        let largest_m = if blade_length_m.is_some() { LENGTH_MAX_M } else { 1.0 };
        // Corners of boxes are points.
        let zero = if contact.is_body_point() { Bound::AtLeast(0.0) } else { Bound::Above(0.0) };
        self.range("radius_m", end_effector.radius_m, zero, largest_m, "m", mm);
        let friction = end_effector.friction_coefficient;
        self.range("friction_coefficient", friction, Bound::Above(0.0), 2.0, "", "");
        if let Some(axis_in_link) = contact.axis_in_link() {
            self.unit_axis("axis_in_link", axis_in_link);
            if blade_length_m.is_some() && axis_in_link.z.abs() > 0.95 {
                let help = "give the axis across the blade, not the z axis of the link: the blade lies below the link";
                self.violated("axis_in_link", format_args!("is {}", show(axis_in_link)), help);
            }
        }
        if let Some(actuator) = contact.actuator() {
            self.actuator(actuator, SPEEDS_MAX_RAD_S[1]);
        }
        if let Some(blade_length_m) = blade_length_m {
            self.range("blade_length_m", blade_length_m, Bound::Above(0.0), 1.0, "m", mm);
        }
        if let Some(drag) = contact.drag() {
            self.drag(&drag);
        }
        if let Some(soft) = &end_effector.soft {
            self.soft(soft, end_effector);
        }
    }

    fn soft(&mut self, soft: &SoftMaterial, end_effector: &EndEffector) {
        if !matches!(end_effector.contact, Contact::PointFoot | Contact::WeldedWheel { .. }) {
            let help = "leave out `soft`: only feet and welded wheels can be soft";
            self.violated("soft", "is given for a part that cannot be soft", help);
        }
        let softer = "; foam has 1e4 to 1e6, rubber 1e6 to 1e7";
        self.range("young_pa", soft.young_pa, Bound::AtLeast(1e3), 1e9, "Pa", softer);
        self.range("poisson", soft.poisson, Bound::AtLeast(0.0), 0.49, "", "");
        self.range("density_kg_m3", soft.density_kg_m3, Bound::AtLeast(1.0), 5000.0, "kg/m³", "");
        self.range("viscosity_pa_s", soft.viscosity_pa_s, Bound::AtLeast(0.0), 1e5, "Pa·s", "");
        let ball_kg = soft.ball_kg(end_effector.radius_m);
        let link_kg = self.robot.links.get(end_effector.link).map_or(0.0, |link| link.mass_kg);
        if ball_kg > SOFT_SHARE * link_kg {
            let help = format!(
                "reduce the density or the radius: the ball weighs {ball_kg:.3} kg, and may weigh at most 75 % of its link ({link_kg:.3} kg)"
            );
            self.violated("density_kg_m3", format_args!("is {} kg/m³", soft.density_kg_m3), help);
        }
    }

    fn drag(&mut self, drag: &RollingDrag) {
        let zero = Bound::AtLeast(0.0);
        self.range("rolling_resistance", drag.rolling_resistance, zero, 0.5, "", "");
        self.range("rolling_drag_s_m", drag.rolling_drag_s_m, zero, 1.0, "s/m", "");
    }
}
