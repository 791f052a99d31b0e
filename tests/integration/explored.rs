//! Tests of sweeps over designs: resumed, split into shards, and run by engines.

use crate::{checkout, copy_shipped_files, desk_with_programs};
use rollwalk_tests::Desk;

fn desk() -> Desk {
    let desk = desk_with_programs();
    copy_shipped_files(&desk);
    desk.copy_folder(&checkout().join("shipped/designs"), "designs");
    desk
}

fn small(desk: &Desk) {
    let text = desk.read_text("designs/agilebot_legs_sweep.toml");
    let text = text.replace("points = 6", "points = 2").replace("0.08, 0.09", "0.08");
    desk.write("designs/small.toml", text.replace(", \"../motions/walk.toml\"", ""));
}

#[test]
fn shards_and_interrupted_sweeps_come_to_the_tables_of_the_whole() {
    let desk = desk();
    small(&desk);
    let explore =
        |rest: &[&str]| desk.run(&[&["design", "explore", "designs/small.toml"], rest].concat());
    explore(&["-o", "whole"])
        .succeeds_with(0, &["8 rows; 8 motions pass the simulation", "results.csv"]);
    let first = explore(&["-o", "parts", "--shard", "1/2"]);
    first.succeeds_with(0, &["2 of 4 chains are left"]);
    // A run that was killed within a line continues.
    let journal = "parts/sweep.journal-1-of-2.jsonl";
    let text = desk.read_text(journal);
    desk.write(journal, &text[..text.len() - 10]);
    explore(&["-o", "parts", "--shard", "1/2"]).succeeds_with(0, &["2 of 4 chains are left"]);
    explore(&["-o", "parts", "--shard", "2/2"]).succeeds_with(0, &["8 rows"]);
    for table in ["results.csv", "results.svg"] {
        assert_eq!(
            desk.read(&format!("whole/{table}")),
            desk.read(&format!("parts/{table}")),
            "{table}"
        );
    }
    // Another figure needs no planning.
    let figure = desk.read_text("whole/results.svg");
    assert!(figure.contains("front_thigh, m") && figure.contains("MX-64AT"), "{figure}");
    let other = ["-o", "whole", "--plot", "peak_joint_torque_nm"];
    explore(&other).succeeds_with(0, &["results.svg"]);
    assert!(desk.read_text("whole/results.svg").contains("peak_joint_torque, N·m"));
    explore(&["-o", "whole", "--plot", "torque"]).fails(2, &["give one of plan_cost, "]);
    desk.edit("designs/small.toml", "points = 2", "points = 3");
    explore(&["-o", "whole"]).fails(1, &["is the journal of another run", "give another folder"]);
}

#[test]
fn the_motors_of_table_3_2_are_an_axis() {
    let desk = desk();
    let args = ["design", "explore", "designs/table_3_2_sweep.toml", "-o", "table"];
    desk.run(&args).succeeds_with(0, &["4 rows; 4 motions pass the simulation"]);
    let table = desk.read_text("table/results.csv");
    let motors: Vec<&str> =
        table.lines().skip(1).map(|line| line.split(',').nth(1).unwrap()).collect();
    assert_eq!(motors, ["2", "3", "4", "5"]);
}

const DATASET: &str = r#"
name = "trots"
[[axis]]
name = "robot"
robots = [ { name = "agilebot", robot = "../robots/agilebot.toml", motions = ["../motions/trot.toml"] } ]
[[axis]]
motion_value = "goal.turn_rad"
values = [0.0, 0.1]
[[axis]]
motion_value = "goal.forward_m"
values = [0.14, 0.16, 1000.0]
[dataset]
rate_hz = 50
length_s = 2
"#;

