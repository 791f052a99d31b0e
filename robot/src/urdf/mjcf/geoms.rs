//! `<geom>`: a solid of a link, and its mass if the model has none. `<inertial>`.

use super::numbers::{Element, Reader, along, called};
use crate::file::parts::MassProperties;
use crate::rules::LENGTH_MAX_M;
use crate::urdf::model::{Shape, Solid};
use nalgebra::{Isometry3, Matrix3, SymmetricEigen, Translation3, Unit, Vector3};
use std::f64::consts::PI;

/// Default density of a geom, kg/m³.
const DENSITY_KG_M3: f64 = 1000.0;

/// Solid with its mass.
pub struct Geom {
    pub shape: Shape,
    /// Mass, centre and inertia in link axes; `None` for a mesh.
    pub mass: Option<MassProperties>,
}

/// Form of a geom, with half lengths along its axes, m.
enum Form {
    Sphere(f64),
    Capsule { radius_m: f64, half_m: f64 },
    Cylinder { radius_m: f64, half_m: f64 },
    Ellipsoid(Vector3<f64>),
    Box(Vector3<f64>),
    Mesh,
}

impl<'a, 'i> Reader<'_, '_, '_, 'a, 'i> {
    /// Reads a solid of a link; `None` for planes, height fields and impossible sizes.
    pub fn geom(&mut self, of: Element<'a, 'i>, link_from_here: &Isometry3<f64>) -> Option<Geom> {
        let kind = self.word(of, "type").unwrap_or("sphere");
        // MuJoCo replaces a geom with a mesh by a fitted simple form.
        let kind = if self.word(of, "mesh").is_some() { "mesh" } else { kind };
        let mut size = self.numbers(of, "size", 1, 3).unwrap_or_default();
        let mut pose = self.pose(of);
        if let Some([a, b, c, d, e, f]) = self.fixed::<6>(of, "fromto") {
            let (from, to) = (Vector3::new(a, b, c), Vector3::new(d, e, f));
            let axis = Unit::try_new(to - from, 1e-9)?;
            pose = Isometry3::from_parts(Translation3::from((from + to) / 2.0), along(&axis));
            let half_m = (to - from).norm() / 2.0;
            let first = *size.first()?;
            size = match kind {
                "box" | "ellipsoid" => vec![first, size.get(1).copied().unwrap_or(first), half_m],
                _ => vec![first, half_m],
            };
        }
        let three = || <[f64; 3]>::try_from(&size[..]).ok().map(Vector3::from);
        let two = || Some((*size.first()?, *size.get(1)?));
        let form = match kind {
            "sphere" => Form::Sphere(*size.first()?),
            "capsule" => two().map(|(radius_m, half_m)| Form::Capsule { radius_m, half_m })?,
            "cylinder" => two().map(|(radius_m, half_m)| Form::Cylinder { radius_m, half_m })?,
            "ellipsoid" => Form::Ellipsoid(three()?),
            "box" => Form::Box(three()?),
            "mesh" => Form::Mesh,
            _ => return None,
        };
        let is_length = |length: &f64| *length > 0.0 && *length <= LENGTH_MAX_M;
        if !matches!(form, Form::Mesh) && !size.iter().all(is_length) {
            return None;
        }
        let mut flag = |name: &str| self.number(of, name).unwrap_or(1.0) != 0.0;
        let collision = flag("contype") | flag("conaffinity");
        let link_from_shape = link_from_here * pose;
        let solid = match form {
            Form::Sphere(radius_m) => Solid::Sphere { radius_m },
            // The shape of a cylinder is a capsule with the same ends.
            Form::Capsule { radius_m, half_m } => {
                Solid::Cylinder { radius_m, length_m: 2.0 * (half_m + radius_m) }
            }
            Form::Cylinder { radius_m, half_m } => {
                Solid::Cylinder { radius_m, length_m: 2.0 * half_m }
            }
            Form::Ellipsoid(half_m) | Form::Box(half_m) => Solid::Box { size_m: half_m * 2.0 },
            Form::Mesh => Solid::Mesh,
        };
        let mass = self.mass(of, &form).map(|(mass_kg, moments)| {
            let turn = link_from_shape.rotation.to_rotation_matrix();
            let inertia = Matrix3::from_diagonal(&moments);
            let inertia_kg_m2 = turn.matrix() * inertia * turn.matrix().transpose();
            MassProperties { mass_kg, com_m: link_from_shape.translation.vector, inertia_kg_m2 }
        });
        Some(Geom { shape: Shape { link_from_shape, solid, collision }, mass })
    }

    /// Mass, kg, and moments of inertia about the centre, kg·m², of a geom whose group counts.
    fn mass(&mut self, of: Element<'a, 'i>, form: &Form) -> Option<(f64, Vector3<f64>)> {
        let group = self.number(of, "group").unwrap_or_default();
        let [first, last] = self.model.groups;
        if !(first..=last).contains(&group) {
            return None;
        }
        let (volume_m3, per_kg) = form.volume_and_moments()?;
        let density = self.number(of, "density").unwrap_or(DENSITY_KG_M3);
        let mass_kg = self.number(of, "mass").unwrap_or(density * volume_m3);
        (mass_kg > 0.0).then(|| (mass_kg, per_kg * mass_kg))
    }

    /// Refuses geoms with the mass in their surface.
    pub fn check_shell(&mut self, of: Element<'a, 'i>) {
        if self.word(of, "shellinertia") == Some("true") {
            let message = format!("{}: `shellinertia` is not read", called(of.node));
            let help = "write an <inertial> into the body, with mass and inertia from MuJoCo";
            self.fault(of.node, message, help);
        }
    }

    /// Adjusts a body's mass and inertia like MuJoCo, by the settings of the model.
    pub fn settled(&self, mut mass: MassProperties) -> MassProperties {
        let [least_kg, least_kg_m2] = self.model.bounds;
        mass.mass_kg = mass.mass_kg.max(least_kg);
        let SymmetricEigen { eigenvalues, eigenvectors: axes } =
            mass.inertia_kg_m2.symmetric_eigen();
        let mut moments = eigenvalues.map(|moment| moment.max(least_kg_m2));
        // Moments of a thin disc are physical except for rounding.
        if self.model.balances && moments.sum() < (2.0 - 1e-9) * moments.max() {
            moments.fill(moments.mean());
        }
        // The axes have rounding errors.
        if moments != eigenvalues {
            mass.inertia_kg_m2 = axes * Matrix3::from_diagonal(&moments) * axes.transpose();
        }
        mass
    }

    /// Reads an `<inertial>`; `None` without mass.
    pub fn inertial(
        &mut self,
        of: Element<'a, 'i>,
        link_from_here: &Isometry3<f64>,
    ) -> Option<MassProperties> {
        let Some(mass_kg) = self.number(of, "mass") else {
            if of.node.attribute("mass").is_none() {
                let message = format!("{}: `mass` is missing", called(of.node));
                self.fault(of.node, message, "write mass=\"…\" into the tag, in kg");
            }
            return None;
        };
        let mut pose = self.pose(of);
        let inertia = if let Some([xx, yy, zz, xy, xz, yz]) = self.fixed::<6>(of, "fullinertia") {
            // MuJoCo uses the axes of the body, and ignores the orientation beside it.
            pose.rotation = nalgebra::UnitQuaternion::identity();
            Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
        } else {
            Matrix3::from_diagonal(&self.vector(of, "diaginertia").unwrap_or_default())
        };
        let pose = link_from_here * pose;
        let turn = pose.rotation.to_rotation_matrix();
        let inertia_kg_m2 = turn.matrix() * inertia * turn.matrix().transpose();
        let com_m = pose.translation.vector;
        (mass_kg > 0.0).then_some(MassProperties { mass_kg, com_m, inertia_kg_m2 })
    }
}

