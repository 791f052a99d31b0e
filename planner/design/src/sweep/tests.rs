//! Tests of sweeps: order, chains, tables and figures.

use super::picture::Field::{Absent, Holds, Lost};
use super::picture::{Kind, Picture};
use super::*;
use crate::goal::Quantity;
use rollwalk_planner::Progress;
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

fn read(path: &str) -> NamedText {
    let at = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shipped").join(path);
    NamedText { name: path.to_owned(), text: fs::read_to_string(at).unwrap() }
}

const SWEEP: &str = r#"
name = "small"
design = "car.toml"
[[axis]]
name = "servo"
actuator = "xm430_drive"
servos = ["XM430-W210-T", "AX-12A"]
[[axis]]
parameter = "front_height"
values = [-0.0447, -0.02, -0.0446]
[[axis]]
name = "gait"
motions = ["car_drive.toml"]
"#;

fn ready(text: &str) -> Result<LoadedSweep, DocumentError> {
    let motion = read("motions/car_drive.toml");
    let design = Designed::new(
        &read("designs/car_tilted.toml"),
        read("robots/car_tilted.toml"),
        vec![motion.clone()],
    )?;
    let file = NamedText { name: "sweep.toml".to_owned(), text: text.to_owned() };
    let motions = [("car_drive.toml".to_owned(), motion.into())].into();
    let files = Files { motions, ..Files::default() };
    LoadedSweep::new(&file, Some(design), files, Catalog::shipped())
}

fn on(_: &str, _: &Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

#[test]
fn a_motion_is_planned_on_the_terrain_that_it_names() {
    let kerb = "[step]\nat_x_m = 0.5\nheight_m = 0.015";
    let terrain = rollwalk_multibody::ground::file::from_toml("kerb.toml", kerb).unwrap();
    let mut file = read("motions/drive_1m.toml");
    file.text = format!("terrain = \"kerb.toml\"\n{}", file.text);
    let motion = MotionFile { file, terrain: Some(terrain) };
    let designed = Designed::fixed(read("robots/agilebot.toml"), vec![motion]).unwrap();
    let variant = designed.at(&[]).unwrap();
    assert_eq!(variant.motions[0].terrain.as_ref().map(|of| of.toml.as_str()), Some(kerb));
}

#[test]
fn points_are_counted_along_the_axes_the_last_parameter_fastest() {
    let sweep = Sweep::from_toml("sweep.toml", SWEEP).unwrap();
    assert_eq!((sweep.chains(), sweep.chain_len(), sweep.inner()), (2, 3, Some(1)));
    assert_eq!(sweep.start(1), [1, 0, 0]);
    let text =
        SWEEP.replace("values = [-0.0447, -0.02, -0.0446]", "from = 0.1\nto = 0.2\npoints = 3");
    let Axis::Parameter { values, .. } = &Sweep::from_toml("s", &text).unwrap().axes[1] else {
        panic!()
    };
    assert_eq!(*values, [0.1, 0.15, 0.2]);
}

#[test]
fn faults_say_what_would_be_right() {
    for (from, to, problem, help) in [
        (
            "front_height",
            "height",
            "`height`, which is not a parameter of the design",
            "front_height, rear_height",
        ),
        ("-0.02", "-0.2", "takes the value -0.2, outside its bounds", "-0.07 to -0.01"),
        ("AX-12A", "AX-12", "`AX-12`, which is not in the catalogue", "AX-12A"),
        ("xm430_drive", "xm430", "no `xm430`", "xm430_drive"),
        (
            "name = \"gait\"",
            "name = \"servo\"",
            "is `servo`, the name of an earlier axis",
            "its own name",
        ),
        ("design = \"car.toml\"\n", "", "or an axis with robots is required", "give `design`"),
        ("values = [-0.0447, -0.02, -0.0446]", "values = []", "`values`", ""),
    ] {
        let error = ready(&SWEEP.replace(from, to)).unwrap_err();
        let all: Vec<String> =
            error.faults().map(|fault| format!("{fault} {}", fault.help)).collect();
        let found = all.join("\n");
        assert!(found.contains(problem) && found.contains(help), "{to}: {found}");
    }
}

#[test]
fn chains_go_on_behind_points_that_cannot_be_planned_into_tables_and_figures() {
    let ready = ready(SWEEP).unwrap();
    let chain = |chain| ready.chain(chain, &mut on, &mut |_, _, _| String::new()).unwrap();
    let all: Vec<Row> = (0..2).flat_map(chain).collect();
    let rows: Vec<&Row> = all.iter().collect();
    // The wheels of the other servo are too slow.
    let held: Vec<bool> = rows.iter().map(|row| row.holds).collect();
    assert_eq!(held, [true, false, true, false, false, false], "{:?}", rows[0]);
    assert!(
        rows[1].status == "infeasible" && rows[1].reason.contains("contradict"),
        "{:?}",
        rows[1]
    );
    assert_eq!(rows[1].quantities, vec![None; Quantity::ALL.len()]);

    let axes: Vec<String> = ready.sweep.axes.iter().map(|axis| axis.name().to_owned()).collect();
    let csv = String::from_utf8(table::csv(&axes, &rows, false).unwrap()).unwrap();
    assert!(
        csv.starts_with("point,servo,front_height,gait,motion,status,holds,iterations,plan_cost")
    );
    assert_eq!(csv.lines().count(), 7);

    let of = |name| Quantity::ALL.into_iter().find(|of| of.bound == name);
    let picture = Picture::of(&ready, &rows, of("plan_cost"));
    let Kind::Lines { x, at, series } = picture.kind else { panic!("{picture:?}") };
    assert_eq!((x.as_str(), at), ("front_height, m", vec![-0.0447, -0.02, -0.0446]));
    let names: Vec<&str> = series.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["XM430-W210-T", "AX-12A"]);
    let cost = |row: usize| Holds(rows[row].quantities[0].unwrap());
    assert_eq!(series[0].1, [cost(0), Lost, cost(2)]);
    assert_eq!(series[1].1, [Lost; 3]);
}

