//! Panels of the figure in columns, from the motion as played and the planned samples. This file contains the panels of the
//! body and of the ground forces.

use super::axes::BarRow;
use super::axes::{Axis, Series};
pub(super) use super::axes::{Content, Panel};
use super::scale::Scale;
use crate::motion::{Ends, Subject};
use crate::plan::{EndEffectorSample, Plan, Sample};
use crate::sample::{PlanSpline, Setpoints, driven_wheels};
use crate::torque::{Actuation, InverseDynamics};

/// Grouping of the panels of angles, speeds and torques.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum JointPanels {
    /// Limbs: one panel each, so that their joints can be compared.
    #[default]
    Limb,
    /// Joints: one panel each, whose separate axis makes small motions visible.
    Joint,
}

const POINTS: usize = 240;
/// Difference below which two values of a plan are equal, in all units.
const EQUAL: f64 = 1e-3;

/// Plan with its motion evaluated along the time axis.
pub(super) struct EvaluatedPlan<'a> {
    pub(super) plan: &'a Plan,
    pub(super) spline: PlanSpline,
    pub(super) states: Vec<(f64, Sample, Setpoints)>,
    /// Torques at the times of `states`.
    pub(super) actuations: Vec<Actuation>,
}

/// Creates the panels of the figure, column by column.
pub fn columns(plan: &Plan, panels: JointPanels) -> Vec<Vec<Panel>> {
    let spline = PlanSpline::new(plan);
    let duration_s = plan.motion.duration_s;
    let states: Vec<_> = (0..=POINTS)
        .map(|k| {
            let t = duration_s * k as f64 / POINTS as f64;
            // The end of a periodic motion, evaluated inside the period.
            let t = t.min(duration_s * (1.0 - 1e-9));
            (t, spline.sample(t), spline.setpoints(t))
        })
        .collect();
    let mut inverse = InverseDynamics::new(plan);
    let actuations = states.iter().map(|(t, ..)| inverse.at(*t)).collect();
    let played = EvaluatedPlan { plan, spline, states, actuations };
    let body = vec![
        footfalls(plan),
        played.horizontal(),
        played.heights(),
        played.swing_heights(),
        played.support(),
        played.orientation(),
        played.wheels(),
    ];
    let body = body.into_iter().flatten().chain(played.path_panels()).collect();
    let groups = played.groups(panels);
    let [angles, speeds] = [played.angles(&groups), played.speeds(&groups)];
    vec![body, angles, speeds, played.torques(&groups), played.forces()]
        .into_iter()
        .filter(|c: &Vec<Panel>| !c.is_empty())
        .collect()
}

/// Creates the footfall chart. Chosen footfalls are filled, and those of the request are outlined, stretched to the duration
/// of the plan. `None` for a robot without end effectors.
pub fn footfalls(plan: &Plan) -> Option<Panel> {
    let given = plan.solve.timing.as_ref();
    let feet = plan.robot.end_effectors.iter().enumerate();
    let rows: Vec<BarRow> = feet
        .map(|(j, foot)| BarRow {
            name: foot.name.clone(),
            filled: stances(plan, j),
            outlined: given.map_or_else(Vec::new, |of| stance_spans(plan, &of.given_stance, j)),
        })
        .collect();
    let title = given.map_or_else(
        || "footfalls".to_owned(),
        |of| format!("footfalls (outlined: as given, in {:.2} s)", of.given_duration_s),
    );
    (!rows.is_empty()).then(|| Panel {
        title,
        axis: Axis::time(plan.motion.duration_s),
        shaded: Vec::new(),
        moments: Vec::new(),
        content: Content::Bars(rows),
    })
}

/// Time spans in which end effector `j` is in stance, s: half an interval around every stance sample.
fn stances(plan: &Plan, j: usize) -> Vec<[f64; 2]> {
    stance_spans(plan, &plan.motion.stance, j)
}

