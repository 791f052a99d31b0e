//! Scratch: plays a CSV of `rollwalk export` in the world.
use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use rollwalk_physics::World;
use rollwalk_physics::ground::{Ground, Plane};
use rollwalk_physics::motor::Law;
use rollwalk_physics::world::{Parameters, RobotState};
use rollwalk_robot::{Channel, Robot};
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Instant;

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let text = std::fs::read_to_string(&args[1]).unwrap();
    let robot = Robot::from_toml(&args[1], &text).unwrap();
    let csv = std::fs::read_to_string(&args[2]).unwrap();
    let periodic = args[3] == "periodic";
    let feed: bool = args[4] == "torque";
    let per: usize = args.get(5).map_or(1, |s| s.parse().unwrap());
    let cycles = if periodic { args.get(6).map_or(6, |s| s.parse().unwrap()) } else { 1 };
    let mut lines = csv.lines();
    let header: HashMap<&str, usize> =
        lines.next().unwrap().split(',').enumerate().map(|(i, n)| (n, i)).collect();
    let rows: Vec<Vec<f64>> =
        lines.map(|l| l.split(',').map(|v| v.parse().unwrap_or(f64::NAN)).collect()).collect();
    let get =
        |row: usize, name: &str| rows[row][*header.get(name).unwrap_or_else(|| panic!("{name}"))];
    let n = rows.len();
    let base = |r: usize| Vector3::new(get(r, "base_x_m"), get(r, "base_y_m"), get(r, "base_z_m"));
    let rot = |r: usize| -> Matrix3<f64> {
        UnitQuaternion::from_quaternion(Quaternion::new(
            get(r, "base_qw"),
            get(r, "base_qx"),
            get(r, "base_qy"),
            get(r, "base_qz"),
        ))
        .to_rotation_matrix()
        .into_inner()
    };
    let moving = periodic;
    let velocity = if moving { (base(1) - base(0)) * 60.0 } else { Vector3::zeros() };
    let spin = if moving {
        Rotation3::from_matrix_unchecked(rot(1) * rot(0).transpose()).scaled_axis() * 60.0
    } else {
        Vector3::zeros()
    };
    let state = RobotState {
        base_position_m: base(0),
        world_from_body: rot(0),
        base_velocity_m_s: velocity,
        base_spin_rad_s: spin,
        joint_rad: robot.joints.iter().map(|j| get(0, &format!("{}_rad", j.name))).collect(),
        joint_rad_s: robot
            .joints
            .iter()
            .map(|j| if moving { get(0, &format!("{}_rad_s", j.name)) } else { 0.0 })
            .collect(),
        wheel_rad_s: robot
            .end_effectors
            .iter()
            .map(|e| {
                if !moving {
                    return 0.0;
                }
                header
                    .get(format!("{}_motor_rad_s", e.name).as_str())
                    .or(header.get(format!("{}_wheel_rad_s", e.name).as_str()))
                    .map_or(0.0, |&i| rows[0][i])
            })
            .map(|v| if v.is_nan() { 0.0 } else { v })
            .collect(),
    };
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    let mut world = World::new(&robot, &ground, &Parameters::new(&robot), &state);
    let h = 1.0 / 60.0 / per as f64;
    let law = |row: f64| -> Vec<Law> {
        let k = row.floor() as usize;
        let (a, b, t) =
            (k % n, if periodic { (k + 1) % n } else { (k + 1).min(n - 1) }, row - row.floor());
        let mix = |name: &str| get(a.min(n - 1), name) * (1.0 - t) + get(b, name) * t;
        robot
            .channels()
            .map(|c| {
                let act = c.actuator();
                let (p, s, q) = match c {
                    Channel::Joint(j) => (
                        mix(&format!("{}_rad", j.name)),
                        mix(&format!("{}_rad_s", j.name)),
                        mix(&format!("{}_nm", j.name)),
                    ),
                    Channel::Wheel(e, _) => (
                        0.0,
                        mix(&format!("{}_motor_rad_s", e.name)),
                        mix(&format!("{}_motor_nm", e.name)),
                    ),
                };
                let line = act.torque_speed.map(|l| (l.stall_torque_nm, l.no_load_speed_rad_s));
                Law {
                    kp_nm_rad: act.kp_nm_rad,
                    kd_nm_s_rad: act.kd_nm_s_rad,
                    position_rad: p,
                    speed_rad_s: s,
                    torque_nm: if feed { q } else { 0.0 },
                    limit_nm: act.torque_max_nm,
                    line,
                }
            })
            .collect()
    };
    let set = |world: &mut World, row: f64| {
        for (k, l) in law(row).into_iter().enumerate() {
            world.set_law(k, l)
        }
    };
    if !moving {
        for _ in 0..60 * per {
            let mut l = law(0.0);
            for one in &mut l {
                one.speed_rad_s = 0.0
            }
            for (k, one) in l.into_iter().enumerate() {
                world.set_law(k, one)
            }
            world.step(h).unwrap();
        }
    }
    let mut marks = vec![world.com().0];
    let (mut its, mut worst, mut halvings, mut subs, mut steps) = (0, 0, 0, 0, 0);
    let frames = if periodic { n } else { n - 1 };
    let start = Instant::now();
    let mut yaw = vec![world.base().1];
    for _ in 0..cycles {
        for k in 0..frames * per {
            set(&mut world, (k + 1) as f64 / per as f64);
            match world.step(h) {
                Ok(r) => {
                    its += r.iterations;
                    worst = worst.max(r.iterations);
                    halvings += r.halvings;
                    subs += r.subdivisions;
                    steps += 1
                }
                Err(e) => {
                    println!("{e}");
                    return;
                }
            }
        }
        marks.push(world.com().0);
        yaw.push(world.base().1);
    }
    let took = start.elapsed().as_secs_f64();
    if !periodic {
        for _ in 0..60 * per {
            world.step(h).unwrap();
        }
        let last = marks.len() - 1;
        marks[last] = world.com().0;
    }
    let last = if periodic { n - 1 } else { n - 1 };
    let planned = if periodic {
        let com = |r: usize| Vector3::new(get(r, "com_x_m"), get(r, "com_y_m"), 0.0);
        // one frame more than the rows
        (com(last) - com(0)) + (com(1) - com(0))
    } else {
        Vector3::new(
            get(last, "com_x_m") - get(0, "com_x_m"),
            get(last, "com_y_m") - get(0, "com_y_m"),
            0.0,
        )
    };
    let moved: Vec<String> = marks
        .windows(2)
        .zip(&yaw)
        .map(|(w, r)| {
            let d = r.transpose() * (w[1] - w[0]);
            format!("{:.4},{:.4}", d.x, d.y)
        })
        .collect();
    let turned: Vec<String> = yaw
        .windows(2)
        .map(|w| {
            let r = w[1] * w[0].transpose();
            format!("{:.3}", r[(1, 0)].atan2(r[(0, 0)]))
        })
        .collect();
    println!(
        "planned {:.4},{:.4} moved {} turned {} | {:.2} its/step, worst {worst}, {halvings} halvings, {subs} subdivisions, {:.3} ms/step, {:.0}x real time",
        planned.x,
        planned.y,
        moved.join(" "),
        turned.join(" "),
        its as f64 / steps as f64,
        1e3 * took / steps as f64,
        steps as f64 * h / took
    );
}
