//! The layers of the optimiser: which module may use which, read off the source.

use std::fs;
use std::path::{Path, PathBuf};

/// Modules in order: each may use itself and those before it. Modules of one line do not use each other.
const LAYERS: &[&[&str]] = &[
    &["families"],
    &["motion"],
    &["plan"],
    &["problem"],
    &["sample"],
    &["formulation"],
    &["solve"],
    &["start", "diagnose"],
    &["planning"],
    &["export", "library", "library_file", "plot", "report"],
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

#[test]
fn no_layer_uses_one_above_it() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let mut seen = 0;
    for path in files {
        // Tests may stand on any layer.
        if path.ends_with("tests.rs")
            || path.ends_with("second_opinion.rs")
            || path.ends_with("derivatives.rs")
        {
            continue;
        }
        let text = fs::read_to_string(&path).unwrap();
        let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        let inside = path.strip_prefix(&root).unwrap();
        let first = inside.components().next().unwrap();
        let module = Path::new(&first).file_stem().unwrap().to_str().unwrap();
        let lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
        for rest in lines.flat_map(|line| line.split("crate::").skip(1)) {
            let used: String =
                rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            let allowed = used == module || layer(&used) < layer(module);
            assert!(allowed, "{}: {module} uses {used}", inside.display());
            seen += 1;
        }
    }
    assert!(seen > 100, "{seen} uses of modules");
}
