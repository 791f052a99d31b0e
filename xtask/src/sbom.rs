//! Bills of materials of the shipped programs and board images, in CycloneDX JSON.
//!
//! cargo-cyclonedx writes them. `cargo tree` resolves dependencies independently, and reveals missing crates.

use crate::{bare_metal, shell, toolchain};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

const CARGO_CYCLONEDX: (&str, &str) = ("cargo-cyclonedx", "0.5.9");

/// Shipped package of a workspace, for a target machine.
struct Shipped {
    workspace: &'static str,
    package: &'static str,
    /// Target triple; `None` for this machine.
    target: Option<&'static str>,
}

const SHIPPED: [Shipped; 6] = [
    Shipped { workspace: ".", package: "rollwalk", target: None },
    Shipped { workspace: ".", package: "rollwalk-bench", target: None },
    Shipped { workspace: ".", package: "rollwalk-ros2", target: None },
    Shipped {
        workspace: "firmware/boards/mps2-an386",
        package: "rollwalk-mps2-an386",
        target: Some(bare_metal::CORTEX_M4F),
    },
    Shipped {
        workspace: "firmware/boards/nucleo-g474re",
        package: "rollwalk-nucleo-g474re",
        target: Some(bare_metal::CORTEX_M4F),
    },
    Shipped {
        workspace: "firmware/boards/pico2",
        package: "rollwalk-pico2",
        target: Some(bare_metal::CORTEX_M33F),
    },
];

/// Name and version of a crate.
type Crate = (String, String);

/// Writes the bills of materials into a folder (default: `sbom` of the target folder), and compares them with the crates that
/// cargo would compile.
///
/// # Errors
/// Returns an error if a shipped crate is missing in a bill. If cargo-cyclonedx is missing, the error contains the command that
/// installs it.
pub fn write(folder: Option<&Path>) -> Result<(), String> {
    let folder = folder.map_or_else(|| shell::target_folder().join("sbom"), Path::to_owned);
    let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
    fs::create_dir_all(&folder).map_err(failed)?;
    let cyclonedx = toolchain::subcommand(CARGO_CYCLONEDX)?;
    for shipped in &SHIPPED {
        let bill = folder.join(format!("{}.cdx.json", shipped.package));
        let text = shipped.bill(&cyclonedx)?;
        let (listed, compiled) = (components(&text)?, compiled(&shipped.tree()?));
        let missing: Vec<_> = compiled.difference(&listed).collect();
        if !missing.is_empty() || compiled.is_empty() {
            return Err(format!(
                "{}: crates missing from the bill of materials: {missing:?}",
                shipped.package
            ));
        }
        fs::write(&bill, text).map_err(failed)?;
        eprintln!("{}: {} crates", bill.display(), listed.len());
    }
    Ok(())
}

impl Shipped {
    fn manifest(&self) -> PathBuf {
        shell::workspace_root().join(self.workspace).join("Cargo.toml")
    }

    /// Returns the bill of materials. cargo-cyclonedx writes a bill next to the manifest of every package of the workspace; all
    /// are removed.
    fn bill(&self, cyclonedx: &str) -> Result<String, String> {
        let options = ["cyclonedx", "--quiet", "--format", "json", "--spec-version", "1.5"];
        let mut write = shell::command(cyclonedx, &options);
        write.args(["--all", "--no-build-deps", "--manifest-path"]).arg(self.manifest());
        write.args(self.features());
        write.args(self.target.iter().flat_map(|target| ["--target", target]));
        shell::run(&mut write)?;
        let mut metadata = shell::cargo(&["metadata", "--no-deps", "--format-version", "1"]);
        let metadata = shell::output(metadata.arg("--manifest-path").arg(self.manifest()))?;
        let metadata: Value = serde_json::from_str(&metadata).map_err(|error| error.to_string())?;
        let mut found =
            Err(format!("cargo-cyclonedx wrote no bill of materials for {}", self.package));
        for package in metadata["packages"].as_array().into_iter().flatten() {
            let (Some(name), Some(path)) =
                (package["name"].as_str(), package["manifest_path"].as_str())
            else {
                continue;
            };
            let bill = Path::new(path).with_file_name(format!("{name}.cdx.json"));
            if name == self.package {
                found = fs::read_to_string(&bill).map_err(|e| format!("{}: {e}", bill.display()));
            }
            // Packages without programs may have none.
            let _ = fs::remove_file(bill);
        }
        // A reader does not need the folder of this checkout.
        let root = shell::workspace_root();
        found.map(|text| text.replace(&format!("{}", root.display()), ""))
    }

    /// Option that selects the features of board images, because keys need additional crates.
    fn features(&self) -> Option<&'static str> {
        self.target.map(|_| "--all-features")
    }

    /// Lists the compiled crates of the package, one per line.
    fn tree(&self) -> Result<String, String> {
        let mut tree = shell::cargo(&["tree", "--locked", "--edges", "normal", "--prefix", "none"]);
        tree.arg("--manifest-path").arg(self.manifest()).args(["--package", self.package]);
        tree.args(self.target.iter().flat_map(|target| ["--target", target])).args(self.features());
        shell::output(&mut tree)
    }
}

/// Crates in the output of `cargo tree --prefix none`: `name v1.2.3 (where) (*)`.
fn compiled(tree: &str) -> BTreeSet<Crate> {
    let of_line = |line: &str| {
        let mut words = line.split_whitespace();
        let (name, version) = (words.next()?, words.next()?.strip_prefix('v')?);
        Some((name.to_owned(), version.to_owned()))
    };
    tree.lines().filter_map(of_line).collect()
}

/// Returns the crates of a bill of materials, including its subject.
fn components(bill: &str) -> Result<BTreeSet<Crate>, String> {
    let bill: Value = serde_json::from_str(bill).map_err(|error| {
        format!(
            "the bill of materials is \
        not JSON: {error}"
        )
    })?;
    if bill["bomFormat"] != "CycloneDX" {
        return Err("the bill of materials is not in the CycloneDX format".into());
    }
    let components = bill["components"].as_array().into_iter().flatten();
    let crates = components.chain([&bill["metadata"]["component"]]).filter_map(|component| {
        let text = |key| component[key].as_str().map(str::to_owned);
        Some((text("name")?, text("version")?))
    });
    Ok(crates.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crate_that_a_bill_lacks_is_found() {
        let tree = "robot v0.1.0 (/somewhere)\nlibm v0.2.16\nserde v1.0.228\nlibm v0.2.16 (*)\n\n";
        let bill = r#"{"bomFormat": "CycloneDX", "metadata": {"component": {"name": "robot", "version": "0.1.0"}},
            "components": [{"name": "libm", "version": "0.2.15"}, {"name": "serde", "version": "1.0.228"}]}"#;
        let (listed, compiled) = (components(bill).unwrap(), compiled(tree));
        let missing: Vec<_> = compiled.difference(&listed).collect();
        assert_eq!(missing, [&("libm".to_owned(), "0.2.16".to_owned())]);
        assert_eq!(compiled.len(), 3);
        assert!(components("{}").is_err());
    }
}
