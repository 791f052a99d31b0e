//! Which crate may depend on which: the arrows of `ARCHITECTURE.md`, held by a test.

use serde_json::Value;

/// Every library crate, and this one, with the workspace crates that it may depend on. What is not listed, the
/// binaries and the tests at the end of the data flow, may depend on all.
const ALLOWED: &[(&str, &[&str])] = &[
    ("rollwalk-protocol", &[]),
    ("rollwalk-firmware", &["rollwalk-protocol"]),
    ("rollwalk-drives", &["rollwalk-protocol"]),
    ("rollwalk-robot", &["rollwalk-protocol"]),
    ("rollwalk-multibody", &["rollwalk-robot"]),
    ("rollwalk-physics", &["rollwalk-multibody", "rollwalk-robot"]),
    ("rollwalk-planner", &["rollwalk-multibody", "rollwalk-protocol", "rollwalk-robot"]),
    ("rollwalk-tracking", &["rollwalk-multibody", "rollwalk-robot"]),
    (
        "rollwalk-simulate",
        &[
            "rollwalk-multibody",
            "rollwalk-physics",
            "rollwalk-planner",
            "rollwalk-robot",
            "rollwalk-tracking",
        ],
    ),
    ("rollwalk-design", &["rollwalk-planner", "rollwalk-robot"]),
    ("rollwalk-interchange", &["rollwalk-multibody", "rollwalk-planner", "rollwalk-robot"]),
    ("rollwalk-shipped", &[]),
    (
        "rollwalk-studio",
        &[
            "rollwalk-bus",
            "rollwalk-design",
            "rollwalk-gamepads",
            "rollwalk-host",
            "rollwalk-multibody",
            "rollwalk-physics",
            "rollwalk-planner",
            "rollwalk-protocol",
            "rollwalk-robot",
            "rollwalk-shipped",
            "rollwalk-sim-host",
        ],
    ),
    ("web-time", &[]),
    (
        "rollwalk-python",
        &[
            "rollwalk-design",
            "rollwalk-multibody",
            "rollwalk-physics",
            "rollwalk-planner",
            "rollwalk-protocol",
            "rollwalk-robot",
            "rollwalk-shipped",
            "rollwalk-simulate",
        ],
    ),
    ("rollwalk-bus", &["rollwalk-protocol"]),
    ("rollwalk-host", &["rollwalk-bus", "rollwalk-protocol"]),
    ("rollwalk-gamepads", &["rollwalk-host", "rollwalk-robot"]),
    (
        "rollwalk-pilot",
        &["rollwalk-host", "rollwalk-planner", "rollwalk-protocol", "rollwalk-robot"],
    ),
    // It builds and runs the others as processes, so that its own checks need none of them.
    ("xtask", &[]),
    (
        "rollwalk-sim-host",
        &[
            "rollwalk-bus",
            "rollwalk-drives",
            "rollwalk-firmware",
            "rollwalk-multibody",
            "rollwalk-physics",
            "rollwalk-protocol",
            "rollwalk-robot",
        ],
    ),
    (
        "rollwalk-campaign",
        &[
            "rollwalk-bus",
            "rollwalk-firmware",
            "rollwalk-host",
            "rollwalk-multibody",
            "rollwalk-physics",
            "rollwalk-protocol",
            "rollwalk-robot",
            "rollwalk-sim-host",
        ],
    ),
    ("rollwalk-experiments", &["rollwalk-multibody", "rollwalk-physics"]),
    (
        "rollwalk-bench",
        &[
            "rollwalk-bus",
            "rollwalk-campaign",
            "rollwalk-design",
            "rollwalk-experiments",
            "rollwalk-multibody",
            "rollwalk-physics",
            "rollwalk-planner",
            "rollwalk-protocol",
            "rollwalk-robot",
            "rollwalk-sim-host",
            "rollwalk-simulate",
        ],
    ),
];

/// What only a crate's tests may depend on.
const ALLOWED_FOR_TESTS: &[(&str, &str)] =
    &[("rollwalk-firmware", "rollwalk-drives"), ("rollwalk-sim-host", "rollwalk-host")];

/// Dependencies against the arrows, in the output of `cargo metadata --no-deps`. Those of tests and
/// build scripts count as well.
///
/// # Errors
/// When `metadata` is not what cargo prints.
pub fn violations(metadata: &str) -> Result<Vec<String>, String> {
    let metadata: Value =
        serde_json::from_str(metadata).map_err(|error| format!("cargo metadata: {error}"))?;
    let packages = metadata["packages"].as_array().ok_or("cargo metadata: no packages")?;
    let mut found = Vec::new();
    for &(name, allowed) in ALLOWED {
        let package = packages.iter().find(|package| package["name"] == name);
        let dependencies = package.and_then(|package| package["dependencies"].as_array());
        let Some(dependencies) = dependencies else {
            found.push(format!("{name}: no such crate in the workspace"));
            continue;
        };
        for dependency in dependencies {
            let Some(to) = dependency["name"].as_str() else { continue };
            let ours = packages.iter().any(|package| package["name"] == to);
            let for_tests = dependency["kind"] == "dev" && ALLOWED_FOR_TESTS.contains(&(name, to));
            if ours && to != name && !allowed.contains(&to) && !for_tests {
                found.push(format!("{name} must not depend on {to} (ARCHITECTURE.md)"));
            }
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::{ALLOWED, ALLOWED_FOR_TESTS, violations};
    use serde_json::{Value, json};

    /// The workspace as allowed, with one dependency more, of this kind.
    fn workspace(from: &str, to: &str, kind: Option<&str>) -> String {
        let package = |&(name, allowed): &(&str, &[&str])| {
            let mut dependencies: Vec<_> = allowed.iter().map(|d| json!({ "name": d })).collect();
            dependencies.push(json!({ "name": "serde" }));
            if name == from {
                dependencies.push(json!({ "name": to, "kind": kind }));
            }
            json!({ "name": name, "dependencies": dependencies })
        };
        let packages: Vec<Value> = ALLOWED.iter().map(package).collect();
        json!({ "packages": packages }).to_string()
    }

    #[test]
    fn the_arrows_themselves_are_fine() {
        assert_eq!(violations(&workspace("", "", None)).unwrap(), Vec::<String>::new());
    }

    #[test]
    fn an_arrow_backwards_is_named() {
        for (from, to) in [
            ("rollwalk-planner", "rollwalk-firmware"),
            ("rollwalk-sim-host", "rollwalk-planner"),
            ("xtask", "rollwalk-host"),
            ("rollwalk-protocol", "rollwalk-robot"),
        ] {
            let found = violations(&workspace(from, to, None)).unwrap();
            assert_eq!(found, [format!("{from} must not depend on {to} (ARCHITECTURE.md)")]);
        }
    }

    #[test]
    fn what_tests_may_depend_on_is_for_them_alone() {
        for &(from, to) in ALLOWED_FOR_TESTS {
            let found = violations(&workspace(from, to, Some("dev"))).unwrap();
            assert_eq!(found, Vec::<String>::new());
            let found = violations(&workspace(from, to, None)).unwrap();
            assert_eq!(found, [format!("{from} must not depend on {to} (ARCHITECTURE.md)")]);
        }
    }
}
