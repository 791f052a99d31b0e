//! Check of the crate map in `ARCHITECTURE.md` against the manifests, and against the existing folders.
//!
//! A row of the map is `` | `folder/` | `crate` | dependencies | … ``. Rows are in the order of the data flow: a crate depends
//! only on crates above it. The third cell lists the dependencies in the crate's manifest, except those of its tests, and without
//! the common prefix of their names.

use crate::checkout::TextFile;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

const PAGE: &str = "ARCHITECTURE.md";
const PREFIX: &str = "rollwalk-";
/// Pair of crates: the first checks the plans of the second, and must therefore not depend on the second, although its row
/// is below.
const INDEPENDENT: [&str; 2] = ["rollwalk-physics", "rollwalk-planner"];

/// Row of the map.
struct Row<'a> {
    folder: &'a str,
    name: &'a str,
    dependencies: BTreeSet<&'a str>,
}

/// Returns crates and folders without a row, rows without a crate, wrong dependencies, and dependencies on crates below.
///
/// # Errors
/// Returns an error if `metadata` is not the output of `cargo metadata --no-deps`.
pub fn violations(files: &[TextFile], metadata: &str) -> Result<Vec<String>, String> {
    let Some(page) = files.iter().find(|file| file.path == PAGE) else {
        return Ok(vec![format!("{PAGE} is missing")]);
    };
    let rows: Vec<Row> = page.text.lines().filter_map(row).collect();
    let metadata: Value =
        serde_json::from_str(metadata).map_err(|error| format!("cargo metadata: {error}"))?;
    let packages = metadata["packages"].as_array().ok_or("cargo metadata: no packages")?;
    let root = metadata["workspace_root"].as_str().unwrap_or_default();
    let ours: BTreeMap<&str, &Value> =
        packages.iter().filter_map(|package| Some((package["name"].as_str()?, package))).collect();
    let mut found = folders(files, &rows);
    for name in ours.keys().filter(|name| rows.iter().all(|row| row.name != **name)) {
        found.push(format!("{PAGE}: the map lacks `{name}`"));
    }
    for (at, row) in rows.iter().enumerate().filter(|(_, row)| !row.name.is_empty()) {
        let Some(package) = ours.get(row.name) else {
            found.push(format!(
                "{PAGE}: the map has `{}`, which is not a crate of this checkout",
                row.name
            ));
            continue;
        };
        let manifest = format!("{root}/{}Cargo.toml", row.folder);
        if package["manifest_path"] != manifest.as_str() {
            found.push(format!("{PAGE}: `{}` does not lie in `{}`", row.name, row.folder));
        }
        found.extend(arrows(row, &rows[..at], package, &ours));
    }
    Ok(found)
}

/// Compares the dependencies of a crate with its row, and with the rows above it. Dependencies of tests are not in the row, but
/// must also be above.
fn arrows(row: &Row, above: &[Row], package: &Value, ours: &BTreeMap<&str, &Value>) -> Vec<String> {
    let all = package["dependencies"].as_array().into_iter().flatten();
    let all = all.filter_map(|on| Some((on["name"].as_str()?, on["kind"] == "dev")));
    let all: Vec<_> = all.filter(|(on, _)| ours.contains_key(on) && *on != row.name).collect();
    let of_library = all.iter().filter(|(_, of_tests)| !of_tests).map(|(on, _)| short(on));
    let of_library: BTreeSet<&str> = of_library.collect();
    let mut found = Vec::new();
    if of_library != row.dependencies {
        let list = of_library.into_iter().collect::<Vec<_>>().join(", ");
        found.push(format!(
            "{PAGE}: correct the dependencies of `{}`; the actual ones are: {list}",
            row.name
        ));
    }
    if all.iter().any(|(on, _)| [row.name, on] == INDEPENDENT) {
        found.push(format!(
            "{} must not depend on {}, whose plans it checks",
            row.name, INDEPENDENT[1]
        ));
    }
    for (on, _) in all.iter().filter(|(on, _)| above.iter().all(|above| above.name != *on)) {
        found.push(format!(
            "{} must not depend on {on}, because {on} is listed further down in \
                {PAGE}",
            row.name
        ));
    }
    found
}

/// Top-level folders without a row, and rows without a folder.
fn folders(files: &[TextFile], rows: &[Row]) -> Vec<String> {
    let top = |path: &str| path.split_once('/').map(|(top, _)| top.to_owned());
    let existing: BTreeSet<String> = files.iter().filter_map(|file| top(&file.path)).collect();
    let existing: BTreeSet<String> =
        existing.into_iter().filter(|folder| !folder.starts_with('.')).collect();
    let mapped: BTreeSet<String> = rows.iter().filter_map(|row| top(row.folder)).collect();
    let missing = existing.difference(&mapped);
    let missing = missing.map(|folder| format!("{PAGE}: the map lacks the folder `{folder}/`"));
    let gone = rows.iter().filter(|row| !files.iter().any(|of| of.path.starts_with(row.folder)));
    missing.chain(gone.map(|row| format!("{PAGE}: there is no `{}`", row.folder))).collect()
}

