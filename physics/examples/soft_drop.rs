//! Drops a soft block of tetrahedra on the ground, and differentiates its height with respect to its stiffness.

use nalgebra::Vector3;
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::sensitivity::parameter::{MaterialQuantity, Softness};
use rollwalk_physics::sensitivity::{Recorder, Residual};
use rollwalk_physics::soft::{Material, Mesh, SoftBody, SurfaceContact};
use rollwalk_physics::{Assembly, Scheme, Settings, StepError, System};
use std::sync::Arc;

const STEP_S: f64 = 1.0 / 240.0;
const STEPS: usize = 120;

fn main() -> Result<(), StepError> {
    // A block of 20 cm with 3 × 3 × 3 cells, 5 cm above the ground; 150 kg/m³, Young's modulus 20 kPa.
    let mesh = Mesh::block(Vector3::new(-0.1, -0.1, 0.05), Vector3::repeat(0.2), [3; 3]);
    let material = Material { viscosity_pa_s: 5.0, ..Material::elastic(150.0, 2e4, 0.3) };
    let mut assembly = Assembly::default();
    let soft = SoftBody::add(&mut assembly, &mesh, &material).expect("a mesh of positive volume");
    let elements = 0..assembly.forces.len();
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    // Stiffness and damping are per area, so that a finer mesh is equally stiff.
    soft.touch(
        &mut assembly,
        &ground,
        &SurfaceContact {
            stiffness_n_m3: 1e6,
            damping_n_s_m3: 1e3,
            ramp_m: 1e-3,
            friction: Friction {
                model: FrictionModel::Linear,
                coefficient: 0.5,
                stick_n_s_m: 100.0,
            },
        },
    );
    let settings = Settings { scheme: Scheme::Bdf2, ..Settings::default() };
    let mut system = System::new(settings, assembly);
    println!("{} nodes, {} tetrahedra", soft.nodes.len(), elements.len());

    // Shear modulus of all tetrahedra.
    let shear = Softness { elements, of: MaterialQuantity::Mu };
    let mut recorder = Recorder::new(&system, vec![Box::new(shear)]);
    let mut iterations = 0;
    for step in 1..=STEPS {
        iterations += system.step_recorded(STEP_S, &mut recorder)?.iterations;
        if step % 15 == 0 {
            let heights = system.motions().iter().map(|node| node.position.z);
            let [low, high] = [f64::min, f64::max]
                .map(|of| heights.clone().reduce(of).expect("the block has nodes"));
            let joule = system.energy().total_j();
            println!(
                "{:.3} s: height from {low:.4} to {high:.4} m, energy {joule:.3} J",
                system.time_s()
            );
        }
    }
    println!("{:.1} Newton iterations a step", f64::from(iterations) / STEPS as f64);

    let rollout = recorder.finish();
    let height = Residual::com(&rollout, STEPS, &Vector3::zeros(), Vector3::z());
    let by_shear = rollout.gradient(std::slice::from_ref(&height))[0] / height.value;
    println!(
        "The centre of mass is at {:.4} m; increasing the shear modulus by 1 kPa moves the centre \
         of mass by {:+.2e} m.",
        height.value,
        1e3 * by_shear
    );
    Ok(())
}
