//! Tests of faults in a robot file as a document: syntax, keys, types, invalid numbers.

use super::*;

#[test]
fn text_that_is_not_toml() {
    let found = faults("mass_kg = 1.0", "mass_kg = ");
    assert_eq!(found[0].0, 13, "{found:#?}");
    assert!(found[0].1.contains("not TOML"), "{found:#?}");
    let found = faults("mass_kg = 1.0", "mass_kg = 1.0\nmass_kg = 2.0");
    assert_eq!(found[0].0, 14, "{found:#?}");
}

#[test]
fn unknown_keys_and_tables() {
    assert_fault(
        "bus = 0\nid = 2",
        "bus = 0\nid = 2\nradus_m = 1",
        "radus_m",
        "end effector `wheel`: unknown key `radus_m`",
        "did you mean `radius_m`?",
    );
    assert_fault(
        "[[end_effector]]",
        "[colour]\nred = 1\n[[end_effector]]",
        "[colour]",
        "unknown key `colour`",
        "`limb`",
    );
    assert_fault(
        "kp_nm_rad = 50.0",
        "kp_nm_rad = 50.0\nki = 1",
        "ki",
        "actuator `servo`: unknown key `ki`",
        "valid names: `servo`, `model`",
    );
    assert_fault(
        "box_m = [0.02, 0.02, 0.2] },\n",
        "box_m = [0.02, 0.02, 0.2], colour = 1 },\n",
        "  { mass_kg = 0.1",
        "unknown key `colour`",
        "valid names: `mass_kg`",
    );
    // Limbs give the addresses of their motors, the template must not.
    assert_fault(
        "nominal_rad = 0.1",
        "nominal_rad = 0.1\nid = 3",
        "id = 3",
        "joint `*_hip`: unknown key `id`",
        "`actuator`",
    );
}

#[test]
fn missing_fields() {
    assert_fault(
        "radius_m = 0.03\n",
        "",
        "[[end_effector]]",
        "end effector `wheel`: `radius_m` is missing",
        "give `radius_m`, a number",
    );
    assert_fault("name = \"tiny\"\n", "", "", "`name` is missing", "a string in quotes");
    assert_fault(
        "model = \"S1\"\n",
        "",
        "[actuator.servo]",
        "actuator `servo`: `model` is missing",
        "give `model`",
    );
    assert_fault(
        "mass_kg = 1.0\ncom_in_link_m = [0.0, 0.0, 0.0]\ninertia_in_link_kg_m2 = [0.01, 0.02, 0.02, 0.0, 0.0, 0.0]\n",
        "",
        "[[link]]",
        "link `body`: `parts` is missing",
        "`inertia_in_link_kg_m2`",
    );
    assert_fault(
        ", box_m = [0.02, 0.02, 0.2] },\n",
        " },\n",
        "  { mass_kg = 0.1",
        "`shape` must be given once",
        "one of `box_m = [x, y, z]`",
    );
    assert_fault(
        "side = \"left\"\n",
        "",
        "[[limb]]",
        "limb `left`: `side` is missing",
        "give `side`, \"left\" or \"right\"",
    );
}

/// A similar key, or one in another unit, explains why a key is missing: one fault with the value to give.
#[test]
fn keys_in_another_unit_are_one_fault() {
    for (from, to, help) in [
        ("position_min_rad = -0.5", "position_min_deg = -30", "give `position_min_rad = -0.5236`"),
        ("radius_m = 0.03", "radius_mm = 30", "give `radius_m = 0.03`"),
        (
            "origin_in_parent_m = [0.0, 0.02, 0.0]",
            "origin_in_parent_mm = [0, 20, 0]",
            "give `origin_in_parent_m = [0, 0.02, 0]`",
        ),
        ("kp_nm_rad = 50.0", "kp_nm_deg = 0.9", "give `kp_nm_rad = 51.566`"),
        ("radius_m = 0.03", "radius_mm = \"30\"", "give `radius_m`, in its unit"),
        ("radius_m = 0.03", "radus_m = 0.03", "did you mean `radius_m`?"),
        ("radius_m = 0.03", "radius = 0.03", "did you mean `radius_m`?"),
    ] {
        let key = to.split(' ').next().unwrap();
        assert_fault(from, to, key, &format!("unknown key `{key}`"), help);
    }
}

