//! Marks of targets and height limits in the panels: a cross at a time, or a bar over a time span.

use super::axes::{Mark, Series};
use super::panels::{Content, EvaluatedPlan, Panel};
use crate::motion::Subject;

impl EvaluatedPlan<'_> {
    /// Returns marks of a subject's target positions and height limits along one axis.
    pub(super) fn target_marks(&self, of: Subject, axis: usize, color: usize) -> Vec<Mark> {
        let asked = self.plan.motion.targets.iter().filter(|target| target.of == of);
        let mut marks: Vec<Mark> = asked
            .filter_map(|target| {
                let value = target.position_m[axis]?;
                Some(Mark { from: target.at_s, to: target.at_s, value, color })
            })
            .collect();
        let limits = self.plan.motion.heights.iter().filter(|limit| axis == 2 && limit.of == of);
        for limit in limits {
            for value in [limit.above_m, limit.below_m].into_iter().flatten() {
                marks.push(Mark { from: limit.from_s, to: limit.to_s, value, color });
            }
        }
        marks
    }

    /// Returns marks of the body's target headings.
    pub(super) fn headings(&self, color: usize) -> Vec<Mark> {
        let asked = self.plan.motion.targets.iter();
        asked
            .filter_map(|target| {
                let value = target.heading_rad?;
                Some(Mark { from: target.at_s, to: target.at_s, value, color })
            })
            .collect()
    }

    /// Creates panels with the paths of the subjects that have target positions, except the centre of mass.
    pub(super) fn path_panels(&self) -> Vec<Panel> {
        let feet = self.plan.robot.end_effectors.iter().enumerate();
        let feet = feet.map(|(j, foot)| (Subject::EndEffector(j), foot.name.as_str()));
        std::iter::once((Subject::Body, "base"))
            .chain(feet)
            .filter_map(|(of, name)| {
                // The height of the base has a panel already.
                let axes = if of == Subject::Body { 0..2 } else { 0..3 };
                let marks: Vec<Vec<Mark>> =
                    axes.clone().map(|axis| self.target_marks(of, axis, axis)).collect();
                let asked = |axis: &usize| !marks[*axis].is_empty();
                let series: Vec<Series> = axes
                    .filter(asked)
                    .map(|axis| {
                        self.series(["x", "y", "z"][axis], axis, move |sample| match of {
                            Subject::EndEffector(j) => sample.end_effectors[j].position_m[axis],
                            Subject::Body | Subject::Com => sample.base_position_m[axis],
                        })
                    })
                    .collect();
                let some = !series.is_empty();
                some.then(|| self.marked(format!("{name} (m)"), series, marks.concat()))
            })
            .collect()
    }

    /// Creates a panel with marks.
    pub(super) fn marked(
        &self,
        title: impl Into<String>,
        series: Vec<Series>,
        asked: Vec<Mark>,
    ) -> Panel {
        let mut panel = self.panel(title, series);
        if let Content::Curves { marks, .. } = &mut panel.content {
            *marks = asked;
        }
        panel
    }
}
