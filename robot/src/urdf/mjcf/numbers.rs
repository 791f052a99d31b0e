//! Attributes of elements as words, numbers and poses, with the defaults of their class.

use super::model::Model;
use crate::document::alternatives;
use crate::urdf::elements::{NUMBERS_MAX, tag};
use crate::urdf::notes::Notes;
use nalgebra::{
    Isometry3, Matrix3, Quaternion, Rotation3, Translation3, Unit, UnitQuaternion, Vector3,
};
use roxmltree::Node;

/// Element with the class of the bodies around it.
#[derive(Clone, Copy)]
pub struct Element<'a, 'i> {
    pub node: Node<'a, 'i>,
    pub class: Option<&'a str>,
}

/// Reader of attributes, which notes faults.
pub struct Reader<'r, 'n, 't, 'a, 'i> {
    pub notes: &'n mut Notes<'t>,
    pub model: &'r Model<'a, 'i>,
}

/// Name of an element in messages: its tag, and its name or that of the body around it.
pub fn called(node: Node<'_, '_>) -> String {
    let kind = node.tag_name().name();
    match node.attribute("name") {
        Some(name) => format!("{kind} `{name}`"),
        None => match node.ancestors().skip(1).find_map(|up| up.attribute("name")) {
            Some(owner) => format!("<{kind}> in `{owner}`"),
            None => format!("<{kind}>"),
        },
    }
}

