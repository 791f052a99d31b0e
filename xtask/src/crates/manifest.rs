//! Metadata of the workspace from cargo: the published crates, and the metadata that their users need.

use serde_json::Value;
use std::path::{Path, PathBuf};

/// Categories of the registry that our crates use. The registry refuses others, but only at publication.
const CATEGORIES: [&str; 10] = [
    "config",
    "embedded",
    "emulators",
    "encoding",
    "hardware-support",
    "mathematics",
    "no-std",
    "parser-implementations",
    "science::robotics",
    "simulation",
];
/// Accepted number of keywords and of categories in the registry.
const WORDS: std::ops::RangeInclusive<usize> = 1..=5;
/// Maximum length of a keyword in the registry, bytes.
const KEYWORD_BYTES: usize = 20;

/// Published crate.
#[derive(Debug, PartialEq, Eq)]
pub struct Published {
    pub name: String,
    pub version: String,
    /// Folder of the manifest.
    pub folder: PathBuf,
}

impl Published {
    /// Name of the package file, and of the folder in it.
    pub fn stem(&self) -> String {
        format!("{}-{}", self.name, self.version)
    }
}

/// Returns the published crates in the output of `cargo metadata --no-deps`.
///
/// # Errors
/// Returns an error if there is no published crate, or if `metadata` is not cargo's output.
pub fn published(metadata: &str) -> Result<Vec<Published>, String> {
    let of_package = |package: &Value| {
        let text = |key| package[key].as_str().map(str::to_owned);
        let folder = Path::new(package["manifest_path"].as_str()?).parent()?.into();
        Some(Published { name: text("name")?, version: text("version")?, folder })
    };
    let packages = packages(metadata)?;
    let published = packages.iter().filter(|package| is_published(package));
    let published: Option<Vec<_>> = published.map(of_package).collect();
    published.filter(|all| !all.is_empty()).ok_or("cargo metadata: no crate is published".into())
}

/// Returns missing and invalid metadata of the published crates.
///
/// # Errors
/// Returns an error if `metadata` is not cargo's output.
pub fn violations(metadata: &str) -> Result<Vec<String>, String> {
    let packages = packages(metadata)?;
    let mut found = Vec::new();
    for package in packages.iter().filter(|package| is_published(package)) {
        let name = package["name"].as_str().unwrap_or_default();
        for key in ["description", "license", "readme", "rust_version"] {
            if package[key].as_str().is_none_or(str::is_empty) {
                found.push(format!("{name}: {} is missing", key.replace('_', "-")));
            }
        }
        let words = |key: &str| -> Vec<&str> {
            package[key].as_array().into_iter().flatten().filter_map(Value::as_str).collect()
        };
        for key in ["keywords", "categories"] {
            if !WORDS.contains(&words(key).len()) {
                found.push(format!("{name}: give one to five {key}"));
            }
        }
        for keyword in words("keywords").iter().filter(|keyword| !is_keyword(keyword)) {
            found.push(format!(
                "{name}: the keyword `{keyword}` must begin with a letter and have at most \
                 {KEYWORD_BYTES} letters, digits, - or _"
            ));
        }
        for category in words("categories").iter().filter(|one| !CATEGORIES.contains(one)) {
            found.push(format!(
                "{name}: add the category `{category}` to CATEGORIES of this check if the registry \
                 has this category"
            ));
        }
        for dependency in package["dependencies"].as_array().into_iter().flatten() {
            found.extend(of_dependency(name, dependency, &packages));
        }
    }
    Ok(found)
}

/// Returns the defect of a dependency on another crate of the workspace. A package retains only the version of the dependency.
fn of_dependency(name: &str, dependency: &Value, packages: &[Value]) -> Option<String> {
    dependency["path"].as_str()?;
    let to = dependency["name"].as_str()?;
    let Some(package) = packages.iter().find(|package| package["name"] == to) else {
        return Some(format!("{name}: depends on {to}, which is not a crate of the workspace"));
    };
    if !is_published(package) {
        return Some(format!("{name}: depends on {to}, which is not published"));
    }
    let (version, required) = (package["version"].as_str()?, dependency["req"].as_str()?);
    // An older compatible version may lack what this version uses.
    (required != format!("^{version}")).then(|| {
        format!(
            "{name}: requires {to} {required}, but {to} has version {version}; correct the \
            root Cargo.toml, which has both versions"
        )
    })
}

