//! Warnings of the survey about its guesses.

use super::draft_side::Draft;
use super::guess::{self, EndKind};
use super::joints::has_degrees;
use super::model::{Kind, Urdf};
use super::names::some_names;
use super::notes::Notes;
use super::side::AXES;
use super::stance::Stance;
use super::tree::Graph;
use rollwalk_protocol::config::MAX_CHANNELS;

/// Warns of guesses that a person has to check.
pub(super) fn warn(
    urdf: &Urdf,
    graph: &Graph,
    draft: &Draft,
    stance: &Stance,
    notes: &mut Notes<'_>,
) {
    let mut remarks = Remarks { urdf, draft, notes };
    remarks.axes();
    remarks.limits();
    remarks.locks();
    remarks.wheels(graph);
    remarks.ends(stance);
}

struct Remarks<'a, 'n, 't> {
    urdf: &'a Urdf,
    draft: &'a Draft,
    notes: &'n mut Notes<'t>,
}

impl Remarks<'_, '_, '_> {
    /// Warns about joints, with their names before the text.
    fn joints(&mut self, joints: &[usize], text: &str) {
        let Some(&first) = joints.first() else { return };
        let names: Vec<_> = joints.iter().map(|&joint| &self.urdf.joints[joint].name).collect();
        let names = some_names(names.into_iter());
        self.notes.warn(&self.urdf.joints[first].span, format_args!("joint {names}: {text}"));
    }

    fn axes(&mut self) {
        let heading = self.draft.heading;
        let [forward, up] = [heading.axes.forward, heading.axes.up].map(|axis| AXES[axis]);
        if let Some(because) = heading.because {
            self.notes.warn(&(0..0), format_args!(
                "according to {because}, {forward} of the root link points forward, and {up} points up: check `forward = \"{forward}\"` and `up = \"{up}\"` in the template"
            ));
        }
        if heading.contradicts {
            let other = if forward.ends_with('x') { "+y" } else { "+x" };
            self.notes.warn(&(0..0), format_args!(
                "{forward} of the root link points forward according to the names of limbs, but knees or wheels turn about this axis: check `forward` in the side file; the knees suggest `forward = \"{other}\"`"
            ));
        }
    }

    fn limits(&mut self) {
        let joints: Vec<usize> = self.draft.bodies.moving.iter().map(|m| m.joint).collect();
        let degrees: Vec<usize> = joints
            .into_iter()
            .filter(|&joint| has_degrees(self.urdf, &self.urdf.joints[joint]))
            .collect();
        if let Some(&first) = degrees.first() {
            let limit = self.urdf.joints[first].limit;
            let [lower, upper] = [limit.lower, limit.upper].map(Option::unwrap_or_default);
            let text = format!(
                "limits {lower} to {upper} look like degrees, so the template has {:.3} to {:.3} rad; convert the limits in the URDF to radians",
                lower.to_radians(),
                upper.to_radians()
            );
            self.joints(&degrees, &text);
        }
    }

    fn locks(&mut self) {
        let locked = |is: &dyn Fn(&super::model::Joint) -> bool| -> Vec<usize> {
            let locks = self.draft.locks.iter().map(|(joint, _)| *joint);
            locks.filter(|&joint| is(&self.urdf.joints[joint])).collect()
        };
        let follow = locked(&|joint| joint.mimics.is_some());
        let blank = locked(&|joint| joint.has_blank_limits());
        let stuck = locked(&|joint| {
            let limit = joint.limit;
            let is_stuck = limit.lower.is_some() && limit.lower == limit.upper;
            joint.kind == Kind::Revolute
                && is_stuck
                && !joint.has_blank_limits()
                && joint.mimics.is_none()
        });
        let slide = locked(&|joint| joint.kind == Kind::Prismatic && joint.mimics.is_none());
        let loose = locked(&|joint| {
            matches!(joint.kind, Kind::Planar | Kind::Floating) && joint.mimics.is_none()
        });
        self.joints(&follow, "follows another joint (<mimic>, or <joint> of an equality). The template locks the joint where it is if the other one is at 0, because joints of a robot file move independently: correct its position for the standing pose");
        self.joints(&blank, "all limits are 0, as some exporters write for unknown limits. The template locks the joint. If the joint moves, write its limits into the model, or remove the joint from [lock] and give `position_min_rad` and `position_max_rad`");
        self.joints(&stuck, "both limits are equal, so the template locks the joint; correct the limits in the model if the joint moves");
        self.joints(&slide, "slides and carries no foot or wheel, or has no stroke, so the template locks the joint; to give the joint a motor, remove it from [lock]");
        self.joints(&loose, "has several degrees of freedom, so the template locks the joint");
        let (passive, idle) = (self.draft.passive.clone(), self.draft.idle.clone());
        self.joints(&passive, "has no actuator in the model, so the template locks the joint; to give the joint a motor, remove it from [lock]");
        let text = format!(
            "locked in the template, because the robot has {} channels and a controller at most {MAX_CHANNELS}; choose the joints under [lock]",
            self.draft.channels
        );
        self.joints(&idle, &text);
    }

    fn wheels(&mut self, graph: &Graph) {
        let of_kind = |kind: EndKind, is: &dyn Fn(usize) -> bool| -> Vec<usize> {
            let ends = self.draft.ends.iter().filter(|end| end.kind == kind);
            ends.filter_map(|end| end.axle).filter(|&axle| is(axle)).collect()
        };
        let urdf = self.urdf;
        let motorless = |axle: usize| guess::lacks_motor(urdf, &urdf.joints[axle]);
        let free = of_kind(EndKind::FreeWheel, &motorless);
        self.joints(&free, "the wheel is passive, because the model has no motor (an actuator, or `effort` in <limit>) for it; if the wheel is driven, set `contact = \"actuated_wheel\"` in the side file");
        for axle in self.draft.ends.iter().filter_map(|end| end.axle) {
            let Some(across) = guess::across(urdf, graph, axle) else { continue };
            let (joint, link) = (&urdf.joints[across.joint], &urdf.links[across.link]);
            self.notes.warn(&link.span, format_args!(
                "link `{}`: the cylinder lies across the axis of joint `{}`: turn the cylinder or the axis by 90°. The template takes the radius of the cylinder, {} m",
                link.name, joint.name, across.radius_m
            ));
        }
    }

    fn ends(&mut self, stance: &Stance) {
        for &(missed, above_m) in &stance.missed {
            let link = &self.urdf.links[self.draft.ends[missed].link];
            self.notes.warn(&link.span, format_args!(
                "link `{}` is {:.0} mm above the ground in the proposed pose: set `nominal_rad` of its joints",
                link.name,
                1e3 * above_m
            ));
        }
        if self.draft.ends.is_empty() {
            self.notes.warn(&(0..0), "no part looks like a foot or a wheel, so the template stands the robot on a point below the body; give [[end_effector]] tables");
        }
    }
}