/// Labels state why a value is wrong, not the type that it rightly has.
#[test]
fn labels_name_the_bound_that_a_value_exceeds() {
    for (from, to, label) in [
        ("id = 1\n", "id = 500\n", "above 127"),
        ("id = 1\n", "id = -1\n", "below 0"),
        ("id = 1\n", "id = 1.5\n", "this value has type float"),
        (
            "axis_in_joint = [0.0, 2.0, 0.0]",
            "axis_in_joint = [0.0, 2.0]",
            "this array has 2 entries",
        ),
    ] {
        let error = Robot::from_toml("tiny.toml", &ROBOT.replacen(from, to, 1)).unwrap_err();
        let labels: Vec<_> = error.faults().map(|fault| fault.label.as_str()).collect();
        assert_eq!(labels, [label], "{to}");
    }
}

#[test]
fn all_mistakes_are_found_at_once_and_none_in_their_train() {
    let text = ROBOT
        .replacen("name = \"arm\"", "nam = \"arm\"", 1)
        .replacen("kp_nm_rad = 50.0", "kp_nm_rad = \"50\"", 1)
        .replacen("link = \"arm\"", "link = \"amr\"", 1)
        .replacen("template = \"leg\"", "template = \"lag\"", 2)
        .replacen("nominal_rad = 0.1", "nominal_rad = nan", 1);
    let error = Robot::from_toml("tiny.toml", &text).unwrap_err();
    let found: Vec<_> = error.faults().map(|fault| fault.message.as_str()).collect();
    // Names are resolved after all items have names; the template then contains no limb.
    assert_eq!(
        found,
        [
            "actuator `servo`: `kp_nm_rad` must be a finite number",
            "link number 2: unknown key `nam`, and `name` is missing",
            "joint `*_hip`: `nominal_rad` must be a finite number",
        ]
    );
}

#[test]
fn wrong_types() {
    assert_fault(
        "mass_kg = 1.0",
        "mass_kg = \"1.0\"",
        "mass_kg",
        "link `body`: `mass_kg` must be a finite number",
        "a finite number",
    );
    assert_fault(
        "axis_in_joint = [0.0, 2.0, 0.0]",
        "axis_in_joint = [0.0, 1.0]",
        "axis_in_joint",
        "must be an array of 3 finite numbers",
        "an array of 3",
    );
    assert_fault(
        "id = 1\n",
        "id = 1.5\n",
        "id",
        "`id` must be a whole number from 0 to 127",
        "0 to 127",
    );
    assert_fault(
        "contact = \"actuated_wheel\"",
        "contact = \"actuatedwheel\"",
        "contact",
        "`contact` cannot be \"actuatedwheel\"",
        "did you mean `actuated_wheel`?",
    );
    assert_fault(
        "side = \"left\"",
        "side = \"front\"",
        "side",
        "`side` cannot be \"front\"",
        "valid names: `left`, `right`",
    );
    assert_fault(
        "[actuator.servo]",
        "[actuator]\nspare = 3\n[actuator.servo]",
        "spare",
        "`actuator` must be tables, written [actuator.NAME]",
        "give tables, written [actuator.NAME]",
    );
}

#[test]
fn numbers_that_are_not_finite() {
    assert_fault("mass_kg = 1.0", "mass_kg = nan", "mass_kg", "must be a finite number", "finite");
    assert_fault(
        "nominal_rad = 0.0",
        "nominal_rad = -inf",
        "nominal_rad",
        "must be a finite number",
        "finite",
    );
    assert_fault(
        "com_in_link_m = [0.0, 0.0, 0.0]",
        "com_in_link_m = [0.0, nan, 0.0]",
        "com_in_link_m",
        "3 finite numbers",
        "finite",
    );
    assert_fault(
        "torque_max_nm = 2.0",
        "torque_max_nm = 1e999",
        "torque_max_nm",
        "finite number",
        "finite",
    );
}
