//! Tests of robots with springs, telescopic legs, belts, or cranks and rods from motors in the body: plan, library behind the
//! bus, tracking and exports.

use crate::desk_with_shipped_files;
use rollwalk_tests::Desk;
use serde_json::Value;

const LIBRARY: &str = "name = \"legs\"\nrobot = \"robots/ROBOT.toml\"\nsafe = \"stand\"\n\
    [[motion]]\nname = \"stand\"\nfile = \"stand.toml\"\ncode = 1\n\
    [[motion]]\nname = \"walk\"\nfile = \"motions/ROBOT_walk.toml\"\ncode = 2\n\
    [via_safe]\nduration_s = 1.2\nsamples = 25\n";

/// Builds a library of a robot's stand and walk, and plays it on the ground behind the bus. Plans the walk and exports it
/// to `walk.xml`.
fn walked(desk: &Desk, robot: &str) {
    let stand = desk.read_text("motions/pup_stand.toml");
    desk.write("stand.toml", stand.replace("../robots/pup", &format!("robots/{robot}")));
    desk.write("legs.toml", LIBRARY.replace("ROBOT", robot));
    desk.run(&["library", "build", "legs.toml", "-o", "legs.rwl"]).succeeds();
    let said = desk.run(&["simulate", "legs.rwl", "--json"]).succeeds();
    let said: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(said["falls"], Value::Array(Vec::new()));
    let travels = said["travels"].as_array().unwrap();
    let walk = travels.iter().find(|travel| travel["name"] == "walk").unwrap();
    // Five periods of 80 mm.
    let ahead_m = walk["forward_m"].as_f64().unwrap();
    assert!((0.38..0.42).contains(&ahead_m), "{ahead_m}");

    desk.make(&["plan", &format!("motions/{robot}_walk.toml"), "-o", "walk.json"]);
    desk.run(&["export", "walk.json", "-o", "walk.xml"]).succeeds();
}

/// Walks with a coupled robot, whose plans `retarget` refuses. Returns the MuJoCo model of the walk.
fn walked_coupled(robot: &str) -> String {
    let desk = desk_with_shipped_files();
    walked(&desk, robot);
    desk.run(&["simulate", "walk.json", "--tracking"]).succeeds();
    desk.run(&["retarget", "walk.json", "-o", "corrected.json"])
        .fails(1, &["the motor of joint `front_left_knee` is coupled"]);
    desk.read_text("walk.xml")
}

#[test]
fn springs_at_the_knees_relieve_the_motors_of_a_walk() {
    let desk = desk_with_shipped_files();
    let peak_nm = |plan: &str| {
        let plan: Value = serde_json::from_str(&desk.read_text(plan)).unwrap();
        let samples = plan["samples"].as_array().unwrap().clone();
        // Joints are hip and knee of each leg.
        let knees = samples.iter().flat_map(|sample| {
            let torques = sample["joint_torque_nm"].as_array().unwrap().iter();
            torques.skip(1).step_by(2).map(|torque| torque.as_f64().unwrap().abs())
        });
        knees.fold(0.0, f64::max)
    };
    desk.make(&["plan", "motions/pup_walk.toml", "-o", "plain.json"]);
    let knee = "nominal_rad = -1.2            # computed: twice the hip, back below the hip\n";
    let spring = "spring = { stiffness_nm_rad = 0.05, rest_rad = 0.0, damping_nm_s_rad = 0.002 }\n";
    let sprung = desk.read_text("robots/pup.toml").replacen(knee, &format!("{knee}{spring}"), 1);
    assert!(sprung.contains("spring ="));
    desk.write("robots/pup_sprung.toml", sprung);
    let walk = desk.read_text("motions/pup_walk.toml");
    desk.write("motions/pup_sprung_walk.toml", walk.replace("pup.toml", "pup_sprung.toml"));
    walked(&desk, "pup_sprung");
    desk.run(&["simulate", "walk.json", "--tracking"]).succeeds();
    assert_eq!(desk.read_text("walk.xml").matches("springref=").count(), 4);
    let [plain_nm, sprung_nm] = ["plain.json", "walk.json"].map(peak_nm);
    assert!(sprung_nm < 0.8 * plain_nm, "{plain_nm} to {sprung_nm} N·m");
}

#[test]
fn a_robot_with_belts_walks_behind_the_bus_and_tracked() {
    let model = walked_coupled("pup_belt");
    assert_eq!(model.matches("<fixed name=\"").count(), 4);
    assert_eq!(model.matches("tendon=\"front_left_knee\"").count(), 1);
}

#[test]
fn a_robot_with_five_bar_legs_walks_behind_the_bus_and_tracked() {
    let model = walked_coupled("pup_five_bar");
    assert_eq!(model.matches("<spatial name=\"").count(), 4);
    assert_eq!(model.matches("tendon1=\"front_left_knee_rod\"").count(), 1);
}

#[test]
fn a_robot_with_telescopic_legs_walks_behind_the_bus_and_tracked() {
    let desk = desk_with_shipped_files();
    walked(&desk, "pup_linear");
    desk.run(&["simulate", "walk.json", "--tracking"]).succeeds();
    let model = desk.read_text("walk.xml");
    assert_eq!(model.matches("type=\"slide\"").count(), 4);
    // The controls are the angles of the servos.
    assert_eq!(model.matches("gear=\"55.55555555555556\"").count(), 4);
    let described = desk.run(&["robot", "check", "robots/pup_linear.toml"]).succeeds();
    assert!(described.contains("prismatic joint"), "{described}");
    desk.run(&["robot", "export", "robots/pup_linear.toml", "-o", "pup.urdf"]).succeeds();
    let urdf = desk.read_text("pup.urdf");
    assert_eq!(urdf.matches("type=\"prismatic\"").count(), 4);
    assert!(urdf.contains("lower=\"0\" upper=\"0.05\""), "{urdf}");
}

#[test]
fn a_robot_with_sprung_feet_walks_behind_the_bus() {
    let desk = desk_with_shipped_files();
    walked(&desk, "pup_toes");
    desk.run(&["retarget", "walk.json", "-o", "corrected.json"])
        .fails(1, &["joint `front_left_toe` has no motor"]);
    // No encoder measures the toes.
    desk.run(&["simulate", "walk.json"]).succeeds();
    desk.run(&["simulate", "walk.json", "--tracking"])
        .fails(1, &["joint `front_left_toe` of pup_toes has no motor"]);
    let model = desk.read_text("walk.xml");
    assert_eq!(model.matches("springref=").count(), 4);
    assert_eq!(model.matches("<position ").count(), 8, "no motor turns the toes");
    let described = desk.run(&["robot", "check", "robots/pup_toes.toml"]).succeeds();
    assert!(described.contains("natural Hz"), "{described}");
}
