//! Tests of the robot on the simulated ground: a plan alone, and a library behind the bus.

use crate::desk_with_shipped_files;
use crate::simulated::{Robot, desk_with_library_file, on};
use rollwalk_tests::program::Program;
use serde_json::Value;
use std::process::Stdio;

#[test]
fn a_plan_is_played_on_the_ground_and_compared_with_what_becomes_of_it() {
    let desk = desk_with_shipped_files();
    desk.make(&["plan", "motions/drive_1m.toml", "-o", "drive.json"]);
    let said = desk.run(&["simulate", "drive.json"]).succeeds();
    assert!(
        said.contains("forward: 1.000 of the plan") && said.contains("passes the simulation"),
        "{said}"
    );
    let said = desk.run(&["simulate", "drive.json", "--json", "--rate", "60"]).succeeds();
    assert!(said.contains("\"holds\": true") && said.contains("\"fell_at_s\": null"), "{said}");
    // The robot slides down a roof.
    desk.run(&["simulate", "drive.json", "--slope", "40"])
        .succeeds_with(3, &["the robot falls after"]);
    desk.run(&["simulate", "drive.json", "--slope", "60"])
        .fails(2, &["'60' for '--slope", "give -45 to 45 degrees"]);
}

#[test]
fn terrain_and_pushes_are_given_to_a_plan() {
    let desk = desk_with_shipped_files();
    desk.make(&["plan", "motions/drive_1m.toml", "-o", "drive.json"]);
    let simulate = |args: &[&str]| desk.run(&[&["simulate", "drive.json"], args].concat());
    desk.write("kerb.toml", "[step]\nat_x_m = 0.5\nheight_m = 0.1\n");
    simulate(&["--terrain", "kerb.toml"])
        .succeeds_with(3, &["forward: 0.5", "fails in simulation: the robot covers 0.5"]);
    simulate(&["--push", "2:0,120,0:0.1"]).succeeds_with(3, &["the robot falls after 2."]);
    simulate(&["--push", "2:0,3,0:0.1"]).succeeds();
    simulate(&["--push", "2:0,3:0.1"]).fails(2, &["give 3 numbers for the force", "not 2"]);
    desk.write("kerb.toml", "[step]\nat_x_m = 0.5\nheight = 0.1\n");
    simulate(&["--terrain", "kerb.toml"]).fails(1, &["kerb.toml:", "unknown key `height`"]);
    simulate(&["--terrain", "motions/walk.toml"])
        .fails(1, &["motions/walk.toml is a motion file, not a terrain file"]);
    simulate(&["--terrain", "none.toml"]).fails(1, &["there is no terrain file"]);
    desk.run(&["plan", "kerb.toml", "-o", "x.json"]).fails(1, &["kerb.toml is a terrain file"]);
}

#[test]
fn a_robot_goes_round_an_obstacle_that_it_would_hit() {
    let desk = desk_with_shipped_files();
    desk.write(
        "crate.toml",
        "[[obstacle]]\nname = \"crate\"\nbox_m = [0.1, 0.1, 0.4]\nat_m = [0.5, 0.05, 0.2]\n",
    );
    let drive = desk.read_text("motions/drive_1m.toml");
    let drive = drive.replacen("robot = \"../", "robot = \"", 1).replacen("= 25", "= 45", 1);
    desk.write("drive.toml", &drive);
    desk.make(&["plan", "drive.toml", "-o", "drive.json"]);
    desk.run(&["simulate", "drive.json", "--terrain", "crate.toml"])
        .succeeds_with(3, &["fails in simulation: `", "touches obstacle `crate` after 2."]);
    // Whether the robot falls over it or not, the obstacle is named.
    desk.write(
        "bar.toml",
        "[[obstacle]]\nname = \"bar\"\nfrom_m = [0.5, -0.5, 0.28]\nto_m = [0.5, 0.5, 0.28]\n\
         radius_m = 0.02\n",
    );
    desk.run(&["simulate", "drive.json", "--terrain", "bar.toml"])
        .succeeds_with(3, &["touches obstacle `bar` after "]);
    desk.write("round.toml", format!("terrain = \"crate.toml\"\n{drive}"));
    let said = desk.run(&["plan", "round.toml", "-o", "round.json"]).succeeds();
    assert!(
        said.contains("from a path round obstacles") && said.contains("passes the simulation"),
        "{said}"
    );
    desk.run(&["report", "round.json"]).succeeds_with(0, &["obstacle clearance"]);
    desk.run(&["plot", "round.json", "--animate", "-o", "round.svg"]).succeeds();
    desk.write("inside.toml", format!("{drive}\n[[obstacle]]\nbox_m = [1, 1, 1]\n"));
    desk.run(&["plan", "inside.toml", "-o", "x.json"])
        .fails(1, &["`obstacle` is no key of a motion file", "name it in `terrain`"]);
}