/// Rows of a sweep with the index of the point as the cost. Points in `lost` fail the checks.
fn rows(ready: &LoadedSweep, motions: &[&str], lost: &[u64]) -> Vec<Row> {
    let sweep = &ready.sweep;
    let mut rows = Vec::new();
    for point in 0..(sweep.chains() * sweep.chain_len()) as u64 {
        let mut at = sweep.start(point as usize / sweep.chain_len());
        if let Some(inner) = sweep.inner() {
            at[inner] = point as usize % sweep.chain_len();
        }
        let labels: Vec<String> =
            sweep.axes.iter().zip(&at).map(|(axis, &at)| axis.label(at)).collect();
        rows.extend(motions.iter().map(|motion| Row {
            point,
            labels: labels.clone(),
            motion: (*motion).to_owned(),
            status: String::new(),
            holds: !lost.contains(&point),
            reason: String::new(),
            iterations: 0,
            quantities: vec![Some(point as f64); Quantity::ALL.len()],
            file: String::new(),
        }));
    }
    rows
}

#[test]
fn two_parameters_make_maps_and_what_lies_behind_them_is_the_best() {
    let with = |more: &str| ready(&format!("{SWEEP}{more}")).unwrap();
    let axis = |values: &str| format!("[[axis]]\nparameter = \"rear_height\"\nvalues = {values}\n");
    // Chains along the two heights of the rear; two servos, three heights in front.
    let ready = with(&axis("[-0.03, -0.02]"));
    let all = rows(&ready, &["car_drive"], &[2, 3]);
    let Kind::Maps { axes, at, panels } =
        Picture::of(&ready, &all.iter().collect::<Vec<_>>(), None).kind
    else {
        panic!()
    };
    assert_eq!(axes, ["front_height, m", "rear_height, m"]);
    assert_eq!(at[1], [-0.03, -0.02]);
    assert_eq!(panels[0].0, "XM430-W210-T");
    let row = |a, b| vec![Holds(a), Holds(b)];
    assert_eq!(panels[0].1, [row(0.0, 1.0), vec![Lost; 2], row(4.0, 5.0)]);
    assert_eq!(panels[1].1[2], row(10.0, 11.0));
}

#[test]
fn choices_alone_stand_side_by_side() {
    let text = SWEEP.replace(
        "[[axis]]\nparameter = \"front_height\"\nvalues = [-0.0447, -0.02, -0.0446]\n",
        "",
    );
    let ready = ready(&text).unwrap();
    let all = rows(&ready, &["car_drive"], &[1]);
    let picture = Picture::of(&ready, &all.iter().collect::<Vec<_>>(), None);
    let Kind::Choices { axis, labels, series } = picture.kind else { panic!("{picture:?}") };
    assert_eq!(
        (axis.as_str(), labels),
        ("servo", vec!["XM430-W210-T".to_owned(), "AX-12A".to_owned()])
    );
    assert_eq!(series, [("car_drive".to_owned(), vec![Holds(0.0), Lost])]);
    // Motions that some robots lack are kept. A missing robot loses all its motions.
    let mut all = rows(&ready, &["car_drive"], &[]);
    all[1].motion = "car_turn".to_owned();
    let series = |all: &[Row]| match Picture::of(&ready, &all.iter().collect::<Vec<_>>(), None).kind
    {
        Kind::Choices { series, .. } => series,
        other => panic!("{other:?}"),
    };
    let [drive, turn] = ["car_drive", "car_turn"].map(str::to_owned);
    assert_eq!(
        series(&all),
        [(drive.clone(), vec![Holds(0.0), Absent]), (turn, vec![Absent, Holds(1.0)])]
    );
    (all[1].motion, all[1].holds) = (String::new(), false);
    assert_eq!(series(&all), [(drive, vec![Holds(0.0), Lost])]);
}
