//! Net displacement between two visits of SAFE, transitions included: the distance that a robot covers with a motion.

use rollwalk_physics::world::NetDisplacement;
use rollwalk_sim_host::ground::Travel;
use rollwalk_terminal::output::{Table, fixed};
use serde::Serialize;

/// Motions between two visits of SAFE.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Excursion {
    /// Names of the motions in the order of playing, without transitions.
    pub motions: Vec<String>,
    /// Net displacement.
    #[serde(flatten)]
    pub way: NetDisplacement,
}

impl Excursion {
    /// Names of the motions, connected by arrows.
    pub fn name(&self) -> String {
        self.motions.join(" → ")
    }
}

/// Collects the travels of a robot since it left SAFE.
#[derive(Debug, Default)]
pub struct Excursions(Option<Excursion>);

impl Excursions {
    /// Adds a motion with its name, or a transition, which has none. Nothing is collected before the first visit of SAFE.
    pub fn add(&mut self, motion: Option<&str>, way: &NetDisplacement) {
        let Some(open) = &mut self.0 else { return };
        open.way = open.way.then(way);
        open.motions.extend(motion.map(str::to_owned));
    }

    /// Ends an excursion, because the robot is in SAFE. Returns `None` if it has played nothing else since the previous visit.
    pub fn return_to_safe(&mut self) -> Option<Excursion> {
        self.0.replace(Excursion::default()).filter(|done| !done.motions.is_empty())
    }
}

/// Excursions of a tour through a library with these motions, of which `safe` is the index of SAFE.
pub fn of_tour(travels: &[Travel], motions: &[&str], safe: usize) -> Vec<Excursion> {
    let mut open = Excursions::default();
    let ended = travels.iter().filter_map(|travel| {
        let clip = travel.clip().map(|clip| usize::from(clip.0));
        if clip == Some(safe) {
            return open.return_to_safe();
        }
        open.add(clip.and_then(|clip| motions.get(clip).copied()), &travel.displacement());
        None
    });
    ended.collect()
}

/// Formats one row for each excursion.
pub fn table(excursions: &[Excursion]) -> String {
    let mut rows = Table::new(["from SAFE to SAFE", "ahead", "left", "turned"]);
    rows.row(["", "m", "m", "rad"].map(str::to_owned));
    for excursion in excursions {
        let [ahead, left, turned] = excursion.way.values().map(fixed::<3>);
        rows.row([excursion.name(), ahead, left, turned]);
    }
    rows.render()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn an_excursion_is_the_way_from_safe_to_safe() {
        let mut of = Excursions::default();
        let ahead = |forward_m| NetDisplacement { forward_m, ..NetDisplacement::default() };
        // Before the first visit, the start is unknown.
        of.add(Some("walk"), &ahead(1.0));
        assert_eq!(of.return_to_safe(), None);
        of.add(None, &ahead(0.1));
        of.add(Some("turn"), &NetDisplacement { turn_rad: FRAC_PI_2, ..ahead(0.0) });
        of.add(None, &ahead(-0.2));
        let done = of.return_to_safe().unwrap();
        assert_eq!(done.name(), "turn");
        for (value, expected) in done.way.values().into_iter().zip([0.1, -0.2, FRAC_PI_2]) {
            assert!((value - expected).abs() < 1e-12, "{done:?}");
        }
        assert_eq!(of.return_to_safe(), None);
    }
}