fn packages(metadata: &str) -> Result<Vec<Value>, String> {
    let metadata: Value =
        serde_json::from_str(metadata).map_err(|error| format!("cargo metadata: {error}"))?;
    metadata["packages"].as_array().cloned().ok_or("cargo metadata: no packages".into())
}

/// True if cargo may publish the package to any registry. Otherwise the metadata contain a list of registries.
fn is_published(package: &Value) -> bool {
    package["publish"].is_null()
}

fn is_keyword(word: &str) -> bool {
    word.len() <= KEYWORD_BYTES
        && word.starts_with(|c: char| c.is_ascii_alphabetic())
        && word.chars().all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_')
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// Creates the metadata of a workspace with a published crate `a` that depends on `b`, and with an unpublished crate.
    fn workspace(change: impl FnOnce(&mut Value)) -> String {
        let package = |name: &str, publish: Value, dependencies: Value| {
            json!({
                "name": name, "version": "0.2.0", "publish": publish, "dependencies": dependencies,
                "manifest_path": format!("/w/{name}/Cargo.toml"),
                "description": "d", "license": "MIT", "readme": "README.md", "rust_version": "1.95",
                "keywords": ["no-std"], "categories": ["simulation"],
            })
        };
        let takes = json!([{ "name": "b", "path": "/w/b", "req": "^0.2.0" }, { "name": "serde", "req": "^1" }]);
        let (a, b) = (package("a", Value::Null, takes), package("b", Value::Null, json!([])));
        let mut all = json!({ "packages": [a, b, package("c", json!([]), json!([]))] });
        change(&mut all["packages"]);
        all.to_string()
    }

    #[test]
    fn a_crate_that_says_all_is_fine() {
        let metadata = workspace(|_| {});
        assert_eq!(violations(&metadata).unwrap(), Vec::<String>::new());
        let published = published(&metadata).unwrap();
        let stems: Vec<_> = published.iter().map(Published::stem).collect();
        assert_eq!(stems, ["a-0.2.0", "b-0.2.0"]);
        assert_eq!(published[0].folder, Path::new("/w/a"));
    }

    #[test]
    fn what_is_missing_is_named() {
        let found = |key: &str, value: Value| {
            violations(&workspace(|packages| packages[0][key] = value)).unwrap()
        };
        assert_eq!(found("description", json!("")), ["a: description is missing"]);
        assert_eq!(found("readme", Value::Null), ["a: readme is missing"]);
        assert_eq!(found("keywords", json!([])), ["a: give one to five keywords"]);
        let categories = json!(["config", "config", "config", "config", "config", "config"]);
        assert_eq!(found("categories", categories), ["a: give one to five categories"]);
        for keyword in ["trajectory-optimization", "3d", "two words"] {
            let found = found("keywords", json!([keyword]));
            assert!(found.len() == 1 && found[0].contains(keyword), "{found:?}");
        }
        assert!(found("categories", json!(["robots"]))[0].contains("`robots`"));
    }

    #[test]
    fn dependencies_must_be_found_by_users() {
        let found = |key: &str, value: Value| {
            let of_first = |packages: &mut Value| packages[0]["dependencies"][0][key] = value;
            violations(&workspace(of_first)).unwrap()
        };
        assert_eq!(found("name", json!("c")), ["a: depends on c, which is not published"]);
        assert!(found("name", json!("d"))[0].contains("not a crate of the workspace"));
        for old in ["^0.1.0", "*"] {
            let found = found("req", json!(old));
            assert!(found.len() == 1 && found[0].starts_with("a: requires b"), "{found:?}");
        }
    }

    #[test]
    fn a_workspace_that_publishes_nothing_is_refused() {
        let nothing = workspace(|packages| {
            packages.as_array_mut().unwrap().drain(..2);
        });
        assert!(published(&nothing).is_err());
        assert!(published("{}").is_err());
    }
}
