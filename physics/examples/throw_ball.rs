//! Throws a ball so that it hits a target after one bounce, and shows both methods for derivatives. The picture shows the path
//! of the ball before and after the fit.
//!
//! The direct method propagates derivatives with respect to all parameters forward. It suits few parameters, or many residuals
//! (Gauss–Newton's method). The adjoint method propagates the derivatives of one scalar backward. Its cost does not depend on
//! the number of parameters.
//!
//! `cargo run --release -p rollwalk-physics --example throw_ball -- ball.svg`

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rollwalk_multibody::ground::Plane;
use rollwalk_physics::contact::{GroundContact, Normal, Resistance, Tip};
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::sensitivity::gauss_newton::{Evaluation, Fit, Options, minimise};
use rollwalk_physics::sensitivity::parameter::{Freedom, Initial};
use rollwalk_physics::sensitivity::{Parameter, Recorder, Residual, Rollout};
use rollwalk_physics::{Assembly, BodyMotion, Inertia, Scheme, Settings, StepError, System};
use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;
use svg::Document;
use svg::node::element::{Circle, Polyline, Rectangle, Text};

pub const RADIUS_M: f64 = 0.05;
pub const START_M: Vector3<f64> = Vector3::new(0.0, 0.0, 0.5);
pub const TARGET_M: Vector3<f64> = Vector3::new(1.2, 0.3, 0.2);
/// Velocity of the first throw, m/s.
pub const FIRST_M_S: [f64; 3] = [1.2, 0.2, 0.5];
/// Number of steps. A contact lasts about 30 steps, so that a bounce hardly depends on the time within a step at which it
/// begins.
pub const STEPS: usize = 800;
pub const STEP_S: f64 = 1e-3;

/// Simulates a throw and records its derivatives.
pub fn throw(velocity: Vector3<f64>) -> Result<Rollout, StepError> {
    // Bodies and forces.
    let mut assembly = Assembly::default();
    let about_com_kg_m2 = Matrix3::identity() * (0.4 * 0.1 * RADIUS_M * RADIUS_M);
    let inertia = Inertia { mass_kg: 0.1, about_com_kg_m2 };
    let ball = assembly.add_body(inertia, BodyMotion { velocity, ..BodyMotion::at(START_M) });
    assembly.add(GroundContact {
        body: [ball],
        center: Vector3::zeros(),
        radius_m: RADIUS_M,
        tip: Tip::Sphere,
        normal: Normal { stiffness_n_m: 1e3, damping_n_s_m: 0.5, ramp_m: 1e-3, pulls: true },
        friction: Friction { model: FrictionModel::Tanh, coefficient: 0.4, stick_n_s_m: 10.0 },
        resistance: Resistance::default(),
        ground: Arc::new(Plane::level()),
    });
    // BDF2 conserves the energy of bodies that fly and bounce.
    let settings = Settings { scheme: Scheme::Bdf2, tolerance: 1e-10, ..Settings::default() };
    let mut system = System::new(settings, assembly);

    // Parameters of the derivatives: velocity along each axis.
    let parameters = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| -> Box<dyn Parameter> {
        Box::new(Initial { bodies: vec![ball], freedom: Freedom::Velocity, axis })
    });
    let mut recorder = Recorder::new(&system, Vec::from(parameters));
    for _ in 0..STEPS {
        system.step_recorded(STEP_S, &mut recorder)?;
    }
    Ok(recorder.finish())
}

/// Residuals: distance of the ball from the target along each axis after the final step.
fn miss(rollout: &Rollout) -> Vec<Residual> {
    let along = |axis| Residual::position(rollout, STEPS, 0, &TARGET_M, axis);
    [Vector3::x(), Vector3::y(), Vector3::z()].map(along).to_vec()
}

/// Derivatives of a throw: d(place)/d(velocity), s, and the gradient of ½ |miss|² by the direct and by the adjoint method.
pub fn derivatives(rollout: &Rollout) -> (DMatrix<f64>, [DVector<f64>; 2]) {
    let residuals = miss(rollout);
    // Rows are residuals, columns parameters. The transpose times the residuals is the gradient.
    let jacobian = rollout.jacobian(&residuals);
    let values = DVector::from_iterator(3, residuals.iter().map(|miss| miss.value));
    let direct = jacobian.tr_mul(&values);
    (jacobian, [direct, DVector::from_vec(rollout.gradient(&residuals))])
}

/// Finds the velocity with which the ball hits the target; `None` if the first throw fails.
pub fn fit() -> Option<Fit> {
    minimise(&FIRST_M_S, &[], &Options::default(), |velocity: &[f64]| {
        let rollout = throw(Vector3::from_column_slice(velocity)).ok()?;
        let residuals = miss(&rollout);
        Some(Evaluation::from((rollout, residuals)))
    })
}

/// Side view of throws, x to the right and z up, at 400 px a metre.
pub fn picture(throws: [(&str, &str, &Rollout); 2]) -> Document {
    let px = |place: &Vector3<f64>| (60.0 + 400.0 * place.x, 420.0 - 400.0 * place.z);
    let ball = |place: &Vector3<f64>| {
        let (x, y) = px(place);
        Circle::new().set("cx", x).set("cy", y).set("r", 400.0 * RADIUS_M)
    };
    let ground = Rectangle::new().set("y", 420).set("width", 640).set("height", 20);
    let scale = Text::new("1.6 m").set("x", 580).set("y", 415);
    let mut picture = Document::new()
        .set("viewBox", (0, 0, 640, 440))
        .set("font-family", "sans-serif")
        .add(Rectangle::new().set("width", 640).set("height", 440).set("fill", "white"))
        .add(ground.set("fill", "#bbb"))
        .add(scale)
        .add(ball(&TARGET_M).set("fill", "#ddd"));
    for (k, (name, color, rollout)) in throws.into_iter().enumerate() {
        let points = (0..=STEPS).step_by(4).map(|step| px(&rollout.motions(step)[0].position));
        let points: Vec<String> = points.map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        let line = Polyline::new().set("points", points.join(" ")).set("fill", "none");
        let end = ball(&rollout.motions(STEPS)[0].position).set("fill", "none");
        let name = Text::new(name).set("x", 500).set("y", 24 + 20 * k).set("fill", color);
        picture = picture.add(line.set("stroke", color)).add(end.set("stroke", color)).add(name);
    }
    picture
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args_os().nth(1).map(PathBuf::from);
    let path = path.unwrap_or_else(|| std::env::temp_dir().join("ball.svg"));
    let first = throw(Vector3::from(FIRST_M_S))?;
    println!("The first throw ends at {:.3?} m.", first.motions(STEPS)[0].position.as_slice());
    let (jacobian, [direct, adjoint]) = derivatives(&first);
    println!("Direct method, d(place)/d(velocity), s:{jacobian:.4}");
    println!("Gradient of ½ |miss|², m·s: adjoint {:.6?}", adjoint.as_slice());
    println!("                            direct  {:.6?}", direct.as_slice());

    let fit = fit().ok_or("the first throw fails")?;
    let best = throw(Vector3::from_column_slice(&fit.parameters))?;
    let end = best.motions(STEPS)[0].position;
    println!(
        "A throw with {:.3?} m/s ends at {:.3?} m, {:.1e} m from the target; the search took {} \
         simulations.",
        fit.parameters,
        end.as_slice(),
        (end - TARGET_M).norm(),
        fit.rollouts
    );
    let throws = [("first throw", "#d62728", &first), ("after the fit", "#1f77b4", &best)];
    svg::save(&path, &picture(throws))?;
    println!("Picture: {}", path.display());
    Ok(())
}