/// Time spans in which end effector `j` is in stance, s, with contact flags `[sample][end effector]` over the duration of the
/// plan.
fn stance_spans(plan: &Plan, stance: &[Vec<bool>], j: usize) -> Vec<[f64; 2]> {
    let end = plan.motion.duration_s;
    let is_periodic = plan.motion.ends == Ends::Periodic;
    let h = end / (stance.len() - usize::from(!is_periodic)) as f64;
    let mut spans: Vec<[f64; 2]> = Vec::new();
    let mut centers: Vec<(f64, bool)> =
        stance.iter().enumerate().map(|(i, flags)| (i as f64 * h, flags[j])).collect();
    if is_periodic {
        centers.push((end, centers[0].1));
    }
    for (t, _) in centers.into_iter().filter(|(_, stands)| *stands) {
        let (from, to) = ((t - 0.5 * h).max(0.0), (t + 0.5 * h).min(end));
        match spans.last_mut() {
            Some(last) if from - last[1] < 0.25 * h => last[1] = to,
            _ => spans.push([from, to]),
        }
    }
    spans
}

impl EvaluatedPlan<'_> {
    pub(super) fn panel(&self, title: impl Into<String>, series: Vec<Series>) -> Panel {
        self.limited(title, series, Vec::new(), Vec::new())
    }

    pub(super) fn limited(
        &self,
        title: impl Into<String>,
        series: Vec<Series>,
        limits: Vec<(f64, usize)>,
        include: Vec<f64>,
    ) -> Panel {
        let scale = Scale::Linear;
        let (marks, margin) = (Vec::new(), EQUAL);
        let content = Content::Curves { series, limits, include, margin, marks, scale };
        Panel {
            title: title.into(),
            axis: Axis::time(self.plan.motion.duration_s),
            shaded: Vec::new(),
            moments: Vec::new(),
            content,
        }
    }

    /// Curve of a quantity of the samples.
    pub(super) fn series(&self, name: &str, color: usize, of: impl Fn(&Sample) -> f64) -> Series {
        let line = self.states.iter().map(|(t, sample, _)| [*t, of(sample)]).collect();
        let dots = self.plan.samples.iter().map(|s| [s.time_s, of(s)]).collect();
        Series { name: name.to_owned(), color, line, dots, dash: "" }
    }

    pub(super) fn foot(
        &self,
        name: &str,
        color: usize,
        j: usize,
        of: impl Fn(&EndEffectorSample) -> f64,
    ) -> Series {
        self.series(name, color, |s| of(&s.end_effectors[j]))
    }

    fn horizontal(&self) -> Option<Panel> {
        let axis = |name, color, c: usize| self.series(name, color, move |s| s.com_m[c]);
        let asked =
            [self.target_marks(Subject::Com, 0, 0), self.target_marks(Subject::Com, 1, 1)].concat();
        let series = vec![axis("x", 0, 0), axis("y", 1, 1)];
        Some(self.marked("centre of mass (m)", series, asked))
    }

    fn heights(&self) -> Option<Panel> {
        let ground = self.plan.motion.ground.body();
        let above_m = |point: [f64; 3]| ground.height_above_m(&point.into());
        let com = self.series("centre of mass", 0, |s| above_m(s.com_m));
        let base = self.series("base", 1, |s| above_m(s.base_position_m));
        let asked = [self.target_marks(Subject::Com, 2, 0), self.target_marks(Subject::Body, 2, 1)]
            .concat();
        Some(self.marked("height (m)", vec![com, base], asked))
    }

    fn orientation(&self) -> Option<Panel> {
        let names = ["yaw", "pitch", "roll"].into_iter().enumerate();
        let series =
            names.map(|(k, name)| self.series(name, k, move |s| s.base_yaw_pitch_roll_rad[k]));
        let series = series.collect();
        let mut panel = self.marked("base orientation (rad)", series, self.headings(0));
        // A minimum range keeps small rotations small in the panel.
        if let Content::Curves { include, .. } = &mut panel.content {
            include.extend([-0.02, 0.02]);
        }
        Some(panel)
    }

    fn wheels(&self) -> Option<Panel> {
        let robot = &self.plan.robot;
        let names = distinct(driven_wheels(robot).map(|j| robot.end_effectors[j].name.as_str()));
        let intervals = match self.plan.motion.ends {
            Ends::Periodic => self.plan.samples.len(),
            Ends::AtRest | Ends::Prescribed => self.plan.samples.len() - 1,
        };
        let series: Vec<Series> = driven_wheels(robot)
            .enumerate()
            .map(|(k, j)| Series {
                name: names[k].clone(),
                color: k,
                line: self
                    .states
                    .iter()
                    .map(|(t, _, set)| [*t, set.motor_speed_rad_s[k]])
                    .collect(),
                // Planned speeds are those of intervals: their dots are in the middle.
                dots: self.plan.samples[..intervals]
                    .iter()
                    .map(|s| {
                        let middle = s.time_s + 0.5 * self.plan.sample_interval_s;
                        [middle, s.end_effectors[j].motor_speed_rad_s]
                    })
                    .collect(),
                dash: "",
            })
            .collect();
        let fastest = driven_wheels(robot)
            .filter_map(|j| robot.end_effectors[j].contact.actuator())
            .map(|motor| motor.speed_max_rad_s)
            .fold(0.0, f64::max);
        let limits = vec![(fastest, 6), (-fastest, 6)];
        let some = !series.is_empty();
        some.then(|| self.limited("wheel motors (rad/s)", series, limits, Vec::new()))
    }

    /// Creates a panel for each foot with its force and friction cone, shaded in stance.
    fn forces(&self) -> Vec<Panel> {
        let feet = self.plan.robot.end_effectors.iter().enumerate();
        let highest = |e: &EndEffectorSample| e.force_n[2];
        let all = self.plan.samples.iter().flat_map(|s| &s.end_effectors).map(highest);
        // One scale for all feet, to compare their shares of the weight.
        let include = vec![0.0, all.fold(0.0, f64::max)];
        feet.map(|(j, e)| {
            let tangential = |e: &EndEffectorSample| e.force_n[0].hypot(e.force_n[1]);
            let mu = e.friction_coefficient;
            let mut cone = self.foot("friction limit", 6, j, move |e| mu * e.force_n[2]);
            cone.dots.clear();
            cone.dash = "2 3";
            let series = vec![
                self.foot("normal", 0, j, |e| e.force_n[2]),
                self.foot("tangential", 1, j, tangential),
                cone,
            ];
            let title = format!("{} force (N)", e.name);
            let mut panel = self.limited(title, series, Vec::new(), include.clone());
            panel.shaded = stances(self.plan, j);
            panel
        })
        .collect()
    }
}

