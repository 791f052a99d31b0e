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
    explore(&["-o", "whole"]).succeeds_with(0, &["8 rows, 8 of which hold", "results.csv"]);
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
    explore(&["-o", "whole"]).fails(1, &["is a journal of other work", "give another folder"]);
}

#[test]
fn the_motors_of_table_3_2_are_an_axis() {
    let desk = desk();
    let args = ["design", "explore", "designs/table_3_2_sweep.toml", "-o", "table"];
    desk.run(&args).succeeds_with(0, &["4 rows, 4 of which hold"]);
    let table = desk.read_text("table/results.csv");
    let motors: Vec<&str> =
        table.lines().skip(1).map(|line| line.split(',').nth(1).unwrap()).collect();
    assert_eq!(motors, ["2", "3", "4", "5"]);
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
