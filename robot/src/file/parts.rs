//! Mass properties of a link from its solids.

use crate::document::Table;
use crate::rules::LENGTH_MAX_M;
use crate::solid::{Form, Solid};
use nalgebra::{Matrix3, Vector3};

/// Mass, centre of mass, and inertia about the centre of mass.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MassProperties {
    pub mass_kg: f64,
    pub com_m: Vector3<f64>,
    pub inertia_kg_m2: Matrix3<f64>,
}

/// Key for the actuator that a part represents. A design that changes this actuator also changes the mass of the part.
pub(super) const ACTUATOR: &str = "actuator";

/// Sums the mass properties of parts. The centre of mass is the weighted mean; inertias are moved to it by the parallel-axis
/// theorem I + m (|d|² 1 − d dᵀ).
pub(crate) fn sum(parts: &[MassProperties]) -> MassProperties {
    let mass_kg: f64 = parts.iter().map(|part| part.mass_kg).sum();
    let moment: Vector3<f64> = parts.iter().map(|part| part.com_m * part.mass_kg).sum();
    let com_m = moment / mass_kg;
    let inertia_kg_m2 = parts
        .iter()
        .map(|part| {
            let d = part.com_m - com_m;
            let spread = Matrix3::from_diagonal_element(d.norm_squared()) - d * d.transpose();
            part.inertia_kg_m2 + spread * part.mass_kg
        })
        .sum();
    MassProperties { mass_kg, com_m, inertia_kg_m2 }
}

/// Reads one entry of `parts`: a mass, a position, and a homogeneous box or cylinder along a link axis. The solid is `None` if
/// its size is faulty.
pub(super) fn read(part: Table<'_>) -> (MassProperties, Option<Solid>) {
    let mass_kg = part.number_in("mass_kg", 1e-6..=1000.0, "kg").unwrap_or_default();
    let com_m: Vector3<f64> = part.numbers::<3>("at_m").unwrap_or_default().into();
    let shapes = ["cylinder_x_m", "cylinder_y_m", "cylinder_z_m", "box_m"];
    let given: Vec<_> = (0..shapes.len()).filter(|&shape| part.has(shapes[shape])).collect();
    let form = match given[..] {
        [3] => sizes(&part, "box_m").map(|size| Form::Box { size_m: size.into() }),
        [axis] => sizes(&part, shapes[axis]).map(|[radius_m, length_m]| Form::Cylinder {
            axis,
            radius_m,
            length_m,
        }),
        _ => {
            let help = "give one of `box_m = [x, y, z]` or `cylinder_x_m`, `cylinder_y_m`, \
                        `cylinder_z_m = [radius, length]`";
            part.fault("shape", "must be given once", "needs one shape", help);
            None
        }
    };
    // These keys tell how designs change the part, and nothing about the present robot.
    part.given("stretches", Table::boolean);
    part.given(ACTUATOR, Table::string);
    part.done();
    let diagonal_per_kg = form.map(|form| match form {
        Form::Box { size_m } => {
            let [x, y, z]: [f64; 3] = size_m.into();
            Vector3::new(y * y + z * z, x * x + z * z, x * x + y * y) / 12.0
        }
        Form::Cylinder { axis, radius_m, length_m } => {
            let across = radius_m * radius_m / 4.0 + length_m * length_m / 12.0;
            let mut diagonal = Vector3::repeat(across);
            diagonal[axis] = radius_m * radius_m / 2.0;
            diagonal
        }
    });
    let inertia_kg_m2 = Matrix3::from_diagonal(&(diagonal_per_kg.unwrap_or_default() * mass_kg));
    let solid = form.map(|form| Solid { center_in_link_m: com_m, form });
    (MassProperties { mass_kg, com_m, inertia_kg_m2 }, solid)
}

/// Reads lengths of a solid, and records a fault for each length out of range.
pub(super) fn sizes<const N: usize>(table: &Table<'_>, key: &'static str) -> Option<[f64; N]> {
    let sizes = table.numbers::<N>(key)?;
    let mut sound = true;
    for (index, size) in sizes.iter().enumerate() {
        if !(*size > 0.0 && *size <= LENGTH_MAX_M) {
            let problem = format!("[{index}] is {size} m");
            let mm = if *size > LENGTH_MAX_M { "; divide millimetres by 1000" } else { "" };
            let help = format!("give a length above 0 and up to {LENGTH_MAX_M} m{mm}");
            table.fault(key, problem, "not a valid length", help);
            sound = false;
        }
    }
    sound.then_some(sizes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests that a box divided into two halves has the mass properties of the whole box.
    #[test]
    fn two_half_boxes_are_one_box() {
        let cuboid = |mass_kg: f64, size: [f64; 3], at: [f64; 3]| {
            let [x, y, z] = size.map(|side| side * side);
            let diagonal = Vector3::new(y + z, x + z, x + y) * (mass_kg / 12.0);
            let inertia_kg_m2 = Matrix3::from_diagonal(&diagonal);
            MassProperties { mass_kg, com_m: Vector3::from(at), inertia_kg_m2 }
        };
        let whole = cuboid(3.0, [0.4, 0.2, 0.1], [1.0, 2.0, 3.0]);
        let halves = [
            cuboid(1.5, [0.2, 0.2, 0.1], [0.9, 2.0, 3.0]),
            cuboid(1.5, [0.2, 0.2, 0.1], [1.1, 2.0, 3.0]),
        ];
        let summed = sum(&halves);
        assert_eq!(summed.mass_kg, whole.mass_kg);
        // Rounding of sums of squares around 10 m² against 1e-2 kg m².
        assert!((summed.com_m - whole.com_m).amax() < 1e-14);
        assert!((summed.inertia_kg_m2 - whole.inertia_kg_m2).amax() < 1e-14);
    }
}