/// Shortens names for legends: removes the words that all of them have at their start or end.
pub(super) fn distinct<'n>(names: impl Iterator<Item = &'n str>) -> Vec<String> {
    let mut words: Vec<Vec<&str>> = names.map(|name| name.split(['_', '-']).collect()).collect();
    let shared = |words: &[Vec<&str>], pick: fn(&Vec<&str>) -> Option<String>| {
        let first = words.first().and_then(pick);
        words.len() > 1 && words.iter().all(|w| w.len() > 1 && pick(w) == first)
    };
    while shared(&words, |w| w.first().map(|s| (*s).to_owned())) {
        words = words.iter().map(|w| w[1..].to_vec()).collect();
    }
    while shared(&words, |w| w.last().map(|s| (*s).to_owned())) {
        words = words.iter().map(|w| w[..w.len() - 1].to_vec()).collect();
    }
    words.iter().map(|w| w.join(" ")).collect()
}

#[cfg(test)]
mod tests {
    use super::distinct;

    #[test]
    fn legends_leave_out_what_all_names_share() {
        let of = |names: &[&str]| distinct(names.iter().copied());
        assert_eq!(of(&["front_left_hip_roll", "front_left_knee"]), ["hip roll", "knee"]);
        assert_eq!(of(&["fl-wheel", "rr-wheel"]), ["fl", "rr"]);
        assert_eq!(of(&["fl-wheel"]), ["fl wheel"]);
        assert_eq!(of(&["a_b", "a_b_c"]), ["b", "b c"]);
    }
}