impl Form {
    /// Volume, m³, and moments of inertia about the centre for each kilogram, m².
    fn volume_and_moments(&self) -> Option<(f64, Vector3<f64>)> {
        let ball = |radius_m: f64| 4.0 / 3.0 * PI * radius_m.powi(3);
        match *self {
            Form::Sphere(r) => Some((ball(r), Vector3::repeat(0.4 * r * r))),
            Form::Cylinder { radius_m: r, half_m } => {
                let across = r * r / 4.0 + half_m * half_m / 3.0;
                Some((PI * r * r * 2.0 * half_m, Vector3::new(across, across, r * r / 2.0)))
            }
            Form::Capsule { radius_m: r, half_m: h } => {
                let (rod, caps) = (PI * r * r * 2.0 * h, ball(r));
                let volume = rod + caps;
                // Both half spheres about the centre of the capsule: 2/5 r² + h² + 3/4 h r.
                let across =
                    rod * (r * r / 4.0 + h * h / 3.0) + caps * (0.4 * r * r + h * h + 0.75 * h * r);
                let about_axis = rod * r * r / 2.0 + caps * 0.4 * r * r;
                Some((volume, Vector3::new(across, across, about_axis) / volume))
            }
            Form::Ellipsoid(half) => {
                let square = half.component_mul(&half);
                let volume = 4.0 / 3.0 * PI * half.product();
                Some((volume, (Vector3::repeat(square.sum()) - square) / 5.0))
            }
            Form::Box(half) => {
                let square = half.component_mul(&half);
                Some((8.0 * half.product(), (Vector3::repeat(square.sum()) - square) / 3.0))
            }
            Form::Mesh => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::model::Model;
    use super::*;
    use crate::urdf::notes::Notes;
    use nalgebra::Rotation3;

    /// MuJoCo 3 raises principal moments to a lower bound, and replaces impossible ones by their mean.
    #[test]
    fn moments_are_settled_as_in_mujoco() {
        let settled = |compiler: &str, moments: [f64; 3]| {
            let text = format!("<mujoco><compiler {compiler}/></mujoco>");
            let document = roxmltree::Document::parse(&text).unwrap();
            let model = Model::new(document.root_element());
            let mut notes = Notes::new("", "");
            let reader = Reader { notes: &mut notes, model: &model };
            let turn = Rotation3::from_euler_angles(0.3, -0.7, 1.1);
            let inertia = turn * Matrix3::from_diagonal(&moments.into()) * turn.transpose();
            let mass =
                MassProperties { mass_kg: 1.0, com_m: Vector3::zeros(), inertia_kg_m2: inertia };
            turn.transpose() * reader.settled(mass).inertia_kg_m2 * turn
        };
        for (compiler, moments, expected) in [
            ("boundinertia=\"0.12\"", [0.1, 0.1, 0.15], [0.12, 0.12, 0.15]),
            ("balanceinertia=\"true\"", [0.1, 0.1, 0.3], [0.5 / 3.0; 3]),
            ("balanceinertia=\"true\"", [0.1, 0.1, 0.2], [0.1, 0.1, 0.2]),
            ("", [0.1, 0.1, 0.3], [0.1, 0.1, 0.3]),
        ] {
            let expected = Matrix3::from_diagonal(&expected.into());
            let error = (settled(compiler, moments) - expected).amax();
            assert!(error < 1e-12, "{compiler} {moments:?}: {error}");
        }
    }

    /// Compares with means of squares over points that fill the form evenly.
    #[test]
    fn moments_are_those_of_points_inside() {
        let half = Vector3::new(0.3, 0.2, 0.5);
        let (r, h): (f64, f64) = (0.2, 0.3);
        type Inside = Box<dyn Fn(&Vector3<f64>) -> bool>;
        let forms: [(Form, Inside); 5] = [
            (Form::Sphere(r), Box::new(move |p| p.norm() < r)),
            (
                Form::Cylinder { radius_m: r, half_m: h },
                Box::new(move |p| p.xy().norm() < r && p.z.abs() < h),
            ),
            (
                Form::Capsule { radius_m: r, half_m: h },
                Box::new(move |p| Vector3::new(p.x, p.y, (p.z.abs() - h).max(0.0)).norm() < r),
            ),
            (Form::Ellipsoid(half), Box::new(move |p| p.component_div(&half).norm() < 1.0)),
            (Form::Box(half), Box::new(move |p| p.component_div(&half).amax() < 1.0)),
        ];
        let n = 60;
        let at = |k: usize| (k as f64 + 0.5) / n as f64 * 1.2 - 0.6;
        for (form, inside) in forms {
            let mut sum = Vector3::zeros();
            let mut count = 0.0;
            for k in 0..n * n * n {
                let p = Vector3::new(at(k % n), at(k / n % n), at(k / n / n));
                if inside(&p) {
                    let square = p.component_mul(&p);
                    sum += Vector3::repeat(square.sum()) - square;
                    count += 1.0;
                }
            }
            let (volume, moments) = form.volume_and_moments().unwrap();
            let cell = (1.2 / n as f64).powi(3);
            assert!((count * cell / volume - 1.0).abs() < 0.02);
            assert!((sum / count - moments).amax() < 0.02 * moments.max());
        }
    }
}
