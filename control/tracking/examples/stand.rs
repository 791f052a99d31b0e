//! Pushes ANYmal on wheels sideways while it stands, and prints recovery time and largest torque. The picture shows tilt and
//! displacement over time.
//!
//! `cargo run --release -p rollwalk-tracking --example stand -- stand.svg`

use nalgebra::{Isometry3, Vector3};
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_multibody::{Tree, WHEEL_MASS_SHARE};
use rollwalk_physics::World;
use rollwalk_physics::motor::Law;
use rollwalk_physics::world::Parameters;
use rollwalk_robot::{EndEffector, GRAVITY_M_S2, Robot};
use rollwalk_tracking::tasks::Weights;
use rollwalk_tracking::{Reference, Tracker};
use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;
use svg::Document;
use svg::node::element::{Polyline, Rectangle, Text};

const ROBOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shipped/robots/anymal_wheels.toml");
const TICK_S: f64 = 0.002;
const END_S: f64 = 2.0;
/// Sideways force on the body, N, with its beginning and end, s.
pub const PUSH_N: f64 = 100.0;
pub const PUSH_S: [f64; 2] = [0.5, 0.6];
/// Displacement, m, and tilt, rad, below which the robot has recovered.
pub const RECOVERED: (f64, f64) = (0.005, 0.01);

/// Course of the robot.
pub struct Stand {
    pub mass_kg: f64,
    /// Time, s, sideways displacement of the centre of mass, m, and tilt, rad.
    pub states: Vec<(f64, f64, f64)>,
    /// Largest sideways speed, m/s, and displacement, m, of the centre of mass.
    pub peak_m_s: f64,
    pub peak_m: f64,
    /// Time from the end of the push until the robot has recovered for good, s.
    pub recovery_s: f64,
    /// Largest torque of a motor, and the limit of this motor, N·m.
    pub largest_nm: (f64, f64),
    /// Sum of the vertical ground forces at the end, N.
    pub force_n: f64,
}

/// Pushes the robot in the simulator.
pub fn stand() -> Result<Stand, Box<dyn Error>> {
    let robot = Robot::from_toml(ROBOT, &std::fs::read_to_string(ROBOT)?)?;
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    let mut world = World::standing(&robot, &ground, &Parameters::new(&robot));

    // The wheels are discs with this inertia.
    let inertia = |wheel: &EndEffector| {
        0.5 * WHEEL_MASS_SHARE * robot.links[wheel.link].mass_kg * wheel.radius_m.powi(2)
    };
    let tree = Tree::new(&robot).with_spinning_wheels(inertia).with_armature();
    let (mass_kg, feet) = (tree.total_mass_kg(), robot.end_effectors.len());
    let reference = Reference {
        time_s: 0.0,
        world_from_ground: Isometry3::identity(),
        state: world.state(&tree),
        acceleration: vec![0.0; tree.dofs()],
        stands: vec![true; feet],
        force_n: vec![Vector3::z() * (mass_kg * GRAVITY_M_S2 / feet as f64); feet],
        ground_height_m: vec![0.0; feet],
        ground_normal: vec![Vector3::z(); feet],
    };
    let mut tracker = Tracker::new(tree, Weights::default(), TICK_S);

    let start_m = world.com().0;
    let (mut states, mut peak_m_s, mut largest_nm) = (Vec::new(), 0.0_f64, (0.0, 0.0));
    for tick in 0..(END_S / TICK_S) as u32 {
        let time_s = f64::from(tick) * TICK_S;
        let is_pushed = (PUSH_S[0]..PUSH_S[1]).contains(&time_s);
        world.push(if is_pushed { Vector3::y() * PUSH_N } else { Vector3::zeros() });

        // From the state to set-points, which act until the next tick.
        let state = world.state(tracker.tree());
        let touches: Vec<bool> = world.switches().collect();
        let setpoints = tracker.tick(&reference, &state, &touches)?;
        for (channel, setpoint) in setpoints.iter().enumerate() {
            let law = Law {
                kp_nm_rad: setpoint.kp_nm_rad,
                kd_nm_s_rad: setpoint.kd_nm_s_rad,
                position_rad: setpoint.position_rad,
                speed_rad_s: setpoint.speed_rad_s,
                torque_nm: setpoint.torque_nm,
                ..world.law(channel)
            };
            world.set_law(channel, law);
        }
        world.step(TICK_S)?;

        let ((com_m, com_m_s), (_, world_from_body)) = (world.com(), world.base());
        let tilt_rad = world_from_body[(2, 2)].clamp(-1.0, 1.0).acos();
        states.push((time_s + TICK_S, com_m.y - start_m.y, tilt_rad));
        peak_m_s = peak_m_s.max(com_m_s.y.abs());
        for (channel, [_, _, torque_nm]) in world.shafts().enumerate() {
            if torque_nm.abs() > largest_nm.0 {
                largest_nm = (torque_nm.abs(), world.law(channel).limit_nm);
            }
        }
    }
    let is_off = |(_, way_m, tilt_rad): &&(f64, f64, f64)| {
        way_m.abs() > RECOVERED.0 || *tilt_rad > RECOVERED.1
    };
    let recovered_s = states.iter().rfind(is_off).map_or(0.0, |(time_s, ..)| *time_s);
    let force_n = world.touches().map(|touch| touch.force.z).sum();
    let recovery_s = recovered_s - PUSH_S[1];
    let peak_m = states.iter().map(|(_, way_m, _)| way_m.abs()).fold(0.0, f64::max);
    Ok(Stand { mass_kg, states, peak_m_s, peak_m, recovery_s, largest_nm, force_n })
}

