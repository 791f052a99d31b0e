//! Panels of the robot over the ground: swing heights of its end effectors, and the centre of mass over the support polygon.

use super::axes::Series;
use super::hull::{convex_hull, depth};
use super::panels::{EvaluatedPlan, Panel, distinct};
use crate::plan::{EndEffectorSample, Sample};

/// Height above which an end effector counts as lifted, m.
const LIFTED_M: f64 = 1e-3;

impl EvaluatedPlan<'_> {
    /// Heights of contact points above the ground. `None` for a robot that lifts no end effector.
    pub(super) fn swing_heights(&self) -> Option<Panel> {
        let feet = &self.plan.robot.end_effectors;
        let names = distinct(feet.iter().map(|foot| foot.name.as_str()));
        let series = names.iter().enumerate();
        let ground = &self.plan.motion.ground;
        let above_m = |j: usize| {
            move |foot: &EndEffectorSample| {
                let contact = foot.position_m.into();
                ground.contact(j, foot.contact, &contact).height_above_m(&contact)
            }
        };
        let series: Vec<Series> =
            series.map(|(j, name)| self.foot(name, j, j, above_m(j))).collect();
        let heights = series.iter().flat_map(|curve| &curve.line);
        let lifts = heights.map(|[_, height]| *height).any(|height| height > LIFTED_M);
        lifts.then(|| self.limited("swing height (m)", series, Vec::new(), vec![0.0]))
    }

    /// Distance of the centre of mass from the edge of the support polygon, seen from above, positive inside. The polygon is
    /// the convex hull of the contact points in stance. The distance is negative outside and with fewer than three contacts; in
    /// flight there is no line.
    pub(super) fn support(&self) -> Option<Panel> {
        let played = self.states.iter().map(|(t, state, _)| (*t, inside_m(state)));
        let played: Vec<(f64, Option<f64>)> = played.collect();
        let point = |(t, inside_m): (f64, Option<f64>)| inside_m.map(|inside_m| [t, inside_m]);
        let stretches = played.chunk_by(|(_, one), (_, next)| one.is_some() == next.is_some());
        let lines = stretches.map(|stretch| stretch.iter().copied().filter_map(point).collect());
        let curve = |line: Vec<[f64; 2]>| Series {
            name: String::new(),
            color: 0,
            line,
            dots: Vec::new(),
            dash: "",
        };
        let mut series: Vec<Series> =
            lines.filter(|line: &Vec<_>| !line.is_empty()).map(curve).collect();
        let planned = self.plan.samples.iter().map(|sample| (sample.time_s, inside_m(sample)));
        series.first_mut()?.dots = planned.filter_map(point).collect();
        // The panel covers at least a centimetre, so that smaller changes look small.
        let include = vec![0.0, 0.01];
        let title = "centre of mass inside support (m)";
        Some(self.limited(title, series, Vec::new(), include))
    }
}

/// Distance of the centre of mass from the edge of the support polygon, m. `None` in flight.
fn inside_m(state: &Sample) -> Option<f64> {
    let standing = state.end_effectors.iter().filter(|foot| foot.contact);
    let hull = convex_hull(standing.map(|foot| [foot.position_m[0], foot.position_m[1]]).collect());
    depth(&hull, [state.com_m[0], state.com_m[1]])
}