fn row(line: &str) -> Option<Row<'_>> {
    let mut cells = line.strip_prefix("| `")?.split(" | ");
    let folder = cells.next()?.strip_suffix('`').filter(|folder| folder.ends_with('/'))?;
    let name = cells.next()?.trim_matches('`');
    let dependencies = cells.next()?.split(", ").map(str::trim).filter(|on| !on.is_empty());
    Some(Row { folder, name, dependencies: dependencies.collect() })
}

fn short(name: &str) -> &str {
    name.strip_prefix(PREFIX).unwrap_or(name)
}

#[cfg(test)]
mod tests {
    use crate::checkout::file;
    use serde_json::json;

    /// Returns the violations of a map of two crates and a folder, with the given dependencies in the manifest of `rollwalk-b`.
    fn violations_of_map(map: &str, dependencies: &serde_json::Value) -> Vec<String> {
        violations_of_crates(["rollwalk-a", "rollwalk-b"], map, dependencies)
    }

    fn violations_of_crates(
        names: [&str; 2],
        map: &str,
        dependencies: &serde_json::Value,
    ) -> Vec<String> {
        let files = [
            file("ARCHITECTURE.md", map),
            file("a/Cargo.toml", ""),
            file("x/b/Cargo.toml", ""),
            file("docs/page.md", ""),
            file(".ci/run", ""),
        ];
        let package = |name: &str, folder: &str, dependencies: &serde_json::Value| {
            json!({
                "name": name,
                "manifest_path": format!("/w/{folder}/Cargo.toml"),
                "dependencies": dependencies,
            })
        };
        let a = package(names[0], "a", &json!([]));
        let packages = [a, package(names[1], "x/b", dependencies)];
        let metadata = json!({ "workspace_root": "/w", "packages": packages });
        super::violations(&files, &metadata.to_string()).unwrap()
    }

    const A: &str = "| `a/` | `rollwalk-a` |  | first |\n";
    const B: &str = "| `x/b/` | `rollwalk-b` | a | second |\n";
    const DOCS: &str = "| `docs/` |  |  | pages |\n";

    #[test]
    fn a_map_of_what_there_is_is_fine() {
        let on = json!([{ "name": "rollwalk-a" }, { "name": "serde" }]);
        assert_eq!(violations_of_map(&[A, B, DOCS].concat(), &on), [""; 0]);
        let more = json!([{ "name": "rollwalk-a" }, { "name": "rollwalk-a", "kind": "dev" }]);
        assert_eq!(violations_of_map(&[A, B, DOCS].concat(), &more), [""; 0]);
    }

    #[test]
    fn the_simulator_knows_nothing_of_the_planner_not_even_in_tests() {
        let on = json!([{ "name": "rollwalk-planner", "kind": "dev" }]);
        let map = [A, &B.replace("| a |", "|  |")[..], DOCS].concat();
        let map =
            map.replace("rollwalk-a", "rollwalk-planner").replace("rollwalk-b", "rollwalk-physics");
        let found = violations_of_crates(["rollwalk-planner", "rollwalk-physics"], &map, &on);
        assert!(found[0].contains("must not depend on rollwalk-planner"), "{found:?}");
    }

    #[test]
    fn what_differs_is_named() {
        let on = json!([{ "name": "rollwalk-a" }]);
        assert!(
            violations_of_map(&[B, A, DOCS].concat(), &on)[0]
                .contains("must not depend on rollwalk-a")
        );
        assert!(
            violations_of_map(&[A, B, DOCS].concat(), &json!([]))[0]
                .contains("correct the dependencies of `rollwalk-b`")
        );
        assert!(violations_of_map(&[A, B].concat(), &on)[0].contains("lacks the folder `docs/`"));
        let no_b = violations_of_map(&[A, DOCS].concat(), &on);
        assert!(no_b.iter().any(|one| one.contains("the map lacks `rollwalk-b`")), "{no_b:?}");
        let moved = violations_of_map(&[A, &B.replace("x/b/", "x/")[..], DOCS].concat(), &on);
        assert!(moved.iter().any(|one| one.contains("does not lie in `x/`")), "{moved:?}");
        let gone = "| `c/` | `rollwalk-c` |  | third |\n";
        let gone = violations_of_map(&[A, B, DOCS, gone].concat(), &on);
        assert!(
            gone.iter()
                .any(|one| one.contains("`rollwalk-c`, which is not a crate of this checkout"))
        );
        assert!(gone.iter().any(|one| one.contains("there is no `c/`")), "{gone:?}");
        let of_tests = json!([{ "name": "rollwalk-a" }, { "name": "rollwalk-b", "kind": "dev" }]);
        assert_eq!(violations_of_map(&[A, B, DOCS].concat(), &of_tests), [""; 0]);
    }
}
