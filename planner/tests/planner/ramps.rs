//! Swings over ramps and edges, as the report judges them.

use rollwalk_multibody::ground::file::from_toml;
use rollwalk_planner::families::Family;
use rollwalk_planner::motion::Motion;
use rollwalk_planner::report::{Grid, Judgement, Report};
use rollwalk_planner::{Options, optimise};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

/// Walk of LegBot, on point feet.
const WALK: &str = "name = \"up\"\nrobot = \"legbot.toml\"\nterrain = \"terrain.toml\"\n\
    ends = \"at_rest\"\nduration_s = 5.6\nsamples = 167\nswing_height_m = 0.03\n\
    [footfalls]\ngait = \"walk\"\nduty = 0.8\ncycles = 3\n\
    [goal]\nforward_m = 0.3\nleft_m = 0.0\nturn_rad = 0.0\n";

/// Depth in swing as played at 500 Hz, and its tolerance, mm.
fn depth_mm(report: &Report) -> [f64; 2] {
    let row = report.row(Family::SwingDepth, Grid::Control500Hz).expect("feet swing");
    [row.worst, row.level.expect("a tolerance")]
}

#[test]
fn a_ramp_is_walked_up_and_an_edge_in_its_place_is_cut() {
    let robot =
        Robot::from_toml("legbot.toml", include_str!("../../../shipped/robots/legbot.toml"));
    let robot = robot.unwrap();
    let on = |terrain: &str| {
        let terrain = from_toml("terrain.toml", terrain).unwrap();
        Motion::from_toml_on("up.toml", WALK, &robot, Some(&terrain)).unwrap()
    };
    let ramp = on("[ramp]\nfrom_x_m = 0.25\nlength_m = 0.24\nheight_m = 0.04");
    let options = Options { refine: false, ..Options::default() };
    let mut plan = optimise(&robot, &ramp, &options, &mut |_| ControlFlow::Continue(()));
    let report = Report::new(&plan);
    assert_eq!(report.judgement, Judgement::Consistent, "{report}");
    // Feet come down to the ramp, not to a ground that is higher by the slope times the reach of a swing: 6 mm.
    let [depth_mm, _] = depth_mm(&report);
    assert!(depth_mm < 1.5, "{report}");
    // Feet carry the goal; without the cost of a lean at the end they move by 0.25 m.
    let carried = report.taken_back.expect("a goal at rest");
    assert!(carried.field == "forward_m" && (carried.left / 0.3 - 1.0).abs() < 0.01, "{carried}");

    // The same swings, over a riser at the foot of the ramp.
    plan.motion.ground = on("[step]\nat_x_m = 0.25\nheight_m = 0.04").ground;
    let report = Report::new(&plan);
    let [depth_mm, tolerance_mm] = self::depth_mm(&report);
    assert!(depth_mm > 2.0 * tolerance_mm, "{report}");
    // A foot just behind the face of the riser is as deep as it is below the tread.
    let feet = plan.samples.iter().flat_map(|sample| &sample.end_effectors);
    let behind = feet.filter(|foot| !foot.contact && foot.position_m[0] > 0.25);
    let deepest_mm = behind.map(|foot| 1e3 * (0.04 - foot.position_m[2])).fold(0.0, f64::max);
    let row = report.row(Family::SwingDepth, Grid::Samples).expect("feet swing");
    assert!((row.worst - deepest_mm).abs() < 1e-9, "{} mm, not {deepest_mm} mm", row.worst);
}
