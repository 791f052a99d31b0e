//! Sweeps: their order, their parts, their journals, their tables.

use super::journal::{Chain, Header, Journal, line};
use super::*;
use crate::goal::Quantity;
use rollwalk_planner::Progress;
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

fn read(path: &str) -> NamedText {
    let at = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path);
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

fn ready(text: &str) -> Result<Ready, DocumentError> {
    let motion = read("motions/car_drive.toml");
    let design = Designed::new(
        &read("designs/car_tilted.toml"),
        read("robots/car_tilted.toml"),
        vec![motion.clone()],
    )?;
    let file = NamedText { name: "sweep.toml".to_owned(), text: text.to_owned() };
    let files = Files::from([("car_drive.toml".to_owned(), motion)]);
    Ready::new(&file, Some(design), files, Catalog::shipped())
}

fn on(_: &str, _: &Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
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
            "`height`, no parameter of the design",
            "front_height, rear_height",
        ),
        ("-0.02", "-0.2", "goes to -0.2, outside its bounds", "-0.07 to -0.01"),
        ("AX-12A", "AX-12", "`AX-12`, not in the catalogue", "AX-12A"),
        ("xm430_drive", "xm430", "no `xm430`", "xm430_drive"),
        ("name = \"gait\"", "name = \"servo\"", "`servo` is there twice", "a name of its own"),
        ("design = \"car.toml\"\n", "", "one of them is needed", "give `design`"),
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
fn a_sweep_in_parts_torn_and_taken_up_again_has_the_bytes_of_one_that_was_not() {
    let ready = ready(SWEEP).unwrap();
    let header = Header {
        sweep: "small".into(),
        digest: String::new(),
        version: String::new(),
        chains: 2,
        axes: ready.sweep.axes.iter().map(|axis| axis.name().to_owned()).collect(),
    };
    let chain = |chain| line(&Chain { chain, rows: ready.chain(chain, &mut on).unwrap() });
    let whole = Journal::read(&(line(&header) + &chain(0) + &chain(1))).unwrap();
    assert_eq!(whole.missing().count(), 0);
    let bytes = |journal: &Journal| {
        let rows: Vec<&Row> = journal.rows().collect();
        let csv = table::csv(&header.axes, &rows).unwrap();
        (csv, table::parquet(&header.axes, &rows).unwrap())
    };
    // A chain goes on behind a point that it cannot plan. The wheels of the other servo are too slow.
    let held: Vec<bool> = whole.rows().map(|row| row.holds).collect();
    assert_eq!(held, [true, false, true, false, false, false], "{:?}", whole.rows().next());
    let lost = whole.rows().nth(1).unwrap();
    assert!(lost.status == "infeasible" && lost.reason.contains("contradict"), "{lost:?}");
    assert_eq!(lost.quantities, vec![None; Quantity::ALL.len()]);

    let one = line(&header) + &chain(1);
    let torn = one.clone() + &chain(0)[..40];
    let mut parts = Journal::read(&torn).unwrap();
    assert_eq!((parts.whole, parts.missing().collect::<Vec<_>>()), (one.len(), vec![0]));
    parts.merge(Journal::read(&(line(&header) + &chain(0))).unwrap());
    assert_eq!(bytes(&parts), bytes(&whole));
    let (csv, parquet) = bytes(&whole);
    let csv = String::from_utf8(csv).unwrap();
    assert!(
        csv.starts_with("point,servo,front_height,gait,motion,status,holds,iterations,plan_cost")
    );
    assert_eq!(csv.lines().count(), 7);
    assert!(parquet.starts_with(b"PAR1") && parquet.ends_with(b"PAR1"));
    assert_eq!(Journal::read("no journal\n"), None);
}