#[test]
fn a_library_holds_a_motion_over_a_kerb_and_plays_it_there() {
    let desk = desk_with_shipped_files();
    desk.write("kerb.toml", "[step]\nat_x_m = 0.5\nheight_m = 0.015\n");
    let drive = desk.read_text("motions/drive_1m.toml");
    let drive = drive.replacen("robot = \"../", "robot = \"", 1).replacen("= 25", "= 60", 1);
    desk.write("over.toml", format!("terrain = \"kerb.toml\"\n{drive}"));
    let library = |name: &str| {
        format!(
            "name = \"kerbs\"\nrobot = \"robots/agilebot.toml\"\nsafe = \"stand\"\n\
             [[motion]]\nname = \"stand\"\nfile = \"motions/stand.toml\"\ncode = 1\n\
             [[motion]]\nname = \"{name}\"\nfile = \"over.toml\"\ncode = 2\n\
             [via_safe]\nduration_s = 1.2\nsamples = 25\n"
        )
    };
    desk.write("kerbs.toml", library("over"));
    desk.run(&["library", "build", "kerbs.toml", "-o", "kerbs.rwl"])
        .fails(1, &["motion `over` is for a terrain", "such as `over@stairs`"]);
    desk.write("kerbs.toml", library("over@kerb"));
    let built = desk.run(&["library", "build", "kerbs.toml", "-o", "kerbs.rwl", "--json"]);
    let built: Value = serde_json::from_str(&built.succeeds()).unwrap();
    // The tour on level ground leaves it out; it is judged on its own ground.
    let simulation = &built["simulation"];
    let clips = simulation["clips"].as_array().unwrap();
    assert!(clips.iter().all(|clip| clip["name"] != "over@kerb"), "{simulation}");
    let alone = &simulation["on_terrain"][0];
    assert_eq!((&alone["name"], &alone["verdict"]), (&"over@kerb".into(), &"holds".into()));
    let level = desk.run(&["simulate", "kerbs.rwl"]);
    assert!(level.stderr.contains("motion `over@kerb` was not played"), "{}", level.stderr);
    let told = desk.run(&["simulate", "kerbs.rwl", "--terrain", "kerb.toml", "--json"]).succeeds();
    let told: Value = serde_json::from_str(&told).unwrap();
    let travels = told["travels"].as_array().unwrap();
    let over = travels.iter().find(|travel| travel["name"] == "over@kerb").expect("it is played");
    let ahead_m = over["forward_m"].as_f64().unwrap();
    assert!((0.95..1.05).contains(&ahead_m), "{ahead_m}");
    assert_eq!(told["falls"], Value::Array(Vec::new()));
    desk.write(
        "crate.toml",
        "[step]\nat_x_m = 0.5\nheight_m = 0.015\n[[obstacle]]\nname = \"crate\"\n\
         box_m = [0.1, 0.1, 0.4]\nat_m = [0.9, 0.05, 0.2]\n",
    );
    desk.run(&["simulate", "kerbs.rwl", "--terrain", "crate.toml"])
        .succeeds_with(3, &["touches obstacle `crate` after "]);
    // The motion may not end half-way up.
    desk.write(
        "over.toml",
        format!("terrain = \"kerb.toml\"\n{}", drive.replacen("= 1.0", "= 0.5", 1)),
    );
    desk.run(&["library", "build", "kerbs.toml", "-o", "kerbs.rwl"])
        .fails(1, &["feet of `over@kerb` stand at heights from 0 to 15 mm", "on level parts"]);
}

