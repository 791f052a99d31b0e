//! Tests of design files and their faults.

use super::*;
use crate::text::RobotText;

const DESIGN: &str = r#"
name = "agilebot_legs"
robot = "../robots/agilebot.toml"
motions = [ { file = "walk.toml" }, { file = "turn_in_place.toml", weight = 0.5 } ]

[[parameter]]
name = "thigh"
length_of = "leg/*_thigh"
min_m = 0.09
max_m = 0.16
step_m = 0.001

[[parameter]]
name = "track"
mount = "leg.y"
min_m = 0.07
max_m = 0.12
"#;

fn faults(text: &str) -> Vec<String> {
    let read = DesignFile::from_toml("design.toml", text);
    let checked = read.and_then(|design| {
        let mut robot =
            RobotText::new(include_str!("../../../../shipped/robots/agilebot.toml")).unwrap();
        design.check("design.toml", text, |place| robot.value(place))
    });
    checked.unwrap_err().faults().map(|fault| format!("{fault}; {}", fault.help)).collect()
}

#[test]
fn a_design_has_parameters_within_bounds() {
    let design = DesignFile::from_toml("design.toml", DESIGN).unwrap();
    assert_eq!(
        design.motions[1],
        WeightedMotion { file: "turn_in_place.toml".into(), weight: 0.5 }
    );
    assert_eq!(design.parameters[0].step, Some(0.001));
    assert_eq!(design.repair_pull, None);
    let pulled = DesignFile::from_toml("design.toml", &format!("{DESIGN}[repair]\npull = 1e-2\n"));
    assert_eq!(pulled.unwrap().repair_pull, Some(1e-2));
    assert_eq!(design.parameters[1].place.axis, Some(Axis::Y));
    let mut robot =
        RobotText::new(include_str!("../../../../shipped/robots/agilebot.toml")).unwrap();
    assert_eq!(
        design.check("design.toml", DESIGN, |place| robot.value(place)).unwrap(),
        [0.12, 0.08]
    );
}

#[test]
fn faults_say_what_would_be_right() {
    let wrong = |from: &str, to: &str| faults(&DESIGN.replace(from, to)).join("\n");
    let expected = [
        (
            "leg/*_thigh",
            "leg/*_thig",
            "the robot has no `leg/*_thig` to change; give one of *_hip, *_thigh",
        ),
        (
            "leg.y",
            "leg",
            "is \"leg\", without a coordinate; add the coordinate: `leg.x`, `.y` or `.z`",
        ),
        ("min_m = 0.09", "min_m = 0.2", "`max_m` is 0.16, not above `min_m` = 0.2"),
        (
            "min_m = 0.09",
            "min_m = 0.13",
            "is 0.12 m, outside its bounds 0.13 to 0.16; widen the bounds to include 0.12 m, the value in the file",
        ),
        (
            "min_m = 0.09\nmax_m = 0.16",
            "min_m = 90\nmax_m = 160",
            "outside its bounds 90 to 160; widen the bounds to include 0.12 m, the value in the file; 90 mm would be 0.09 m",
        ),
        ("min_m = 0.07", "min_rad = 0.07", "unknown key `min_rad`"),
        ("mount = \"leg.y\"\n", "", "changes nothing; give exactly one of length_of, joint, mount"),
        (
            "mount = \"leg.y\"",
            "length_of = \"leg/*_thigh\"",
            "changes the same value as `thigh`; leave out one of the two parameters",
        ),
        (
            "min_m = 0.09",
            "min_m = 0",
            "`min_m` is 0; expected a value above 0; give the smallest value",
        ),
        ("step_m = 0.001", "step_m = 0", "`step_m` must be at least 0.000001"),
        ("step_m = 0.001", "step_m = 1e-9", "`step_m` must be at least 0.000001"),
        (
            "step_m = 0.001",
            "step_m = 1",
            "`step_m` is 1, more than the range of 0.070000; give a smaller step",
        ),
        (
            "mount = \"leg.y\"",
            "mount = \"leg.y\"\nradius_of = \"leg/*\"",
            "`radius_of` stands beside `mount`; give exactly one of length_of, joint, mount",
        ),
        ("leg/*_thigh", "*_thigh", "or TEMPLATE/*_thigh for parts of a template"),
        ("weight = 0.5", "weight = -1", "`weight` is -1"),
        ("max_m = 0.12\n", "max_m = 0.12\n[repair]\npull = 0\n", "`pull` is 0"),
        ("max_m = 0.12\n", "max_m = 0.12\n[repair]\n", "`pull` is missing"),
    ];
    for (from, to, part) in expected {
        let found = wrong(from, to);
        assert!(found.contains(part), "{to}: {found}");
    }
    let found = faults("name = \"none\"\nrobot = \"r.toml\"\n").join("\n");
    assert!(found.contains("`parameter` is missing"), "{found}");
}