/// Chart over time: 300 px are a second, 100 px a centimetre or a degree.
pub fn picture(stand: &Stand) -> Document {
    let background = Rectangle::new().set("y", -180).set("width", 600).set("height", 240);
    let mut picture = Document::new()
        .set("viewBox", (0, -180, 600, 240))
        .set("font-family", "sans-serif")
        .add(background.set("fill", "white"));
    for (k, (name, color, unit)) in
        [("displacement", "#1f77b4", "cm"), ("tilt", "#d62728", "°")].into_iter().enumerate()
    {
        let values = stand.states.iter().map(|&(time_s, way_m, tilt_rad)| {
            (time_s, if k == 0 { 100.0 * way_m } else { tilt_rad.to_degrees() })
        });
        let largest = values.clone().map(|(_, value)| value.abs()).fold(0.0, f64::max);
        let label = Text::new(format!("{name}, at most {largest:.1} {unit}"));
        let px = |(time_s, value)| format!("{:.1},{:.1}", 300.0 * time_s, -100.0 * value);
        let points: Vec<String> = values.map(px).collect();
        let curve = Polyline::new().set("points", points.join(" ")).set("fill", "none");
        let label = label.set("x", 10 + 280 * k).set("y", -160).set("fill", color);
        picture = picture.add(curve.set("stroke", color)).add(label);
    }
    picture
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args_os().nth(1).map(PathBuf::from);
    let path = path.unwrap_or_else(|| std::env::temp_dir().join("stand.svg"));
    let stand = stand()?;
    let impulse_n_s = PUSH_N * (PUSH_S[1] - PUSH_S[0]);
    println!("push             {impulse_n_s:.1} N·s on {:.1} kg", stand.mass_kg);
    println!("largest speed    {:.3} m/s", stand.peak_m_s);
    println!("displacement     {:.1} mm at most", 1e3 * stand.peak_m);
    println!("recovery         {:.2} s", stand.recovery_s);
    println!("largest torque   {:.1} N·m of {:.1} N·m", stand.largest_nm.0, stand.largest_nm.1);
    println!("ground force     {:.1} N at the end", stand.force_n);
    svg::save(&path, &picture(&stand))?;
    println!("picture          {}", path.display());
    Ok(())
}
