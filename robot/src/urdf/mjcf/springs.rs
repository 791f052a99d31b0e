//! Springs and dampers of joints: `stiffness`, `springref` and `damping`.

use super::numbers::{Element, Reader};
use crate::document::Span;
use crate::spring::JointSpring;
use crate::urdf::elements::tag;
use crate::urdf::model::Urdf;
use crate::urdf::names::some_names;
use crate::urdf::toml_text::key;
use roxmltree::Node;

/// Springs and dampers that the import changes or omits, with the tags of their joints.
#[derive(Default)]
pub struct Springs {
    /// Joints with a spring and no motor.
    passive: Vec<(String, Span)>,
    /// Joints whose damping is that of their servo.
    of_servos: Vec<(String, Span)>,
    /// Joints with a spring or damper that is not linear.
    bent: Vec<(String, Span)>,
}

/// Motor of a joint.
#[derive(Clone, Copy, PartialEq)]
pub enum Drive {
    /// Joint without an actuator.
    None,
    /// Position servo without a damping gain.
    Undamped,
    /// Other actuator.
    Other,
}

/// True for a position servo without damping, for which models use the damping of the joint.
pub fn is_undamped<'a, 'i>(
    reader: &mut Reader<'_, '_, '_, 'a, 'i>,
    of: Element<'a, 'i>,
    actuator: Node<'a, 'i>,
) -> bool {
    let mut damps = |name| reader.number(of, name).is_some_and(|gain| gain != 0.0);
    let damps = damps("kv") | damps("dampratio");
    let bias = reader.numbers(of, "biasprm", 1, 10).unwrap_or_default();
    let holds = actuator.has_tag_name("position")
        || reader.word(of, "biastype") == Some("affine") && bias.get(1).is_some_and(|k| *k != 0.0);
    holds && !damps && bias.get(2).is_none_or(|k| *k == 0.0)
}

impl Springs {
    /// Reads spring and damper of a hinge, or of a slide in m and N. `reference` is the position of the file at position 0.
    pub fn read<'a, 'i>(
        &mut self,
        reader: &mut Reader<'_, '_, '_, 'a, 'i>,
        of: Element<'a, 'i>,
        name: &str,
        reference: f64,
        drive: Drive,
    ) -> Option<JointSpring> {
        let [stiffness, damping] =
            ["stiffness", "damping"].map(|name| reader.numbers(of, name, 1, 3).unwrap_or_default());
        let linear = |of: &[f64]| of.first().copied().unwrap_or_default().max(0.0);
        if [&stiffness, &damping].iter().any(|of| of.iter().skip(1).any(|k| *k != 0.0)) {
            self.bent.push((name.to_owned(), tag(of.node)));
        }
        let rest = reader.number(of, "springref").unwrap_or_default();
        let mut spring = JointSpring {
            stiffness_nm_rad: linear(&stiffness),
            rest_rad: if reader.word(of, "type") == Some("slide") {
                rest
            } else {
                reader.angle(rest)
            } - reference,
            damping_nm_s_rad: linear(&damping),
        };
        if spring.stiffness_nm_rad == 0.0 {
            spring.rest_rad = 0.0;
        }
        match drive {
            Drive::None if spring.stiffness_nm_rad > 0.0 => {
                self.passive.push((name.to_owned(), tag(of.node)));
            }
            Drive::Undamped if spring.damping_nm_s_rad > 0.0 => {
                self.of_servos.push((name.to_owned(), tag(of.node)));
                spring.damping_nm_s_rad = 0.0;
            }
            _ => {}
        }
        let acts = spring.stiffness_nm_rad > 0.0 || spring.damping_nm_s_rad > 0.0;
        acts.then_some(spring)
    }

    /// Warns of springs and dampers that the import changes. Joints that a crank drives have a motor in `urdf`.
    pub fn warn(&self, reader: &mut Reader<'_, '_, '_, '_, '_>, urdf: &Urdf) {
        let is_passive = |(name, _): &&(String, Span)| {
            urdf.joints.iter().any(|joint| joint.name == *name && !joint.has_motor)
        };
        let passive: Vec<_> = self.passive.iter().filter(is_passive).collect();
        if let Some((name, span)) = passive.first() {
            let names = some_names(passive.iter().map(|(name, _)| name));
            reader.notes.warn(span, format_args!(
                "joint {names}: has a spring and no motor, so only its spring holds it; if a motor turns it, give {} = {{ actuator = \"…\" }} under [joint] of the side file",
                key(name)
            ));
        }
        if let Some((_, span)) = self.of_servos.first() {
            let names = some_names(self.of_servos.iter().map(|(name, _)| name));
            reader.notes.warn(span, format_args!(
                "joint {names}: `damping` is not imported, because the <position> actuator of the joint has no `kv`, so this damping belongs to the servo; give `kd_nm_s_rad` in the side file"
            ));
        }
        if let Some((_, span)) = self.bent.first() {
            let names = some_names(self.bent.iter().map(|(name, _)| name));
            reader.notes.warn(span, format_args!(
                "joint {names}: springs and dampers of robot files are linear, so the import takes the first number of `stiffness` and `damping`"
            ));
        }
    }
}