impl<'a, 'i> Reader<'_, '_, '_, 'a, 'i> {
    pub fn fault(&mut self, node: Node<'_, '_>, message: impl Into<String>, help: &str) {
        self.notes.fault(tag(node), message, "here", help);
    }

    pub fn word(&self, of: Element<'a, 'i>, name: &str) -> Option<&'a str> {
        self.model.attribute(of.node, of.class, name).map(|attribute| attribute.value())
    }

    /// Notes a fault if the class does not exist.
    pub fn check_class(&mut self, node: Node<'a, 'i>, attribute: &str) {
        let Some(class) = node.attribute(attribute) else { return };
        if !self.notes.is_full() && !self.model.has_class(class) {
            let help = alternatives(class, self.model.classes());
            self.fault(node, format!("{}: class `{class}` does not exist", called(node)), &help);
        }
    }

    /// Finite numbers of an attribute. Notes a fault unless there are `least` to `most`.
    pub fn numbers(
        &mut self,
        of: Element<'a, 'i>,
        name: &str,
        least: usize,
        most: usize,
    ) -> Option<Vec<f64>> {
        let attribute = self.model.attribute(of.node, of.class, name)?;
        if self.notes.is_full() {
            return None;
        }
        let finite = |word: &str| word.parse().ok().filter(|number: &f64| number.is_finite());
        let written = attribute.value();
        let words = written.split_whitespace().take(most + 1);
        let parsed: Option<Vec<f64>> =
            (written.len() <= NUMBERS_MAX).then(|| words.map(finite).collect()).flatten();
        let numbers = parsed.filter(|numbers| (least..=most).contains(&numbers.len()));
        if numbers.is_none() {
            let wanted = match (least, most) {
                (1, 1) => "one finite number".to_owned(),
                _ if least == most => format!("{least} finite numbers"),
                _ => format!("{least} to {most} finite numbers"),
            };
            let shown: String = written.chars().take(60).collect();
            let message = format!("{}: `{name}` is \"{shown}\"", called(of.node));
            let help =
                if most == 1 { wanted.clone() } else { format!("{wanted}, separated by blanks") };
            self.notes.fault(attribute.range_value(), message, format!("not {wanted}"), help);
        }
        numbers
    }

    pub fn fixed<const N: usize>(&mut self, of: Element<'a, 'i>, name: &str) -> Option<[f64; N]> {
        self.numbers(of, name, N, N)?.try_into().ok()
    }

    pub fn vector(&mut self, of: Element<'a, 'i>, name: &str) -> Option<Vector3<f64>> {
        self.fixed(of, name).map(Vector3::from)
    }

    pub fn number(&mut self, of: Element<'a, 'i>, name: &str) -> Option<f64> {
        self.fixed(of, name).map(|[number]| number)
    }

    /// Converts an angle of the file to rad.
    pub fn angle(&self, written: f64) -> f64 {
        if self.model.degrees { written.to_radians() } else { written }
    }

    /// Limits of `name`; `None` if attribute `limited` or the settings of the model disable them.
    pub fn range(&mut self, of: Element<'a, 'i>, name: &str, limited: &str) -> Option<[f64; 2]> {
        let range = self.fixed::<2>(of, name)?;
        let holds = match self.word(of, limited) {
            Some("true") => true,
            Some("false") => false,
            _ => self.model.autolimits && range != [0.0; 2],
        };
        holds.then_some(range)
    }

    /// Pose of an element in the frame of its parent element.
    pub fn pose(&mut self, of: Element<'a, 'i>) -> Isometry3<f64> {
        let at = self.vector(of, "pos").unwrap_or_default();
        Isometry3::from_parts(Translation3::from(at), self.orientation(of))
    }

    fn orientation(&mut self, of: Element<'a, 'i>) -> UnitQuaternion<f64> {
        let turned = if let Some([w, x, y, z]) = self.fixed::<4>(of, "quat") {
            Unit::try_new(Quaternion::new(w, x, y, z), 1e-9)
        } else if let Some([x, y, z, angle]) = self.fixed::<4>(of, "axisangle") {
            Unit::try_new(Vector3::new(x, y, z), 1e-9)
                .map(|axis| UnitQuaternion::from_axis_angle(&axis, self.angle(angle)))
        } else if let Some([x, y, z, u, v, w]) = self.fixed::<6>(of, "xyaxes") {
            from_axes(Vector3::new(x, y, z), Vector3::new(u, v, w))
        } else if let Some(z) = self.vector(of, "zaxis") {
            Unit::try_new(z, 1e-9).map(|z| along(&z))
        } else if let Some(angles) = self.vector(of, "euler") {
            self.euler(angles.map(|angle| self.angle(angle)))
        } else {
            Some(UnitQuaternion::identity())
        };
        if turned.is_none() {
            let message = format!("{}: its orientation is not a rotation", called(of.node));
            self.fault(
                of.node,
                message,
                "give a quaternion or axes of a length above 0, and axes that are not parallel",
            );
        }
        turned.unwrap_or_default()
    }

    fn euler(&self, angles_rad: Vector3<f64>) -> Option<UnitQuaternion<f64>> {
        let mut turned = UnitQuaternion::identity();
        for (letter, angle) in self.model.euler.chars().zip(angles_rad.iter()) {
            let axis = match letter.to_ascii_lowercase() {
                'x' => Vector3::x_axis(),
                'y' => Vector3::y_axis(),
                'z' => Vector3::z_axis(),
                _ => return None,
            };
            let turn = UnitQuaternion::from_axis_angle(&axis, *angle);
            turned = if letter.is_ascii_lowercase() { turned * turn } else { turn * turned };
        }
        Some(turned)
    }
}

/// Shortest rotation from z to an axis.
pub fn along(axis: &Unit<Vector3<f64>>) -> UnitQuaternion<f64> {
    let opposite = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    UnitQuaternion::rotation_between_axis(&Vector3::z_axis(), axis).unwrap_or(opposite)
}

/// Rotation whose first axis is along `x` and whose second is in the plane of `x` and `y`.
fn from_axes(x: Vector3<f64>, y: Vector3<f64>) -> Option<UnitQuaternion<f64>> {
    let x = Unit::try_new(x, 1e-9)?;
    let y = Unit::try_new(y - x.into_inner() * x.dot(&y), 1e-9)?;
    let axes = Matrix3::from_columns(&[*x, *y, x.cross(&y)]);
    Some(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)))
}
