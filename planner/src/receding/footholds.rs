//! Footholds of a horizon on terrain: the ground of each contact at each sample.
//!
//! A stance that begins later is planned where the gait puts its middle relative to the body, on the nearest ground on which
//! the end effector can stand. A swing in its second half keeps its foothold, even if the map or the command changes: there is
//! no time to reach another one.

use super::gait::Gait;
use super::schedule::Footfalls;
use crate::motion::{Footing, Patch};
use crate::plan::Placement;
use crate::problem::ContactGround;
use crate::problem::variables::Layout;
use nalgebra::{Rotation2, Vector2, Vector3};
use rollwalk_multibody::{Frames, RimContact, State, Tree};

/// Planned landing of an end effector.
#[derive(Clone, Debug)]
pub(super) struct Landing {
    /// Sample of the landing.
    at: i64,
    /// Planned position of the contact in the middle of the stance, m.
    near: Vector2<f64>,
}

/// Inputs of the assignment of footholds.
pub(super) struct Footholds<'a> {
    pub tree: &'a Tree,
    pub layout: &'a Layout,
    pub gait: &'a Gait,
    pub ground: &'a Footing,
    /// Placements of the body at the samples of the horizon, and one interval later.
    pub path: &'a [Placement],
    /// Index of the first sample. `phase` is its index in the gait.
    pub at: i64,
    pub phase: usize,
    /// Landings of the latest accepted plan.
    pub landings: &'a [Option<Landing>],
}

/// Assigned footholds.
pub(super) struct Assignment {
    /// Ground of all contacts, `[sample][end effector]`.
    pub contacts: Vec<Vec<ContactGround>>,
    /// Landings to come.
    pub landings: Vec<Option<Landing>>,
    /// End effector without a steppable position near its landing.
    pub without_foothold: Option<usize>,
}

/// Distance of the borders beyond a rolling wheel that is too near to an edge at the beginning, m.
const RELAXED_M: f64 = 0.005;

impl Footholds<'_> {
    /// Assigns the ground of all contacts.
    pub fn assign(&self, state: &State, footfalls: &Footfalls) -> Assignment {
        let Footfalls { stance, height_m } = footfalls;
        let count = self.landings.len();
        let mut contacts = vec![Vec::with_capacity(count); stance.len()];
        let frames = Frames::new(self.tree, &state.configuration());
        let (mut landings, mut without_foothold) = (vec![None; count], None);
        for (j, landing) in landings.iter_mut().enumerate() {
            let column: Vec<bool> = stance.iter().map(|row| row[j]).collect();
            let mut from = 0;
            for run in column.chunk_by(|a, b| a == b) {
                let until = from + run.len();
                let ground = match (run[0], from) {
                    (false, _) => {
                        let map = self.ground.contact(j, false, &Vector3::zeros());
                        ContactGround { map, ..ContactGround::default() }
                    }
                    (true, 0) => self.present(j, &frames),
                    (true, _) => {
                        let near = self.near(j, from, until == stance.len(), run.len());
                        if landing.is_none() {
                            *landing = Some(Landing { at: self.at + from as i64, near });
                        }
                        let patch = self.ground.patch(j, &near);
                        if patch.is_none() && self.ground.needs_patch(j) {
                            without_foothold = without_foothold.or(Some(j));
                        }
                        self.next(j, near, patch)
                    }
                };
                contacts[from..until].iter_mut().for_each(|row| row.push(ground.clone()));
                from = until;
            }
            // At both ends of a long swing the foot is on the ground, not on the envelope of swings.
            for i in 1..stance.len() {
                let is_down = |k: usize| column.get(k).copied().unwrap_or(false);
                let beside = [i - 1, i + 1].into_iter().find(|k| is_down(*k));
                if let Some(beside) = beside
                    && !column[i]
                    && height_m[i][j] == 0.0
                {
                    contacts[i][j].map = contacts[beside][j].map.clone();
                }
            }
        }
        Assignment { contacts, landings, without_foothold }
    }

    /// True for an end effector that moves along the ground in stance.
    fn rolls(&self, j: usize) -> bool {
        self.tree.robot().end_effectors[j].contact.rolls() && !self.gait.motion.held_wheels[j]
    }

    /// Ground of an end effector that stands at the beginning.
    fn present(&self, j: usize, frames: &Frames) -> ContactGround {
        let end = &self.tree.robot().end_effectors[j];
        let center = frames.point(end.link, &end.center_in_link_m);
        let map = self.ground.contact(j, true, &center);
        let Some(contact) = RimContact::on(self.tree, frames, j, &map) else {
            return ContactGround { map, ..ContactGround::default() };
        };
        let contact = contact.position();
        if !self.rolls(j) {
            return ContactGround { map, borders: Vec::new(), foothold: Some(contact) };
        }
        let patch = self.ground.patch(j, &center.xy());
        let mut borders = patch.map(|patch| patch.borders).unwrap_or_default();
        for border in &mut borders {
            border.at_m = border.at_m.max(border.outward.dot(&contact.xy()) + RELAXED_M);
        }
        ContactGround { map, borders, foothold: None }
    }

    /// Ground of a stance planned near the position `near`.
    fn next(&self, j: usize, near: Vector2<f64>, patch: Option<Patch>) -> ContactGround {
        let place = patch.as_ref().map_or(near, |patch| patch.nearest(&near)).push(0.0);
        let below = match &patch {
            Some(patch) => patch.plane.clone(),
            None => self.ground.contact(j, true, &place),
        };
        let radius_m = self.tree.robot().end_effectors[j].radius_m;
        let center = place + Vector3::z() * (below.at(&place).height_m + radius_m);
        let map = self.ground.contact(j, true, &center);
        let foothold = (!self.rolls(j)).then(|| place + Vector3::z() * map.at(&place).height_m);
        ContactGround {
            map,
            borders: patch.map(|patch| patch.borders).unwrap_or_default(),
            foothold,
        }
    }

    /// Planned contact position of a stance that starts at sample `from` and lasts `samples` samples, m. A stance that the
    /// horizon cuts counts with at least its number of samples in the gait.
    fn near(&self, j: usize, from: usize, is_cut: bool, samples: usize) -> Vector2<f64> {
        let rows = &self.gait.motion.stance;
        let standing = rows.iter().filter(|row| row[j]).count();
        let swinging = rows.len() - standing;
        let kept = self.landings[j]
            .as_ref()
            .filter(|landing| landing.at == self.at + from as i64 && 2 * from <= swinging);
        if let Some(landing) = kept {
            return landing.near;
        }
        let samples = if is_cut { samples.max(standing) } else { samples };
        let middle = from + samples / 2;
        let cycle = &self.gait.cycle[(self.phase + middle) % self.gait.samples()];
        let first = self.layout.end_effectors[j].position;
        let place = self.place(middle);
        let turned = Rotation2::new(place.yaw_rad) * Vector2::new(cycle[first], cycle[first + 1]);
        turned + Vector2::from(place.offset_m)
    }

    /// Placement of the body at a sample. After the horizon, the body continues at its last velocity.
    fn place(&self, sample: usize) -> Placement {
        let last = self.path.len() - 1;
        if sample <= last {
            return self.path[sample];
        }
        let [before, end] = [self.path[last - 1], self.path[last]];
        let more = (sample - last) as f64;
        let on = |end: f64, before: f64| end + more * (end - before);
        Placement {
            offset_m: [0, 1].map(|k| on(end.offset_m[k], before.offset_m[k])),
            yaw_rad: on(end.yaw_rad, before.yaw_rad),
        }
    }
}
