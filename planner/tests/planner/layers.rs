//! Layers of the optimiser, checked on the source: permitted uses between modules, no cycles, and solvers that use rows only.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Modules in order. Each may use itself and those before it. Modules of one line do not use each other.
const LAYERS: &[&[&str]] = &[
    &["json", "cone_program"],
    &["families"],
    &["motion"],
    &["plan"],
    &["problem"],
    &["sample"],
    &["torque", "growth"],
    &["whole_body"],
    &["formulation"],
    &["solve"],
    &["start", "diagnose"],
    &["report"],
    &["planning"],
    &["receding"],
    &["sensitivity"],
    &["timing"],
    &["export", "library", "library_file", "plot"],
    &["building"],
    &["lib", "test_plans", "test_robots"],
];

fn layer(module: &str) -> usize {
    LAYERS
        .iter()
        .position(|modules| modules.contains(&module))
        .unwrap_or_else(|| panic!("{module} has no layer"))
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else {
            found.push(path);
        }
    }
}

/// Code of every file, without tests and comments, with its path below `src`.
fn code() -> Vec<(PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    // Tests may use any layer.
    files.retain(|path| {
        !["tests.rs", "second_opinion.rs", "derivatives.rs"].iter().any(|test| path.ends_with(test))
    });
    let code_of = |path: PathBuf| {
        let text = fs::read_to_string(&path).unwrap();
        let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        let lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
        let code = lines.collect::<Vec<_>>().join("\n");
        (path.strip_prefix(&root).unwrap().to_owned(), code)
    };
    files.into_iter().map(code_of).collect()
}

/// First-level module of a file.
fn module(inside: &Path) -> &str {
    let first = inside.components().next().unwrap();
    Path::new(first.as_os_str()).file_stem().unwrap().to_str().unwrap()
}

#[test]
fn no_layer_uses_one_above_it() {
    let mut seen = 0;
    for (inside, code) in code() {
        let module = module(&inside);
        for rest in code.split("crate::").skip(1) {
            let used: String =
                rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            let allowed = used == module || layer(&used) < layer(module);
            assert!(allowed, "{}: {module} uses {used}", inside.display());
            seen += 1;
        }
        // `super` leads at most to the module itself, so `crate` shows all dependencies.
        let ups = inside.components().count();
        let beyond = "super::".repeat(ups);
        assert!(!code.contains(&beyond), "{}: {beyond} leaves {module}", inside.display());
    }
    assert!(seen > 100, "{seen} uses of modules");
}

/// Items that solvers may use: rows as functions of unknowns, the columns of each slot, families for the name of the worst row,
/// and the outcome's status.
const SEEN_BY_SOLVERS: &[&str] = &[
    "families::Family",
    "families::FamilySet",
    "formulation::System",
    "formulation::rows::Columns",
    "formulation::rows::Role",
    "formulation::rows::Row",
    "formulation::rows::Rows",
    "plan::Status",
    "problem::Unknowns",
];

/// Paths after `crate::` in a piece of code, with lists in braces expanded.
fn paths(code: &str) -> Vec<String> {
    let mut found = Vec::new();
    for rest in code.split("crate::").skip(1) {
        let end = rest.find(|c: char| !c.is_alphanumeric() && !"_:".contains(c));
        let (path, rest) = rest.split_at(end.unwrap_or(rest.len()));
        let Some(list) = rest.strip_prefix('{') else {
            found.push(path.to_owned());
            continue;
        };
        let (list, _) = list.split_once('}').expect("a list ends");
        assert!(!list.contains('{'), "nested lists are not read: {list}");
        let items = list.split(',').map(str::trim).filter(|item| !item.is_empty());
        found.extend(items.map(|item| format!("{path}{item}")));
    }
    found
}

#[test]
fn solvers_see_rows_only() {
    let mut seen = 0;
    for (inside, code) in code().into_iter().filter(|(inside, _)| module(inside) == "solve") {
        for path in paths(&code) {
            let allowed = SEEN_BY_SOLVERS.iter().any(|seen| {
                path == *seen || path.strip_prefix(seen).is_some_and(|rest| rest.starts_with("::"))
            });
            assert!(allowed, "{}: a solver uses {path}", inside.display());
            seen += 1;
        }
        // The system moves the unknowns; a solver does not need their content.
        let fields = code.replace("..", " ");
        for inner in [".slots", "unknowns.placement", ".problem"] {
            assert!(!fields.contains(inner), "{}: a solver looks at `{inner}`", inside.display());
        }
    }
    assert!(seen > 10, "{seen} uses of modules");
}

/// Names of a file's module and of its parents, from the outermost. Empty for the crate's root.
fn names(inside: &Path) -> Vec<String> {
    let names = inside.with_extension("");
    let names = names.iter().map(|name| name.to_string_lossy().into_owned());
    names.filter(|name| name != "lib" && name != "mod").collect()
}

/// Modules whose files use siblings only, never an item of their parent module.
const SIBLINGS_ONLY: &[&str] = &["planning"];

#[test]
fn modules_of_a_folder_use_each_other_without_circles() {
    // For each folder and each of its modules, the names that are used there.
    let mut folders = BTreeMap::<String, BTreeMap<String, BTreeSet<String>>>::new();
    for (inside, mut code) in code() {
        let module = names(&inside);
        for ups in (1..=module.len()).rev() {
            let around = [&["crate".to_owned()], &module[..module.len() - ups]].concat();
            code = code.replace(&"super::".repeat(ups), &format!("{}::", around.join("::")));
        }
        let paths = paths(&code);
        for (depth, name) in module.iter().enumerate() {
            let folder = module[..depth].join("::");
            let uses = folders.entry(folder.clone()).or_default().entry(name.clone()).or_default();
            for path in &paths {
                let path: Vec<&str> = path.split("::").collect();
                if path.len() > depth && path[..depth] == module[..depth] && path[depth] != name {
                    uses.insert(path[depth].to_owned());
                }
            }
        }
    }
    for folder in SIBLINGS_ONLY {
        let modules = &folders[*folder];
        for (module, used) in modules {
            let other = used.iter().find(|used| !modules.contains_key(*used));
            assert_eq!(other, None, "{folder}::{module} uses it of {folder}");
        }
    }
    assert!(folders.len() > 10, "{} folders", folders.len());
    for (folder, mut uses) in folders {
        let free = |uses: &BTreeMap<String, BTreeSet<String>>| {
            let mut modules = uses.iter();
            let free = modules.find(|(_, used)| !used.iter().any(|used| uses.contains_key(used)));
            free.map(|(module, _)| module.clone())
        };
        while let Some(module) = free(&uses) {
            uses.remove(&module);
        }
        assert!(uses.is_empty(), "modules in a circle, or above one, in `{folder}`: {uses:#?}");
    }
}