/// Presses Ctrl-C in the first of 10,000 cycles of a loop. The robot must return to SAFE and be disarmed, and the results must
/// report the interruption.
#[test]
fn ctrl_c_ends_the_tour_through_a_library() {
    let desk = desk_with_library_file();
    desk.edit("rest.toml", "at_rest", "periodic");
    let library = "legbot.rwl";
    desk.run(&["library", "build", "legbot.toml", "-o", library]).succeeds();
    let mut command = desk.command(&["simulate", library, "--cycles", "10000", "--json"]);
    let program = Program::start(command.stdout(Stdio::piped()).stderr(Stdio::piped()));
    program.wait_for_words("armed");
    program.signal("INT");
    let outcome = program.ends();
    let said = &outcome.stderr;
    assert!(said.contains("returning to SAFE") && said.contains("disarmed"), "{said}");
    outcome.succeeds_with(130, &["\"stopped\": \"interrupted\""]);
}

#[test]
fn a_robot_on_the_ground_tells_how_far_it_went() {
    let desk = desk_with_shipped_files();
    desk.write(
        "drive.toml",
        "name = \"drive\"\nrobot = \"robots/agilebot.toml\"\nsafe = \"stand\"\n\
         [[motion]]\nname = \"stand\"\nfile = \"motions/stand.toml\"\ncode = 1\n\
         [[motion]]\nname = \"drive_1m\"\nfile = \"motions/drive_1m.toml\"\ncode = 2\n\
         [via_safe]\nduration_s = 1.2\nsamples = 25\n",
    );
    desk.make(&["library", "build", "drive.toml", "-o", "drive.rwl"]);
    let told = desk.run(&["simulate", "drive.rwl", "--json"]).succeeds();
    let told: Value = serde_json::from_str(&told).unwrap();
    let travels = told["travels"].as_array().unwrap();
    let names: Vec<_> = travels.iter().map(|travel| travel["name"].as_str().unwrap()).collect();
    let tour = ["stand", "stand → drive_1m", "drive_1m", "drive_1m → stand", "stand"];
    assert_eq!((names, &told["falls"]), (tour.to_vec(), &Value::Array(Vec::new())));
    let ahead_m = travels[2]["forward_m"].as_f64().unwrap();
    assert!((0.97..1.03).contains(&ahead_m), "{ahead_m}");
    let excursions = told["excursions"].as_array().unwrap();
    assert_eq!((excursions.len(), &excursions[0]["motions"][0]), (1, &"drive_1m".into()));
    let net_m = excursions[0]["forward_m"].as_f64().unwrap();
    let sum_m: f64 = travels[1..4].iter().map(|of| of["forward_m"].as_f64().unwrap()).sum();
    // The robot drives straight ahead.
    assert!((net_m - sum_m).abs() < 0.005, "{net_m} m from SAFE to SAFE, {sum_m} m in all");
    let heavy =
        desk.run(&["simulate", "drive.rwl", "--mass", "1.5", "--friction", "0.9", "--json"]);
    let heavy: Value = serde_json::from_str(&heavy.stdout).unwrap();
    let force_n = |of: &Value| of["travels"][2]["force_max_n"].as_f64().unwrap();
    assert!(force_n(&heavy) > 1.2 * force_n(&told), "{heavy}");
    desk.run(&["simulate", "drive.rwl", "--contact-stiffness", "2"])
        .fails(1, &["--contact-stiffness is for plans"]);
    desk.run(&["simulate", "drive.rwl", "--push", "4:0,100,0:0.2"])
        .succeeds_with(3, &["1 fall, the first after 4.", "waited for motion"]);
    desk.run(&["simulate", "drive.rwl", "--rate", "60"]).fails(1, &["--rate is for plans"]);
    desk.run(&["simulate", "drive.rwl", "--tracking"]).fails(1, &["--tracking is for plans"]);
    desk.run(&["simulate", "drive.rwl", "--world-log", "run.csv"]).succeeds();
    let driven_m = logged_way_m(&desk.read_text("run.csv"), "drive_1m");
    assert!(
        (driven_m - ahead_m).abs() < 0.002,
        "{driven_m} m in the log, {ahead_m} m in the table"
    );
    desk.run(&["plot", "run.csv", "-o", "run.svg"]).succeeds();
    let figure = desk.read_text("run.svg");
    for words in ["force along the normal", "rear_right", "drive_1m"] {
        assert!(figure.contains(words), "{words}");
    }
    desk.write("bad.csv", desk.read_text("run.csv").replacen(",0.0", ",x", 1));
    desk.run(&["plot", "bad.csv", "-o", "run.svg"]).fails(1, &["bad.csv: line 2, column `"]);
    desk.run(&["plot", "run.csv", "bad.csv", "-o", "x.svg"])
        .fails(1, &["draw the world log alone"]);
    // Without the columns of the figure.
    let base: Vec<_> = desk.read_text("run.csv").lines().map(first_cells).collect();
    desk.write("base.CSV", base.join("\n") + "\n");
    desk.run(&["plot", "base.CSV", "-o", "base.svg"]).succeeds();
    desk.run(&["plot", "drive.toml", "-o", "run.svg"]).fails(1, &["drive.toml is a library file"]);
    desk.run(&["simulate", "drive.rwl", "--world-log", "run.png"])
        .fails(1, &["cannot write a world log as run.png"]);
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    let on_stand = ["robots/agilebot.toml", "--bus", &bus, "--on", "stand"];
    Robot::refuses(&desk, &[&on_stand[..], &["--world-log", "run.csv"]].concat())
        .fails(1, &["--world-log is for a robot on the ground", "leave out one of"]);
    let twice = ["robots/agilebot.toml", "--bus", &bus, "--log", "one.csv", "--world-log"];
    Robot::refuses(&desk, &[&twice[..], &["one.csv"]].concat()).fails(1, &["one.csv"]);
    Robot::refuses(
        &desk,
        &["robots/agilebot.toml", "--bus", &bus, "--on", "stand", "--slope", "3"],
    )
    .fails(1, &["are for a robot on the ground, but this robot is on a stand", "--on stand"]);
    Robot::refuses(&desk, &["robots/test_leg.toml", "--bus", &bus])
        .fails(1, &["test_leg cannot stand on the ground: it has 1 feet and wheels", "--on stand"]);
    let robot = ["robots/agilebot.toml", "--world-log", "live.csv"];
    let mut robot = Robot::start_logged(&desk, &robot, &bus, "said.txt");
    on(&desk, &bus, &["flash", "drive.rwl"]).succeeds();
    on(&desk, &bus, &["send", "--arm", "drive_1m"]).succeeds();
    robot.stop();
    let said = desk.read_text("said.txt");
    let line = said.lines().find(|line| line.contains("drive_1m:")).expect(&said);
    let words: Vec<&str> = line.split_whitespace().collect();
    let ahead: f64 =
        words[words.iter().position(|word| *word == "ahead,").unwrap() - 2].parse().unwrap();
    assert!((0.97..1.03).contains(&ahead), "{line}");
    assert!(!said.contains("fell"), "{said}");
    assert!(said.contains("s  from SAFE to SAFE with drive_1m: "), "{said}");
    // Other lines than events begin with a word.
    let times: Vec<f64> =
        said.lines().filter_map(|line| line.split_once(" s  ")?.0.trim().parse().ok()).collect();
    assert!(times.len() > 5 && times.is_sorted(), "{said}");
    let driven_m = logged_way_m(&desk.read_text("live.csv"), "drive_1m");
    assert!((driven_m - ahead).abs() < 0.002, "{driven_m} m in the log, {line}");
}

/// Returns the cells of a line that every log has.
fn first_cells(line: &str) -> String {
    line.split(',').take(17).collect::<Vec<_>>().join(",")
}

/// Returns the displacement of the centre of mass along x during a motion in a log of the world, m. Every line must have a cell
/// for each column.
fn logged_way_m(log: &str, motion: &str) -> f64 {
    let mut lines = log.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let heading = lines.next().expect("a heading");
    let column = |name| heading.iter().position(|cell| *cell == name).expect("the column");
    let (name, com) = (column("motion"), column("com_x_m"));
    let rows: Vec<_> = lines.inspect(|row| assert_eq!(row.len(), heading.len())).collect();
    let mut playing = rows.iter().filter(|row| row[name] == motion);
    let [first, last] = [playing.next(), playing.next_back()];
    let com_m =
        |row: Option<&Vec<&str>>| row.expect("it is played")[com].parse::<f64>().expect("a number");
    com_m(last) - com_m(first)
}