#[test]
fn datasets_have_a_file_for_each_motion_that_holds_in_any_split() {
    let desk = desk();
    desk.write("designs/trots.toml", DATASET);
    let explore =
        |rest: &[&str]| desk.run(&[&["design", "explore", "designs/trots.toml"], rest].concat());
    let whole = explore(&["-o", "whole"]);
    // Two of the goals are beyond what a motion file may ask for.
    assert!(whole.stderr.contains("planned 4 motions in "), "{}", whole.stderr);
    assert!(whole.stderr.contains(" per second and core"), "{}", whole.stderr);
    whole.succeeds_with(
        0,
        &["wrote 4 motions into whole/motions", "6 rows; 4 motions pass the simulation"],
    );
    let table = desk.read_text("whole/results.csv");
    let files: Vec<&str> =
        table.lines().skip(1).map(|line| line.rsplit_once(',').unwrap().1).collect();
    let of = |point: u32| format!("motions/{point:06}_trot.npz");
    assert_eq!(files, [&of(0), &of(1), "", &of(3), &of(4), ""]);
    assert!(table.starts_with("point,robot,goal.turn_rad,goal.forward_m,motion,"), "{table}");
    explore(&["-o", "parts", "--shard", "2/2"]).succeeds_with(0, &["1 of 2 chains are left"]);
    assert!(!desk.path("parts").join(of(0)).exists());
    explore(&["-o", "parts", "--shard", "1/2"]).succeeds_with(0, &["6 rows"]);
    for file in ["results.csv", &of(0), &of(1), &of(3), &of(4)] {
        let [one, other] = ["whole", "parts"].map(|folder| desk.read(&format!("{folder}/{file}")));
        assert!(one == other, "{file}");
    }
    // 101 frames of two seconds.
    let motion = desk.read(&format!("whole/{}", of(0)));
    let text = String::from_utf8_lossy(&motion);
    assert!(text.contains("'shape': (101, "), "{}", motion.len());
}

#[test]
fn faults_of_datasets_are_named() {
    let desk = desk();
    for (from, to, words) in [
        ("goal.forward_m", "goal.ahead_m", &["trot.toml", "no `ahead_m`", "forward_m"][..]),
        ("rate_hz = 50", "rate_hz = 0", &["`rate_hz`", "1 to 10000 Hz"]),
        ("rate_hz = 50", "", &["`rate_hz`", "missing"]),
        ("length_s = 2", "length_s = 9000", &["`length_s`", "0.1 to 3600 s"]),
        ("length_s = 2", "lenght_s = 2", &["unknown key `lenght_s`"]),
        ("values = [0.0, 0.1]", "values = []", &["`values`", "1 to 10000 finite numbers"]),
    ] {
        desk.write("designs/trots.toml", DATASET.replacen(from, to, 1));
        desk.run(&["design", "explore", "designs/trots.toml", "-o", "out"])
            .fails(1, &[&["designs/trots.toml"], words].concat());
        assert!(!desk.path("out").exists());
    }
}

#[test]
fn jobs_of_engines_are_written() {
    let desk = desk();
    small(&desk);
    let on = |engine: &str| {
        let args = ["design", "explore", "designs/small.toml", "-o", "out", "--shards", "4"];
        desk.run(&[&args[..], &["--on", engine, "--dry-run"]].concat())
    };
    on("slurm").succeeds_with(0, &["next: sbatch --parsable --wait out/slurm.sh"]);
    assert!(desk.read_text("out/slurm.sh").contains("#SBATCH --array=0-3"));
    on("kubernetes").succeeds_with(0, &["next: kubectl apply -f out/kubernetes.yaml"]);
    on("parallel").succeeds_with(0, &["next: sh out/parallel.sh"]);
    assert!(desk.read_text("out/parallel.sh").contains("--shard {}/4"));
    let alone = ["design", "explore", "designs/small.toml", "-o", "out", "--shards", "4"];
    desk.run(&alone).fails(1, &["neither by Slurm nor by Kubernetes", "--shard K/N"]);
    let wrong = ["design", "explore", "designs/small.toml", "-o", "out", "--shard", "3/2"];
    desk.run(&wrong).fails(2, &["`3/2` is not a shard"]);
}

#[test]
fn a_motion_of_a_sweep_may_name_its_terrain() {
    let desk = desk();
    desk.write("motions/kerb.toml", "[step]\nat_x_m = 0.5\nheight_m = 0.015\n");
    let drive = desk.read_text("motions/drive_1m.toml").replacen("= 25", "= 60", 1);
    desk.write("motions/over.toml", format!("terrain = \"kerb.toml\"\n{drive}"));
    desk.write(
        "designs/kerb.toml",
        "name = \"kerbs\"\n[[axis]]\nname = \"robot\"\nrobots = [{ name = \"agilebot\", \
         robot = \"../robots/agilebot.toml\", motions = [\"../motions/over.toml\"] }]\n",
    );
    desk.run(&["design", "explore", "designs/kerb.toml", "-o", "kerb"])
        .succeeds_with(0, &["1 rows; 1 motions pass the simulation"]);
}
