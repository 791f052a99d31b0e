//! Assignment of footholds to the patches of a terrain, and the ground at each contact of the timeline.
//!
//! A stance keeps its patch during a solve, because a foothold on the wrong side of a wall would never cross it. The patch is the
//! one nearest to the foothold of a robot that moves to the goal at constant velocity.

use super::Problem;
use super::contact_ground::ContactGround;
use nalgebra::{Rotation2, Vector2, Vector3};
use rollwalk_multibody::parts::parts;

/// Distance between points of a limb that must keep clear of edges, m.
const LIMB_SPACING_M: f64 = 0.03;

impl Problem {
    /// Sets the points that must keep clear of the ground, and the parts that must keep clear of obstacles.
    pub(super) fn assign_clearance(&mut self) {
        self.clearance_points = self.model.clearance().points().to_vec();
        if self.ground.has_edges() {
            self.clearance_points.extend(self.model.clearance().points_between(LIMB_SPACING_M));
        }
        self.obstacles = self.obstacles_in_reach();
        if !self.obstacles.is_empty() {
            self.obstacle_parts = parts(self.model.robot());
        }
    }

    /// Sets the ground at all contacts, and the points and parts that must keep clear of ground and obstacles.
    pub(crate) fn assign_footholds(&mut self) {
        self.assign_clearance();
        let count = self.layout.end_effectors.len();
        if self.ground.terrain().is_none() {
            let ground = ContactGround { map: self.ground.body().clone(), ..Default::default() };
            self.contacts = vec![vec![ground; count]; self.timeline.len()];
            return;
        }
        let nominal = self.nominal_contacts();
        let mut contacts = vec![Vec::with_capacity(count); self.timeline.len()];
        for j in 0..count {
            let flags: Vec<bool> = self.stance.iter().map(|flags| flags[j]).collect();
            for (t, stands) in flags.iter().enumerate() {
                let foothold = stands.then(|| {
                    let at = |t: usize| flags.get(t).copied().unwrap_or(false);
                    let from = (0..=t).rev().take_while(|t| at(*t)).last().unwrap_or(t);
                    let until = (t..flags.len()).take_while(|t| at(*t)).last().unwrap_or(t);
                    self.middle_of_stance(&nominal[j], from, until)
                });
                contacts[t].push(self.contact_ground(j, foothold));
            }
        }
        self.contacts = contacts;
    }

    /// Contact points of the standing robot with its body at the origin, m.
    fn nominal_contacts(&self) -> Vec<Vector2<f64>> {
        let pose = self.model.pose_values(&self.posture_q[0]);
        pose.end_effectors.iter().map(|mount| mount.center.xy()).collect()
    }

    /// Position of a nominal contact when the body is half-way through a stance. Stances at the ends of a motion at rest begin
    /// and end with the motion.
    fn middle_of_stance(&self, nominal: &Vector2<f64>, from: usize, until: usize) -> Vector2<f64> {
        let first_and_last = [1, self.samples];
        let middle = match (self.at_rest, from <= first_and_last[0], until >= first_and_last[1]) {
            (true, true, _) => first_and_last[0] as f64,
            (true, false, true) => first_and_last[1] as f64,
            _ => 0.5 * (from + until) as f64,
        };
        let placement = self.goal_placement();
        let share = (middle - 1.0) / (self.last() - 1) as f64;
        let turned = Rotation2::new(share * placement.yaw_rad) * nominal;
        turned + Vector2::from(placement.offset_m) * share
    }

    fn contact_ground(&self, j: usize, foothold: Option<Vector2<f64>>) -> ContactGround {
        let patch =
            foothold.and_then(|near| self.ground.patch(j, &near).map(|patch| (near, patch)));
        match patch {
            Some((near, patch)) => {
                let place = patch.nearest(&near).push(0.0);
                let height_m = patch.plane.at(&place).height_m;
                ContactGround {
                    map: patch.plane.clone(),
                    borders: patch.borders.clone(),
                    foothold: Some(place + Vector3::z() * height_m),
                }
            }
            None => {
                let map = self.ground.contact(j, foothold.is_some(), &Vector3::zeros());
                ContactGround { map, ..ContactGround::default() }
            }
        }
    }
}
